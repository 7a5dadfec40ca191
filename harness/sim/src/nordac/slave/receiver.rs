//! The receiver of a slave: from octets to telegrams (EN 1).

use harness_proto::line::Received;
use harness_proto::profibus::fdl::{SC, SD1, SD2, SD3, SD4};
use harness_proto::profibus::rate::SYN_BITS;
use harness_proto::profibus::{Buffer, BusRate, Telegram};
use harness_proto::time::{Instant, Span};

/// Collects the octets of a telegram. A telegram begins behind [`SYN_BITS`] idle bits and has no gap; after a damaged one the receiver waits
/// for the line to be idle that long again.
#[derive(Clone, Debug)]
pub(in crate::nordac) struct Receiver {
    bit: Span,
    octet: Span,
    /// The end of the last octet on the line.
    idle_since: Instant,
    /// The telegram so far.
    octets: Buffer,
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
            idle_since: at,
            octets: Buffer::new(),
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

    /// Takes an octet whose last stop bit has passed at `at`; gives the telegram that it completes.
    pub(in crate::nordac) fn hear(&mut self, at: Instant, octet: Received) -> Option<Telegram> {
        let start = at - self.octet;
        let idle = start.since(self.idle_since);
        self.idle_since = at;
        self.complete = false;
        if idle >= self.bit * SYN_BITS {
            self.octets.clear();
            self.skips = false;
        } else if idle >= self.bit {
            self.skips = true;
        }
        if self.skips {
            return None;
        }
        let fits = octet.error.is_none() && self.octets.push(octet.byte);
        match expected(&self.octets).filter(|_| fits) {
            None => self.skips = true,
            Some(length) if length == self.octets.len() => {
                self.skips = true;
                let telegram = Telegram::decode(&self.octets).value();
                self.complete = telegram.is_some();
                return telegram;
            }
            Some(_) => {}
        }
        None
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
