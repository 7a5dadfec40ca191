//! What the driver of a serial port counts beside what this program has sent and read there. More than that is another program's: root
//! opens a port in the middle of a run, though the bench has it.

use harness_uart::Counts;
use std::time::{Duration, Instant};

/// How long a byte that the driver has counted may be on its way to the program that reads.
const DELIVERED: Duration = Duration::from_millis(100);

/// How often a driver is asked where nothing comes.
const OFTEN: Duration = Duration::from_millis(10);

/// The counts of a port.
#[derive(Debug)]
pub(super) struct Ledger {
    /// As of the last look.
    counts: Counts,
    asked: Instant,
    /// Bytes that were sent and read here, beside those of another program that were reported; all wrap as the driver's do.
    sent: u32,
    read: u32,
    /// What the driver had counted as received some time ago.
    received: (Instant, u32),
}

impl Ledger {
    pub(super) fn new(counts: Counts, now: Instant) -> Self {
        Self {
            counts,
            asked: now,
            sent: counts.sent,
            read: counts.received,
            received: (now, counts.received),
        }
    }

    pub(super) fn sent(&mut self, bytes: usize) {
        self.sent = self
            .sent
            .wrapping_add(u32::try_from(bytes).unwrap_or(u32::MAX));
    }

    pub(super) fn read(&mut self) {
        self.read = self.read.wrapping_add(1);
    }

    /// Whether it is time to ask the driver if nothing was received.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        now >= self.asked + OFTEN
    }

    /// Bytes since the last call that were lost or that another program has read, and those that it has sent. All that has come is read.
    pub(super) fn beside(&mut self, counts: Counts, now: Instant) -> (u64, u64) {
        let lost = counts.since(self.counts).overruns;
        let foreign = more(counts.sent, self.sent);
        self.sent = self.sent.wrapping_add(foreign);
        let (since, received) = self.received;
        let mut missed = 0;
        if now >= since + DELIVERED {
            missed = more(received, self.read);
            self.read = self.read.wrapping_add(missed);
            self.received = (now, counts.received);
        }
        (self.counts, self.asked) = (counts, now);
        (u64::from(lost) + u64::from(missed), u64::from(foreign))
    }
}

/// How far a count is ahead of another; 0 if it is behind.
fn more(counted: u32, known: u32) -> u32 {
    let ahead = counted.wrapping_sub(known);
    if ahead < 1 << 31 { ahead } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_program_sends_and_reads_is_counted_once() {
        let start = Instant::now();
        // The driver's counts wrap.
        let counts = |sent: u32, received: u32| Counts {
            sent: sent.wrapping_sub(5),
            received: received.wrapping_sub(5),
            ..Counts::default()
        };
        let mut ledger = Ledger::new(counts(0, 0), start);
        let mut beside = |sent, read, counted: Counts, steps| {
            ledger.sent(sent);
            (0..read).for_each(|_| ledger.read());
            ledger.beside(counted, start + DELIVERED * steps)
        };
        assert_eq!(
            beside(10, 0, counts(7, 3), 0),
            (0, 0),
            "3 bytes wait to be sent"
        );
        assert_eq!(beside(0, 3, counts(10, 10), 1), (0, 0));
        assert_eq!(
            beside(0, 2, counts(10, 10), 1),
            (0, 0),
            "5 are under way to the program"
        );
        assert_eq!(
            beside(0, 0, counts(10, 10), 2),
            (5, 0),
            "another program has read 5"
        );
        assert_eq!(
            beside(0, 0, counts(16, 10), 2),
            (0, 6),
            "another program has sent 6"
        );
        let lost = Counts {
            overruns: 1,
            ..counts(16, 10)
        };
        assert_eq!(beside(0, 0, lost, 3), (1, 0));
        assert_eq!(beside(0, 0, lost, 4), (0, 0));
    }

    /// A driver that counts nothing accuses no program.
    #[test]
    fn a_driver_that_does_not_count() {
        let start = Instant::now();
        let mut ledger = Ledger::new(Counts::default(), start);
        ledger.sent(5);
        (0..5).for_each(|_| ledger.read());
        for step in 0..3 {
            let found = ledger.beside(Counts::default(), start + DELIVERED * step);
            assert_eq!(found, (0, 0));
        }
    }
}
