//! Operation lists on the whole ND21: its invariants are debug assertions, so builds for fuzzing have them on.

use super::LONGEST;
use super::drive_words::Watch;
use super::features::Notebook;
use crate::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use crate::novobus::device::Device;
use harness_proto::line::Received;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};

/// The longest time that an input may ask for, so that no case takes long.
const MOST_TIME: Span = Span::from_millis(5_000);

/// The cycle of the drive's program (ND21 4.1).
const CYCLE: Span = Span::from_micros(432);

/// Four bytes an operation: what, and three operands. 0: a cell FFxx is written; 1: any cell; 2: an input; 3:
/// time in ms; 4: a byte on the bus; 5: reset; 6: power failure; 7: what is outside, see [`Stimulus`]: load, voltage, temperature,
/// jam, sensor, resolver, short circuit, analogue input, frequency, cam at GPIN4; 8 and up: time in cycles.
///
/// # Panics
/// An invariant of the drive is broken.
pub fn drive(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the drive does is noted, cycle by cycle.
///
/// # Panics
/// As [`drive`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let properties = Nd21Properties::default();
    let mut drive = Nd21Drive::new(Properties::default(), properties, factory::eeprom());
    let mut watch = Watch::new(&drive);
    let mut now = Instant::START;
    let end = now + MOST_TIME;
    for operation in data[..data.len().min(LONGEST)].chunks_exact(4) {
        let &[what, a, b, c] = operation else { return };
        let before = now;
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
            7 => drive.stimulate(outside(a, b, c)),
            cycles => now += CYCLE * u64::from(cycles),
        }
        if now > end {
            return;
        }
        if notes.wanted() {
            match what {
                0 | 1 => watch.forget(&drive),
                2..8 if what != 3 => watch.comes(notes, NAMES[usize::from(what) - 2]),
                _ => {}
            }
            let mut time = before;
            while time < now {
                drive.advance(time);
                watch.look(notes, &drive);
                time += CYCLE;
            }
        }
        drive.advance(now);
        if notes.wanted() {
            watch.look(notes, &drive);
        }
        let _shown = drive.shown();
    }
}

/// The operations from 2 to 7.
const NAMES: [&str; 6] = [
    "an input is set",
    "time passes",
    "a byte comes over the bus",
    "a reset",
    "a power failure",
    "something changes outside",
];

/// What happens outside the bus.
fn outside(what: u8, b: u8, c: u8) -> Stimulus {
    let word = i32::from(i16::from_be_bytes([b, c]));
    let natural = u32::from(u16::from_be_bytes([b, c]));
    match what % 10 {
        0 => Stimulus::Load(word * 10),
        1 => Stimulus::Rail(u32::from(b) * 4),
        2 => Stimulus::Cooler(i32::from(b) * 10),
        3 => Stimulus::Jammed(b & 1 != 0),
        4 => Stimulus::MotorSensor(natural),
        5 => Stimulus::Resolver(b & 1 != 0),
        6 => Stimulus::Short(b & 1 != 0),
        7 => Stimulus::Analogue(word),
        8 => Stimulus::Frequency(natural * 8),
        _ => Stimulus::Cam(Input::Gpin4, i64::from(b) * 256, i64::from(c) * 256),
    }
}
