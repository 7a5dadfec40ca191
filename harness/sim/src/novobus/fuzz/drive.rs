//! Operation lists on the whole ND21: its invariants are debug assertions, so builds for fuzzing have them on.

use super::drive_words::DriveWatch;
use crate::fuzz::LONGEST;
use crate::fuzz::Notebook;
use crate::nd21::{Nd21Drive, Nd21Properties, Stimulus, factory};
use crate::novobus::device::Device;
use arbitrary::{Arbitrary, Unstructured};
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

/// What happens to the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operation {
    /// A cell is written; with no way over the bus.
    Write(u16, u8),
    /// An input is set.
    Input(Input, bool),
    /// Time passes.
    Wait(Span),
    /// A byte comes over the bus.
    Byte(u8),
    Reset,
    PowerFailure,
    /// Something changes outside the bus.
    Outside(Stimulus),
}

impl Operation {
    /// What comes to the drive from outside, in words.
    const fn name(self) -> Option<&'static str> {
        match self {
            Self::Write(..) | Self::Wait(_) => None,
            Self::Input(..) => Some("an input is set"),
            Self::Byte(_) => Some("a byte comes over the bus"),
            Self::Reset => Some("a reset"),
            Self::PowerFailure => Some("a power failure"),
            Self::Outside(_) => Some("something changes outside"),
        }
    }
}

impl<'a> Arbitrary<'a> for Operation {
    /// Four bytes: what, and three operands. 0: a cell FFxx is written; 1: any cell; 2: an input; 3: time in ms; 4: a byte on the bus; 5: reset;
    /// 6: power failure; 7: what is outside, see [`outside`]; 8 and up: time in cycles.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let [what, a, b, c] = input.arbitrary()?;
        Ok(match what {
            0 => Self::Write(ram::STATUS + u16::from(a & 0x7F), b),
            1 => Self::Write(u16::from_be_bytes([a, b]), c),
            2 => Self::Input(Input::ALL[usize::from(a) % Input::ALL.len()], b & 1 != 0),
            3 => Self::Wait(Span::from_millis(u64::from(a))),
            4 => Self::Byte(a),
            5 => Self::Reset,
            6 => Self::PowerFailure,
            7 => Self::Outside(outside(a, b, c)),
            cycles => Self::Wait(CYCLE * u64::from(cycles)),
        })
    }
}

/// A list of operations on an ND21.
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
    let mut watch = DriveWatch::new(&drive);
    let mut now = Instant::START;
    let end = now + MOST_TIME;
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    while let (false, Ok(operation)) = (input.is_empty(), input.arbitrary()) {
        let before = now;
        match operation {
            Operation::Write(address, byte) => drive.program_mut().write(address, byte),
            Operation::Input(input, high) => drive.stimulate(Stimulus::Input(input, high)),
            Operation::Wait(time) => now += time,
            Operation::Byte(byte) => {
                drive.advance(now);
                drive.receive(now, Received::good(byte));
                now += Span::from_micros(287);
            }
            Operation::Reset => drive.program_mut().reset(),
            Operation::PowerFailure => drive.power_on(now),
            Operation::Outside(stimulus) => drive.stimulate(stimulus),
        }
        if now > end {
            return;
        }
        if notes.wanted() {
            match (operation, operation.name()) {
                (Operation::Write(..), _) => watch.forget(&drive),
                (_, Some(name)) => watch.comes(notes, name),
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

/// What happens outside the bus: load, voltage, temperature, jam, sensor, resolver, short circuit, analogue input, frequency, cam at GPIN4.
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
