//! How frames of drives differ, and what of the open points was measured.
//!
//! Times of three points are measured, since they can have any value: `stuff`, `reply-delay` and `homing-time`.

use super::act::{FrameAct, FrameActKind, FrameTalk};
use super::play::{FramesSeen, play};
use crate::judge::FrameSymptom;
use crate::language::written;
use crate::simulate::Setup;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::properties::{Accepts, PROPERTIES, Properties, Setting};
use harness_proto::unitek::words::{MODE_EVENT, status};
use harness_proto::unitek::{Data, Register, Request};
use harness_sim::record::LineFrame;
use serde::{Deserialize, Serialize};

/// Bits of the intermission after a frame.
const INTERMISSION_BITS: u32 = 3;

/// The first frame that no model explains.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FrameDifference {
    pub(crate) what: FrameSymptom,
    /// The section, example, appendix item or dump that says most about it, such as `ex 9`.
    pub(crate) section: String,
    pub(crate) register: u8,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) drive: Option<u8>,
    /// The number of the frame among those of the drives, counted from 1.
    pub(crate) frame: usize,
    /// The values of open points with which the model explains most, as header lines; those of the profile `ds` are not listed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) under: Vec<String>,
    /// The whole difference, as a sentence.
    pub(crate) about: String,
}

/// What was measured of a drive: the points that can have any value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Measured {
    stuff: u8,
    reply_delay: Span,
    homing_time: Span,
}

/// The usual values of every drive and those of the other profile, but with what was measured.
pub(super) fn begins(setup: &Setup) -> Vec<Vec<Properties>> {
    let measured: Vec<_> = (0..setup.drives.len())
        .map(|drive| measure(setup, drive))
        .collect();
    let all = |properties: Properties| {
        let properties = |measured: &Measured| Properties {
            stuff: measured.stuff,
            reply_delay: measured.reply_delay,
            homing_time: measured.homing_time,
            ..properties
        };
        measured.iter().map(properties).collect()
    };
    vec![all(Properties::default()), all(Properties::fw472())]
}

/// All properties that differ in one open point.
pub(super) fn neighbours(properties: &Properties) -> impl Iterator<Item = Properties> {
    let properties = *properties;
    let words = PROPERTIES
        .iter()
        .flat_map(|property| match property.accepts {
            Accepts::Words(words) => words.iter().map(move |word| (property, *word)).collect(),
            Accepts::Byte | Accepts::TimeUpTo(_) => Vec::new(),
        });
    words.filter_map(move |(property, word)| {
        let mut new = properties;
        (property.set(&mut new, Setting::Word(word)) && new != properties).then_some(new)
    })
}

/// The open points of an assignment as header lines, where they are not those of the profile `ds`.
pub(super) fn lines(setup: &Setup, assignment: &[Properties]) -> Vec<String> {
    let mut lines = Vec::new();
    for (drive, values) in setup.drives.iter().zip(assignment) {
        let node = drive.node;
        for property in PROPERTIES {
            if let Accepts::Words(words) = property.accepts {
                let is = |word: &&&str| {
                    let mut same = *values;
                    property.set(&mut same, Setting::Word(word)) && same == *values
                };
                if let Some(word) = words.iter().skip(1).find(is) {
                    lines.push(format!("drive {node} property {} = {word}", property.name));
                }
            }
        }
        if values.stuff != 0 {
            let stuff = values.stuff;
            lines.push(format!("drive {node} property stuff = {stuff:02X}"));
        }
        let usual = Properties::default();
        let times = [
            ("reply-delay", values.reply_delay, usual.reply_delay),
            ("homing-time", values.homing_time, usual.homing_time),
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

pub(super) fn same_frame(a: &Frame, b: &Frame) -> bool {
    let head = |frame: &Frame| (frame.id(), frame.is_remote(), frame.dlc());
    head(a) == head(b) && meaning(a) == meaning(b)
}

/// The distance of two frames: 0 if they are equal.
pub(super) fn unlike(a: &LineFrame, b: &LineFrame) -> i64 {
    let (one, other) = (&a.frame, &b.frame);
    let head = i64::from(one.id() != other.id()) + i64::from(one.is_remote() != other.is_remote());
    let register = i64::from(one.data().first() != other.data().first());
    let length = i64::from(one.dlc() != other.dlc());
    let bits = meaning(one).iter().zip(meaning(other));
    let bits: u32 = bits.map(|(a, b)| (a ^ b).count_ones()).sum();
    let time = i64::from(a.start != b.start);
    1_000 * head + 1_000 * register + 100 * length + 2 * i64::from(bits) + time
}

/// The difference at a place, in words.
pub(super) fn difference(
    setup: &Setup,
    index: usize,
    (expected, seen): (&FramesSeen, &FramesSeen),
    under: Vec<String>,
) -> Option<FrameDifference> {
    let (wanted, came) = (expected.said.get(index), seen.said.get(index));
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
    let drive = node.filter(|node| setup.drives.iter().any(|drive| drive.node == *node));
    let said = |frame: Option<&LineFrame>| {
        frame.map_or("no frame".to_owned(), |frame| {
            format!("{} at {}", written(&frame.frame), frame.at)
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
    let named = |frame: &Frame| (frame.id(), frame.is_remote(), frame.data().first().copied());
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
    let reply = firmware.said.first();
    let known = reply.and_then(|frame| Some((frame, Reply::decode(&frame.frame, tx).ok()?)));
    let request = Request::Read { register: 0x1B }.encode(rx);
    let asked = request.map_or(Span::ZERO, |frame| alone.rate.time_of(frame.wire_bits()));
    // A reply that is ready within the intermission begins after it; the delay counts from the end of the request.
    let after = known.map_or(Span::ZERO, |(frame, _)| {
        frame.start.since(Instant::START + asked)
    });
    let delay = match after {
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
    let ends = homed.said.iter().find(|frame| {
        let reply = Reply::decode(&frame.frame, tx);
        let calibrated = |reply: Reply| reply.data.bits() & status::CALIBRATED != 0;
        reply.is_ok_and(|reply| reply.register == 0x40 && calibrated(reply))
    });
    let begins = homed.done.last().map(|at| {
        let frame = write(0x78, 1).encode(rx);
        *at + frame.map_or(Span::ZERO, |frame| alone.rate.time_of(frame.wire_bits()))
    });
    let scans = |at: Instant| at.since_start().units() / scan.units();
    let homing_time = match (ends, begins) {
        (Some(end), Some(begins)) => scan * scans(end.start).saturating_sub(scans(begins)),
        _ => usual.homing_time,
    };
    Measured {
        stuff: known.map_or(usual.stuff, |(_, reply)| reply.stuff),
        reply_delay: delay,
        homing_time,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_differ_in_all_but_the_stuff_byte() {
        let frame = |text: &str| -> Frame { text.parse().expect("a frame") };
        for (other, same) in [
            ("181#31008000", true),
            ("181#310080A5", true),
            ("181#31008100", false),
            ("181#31018000", false),
            ("181#32008000", false),
            ("182#31008000", false),
            ("181#310080", false),
            ("181#310080000000", false),
        ] {
            assert_eq!(
                same_frame(&frame("181#31008000"), &frame(other)),
                same,
                "{other}"
            );
        }
    }
}
