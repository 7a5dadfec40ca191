//! In-band marks: the meaning of a stream with marks does not depend on where it is split.

use crate::fuzz::LONGEST;
use crate::fuzz::{Feature, Notebook};
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::line::{LineError, Received};
use harness_proto::marks::{BadMark, Unmark, mark};

type Read = Vec<Result<Received, BadMark>>;

/// A stream as it is read from a socket or a pseudo terminal (PARMRK, termios).
struct Stream<'a> {
    /// Where it is cut in two, and the length of its pieces less one.
    cut: u8,
    bytes: &'a [u8],
}

impl<'a> Arbitrary<'a> for Stream<'a> {
    /// The cut, then the bytes.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        Ok(Self {
            cut: input.arbitrary()?,
            bytes: input.bytes(input.len().min(LONGEST))?,
        })
    }
}

/// A stream means the same however it is cut.
///
/// # Panics
/// Another split gives other bytes; a byte is invented or lost; bytes that are written again with marks are
/// read differently; a good end is taken for the middle of a mark, or the reverse.
pub fn links(data: &[u8]) {
    let Ok(Stream { cut, bytes: stream }) = Unstructured::new(data).arbitrary() else {
        return;
    };
    let (whole, boundary) = read([stream]);
    let pieces = stream.chunks(usize::from(cut) + 1);
    assert_eq!(read(pieces), (whole.clone(), boundary), "cut at {cut}");
    let (front, back) = stream.split_at(usize::from(cut).min(stream.len()));
    assert_eq!(
        read([front, &[], back]),
        (whole.clone(), boundary),
        "at {cut}"
    );
    assert!(whole.len() <= stream.len(), "a byte out of nothing");
    assert!(
        3 * whole.len() + 2 >= stream.len(),
        "a mark has at most three bytes"
    );
    again(&whole);
    as_line(stream);
}

/// How many features there are: three places in a mark, and there three bytes, a cut and the end.
pub(super) fn count() -> usize {
    3 * 5
}

/// Plays an input, and names what comes where in a mark.
///
/// # Panics
/// As the target.
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    links(data);
    let Ok(Stream { cut, bytes: stream }) = Unstructured::new(data).arbitrary() else {
        return;
    };
    let mut mark = "between marks";
    let mut note = |mark, what| notes.note(|| Feature::new("", mark, what));
    for (index, byte) in stream.iter().enumerate() {
        if index == usize::from(cut) {
            note(mark, "the stream is cut");
        }
        let what = match byte {
            0 => "00",
            0xFF => "FF",
            _ => "another byte",
        };
        note(mark, what);
        mark = match (mark, byte) {
            ("between marks", 0xFF) => "behind FF",
            ("behind FF", 0) => "behind FF 00",
            _ => "between marks",
        };
    }
    note(mark, "the stream ends");
}

fn read<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> (Read, bool) {
    let mut unmark = Unmark::default();
    let mut read = Vec::new();
    for piece in pieces {
        read.extend(piece.iter().filter_map(|byte| unmark.push(*byte)));
    }
    (read, unmark.at_boundary())
}

/// Writes the bytes that were read with marks, and reads them again.
fn again(read_first: &Read) {
    let good: Vec<_> = read_first.iter().copied().filter_map(Result::ok).collect();
    let mut stream = Vec::new();
    for received in &good {
        stream.extend_from_slice(mark(*received).as_bytes());
    }
    let expected: Read = good.into_iter().map(Ok).collect();
    assert_eq!(read([&stream[..]]), (expected, true));
}

/// The input as bytes of a line, every third of them damaged: each comes back with its error, as far as the coding tells.
fn as_line(bytes: &[u8]) {
    let errors = [None, Some(LineError::Parity), Some(LineError::Framing)];
    let sent = bytes.iter().zip(errors.into_iter().cycle());
    let mut stream = Vec::new();
    let mut expected = Read::new();
    for (&byte, error) in sent {
        stream.extend_from_slice(mark(Received { byte, error }).as_bytes());
        let seen = error.map(|_| match byte {
            0 => LineError::Break,
            _ => LineError::Parity,
        });
        expected.push(Ok(Received { byte, error: seen }));
    }
    assert_eq!(read([&stream[..]]), (expected, true));
}
