//! Campaigns on a CAN segment: one conversation of the master with a drive, disturbed at every frame, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, and `converse` plays the conversation with one fault or none.

mod converse;
mod file;

use crate::language::written;
use converse::{DriveState, JobEnd};
use file::CampaignStep;
use harness_bench::bus_name::BusName;
use harness_bench::campaign::OutcomeClass;
use harness_bench::campaign::line::{Conversation, DisturbedLine, LineCase, LineTable, LineText};
use harness_proto::can::Frame;
use harness_proto::unitek::master::Options;
use harness_proto::unitek::{Register, Width};
use harness_sim::segment::{FrameFault, Placed};
use include_dir::{Dir, include_dir};

/// The campaigns that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns/unitek");

static TABLE: LineTable = LineTable {
    bus: BusName::Unitek,
    built_in: &BUILT_IN,
    units: "frames",
    heading: "As candump writes it",
    most_steps: 200,
    longest: "10000 ms",
    classes: [
        OutcomeClass {
            name: "answered",
            about: "every job ended as without the fault",
            letter: '.',
            gravity: 0,
        },
        OutcomeClass {
            name: "retried",
            about: "every job ended as without the fault, after a repeated request",
            letter: 'R',
            gravity: 2,
        },
        OutcomeClass {
            name: "noticed",
            about: "the master reported the fault",
            letter: 'N',
            gravity: 4,
        },
        OutcomeClass {
            name: "unnoticed",
            about: "the master reported nothing, and a result or what the drive holds is wrong",
            letter: 'U',
            gravity: 6,
        },
    ],
};

/// The conversation of a campaign, and its faults.
#[derive(Debug)]
pub(crate) struct Frames {
    steps: Vec<CampaignStep>,
    faults: Vec<FrameFault>,
    options: Options,
}

impl DisturbedLine for Frames {
    type Fault = Placed;
    type End = JobEnd;
    type State = DriveState;
    type Piece = Frame;
    type Carried = Frame;

    const TABLE: &'static LineTable = &TABLE;

    fn read(text: &str) -> Result<(Self, LineText), String> {
        file::read(text)
    }

    fn play(&self, fault: Option<Placed>) -> Option<Conversation<Self>> {
        Some(converse::converse(self, fault))
    }

    fn unsound(steps: &[String], sound: &Conversation<Self>) -> Option<String> {
        if let Some(step) = sound.failed() {
            return Some(format!(
                "step {} ({}) ends without any fault as {}; a conversation is expected that the drive answers",
                step + 1,
                steps[step],
                sound.words()[step]
            ));
        }
        let disturbance = sound.troubles.first()?;
        Some(format!(
            "the master reports {disturbance} without any fault; give the steps more time"
        ))
    }

    fn cases(&self, carried: &[Frame]) -> Vec<(LineCase, Placed)> {
        let cases = (1..).zip(carried).flat_map(|(frame, disturbed)| {
            let faults = self.faults.iter();
            faults.map(move |&fault| {
                let case = LineCase {
                    place: frame,
                    fault: fault.to_string(),
                    step: format!("frame {frame}: {fault}"),
                    disturbed: disturbed.to_string(),
                };
                let placed = Placed {
                    station: None,
                    frame,
                    fault,
                };
                (case, placed)
            })
        });
        cases.collect()
    }

    fn happened(_: &Conversation<Self>, played: &Conversation<Self>) -> String {
        let failed = played.ends.iter().zip(1..);
        let failed = failed.filter_map(|(end, step)| Some((step, end.as_ref().err()?)));
        let parts: Vec<_> = failed
            .map(|(step, why)| format!("step {step}: {why}"))
            .chain(played.troubles.iter().cloned())
            .take(4)
            .collect();
        if parts.is_empty() {
            return format!("reported: {}", played.words().join(", "));
        }
        parts.join("; ")
    }

    fn written(frame: &Frame) -> String {
        written(frame)
    }

    fn left(state: &DriveState, sound: &DriveState) -> String {
        let differing = state.differing(sound).map(|(number, raw)| {
            let width = match Register::of(number).width {
                Width::Bits16 => 4,
                Width::Bits32 => 8,
            };
            format!("? drive 1 register {number:02X} = {raw:0width$X}\n")
        });
        differing.collect()
    }
}

#[cfg(test)]
mod tests;
