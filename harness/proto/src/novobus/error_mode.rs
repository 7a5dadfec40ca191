//! The error mode: how a ring spells out which drive saw the fault (ND21 9.7-9.9).
//!
//! From the offending byte on, a drive
//!
//! 1. sends 00 for every byte ("!" is the first of them);
//! 2. counts the good zeros that it receives in a row, the offending byte included; with the eighth
//!    ("*") it knows that the drive before it is in the error mode too, and remembers it;
//! 3. with "*" behind it and 17 zeros sent ("#" is the seventeenth) it sends received + 1, beginning
//!    with the byte in hand. Only the drive that was first never sees "*", so what reaches the master
//!    is 00 ... 00 and then that drive's address;
//! 4. with "*" behind it it looks for the check sequence, forwards its bytes unchanged ("@" marks the
//!    FF) and is back in normal mode after the last.
//!
//! After a time-out (9.9) received + 1 starts with the "*" itself, as the printed figure has it.

mod climb;

use super::check_sequence::{SequenceProgress, SequenceWatch, ZEROS};
use super::properties::BrokenSequence;
use crate::line::Received;

pub use climb::Climb;

/// Zeros in a row that show that the drive before is in the error mode: a telegram holds at most seven
/// (ND21 9.7).
pub const UPSTREAM_ZEROS: u8 = 8;

/// The numbers of the error mode. A right drive has those of the [manual](Self::MANUAL); other numbers make a wrong
/// drive, for tests that must find one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rules {
    /// Good zeros in a row that show that the drive before is in the error mode (ND21 9.7); 1 or more.
    pub upstream_zeros: u8,
    /// Zeros that a drive has sent when it begins to increment (ND21 9.7).
    pub sent_zeros: u8,
    /// Whether the byte in error is one of the zeros in a row.
    pub offending_zero: OffendingZero,
    /// Whether another byte starts the count of zeros again (ND21 9.7).
    pub zeros_in_a_row: bool,
}

/// Whether the byte in error counts as the first of the zeros in a row (ND21 9.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OffendingZero {
    /// Where it is a good 00: the manual's rule.
    GoodZero,
    /// Never.
    Never,
    /// Whatever it is.
    AnyByte,
}

impl OffendingZero {
    fn counts(self, offending: Received) -> bool {
        match self {
            Self::GoodZero => offending.is(0),
            Self::Never => false,
            Self::AnyByte => true,
        }
    }
}

impl Rules {
    /// Eight and seventeen (ND21 9.7).
    pub const MANUAL: Self = Self {
        upstream_zeros: UPSTREAM_ZEROS,
        sent_zeros: ZEROS,
        offending_zero: OffendingZero::GoodZero,
        zeros_in_a_row: true,
    };
}

/// What happened at a byte, in the manual's own marks (ND21 9.7, 9.8). Several can coincide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks(u8);

impl Marks {
    /// Nothing to remark.
    pub const NONE: Self = Self(0);
    /// `!`: the drive detects an error.
    pub const DETECTED: Self = Self(1);
    /// `*`: it detects that the preceding drive is in error mode.
    pub const UPSTREAM: Self = Self(1 << 1);
    /// `#`: the 17th sent zero byte.
    pub const SEVENTEENTH: Self = Self(1 << 2);
    /// `@`: the first byte of the check sequence.
    pub const SEQUENCE: Self = Self(1 << 3);
    /// The last byte of the check sequence: back in normal mode.
    pub const RECOVERED: Self = Self(1 << 4);
    /// `>`: an answer byte, contents of a memory cell.
    pub const ANSWER: Self = Self(1 << 5);
    /// `+`: a new checking byte.
    pub const CHECKSUM: Self = Self(1 << 6);

    /// These bits; those that stand for nothing are left out.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & 0x7F)
    }

    /// Their bits.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether all of `other` are among these.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// A drive in the error mode.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ErrorMode {
    rules: Rules,
    zeros_received: u8,
    zeros_sent: u8,
    upstream: bool,
    after_time_out: bool,
    watch: SequenceWatch,
    in_sequence: bool,
}

/// The reaction of the error mode to a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Response {
    /// The byte that goes out for it.
    pub byte: u8,
    /// The event at this byte.
    pub marks: Marks,
}

impl ErrorMode {
    /// Enters the error mode with the offending byte; 00 goes out in its place.
    #[must_use]
    #[inline]
    pub fn enter(offending: Received, rules: Rules) -> Self {
        Self {
            rules,
            zeros_received: u8::from(rules.offending_zero.counts(offending)),
            zeros_sent: 1,
            upstream: false,
            after_time_out: false,
            watch: SequenceWatch::default(),
            in_sequence: false,
        }
    }

    /// Enters the error mode after a time-out: no byte is to blame, and none is answered.
    #[must_use]
    pub fn enter_after_time_out(rules: Rules) -> Self {
        Self {
            rules,
            zeros_received: 0,
            zeros_sent: 0,
            upstream: false,
            after_time_out: true,
            watch: SequenceWatch::default(),
            in_sequence: false,
        }
    }

    /// The line has been silent for too long (ND21 9.9).
    pub fn time_out(&mut self) {
        self.after_time_out = true;
    }

    /// Takes the next byte (rules 1 to 4).
    #[inline]
    pub fn receive(&mut self, received: Received, broken_sequence: BrokenSequence) -> Response {
        let good = received.error.is_none();
        let mut marks = self.count(received.is(0));
        if self.upstream {
            let was_in_sequence = self.in_sequence;
            let progress = self.watch.see(received.byte, good);
            self.in_sequence = matches!(
                progress,
                SequenceProgress::Started | SequenceProgress::Continued
            );
            let forward = match progress {
                SequenceProgress::Started => {
                    marks = marks.and(Marks::SEQUENCE);
                    true
                }
                SequenceProgress::Continued => true,
                SequenceProgress::Complete => {
                    marks = marks.and(Marks::RECOVERED);
                    true
                }
                SequenceProgress::None => {
                    was_in_sequence && broken_sequence == BrokenSequence::Forwarded
                }
            };
            if forward {
                return Response {
                    byte: received.byte,
                    marks,
                };
            }
        }
        if self.increments() {
            let byte = received.byte.wrapping_add(1);
            return Response { byte, marks };
        }
        Response {
            byte: 0,
            marks: marks.and(self.send_zero()),
        }
    }

    /// Takes a byte that is not answered, in the silence after a time-out (ND21 9.9): rules 2 and 4
    /// hold, nothing goes out.
    pub fn overhear(&mut self, received: Received) -> Marks {
        let marks = self.count(received.is(0));
        if !self.upstream {
            return marks;
        }
        match self.watch.see(received.byte, received.error.is_none()) {
            SequenceProgress::Started => marks.and(Marks::SEQUENCE),
            SequenceProgress::Complete => marks.and(Marks::RECOVERED),
            SequenceProgress::Continued | SequenceProgress::None => marks,
        }
    }

    /// Good zeros received in a row, the last of them just now; it stays at the largest number that fits.
    #[must_use]
    #[inline]
    pub const fn zeros_received(&self) -> u8 {
        self.zeros_received
    }

    /// Zeros sent; it stays at the largest number that fits.
    #[must_use]
    #[inline]
    pub const fn zeros_sent(&self) -> u8 {
        self.zeros_sent
    }

    /// Whether "*" has happened.
    #[must_use]
    #[inline]
    pub const fn upstream(&self) -> bool {
        self.upstream
    }

    /// The bytes of the check sequence received, 0 to 4.
    #[must_use]
    #[inline]
    pub const fn sequence(&self) -> u8 {
        self.watch.matched()
    }

    /// Notes that a 00 goes out, asked for or not.
    #[inline]
    pub fn send_zero(&mut self) -> Marks {
        self.zeros_sent = self.zeros_sent.saturating_add(1);
        if self.zeros_sent == self.rules.sent_zeros {
            Marks::SEVENTEENTH
        } else {
            Marks::NONE
        }
    }

    /// Rule 2.
    #[inline]
    fn count(&mut self, good_zero: bool) -> Marks {
        // Without a branch on the byte: any byte is as likely as another.
        self.zeros_received = match good_zero {
            true => self.zeros_received.saturating_add(1),
            false if self.rules.zeros_in_a_row => 0,
            false => return Marks::NONE,
        };
        if self.zeros_received == self.rules.upstream_zeros && !self.upstream {
            self.upstream = true;
            return Marks::UPSTREAM;
        }
        Marks::NONE
    }

    /// Whether the next byte is answered with received + 1 (rule 3).
    #[must_use]
    #[inline]
    pub const fn increments(&self) -> bool {
        self.upstream && (self.after_time_out || self.zeros_sent >= self.rules.sent_zeros)
    }
}
