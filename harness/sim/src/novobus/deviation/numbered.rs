//! The numbers of the error mode (ND21 9.7) put wrong in any way: relatives of deviations in the tables, which stand there with one number
//! each.

use super::how::{Deviation, How, wrong};

/// Drives that take `n` zeros in a row for the sign that the preceding drive is in the error mode.
macro_rules! counts {
    ($($n:literal)*) => {
        &[$(numbered(
            concat!("counts-", $n, "-zeros"),
            concat!("it takes ", $n, " zeros in a row for the sign that the drive before it is in the error mode"),
            How::Amends(|_, rules| rules.upstream_zeros = $n),
        )),*]
    };
}

/// Drives that begin to increment after `n` zeros.
macro_rules! sends {
    ($($n:literal)*) => {
        &[$(numbered(
            concat!("sends-", $n, "-zeros"),
            concat!("it begins to increment after ", $n, " zeros"),
            How::Amends(|_, rules| rules.sent_zeros = $n),
        )),*]
    };
}

/// A drive that sends the byte received with so much added.
macro_rules! adds {
    ($($n:literal)*) => {
        &[$(numbered(
            concat!("adds-", $n, "-in-error-mode"),
            concat!("it adds ", $n, " to what it receives in the error mode, and not 1"),
            How::Says(|m, byte| Some(match m.increments(byte) {
                true => m.received.byte.wrapping_add($n),
                false => byte,
            })),
        )),*]
    };
}

const fn numbered(name: &'static str, about: &'static str, how: How) -> Deviation {
    wrong(name, "9.7", about, how)
}

pub(super) static COUNTS: &[Deviation] =
    counts!(1 2 3 4 5 6 10 11 12 13 14 15 16 17 18 20 24 25 32);

pub(super) static SENDS: &[Deviation] =
    sends!(1 2 4 7 8 9 10 11 12 13 14 15 19 20 21 22 23 24 25 26 28 30 32 34 40 50 64);

pub(super) static ADDS: &[Deviation] = adds!(0 3 4 8 16 32 64 128 254 255);

pub(super) static INCREMENTS: &[Deviation] = &[
    numbered(
        "increments-seven-bits-in-error-mode",
        "it leaves bit 7 out where it adds 1 in the error mode",
        How::Says(|m, byte| {
            Some(match m.increments(byte) {
                true => byte & 0x7F,
                false => byte,
            })
        }),
    ),
    numbered(
        "increments-zeros-only",
        "it adds 1 to zeros only in the error mode, and passes other bytes on",
        How::Says(|m, byte| {
            Some(match m.increments(byte) && m.received.byte != 0 {
                true => m.received.byte,
                false => byte,
            })
        }),
    ),
    numbered(
        "increments-bytes-below-80-only",
        "it does not add 1 to a byte from 80 on in the error mode",
        How::Says(|m, byte| {
            Some(match m.increments(byte) && m.received.byte >= 0x80 {
                true => m.received.byte,
                false => byte,
            })
        }),
    ),
    numbered(
        "increments-others-than-zeros",
        "it does not add 1 to zeros in the error mode",
        How::Says(|m, byte| {
            Some(match m.increments(byte) && m.received.byte == 0 {
                true => 0,
                false => byte,
            })
        }),
    ),
];
