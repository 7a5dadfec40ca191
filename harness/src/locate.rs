//! Reads from what the master receives which drive saw a fault (ND21 9.7).

use harness_proto::line::Received;
use harness_proto::novobus::sync::SYNCO;

/// Zeros in a row that no telegram holds: one more than the seven of ND21 9.7 would be sure, but the
/// last drive of a broken ring sends just seven (the figure of 9.9).
const ZEROS: usize = 7;
/// How often an address must repeat before it counts: it comes "for ever".
const REPEATS: usize = 4;
/// The most zeros in front of an address (ND21 9.7).
pub const MAX_ZEROS: usize = 25;

/// A drive that the ring spells out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Location {
    /// Its number.
    pub drive: u8,
    /// The zeros in front of its address; `None` for drive 0, whose address is a zero itself.
    pub zeros: Option<u64>,
}

/// The drive that the ring spells out, from what was received since the last check sequence.
#[must_use]
pub fn locate(received: &[Received], drives: u8) -> Option<Location> {
    let last = received.last()?;
    let repeats = received
        .iter()
        .rev()
        .take_while(|byte| *byte == last)
        .count();
    if last.error.is_some() || repeats < REPEATS {
        return None;
    }
    if last.byte == 0 {
        return (repeats > MAX_ZEROS).then_some(Location {
            drive: 0,
            zeros: None,
        });
    }
    if last.byte >= drives {
        return None;
    }
    // Behind a time-out the addresses climb for a byte or two: 00 00 01 02 02 (ND21 9.9).
    let mut before = &received[..received.len() - repeats];
    let mut lowest = last.byte;
    while let [rest @ .., byte] = before
        && byte.error.is_none()
        && (1..lowest).contains(&byte.byte)
    {
        lowest = byte.byte;
        before = rest;
    }
    let zeros = before.iter().rev().take_while(|byte| byte.is(0)).count();
    // SYNCO behind the seven zeros of a telegram is no address, although some rings have a drive 128.
    let fewest = if last.byte == SYNCO { ZEROS + 1 } else { ZEROS };
    (zeros >= fewest).then_some(Location {
        drive: last.byte,
        zeros: Some(zeros as u64),
    })
}
