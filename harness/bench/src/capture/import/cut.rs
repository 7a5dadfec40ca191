//! Files that were cut, by a full disk or a power failure: what is whole is read, and the rest is counted in a note.

use super::super::CaptureError;
use crate::counted::counted;
use std::borrow::Cow;

/// What a format's files consist of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parts {
    /// Blocks of known lengths: the format's reader sees where they end.
    Blocks,
    /// Words: the format's reader knows which one may be the last.
    Words,
    /// Lines, each with an end.
    Lines,
    /// A list of JSON objects, which no other list follows.
    Objects,
}

/// The complete part of a file, and notes about the rest.
///
/// # Errors
/// A file of lines in which no line has an end.
pub(super) fn whole_part(
    bytes: &[u8],
    parts: Parts,
) -> Result<(Cow<'_, [u8]>, Vec<String>), CaptureError> {
    if parts == Parts::Blocks {
        return Ok((Cow::Borrowed(bytes), Vec::new()));
    }
    let last = bytes.iter().rposition(|byte| *byte != 0);
    let (text, zeros) = bytes.split_at(last.map_or(0, |last| last + 1));
    let mut notes = Vec::new();
    if !zeros.is_empty() {
        let zeros = counted(zeros.len(), "zero byte");
        notes.push(format!(
            "the file ends with {zeros}, as after a power failure: not read"
        ));
    }
    let whole = match parts {
        Parts::Blocks | Parts::Words => Cow::Borrowed(text),
        Parts::Lines => {
            let (whole, rest) = lines(text)?;
            if rest > 0 {
                notes.push(format!(
                    "the file ends in the middle of a line: its last {} not read; end the line if it is whole",
                    counted(rest, "byte")
                ));
            }
            Cow::Borrowed(whole)
        }
        Parts::Objects => {
            let (whole, rest) = objects(text);
            if rest > 0 {
                notes.push(format!(
                    "the file ends in the middle of its list: its last {} not read",
                    counted(rest, "byte")
                ));
            }
            whole
        }
    };
    Ok((whole, notes))
}

/// The lines that have an end, and how many bytes are after them.
fn lines(text: &[u8]) -> Result<(&[u8], usize), CaptureError> {
    let end = text.iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
    let (whole, rest) = text.split_at(end.map_or(0, |last| last + 1));
    if whole.is_empty() {
        return Err(CaptureError::Link {
            place: "line 1".to_owned(),
            what: "it has no line end, so it may have been cut; end it if it is whole".to_owned(),
        });
    }
    let blank = rest.trim_ascii().is_empty();
    Ok((whole, if blank { 0 } else { rest.len() }))
}

/// The objects of a list that are whole, as a text of JSON, and how many bytes are after them. What follows an object shows that it is whole.
fn objects(text: &[u8]) -> (Cow<'_, [u8]>, usize) {
    let parsed = serde_json::from_slice::<serde::de::IgnoredAny>(text);
    let between = text.windows(3).rposition(|window| window == b"},{");
    match (parsed, between) {
        (Err(error), Some(last)) if error.is_eof() => {
            let (whole, rest) = text.split_at(last + 1);
            (Cow::Owned([whole, b"]}"].concat()), rest.len())
        }
        _ => (Cow::Borrowed(text), 0),
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::read_with;
    use super::super::ReadSettings;

    const LINES: [&str; 3] = [
        "(1.100000) can0 201#3DE200\n",
        "(1.100400) can0 181#E2010000\n",
        "(1.200000) can0 201#3DE200\n",
    ];
    const ASC: [&str; 4] = [
        "base hex  timestamps absolute\n",
        "1.1 1  201  Rx  d 3 3D E2 00\n",
        "1.1004 1  181  Rx  d 4 E2 01 00 00\n",
        "1.2 1  201  Rx  d 3 3D E2 00\n",
    ];
    const CSV: [&str; 4] = [
        "t_ns,from,id,remote,dlc,data,ended\n",
        "1000000,master,201,0,3,3DE200,\n",
        "1400000,1,181,0,4,E2010000,\n",
        "9000000,master,201,0,3,3DE200,\n",
    ];
    const JSON: [&str; 4] = [
        "{\"schema\":2,\"frames\":[",
        "{\"t_ns\":1000000,\"id\":513,\"data\":[61,226,0],\"from\":\"master\",\"fault\":null},",
        "{\"t_ns\":1400000,\"id\":385,\"data\":[226,1,0,0],\"from\":1,\"fault\":null},",
        "{\"t_ns\":9000000,\"id\":513,\"data\":[61,226,0],\"from\":\"master\",\"fault\":null}]}\n",
    ];

    /// The frames of a file, and the notes.
    fn read(text: &[u8]) -> (Vec<String>, Vec<String>) {
        let read = read_with(text, &ReadSettings::default()).expect("a capture");
        let frames = read.capture.traces[0].channels[0].frames();
        let frames = frames.iter().map(|frame| frame.frame.to_string()).collect();
        (frames, read.notes)
    }

    /// Cut anywhere in the last line but one or after it, a log has the frames in front of the cut and no other.
    #[test]
    fn a_cut_log_has_its_whole_lines_and_no_other() {
        for parts in [&LINES[..], &ASC, &CSV] {
            let all = parts.concat();
            let (frames, notes) = read(all.as_bytes());
            assert_eq!((frames.len(), notes.len()), (3, 0), "{all}");
            let begin = all.len() - parts[parts.len() - 2..].concat().len();
            for cut in begin..all.len() {
                let text = &all[..cut];
                let whole = text.matches('\n').count() + 3 - parts.len();
                let (found, notes) = read(text.as_bytes());
                assert_eq!(found, frames[..whole], "{text}");
                let half = !text.ends_with('\n');
                assert_eq!(notes.len(), usize::from(half), "{notes:?} {text}");
            }
        }
    }

    #[test]
    fn a_cut_list_of_objects_has_those_that_another_one_follows() {
        let all = JSON.concat();
        let (frames, _) = read(all.as_bytes());
        let begin = all.len() - JSON[3].len();
        for cut in begin + 1..all.len() - 1 {
            let (found, notes) = read(&all.as_bytes()[..cut]);
            assert_eq!((found.as_slice(), notes.len()), (&frames[..2], 1), "{cut}");
        }
    }

    #[test]
    fn zero_bytes_at_the_end_are_counted() {
        let log = LINES.concat();
        for (cut, expected) in [(log.len(), 3), (log.len() - 3, 2)] {
            let mut bytes = log.as_bytes()[..cut].to_vec();
            bytes.resize(cut + 512, 0);
            let (frames, notes) = read(&bytes);
            assert_eq!(frames.len(), expected);
            assert!(notes[0].contains("512 zero bytes"), "{notes:?}");
        }
    }

    #[test]
    fn a_file_of_half_a_line_is_refused() {
        let error = read_with(b"(1.1) can0 201#3D", &ReadSettings::default());
        let error = error.expect_err("half a line").to_string();
        assert!(error.starts_with("line 1: it has no line end"), "{error}");
    }
}
