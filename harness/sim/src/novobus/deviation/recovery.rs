//! Deviations in what a drive does with the byte in error, with the zeros behind it and with a check sequence that
//! breaks off (ND21 9.7, 9.8).

use super::how::{Deviation, How, Moment, wrong};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::bus_end::Place;
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::command::Field;
use harness_proto::novobus::error_mode::{Marks, OffendingZero, UPSTREAM_ZEROS};

pub(super) static DEVIATIONS: &[Deviation] = &[
    passes(
        "bad-sync-byte-passed-on",
        "it passes a bad sync byte on, and sends 00 only from the next byte",
        |m, byte| offending(m, byte, m.place == Place::Sync),
    ),
    passes(
        "unknown-command-passed-on",
        "it passes an unknown command byte on, and sends 00 only from the next byte",
        |m, byte| offending(m, byte, m.place == Place::Command),
    ),
    passes(
        "wrong-parameter-passed-on",
        "it passes a parameter that it cannot accept on, and sends 00 only from the next byte",
        |m, byte| offending(m, byte, m.parameter().is_some() && m.check().is_none()),
    ),
    passes(
        "wrong-checksum-passed-on",
        "it passes a wrong checking byte on, and sends 00 only from the next byte",
        |m, byte| offending(m, byte, m.check().is_some()),
    ),
    wrong(
        "offending-zero-not-counted",
        "9.7",
        "it does not count the byte in error among the eight zeros, even where it is a good 00",
        How::Amends(|_, rules| rules.offending_zero = OffendingZero::Never),
    ),
    wrong(
        "offending-byte-counted-as-zero",
        "9.7",
        "it counts the byte in error among the eight zeros, whatever it is",
        How::Amends(|_, rules| rules.offending_zero = OffendingZero::AnyByte),
    ),
    wrong(
        "zeros-need-not-be-in-a-row",
        "9.7",
        "its count of zeros does not start again at another byte",
        How::Amends(|_, rules| rules.zeros_in_a_row = false),
    ),
    wrong(
        "damaged-zeros-counted",
        "9.7",
        "it counts a 00 with a line error among the eight zeros",
        How::Hears(|m| match m.place {
            Place::ErrorMode if m.received.byte == 0 => Received::good(0),
            _ => m.received,
        }),
    ),
    wrong(
        "check-sequence-not-restarted",
        "9.8",
        "it does not take an FF that breaks a check sequence for the first byte of another one",
        How::Hears(|m| match m.matched {
            1.. if m.place == Place::ErrorMode && m.received.is(SEQUENCE[0]) => {
                Received::bad(SEQUENCE[0], LineError::Parity)
            }
            _ => m.received,
        }),
    ),
    wrong(
        "broken-check-sequence-accepted",
        "9.8",
        "it takes the five bytes for a check sequence although others stand between them",
        How::Leaves(|m| m.in_order),
    ),
    wrong(
        "damaged-check-sequence-accepted",
        "9.8",
        "it takes a byte of a check sequence with a line error for a good one",
        How::Hears(|m| match SEQUENCE.get(usize::from(m.matched)) {
            Some(due) if m.place == Place::ErrorMode && m.received.byte == *due => {
                Received::good(*due)
            }
            _ => m.received,
        }),
    ),
    wrong(
        "check-sequence-third-byte-any",
        "9.8",
        "it takes any byte for the 72 of a check sequence",
        How::Mistakes(
            |m| match (m.place, m.matched) {
                (Place::ErrorMode, 2) => m.good(SEQUENCE[2]),
                _ => m.received,
            },
            |m, byte| {
                let third = m.place == Place::ErrorMode && m.matched == 2 && byte == SEQUENCE[2];
                Some(if third { m.received.byte } else { byte })
            },
        ),
    ),
    wrong(
        "check-sequence-only-behind-zeros",
        "9.8",
        "it takes a check sequence only where eight zeros stand directly before it",
        How::Hears(|m| {
            let begins = m.place == Place::ErrorMode && m.received.is(SEQUENCE[0]);
            match begins && m.zeros_before < UPSTREAM_ZEROS {
                true => Received::bad(SEQUENCE[0], LineError::Parity),
                false => m.received,
            }
        }),
    ),
    wrong(
        "command-kept-over-a-check-sequence",
        "9.8",
        "it goes on behind a check sequence with the command that was half received before the error",
        How::Keeps,
    ),
    cut(
        "synco-cuts-commands",
        "it forgets a half received command at SYNCO",
        |m| m.at_sync(0x80),
    ),
    cut(
        "pause-cuts-commands",
        "it forgets a half received command at PAUSE",
        |m| m.at_sync(0x81),
    ),
    cut(
        "telegram-cuts-commands",
        "it forgets a half received command at the next telegram with its address",
        |m| m.place == Place::Address && m.received.is(0xFF),
    ),
    cut(
        "other-telegram-cuts-commands",
        "it forgets a half received command at a telegram to another drive",
        |m| m.place == Place::Address && !m.received.is(0xFF),
    ),
    cut(
        "short-address-cuts-commands",
        "it forgets a half received command at a telegram with a short address",
        |m| m.place == Place::Sync && m.received.byte & 0xB0 == 0xA0,
    ),
    cut(
        "process-data-cut-commands",
        "it forgets a half received command at process data in its own telegram",
        |m| m.place == Place::ProcessLow,
    ),
    wrong(
        "error-in-telegrams-for-others",
        "9.7",
        "it looks for command bytes in telegrams for other drives and goes into the error mode over an FF there",
        How::Hears(|m| match m.place {
            Place::Passing if m.received.is(0xFF) => Received::bad(0xFF, LineError::Parity),
            _ => m.received,
        }),
    ),
    wrong(
        "eight-zeros-in-a-telegram-needed-as-seven",
        "9.7",
        "it goes into the error mode at the seventh zero of a telegram for another drive",
        How::Hears(|m| match m.place {
            Place::Passing if m.zeros >= 7 => Received::bad(0, LineError::Parity),
            _ => m.received,
        }),
    ),
    wrong(
        "fixed-byte-case-ignored",
        "10.1",
        "it takes a fixed byte of a command for right where only bit 5 is wrong",
        How::Hears(|m| match m.parameter().map(|p| p.field) {
            Some(Field::Fixed(right)) if m.received.is(right ^ 0x20) => m.good(right),
            _ => m.received,
        }),
    ),
];

/// One kind of byte in error is passed on; the zeros begin with the next byte.
const fn passes(
    name: &'static str,
    about: &'static str,
    says: fn(&Moment, u8) -> Option<u8>,
) -> Deviation {
    wrong(name, "9.7", about, How::Says(says))
}

/// A command that is cut there is forgotten.
const fn cut(name: &'static str, about: &'static str, forgets: fn(&Moment) -> bool) -> Deviation {
    wrong(name, "9.5", about, How::Forgets(forgets))
}

#[expect(
    clippy::unnecessary_wraps,
    reason = "the form of every deviation that says another byte"
)]
fn offending(m: &Moment, byte: u8, of_this_kind: bool) -> Option<u8> {
    let detected = m.step.marks.contains(Marks::DETECTED) && m.received.error.is_none();
    Some(if detected && of_this_kind {
        m.received.byte
    } else {
        byte
    })
}
