//! Logs of frames in Vector's text format, ASC.
//!
//! | line | meaning |
//! |---|---|
//! | `date Mon Nov 23 10:00:00.000 am 2026` | passed over |
//! | `Begin Triggerblock` | another recording: what was on the bus before it is not in the log |
//! | `base hex  timestamps absolute` | the radix of identifiers and bytes; `relative` times count from the event before |
//! | `0.001000 1  201x  Rx  d 3 3D 40 00 ...` | time, channel, identifier with `x` for 29 bits, direction, `d` data or `r` remote, length, bytes |
//! | `0.002000 1  ErrorFrame` | passed over and counted |
//!
//! All other lines that begin with a time are events of the program, in the user's language.

use super::super::CaptureError;
use super::super::frames::{FrameRead, Sender};
use super::super::order::Place;
use super::numbers::{Time, seconds};
use harness_proto::can::{Frame, Id};
use harness_sim::record::FrameEnd;

/// The lines in which a heading is looked for.
const HEADING: usize = 20;

/// Whether a file is such a log: a line of its heading says the radix.
pub(super) fn recognised(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(4_096)];
    let text = String::from_utf8_lossy(start);
    let mut lines = text.lines().take(HEADING);
    lines.any(|line| {
        let mut words = line.split_whitespace();
        words.next() == Some("base") && matches!(words.next(), Some("hex" | "dec"))
    })
}

/// A frame, the channel that it was on, and its time.
pub(in crate::capture) struct Logged {
    pub(in crate::capture) channel: String,
    pub(in crate::capture) at: Time,
    pub(in crate::capture) frame: FrameRead,
}

struct Reader {
    radix: u32,
    relative: bool,
    /// The time of the event before.
    before: Time,
    errors: usize,
    /// Lines so far, and blocks: a trigger begins and ends each of them.
    place: Place,
}

/// The frames of a log, and what is to be told about it.
///
/// # Errors
/// A line that cannot be.
pub(super) fn read(bytes: &[u8]) -> Result<(Vec<Logged>, Vec<String>), CaptureError> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader {
        radix: 16,
        relative: false,
        before: 0,
        errors: 0,
        place: Place::default(),
    };
    let mut frames = Vec::new();
    let mut notes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        reader.place.number = number + 1;
        frames.extend(reader.line(line).map_err(|what| {
            let shown: String = line.trim().chars().take(60).collect();
            CaptureError::Link {
                place: format!("line {}", number + 1),
                what: format!("{shown:?}: {what}"),
            }
        })?);
    }
    if reader.errors > 0 {
        let errors = reader.errors;
        notes.push(format!(
            "{errors} error frames not read: the log does not say which frames they ended"
        ));
    }
    Ok((frames, notes))
}

impl Reader {
    /// A line; `None` where it has no frame.
    fn line(&mut self, line: &str) -> Result<Option<Logged>, String> {
        let words: Vec<&str> = line.split_whitespace().take(16).collect();
        match words.as_slice() {
            ["base", radix, rest @ ..] => {
                self.radix = match *radix {
                    "hex" => 16,
                    "dec" => 10,
                    _ => return Err("`base hex` or `base dec` is expected".to_owned()),
                };
                self.relative = rest.contains(&"relative");
                Ok(None)
            }
            // Also that of another log, joined to this one.
            ["date", ..] | ["Begin", ..] => {
                self.place.recording += 1;
                self.before = 0;
                Ok(None)
            }
            [time, rest @ ..] => match seconds(time).filter(|_| time.contains('.')) {
                Some(time) => {
                    // Every event moves the time on, also one that is passed over.
                    let at = match self.relative {
                        true => self
                            .before
                            .checked_add(time)
                            .ok_or("too late for any clock")?,
                        false => time,
                    };
                    self.before = at;
                    self.event(at, rest)
                }
                None => Ok(None),
            },
            [] => Ok(None),
        }
    }

    /// What stands behind a time.
    fn event(&mut self, at: Time, words: &[&str]) -> Result<Option<Logged>, String> {
        let (channel, id, rest) = match words {
            ["CANFD", ..] => {
                return Err("a frame of CAN FD, and classic frames are expected".to_owned());
            }
            [_, "ErrorFrame", ..] => {
                self.errors += 1;
                return Ok(None);
            }
            [channel, id, "Rx" | "Tx", kind @ ("d" | "r"), rest @ ..] => {
                (channel, id, (*kind == "r", rest))
            }
            _ => return Ok(None),
        };
        let (number, extended) = match id.strip_suffix('x') {
            Some(number) => (number, true),
            None => (*id, false),
        };
        let Ok(number) = u32::from_str_radix(number, self.radix) else {
            let base = if self.radix == 16 {
                "hexadecimal"
            } else {
                "decimal"
            };
            return Err(format!("`{id}` is no {base} identifier, which `base` says"));
        };
        let known = match extended {
            true => Id::extended(number),
            false => u16::try_from(number).ok().and_then(Id::base),
        };
        let id = known.ok_or_else(|| format!("identifier `{id}` is too large"))?;
        let (remote, rest) = rest;
        // The length of a remote frame may be missing in old logs.
        let length = rest
            .first()
            .and_then(|own| usize::from_str_radix(own, 16).ok());
        let frame = match (remote, length) {
            (true, length) => Frame::remote(id, length.unwrap_or(0)),
            (false, None) => return Err("the length of the data is missing".to_owned()),
            (false, Some(length)) => {
                // A raw length code above 8 has 8 bytes.
                let length = length.min(8);
                let bytes = rest.iter().skip(1).take(length);
                let bytes = bytes.map(|own| u8::from_str_radix(own, self.radix).ok());
                match bytes.collect::<Option<Vec<u8>>>() {
                    Some(bytes) if bytes.len() == length => Frame::new(id, &bytes),
                    _ => return Err(format!("{length} data bytes are expected")),
                }
            }
        };
        let frame = FrameRead {
            nanos: 0,
            sender: Sender::ByIdentifier,
            frame: frame.map_err(|bad| bad.to_string())?,
            ended: FrameEnd::Good,
            place: self.place,
        };
        Ok(Some(Logged {
            channel: (*channel).to_owned(),
            at,
            frame,
        }))
    }
}
