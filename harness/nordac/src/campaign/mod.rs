//! Campaigns on a line of PROFIBUS: one conversation of a master with a slave, disturbed at every octet and telegram, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, and `converse` plays the conversation with one fault or none.

mod converse;
mod file;
#[cfg(test)]
mod tests;

use crate::value::hex;
use converse::{SlaveState, StepEnd};
use file::{CampaignStep, FaultName};
use harness_bench::bus_name::BusName;
use harness_bench::campaign::OutcomeClass;
use harness_bench::campaign::line::{Conversation, DisturbedLine, LineCase, LineTable, LineText};
use harness_bench::file::values::Time;
use harness_proto::line::{LineError, Received};
use harness_proto::nordac::PpoType;
use harness_sim::octet_segment::{LineFault, LineFaultAt};
use include_dir::{Dir, include_dir};

/// The campaigns that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns/nordac");

/// The most octets of a telegram that are shown.
const SHOWN: usize = 8;

static TABLE: LineTable = LineTable {
    bus: BusName::Nordac,
    built_in: &BUILT_IN,
    units: "telegrams",
    heading: "First octets",
    most_steps: 100,
    longest: "10 s",
    classes: [
        OutcomeClass {
            name: "unharmed",
            about: "every step ended as without the fault, and no request was repeated",
            letter: '.',
            gravity: 0,
        },
        OutcomeClass {
            name: "repeated",
            about: "every step ended as without the fault, after a repeated request",
            letter: 'R',
            gravity: 2,
        },
        OutcomeClass {
            name: "fell-back",
            about: "the master started the slave again, or gave up",
            letter: 'F',
            gravity: 4,
        },
        OutcomeClass {
            name: "wrong-word",
            about: "the master noticed nothing, and a word or what the slave holds is wrong",
            letter: 'W',
            gravity: 6,
        },
    ],
};

/// The conversation of a campaign, and its faults.
#[derive(Debug)]
pub(crate) struct Telegrams {
    ppo: PpoType,
    steps: Vec<CampaignStep>,
    faults: Vec<FaultName>,
    delays: Vec<Time>,
    /// How often a request without a reply is repeated.
    repeats: u8,
}

impl DisturbedLine for Telegrams {
    type Fault = LineFaultAt;
    type End = StepEnd;
    type State = SlaveState;
    type Piece = Vec<Received>;
    /// Whether the slave sent it, and its octets.
    type Carried = (bool, Vec<u8>);

    const TABLE: &'static LineTable = &TABLE;

    fn read(text: &str) -> Result<(Self, LineText), String> {
        file::read(text)
    }

    fn play(&self, fault: Option<LineFaultAt>) -> Option<Conversation<Self>> {
        converse::converse(self, fault)
    }

    fn unsound(steps: &[String], sound: &Conversation<Self>) -> Option<String> {
        let step = sound.failed().or((sound.starts > 0).then_some(0))?;
        Some(format!(
            "step {} (`{}`) ends without any fault as: {}; a conversation is expected that begins with `start` and that the slave answers",
            step + 1,
            steps[step],
            sound.words()[step]
        ))
    }

    fn cases(&self, carried: &[(bool, Vec<u8>)]) -> Vec<(LineCase, LineFaultAt)> {
        let mut cases = Vec::new();
        let mut before = 0;
        for (telegram, (_, octets)) in (1..).zip(carried) {
            let more = if octets.len() > SHOWN { " .." } else { "" };
            let disturbed = hex(octets.iter().take(SHOWN)) + more;
            for fault in self
                .faults
                .iter()
                .flat_map(|kind| kind.faults(&self.delays))
            {
                let mut add = |number, words: String, step: String| {
                    let case = LineCase {
                        place: telegram,
                        fault: words,
                        step,
                        disturbed: disturbed.clone(),
                    };
                    let station = None;
                    cases.push((
                        case,
                        LineFaultAt {
                            station,
                            number,
                            fault,
                        },
                    ));
                };
                match fault {
                    LineFault::Telegram(fault) => {
                        let step = format!("telegram {telegram}: {fault}");
                        add(telegram, fault.to_string(), step);
                    }
                    LineFault::Octet(fault) => {
                        for octet in 1..=octets.len() as u64 {
                            let number = before + octet;
                            let step = format!("byte {number}: {fault}");
                            add(number, format!("byte {octet} {fault}"), step);
                        }
                    }
                }
            }
            before += octets.len() as u64;
        }
        cases
    }

    fn happened(sound: &Conversation<Self>, played: &Conversation<Self>) -> String {
        let ends = played.words().into_iter().zip(sound.words()).zip(1..);
        let differing = ends.filter(|((end, sound), _)| end != sound);
        let mut parts: Vec<_> = differing
            .map(|((end, _), step)| format!("step {step}: {end}"))
            .take(3)
            .collect();
        if played.starts > 0 {
            parts.push(format!("started again {}", times(played.starts)));
        }
        if played.requests > 0 {
            parts.push(format!("repeated {}", times(played.requests)));
        }
        if parts.is_empty() {
            parts.push("as without the fault".to_owned());
        }
        parts.join("; ")
    }

    /// Octets with the places of line errors after them.
    fn written(octets: &Vec<Received>) -> String {
        let bad = octets
            .iter()
            .zip(1..)
            .filter_map(|(octet, place)| match octet.error? {
                LineError::Parity => Some(format!(" bad {place}")),
                _ => Some(format!(" bad {place} stop")),
            });
        hex(octets.iter().map(|octet| &octet.byte)) + &bad.collect::<String>()
    }
}

/// `once`, `twice`, `3 times`.
fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        2 => "twice".to_owned(),
        more => format!("{more} times"),
    }
}
