//! A walk through the states of a model: each of them with each input, as far as the guard admits it.
//!
//! A bus supplies a model with its inputs ([`WalkModel`]). What is planned depends on the model and on what the rig's file permits, and on
//! nothing that a drive has sent: a record names the same conversations when it is judged again.

use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// A right drive as it is before the next input, behind the guard that judges what is sent to it.
pub trait WalkModel: Clone {
    /// What distinguishes its states.
    type State: Ord + Clone;

    fn state(&self) -> Self::State;

    /// Whether an input has a meaning in the present state. If not, the two are no pair that is walked.
    fn takes(&self, _input: usize) -> bool {
        true
    }

    /// Sends an input, and asks the drive for what shows its effect: the lines of a scenario.
    ///
    /// # Errors
    /// Why the input is left out, such as what it needs in the rig's file. The model must not be used any more.
    fn put(&mut self, input: usize) -> Result<Vec<String>, String>;

    /// Its clock, which begins at [`Instant::START`].
    fn now(&self) -> Instant;
}

/// Maximum durations of a walk, in bus time.
#[derive(Clone, Copy, Debug)]
pub struct WalkBounds {
    /// Of each conversation; it ends with the first input that exceeds this.
    pub conversation: Span,
    /// Of all conversations together.
    pub all: Span,
}

/// A conversation of a walk. It begins where the walk begins.
#[derive(Debug)]
pub struct WalkPart<S> {
    pub lines: Vec<String>,
    /// The pairs of a state and an input that it walks first.
    pub walked: BTreeSet<(S, usize)>,
}

#[derive(Debug)]
pub struct Walk<S> {
    pub parts: Vec<WalkPart<S>>,
    /// Pairs of a state and an input that are left out, by the reason.
    pub denied: BTreeMap<String, BTreeSet<(S, usize)>>,
    /// Pairs that were not reached within the bounds.
    pub left: BTreeSet<(S, usize)>,
}

/// Walks a model from its present state with this number of inputs, to the pairs that none of the parts `before` has walked.
pub fn walk<M: WalkModel>(
    start: &M,
    inputs: usize,
    bounds: WalkBounds,
    before: &[WalkPart<M::State>],
) -> Walk<M::State> {
    let before = before.iter().flat_map(|part| part.walked.iter().cloned());
    let mut walker = Walker {
        inputs,
        ways: BTreeMap::new(),
        walked: before.collect(),
        walk: Walk {
            parts: Vec::new(),
            denied: BTreeMap::new(),
            left: BTreeSet::new(),
        },
    };
    let mut past = Span::ZERO;
    while past < bounds.all {
        let mut model = start.clone();
        let part = walker.conversation(&mut model, bounds.conversation);
        // Ways alone show nothing new.
        if part.walked.is_empty() {
            break;
        }
        past = past + model.now().since(Instant::START);
        walker.walk.parts.push(part);
    }
    walker.end()
}

/// Where an input leads from a state; `None` where it is not admitted there.
type Ways<S> = Vec<Option<S>>;

struct Walker<S> {
    inputs: usize,
    ways: BTreeMap<S, Ways<S>>,
    walked: BTreeSet<(S, usize)>,
    walk: Walk<S>,
}

impl<S: Ord + Clone> Walker<S> {
    /// Plans one conversation; it walks no pair if none can be reached any more.
    fn conversation<M: WalkModel<State = S>>(&mut self, model: &mut M, most: Span) -> WalkPart<S> {
        let mut part = WalkPart {
            lines: Vec::new(),
            walked: BTreeSet::new(),
        };
        // What comes before may decide that an input is left out here, which the state does not tell.
        let mut refused = BTreeSet::new();
        while model.now().since(Instant::START) < most {
            let here = model.state();
            self.explore(model, &here);
            let Some(input) = self.next(&here, &refused) else {
                break;
            };
            let mut there = model.clone();
            match there.put(input) {
                Ok(lines) => part.lines.extend(lines),
                Err(why) => {
                    let denied = self.walk.denied.entry(why).or_default();
                    denied.insert((here, input));
                    refused.insert(input);
                    continue;
                }
            }
            if let Some(ways) = self.ways.get_mut(&here) {
                ways[input] = Some(there.state());
            }
            if self.walked.insert((here.clone(), input)) {
                part.walked.insert((here, input));
            }
            *model = there;
            refused.clear();
        }
        part
    }

    /// Finds out where each input leads from a state that the model is in for the first time.
    fn explore<M: WalkModel<State = S>>(&mut self, model: &M, here: &S) {
        if self.ways.contains_key(here) {
            return;
        }
        let ways = (0..self.inputs).map(|input| {
            if !model.takes(input) {
                return None;
            }
            let mut there = model.clone();
            match there.put(input) {
                Ok(_) => Some(there.state()),
                Err(why) => {
                    let denied = self.walk.denied.entry(why).or_default();
                    denied.insert((here.clone(), input));
                    None
                }
            }
        });
        let ways = ways.collect();
        self.ways.insert(here.clone(), ways);
    }

    fn is_new(&self, state: &S, input: usize) -> bool {
        !self.walked.contains(&(state.clone(), input))
    }

    /// The next input that was not refused: a new one that keeps the state, then any new one, then the first of the shortest way to one.
    fn next(&self, here: &S, refused: &BTreeSet<usize>) -> Option<usize> {
        let ways = self.ways.get(here)?;
        let new = |stays: bool| {
            (0..self.inputs).find(|input| {
                let leads = ways[*input].as_ref();
                let leads = leads.is_some_and(|there| (there == here) == stays);
                leads && self.is_new(here, *input) && !refused.contains(input)
            })
        };
        new(true)
            .or_else(|| new(false))
            .or_else(|| self.way(here, refused))
    }

    /// The first input of the shortest way to a state in which an input is new; it was not refused.
    fn way(&self, here: &S, refused: &BTreeSet<usize>) -> Option<usize> {
        let mut seen = BTreeSet::from([here]);
        let mut reached = VecDeque::from([(here, None)]);
        while let Some((state, first)) = reached.pop_front() {
            let Some(ways) = self.ways.get(state) else {
                return first;
            };
            for (input, leads) in ways.iter().enumerate() {
                let Some(there) = leads else { continue };
                if first.is_none() && refused.contains(&input) {
                    continue;
                }
                let first = first.or(Some(input));
                if self.is_new(state, input) && state != here {
                    return first;
                }
                if seen.insert(there) {
                    reached.push_back((there, first));
                }
            }
        }
        None
    }

    /// The walk, with what it has left out.
    fn end(mut self) -> Walk<S> {
        for denied in self.walk.denied.values_mut() {
            denied.retain(|pair| !self.walked.contains(pair));
        }
        self.walk.denied.retain(|_, denied| !denied.is_empty());
        let denied: BTreeSet<_> = self.walk.denied.values().flatten().collect();
        let leads = |state: &S, input: usize| match self.ways.get(state) {
            Some(ways) => ways[input].is_some(),
            // Nothing is known of a state that was never reached.
            None => true,
        };
        let reached = self.ways.values().flatten().flatten();
        let states: BTreeSet<&S> = self.ways.keys().chain(reached).collect();
        let all = states.into_iter().flat_map(|state| {
            let inputs = 0..self.inputs;
            inputs.map(move |input| (state, input))
        });
        let left = all.filter(|(state, input)| leads(state, *input));
        let left = left.map(|(state, input)| (state.clone(), input));
        let left = left.filter(|pair| !self.walked.contains(pair) && !denied.contains(pair));
        self.walk.left = left.collect();
        self.walk
    }
}

impl<S: Ord> Walk<S> {
    /// Appends the conversations of another walk, one with more permissions, and takes its left-out pairs.
    #[must_use]
    pub fn then(mut self, other: Self) -> Self {
        self.parts.extend(other.parts);
        Self {
            parts: self.parts,
            ..other
        }
    }

    /// Adds a walk with other inputs, in conversations of its own.
    #[must_use]
    pub fn beside(mut self, other: Self) -> Self {
        self.parts.extend(other.parts);
        for (why, pairs) in other.denied {
            self.denied.entry(why).or_default().extend(pairs);
        }
        self.left.extend(other.left);
        self
    }

    /// The lines that say what was walked and what was not, by the names of the inputs. `played` says whether the part at a place has passed or failed.
    #[must_use]
    pub fn told(&self, names: &[&str], played: impl Fn(usize) -> bool) -> String {
        let (played, skipped): (Vec<_>, Vec<_>) = self
            .parts
            .iter()
            .enumerate()
            .partition(|(place, _)| played(*place));
        let count = |parts: &[(usize, &WalkPart<S>)]| -> usize {
            parts.iter().map(|(_, part)| part.walked.len()).sum()
        };
        let (walked, skipped) = (count(&played), count(&skipped));
        let denied: usize = self.denied.values().map(BTreeSet::len).sum();
        let all = walked + skipped + denied + self.left.len();
        let mut text = format!("walked: {walked} of {all} pairs of a state and an input\n");
        for (why, pairs) in &self.denied {
            let inputs: BTreeSet<_> = pairs.iter().map(|(_, input)| names[*input]).collect();
            let inputs: Vec<_> = inputs.into_iter().collect();
            text.push_str(&format!(
                "  {} left out, {why}: {}\n",
                pairs.len(),
                inputs.join(", ")
            ));
        }
        for (number, why) in [
            (skipped, "in conversations without a verdict"),
            (
                self.left.len(),
                "not reached in the time that a walk may take",
            ),
        ] {
            if number > 0 {
                text.push_str(&format!("  {number} {why}\n"));
            }
        }
        text
    }
}

/// The walk of a drive of a rig.
#[derive(Debug)]
pub struct DriveWalk<S> {
    /// The drive as a scenario names it, such as `slave 8`; nothing where it is alone.
    pub drive: String,
    pub walk: Walk<S>,
}

impl<S: Ord> DriveWalk<S> {
    /// Its conversations, with names behind `prefix` and the texts that a bus makes of their lines.
    pub fn conversations(&self, prefix: &str, text: impl Fn(&[String]) -> String) -> Vec<Source> {
        let parts = self.walk.parts.iter().enumerate();
        let sources = parts.map(|(place, part)| Source {
            name: format!("{prefix}{}", self.name(place)),
            text: text(&part.lines).into(),
        });
        sources.collect()
    }

    /// The name of the conversation at a place, such as `walk-1-slave-8`.
    fn name(&self, place: usize) -> String {
        let name = format!("walk-{} {}", place + 1, self.drive);
        name.trim_end().replace(' ', "-")
    }

    /// The lines that say what was walked in these attempts, by name and verdict, and what was not: see [`Walk::told`].
    pub fn told(&self, names: &[&str], prefix: &str, attempts: &[(&str, Verdict)]) -> String {
        let told = self.walk.told(names, |place| {
            let name = format!("{prefix}{}", self.name(place));
            let judged = [Verdict::Passed, Verdict::Failed];
            let mut attempts = attempts.iter();
            attempts.any(|(attempt, verdict)| *attempt == name && judged.contains(verdict))
        });
        format!("{} {told}", self.drive).trim_start().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A door: open, closed or locked. Input 0 looks, 1 opens or closes, 2 turns the key, 3 is never admitted, 4 means something nowhere.
    #[derive(Clone)]
    struct Door(u8, Instant);

    impl WalkModel for Door {
        type State = u8;

        fn state(&self) -> u8 {
            self.0
        }

        fn takes(&self, input: usize) -> bool {
            input != 4
        }

        fn put(&mut self, input: usize) -> Result<Vec<String>, String> {
            self.1 += Span::from_millis(10);
            self.0 = match (self.0, input) {
                (_, 3) => return Err("needs a hammer".to_owned()),
                (0, 1) => 1,
                (1, 1) => 0,
                (1, 2) => 2,
                (2, 2) => 1,
                (state, _) => state,
            };
            Ok(vec![format!("{input}")])
        }

        fn now(&self) -> Instant {
            self.1
        }
    }

    fn of(bounds: WalkBounds) -> Walk<u8> {
        walk(&Door(0, Instant::START), 5, bounds, &[])
    }

    fn walked(walk: &Walk<u8>) -> usize {
        walk.parts.iter().map(|part| part.walked.len()).sum()
    }

    #[test]
    fn every_input_is_put_in_every_state() {
        let bounds = WalkBounds {
            conversation: Span::from_millis(1_000),
            all: Span::from_millis(10_000),
        };
        let planned = of(bounds);
        assert_eq!(walked(&planned), 9, "{planned:?}");
        assert_eq!(planned.denied["needs a hammer"].len(), 3);
        assert!(planned.left.is_empty(), "{planned:?}");
        assert_eq!(planned.parts.len(), 1);
        // Nothing is new after it.
        let again = walk(&Door(0, Instant::START), 5, bounds, &planned.parts);
        assert!(again.parts.is_empty(), "{again:?}");
    }

    /// Every conversation begins at the start, and what time does not permit is said.
    #[test]
    fn what_a_bound_cuts_off_is_left() {
        let several = of(WalkBounds {
            conversation: Span::from_millis(60),
            all: Span::from_millis(10_000),
        });
        assert!(several.parts.len() > 1);
        assert!(several.left.is_empty(), "{several:?}");
        let cut = of(WalkBounds {
            conversation: Span::from_millis(60),
            all: Span::from_millis(60),
        });
        assert_eq!(cut.parts.len(), 1);
        assert_eq!(cut.parts[0].lines.len(), 6);
        assert!(!cut.left.is_empty(), "{cut:?}");
    }

    #[test]
    fn what_was_not_walked_is_said() {
        let planned = of(WalkBounds {
            conversation: Span::from_millis(60),
            all: Span::from_millis(10_000),
        });
        let names = ["a look", "a push", "a turn of the key", "a blow", "a word"];
        let all = planned.told(&names, |_| true);
        assert_eq!(
            all,
            "walked: 9 of 12 pairs of a state and an input\n  3 left out, needs a hammer: a blow\n"
        );
        let first = planned.told(&names, |place| place == 0);
        let skipped = 9 - planned.parts[0].walked.len();
        assert!(
            first.contains(&format!("{skipped} in conversations without a verdict")),
            "{first}"
        );
    }

    /// What a drive has sent in an attempt without a verdict was not judged.
    #[test]
    fn attempts_without_a_verdict_walk_nothing() {
        let walk = of(WalkBounds {
            conversation: Span::from_millis(1_000),
            all: Span::from_millis(10_000),
        });
        let drive = DriveWalk {
            drive: "slave 8".to_owned(),
            walk,
        };
        let names = ["a look", "a push", "a turn of the key", "a blow", "a word"];
        let walked = |verdict| drive.told(&names, "q-", &[("q-walk-1-slave-8", verdict)]);
        for verdict in [Verdict::Passed, Verdict::Failed] {
            let told = walked(verdict);
            assert!(told.starts_with("slave 8 walked: 9 of 12 "), "{told}");
        }
        for verdict in [Verdict::Inconclusive, Verdict::Skipped] {
            let told = walked(verdict);
            assert!(told.starts_with("slave 8 walked: 0 of 12 "), "{told}");
        }
    }
}
