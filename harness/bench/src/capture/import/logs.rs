//! Logs of frames as text, a frame a line: how every form is read, and those of candump.
//!
//! | form | a line |
//! |---|---|
//! | candump with `-l` or `-L` | `(1436509052.249713) can0 201#3D4000`, and the direction after it in newer versions |
//! | candump on the screen | ` (2023-11-14 22:13:20.001000)  can0  201   [3]  3D 40 00`; the time of `-ta`, `-tA`, `-td`, `-tz`, or none |
//!
//! The other forms are in `forms`.

use super::super::CaptureError;
use super::super::frames::{Log, LogEntry, LogItem};
use super::super::order::Place;
use super::numbers::{SignedTime, date, seconds};
use crate::counted::counted;
use crate::report::pcapng_frames::ERROR;
use harness_proto::can::{Frame, Id};

/// The number of lines in which to look for a frame after headings.
const HEADING: usize = 4_096;

/// Reads a line of a log; `None` for one that has no frame.
pub(super) type ReadLine = fn(&mut State, &str) -> Result<Option<LogEntry>, String>;

/// What is known from the lines so far.
pub(super) struct State {
    /// A frame has been read.
    begun: bool,
    /// Lines before the first frame that are ignored.
    headings: usize,
    /// The columns, if a heading names them.
    pub(super) columns: String,
    pub(super) radix: u32,
    /// Each time counts from the frame before.
    pub(super) relative: bool,
    /// After how long its clock begins again.
    pub(super) wraps: Option<SignedTime>,
    /// A line was in the form of the screen.
    screen: bool,
    /// The log says that frames are missing.
    lost: Option<String>,
}

/// The frames of a log of this form.
///
/// # Errors
/// A line that cannot be.
pub(super) fn read(bytes: &[u8], read_line: ReadLine) -> Result<Log, CaptureError> {
    let text = String::from_utf8_lossy(bytes);
    let mut state = State {
        begun: false,
        headings: 0,
        columns: String::new(),
        radix: 16,
        relative: false,
        wraps: None,
        screen: false,
        lost: None,
    };
    let mut log = Log::default();
    // What a terminal prints after the last frame, such as the prompt of a shell: the first such line, and how many there are.
    let mut behind: Option<(CaptureError, usize)> = None;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        match read_line(&mut state, line) {
            Ok(None) => {}
            Ok(Some(logged)) => {
                if let Some((error, _)) = behind {
                    return Err(error);
                }
                state.begun = true;
                log.frames.push(LogEntry {
                    place: Place::of(number + 1),
                    ..logged
                });
            }
            Err(what) => {
                let shown: String = line.chars().take(60).collect();
                let error = CaptureError::Link {
                    place: format!("line {}", number + 1),
                    what: format!("{shown:?}: {what}"),
                };
                match log.frames.last() {
                    Some(last) if !begins_a_frame(line, &last.channel) => {
                        behind.get_or_insert((error, 0)).1 += 1;
                    }
                    _ => return Err(error),
                }
            }
        }
    }
    if let Some((_, count)) = behind {
        let lines = counted(count, "line");
        log.notes
            .push(format!("{lines} behind the last frame not read"));
    }
    if state.headings > 0 {
        let headings = counted(state.headings, "line");
        log.notes
            .push(format!("{headings} in front of the first frame not read"));
    }
    if let Some(lost) = state.lost.take() {
        log.notes.push(lost);
        log.lost = true;
    }
    if state.screen {
        settle_times(&mut log, &mut state);
    }
    if state.relative {
        let mut at = 0_i64;
        for logged in &mut log.frames {
            at = logged.at.map_or(at, |since| at.saturating_add(since));
            logged.at = logged.at.map(|_| at);
        }
    }
    if let Some(period) = state.wraps {
        unwrap_times(&mut log.frames, period);
    }
    Ok(log)
}

/// Whether a line begins as one of a frame does: with a time, a number, or the channel of the frame before.
fn begins_a_frame(line: &str, channel: &str) -> bool {
    let line = plain(line);
    let first = line.split_whitespace().next().unwrap_or_default();
    first == channel || first.starts_with(|letter: char| letter == '(' || letter.is_ascii_digit())
}

/// Whether the times on a screen count from the first frame (`-tz`) or each from the one before (`-td`): both begin at 0 and look alike.
fn settle_times(log: &mut Log, state: &mut State) {
    // A log of as many frames in which each cycle is shorter than the one before has not been seen.
    const ENOUGH: usize = 20;
    let times: Vec<SignedTime> = log.frames.iter().filter_map(|logged| logged.at).collect();
    if times.len() < 3 || times[0] != 0 {
        return;
    }
    let back = times.windows(2).filter(|two| two[1] < two[0]).count();
    if back >= 2 && back * 8 >= times.len() {
        state.relative = true;
        let note = "times go back, so each is taken to count from the frame before (candump -td)";
        log.notes.push(note.to_owned());
    } else if times.len() < ENOUGH {
        for logged in &mut log.frames {
            logged.at = None;
        }
        let note = "whether times count from the first frame or from the one before, so short a log does not show (candump -tz, -td)";
        log.notes.push(note.to_owned());
    }
}

/// Times of a clock that begins again after `period`, as times since the first frame.
fn unwrap_times(frames: &mut [LogEntry], period: SignedTime) {
    let first = frames.iter().find_map(|logged| logged.at).unwrap_or(0);
    let (mut before, mut added) = (None, first.saturating_neg());
    for logged in frames {
        let Some(at) = logged.at else {
            continue;
        };
        if before.is_some_and(|before: SignedTime| before - at > period / 2) {
            added = added.saturating_add(period);
        }
        before = Some(at);
        logged.at = Some(at.saturating_add(added));
    }
}

/// Whether a line in the first part of a file is one of a frame.
pub(super) fn shows(bytes: &[u8], line: fn(&str) -> bool) -> bool {
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(HEADING)]);
    start.lines().map(str::trim).any(line)
}

pub(super) fn is_candump(bytes: &[u8]) -> bool {
    let is_frame = |line: &str| {
        let line = plain(line);
        matches!(split_time(&line), Ok((_, words)) if is_screen(&words) || is_log(&words))
    };
    bytes.trim_ascii_start().starts_with(b"(") || shows(bytes, is_frame)
}

/// The frame of these parts; `extended` as far as the log says it, and by the identifier where it does not.
pub(super) fn frame(
    (number, extended): (u32, Option<bool>),
    remote: bool,
    length: usize,
    bytes: &[&str],
    radix: u32,
) -> Result<Frame, String> {
    let known = match extended.unwrap_or(number > 0x7FF) {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let id = known.ok_or_else(|| format!("identifier {number:X} is too large"))?;
    // A raw length code above 8 has 8 bytes.
    let length = length.min(8);
    if remote {
        return Frame::remote(id, length).map_err(|bad| bad.to_string());
    }
    let data = bytes.iter().take(length).map(|text| {
        let valid = text.bytes().all(|digit| digit.is_ascii_alphanumeric());
        u8::from_str_radix(text, radix).ok().filter(|_| valid)
    });
    match data.collect::<Option<Vec<u8>>>() {
        Some(data) if data.len() == length => Frame::new(id, &data).map_err(|bad| bad.to_string()),
        _ => Err(format!("{} expected", counted(length, "data byte"))),
    }
}

pub(super) fn identifier(text: &str, radix: u32) -> Result<u32, String> {
    let digits = text.bytes().all(|digit| digit.is_ascii_alphanumeric());
    let number = u32::from_str_radix(text, radix).ok().filter(|_| digits);
    number.ok_or_else(|| format!("`{text}` is no identifier"))
}

pub(super) fn logged(channel: &str, at: Option<SignedTime>, what: LogItem) -> LogEntry {
    LogEntry {
        channel: channel.to_owned(),
        at,
        what,
        place: Place::default(),
    }
}

/// A line without the colours of a terminal and without the mark of a quotation.
fn plain(line: &str) -> String {
    // A text that is quoted has this in front of each line.
    let mut parts = line.trim_start_matches("> ").split('\x1b');
    let mut plain = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        plain.push_str(part.split_once('m').map_or(part, |(_, text)| text));
    }
    plain
}

/// The time at the beginning of a line of candump, and the words after it.
fn split_time(line: &str) -> Result<(Option<SignedTime>, Vec<&str>), String> {
    let Some(rest) = line.trim_start().strip_prefix('(') else {
        return Ok((None, line.split_whitespace().collect()));
    };
    let split = rest.split_once(')').and_then(|(time, rest)| {
        let time = match time.contains('-') {
            true => date(time),
            false => seconds(time).filter(|at| *at >= 0 && time.contains('.')),
        };
        Some((time?, rest))
    });
    let (time, rest) = split.ok_or("a time in seconds is expected in the brackets")?;
    Ok((Some(time), rest.split_whitespace().collect()))
}

/// The time of a line of candump that has a frame.
pub(in crate::capture) fn candump_time(line: &str) -> Option<SignedTime> {
    let (time, words) = split_time(line).ok()?;
    time.filter(|_| is_log(&words) || is_screen(&words))
}

/// Whether words are an interface and a frame in one word.
fn is_log(words: &[&str]) -> bool {
    let is_frame = |text: &str| {
        let id = text.split_once('#').map_or("", |(id, _)| id);
        matches!(id.len(), 3 | 8) && id.bytes().all(|digit| digit.is_ascii_hexdigit())
    };
    let named = |name: &str| name.starts_with(|first: char| first.is_ascii_alphanumeric());
    matches!(words, [name, frame] | [name, frame, "R" | "T"] if named(name) && is_frame(frame))
}

/// Whether words have a length in brackets: a frame on the screen.
fn is_screen(words: &[&str]) -> bool {
    words
        .iter()
        .skip(2)
        .take(4)
        .any(|word| length(word).is_some())
}

/// The length in `[3]`, or the raw length code in `{F}`.
fn length(word: &str) -> Option<&str> {
    let within = |open: char, close: char| word.strip_prefix(open)?.strip_suffix(close);
    let inner = within('[', ']').or_else(|| within('{', '}'))?;
    let digits = inner.bytes().all(|digit| digit.is_ascii_hexdigit());
    (digits && (1..=3).contains(&inner.len())).then_some(inner)
}

pub(super) fn candump(state: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    const FORM: &str = "(1436509052.249713) can0 201#3D4000 is expected, as candump -L writes it";
    if line.starts_with('#') || line.starts_with("^C") {
        return Ok(None);
    }
    if line.starts_with("DROPCOUNT") {
        state.lost = Some(format!("candump noted that frames are missing: {line}"));
        return Ok(None);
    }
    let line = plain(line);
    let (at, words) = split_time(&line).map_err(|_| FORM.to_owned())?;
    if let [channel, frame] | [channel, frame, "R" | "T"] = words.as_slice()
        && (is_log(&words) || at.is_some() && frame.contains('#'))
    {
        return one_word(channel, at, frame).map(Some);
    }
    if is_screen(&words) {
        state.screen = true;
        return screen(at, &words).map(Some);
    }
    // What an error frame says stands below it in words.
    let explains = state.screen && at.is_none() && line.ends_with('}');
    match (at, state.begun) {
        (None, false) => state.headings += 1,
        _ if explains => {}
        _ => return Err(FORM.to_owned()),
    }
    Ok(None)
}

/// The frame of a line of candump -L.
fn one_word(channel: &str, at: Option<SignedTime>, frame: &str) -> Result<LogEntry, String> {
    let (id, data) = frame.split_once('#').unwrap_or((frame, ""));
    let what = if data.starts_with('#') {
        LogItem::Fd
    } else if id.len() == 8 && u32::from_str_radix(id, 16).is_ok_and(|id| id & ERROR != 0) {
        LogItem::Error
    } else {
        // After `_` stands the raw length code of a frame with 8 bytes.
        let frame = frame.split('_').next().unwrap_or(frame);
        LogItem::Frame(frame.parse().map_err(|bad| format!("{bad}"))?)
    };
    Ok(logged(channel, at, what))
}

/// The frame of a line on the screen: `can0  201   [3]  3D 40 00`, with `RX - -` after the interface (`-x`), bytes in binary (`-i`), or
/// their characters after them (`-a`).
fn screen(at: Option<SignedTime>, words: &[&str]) -> Result<LogEntry, String> {
    let (channel, rest) = match words {
        [channel, "RX" | "TX", _, _, rest @ ..] | [channel, rest @ ..] => (*channel, rest),
        [] => ("", words),
    };
    let [id, stated, rest @ ..] = rest else {
        return Err("an identifier and a length are expected".to_owned());
    };
    let stated = length(stated).ok_or("a length in brackets is expected")?;
    let number = identifier(id, 16)?;
    let what = if id.len() == 8 && number & ERROR != 0 {
        LogItem::Error
    } else if stated.len() > 1 {
        // candump states the length of a frame of CAN FD with two digits.
        LogItem::Fd
    } else {
        let binary = rest.first().is_some_and(|word| word.len() == 8);
        let remote = rest.first() == Some(&"remote");
        let id = (number, Some(id.len() == 8));
        let length = usize::from_str_radix(stated, 16).unwrap_or(usize::MAX);
        LogItem::Frame(frame(
            id,
            remote,
            length,
            rest,
            if binary { 2 } else { 16 },
        )?)
    };
    Ok(logged(channel, at, what))
}
