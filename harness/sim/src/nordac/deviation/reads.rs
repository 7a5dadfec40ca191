//! Drives that read a telegram where there is none (EN 1).

use super::{Deviation, DpInjection, How};
use crate::deviation::rows;
use crate::nordac::slave::expected;
use harness_proto::line::{LineError, Received};
use harness_proto::profibus::BusRate;
use harness_proto::profibus::fdl::check_sum;
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::time::{Instant, Span};

/// Octets that are as many as a telegram has.
#[derive(Clone, Debug, Default)]
pub(super) struct Raw {
    bytes: Vec<u8>,
    errors: Vec<LineError>,
    /// The longest gap between two of them, in bits.
    gap: u64,
    /// Whether T_SYN was in front of them.
    synchronised: bool,
}

impl Raw {
    /// The octets, if nothing is wrong with them on the line.
    fn whole(&self) -> Option<Vec<u8>> {
        (self.errors.is_empty() && self.gap == 0 && self.synchronised).then(|| self.bytes.clone())
    }

    /// The octets, if all their errors are of this kind.
    fn with_errors(&self, kind: LineError) -> Option<Vec<u8>> {
        let all = self.errors.iter().all(|error| *error == kind);
        (all && self.gap == 0 && self.synchronised).then(|| self.bytes.clone())
    }
}

/// Collects octets up to the length of a telegram, whatever is wrong with them.
#[derive(Clone, Debug)]
pub(super) struct Collector {
    bit: Span,
    octet: Span,
    idle_since: Instant,
    raw: Raw,
}

impl Collector {
    pub(super) fn new(rate: BusRate) -> Self {
        Self {
            bit: rate.bit_time(),
            octet: rate.octet_time(),
            idle_since: Instant::START,
            raw: Raw::default(),
        }
    }

    /// The station has sent until `at`.
    pub(super) fn skip(&mut self, at: Instant) {
        self.idle_since = self.idle_since.max(at);
        self.raw = Raw::default();
    }

    pub(super) fn hear(&mut self, at: Instant, octet: Received) -> Option<Raw> {
        let idle = (at - self.octet).since(self.idle_since).units() / self.bit.units().max(1);
        self.idle_since = at;
        if self.raw.bytes.is_empty() || idle >= SYN_BITS {
            self.raw = Raw {
                synchronised: idle >= SYN_BITS,
                ..Raw::default()
            };
        } else {
            self.raw.gap = self.raw.gap.max(idle);
        }
        self.raw.bytes.push(octet.byte);
        self.raw.errors.extend(octet.error);
        match expected(&self.raw.bytes) {
            Some(length) if length > self.raw.bytes.len() => None,
            Some(_) => Some(std::mem::take(&mut self.raw)),
            None => {
                self.raw = Raw::default();
                None
            }
        }
    }
}

/// The octets with a right FCS.
fn with_sum(mut bytes: Vec<u8>) -> Option<Vec<u8>> {
    let begin = if bytes.first() == Some(&0x68) { 4 } else { 1 };
    let place = bytes.len().checked_sub(2)?;
    bytes[place] = check_sum(bytes.get(begin..place)?);
    Some(bytes)
}

/// The octets with another one at a place.
fn with(mut bytes: Vec<u8>, place: usize, octet: u8) -> Option<Vec<u8>> {
    *bytes.get_mut(place)? = octet;
    Some(bytes)
}

/// A row: name, section, what it does, and the octets that the drive reads in place of those on the line.
pub(super) static DEVIATIONS: &[Deviation] = rows! { DpInjection(Reads):
    "ignores-parity" "EN 1" "An octet with a parity error counts." |raw| raw.with_errors(LineError::Parity);
    "ignores-framing" "EN 1" "An octet with a framing error counts." |raw| raw.with_errors(LineError::Framing);
    "ignores-gaps" "EN 1" "A telegram may have gaps up to T_SYN." |raw| {
        (raw.errors.is_empty() && raw.synchronised).then(|| raw.bytes.clone())
    };
    "ignores-t-syn" "EN 1" "A request needs no idle time in front of it." |raw| {
        (raw.errors.is_empty() && raw.gap == 0).then(|| raw.bytes.clone())
    };
    "ignores-fcs" "EN 1" "FCS is not checked." |raw| with_sum(raw.whole()?);
    "ignores-end" "EN 1" "The last octet may be any." |raw| {
        let bytes = raw.whole()?;
        let last = bytes.len() - 1;
        with(bytes, last, 0x16)
    };
    "ignores-ler" "EN 1" "The second length is not checked." |raw| {
        let bytes = raw.whole().filter(|bytes| bytes[0] == 0x68)?;
        let length = bytes[1];
        with(bytes, 2, length)
    };
    "ignores-the-second-start" "EN 1" "The fourth octet of SD2 may be any." |raw| {
        with(raw.whole().filter(|bytes| bytes[0] == 0x68)?, 3, 0x68)
    };
    "ignores-sap-bits" "EN 1" "Bits 7 and 6 of a SAP are ignored." |raw| {
        let mut bytes = raw.whole().filter(|bytes| bytes[0] == 0x68 && bytes.len() > 10)?;
        let saps = usize::from(bytes[4] >> 7) + usize::from(bytes[5] >> 7);
        bytes[7..7 + saps].iter_mut().for_each(|sap| *sap &= 0x3F);
        with_sum(bytes)
    };
    "ignores-bit-7-of-fc" "EN 1" "Bit 7 of FC is ignored." |raw| {
        let mut bytes = raw.whole()?;
        let place = if bytes[0] == 0x68 { 6 } else { 3 };
        *bytes.get_mut(place)? &= 0x7F;
        with_sum(bytes)
    };
};
