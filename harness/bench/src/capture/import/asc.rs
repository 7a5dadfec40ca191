//! Logs of frames in Vector's text format, ASC.
//!
//! | line | meaning |
//! |---|---|
//! | `date Mon Nov 23 10:00:00.000 am 2026` | passed over |
//! | `Begin Triggerblock` | another recording: what was on the bus before it is not in the log |
//! | `base hex  timestamps absolute` | the radix of identifiers and bytes; `relative` times count from the event before |
//! | `0.001000 1  201x  Rx  d 3 3D 40 00 ...` | time, channel, identifier with `x` for 29 bits, direction, `d` data or `r` remote, length, bytes |
//! | `0.001000 1  DriveRx  Rx  d 3 3D 40 00 ... ID = 513` | the same of a log with names: the identifier is decimal, at the end |
//! | `0.001000 CANFD 1 Rx 201 0 0 3 3 3D 40 00 130000 130 0 ...` | a frame whose flags (after duration and length) say whether it is of CAN FD (bit 12) |
//! | `0.002000 1  ErrorFrame` | passed over and counted |
//!
//! All other lines that begin with a time are events of the program, in the user's language.

use super::super::CaptureError;
use super::super::frames::{Log, LogEntry, LogItem};
use super::super::order::Place;
use super::logs::{frame, identifier, logged};
use super::numbers::{SignedTime, seconds};

/// The number of lines in which to look for a heading.
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

struct AscReader {
    radix: u32,
    relative: bool,
    /// The time of the event before.
    before: SignedTime,
    /// The present line and block. A trigger begins and ends a block.
    place: Place,
}

/// The frames of a log.
///
/// # Errors
/// A line that cannot be.
pub(super) fn read(bytes: &[u8]) -> Result<Log, CaptureError> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = AscReader {
        radix: 16,
        relative: false,
        before: 0,
        place: Place::default(),
    };
    let mut log = Log::default();
    for (number, line) in text.lines().enumerate() {
        reader.place.number = number + 1;
        let read = reader.line(line).map_err(|what| {
            let shown: String = line.trim().chars().take(60).collect();
            CaptureError::Link {
                place: format!("line {}", number + 1),
                what: format!("{shown:?}: {what}"),
            }
        })?;
        log.frames.extend(read.map(|logged| LogEntry {
            place: reader.place,
            ..logged
        }));
    }
    Ok(log)
}

impl AscReader {
    /// A line; `None` where it has no frame.
    fn line(&mut self, line: &str) -> Result<Option<LogEntry>, String> {
        let words: Vec<&str> = line.split_whitespace().take(40).collect();
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

    /// What follows a time.
    fn event(&self, at: SignedTime, words: &[&str]) -> Result<Option<LogEntry>, String> {
        let (channel, what) = match words {
            ["CANFD", channel, "Rx" | "Tx", rest @ ..] => (channel, with_flags(rest)?),
            [channel, "ErrorFrame", ..] => (channel, LogItem::Error),
            [channel, id, "Rx" | "Tx", kind @ ("d" | "r"), rest @ ..] => {
                (channel, self.classic(id, *kind == "r", rest)?)
            }
            _ => return Ok(None),
        };
        Ok(Some(logged(channel, Some(at), what)))
    }

    /// A frame by its identifier or name, and what follows `d` or `r`.
    fn classic(&self, name: &str, remote: bool, rest: &[&str]) -> Result<LogItem, String> {
        // A name may look like a number.
        let stated = rest.windows(3).find_map(|words| match words {
            ["ID", "=", id] => Some(*id),
            _ => None,
        });
        let (text, radix) = stated.map_or((name, self.radix), |id| (id, 10));
        let (digits, extended) = match text.strip_suffix('x') {
            Some(digits) => (digits, true),
            None => (text, false),
        };
        let number = identifier(digits, radix).map_err(|_| {
            let base = if radix == 16 { "hexadecimal" } else { "decimal" };
            format!(
                "`{text}` is no {base} identifier, which `base` says; a log with names needs `ID =` at the end of its lines, or is \
                 saved with numeric identifiers"
            )
        })?;
        // The length of a remote frame may be missing in old logs.
        let length = rest.first();
        let length = length.and_then(|digits| usize::from_str_radix(digits, 16).ok());
        let length = match (remote, length) {
            (_, Some(length)) => length,
            (true, None) => 0,
            (false, None) => return Err("the length of the data is missing".to_owned()),
        };
        let data = rest.get(1..).unwrap_or_default();
        let id = (number, Some(extended));
        Ok(LogItem::Frame(frame(id, remote, length, data, self.radix)?))
    }
}

/// A line CANFD after its direction: identifier, perhaps a name, BRS, ESI, length code, length, data, duration, bits, flags. All numbers but
/// the length are hexadecimal.
fn with_flags(words: &[&str]) -> Result<LogItem, String> {
    const REMOTE: u32 = 1 << 4;
    const FD: u32 = 1 << 12;
    let (id, rest) = match words {
        [id, rest @ ..] if matches!(rest, ["0" | "1", "0" | "1", ..]) => (*id, rest),
        [id, _, rest @ ..] => (*id, rest),
        _ => return Err("an identifier is expected".to_owned()),
    };
    let [switch, _, _, length, rest @ ..] = rest else {
        return Err("BRS, ESI, length code and length are expected".to_owned());
    };
    let length: usize = length
        .parse()
        .map_err(|_| format!("`{length}` is no length of the data"))?;
    let (digits, extended) = match id.strip_suffix('x') {
        Some(digits) => (digits, true),
        None => (id, false),
    };
    let flags = rest.get(length.saturating_add(2));
    let flags = flags.and_then(|text| u32::from_str_radix(text, 16).ok());
    match flags {
        Some(flags) if flags & FD == 0 && *switch == "0" && length <= 8 => {
            let id = (identifier(digits, 16)?, Some(extended));
            let frame = frame(id, flags & REMOTE != 0, length, rest, 16)?;
            Ok(LogItem::Frame(frame))
        }
        _ => Ok(LogItem::Fd),
    }
}
