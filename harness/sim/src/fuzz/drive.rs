//! Operation lists on the whole ND21: its invariants are debug assertions, so builds for fuzzing have them on.

use super::LONGEST;
use crate::device::Device;
use crate::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use harness_proto::line::Received;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};

/// The longest time that an input may ask for, so that no case takes long.
const MOST_TIME: Span = Span::from_millis(5_000);

/// Four bytes an operation: what, and three operands. 0: a cell FFxx is written; 1: any cell; 2: an input; 3:
/// time in ms; 4: a byte on the bus; 5: reset; 6: power failure; 7: load, voltage, temperature; 8 and up:
/// time in cycles.
///
/// # Panics
/// An invariant of the drive is broken.
pub fn drive(data: &[u8]) {
    let properties = Nd21Properties::default();
    let mut drive = Nd21Drive::new(Properties::default(), properties, factory::eeprom());
    let mut now = Instant::START;
    let end = now + MOST_TIME;
    for operation in data[..data.len().min(LONGEST)].chunks_exact(4) {
        let &[what, a, b, c] = operation else { return };
        match what {
            0 => drive
                .program_mut()
                .write(ram::STATUS + u16::from(a & 0x7F), b),
            1 => drive.program_mut().write(u16::from_be_bytes([a, b]), c),
            2 => {
                let input = Input::ALL[usize::from(a) % Input::ALL.len()];
                drive.stimulate(Stimulus::Input(input, b & 1 != 0));
            }
            3 => now += Span::from_millis(u64::from(a)),
            4 => {
                drive.advance(now);
                drive.receive(now, Received::good(a));
                now += Span::from_micros(287);
            }
            5 => drive.program_mut().reset(),
            6 => drive.power_on(now),
            7 => drive.stimulate(match a % 4 {
                0 => Stimulus::Load(i32::from(i16::from_be_bytes([b, c])) * 10),
                1 => Stimulus::Rail(u32::from(b) * 4),
                2 => Stimulus::Cooler(i32::from(b) * 10),
                _ => Stimulus::Jammed(b & 1 != 0),
            }),
            cycles => now += Span::from_micros(432) * u64::from(cycles),
        }
        if now > end {
            return;
        }
        drive.advance(now);
        let _shown = drive.shown();
    }
}
