//! Whether drives do what the manual says, with any value of what it leaves open.
//!
//! The frames of a case are compared with those of the model. Where they differ, the model is played again with other values of the
//! points that the manual leaves open (UNITEK 7; `explore::search`). Only what no such model explains is a difference. Times of three points are measured, since they can have any value: `stuff`, `reply-delay` and
//! `homing-time`.

use super::act::{FrameAct, FrameActKind, FrameTalk};
use super::play::{FramesSeen, play};
use super::setup::model;
use crate::buses::unitek::judge::FrameSymptom;
use crate::buses::unitek::language::written;
use crate::buses::unitek::simulate::Setup;
use crate::explore::search::{Explained, Explains, explain};
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::properties::{Accepts, PROPERTIES, Properties, Setting};
use harness_proto::unitek::words::{MODE_EVENT, status};
use harness_proto::unitek::{Data, Register, Request};
use harness_sim::record::LineFrame;
use serde::{Deserialize, Serialize};

/// Bits of the intermission behind a frame.
const INTERMISSION_BITS: u32 = 3;

/// The first frame that no model explains.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameDifference {
    /// How it differs.
    pub what: FrameSymptom,
    /// The section, example, appendix item or dump that says most about it, such as `ex 9`.
    pub section: String,
    /// The register.
    pub register: u8,
    /// The drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<u8>,
    /// The number of the frame among those of the drives, counted from 1.
    pub frame: usize,
    /// The values of open points with which the model explains most, as header lines; those of the profile `ds` are not listed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub under: Vec<String>,
    /// The whole difference, as a sentence.
    pub about: String,
}

/// The properties of every drive of a segment.
pub type Assignment = Vec<Properties>;

/// What a case comes to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// These properties explain every frame.
    Explained(Assignment),
    /// No model does; the best one is this.
    Differs(Box<FrameDifference>),
    /// Too many models would have to be played.
    Undecided,
}

/// What was measured of a drive: the points that can have any value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Measured {
    stuff: u8,
    reply_delay: Span,
    homing_time: Span,
}

/// Judges cases on one segment.
#[derive(Clone, Debug)]
pub struct Oracle {
    under_test: Setup,
    measured: Vec<Measured>,
    /// What explained the last case.
    last: Assignment,
}

impl Oracle {
    /// Judges the drives of this segment; measures the points that can have any value.
    #[must_use]
    pub fn new(under_test: Setup) -> Self {
        let own = &under_test;
        let measured = (0..own.drives.len())
            .map(|drive| measure(own, drive))
            .collect();
        let mut new = Self {
            under_test,
            measured,
            last: Vec::new(),
        };
        new.last = new.all(Properties::default());
        new
    }

    /// The drives under test.
    #[must_use]
    pub const fn under_test(&self) -> &Setup {
        &self.under_test
    }

    /// Every drive with these properties, but with what was measured of it.
    fn all(&self, properties: Properties) -> Assignment {
        let own = |measured: &Measured| Properties {
            stuff: measured.stuff,
            reply_delay: measured.reply_delay,
            homing_time: measured.homing_time,
            ..properties
        };
        self.measured.iter().map(own).collect()
    }

    /// What the model with these properties does.
    #[must_use]
    pub fn expected(&self, case: &FrameTalk, assignment: &[Properties]) -> FramesSeen {
        play(&model(&self.under_test, assignment), case)
    }

    /// The properties that the oracle takes for the most likely.
    #[must_use]
    pub fn last(&self) -> &[Properties] {
        &self.last
    }

    /// Judges what the drives under test have done in a case.
    pub fn judge(&mut self, case: &FrameTalk, seen: &FramesSeen) -> Judgement {
        let played = Played {
            oracle: self,
            case,
            seen,
        };
        let begins = [
            self.last.clone(),
            self.all(Properties::default()),
            self.all(Properties::fw472()),
        ];
        match explain(&played, begins) {
            Explained::By(found) => {
                self.last.clone_from(&found);
                Judgement::Explained(found)
            }
            Explained::Not(best) => {
                let expected = self.expected(case, &best);
                let found = difference(&self.under_test, &expected, seen, lines(self, &best));
                found.map_or(Judgement::Undecided, |own| {
                    Judgement::Differs(Box::new(own))
                })
            }
            Explained::Undecided => Judgement::Undecided,
        }
    }
}

/// A case that was played on the drives under test.
struct Played<'o> {
    oracle: &'o Oracle,
    case: &'o FrameTalk,
    seen: &'o FramesSeen,
}

impl Explains for Played<'_> {
    type Assumed = Assignment;
    /// Frames before the first difference, and how like this frame is.
    type Agreement = (usize, i64);

    fn agreement(&self, assumed: &Assignment) -> Option<(usize, i64)> {
        let expected = self.oracle.expected(self.case, assumed);
        let index = first(&expected.frames, &self.seen.frames)?;
        let pair = (expected.frames.get(index), self.seen.frames.get(index));
        Some((index, -unlike(pair)))
    }

    fn neighbours(&self, assumed: &Assignment) -> Vec<Assignment> {
        let mut all = Vec::new();
        for (drive, own) in assumed.iter().enumerate() {
            for changed in neighbours(own) {
                let mut next = assumed.clone();
                next[drive] = changed;
                all.push(next);
            }
        }
        all
    }
}

/// Every assignment that differs in one open point.
fn neighbours(own: &Properties) -> impl Iterator<Item = Properties> {
    let own = *own;
    let words = PROPERTIES
        .iter()
        .flat_map(|property| match property.accepts {
            Accepts::Words(words) => words.iter().map(move |word| (property, *word)).collect(),
            Accepts::Byte | Accepts::TimeUpTo(_) => Vec::new(),
        });
    words.filter_map(move |(property, word)| {
        let mut new = own;
        (property.set(&mut new, Setting::Word(word)) && new != own).then_some(new)
    })
}

/// The open points of an assignment as header lines, where they are not those of the profile `ds`.
fn lines(oracle: &Oracle, assignment: &[Properties]) -> Vec<String> {
    let mut lines = Vec::new();
    for (drive, own) in oracle.under_test.drives.iter().zip(assignment) {
        let node = drive.node;
        for property in PROPERTIES {
            if let Accepts::Words(words) = property.accepts {
                let is = |word: &&&str| {
                    let mut same = *own;
                    property.set(&mut same, Setting::Word(word)) && same == *own
                };
                if let Some(word) = words.iter().skip(1).find(is) {
                    lines.push(format!("drive {node} property {} = {word}", property.name));
                }
            }
        }
        if own.stuff != 0 {
            lines.push(format!("drive {node} property stuff = {:02X}", own.stuff));
        }
        let usual = Properties::default();
        let times = [
            ("reply-delay", own.reply_delay, usual.reply_delay),
            ("homing-time", own.homing_time, usual.homing_time),
        ];
        for (name, time, usual) in times {
            if time != usual {
                let nanos = time.as_nanos();
                let time = match nanos % 1_000_000 {
                    0 => format!("{}ms", nanos / 1_000_000),
                    _ => format!("{nanos}ns"),
                };
                lines.push(format!("drive {node} property {name} = {time}"));
            }
        }
    }
    lines
}

/// Data bytes without the stuff byte of a reply, which means nothing (UNITEK 4.1).
fn meaning(frame: &Frame) -> &[u8] {
    let data = frame.data();
    match data.len() {
        4 | 6 => &data[..data.len() - 1],
        _ => data,
    }
}

fn same_frame(a: &Frame, b: &Frame) -> bool {
    let head = |own: &Frame| (own.id(), own.is_remote(), own.dlc());
    head(a) == head(b) && meaning(a) == meaning(b)
}

/// The first frame that differs, in what it says or in its time.
fn first(expected: &[LineFrame], seen: &[LineFrame]) -> Option<usize> {
    let same =
        |(a, b): (&LineFrame, &LineFrame)| same_frame(&a.frame, &b.frame) && a.start == b.start;
    let shorter = expected.len().min(seen.len());
    let index = expected.iter().zip(seen).position(|pair| !same(pair));
    index.or((expected.len() != seen.len()).then_some(shorter))
}

/// How unlike two frames are.
fn unlike(pair: (Option<&LineFrame>, Option<&LineFrame>)) -> i64 {
    let (Some(a), Some(b)) = pair else {
        return 10_000;
    };
    let (own, other) = (&a.frame, &b.frame);
    let head = i64::from(own.id() != other.id()) + i64::from(own.is_remote() != other.is_remote());
    let register = i64::from(own.data().first() != other.data().first());
    let length = i64::from(own.dlc() != other.dlc());
    let bits = meaning(own).iter().zip(meaning(other));
    let bits: u32 = bits.map(|(a, b)| (a ^ b).count_ones()).sum();
    let time = i64::from(a.start != b.start);
    1_000 * head + 1_000 * register + 100 * length + 2 * i64::from(bits) + time
}

/// The first difference, in words.
fn difference(
    setup: &Setup,
    expected: &FramesSeen,
    seen: &FramesSeen,
    under: Vec<String>,
) -> Option<FrameDifference> {
    let index = first(&expected.frames, &seen.frames)?;
    let (wanted, came) = (expected.frames.get(index), seen.frames.get(index));
    let what = match (wanted, came) {
        (Some(_), None) => FrameSymptom::Missing,
        (None, _) => FrameSymptom::Unasked,
        (Some(a), Some(b)) => symptom(a, b),
    };
    let about_it = match what {
        FrameSymptom::Unasked => came,
        _ => wanted.or(came),
    }?;
    let node = about_it.from;
    let register = about_it.frame.data().first().copied().unwrap_or(0);
    let known = Register::of(register);
    let drive = node.filter(|node| setup.drives.iter().any(|own| own.node == *node));
    let said = |own: Option<&LineFrame>| {
        own.map_or("no frame".to_owned(), |own| {
            format!("{} at {}", written(&own.frame), own.at)
        })
    };
    let any = match under.is_empty() {
        true => "",
        false => ", with the values of open points that explain most",
    };
    Some(FrameDifference {
        what,
        section: known.origin.to_owned(),
        register,
        drive,
        frame: index + 1,
        under,
        about: format!(
            "frame {} of the drives, register {register:02X} ({}): {} is expected{any}, and {} has come",
            index + 1,
            known.name,
            said(wanted),
            said(came)
        ),
    })
}

fn symptom(wanted: &LineFrame, came: &LineFrame) -> FrameSymptom {
    let (a, b) = (&wanted.frame, &came.frame);
    let named = |own: &Frame| (own.id(), own.is_remote(), own.data().first().copied());
    if same_frame(a, b) {
        FrameSymptom::Time
    } else if came.start < wanted.start {
        FrameSymptom::Unasked
    } else if came.start > wanted.start {
        FrameSymptom::Missing
    } else if named(a) != named(b) {
        FrameSymptom::Name
    } else if a.dlc() != b.dlc() {
        FrameSymptom::Length
    } else {
        FrameSymptom::Value
    }
}

/// Measures the points of a drive that can have any value, in two conversations with it alone.
fn measure(setup: &Setup, drive: usize) -> Measured {
    let alone = Setup {
        drives: vec![setup.drives[drive].clone()],
        ..setup.clone()
    };
    let (rx, tx) = alone.drives[0].identifiers;
    let usual = Properties::default();
    let send = |request: Request, wait_us| {
        let frame = request.encode(rx).ok()?;
        Some(FrameAct::new(FrameActKind::Send(frame), wait_us))
    };
    let said = |acts: Vec<Option<FrameAct>>| {
        let acts = acts.into_iter().flatten().collect();
        play(&alone, &FrameTalk { acts })
    };
    let firmware = said(vec![send(Request::Read { register: 0x1B }, 10_100_000)]);
    let reply = firmware.frames.first();
    let known = reply.and_then(|own| Some((own, Reply::decode(&own.frame, tx).ok()?)));
    let request = Request::Read { register: 0x1B }.encode(rx);
    let asked = request.map_or(Span::ZERO, |own| alone.rate.time_of(own.wire_bits()));
    // A reply that is ready within the intermission begins behind it; the delay counts from the end of the request.
    let behind = known.map_or(Span::ZERO, |(own, _)| {
        own.start.since(Instant::START + asked)
    });
    let delay = match behind {
        Span::ZERO => Span::ZERO,
        later => later + alone.rate.time_of(INTERMISSION_BITS),
    };
    let write = |register, data| Request::Write {
        register,
        data: Data::Short(data),
    };
    let homed = said(vec![
        send(write(0x51, 0), 2_000),
        send(write(0x52, 0x1000), 2_000),
        send(write(0x51, MODE_EVENT), 2_000),
        send(write(0x78, 1), 10_100_000),
    ]);
    let scan = Span::from_millis(1);
    let ends = homed.frames.iter().find(|own| {
        let reply = Reply::decode(&own.frame, tx);
        reply.is_ok_and(|own| own.register == 0x40 && own.data.bits() & status::CALIBRATED != 0)
    });
    let begins = homed.acts.last().map(|at| {
        let frame = write(0x78, 1).encode(rx);
        *at + frame.map_or(Span::ZERO, |own| alone.rate.time_of(own.wire_bits()))
    });
    let scans = |at: Instant| at.since_start().units() / scan.units();
    let homing_time = match (ends, begins) {
        (Some(own), Some(begins)) => scan * scans(own.start).saturating_sub(scans(begins)),
        _ => usual.homing_time,
    };
    Measured {
        stuff: known.map_or(usual.stuff, |(_, reply)| reply.stuff),
        reply_delay: delay,
        homing_time,
    }
}
