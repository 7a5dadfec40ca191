//! The memory oscilloscope (ND21 14.10.6).
//!
//! It has no state but its cells and the divider of its time base: what a bus write leaves in the cells is
//! obeyed at the next scan, at any time and in any order. Its own cells are `scope_status`,
//! `scope_counter`, `scope_delay`, `scope_pointer` and `scope_puffer`; it writes to no other.
//!
//! What the manual leaves open, and what is chosen here:
//!
//! * *One byte a scan period.* Every scan period one byte is stored, of signal 1 where the address is even
//!   and of signal 2 where it is odd. Then the 256 bytes of `scope_puffer` are the "total of 256
//!   measurements" and last the printed 256 x 108 us = 27,648 ms (14.10.6.2), 46 and 210 scan points fill
//!   them exactly (14.10.6.4), `scope_pointer` counts bytes (14.10.6.6), and the same address in both
//!   cells shows one signal without a gap (14.10.6.1). A pair each period would fill the buffer in half of
//!   that time (E130).
//! * *`scope_counter` includes the measurement that triggers*: 46 before and 210 from it on are 256, and
//!   with H'0100 the recording begins at the trigger.
//! * *`scope_counter` = 0 has nothing to run down*: the recording goes on until it is stopped by hand. No
//!   trigger delay gives this value, and "both cells must be programmed with each new recording"
//!   (14.10.6.4).
//! * *Auto trigger* (14.10.6.7): bit 7 is set to 0 and nothing else, and later back to 1. The cells are then
//!   as a finished recording has left them (bits 6 and 5 are 1, `scope_counter` is 0) or as after power-up
//!   (bits 6 to 4 and `scope_counter` are 0). In both cases measurements are stored until bit 7 is set to
//!   1, whatever the trigger signal does. With another `scope_counter` a trigger ends it.
//! * *The delay* counts measurements, and no trigger condition is looked at while it runs, not even for bit
//!   5. Bit 6 written as 1 is a trigger that has occurred.
//! * *The trigger* is looked at with each measurement after the delay, at the same instant. A signal that
//!   reaches the threshold has passed it: bit 5 goes to 0 strictly below (positive flank) or above
//!   (negative flank), and back to 1 as soon as that no longer holds. A signal that never was on the near
//!   side does not trigger.
//! * *The divider of the time base* starts a scan period at power-up and at each end of a recording. Where
//!   a recording is stopped by hand in the middle of a scan period, the next one finishes that period.
//! * *`scope_pointer`* is not set by the start of a recording; it goes on round the buffer.

use crate::novobus::cells::Cells;
use harness_proto::nd21::bits::scope_status::{ARMED, POSITIVE, STOPPED, TRIGGERED};
use harness_proto::nd21::ram;

/// Signals lie in the RAM range FFxx; the cells hold the low byte (ND21 14.10.6.1).
const SIGNALS: u16 = 0xFF00;

/// The memory oscilloscope.
#[derive(Clone, Debug, Default)]
pub(super) struct Scope {
    /// The scans of the scan period that is running.
    elapsed: u8,
}

impl Scope {
    /// As after power-up and reset: stopped.
    pub(super) fn start(&mut self, cells: &mut Cells) {
        self.elapsed = 0;
        cells.set_bits(ram::SCOPE_STATUS, STOPPED, true);
    }

    /// Whether a recording runs (ND21 14.10.6.5): if not, [`Self::scan`] does nothing.
    pub(super) fn running(&self, cells: &Cells) -> bool {
        cells.byte(ram::SCOPE_STATUS) & STOPPED == 0
    }

    /// 108 us have passed. A measurement is due every `scope_timer0` + 1 of them (ND21 14.10.6.2, E106).
    pub(super) fn scan(&mut self, cells: &mut Cells) {
        if !self.running(cells) {
            return;
        }
        if self.elapsed < cells.byte(ram::SCOPE_TIMER0) {
            self.elapsed += 1;
            return;
        }
        self.elapsed = 0;
        measure(cells);
        // "First the delay time runs down. Next the triggering conditions will be checked" (14.10.6.6).
        let delay = cells.byte(ram::SCOPE_DELAY);
        if delay != 0 {
            cells.put(ram::SCOPE_DELAY, delay - 1);
        } else if cells.byte(ram::SCOPE_STATUS) & TRIGGERED != 0 || triggers(cells) {
            run_down(cells);
        }
    }
}

/// The low byte of an address, in the cell `selector`, selects a signal (ND21 14.10.6.1).
fn signal(cells: &Cells, selector: u16) -> u8 {
    cells.byte(SIGNALS | u16::from(cells.byte(selector)))
}

/// Stores a byte behind the newest one: signal 1 at even addresses, 2 at odd ones (ND21 14.10.6.6).
fn measure(cells: &mut Cells) {
    let pointer = cells.byte(ram::SCOPE_POINTER).wrapping_add(1);
    let address = ram::SCOPE_PUFFER + u16::from(pointer);
    let selector = if address.is_multiple_of(2) {
        ram::SCOPE_SIGNAL1
    } else {
        ram::SCOPE_SIGNAL2
    };
    // `scope_pointer` may be selected itself: the value before this measurement is stored.
    cells.put(address, signal(cells, selector));
    cells.put(ram::SCOPE_POINTER, pointer);
}

/// Follows the trigger signal with bit 5, and sets bit 6 where it passes the threshold (ND21 14.10.6.6).
fn triggers(cells: &mut Cells) -> bool {
    let status = cells.byte(ram::SCOPE_STATUS);
    let level = cells.byte(ram::SCOPE_LEVEL);
    // The threshold has its bit 7 inverted (14.10.6.3): so the signal's bit 7 is, too, and two's
    // complement compares as plain bytes.
    let signal = signal(cells, ram::SCOPE_TRIGGER) ^ 0x80;
    let near = if status & POSITIVE != 0 {
        signal < level
    } else {
        signal > level
    };
    let passed = status & ARMED == 0 && !near;
    if near {
        cells.set_bits(ram::SCOPE_STATUS, ARMED, false);
    } else if passed {
        cells.set_bits(ram::SCOPE_STATUS, ARMED | TRIGGERED, true);
    }
    passed
}

/// Counts one measurement from the trigger on; at the end bit 7 is set (ND21 14.10.6.6, E107).
fn run_down(cells: &mut Cells) {
    let Some(left) = cells.word(ram::SCOPE_COUNTER).checked_sub(1) else {
        return;
    };
    cells.put_word(ram::SCOPE_COUNTER, left);
    cells.set_bits(ram::SCOPE_STATUS, STOPPED, left == 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::nd21::units::{
        DriveType, Ratio, momentary_current_to_raw, scope_address, trigger_delay,
        trigger_level_to_raw,
    };

    /// A cell that counts the scans, to tell measurements apart: it has no part in the oscilloscope.
    const COUNT: u16 = ram::UMDRIST;

    /// An oscilloscope that records [`COUNT`] and triggers on `iaist`.
    struct ScopeBench {
        cells: Cells,
        scope: Scope,
        scans: u32,
    }

    impl ScopeBench {
        fn new() -> Self {
            let mut cells = Cells::with_eeprom([0; 256]);
            let mut scope = Scope::default();
            scope.start(&mut cells);
            for selector in [ram::SCOPE_SIGNAL1, ram::SCOPE_SIGNAL2] {
                cells.put(selector, (COUNT & 0xFF) as u8);
            }
            cells.put(ram::SCOPE_TRIGGER, (ram::IAIST & 0xFF) as u8);
            Self {
                cells,
                scope,
                scans: 0,
            }
        }

        /// Loads a recording as 14.10.6.6 says, the trigger delay in us.
        fn load(&mut self, status: u8, delay_us: i64) {
            let timer0 = self.cells.byte(ram::SCOPE_TIMER0);
            let delay = trigger_delay(delay_us, timer0).unwrap();
            self.cells.put(ram::SCOPE_DELAY, delay.delay);
            self.cells.put_word(ram::SCOPE_COUNTER, delay.counter);
            self.cells.put(ram::SCOPE_STATUS, status);
        }

        fn status(&self) -> u8 {
            self.cells.byte(ram::SCOPE_STATUS)
        }

        /// One scan with this trigger signal; the first one has the number 0.
        fn scan(&mut self, trigger: i8) {
            self.cells.put(COUNT, (self.scans & 0xFF) as u8);
            self.cells.put(ram::IAIST, trigger.cast_unsigned());
            self.scope.scan(&mut self.cells);
            self.scans += 1;
        }

        /// Scans with this trigger signal, until the end of the recording; how many there were.
        fn finish(&mut self, trigger: i8) -> u32 {
            let first = self.scans;
            while self.scope.running(&self.cells) {
                self.scan(trigger);
                assert!(self.scans < 1_000_000);
            }
            self.scans - first
        }

        /// The recording, read as 14.10.6.6 says: from the pointer + 1 to the end, from the beginning to
        /// the pointer.
        fn recording(&self) -> Vec<u8> {
            let end = 0xFDA0 + u16::from(self.cells.byte(ram::SCOPE_POINTER));
            let addresses = (end + 1..=0xFE9F).chain(0xFDA0..=end);
            addresses.map(|address| self.cells.byte(address)).collect()
        }

        /// Whether the recording is the 256 scans from this one on.
        fn shows_from(&self, scan: u32) -> bool {
            let expected = (scan..scan + 256).map(|scan| (scan & 0xFF) as u8);
            self.recording().into_iter().eq(expected)
        }
    }

    /// 14.10.6.5: after power-up nothing is recorded.
    #[test]
    fn power_up_is_a_stopped_recording() {
        let mut bench = ScopeBench::new();
        assert_eq!(bench.status(), 0x80);
        let before = bench.cells.clone();
        assert!(!bench.scope.running(&bench.cells));
        bench.scope.scan(&mut bench.cells);
        assert_eq!(bench.cells, before);
    }

    /// 14.10.6.4: -5 ms at 108 us are 46 scan points before the trigger and 210 from it on, which fill the
    /// buffer of 14.10.6.2; the trigger is 14.10.6.3, -7 A on a 5610, with both flanks of 14.10.6.6.
    #[test]
    fn worked_examples_of_14_10_6() {
        let level = momentary_current_to_raw(Ratio::whole(-7), DriveType::Nd5610).unwrap();
        assert_eq!(trigger_level_to_raw(level), 0x63);
        for (status, near) in [(0x30, level - 1), (0x20, level + 1)] {
            let mut bench = ScopeBench::new();
            bench.cells.put(ram::SCOPE_LEVEL, 0x63);
            bench.load(status, -5_000);
            assert_eq!(bench.cells.byte(ram::SCOPE_DELAY), 46);
            for _ in 0..300 {
                bench.scan(near);
                assert_eq!(bench.status() & TRIGGERED, 0);
            }
            // Bit 5 has gone to 0, for the signal is on the near side.
            assert_eq!(bench.status(), status & !ARMED);
            bench.scan(level);
            assert_eq!(bench.status(), status | TRIGGERED);
            assert_eq!(bench.finish(near), 209);
            // The trigger is scan 300: 46 before it, 210 from it on.
            assert!(bench.shows_from(300 - 46));
            assert_eq!(bench.status(), status | TRIGGERED | STOPPED);
            let end = bench.cells.clone();
            bench.scope.scan(&mut bench.cells);
            assert_eq!(bench.cells, end);
        }
    }

    /// 14.10.6.6: bit 5 stays 1, and nothing triggers, while the signal has not been on the near side.
    #[test]
    fn what_never_was_below_does_not_pass() {
        for (status, far, near) in [(0x30, 10, -10), (0x20, -10, 10)] {
            let mut bench = ScopeBench::new();
            bench.cells.put(ram::SCOPE_LEVEL, trigger_level_to_raw(0));
            bench.load(status, 0);
            for trigger in [far, 0, far] {
                bench.scan(trigger);
                assert_eq!(bench.status(), status);
            }
            bench.scan(near);
            assert_eq!(bench.status(), status & !ARMED);
            bench.scan(far);
            assert_eq!(bench.status(), status | TRIGGERED);
        }
    }

    /// 14.10.6.6: while the delay runs down, the trigger conditions are not checked.
    #[test]
    fn the_delay_comes_first() {
        let mut bench = ScopeBench::new();
        bench.cells.put(ram::SCOPE_LEVEL, trigger_level_to_raw(0));
        bench.load(0x30, -3 * 108);
        for (trigger, delay) in [(-1, 2), (1, 1), (-1, 0)] {
            bench.scan(trigger);
            assert_eq!(bench.cells.byte(ram::SCOPE_DELAY), delay);
            assert_eq!(bench.status(), 0x30);
        }
        bench.scan(-1);
        assert_eq!(bench.status(), 0x10);
        // The threshold can be changed at any time (14.10.6.3).
        bench.cells.put(ram::SCOPE_LEVEL, trigger_level_to_raw(-5));
        bench.scan(-1);
        assert_eq!(bench.status(), 0x70);
    }

    /// 14.10.6.4: a recording begins at the trigger, or a number of scan periods after it.
    #[test]
    fn positive_delays() {
        for (delay_us, periods) in [(0, 0), (108, 1), (40_000, 370), (65_279 * 108, 65_279)] {
            let mut bench = ScopeBench::new();
            bench.cells.put(ram::SCOPE_LEVEL, trigger_level_to_raw(0));
            bench.load(0x30, delay_us);
            bench.scan(-1);
            assert_eq!(bench.finish(1), 256 + periods);
            assert!(bench.shows_from(1 + periods));
        }
    }

    /// 14.10.6.2, E106: a measurement every `scope_timer0` + 1 scans, the first after a whole period.
    #[test]
    fn time_base() {
        for timer0 in [0, 1, 3, 255] {
            let period = u32::from(timer0) + 1;
            let mut bench = ScopeBench::new();
            bench.cells.put(ram::SCOPE_TIMER0, timer0);
            bench.cells.put(ram::SCOPE_LEVEL, trigger_level_to_raw(0));
            bench.load(0x30, 0);
            let first = (0..period).map(|_| bench.scan(-1)).count();
            assert_eq!(first as u32, period);
            assert_eq!(bench.status(), 0x10);
            assert_eq!(bench.finish(1), 256 * period);
            let scans = (2..258).map(|n| ((n * period - 1) & 0xFF) as u8);
            assert!(bench.recording().into_iter().eq(scans));
        }
    }

    /// 14.10.6.6: signal 1 at even addresses, 2 at odd ones; 14.10.6.1: only the low byte selects.
    #[test]
    fn two_signals() {
        let mut bench = ScopeBench::new();
        bench.cells.put(ram::SCOPE_SIGNAL1, 0x00);
        bench.cells.put(ram::SCOPE_SIGNAL2, 0xFF);
        bench.cells.put(0xFF00, 0x11);
        bench.cells.put(0xFFFF, 0x22);
        bench.load(0x60, 0);
        assert_eq!(bench.finish(0), 256);
        for address in 0xFDA0..=0xFE9F_u16 {
            let expected = if address.is_multiple_of(2) {
                0x11
            } else {
                0x22
            };
            assert_eq!(bench.cells.byte(address), expected);
        }
    }

    /// 14.10.6.6: from every pointer the three lines of the manual give the order of time, and so does the
    /// function of the units.
    #[test]
    fn buffer_order() {
        for pointer in 0..=u8::MAX {
            let mut bench = ScopeBench::new();
            bench.cells.put(ram::SCOPE_POINTER, pointer);
            bench.load(0x40, 17 * 108);
            assert_eq!(bench.finish(0), 256 + 17);
            assert!(bench.shows_from(17));
            let end = bench.cells.byte(ram::SCOPE_POINTER);
            assert_eq!(end, pointer.wrapping_add(17));
            for n in 0..=u8::MAX {
                let byte = bench.cells.byte(scope_address(end, n));
                assert_eq!(byte, n.wrapping_add(17));
            }
        }
    }

    /// 14.10.6.7: bit 7 alone starts and ends a recording without a trigger, after power-up and after a
    /// finished recording.
    #[test]
    fn auto_trigger() {
        let mut bench = ScopeBench::new();
        for level in [0x00, 0x80, 0xFF] {
            bench.cells.put(ram::SCOPE_LEVEL, level);
            for scans in [256, 257, 1_000] {
                bench.cells.set_bits(ram::SCOPE_STATUS, STOPPED, false);
                (0..scans).for_each(|n| bench.scan(if n % 2 == 0 { -1 } else { 1 }));
                assert!(bench.scope.running(&bench.cells));
                bench.cells.set_bits(ram::SCOPE_STATUS, STOPPED, true);
                bench.scan(0);
                assert!(bench.shows_from(bench.scans - 1 - 256));
            }
            bench.load(0x60, 0);
            bench.finish(0);
            assert_eq!(bench.status(), 0xE0);
        }
    }

    /// The choice for `scope_counter` = 0: no end.
    #[test]
    fn a_counter_that_was_not_loaded() {
        let mut bench = ScopeBench::new();
        bench.load(0x60, 0);
        bench.cells.put_word(ram::SCOPE_COUNTER, 0);
        (0..100_000).for_each(|_| bench.scan(0));
        assert_eq!(bench.status(), 0x60);
    }

    /// Whatever the cells hold, at most one byte of FDA0-FE9F and its own cells change, at each scan.
    #[test]
    fn nothing_else_is_touched() {
        let mut state = 0x2545_F491_4F6C_DD1D_u64;
        let mut random = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        };
        let mut cells = Cells::with_eeprom([0; 256]);
        let mut scope = Scope::default();
        for n in 0..100_000 {
            if n % 1_000 == 0 {
                (0xFD80..=0xFFFF).for_each(|address| cells.put(address, random() as u8));
                cells.put(ram::SCOPE_TIMER0, (random() % 4) as u8);
            }
            let word = random();
            let address = 0xFF00 | (word & 0xFF) as u16;
            cells.put(address, (word >> 8) as u8);
            cells.set_bits(ram::SCOPE_STATUS, STOPPED, word >> 60 == 0);

            let before = cells.clone();
            scope.scan(&mut cells);
            let buffer = || (0xFDA0..=0xFE9F).filter(|&a| cells.byte(a) != before.byte(a));
            assert!(buffer().count() <= 1);
            let state = [0xFF38, 0xFF3A, 0xFF3B, 0xFF3C, 0xFF3D];
            let mut allowed = before.clone();
            buffer()
                .chain(state)
                .for_each(|a| allowed.put(a, cells.byte(a)));
            assert_eq!(cells, allowed);
        }
    }
}
