//! Names a fault from the expected bytes, the bytes that came instead, and the address that the ring
//! spelled out (ND21 9.7-9.9).

use super::super::address::RingSize;
use super::super::check_sequence::{SEQUENCE, ZEROS};
use super::super::sync::{MAX_NET_LENGTH, SYNCO};
use super::fault::{Fault, RingLink};
use super::in_flight::{ByteInFlight, BytePlace};
use crate::line::Received;
use alloc::vec::Vec;

/// How many bytes after the first wrong one are kept to be compared.
const KEPT: usize = 32;
/// Maximum number of lost or extra bytes that can be recognised.
const MOST_SHIFT: usize = 9;
/// Number of bytes that must match before a shift is accepted.
const FITTING: usize = 4;

/// Number of zeros in a row that no telegram contains: a telegram holds at most seven (ND21 9.7).
pub(super) const NO_TELEGRAM: u8 = MAX_NET_LENGTH + 1;
/// Number of bytes after which every drive behind the one that detected the error has sent its 17 zeros: these drives
/// detect the error after at most 9 bytes, the length of a telegram (ND21 9.7).
const SETTLED: u32 = ZEROS as u32 + 9;
/// Number of equal bytes in a row after which they count as the spelled-out address: more than an address byte and net bytes
/// can be equal in a row.
const STEADY: u32 = NO_TELEGRAM as u32 + 1;
/// Byte times, in addition to one round trip, within which a ring spells out an address: the current
/// telegram is completed first, and drives that send zeros unasked need as many again.
pub(super) const SPELLING: u64 = 2 * (SETTLED + STEADY) as u64;

/// The steady output of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spelled {
    /// The address of the drive that detected the error.
    Address(u8),
    /// SYNCO as it was sent: no drive is in the error mode.
    Sound,
    /// Nothing comes.
    Nothing,
    /// Bytes without a meaning.
    Noise,
}

/// The first sign of a disturbance.
#[derive(Clone, Copy, Debug)]
pub(super) enum DisturbanceSign {
    /// Another byte came than this one, or it was damaged.
    Wrong(ByteInFlight),
    /// This byte did not come.
    Missed(ByteInFlight),
    /// An unexpected byte came.
    Unasked,
    /// A check sequence did not come back.
    NotBack,
}

impl DisturbanceSign {
    /// The byte at which it began.
    pub(super) const fn sent(&self) -> Option<&ByteInFlight> {
        match self {
            Self::Wrong(sent) | Self::Missed(sent) => Some(sent),
            Self::Unasked | Self::NotBack => None,
        }
    }
}

/// What is known about a disturbance.
#[derive(Clone, Debug)]
pub(super) struct Evidence {
    cause: DisturbanceSign,
    /// The expected bytes, starting at the first wrong one.
    expected: Vec<Option<u8>>,
    /// The bytes that came, starting at the same place.
    received: Vec<Received>,
    seen: u32,
    last: Option<Received>,
    run: u32,
    longest_zeros: u32,
}

impl Evidence {
    /// A disturbance, with the bytes under way behind it.
    pub(super) fn new<'a>(
        cause: DisturbanceSign,
        behind: impl Iterator<Item = &'a ByteInFlight>,
    ) -> Self {
        let all = cause
            .sent()
            .copied()
            .into_iter()
            .chain(behind.copied())
            .take(KEPT);
        Self {
            cause,
            expected: all.map(|sent| sent.composed.back).collect(),
            received: Vec::new(),
            seen: 0,
            last: None,
            run: 0,
            longest_zeros: 0,
        }
    }

    /// The first sign.
    pub(super) fn cause(&self) -> &DisturbanceSign {
        &self.cause
    }

    /// Takes a byte that was sent since.
    #[inline]
    pub(super) fn expect(&mut self, back: Option<u8>) {
        if self.expected.len() < KEPT {
            self.expected.push(back);
        }
    }

    /// Takes a byte of what came.
    pub(super) fn see(&mut self, received: Received) {
        if self.received.len() < KEPT {
            self.received.push(received);
        }
        self.seen = self.seen.saturating_add(1);
        self.run = if self.last == Some(received) {
            self.run.saturating_add(1)
        } else {
            1
        };
        self.last = Some(received);
        if received.is(0) {
            self.longest_zeros = self.longest_zeros.max(self.run);
        }
    }

    /// What the ring spells out; `None` as long as that may change.
    pub(super) fn settled(&self, ring: RingSize) -> Option<Spelled> {
        (self.seen >= SETTLED + STEADY && self.run >= STEADY)
            .then(|| self.spelled(ring))
            .filter(|spelled| *spelled != Spelled::Noise)
    }

    /// What the ring spells out when the time is over.
    pub(super) fn spelled(&self, ring: RingSize) -> Spelled {
        let Some(last) = self.last else {
            return Spelled::Nothing;
        };
        // At most 25 zeros come before an address (ND21 9.7); more are the address of drive 0.
        let steady = if last.byte == 0 { SETTLED } else { STEADY };
        if last.error.is_some() || self.run < steady {
            return Spelled::Noise;
        }
        // In a ring of more than 128 drives SYNCO is an address as well; but before an address come zeros.
        let zeros = self.longest_zeros >= u32::from(NO_TELEGRAM);
        if last.byte < ring.drives() && (zeros || last.byte != SYNCO) {
            Spelled::Address(last.byte)
        } else if last.byte == SYNCO {
            Spelled::Sound
        } else {
            Spelled::Noise
        }
    }

    /// The name of the fault. `silent`: a byte was missed, now or since the disturbance began; `drive`:
    /// the drive that was to answer.
    pub(super) fn name(
        &self,
        ring: RingSize,
        spelled: Spelled,
        silent: bool,
        drive: Option<u8>,
    ) -> Fault {
        match spelled {
            // An error that only the master received happened on the last link: no drive forwards a damaged byte.
            _ if self.received.first().is_some_and(|r| r.error.is_some()) => {
                Fault::Damaged(RingLink::last())
            }
            Spelled::Address(drive) if silent && !self.was_late() => {
                Fault::Broken(RingLink::into(ring, drive))
            }
            Spelled::Address(drive) => Fault::Damaged(RingLink::into(ring, drive)),
            Spelled::Nothing => Fault::Silent,
            Spelled::Sound => self.compare(ring, drive),
            Spelled::Noise => Fault::Unclear,
        }
    }

    /// Whether the byte that was missed came after all: the computer was late, and no link was silent. Zeros are what drives send unasked
    /// after a silence (ND21 9.9).
    fn was_late(&self) -> bool {
        let missed = self.expected.first().copied().flatten();
        let came = self.received.first();
        let right = |byte: &u8| *byte != 0 && came.is_some_and(|received| received.is(*byte));
        matches!(self.cause, DisturbanceSign::Missed(_)) && missed.as_ref().is_some_and(right)
    }

    /// The fault of a ring in which no drive is in the error mode.
    fn compare(&self, ring: RingSize, drive: Option<u8>) -> Fault {
        let first = self.received.first().map(|received| received.byte);
        match (&self.cause, first) {
            (DisturbanceSign::Unasked, _) => return Fault::Extra { bytes: 1 },
            (DisturbanceSign::NotBack, _) => {
                let whole = |bytes: &[Received]| {
                    let pairs = bytes.iter().zip(SEQUENCE);
                    pairs.into_iter().all(|(received, byte)| received.is(byte))
                };
                let back = self.received.windows(SEQUENCE.len()).any(whole);
                return if back { Fault::Late } else { Fault::Unclear };
            }
            (DisturbanceSign::Missed(_), _) if self.fit(0, 0) => return Fault::Late,
            (DisturbanceSign::Wrong(sent), Some(received)) if self.fit(1, 1) => {
                return match (sent.composed.place, sent.composed.back, drive) {
                    // The address byte comes back increased by the number of drives (9.3).
                    (BytePlace::Address, Some(expected), _) => Fault::WrongRingSize {
                        counted: received.wrapping_sub(expected).wrapping_add(ring.drives()),
                        ring,
                    },
                    (BytePlace::Parameter, expected, Some(drive)) => Fault::Protocol {
                        drive,
                        expected,
                        received,
                    },
                    _ => Fault::Unclear,
                };
            }
            _ => {}
        }
        for shift in 1..=MOST_SHIFT {
            let bytes = u8::try_from(shift).unwrap_or(u8::MAX);
            if self.fit(shift, 0) {
                return Fault::Lost { bytes };
            }
            if self.fit(0, shift) {
                return Fault::Extra { bytes };
            }
        }
        Fault::Unclear
    }

    /// Whether what came from `received` on is what must have come from `expected` on.
    fn fit(&self, expected: usize, received: usize) -> bool {
        let expected = self.expected.get(expected..).unwrap_or_default();
        let received = self.received.get(received..).unwrap_or_default();
        let mut telling = 0;
        let fits = expected
            .iter()
            .zip(received)
            .all(|(expected, received)| match expected {
                None => received.error.is_none(),
                Some(byte) => {
                    telling += usize::from(*byte != SYNCO);
                    received.is(*byte)
                }
            });
        fits && (telling >= FITTING || expected.len().min(received.len()) >= KEPT / 2)
    }
}
