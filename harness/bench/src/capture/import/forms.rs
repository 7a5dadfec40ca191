//! Logs of frames by other programs than candump, a frame a line.
//!
//! | form | a line |
//! |---|---|
//! | TRC (PEAK) | `1)  1059.9 1  Rx  0201 -  3  3D 40 00`; the columns follow from the version, or stand in the heading |
//! | csv (GVRET, SavvyCAN) | `39747828,00000201,false,Rx,0,3,3D,40,00,`; microseconds |
//! | BUSMASTER | `11:49:12:9420 Rx 1 0x201 s 3 3D 40 00`; tenths of a millisecond |
//! | CRTD (OVMS) | `1320745424.002 1R11 201 3D 40 00` |
//! | python-can's text | `Timestamp: 1700000000.1 ID: 201 S Rx DL: 3 3d 40 00 Channel: can0` |
//! | Kvaser's text | `0 00000201 3 3D 40 00 154.266550 R`, in hexadecimal |
//! | CANHacker | `17,123 201 3 3D 40 00`; the time begins again each minute |

use super::logs::{State, frame, identifier, logged, shows};
use super::numbers::{SignedTime, seconds};
use super::table::first_line;
use crate::capture::frames::{LogEntry, LogItem};

/// Units of a second.
const SECOND: SignedTime = 3_000_000_000;

/// The words of the first line that is not empty.
fn begins(bytes: &[u8], words: &[&str]) -> bool {
    let first = first_line(bytes.trim_ascii_start());
    let mut parts = first.split_whitespace();
    words.iter().all(|word| parts.next() == Some(word))
}

pub(super) fn is_trc(bytes: &[u8]) -> bool {
    bytes.starts_with(b";$FILEVERSION")
        || bytes.starts_with(b";##") && shows(bytes, |line| line.starts_with(";----+-"))
}

pub(super) fn is_gvret(bytes: &[u8]) -> bool {
    first_line(bytes).starts_with("Time Stamp,ID,Extended,")
}

pub(super) fn is_busmaster(bytes: &[u8]) -> bool {
    bytes.starts_with(b"***BUSMASTER")
}

pub(super) fn is_crtd(bytes: &[u8]) -> bool {
    let is_line = |line: &str| {
        let mut words = line.split_whitespace();
        let time = words.next().and_then(seconds);
        time.is_some() && words.next().is_some_and(|kind| crtd_kind(kind).is_some())
    };
    shows(bytes, is_line)
}

pub(super) fn is_printed(bytes: &[u8]) -> bool {
    begins(bytes, &["Timestamp:"]) && shows(bytes, |line| line.contains(" DL:"))
}

pub(super) fn is_kvaser(bytes: &[u8]) -> bool {
    begins(bytes, &["Chn", "Identifier", "Flg"])
}

pub(super) fn is_canhacker(bytes: &[u8]) -> bool {
    begins(bytes, &["Time", "ID", "DLC", "Data"])
}

/// The number of data bytes, or a length code.
fn stated(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|length| *length <= 64);
    number.ok_or_else(|| format!("`{text}` is no length of the data"))
}

/// N number, O time in milliseconds, B bus, T type, d direction or type, I identifier, R reserved, l or L length, D data.
pub(super) fn trc(state: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    if let Some(heading) = line.strip_prefix(';') {
        if let Some(version) = heading.strip_prefix("$FILEVERSION=") {
            let columns = match version.trim() {
                "1.0" => "NOIlD",
                "1.1" => "NOdIlD",
                "1.2" => "NOBdIlD",
                "1.3" => "NOBdIRlD",
                "2.0" => "NOTIdlD",
                "2.1" => "NOTBIdRLD",
                _ => return Err("versions 1.0 to 2.1 of TRC are read".to_owned()),
            };
            columns.clone_into(&mut state.columns);
        } else if let Some(columns) = heading.strip_prefix("$COLUMNS=") {
            state.columns = columns.split(',').map(str::trim).collect();
        }
        return Ok(None);
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    // Version 1.0 has no line that says so.
    let columns = match state.columns.as_str() {
        "" => "NOIlD",
        columns => columns,
    };
    let place = |letter: char| columns.chars().position(|column| column == letter);
    let word = |letter| place(letter).and_then(|at| words.get(at).copied());
    let at = word('O').and_then(|text| seconds(&format!("{text}e-3")));
    let at = at.ok_or("a time in milliseconds is expected")?;
    let kind = word('T').or_else(|| word('d')).unwrap_or("Rx");
    let channel = word('B').unwrap_or_default();
    let remote = kind == "RR";
    match kind {
        "DT" | "RR" | "Rx" | "Tx" => {}
        "FD" | "FB" | "FE" | "BI" => return Ok(Some(logged(channel, Some(at), LogItem::Fd))),
        "ER" | "Error" => return Ok(Some(logged(channel, Some(at), LogItem::Error))),
        _ => return Ok(None),
    }
    let id = word('I').ok_or("an identifier is expected")?;
    // In version 1.0 an event of the bus.
    if id == "FFFFFFFF" {
        return Ok(None);
    }
    let number = identifier(id, 16)?;
    let length = word('l').or_else(|| word('L')).unwrap_or_default();
    let data = place('D')
        .and_then(|at| words.get(at..))
        .unwrap_or_default();
    let remote = remote || data.first() == Some(&"RTR");
    let id = (number, Some(id.len() > 4));
    let frame = frame(id, remote, stated(length)?, data, 16)?;
    Ok(Some(logged(channel, Some(at), LogItem::Frame(frame))))
}

pub(super) fn gvret(state: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    if line.starts_with("Time Stamp") {
        line.clone_into(&mut state.columns);
        return Ok(None);
    }
    let columns: Vec<&str> = state.columns.split(',').map(str::trim).collect();
    let place = |name: &str| columns.iter().position(|column| *column == name);
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let field = |name| {
        place(name)
            .and_then(|at| fields.get(at).copied())
            .unwrap_or_default()
    };
    let at = seconds(&format!("{}e-6", field("Time Stamp")));
    let at = at.ok_or("a time in microseconds is expected")?;
    let number = identifier(field("ID"), 16)?;
    let extended = field("Extended").eq_ignore_ascii_case("true");
    let data = place("LEN")
        .and_then(|at| fields.get(at + 1..))
        .unwrap_or_default();
    let what = match stated(field("LEN"))? {
        // Frames of CAN FD stand in the same columns.
        9.. => LogItem::Fd,
        length => LogItem::Frame(frame((number, Some(extended)), false, length, data, 16)?),
    };
    Ok(Some(logged(field("Bus"), Some(at), what)))
}

pub(super) fn busmaster(state: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    state.wraps = Some(86_400 * SECOND);
    if let Some(heading) = line.strip_prefix("***") {
        match heading.trim_end_matches('*') {
            "DEC" => state.radix = 10,
            "RELATIVE MODE" => state.relative = true,
            _ => {}
        }
        return Ok(None);
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    let [time, "Rx" | "Tx", channel, id, kind, length, data @ ..] = words.as_slice() else {
        return Err("11:49:12:9420 Rx 1 0x201 s 3 3D 40 00 is expected".to_owned());
    };
    let parts: Vec<&str> = time.splitn(4, ':').collect();
    let at = match parts.as_slice() {
        [hours, minutes, second, part] => {
            let whole = |text: &str| text.parse::<u8>().ok().map(SignedTime::from);
            let seconds = seconds(&format!("{second}.{part}"));
            whole(hours)
                .zip(whole(minutes))
                .zip(seconds)
                .map(|((hours, minutes), seconds)| (hours * 60 + minutes) * 60 * SECOND + seconds)
        }
        _ => None,
    };
    let at = at.ok_or("hours, minutes, seconds and tenths of a millisecond are expected")?;
    let number = identifier(id.trim_start_matches("0x"), state.radix)?;
    let (extended, remote) = match *kind {
        "s" => (false, false),
        "x" => (true, false),
        "sr" => (false, true),
        "xr" => (true, true),
        _ => return Err(format!("`{kind}` is no type: s, x, sr or xr expected")),
    };
    let frame = frame(
        (number, Some(extended)),
        remote,
        stated(length)?,
        data,
        state.radix,
    )?;
    Ok(Some(logged(channel, Some(at), LogItem::Frame(frame))))
}

/// The bus of `2R11`, and whether identifiers have 29 bits.
fn crtd_kind(kind: &str) -> Option<(&str, bool)> {
    let split = kind.find(['R', 'T'])?;
    let (bus, kind) = kind.split_at(split);
    let digits = bus.bytes().all(|digit| digit.is_ascii_digit());
    match kind {
        "R11" | "T11" if digits => Some((bus, false)),
        "R29" | "T29" if digits => Some((bus, true)),
        _ => None,
    }
}

pub(super) fn crtd(_: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (time, kind, rest) = match words.as_slice() {
        [time, kind, rest @ ..] => (*time, *kind, rest),
        _ => return Err("1320745424.002 1R11 201 3D 40 00 is expected".to_owned()),
    };
    // Comments, events and states of the logger.
    let Some((bus, extended)) = crtd_kind(kind) else {
        return Ok(None);
    };
    let at = seconds(time).filter(|_| time.contains('.'));
    let at = at.ok_or("a time in seconds is expected")?;
    let [id, data @ ..] = rest else {
        return Err("an identifier is expected".to_owned());
    };
    let id = (identifier(id, 16)?, Some(extended));
    if data.len() > 8 {
        return Err("at most 8 data bytes are expected".to_owned());
    }
    let frame = frame(id, false, data.len(), data, 16)?;
    Ok(Some(logged(bus, Some(at), LogItem::Frame(frame))))
}

pub(super) fn printed(_: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let behind = |name: &str| {
        let at = words.iter().position(|word| *word == name)?;
        words.get(at + 1..)
    };
    let first = |name: &str| behind(name).and_then(|words| words.first().copied());
    let (Some(time), Some(id), Some([length, data @ ..])) =
        (first("Timestamp:"), first("ID:"), behind("DL:"))
    else {
        return Err("Timestamp, ID and DL are expected".to_owned());
    };
    let at = seconds(time).ok_or("a time in seconds is expected")?;
    let flags = words.iter().take_while(|word| **word != "DL:");
    let has = |flag: &str| flags.clone().any(|word| *word == flag);
    let what = if has("E") {
        LogItem::Error
    } else if has("F") {
        LogItem::Fd
    } else {
        let id = (identifier(id, 16)?, Some(has("X")));
        LogItem::Frame(frame(id, has("R"), stated(length)?, data, 16)?)
    };
    let channel = first("Channel:").unwrap_or_default();
    Ok(Some(logged(channel, Some(at), what)))
}

pub(super) fn kvaser(_: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [channel, id, rest @ .., time, "R" | "T"] = words.as_slice() else {
        return match words.first() {
            Some(&"Chn") => Ok(None),
            _ => Err("0 00000201 3 3D 40 00 154.266550 R is expected".to_owned()),
        };
    };
    let at = seconds(time).ok_or("a time in seconds is expected")?;
    if id.contains("Error") {
        return Ok(Some(logged(channel, Some(at), LogItem::Error)));
    }
    let number = identifier(id, 16)?;
    // Flags may stand in front of the length.
    let is_length = |word: &&str| word.len() == 1 && word.as_bytes()[0].is_ascii_digit();
    let start = rest.iter().position(is_length).unwrap_or(rest.len());
    let [length, data @ ..] = &rest[start..] else {
        return Err("a length is expected".to_owned());
    };
    let remote = rest[..start].contains(&"R");
    // The file does not say its radix: with it in decimal, identifiers and bytes are not filled up with zeros.
    if id.len() < 8 || data.iter().any(|byte| byte.len() != 2) {
        return Err(
            "the log is not in hexadecimal; save it with hexadecimal identifiers and data"
                .to_owned(),
        );
    }
    let frame = frame((number, None), remote, stated(length)?, data, 16)?;
    Ok(Some(logged(channel, Some(at), LogItem::Frame(frame))))
}

pub(super) fn canhacker(state: &mut State, line: &str) -> Result<Option<LogEntry>, String> {
    state.wraps = Some(60 * SECOND);
    let words: Vec<&str> = line.split_whitespace().collect();
    let [time, id, length, data @ ..] = words.as_slice() else {
        return Err("17,123 201 3 3D 40 00 is expected".to_owned());
    };
    if *time == "Time" {
        return Ok(None);
    }
    let at = seconds(time).ok_or("a time in seconds is expected")?;
    let frame = frame(
        (identifier(id, 16)?, None),
        false,
        stated(length)?,
        data,
        16,
    )?;
    Ok(Some(logged("", Some(at), LogItem::Frame(frame))))
}
