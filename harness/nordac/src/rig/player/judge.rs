//! Whether a line that was not met accuses a slave.

use super::note::kind;
use super::rehearse::ModelOptions;
use super::worlds::{Divergence, MOST_LOST, TOO_MANY, right_slaves_send};
use super::{AttemptEvidence, Player, RigScenario};
use crate::rig::known::value_of;
use crate::rig::observed::{ReceivedOctets, Turn};
use crate::rig::settle::{Assumptions, search};
use crate::rig::talk::TalkError;
use crate::value::hex;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::run::outcome::{Mismatch, Unready};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::decode::Decoded;
use harness_proto::nordac::properties::{NordacProperty, PROPERTIES};
use harness_proto::profibus::Telegram;
use harness_proto::time::Span;
use std::collections::{BTreeMap, BTreeSet};

/// In how many attempts at a scenario, one after the other, the line may have lost the same telegram or its reply.
const LOST_BY_THE_LINE: usize = 2;

impl Player {
    /// The outcome where the slaves could not be made ready.
    pub(super) fn unanswered(
        &mut self,
        scenario: &RigScenario,
        error: &TalkError,
        left: &AttemptEvidence,
    ) -> Outcome {
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
            _ if exact && self.excused(scenario, left).is_none() => {
                Outcome::not_ready(Verdict::Failed, what, remark)
            }
            TalkError::NoReply { .. } if !exact => {
                Outcome::not_ready(Verdict::Failed, what, remark)
            }
            _ => match self.differs(scenario, left) {
                Some(differs) if !exact => {
                    let said = said(&differs, &left.turns);
                    Outcome::not_ready(Verdict::Failed, what, format!("{remark}; {said}"))
                }
                // A slave may have reasons of its own to refuse a parameter.
                _ => Outcome::not_ready(Verdict::Inconclusive, what, remark),
            },
        }
    }

    /// What no right slave sends, where nothing that the line has lost or a stream has parted explains it.
    fn differs(&mut self, scenario: &RigScenario, left: &AttemptEvidence) -> Option<Divergence> {
        let turns = &left.turns;
        let sent = right_slaves_send(self.known(), self.rate, 0, turns, &self.beats);
        let differs = sent.err().filter(|differs| differs.open.is_none())?;
        self.lost(scenario, turns).is_none().then_some(differs)
    }

    /// Whether a line that was not met accuses the slave; behind an adapter, whether anything that it sent does.
    pub(super) fn judged(
        &mut self,
        scenario: &RigScenario,
        outcome: Outcome,
        left: &AttemptEvidence,
    ) -> Outcome {
        let judged = [Verdict::Passed, Verdict::Failed].contains(&outcome.verdict);
        if left.way.tolerance > Span::ZERO && judged {
            return self.judged_by_times(scenario, outcome, left);
        }
        if outcome.verdict != Verdict::Failed {
            return outcome.judged_by(&scenario.plan);
        }
        match self.explained(scenario, left) {
            None => outcome,
            Some(with) => Outcome {
                verdict: Verdict::Inconclusive,
                remarks: std::iter::once(format!(
                    "a right slave with {with} does the same, and this is not known"
                ))
                .chain(outcome.remarks)
                .collect(),
                ..outcome
            },
        }
    }

    /// The outcome where time is real: slaves are right if right ones could have sent what came, whatever the lines say of it.
    fn judged_by_times(
        &mut self,
        scenario: &RigScenario,
        outcome: Outcome,
        left: &AttemptEvidence,
    ) -> Outcome {
        let turns = &left.turns;
        let late = left.way.late.max(left.way.longest);
        let not_shown = |verdict, why: &str| {
            let remark = format!("{why} (the computer or the adapter was late by {late})");
            Outcome::not_ready(verdict, Unready::NoAnswer, remark)
        };
        let sent = right_slaves_send(self.known(), self.rate, 0, turns, &self.beats);
        match sent {
            Err(Divergence {
                open: Some(why), ..
            }) => return not_shown(Verdict::Inconclusive, why),
            Err(differs) => match self.lost(scenario, turns) {
                None => return accused(outcome, &differs, turns),
                Some(why) => {
                    let remarks = std::iter::once(why).chain(outcome.remarks);
                    return Outcome {
                        verdict: Verdict::Inconclusive,
                        shows_nothing: true,
                        remarks: remarks.collect(),
                        ..outcome
                    };
                }
            },
            Ok(_) => drop(self.lost.remove(&scenario.name)),
        }
        let Some(finding) = &outcome.finding else {
            return outcome;
        };
        let other = ModelOptions {
            switches: left.switches,
            ..ModelOptions::default()
        };
        let rehearsed = self.rehearse(scenario, &self.limits, other).turns;
        let shown = kinds(turns) == kinds(&rehearsed);
        if late > left.way.tolerance && !shown {
            return not_shown(
                Verdict::Marginal,
                "the slaves are right in what they sent, and the scenario was not shown",
            );
        }
        let right = match shown {
            true => "a right slave sends this at the time at which it was asked",
            false => {
                "a right slave sends this to what has reached it, which is not what the scenario is about"
            }
        };
        let remark = format!("{}: {right}", finding.message);
        Outcome {
            verdict: Verdict::Passed,
            finding: None,
            remarks: std::iter::once(remark).chain(outcome.remarks).collect(),
            ..outcome
        }
    }

    /// What the line has lost if right slaves have sent all else, in a sentence. A slave is silent at the same place each time: what was lost
    /// there in the two attempts before is not lost by the line.
    fn lost(&mut self, scenario: &RigScenario, turns: &[Turn]) -> Option<String> {
        let sent = right_slaves_send(self.known(), self.rate, MOST_LOST, turns, &self.beats);
        let lost = match sent {
            Ok(lost) => lost,
            Err(Divergence { open, .. }) => {
                return open.filter(|why| *why == TOO_MANY).map(str::to_owned);
            }
        };
        let first = turns.get(*lost.first()?)?;
        let place = |number: usize| {
            let step = turns.get(number).map(|turn| turn.step);
            let before = turns[..number].iter();
            let same = before.filter(|turn| Some(turn.step) == step);
            (step.flatten(), same.count())
        };
        let before = self.lost.remove(&scenario.name).unwrap_or_default();
        let times = |place| before.get(&place).copied().unwrap_or_default() + 1;
        let now: BTreeMap<_, _> = lost
            .into_iter()
            .map(place)
            .map(|turn| (turn, times(turn)))
            .collect();
        let again = now.values().any(|times| *times > LOST_BY_THE_LINE);
        self.lost.insert(scenario.name.clone(), now);
        (!again).then(|| {
            format!(
                "no whole reply came to {}: the line may have lost it, and all else is what right slaves send",
                words(&first.octets)
            )
        })
    }

    /// As [`Self::explained`], but `None` once a slave was proven wrong.
    fn excused(&mut self, scenario: &RigScenario, left: &AttemptEvidence) -> Option<String> {
        if self.proven {
            return None;
        }
        let excuse = self.explained(scenario, left);
        self.proven = excuse.is_none() && self.slaves.len() == 1;
        excuse
    }

    /// In what right slaves that send the very same octets differ from what is known of the slaves; `None` if no right slaves send them.
    fn explained(&self, scenario: &RigScenario, left: &AttemptEvidence) -> Option<String> {
        let base: Assumptions = self.known().iter().map(|known| known.properties).collect();
        let open: Vec<Vec<_>> = self
            .known()
            .iter()
            .map(|known| {
                PROPERTIES
                    .iter()
                    .filter(|property| !known.is_settled(property))
                    .collect()
            })
            .collect();
        let may = |place: usize, property: &NordacProperty| {
            open[place].iter().any(|point| point.name == property.name)
        };
        let came = |all: &Assumptions| -> ReceivedOctets {
            let other = ModelOptions {
                properties: Some(all),
                switches: left.switches,
                came: Some(&left.came),
                ..ModelOptions::default()
            };
            self.rehearse(scenario, &self.limits, other).came
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
}

/// A reply that no right slave sends.
fn accused(outcome: Outcome, differs: &Divergence, turns: &[Turn]) -> Outcome {
    let turn = turns.get(differs.turn);
    let message = said(differs, turns);
    let finding = match outcome.finding {
        Some(finding) => finding,
        None => {
            let place = turn.and_then(|turn| turn.step).unwrap_or_default();
            let span = TextSpan {
                start: place,
                end: place,
            };
            Mismatch {
                span,
                message: message.clone(),
                difference: None,
                in_error: String::new(),
            }
        }
    };
    Outcome {
        verdict: Verdict::Failed,
        finding: Some(finding),
        remarks: std::iter::once(message).chain(outcome.remarks).collect(),
        ..outcome
    }
}

/// What the slave replied, and what a right one replies, in a sentence.
fn said(differs: &Divergence, turns: &[Turn]) -> String {
    let turn = turns.get(differs.turn);
    let came: Vec<u8> = turn.map_or(Vec::new(), |turn| {
        turn.came.iter().map(|octet| *octet as u8).collect()
    });
    let asked = turn.map_or(Vec::new(), |turn| turn.octets.clone());
    format!(
        "the slave replies {} to {}, where a right one sends {}, or the same at another time that the record allows",
        words(&came),
        words(&asked),
        words(&differs.wanted)
    )
}

fn words(octets: &[u8]) -> String {
    match octets.is_empty() {
        true => "nothing".to_owned(),
        false => hex(octets),
    }
}

/// The kinds of replies in a scenario: who sends what, and the states of the slaves, without what follows a motor or a clock.
fn kinds(turns: &[Turn]) -> BTreeSet<String> {
    let played = turns.iter().filter(|turn| turn.step.is_some());
    let kinds = played.map(|turn| {
        let octets: Vec<u8> = turn.came.iter().map(|octet| *octet as u8).collect();
        match Telegram::decode(&octets) {
            Decoded::Value { value, used } if used == octets.len() => kind(&value),
            _ => words(&octets),
        }
    });
    kinds.collect()
}
