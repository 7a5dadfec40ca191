//! Whether a line that was not met accuses a slave.

use super::rehearse::Other;
use super::{Left, Own, Player};
use crate::rig::known::value_of;
use crate::rig::observed::Came;
use crate::rig::settle::{Assumed, search};
use crate::rig::talk::TalkError;
use harness_bench::rig::segment::observed::LinkTimes;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::run::outcome::Unready;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::decode::Decoded;
use harness_proto::nordac::properties::{Description, PROPERTIES};
use harness_proto::profibus::Telegram;
use harness_proto::time::Span;

/// How many of these octets are a telegram; all of them where they do not begin with one.
fn telegram(octets: &[u8]) -> usize {
    match Telegram::decode(octets) {
        Decoded::Value { used, .. } => used,
        _ => octets.len(),
    }
}

impl Player {
    /// The outcome where the slaves could not be made ready.
    pub(super) fn unanswered(&mut self, own: &Own, error: &TalkError, left: &Left) -> Outcome {
        let remark = error.to_string();
        let exact = left.way.tolerance == Span::ZERO;
        let silent = matches!(error, TalkError::NoReply { .. });
        let what = if silent {
            Unready::NoAnswer
        } else {
            Unready::Differs
        };
        match error {
            TalkError::Line(trouble) => Outcome::trouble(trouble),
            TalkError::OtherThanProfile { .. } => Outcome::rig_error(remark),
            // A simulated slave is there, and its line has no faults.
            _ if self.known.is_none() && exact => {
                self.unable = Some(remark.clone());
                Outcome::not_ready(Verdict::Failed, what, remark)
            }
            // Nothing was ever heard of it.
            _ if self.known.is_none() && !left.heard => Outcome::rig_error(remark),
            _ if self.known.is_none() => Outcome::not_ready(Verdict::Inconclusive, what, remark),
            _ if exact && self.excused(own, left).is_none() => {
                Outcome::not_ready(Verdict::Failed, what, remark)
            }
            TalkError::NoReply { .. } if !exact => {
                Outcome::not_ready(Verdict::Failed, what, remark)
            }
            // A slave may have reasons of its own to refuse a parameter.
            _ => Outcome::not_ready(Verdict::Inconclusive, what, remark),
        }
    }

    /// Whether a line that was not met accuses the slave.
    pub(super) fn judged(&mut self, own: &Own, outcome: Outcome, left: &Left) -> Outcome {
        if outcome.verdict != Verdict::Failed {
            return outcome.judged_by(&own.plan);
        }
        let way = left.way;
        let late = way.late.max(way.longest);
        let why = if way.tolerance == Span::ZERO {
            self.explained(own, left).map(|with| {
                format!("a right slave with {with} does the same, and this is not known")
            })
        } else if late > way.tolerance {
            Some(format!(
                "the computer or the adapter was late by {late}: this may not be the slave's fault"
            ))
        } else {
            self.left_open(own, way, left.switches).map(|property| {
                format!(
                    "a right slave with {property} does not meet it either, and this is not known"
                )
            })
        };
        match why {
            None => outcome,
            Some(why) => Outcome {
                verdict: Verdict::Inconclusive,
                remarks: std::iter::once(why).chain(outcome.remarks).collect(),
                ..outcome
            },
        }
    }

    /// The same as [`Self::explained`], unless a slave was proven wrong before.
    fn excused(&mut self, own: &Own, left: &Left) -> Option<String> {
        if self.proven {
            return None;
        }
        let excuse = self.explained(own, left);
        self.proven = excuse.is_none() && self.slaves.len() == 1;
        excuse
    }

    /// In what right slaves that send the very same octets differ from what is known of the slaves; `None` if no right slaves send them.
    fn explained(&self, own: &Own, left: &Left) -> Option<String> {
        let base: Assumed = self.known().iter().map(|own| own.properties).collect();
        let open: Vec<Vec<_>> = self
            .known()
            .iter()
            .map(|known| {
                PROPERTIES
                    .iter()
                    .filter(|own| !known.is_settled(own))
                    .collect()
            })
            .collect();
        let may = |place: usize, property: &Description| {
            open[place].iter().any(|own| own.name == property.name)
        };
        let came = |all: &Assumed| -> Came {
            let other = Other {
                properties: Some(all),
                switches: left.switches,
                came: Some(&left.came),
                ..Other::default()
            };
            self.rehearse(own, &self.limits, other).came
        };
        let found = search(&base, may, |all| came(all).agrees(&left.came));
        let (_, found) = found.into_iter().next()?;
        let mut words = Vec::new();
        for (known, found) in base.iter().zip(&found) {
            for property in PROPERTIES {
                let value = value_of(property, found);
                if value != value_of(property, known) {
                    words.push(format!("{} = {value}", property.name));
                }
            }
        }
        Some(words.join(", "))
    }

    /// A difference from the model with which a right slave does not meet the scenario either: another value of a point that the manual leaves
    /// open, or times at which telegrams leave.
    fn left_open(&self, own: &Own, way: LinkTimes, switches: bool) -> Option<String> {
        let fails = |other: Other<'_>| {
            let other = Other { switches, ..other };
            !self.rehearse(own, &self.limits, other).passes()
        };
        for slow in way.slow() {
            let other = Other {
                slow: Some(slow),
                ..Other::default()
            };
            if fails(other) {
                return Some(format!(
                    "an adapter through which telegrams leave {} late",
                    slow.by
                ));
            }
        }
        if let Some(slow) = way.in_parts(telegram) {
            let other = Other {
                slow: Some(slow),
                ..Other::default()
            };
            if fails(other) {
                return Some(
                    "an adapter or a server that makes a pause behind a telegram".to_owned(),
                );
            }
        }
        let base: Assumed = self.known().iter().map(|own| own.properties).collect();
        for (place, known) in self.known().iter().enumerate() {
            for (words, properties) in &known.open {
                let mut all = base.clone();
                all[place] = *properties;
                let other = Other {
                    properties: Some(&all),
                    ..Other::default()
                };
                if fails(other) {
                    return Some(words.clone());
                }
            }
        }
        None
    }
}
