//! Arithmetic over the ring's size and the counters of loops, so that one file serves rings of any size: `N-1`, `last`, `N/2+1`, `k-N`.

use super::problem::{Problem, TextSpan};
use super::scanner::Scanner;
use std::fmt::{self, Display};

/// How deep parentheses may nest.
const MAX_DEPTH: u32 = 32;
/// How many terms a sum, or factors a product, may have.
const MAX_TERMS: usize = 32;

/// The values that an expression can refer to: the ring's size and the counters of the loops around a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scope {
    size: i64,
    counters: [Option<i64>; 26],
}

impl Scope {
    /// A ring of `size` drives, outside every loop.
    #[must_use]
    pub const fn new(size: i64) -> Self {
        Self {
            size,
            counters: [None; 26],
        }
    }

    /// The same with another value of a counter; `None` outside its loop.
    #[must_use]
    pub fn with(mut self, counter: Counter, value: Option<i64>) -> Self {
        if let Some(counter) = self.counters.get_mut(counter.place()) {
            *counter = value;
        }
        self
    }

    /// The value of a counter; `None` outside its loop.
    #[must_use]
    pub fn counter(&self, counter: Counter) -> Option<i64> {
        self.counters.get(counter.place()).copied().flatten()
    }

    /// The same counters with another ring size.
    #[must_use]
    pub const fn of_ring(self, size: i64) -> Self {
        Self { size, ..self }
    }
}

/// The counter of a loop: a letter from `a` to `z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counter(char);

impl Counter {
    /// The counter of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let mut letters = name.chars();
        let letter = letters.next().filter(char::is_ascii_lowercase)?;
        letters.next().is_none().then_some(Self(letter))
    }

    fn place(self) -> usize {
        usize::from(u8::try_from(self.0).unwrap_or(b'a') - b'a')
    }
}

impl fmt::Display for Counter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A number that may depend on N, the number of drives in the ring, and on the counters of loops.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Expression {
    Number(i64),
    /// `N`: how many drives the ring has.
    Size,
    /// `last`: N-1, the highest drive number.
    Last,
    /// The counter of a loop around the line.
    Counter(Counter),
    /// Two numbers and an operator.
    Operation(Box<Expression>, Operator, Box<Expression>),
}

/// An operator on two numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`, the rest thrown away
    Divide,
    /// `%`, the rest
    Remainder,
    /// `&`, bit by bit
    And,
    /// `|`, bit by bit
    Or,
    /// `^`, bit by bit
    ExclusiveOr,
}

/// An expression with its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located {
    pub expression: Expression,
    pub span: TextSpan,
}

impl Located {
    /// The value in this scope.
    ///
    /// # Errors
    /// The number has no value: a division by zero, too large, or a counter outside its loop.
    pub fn value(&self, scope: Scope) -> Result<i64, Problem> {
        if let Some(counter) = self.expression.outside(scope) {
            return Err(Problem::new(
                self.span,
                format!("`{counter}` is used outside a loop that counts with it"),
                "a number, `N`, `last` or the counter of a loop expected here",
            )
            .help(format!("`for {counter} in 0..last` begins such a loop")));
        }
        self.expression.value(scope).ok_or_else(|| {
            Problem::new(
                self.span,
                "the number has no value: a division by zero, or too large",
                "this number",
            )
        })
    }

    /// A number without a place in a text.
    #[must_use]
    pub const fn number(value: i64) -> Self {
        Self {
            expression: Expression::Number(value),
            span: TextSpan { start: 0, end: 0 },
        }
    }
}

impl Operator {
    /// The sign of the operator.
    const fn sign(self) -> char {
        match self {
            Self::Add => '+',
            Self::Subtract => '-',
            Self::Multiply => '*',
            Self::Divide => '/',
            Self::Remainder => '%',
            Self::And => '&',
            Self::Or => '|',
            Self::ExclusiveOr => '^',
        }
    }

    /// Whether it joins the terms of a sum; the others join the factors of a product.
    const fn joins_terms(self) -> bool {
        matches!(
            self,
            Self::Add | Self::Subtract | Self::Or | Self::ExclusiveOr
        )
    }
}

impl fmt::Display for Located {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.expression.fmt(f)
    }
}

impl fmt::Display for Expression {
    /// As the language writes it, with the parentheses that it needs and no others.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Size => f.write_str("N"),
            Self::Last => f.write_str("last"),
            Self::Counter(counter) => counter.fmt(f),
            Self::Operation(left, operator, right) => {
                let sum = |side: &Self| matches!(side, Self::Operation(_, inner, _) if inner.joins_terms());
                let product = |side: &Self| matches!(side, Self::Operation(..)) && !sum(side);
                let of_terms = operator.joins_terms();
                parenthesized(f, left, sum(left) && !of_terms)?;
                write!(f, "{}", operator.sign())?;
                parenthesized(f, right, sum(right) || product(right) && !of_terms)
            }
        }
    }
}

fn parenthesized(f: &mut fmt::Formatter<'_>, side: &Expression, needed: bool) -> fmt::Result {
    match needed {
        true => write!(f, "({side})"),
        false => side.fmt(f),
    }
}

impl Expression {
    /// A counter that has no value there.
    fn outside(&self, scope: Scope) -> Option<Counter> {
        match self {
            Self::Counter(counter) if scope.counter(*counter).is_none() => Some(*counter),
            Self::Operation(left, _, right) => left.outside(scope).or_else(|| right.outside(scope)),
            _ => None,
        }
    }

    fn value(&self, scope: Scope) -> Option<i64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Size => Some(scope.size),
            Self::Last => scope.size.checked_sub(1),
            Self::Counter(counter) => scope.counter(*counter),
            Self::Operation(left, operator, right) => {
                let (left, right) = (left.value(scope)?, right.value(scope)?);
                match operator {
                    Operator::Add => left.checked_add(right),
                    Operator::Subtract => left.checked_sub(right),
                    Operator::Multiply => left.checked_mul(right),
                    Operator::Divide => left.checked_div(right),
                    Operator::Remainder => left.checked_rem(right),
                    Operator::And => Some(left & right),
                    Operator::Or => Some(left | right),
                    Operator::ExclusiveOr => Some(left ^ right),
                }
            }
        }
    }
}

/// Reads a number without arithmetic.
pub fn plain(scanner: &mut Scanner<'_>) -> Result<i64, Problem> {
    let mut ahead = scanner.clone();
    let digits = ahead.take_while(|c| c.is_ascii_digit());
    match digits.and_then(|digits| digits.value.parse().ok()) {
        Some(number) => {
            *scanner = ahead;
            Ok(number)
        }
        None => Err(scanner.unexpected("a number such as 1024")),
    }
}

/// Reads a sum.
pub fn sum(scanner: &mut Scanner<'_>) -> Result<Located, Problem> {
    let here = scanner.here();
    let expression = sum_at(scanner, 0)?;
    Ok(Located {
        expression,
        span: scanner.since(here),
    })
}

fn sum_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    let mut left = product_at(scanner, depth)?;
    for _ in 0..MAX_TERMS {
        // `98->97` is a link, not a subtraction.
        let operator = if scanner.rest().starts_with("->") {
            return Ok(left);
        } else if scanner.eat("+") {
            Operator::Add
        } else if scanner.eat("-") {
            Operator::Subtract
        } else if scanner.eat("|") {
            Operator::Or
        } else if scanner.eat("^") {
            Operator::ExclusiveOr
        } else {
            return Ok(left);
        };
        let right = product_at(scanner, depth)?;
        left = Expression::Operation(Box::new(left), operator, Box::new(right));
    }
    Err(scanner.unexpected("a sum of fewer terms"))
}

fn product_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    let mut left = factor_at(scanner, depth)?;
    for _ in 0..MAX_TERMS {
        let operator = if scanner.eat("*") {
            Operator::Multiply
        } else if scanner.eat("/") {
            Operator::Divide
        } else if scanner.eat("%") {
            Operator::Remainder
        } else if scanner.eat("&") {
            Operator::And
        } else {
            return Ok(left);
        };
        let right = factor_at(scanner, depth)?;
        left = Expression::Operation(Box::new(left), operator, Box::new(right));
    }
    Err(scanner.unexpected("a product of fewer factors"))
}

fn factor_at(scanner: &mut Scanner<'_>, depth: u32) -> Result<Expression, Problem> {
    if depth > MAX_DEPTH {
        return Err(scanner.unexpected("a number with fewer parentheses"));
    }
    if scanner.eat("(") {
        let inner = sum_at(scanner, depth + 1)?;
        if !scanner.eat(")") {
            return Err(scanner.unexpected("`)`"));
        }
        return Ok(inner);
    }
    let before = scanner.clone();
    if let Some(digits) = scanner.take_while(|c| c.is_ascii_digit()) {
        return match digits.value.parse() {
            Ok(number) => Ok(Expression::Number(number)),
            Err(_) => Err(Problem::new(
                digits.span,
                format!("{} is too large", digits.value),
                "a smaller number expected here",
            )),
        };
    }
    if let Some(name) = scanner.take_while(|c| c.is_ascii_alphabetic()) {
        return match name.value {
            "N" => Ok(Expression::Size),
            "last" => Ok(Expression::Last),
            other => {
                if let Some(counter) = Counter::named(other) {
                    return Ok(Expression::Counter(counter));
                }
                *scanner = before;
                Err(scanner
                    .unexpected("a number, `N` or `last`")
                    .did_you_mean(other, &["N", "last"]))
            }
        };
    }
    Err(scanner.unexpected("a number, `N` or `last`"))
}
