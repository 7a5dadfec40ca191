//! Deviations in what a drive takes for an error, in the error mode and in time-outs (ND21 9.7 to 9.9, 14.10.2).

use super::how::{Deviation, How};
use harness_proto::line::{LineError, Received};
use harness_proto::novobus::bus_end::{Deadline, Place};
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::Span;

/// The table.
pub(super) static DEVIATIONS: &[Deviation] = &[
    Deviation {
        name: "ignores-parity-errors",
        section: "9.7",
        about: "it takes a byte with a parity error for a good one",
        behind_the_bus: false,
        how: How::Hears(|m| m.forgive(LineError::Parity)),
    },
    Deviation {
        name: "ignores-framing-errors",
        section: "9.7",
        about: "it takes a byte without a stop bit for a good one",
        behind_the_bus: false,
        how: How::Hears(|m| m.forgive(LineError::Framing)),
    },
    Deviation {
        name: "ignores-overruns",
        section: "9.7",
        about: "it does not notice that its receiver was too slow",
        behind_the_bus: false,
        how: How::Hears(|m| m.forgive(LineError::Overrun)),
    },
    Deviation {
        name: "parity-unchecked-in-passing",
        section: "9.7",
        about: "it ignores parity errors in telegrams for others",
        behind_the_bus: false,
        how: How::Hears(|m| {
            if m.place == Place::Passing {
                m.forgive(LineError::Parity)
            } else {
                m.received
            }
        }),
    },
    Deviation {
        name: "passes-the-offending-byte-on",
        section: "9.7",
        about: "it passes on the byte in which it detected an error, and sends 00 only from the next",
        behind_the_bus: false,
        how: How::Says(|m, byte| {
            Some(if m.step.marks.contains(Marks::DETECTED) {
                m.received.byte
            } else {
                byte
            })
        }),
    },
    Deviation {
        name: "silent-in-error-mode",
        section: "9.7",
        about: "it sends nothing in the error mode",
        behind_the_bus: false,
        how: How::Says(|m, byte| (m.place != Place::ErrorMode).then_some(byte)),
    },
    Deviation {
        name: "counts-7-zeros",
        section: "9.7",
        about: "it takes seven zeros for the sign that the drive before it is in the error mode",
        behind_the_bus: false,
        how: How::Amends(|_, rules| rules.upstream_zeros = 7),
    },
    Deviation {
        name: "counts-9-zeros",
        section: "9.7",
        about: "it takes nine zeros for the sign that the drive before it is in the error mode",
        behind_the_bus: false,
        how: How::Amends(|_, rules| rules.upstream_zeros = 9),
    },
    Deviation {
        name: "sends-16-zeros",
        section: "9.7",
        about: "it begins to increment after 16 zeros",
        behind_the_bus: false,
        how: How::Amends(|_, rules| rules.sent_zeros = 16),
    },
    Deviation {
        name: "sends-18-zeros",
        section: "9.7",
        about: "it begins to increment after 18 zeros",
        behind_the_bus: false,
        how: How::Amends(|_, rules| rules.sent_zeros = 18),
    },
    Deviation {
        name: "never-increments",
        section: "9.7",
        about: "it sends 00 for ever in the error mode",
        behind_the_bus: false,
        how: How::Says(|m, byte| Some(if m.increments(byte) { 0 } else { byte })),
    },
    Deviation {
        name: "increments-twice-in-error-mode",
        section: "9.7",
        about: "it adds 2 to what it receives in the error mode",
        behind_the_bus: false,
        how: How::Says(|m, byte| {
            Some(if m.increments(byte) {
                byte.wrapping_add(1)
            } else {
                byte
            })
        }),
    },
    Deviation {
        name: "ignores-check-sequences",
        section: "9.8",
        about: "it stays in the error mode whatever comes",
        behind_the_bus: false,
        how: How::Hears(|m| {
            if m.place == Place::ErrorMode && m.received.is(SEQUENCE[0]) {
                Received::bad(SEQUENCE[0], LineError::Parity)
            } else {
                m.received
            }
        }),
    },
    Deviation {
        name: "swallows-the-end-of-a-check-sequence",
        section: "9.8",
        about: "it does not pass on the 41 with which it leaves the error mode",
        behind_the_bus: false,
        how: How::Says(|m, byte| (!m.step.marks.contains(Marks::RECOVERED)).then_some(byte)),
    },
    Deviation {
        name: "check-sequence-ends-early",
        section: "9.8",
        about: "it leaves the error mode with the 4C, a byte early",
        behind_the_bus: false,
        how: How::Leaves(|m| m.received.is(SEQUENCE[3])),
    },
    Deviation {
        name: "leaves-error-mode-on-16-zeros",
        section: "9.8",
        about: "it leaves the error mode when 16 zeros have come",
        behind_the_bus: false,
        how: How::Leaves(|m| m.zeros >= 16),
    },
    Deviation {
        name: "check-sequence-without-zeros",
        section: "9.8",
        about: "it takes a check sequence without having seen eight zeros before",
        behind_the_bus: false,
        how: How::Leaves(|m| m.sequence),
    },
    Deviation {
        name: "time-out-after-8ms",
        section: "9.9",
        about: "it detects a time-out after 8 ms, where the manual says 10 to 20",
        behind_the_bus: false,
        how: How::Amends(|properties, _| properties.time_out = Span::from_millis(8)),
    },
    Deviation {
        name: "time-out-after-25ms",
        section: "9.9",
        about: "it detects a time-out only after 25 ms, where the manual says 10 to 20",
        behind_the_bus: false,
        how: How::Amends(|properties, _| properties.time_out = Span::from_millis(25)),
    },
    Deviation {
        name: "zeros-5ms-after-a-time-out",
        section: "9.9",
        about: "it waits 5 ms after a time-out before it sends zeros, where the manual says 10",
        behind_the_bus: false,
        how: How::Amends(|properties, _| properties.time_out_wait = Span::from_millis(5)),
    },
    Deviation {
        name: "zeros-20ms-after-a-time-out",
        section: "9.9",
        about: "it waits 20 ms after a time-out before it sends zeros, where the manual says 10",
        behind_the_bus: false,
        how: How::Amends(|properties, _| properties.time_out_wait = Span::from_millis(20)),
    },
    Deviation {
        name: "no-zeros-unasked",
        section: "9.9",
        about: "it sends no zeros by itself after a time-out",
        behind_the_bus: false,
        how: How::Waits(|due| matches!(due, Deadline::LineFree(_))),
    },
    Deviation {
        name: "no-time-out",
        section: "14.10.2",
        about: "it never detects a time-out",
        behind_the_bus: false,
        how: How::Monitors(false),
    },
    Deviation {
        name: "time-out-always",
        section: "14.10.2",
        about: "it detects time-outs also where monitoring is switched off",
        behind_the_bus: false,
        how: How::Monitors(true),
    },
];
