//! Loops: the steps of a scenario in the order in which they are played.

use crate::scenario::expression::{Counter, Scope};
use crate::scenario::language::Language;
use crate::scenario::problem::{Problem, TextSpan};
use crate::scenario::syntax::{Action, Step};

/// Maximum number of steps of a scenario, including the repetitions of its loops.
const MAX_STEPS: usize = 200_000;

/// A loop under way.
#[derive(Debug)]
struct Loop {
    counter: Counter,
    /// The place of its first step.
    body: usize,
    now: i64,
    to: i64,
    /// The value of the counter outside the loop.
    outside: Option<i64>,
}

/// Every step with the scope in which it is played.
#[derive(Debug)]
pub struct Unroll<'s, L: Language> {
    steps: &'s [Step<L>],
    next: usize,
    scope: Scope,
    loops: Vec<Loop>,
    played: usize,
}

impl<'s, L: Language> Unroll<'s, L> {
    /// The steps of a scenario whose loops are whole, as the parser has checked. Numbers of loops refer to ring 1.
    pub const fn new(steps: &'s [Step<L>], scope: Scope) -> Self {
        Self {
            steps,
            next: 0,
            scope,
            loops: Vec::new(),
            played: 0,
        }
    }

    /// Whether the last step is inside a loop.
    pub(crate) const fn in_loop(&self) -> bool {
        !self.loops.is_empty()
    }

    fn begin(&mut self, counter: Counter, from: i64, to: i64) {
        self.loops.push(Loop {
            counter,
            body: self.next,
            now: from,
            to,
            outside: self.scope.counter(counter),
        });
        self.scope = self.scope.with(counter, Some(from));
    }

    fn end(&mut self) {
        let Some(innermost) = self.loops.last_mut() else {
            return;
        };
        if innermost.now == innermost.to {
            self.scope = self.scope.with(innermost.counter, innermost.outside);
            self.loops.pop();
            return;
        }
        innermost.now += (innermost.to - innermost.now).signum();
        self.scope = self.scope.with(innermost.counter, Some(innermost.now));
        self.next = innermost.body;
    }
}

impl<'s, L: Language> Iterator for Unroll<'s, L> {
    type Item = Result<(&'s Step<L>, Scope), Problem>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let step = self.steps.get(self.next)?;
            self.next += 1;
            self.played += 1;
            if self.played > MAX_STEPS {
                self.next = self.steps.len();
                return Some(Err(too_many(step.span)));
            }
            match &step.action {
                Action::For(counter, from, to) => {
                    let ends = from.value(self.scope).and_then(|from| {
                        let to = to.value(self.scope)?;
                        Ok((from, to))
                    });
                    match ends {
                        Ok((from, to)) => self.begin(*counter, from, to),
                        Err(problem) => {
                            self.next = self.steps.len();
                            return Some(Err(problem));
                        }
                    }
                }
                Action::End => self.end(),
                _ => return Some(Ok((step, self.scope))),
            }
        }
    }
}

fn too_many(span: TextSpan) -> Problem {
    Problem::new(
        span,
        format!("the loops of the scenario unroll to more than {MAX_STEPS} steps"),
        "loops with fewer turns expected",
    )
}
