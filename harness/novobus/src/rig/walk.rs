//! The conversations that walk a right drive of a ring: each state of its end of the bus (ND21 9.1-9.8) with each input.
//!
//! States and inputs are those of the simulator's matrix of transitions. What takes its own time is left to the conversations in
//! corpora/qualify/novobus: time-outs (9.9), resets (10.5), and what stands behind the bus.

mod model;
#[cfg(test)]
mod tests;

use super::limits;
use crate::language::read::RingScenario;
use crate::qualify::some_drives;
use harness_bench::qualify::walk::{DriveWalk, Walk, WalkBounds, WalkPart, walk};
use harness_bench::rig::Rig;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::guard::Limits;
use harness_proto::time::Span;
use model::{BITS, INPUTS, Model, PROCESS, State, WORD};

/// The largest ring that is walked: behind each silence a round is waited for.
const SMALL: u8 = 16;

/// How long a conversation takes at most. It ends with the input that goes beyond.
const CONVERSATION: Span = Span::from_millis(1_000);

/// How long the walks of a ring take together without motion, with it, and with wrong parity bits.
const STILL: Span = Span::from_millis(4_000);
const MOVING: Span = Span::from_millis(7_000);
const DAMAGED: Span = Span::from_millis(1_000);

/// What the names of the conversations begin with.
const PREFIX: &str = "qualify-";

/// What is written in front of a walk with motion: where process data come from and go to, and values that are known.
const FIRST: [Command; 6] = [
    Command::WriteByte {
        address: ram::DATA_IN,
        data: PROCESS as u8,
    },
    Command::WriteByte {
        address: ram::DATA_OUT,
        data: PROCESS as u8,
    },
    Command::WriteWord {
        address: PROCESS,
        data: 0x1234,
    },
    Command::WriteWord {
        address: BITS,
        data: 0x9234,
    },
    Command::WriteWord {
        address: WORD,
        data: 0x1234,
    },
    Command::WriteWord {
        address: WORD + 2,
        data: 0x5678,
    },
];

/// What is read behind a walk.
const LAST: [Command; 3] = [
    Command::ReadWord { address: PROCESS },
    Command::ReadWord { address: BITS },
    Command::ReadWord { address: WORD },
];

/// The walks of the drives of a ring.
pub(crate) struct Walks {
    drives: u8,
    walks: Vec<DriveWalk<State>>,
}

impl Walks {
    /// Those of the first ring of a rig, as its file permits them; nothing depends on what its drives have sent.
    pub(crate) fn new(rig: &Rig) -> Self {
        Self::within(rig.ring_size(), &limits(rig, true))
    }

    /// Those of a ring of `drives` within these limits: of the first drives, the middle one and the last one.
    fn within(drives: u8, limits: &Limits) -> Self {
        let size = RingSize::new(drives.into()).ok();
        let size = size.filter(|_| drives <= SMALL);
        let walked = some_drives(drives);
        let share = walked.len() as u64;
        let walks = walked.into_iter().filter_map(|drive| {
            Some(DriveWalk {
                drive: match drives {
                    1 => String::new(),
                    _ => format!("drive {drive}"),
                },
                walk: walk_of(size?, drive, limits, share),
            })
        });
        Self {
            drives,
            walks: walks.collect(),
        }
    }

    pub(crate) fn conversations(&self) -> Vec<RingScenario> {
        let sources = self
            .walks
            .iter()
            .flat_map(|walk| walk.conversations(PREFIX, |lines| text(self.drives, lines)));
        let entries = sources.map(|source| RingScenario::new(source, Some(self.drives)));
        entries.filter_map(Result::ok).collect()
    }

    /// The lines that say what these attempts have walked, by name and verdict, and what not.
    pub(crate) fn told(&self, attempts: &[(String, Verdict)]) -> String {
        if self.drives > SMALL {
            return format!("walked: nothing; rings of at most {SMALL} drives are\n");
        }
        let attempts = attempts.iter().map(|(name, verdict)| {
            // Each byte was right, and the computer was late.
            let verdict = match verdict {
                Verdict::Marginal => Verdict::Passed,
                other => *other,
            };
            (name.as_str(), verdict)
        });
        let attempts: Vec<_> = attempts.collect();
        let names = INPUTS.map(|(name, _)| name);
        let told = self.walks.iter();
        told.map(|walk| walk.told(&names, PREFIX, &attempts))
            .collect()
    }
}

/// The walk of a drive, which takes a share of the time of all. What needs less is walked first, in conversations of its own: they are played
/// without --allow-motion, and where no byte can be sent with a wrong parity bit.
fn walk_of(size: RingSize, drive: u8, limits: &Limits, share: u64) -> Walk<State> {
    let stage = |limits, wrong_parity, all: Span, before: &[_]| {
        let mut model = Model::new(size, drive, limits);
        model.wrong_parity = wrong_parity;
        let bounds = WalkBounds {
            conversation: CONVERSATION,
            all: Span::from_units(all.units() / share.max(1)),
        };
        permitted(model, bounds, &limits, before)
    };
    let still = Limits {
        motion: false,
        ..*limits
    };
    let mut all = stage(still, false, STILL, &[]);
    if limits.motion {
        let more = stage(*limits, false, MOVING, &all.parts);
        all = all.then(more);
    }
    // A port puts faults on the link of the master alone.
    if drive == size.first() {
        let more = stage(*limits, true, DAMAGED, &all.parts);
        all = all.then(more);
    }
    all
}

/// The walk of a model to what was not walked before, with the lines that stand around it.
fn permitted(
    mut model: Model,
    bounds: WalkBounds,
    limits: &Limits,
    before: &[WalkPart<State>],
) -> Walk<State> {
    let mut needs = Vec::new();
    let mut first = Vec::new();
    if limits.motion {
        needs.push("motion");
        for command in FIRST {
            let mut tried = model.clone();
            if let Ok(lines) = tried.command(command) {
                first.extend(lines);
                model = tried;
            }
        }
    }
    if model.wrong_parity {
        needs.push("line-errors");
    }
    let mut head = Vec::new();
    if !needs.is_empty() {
        head.push(format!("needs   {}", needs.join(", ")));
    }
    head.push(String::new());
    head.extend(first);
    let mut last = vec!["recover".to_owned()];
    for command in LAST {
        last.extend(model.clone().command(command).unwrap_or_default());
    }
    let mut walk = walk(&model, INPUTS.len(), bounds, before);
    for part in &mut walk.parts {
        let lines = std::mem::take(&mut part.lines);
        part.lines = [head.clone(), lines, last.clone()].concat();
    }
    walk
}

/// How many bytes stand in a line of a conversation.
const LINE: usize = 24;

/// The text of a conversation with these lines of a walk. Bytes that follow each other without a gap stand in one line.
fn text(drives: u8, lines: &[String]) -> String {
    let mut text = format!(
        "title   A walk through the states of a drive's end of the bus, with each input in each of them\n\
         source  nd21 9.1\nring    {drives}..{drives} default {drives}\n"
    );
    let mut room = 0;
    for line in lines {
        match line.strip_prefix("> ") {
            Some(bytes) if room > 0 => {
                text.push(' ');
                text.push_str(bytes);
            }
            _ => {
                text.push('\n');
                text.push_str(line);
                room = LINE;
            }
        }
        let bytes = line
            .strip_prefix("> ")
            .map_or(usize::MAX, |bytes| bytes.split(' ').count());
        room = room.saturating_sub(bytes);
    }
    text.push('\n');
    text
}
