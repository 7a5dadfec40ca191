//! Captures of frames: link type 227 of pcapng, logs of frames as text, the JSON of `drivebench trace`.

use super::import::candump_time;
use super::order::{Counts, Place, ordered};
use super::{Capture, CaptureError, ChannelTarget, ImportedCapture, NamedLink};
use crate::counted::counted;
use crate::report::pcapng_frames::{DRIVE, ERROR, EXTENDED, HEADER, LOST, MASTER, REMOTE};
use harness_proto::can::{BitRate, CanError, Frame, Id};
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_proto::unitek::sender_of;
use harness_sim::record::{Channel, FrameEnd, LineFrame, Trace};
use serde::Deserialize;
use std::collections::BTreeSet;

/// Who sent a frame, as far as the file says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sender {
    /// The bench, or a drive.
    Known(Option<u8>),
    /// What the bus knows by the identifier.
    ByIdentifier,
}

impl Sender {
    /// By the name of an interface.
    pub(super) fn named(name: &str) -> Self {
        let drive = name.strip_prefix(DRIVE).and_then(|text| text.parse().ok());
        match (name, drive) {
            (MASTER, _) => Self::Known(None),
            (_, Some(drive)) => Self::Known(Some(drive)),
            _ => Self::ByIdentifier,
        }
    }
}

/// A frame as a file has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameRead {
    /// When it had ended.
    pub(super) nanos: u64,
    pub(super) sender: Sender,
    pub(super) frame: Frame,
    pub(super) ended: FrameEnd,
    pub(super) place: Place,
}

/// The capture of these frames, which are in the order of their file.
pub(super) fn assemble(
    frames: Vec<FrameRead>,
    counts: Counts,
    rate: Option<BitRate>,
) -> ImportedCapture {
    let rate = rate.unwrap_or(BitRate::K500);
    let length = |frame: &Frame| rate.time_of(frame.wire_bits());
    let ordered = ordered(frames, counts, |read| length(&read.frame));
    let line = ordered.frames.into_iter().map(|(at, read)| LineFrame {
        from: match read.sender {
            Sender::Known(from) => from,
            Sender::ByIdentifier => sender_of(&read.frame),
        },
        start: at - length(&read.frame),
        at,
        frame: read.frame,
        ended: read.ended,
    });
    let line: Vec<_> = line.collect();
    let drives: BTreeSet<u8> = line.iter().filter_map(|frame| frame.from).collect();
    let capture = Capture {
        rate: Rate::default(),
        traces: vec![Trace {
            channels: vec![Channel::of_frames(line)],
            seams: ordered.seams,
            ..Trace::empty(u8::try_from(drives.len()).unwrap_or(u8::MAX))
        }],
        listened: None,
        timed: true,
    };
    ImportedCapture {
        notes: ordered.notes,
        ..capture.into()
    }
}

/// Reads a packet of link type 227: header and data, and its comment.
///
/// # Errors
/// What is wrong with it, in a sentence. `None` for an error frame that does not say which frame it ended.
pub(super) fn packet(
    data: &[u8],
    comment: Option<&str>,
) -> Result<Option<(Frame, FrameEnd)>, String> {
    let (header, data) = data.split_at_checked(HEADER).ok_or_else(|| {
        format!(
            "a packet of {} bytes: at least the {HEADER} of its header are expected",
            data.len()
        )
    })?;
    let word = u32::from_be_bytes([header[0], header[1], header[2], header[3]]);
    let len = usize::from(header[4]);
    if word & ERROR != 0 {
        let ended = comment.and_then(|text| {
            let (error, frame) = text.split_once(' ')?;
            let error = CanError::from_name(error)?;
            Some((frame.parse().ok()?, FrameEnd::Error(error)))
        });
        return Ok(ended);
    }
    let number = word & Id::MAX_EXTENDED;
    let known = match word & EXTENDED != 0 {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let id = known.ok_or_else(|| format!("identifier {number:X} does not fit into 11 bits"))?;
    let frame = match word & REMOTE != 0 {
        true => Frame::remote(id, len),
        false => {
            let data = data.get(..len).ok_or_else(|| {
                format!("{len} data bytes are stated, and {} are there", data.len())
            })?;
            Frame::new(id, data)
        }
    };
    let frame = frame.map_err(|bad| bad.to_string())?;
    let ended = match comment {
        Some(LOST) => FrameEnd::Lost,
        _ => FrameEnd::Good,
    };
    Ok(Some((frame, ended)))
}

/// What a line of a log has.
#[derive(Clone, Copy, Debug)]
pub(super) enum LogItem {
    Frame(Frame),
    /// An error frame, of which the log does not say which frame it ended.
    Error,
    /// A frame of CAN FD.
    Fd,
}

/// A line of a log: its channel, and its time in thirds of a nanosecond where the log has one.
#[derive(Clone, Debug)]
pub(super) struct LogEntry {
    pub(super) channel: String,
    pub(super) at: Option<i64>,
    pub(super) what: LogItem,
    /// Its number, counted from 1, and its block.
    pub(super) place: Place,
}

/// A log of frames as text.
#[derive(Debug, Default)]
pub(super) struct Log {
    pub(super) frames: Vec<LogEntry>,
    pub(super) notes: Vec<String>,
    /// Whether the program that wrote it has noted that something is missing.
    pub(super) lost: bool,
}

/// The capture of a log. `links` chooses an interface where there are several. Times may be before 0; where a line has none, frames are placed one after
/// another.
///
/// # Errors
/// Frames of several channels; a frame of CAN FD on the chosen one.
pub(super) fn of_log(log: Log, links: &[NamedLink]) -> Result<ImportedCapture, CaptureError> {
    let Log {
        frames,
        mut notes,
        lost,
    } = log;
    let first = frames.iter().filter_map(|logged| logged.at).min();
    let first = first.unwrap_or(0).min(0);
    let lines = one_bus(frames, links, &mut notes)?;
    let timed = lines.iter().all(|logged| logged.at.is_some());
    let (mut frames, mut errors, mut end) = (Vec::new(), 0, Span::ZERO);
    for logged in &lines {
        let frame = match logged.what {
            LogItem::Frame(frame) => frame,
            LogItem::Error => {
                errors += 1;
                continue;
            }
            LogItem::Fd => {
                return Err(CaptureError::Link {
                    place: format!("line {}", logged.place.number),
                    what: "a frame of CAN FD, and classic frames are expected; choose another channel with `--link bus=...` where there is one"
                        .to_owned(),
                });
            }
        };
        end = end + BitRate::K500.time_of(frame.wire_bits());
        let at = logged.at.filter(|_| timed);
        let at = at.map(|at| at.abs_diff(first));
        frames.push(FrameRead {
            nanos: at.map_or(end, Span::from_units).as_nanos(),
            sender: Sender::ByIdentifier,
            frame,
            ended: FrameEnd::Good,
            place: logged.place,
        });
    }
    if errors > 0 {
        notes.push(format!(
            "{} not read: the log does not say which frame it ended",
            counted(errors, "error frame")
        ));
    }
    if !timed {
        notes.push("the log has no times that can be used: frames are placed one behind another, and their order alone is judged".to_owned());
    }
    let mut imported = assemble(frames, Counts::Lines, None);
    imported.capture.timed = timed;
    notes.extend(imported.notes);
    Ok(ImportedCapture {
        notes,
        lost,
        ..imported
    })
}

/// The frames of one interface: that which `links` names, or the only one.
fn one_bus(
    frames: Vec<LogEntry>,
    links: &[NamedLink],
    notes: &mut Vec<String>,
) -> Result<Vec<LogEntry>, CaptureError> {
    let wrong = |what: String| CaptureError::Link {
        place: "the log".to_owned(),
        what,
    };
    let channels = frames.iter().map(|logged| logged.channel.as_str());
    let mut names: Vec<&str> = channels.collect();
    names.sort_unstable();
    names.dedup();
    let chosen = links.iter().find(|link| link.target == ChannelTarget::Bus);
    let chosen = chosen.and_then(|link| link.channel.as_deref());
    let name = match (chosen, names.as_slice()) {
        (None, [] | [_]) => return Ok(frames),
        (None, [first, ..]) => {
            return Err(wrong(format!(
                "it has frames of {}; choose one of {}, as in `--link bus={first}`",
                counted(names.len(), "interface"),
                names.join(", ")
            )));
        }
        (Some(name), names) if names.contains(&name) => name,
        (Some(name), names) => {
            return Err(wrong(format!(
                "no interface is named `{name}`; it has {}",
                names.join(", ")
            )));
        }
    };
    let all = frames.len();
    let kept = frames.iter().filter(|logged| logged.channel == name);
    let kept: Vec<LogEntry> = kept.cloned().collect();
    if kept.len() < all {
        let left = counted(all - kept.len(), "frame");
        notes.push(format!("{left} of other interfaces not read"));
    }
    Ok(kept)
}

/// Puts logs in order of time where each ends before another one begins.
pub(super) fn in_order_of_time<L: AsRef<[u8]>>(logs: &mut [L]) {
    let span = |log: &L| {
        let text = String::from_utf8_lossy(log.as_ref());
        let times = text.lines().filter_map(candump_time);
        times.fold(None, |span, at| {
            let (first, last) = span.unwrap_or((at, at));
            Some((at.min(first), at.max(last)))
        })
    };
    let mut spans: Vec<_> = logs.iter().map(span).collect();
    spans.sort_unstable();
    let follow = |two: &[Option<(i64, i64)>]| match (two[0], two[1]) {
        (Some((_, last)), Some((first, _))) => last <= first,
        _ => true,
    };
    if spans.windows(2).all(follow) {
        logs.sort_by_cached_key(span);
    }
}

#[derive(Deserialize)]
struct Object {
    frames: Vec<FrameObject>,
}

#[derive(Deserialize)]
struct FrameObject {
    t_ns: u64,
    id: u32,
    #[serde(default)]
    extended: bool,
    remote: Option<usize>,
    data: Vec<u8>,
    from: serde_json::Value,
    fault: Option<String>,
}

/// Whether a JSON text is a trace of frames.
pub(super) fn is_json(bytes: &[u8]) -> bool {
    let start = bytes.get(..200).unwrap_or(bytes);
    let start: String = String::from_utf8_lossy(start).split_whitespace().collect();
    start.contains("\"schema\":2") && start.contains("\"frames\"")
}

/// Reads the JSON of a trace of frames, schema 2.
///
/// # Errors
/// What is wrong, and at which frame.
pub(super) fn json(bytes: &[u8]) -> Result<ImportedCapture, CaptureError> {
    let object: Object = serde_json::from_slice(bytes).map_err(|error| CaptureError::Link {
        place: format!("line {}, column {}", error.line(), error.column()),
        what: format!("{error}"),
    })?;
    let frames = object.frames.iter().enumerate().map(|(number, frame)| {
        let place = Place::of(number + 1);
        let read = frame.read().map(|read| FrameRead { place, ..read });
        read.map_err(|what| CaptureError::Link {
            place: format!("frame {}", number + 1),
            what,
        })
    });
    let mut frames = frames.collect::<Result<Vec<_>, _>>()?;
    // This program writes it, by one clock. A frame of the bench stands where it was handed over, with the time at which it leaves.
    frames.sort_by_key(|frame| frame.nanos);
    Ok(assemble(frames, Counts::Frames, None))
}

impl FrameObject {
    fn read(&self) -> Result<FrameRead, String> {
        let id = match self.extended {
            true => Id::extended(self.id),
            false => u16::try_from(self.id).ok().and_then(Id::base),
        };
        let id = id.ok_or_else(|| format!("identifier {:X} is too large", self.id))?;
        let frame = match self.remote {
            Some(len) => Frame::remote(id, len),
            None => Frame::new(id, &self.data),
        };
        let from = match &self.from {
            serde_json::Value::String(name) if name == MASTER => Some(None),
            other => other
                .as_u64()
                .and_then(|number| u8::try_from(number).ok())
                .map(Some),
        };
        let ended = match self.fault.as_deref() {
            None => Some(FrameEnd::Good),
            Some(LOST) => Some(FrameEnd::Lost),
            Some(name) => CanError::from_name(name).map(FrameEnd::Error),
        };
        Ok(FrameRead {
            nanos: self.t_ns,
            sender: Sender::Known(from.ok_or("`from` is \"master\" or a drive's number")?),
            frame: frame.map_err(|bad| bad.to_string())?,
            ended: ended.ok_or("`fault` is null, \"lost\", or the name of an error")?,
            place: Place::default(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::pcapng_frames;
    use harness_proto::time::Instant;

    fn frames(capture: &Capture) -> &[LineFrame] {
        capture.traces[0].channels[0].frames()
    }

    /// Lines of candump, with the direction that newer versions write, and one of an error frame.
    #[test]
    fn a_log_of_candump_is_read() {
        let log = "(1436509052.249713) can0 201#3D4000\n(1436509052.249999) can0 181#40810100 R\n\n\
                   (1436509052.250100) can0 20000088#0000000000000000\n(1436509052.250200) can0 00000201#R3\n";
        let capture = super::super::read(log.as_bytes(), None).expect("a capture");
        let read: Vec<_> = frames(&capture)
            .iter()
            .map(|frame| (frame.from, frame.frame.to_string()))
            .collect();
        let sent = |from, text: &str| (from, text.to_owned());
        assert_eq!(
            read,
            [
                sent(None, "201#3D4000"),
                sent(Some(1), "181#40810100"),
                sent(None, "00000201#R3")
            ]
        );
        let first = &frames(&capture)[0];
        assert_eq!(first.start, Instant::START);
        let apart = frames(&capture)[1].at.since(first.at);
        assert_eq!(apart, Span::from_micros(286));
    }

    #[test]
    fn what_is_no_log_names_its_line() {
        for (line, words) in [
            ("(1.0) can0", "as candump -L writes it"),
            ("(1,0) can0 201#", "as candump -L writes it"),
            (
                "(99999999999999999999.0) can0 201#",
                "as candump -L writes it",
            ),
            ("(1.0) can0 201#3D4", "pairs of hexadecimal digits"),
            ("(1.0) can0 201##0AA", "CAN FD"),
            ("(1.0) can0 FFF#00", "too large"),
            ("can0 hello", "as candump -L writes it"),
        ] {
            let log = format!("(0.5) can0 201#\n{line}\n");
            let error = super::super::read(log.as_bytes(), None)
                .expect_err(line)
                .to_string();
            assert!(
                error.starts_with("line 2: ") && error.contains(words),
                "{error}"
            );
        }
    }

    /// A frame of the bench that is handed over before a drive's frame arrives and leaves after it: both keep their times, which `verify` compares
    /// with the record.
    #[test]
    fn a_frame_that_leaves_later_keeps_its_time() {
        let text = r#"{"schema": 2, "frames": [{"t_ns": 2000000, "id": 513, "data": [61, 64, 0], "from": "master"},
                       {"t_ns": 1500000, "id": 385, "data": [64, 0, 0, 0], "from": 1}]}"#;
        let capture = super::super::read(text.as_bytes(), None).expect("a capture");
        let frames = capture.traces[0].channels[0].frames();
        let times: Vec<_> = frames
            .iter()
            .map(|frame| (frame.from, frame.at.since_start().as_nanos()))
            .collect();
        assert_eq!(times, [(Some(1), 1_500_000), (None, 2_000_000)]);
        assert!(capture.traces[0].seams.is_empty());
    }

    /// Every kind of frame and of end, at times in nanoseconds, written and read again.
    fn every_kind() -> Capture {
        let frame = |text: &str| text.parse::<Frame>().expect("a frame");
        let kinds = [
            (None, "201#3D4000", FrameEnd::Good),
            (Some(1), "181#40810100", FrameEnd::Good),
            (Some(2), "182#", FrameEnd::Lost),
            (None, "1FFFFFFF#R8", FrameEnd::Good),
            (None, "201#R", FrameEnd::Good),
            (
                None,
                "201#0011223344556677",
                FrameEnd::Error(CanError::ErrorFrame),
            ),
            (
                Some(1),
                "00000181#AA",
                FrameEnd::Error(CanError::NoAcknowledge),
            ),
        ];
        let read = kinds
            .iter()
            .zip(1..)
            .map(|((from, text, ended), number)| FrameRead {
                nanos: number * 1_000_001,
                sender: Sender::Known(*from),
                frame: frame(text),
                ended: *ended,
                place: Place::default(),
            });
        assemble(read.collect(), Counts::Frames, None).capture
    }

    #[test]
    fn pcapng_survives() {
        let capture = every_kind();
        let mut bytes = Vec::new();
        pcapng_frames::write(&capture.traces, &mut bytes).expect("a Vec");
        assert_eq!(super::super::read(&bytes, None), Ok(capture));
        // Every cut and every flipped bit gives a capture or an error that names the place.
        for length in 0..bytes.len() {
            let _any = super::super::read(&bytes[..length], None);
        }
        for place in 0..bytes.len() * 8 {
            let mut other = bytes.clone();
            other[place / 8] ^= 1 << (place % 8);
            let _any = super::super::read(&other, None);
        }
    }
    #[test]
    fn an_identifier_that_is_too_large_is_named() {
        let wrong =
            br#"{"schema":2,"frames":[{"t_ns":1,"id":4096,"data":[],"from":1,"fault":null}]}"#;
        let error = super::super::read(wrong, None)
            .expect_err("too large")
            .to_string();
        assert_eq!(error, "frame 1: identifier 1000 is too large");
    }
}
