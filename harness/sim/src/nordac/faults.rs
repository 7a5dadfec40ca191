//! The fault memory: 947 and 1800 to 1806 (5.7, 4.1.3).

use std::hash::{Hash, Hasher};

/// How many faults there are (1800).
pub const FAULTS: usize = 25;
/// The fault of a lost master (2.6): printed as USS time-out.
pub const TIME_OUT: u8 = 10;

/// What is kept of a fault, in the order of the sub-indices of 1801.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Past {
    /// 1 to 25; 0 is no fault.
    pub code: u8,
    /// Operating period in hours.
    pub hours: u16,
    /// In 0.1 Hz, without sign.
    pub frequency: u16,
    /// In volts.
    pub voltage: u16,
    /// In 0.1 A.
    pub current: u16,
    /// Of the heat sink, in 0.1 C.
    pub temperature: u16,
    /// The active parameter set: 0 to 3.
    pub set: u8,
}

impl Past {
    /// The value of a sub-index of 1801 to 1805; 0 beyond 6.
    #[must_use]
    pub const fn value(&self, element: usize) -> u16 {
        match element {
            0 => self.code as u16,
            1 => self.hours,
            2 => self.frequency,
            3 => self.voltage,
            4 => self.current,
            5 => self.temperature,
            6 => self.set as u16,
            _ => 0,
        }
    }
}

/// Current and past faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaultMemory {
    pending: u8,
    past: [Past; 5],
    counters: [u16; FAULTS],
}

impl Hash for FaultMemory {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let past = self.past.iter().filter(|fault| fault.code != 0);
        (self.pending, self.counters).hash(state);
        past.for_each(|fault| fault.hash(state));
    }
}

impl Default for FaultMemory {
    fn default() -> Self {
        Self {
            pending: 0,
            past: [Past::default(); 5],
            counters: [0; FAULTS],
        }
    }
}

impl FaultMemory {
    /// The highest value of a counter (1806).
    const COUNTED: u16 = 1_000;

    /// Records a fault; the oldest one is forgotten.
    pub fn record(&mut self, fault: Past) {
        self.pending = fault.code;
        self.past.rotate_right(1);
        self.past[0] = fault;
        if let Some(counter) = usize::from(fault.code)
            .checked_sub(1)
            .and_then(|index| self.counters.get_mut(index))
        {
            *counter = (*counter + 1).min(Self::COUNTED);
        }
    }

    /// The fault is acknowledged.
    pub const fn acknowledge(&mut self) {
        self.pending = 0;
    }

    /// 1800: the pending fault, 0 if there is none.
    #[must_use]
    pub const fn pending(&self) -> u8 {
        self.pending
    }

    /// The fault `age` places back: 0 is the newest (1801), 4 the oldest (1805). An empty place beyond.
    #[must_use]
    pub fn past(&self, age: usize) -> Past {
        self.past.get(age).copied().unwrap_or_default()
    }

    /// 947: the pending fault, or the last one if none is pending (4.1.3).
    #[must_use]
    pub const fn last(&self) -> u8 {
        if self.pending == 0 {
            self.past[0].code
        } else {
            self.pending
        }
    }

    /// 1806: how often the fault `element` + 1 has occurred, up to 1000.
    #[must_use]
    pub fn counter(&self, element: usize) -> u16 {
        self.counters.get(element).copied().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_fault_pushes_the_others_down() {
        let mut memory = FaultMemory::default();
        for code in 1..=6 {
            let fault = Past {
                code,
                set: 3,
                ..Past::default()
            };
            memory.record(fault);
        }
        let codes: Vec<u8> = (0..6).map(|age| memory.past(age).code).collect();
        assert_eq!(codes, [6, 5, 4, 3, 2, 0]);
        assert_eq!(
            (memory.pending(), memory.last(), memory.past(4).value(6)),
            (6, 6, 3)
        );
        memory.acknowledge();
        assert_eq!(
            (
                memory.pending(),
                memory.last(),
                memory.counter(5),
                memory.counter(6)
            ),
            (0, 6, 1, 0)
        );
    }

    #[test]
    fn counters_stop_at_1000() {
        let mut memory = FaultMemory::default();
        for _ in 0..1_100 {
            memory.record(Past {
                code: TIME_OUT,
                ..Past::default()
            });
        }
        assert_eq!(memory.counter(9), 1_000);
    }
}
