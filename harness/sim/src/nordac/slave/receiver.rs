//! The receiver of a slave: from octets to telegrams (EN 1).

use harness_proto::line::Received;
use harness_proto::profibus::fdl::{SC, SD1, SD2, SD3, SD4};
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::profibus::{Buffer, BusRate, Telegram};
use harness_proto::time::{Instant, Span};

/// Collects the octets of a telegram. A telegram begins after [`SYN_BITS`] idle bits and has no gap; after a damaged one the receiver waits
/// for the line to be idle that long again.
#[derive(Clone, Debug)]
pub(in crate::nordac) struct Receiver {
    bit: Span,
    octet: Span,
    /// The idle time in front of a telegram.
    pause: Span,
    /// The end of the last octet on the line.
    idle_since: Instant,
    /// The telegram so far.
    octets: Buffer,
    /// How many octets it will have, by its first two.
    length: usize,
    /// Whether the octets up to the next idle time are not read.
    skips: bool,
    /// Whether the last octet was the last one of a telegram.
    complete: bool,
}

impl Receiver {
    /// A receiver that listens from `at` on.
    pub(in crate::nordac) fn new(rate: BusRate, at: Instant) -> Self {
        Self {
            bit: rate.bit_time(),
            octet: rate.octet_time(),
            pause: rate.bit_time() * SYN_BITS,
            idle_since: at,
            octets: Buffer::new(),
            length: 0,
            skips: true,
            complete: false,
        }
    }

    /// The line was in use until `at`, by the station itself or while it had no power: what comes next is read behind the next idle time.
    pub(in crate::nordac) fn skip(&mut self, at: Instant) {
        self.idle_since = self.idle_since.max(at);
        self.skips = true;
        self.complete = false;
    }

    /// Whether an octet that ends at `at` follows a telegram without a gap: then that was no telegram, but one of another length than it announced.
    pub(in crate::nordac) fn tears(&self, at: Instant) -> bool {
        self.complete && (at - self.octet).since(self.idle_since) < self.bit
    }

    /// Takes an octet whose last stop bit has passed at `at`; `true` if it is the last one of what may be a telegram.
    #[inline]
    pub(in crate::nordac) fn hear(&mut self, at: Instant, octet: Received) -> bool {
        let start = at - self.octet;
        let idle = start.since(self.idle_since);
        self.idle_since = at;
        self.complete = false;
        if idle >= self.pause {
            self.octets.clear();
            self.skips = false;
        } else if idle >= self.bit {
            self.skips = true;
        }
        if self.skips {
            return false;
        }
        let fits = octet.error.is_none() && self.octets.push(octet.byte);
        if fits && self.octets.len() <= 2 {
            self.length = expected(&self.octets).unwrap_or(0);
        }
        // The octets of no telegram have a length of 0.
        self.skips = !fits || self.octets.len() >= self.length;
        fits && self.octets.len() == self.length
    }

    /// The telegram that has just ended.
    pub(in crate::nordac) fn telegram(&mut self) -> Option<Telegram> {
        let telegram = Telegram::decode(&self.octets).value();
        self.complete = telegram.is_some();
        telegram
    }
}

/// How many octets a telegram has that begins with these, or more than there are if that is not known yet; `None` if no telegram begins so.
pub(in crate::nordac) fn expected(octets: &[u8]) -> Option<usize> {
    match *octets {
        [SC, ..] => Some(1),
        [SD4, ..] => Some(3),
        [SD1, ..] => Some(6),
        [SD3, ..] => Some(14),
        [SD2] => Some(2),
        [SD2, length, ..] => Some(usize::from(length) + 6),
        _ => None,
    }
}
