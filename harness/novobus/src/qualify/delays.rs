//! Bytes that a drive sends late each time, within the tolerance of the rig's file (ND21 8.2: every drive takes a byte time).
//!
//! A computer is late at any byte, and not at the same byte of most telegrams. Where the lateness rises by much from one byte to the next, at
//! the same place of most telegrams to one drive and of hardly any to the others, that drive holds the byte back.

use crate::twin::Conversation;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::time::Span;
use std::collections::BTreeMap;
use std::fmt;

/// The conversation that shows it.
pub(super) const DELAYS: &str = "qualify-delays";

/// How long a telegram of that conversation is, with the SYNCO behind it.
const TELEGRAM: usize = 12;

/// How many telegrams each drive must have had.
const ENOUGH: usize = 16;

/// From which rise of the lateness on a byte is late.
const LATE: Span = Span::from_millis(2);

/// How many quarters of the telegrams to a drive must have a late byte at the same place, and those to other drives none.
const MOST_OF_THEM: usize = 3;

/// A drive that holds a byte back each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HeldBack {
    drive: u8,
    role: Role,
    by: Span,
}

impl fmt::Display for HeldBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { drive, role, by } = self;
        let (_, what) = role.rule();
        let tenths = by.as_nanos() / 100_000;
        write!(
            f,
            "drive {drive}: it sends its byte \"{what}\" {}.{} ms late each time, which the tolerance of the rig's file permits (ND21 8.2)",
            tenths / 10,
            tenths % 10
        )
    }
}

/// The drives of a ring of `drives` that hold a byte of their telegrams back. Nothing where bytes are missing.
pub(super) fn held_back(drives: u8, byte_time: Span, conversation: &Conversation) -> Vec<HeldBack> {
    let sent = conversation.sent_in(0);
    let received = conversation.received_in(0);
    let size = RingSize::new(u64::from(drives));
    let Some(size) = size.ok().filter(|_| sent.len() == received.len()) else {
        return Vec::new();
    };
    let way = byte_time * (u64::from(drives) + 1);
    let times = conversation.sent_at(0).into_iter().zip(&received);
    let late: Vec<Span> = times
        .map(|(sent, (came, _))| came.since(sent + way))
        .collect();
    let roles = roles(size, &sent);
    let mut telegrams: BTreeMap<u8, Vec<&[Span]>> = BTreeMap::new();
    for (telegram, late) in roles
        .chunks_exact(TELEGRAM)
        .zip(late.chunks_exact(TELEGRAM))
    {
        let Some(drive) = telegram.iter().find_map(|role| role.drive()) else {
            return Vec::new();
        };
        telegrams.entry(drive).or_default().push(late);
    }
    if telegrams.values().any(|telegrams| telegrams.len() < ENOUGH) {
        return Vec::new();
    }
    let rises = |drive: u8, place: usize| -> Vec<Span> {
        let rises = telegrams[&drive]
            .iter()
            .map(|telegram| telegram[place].saturating_sub(telegram[place - 1]));
        rises.filter(|rise| *rise >= LATE).collect()
    };
    let quarters =
        |drive: u8, place: usize| rises(drive, place).len() * 4 / telegrams[&drive].len();
    let places = (1..TELEGRAM).flat_map(|place| telegrams.keys().map(move |drive| (place, *drive)));
    let alone = |(place, drive): &(usize, u8)| {
        let mut others = telegrams.keys().filter(|other| *other != drive);
        quarters(*drive, *place) >= MOST_OF_THEM
            && others.all(|other| quarters(*other, *place) == 0)
    };
    let held = places.filter(alone).map(|(place, drive)| HeldBack {
        drive,
        role: roles[place],
        by: rises(drive, place).into_iter().min().unwrap_or_default(),
    });
    held.filter(|held| held.role.drive().is_some()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::twin::Done;
    use harness_proto::line::Received;
    use harness_proto::time::Instant;

    const BYTE: Span = Span::from_micros(286);

    /// A ring of three behind a computer that is late at random, and by 30 ms now and then; drive 1 holds this byte of its telegrams back.
    fn conversation(held: usize, by: Span) -> Conversation {
        let mut conversation = Conversation::default();
        let mut dice = fastrand::Rng::with_seed(7);
        let mut at = Instant::START;
        for drive in 0..3_u8 {
            for _ in 0..24 {
                let bytes = [0x88, drive.wrapping_sub(3), 0xC0, 0x13, 0xFE, 0xD1];
                let bytes = bytes.into_iter().chain([0x80; 6]).enumerate();
                let mut free = Instant::START;
                for (place, byte) in bytes {
                    conversation.done.push((0, Done::Sent(at, byte)));
                    let noise = match dice.u8(..) {
                        0..=9 => Span::from_millis(30),
                        _ => Span::from_micros(dice.u64(..300)),
                    };
                    let held = drive == 1 && place == held;
                    let delay = if held { by } else { Span::ZERO };
                    // A byte overtakes none.
                    free = (free + BYTE).max(at + BYTE * 4 + delay);
                    let received = (0, free + noise, Received::good(byte));
                    conversation.received.push(received);
                    at += BYTE;
                }
                at += Span::from_millis(11);
            }
        }
        conversation
    }

    /// ND21 8.2: a checking byte that comes 5 ms late each time is that drive's, however busy the computer is.
    #[test]
    fn a_byte_that_is_held_back_each_time_is_found() {
        let late = held_back(3, BYTE, &conversation(5, Span::from_millis(5)));
        let [only] = late[..] else { panic!("{late:?}") };
        let text = only.to_string();
        assert!(
            text.starts_with("drive 1: it sends its byte \"checking byte"),
            "{text}"
        );
        assert!(
            only.by > Span::from_millis(4) && only.by < Span::from_millis(6),
            "{text}"
        );
    }

    #[test]
    fn a_busy_computer_accuses_no_drive() {
        assert_eq!(held_back(3, BYTE, &conversation(5, Span::ZERO)), []);
        assert_eq!(
            held_back(3, BYTE, &conversation(5, Span::from_millis(1))),
            []
        );
        // A byte is lost.
        let mut less = conversation(5, Span::from_millis(5));
        less.received.pop();
        assert_eq!(held_back(3, BYTE, &less), []);
    }
}
