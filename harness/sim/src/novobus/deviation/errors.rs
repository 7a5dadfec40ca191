//! Deviations in what a drive takes for an error, in the error mode and in time-outs (ND21 9.7 to 9.9, 14.10.2).

use super::how::{Deviation, How, wrong};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::bus_end::{Deadline, Place};
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::Span;

pub(super) static DEVIATIONS: &[Deviation] = &[
    wrong(
        "ignores-parity-errors",
        "9.7",
        "it takes a byte with a parity error for a good one",
        How::Hears(|m| m.forgive(LineError::Parity)),
    ),
    wrong(
        "ignores-framing-errors",
        "9.7",
        "it takes a byte without a stop bit for a good one",
        How::Hears(|m| m.forgive(LineError::Framing)),
    ),
    wrong(
        "ignores-overruns",
        "9.7",
        "it does not notice that its receiver was too slow",
        How::Hears(|m| m.forgive(LineError::Overrun)),
    ),
    wrong(
        "parity-unchecked-in-passing",
        "9.7",
        "it ignores parity errors in telegrams for others",
        How::Hears(|m| {
            if m.place == Place::Passing {
                m.forgive(LineError::Parity)
            } else {
                m.received
            }
        }),
    ),
    wrong(
        "passes-the-offending-byte-on",
        "9.7",
        "it passes on the byte in which it detected an error, and sends 00 only from the next",
        How::Says(|m, byte| {
            Some(if m.step.marks.contains(Marks::DETECTED) {
                m.received.byte
            } else {
                byte
            })
        }),
    ),
    wrong(
        "silent-in-error-mode",
        "9.7",
        "it sends nothing in the error mode",
        How::Says(|m, byte| (m.place != Place::ErrorMode).then_some(byte)),
    ),
    wrong(
        "counts-7-zeros",
        "9.7",
        "it takes seven zeros for the sign that the drive before it is in the error mode",
        How::Amends(|_, rules| rules.upstream_zeros = 7),
    ),
    wrong(
        "counts-9-zeros",
        "9.7",
        "it takes nine zeros for the sign that the drive before it is in the error mode",
        How::Amends(|_, rules| rules.upstream_zeros = 9),
    ),
    wrong(
        "sends-16-zeros",
        "9.7",
        "it begins to increment after 16 zeros",
        How::Amends(|_, rules| rules.sent_zeros = 16),
    ),
    wrong(
        "sends-18-zeros",
        "9.7",
        "it begins to increment after 18 zeros",
        How::Amends(|_, rules| rules.sent_zeros = 18),
    ),
    wrong(
        "never-increments",
        "9.7",
        "it sends 00 for ever in the error mode",
        How::Says(|m, byte| Some(if m.increments(byte) { 0 } else { byte })),
    ),
    wrong(
        "increments-twice-in-error-mode",
        "9.7",
        "it adds 2 to what it receives in the error mode",
        How::Says(|m, byte| {
            Some(if m.increments(byte) {
                byte.wrapping_add(1)
            } else {
                byte
            })
        }),
    ),
    wrong(
        "ignores-check-sequences",
        "9.8",
        "it stays in the error mode whatever comes",
        How::Hears(|m| {
            if m.place == Place::ErrorMode && m.received.is(SEQUENCE[0]) {
                Received::bad(SEQUENCE[0], LineError::Parity)
            } else {
                m.received
            }
        }),
    ),
    wrong(
        "swallows-the-end-of-a-check-sequence",
        "9.8",
        "it does not pass on the 41 with which it leaves the error mode",
        How::Says(|m, byte| (!m.step.marks.contains(Marks::RECOVERED)).then_some(byte)),
    ),
    wrong(
        "check-sequence-ends-early",
        "9.8",
        "it leaves the error mode with the 4C, a byte early",
        How::Leaves(|m| m.received.is(SEQUENCE[3])),
    ),
    wrong(
        "leaves-error-mode-on-16-zeros",
        "9.8",
        "it leaves the error mode when 16 zeros have come",
        How::Leaves(|m| m.zeros >= 16),
    ),
    wrong(
        "check-sequence-without-zeros",
        "9.8",
        "it takes a check sequence without having seen eight zeros before",
        How::Leaves(|m| m.sequence),
    ),
    wrong(
        "time-out-after-8ms",
        "9.9",
        "it detects a time-out after 8 ms, where the manual says 10 to 20",
        How::Amends(|properties, _| properties.time_out = Span::from_millis(8)),
    ),
    wrong(
        "time-out-after-25ms",
        "9.9",
        "it detects a time-out only after 25 ms, where the manual says 10 to 20",
        How::Amends(|properties, _| properties.time_out = Span::from_millis(25)),
    ),
    wrong(
        "zeros-5ms-after-a-time-out",
        "9.9",
        "it waits 5 ms after a time-out before it sends zeros, where the manual says 10",
        How::Amends(|properties, _| properties.time_out_wait = Span::from_millis(5)),
    ),
    wrong(
        "zeros-20ms-after-a-time-out",
        "9.9",
        "it waits 20 ms after a time-out before it sends zeros, where the manual says 10",
        How::Amends(|properties, _| properties.time_out_wait = Span::from_millis(20)),
    ),
    wrong(
        "no-zeros-unasked",
        "9.9",
        "it sends no zeros by itself after a time-out",
        How::Waits(|due| matches!(due, Deadline::LineFree(_))),
    ),
    wrong(
        "no-time-out",
        "14.10.2",
        "it never detects a time-out",
        How::Monitors(false),
    ),
    wrong(
        "time-out-always",
        "14.10.2",
        "it detects time-outs also where monitoring is switched off",
        How::Monitors(true),
    ),
];
