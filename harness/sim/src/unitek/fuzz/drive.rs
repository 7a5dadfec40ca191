//! Frames, waits and inputs for one drive, beside the reference model.

use super::cells::{CellState, DriveCell, Event};
use crate::fuzz::{LONGEST, Notebook};
use crate::unitek::Drive;
use crate::unitek::inputs::Inputs;
use crate::unitek::outbox::Cause;
use crate::unitek::reference::Reference;
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::can::{Frame, Id};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{CYCLES, DEFAULT_RX};
use harness_proto::unitek::properties::{Accepts, PROPERTIES, Properties, Setting};
use harness_proto::unitek::words::{ERROR_TIME_OUT, MODE_EVENT, MODE_LOCK, status};
use harness_proto::unitek::{Access, Data, Ignored, Register, Request, Width};
use std::sync::LazyLock;

/// Milliseconds after which a case ends, so that none takes long.
const MOST_TIME: u64 = 250;

/// Homing ends soon in all variants but that of `homing-time`.
const HOMING: Span = Span::from_millis(5);

/// What happens to the drive, and how many milliseconds pass after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct DriveStep {
    what: DriveOperation,
    wait: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DriveOperation {
    /// A frame to the identifier that the drive receives on now.
    ToDrive([u8; 8], usize),
    /// A frame to the identifier that it was delivered with.
    ToDelivered([u8; 8], usize),
    /// A frame with this identifier.
    Elsewhere(Id, [u8; 8], usize),
    /// A remote frame with the drive's identifier.
    Remote(usize),
    /// The input with this number is switched.
    Switch(usize, bool),
    /// The value with this number is overruled, or no longer.
    Force(usize, Option<u32>),
    /// This number of milliseconds passes.
    Time(u64),
}

impl<'a> Arbitrary<'a> for DriveStep {
    /// Seven bytes: what, register, four bytes of a value, time. Of the first byte, bits 3 to 0 give the number of data bytes (9 to 11 mean 3,
    /// 12 to 15 mean 5), or which input or value. 00: a frame to the drive; 80: to 201; B0: to the identifier in the value, bit 31 for 29 bits;
    /// C0: a remote frame; D0: an input; E0: a value that is overruled; F0: it is so no longer; FF: a quarter of the first byte
    /// of the value in milliseconds.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let mut bytes = [0; 7];
        input.fill_buffer(&mut bytes)?;
        let [what, register, a, b, c, d, wait] = bytes;
        let value = u32::from_le_bytes([a, b, c, d]);
        let low = usize::from(what & 0xF);
        let len = match low {
            0..=8 => low,
            9..=11 => 3,
            _ => 5,
        };
        let data = [register, a, b, c, d, 7, 8, 9];
        let what = match what >> 4 {
            0x0..=0x7 => DriveOperation::ToDrive(data, len),
            0x8..=0xA => DriveOperation::ToDelivered(data, len),
            0xB => DriveOperation::Elsewhere(identifier(value), data, len),
            0xC => DriveOperation::Remote(len),
            0xD => DriveOperation::Switch(low % Inputs::SWITCHES.len(), register & 1 != 0),
            0xE => DriveOperation::Force(low % Inputs::FORCED.len(), Some(value)),
            0xF if low == 0xF => DriveOperation::Time(u64::from(a >> 2)),
            _ => DriveOperation::Force(low % Inputs::FORCED.len(), None),
        };
        Ok(Self {
            what,
            wait: millis(wait),
        })
    }
}

/// The identifier that a value gives: 29 bits where its highest bit is set.
fn identifier(value: u32) -> Id {
    let base = Id::base((value & 0x7FF) as u16);
    let extended = Id::extended(value & Id::MAX_EXTENDED);
    let chosen = if value >> 31 == 0 { base } else { extended };
    chosen.or(base).unwrap_or_else(|| unreachable!("7FF fits"))
}

/// The milliseconds that a byte gives: mostly few, since each of them is computed twice.
fn millis(byte: u8) -> u64 {
    let mask = match byte {
        0x00..=0xBF => 1,
        0xC0..=0xEF => 3,
        _ => 0xF,
    };
    u64::from(byte & mask)
}

/// Both models of a drive, at the same time.
#[derive(Clone, Debug)]
struct Pair {
    drive: Drive,
    reference: Reference,
    inputs: Inputs,
    /// Milliseconds since power-up.
    now: u64,
}

/// Both models with the profiles `ds` and `fw472`, and with each other value of each open point. A copy is made much faster than a new one.
static VARIANTS: LazyLock<Vec<Pair>> = LazyLock::new(|| {
    let ds = Properties {
        homing_time: HOMING,
        ..Properties::default()
    };
    let fw472 = Properties {
        homing_time: HOMING,
        ..Properties::fw472()
    };
    let mut all = vec![ds, fw472];
    for property in PROPERTIES {
        let settings = match property.accepts {
            Accepts::Words(words) => words
                .iter()
                .skip(1)
                .map(|word| Setting::Word(word))
                .collect(),
            Accepts::Byte => vec![Setting::Word("A5")],
            Accepts::TimeUpTo(_) => vec![Setting::Time(Span::from_millis(500))],
        };
        for setting in settings {
            let mut variant = ds;
            // The reference model knows neither delays nor counters.
            let known = !matches!(property.name, "reply-delay" | "can-counters");
            if known && property.set(&mut variant, setting) {
                all.push(variant);
            }
        }
    }
    all.into_iter().map(Pair::new).collect()
});

/// The first byte chooses the variant of the drive; the others are operations of seven bytes.
///
/// # Panics
/// The drive does something else than the reference model, or breaks a rule of the manual.
pub fn drive(data: &[u8]) {
    drive_watched(data, &mut |_| {});
}

/// The same, and every cell that the drive goes through is given to `reached`.
///
/// # Panics
/// As [`drive`].
fn drive_watched(data: &[u8], reached: &mut impl FnMut(DriveCell)) {
    let Some((&variant, data)) = data.split_first() else {
        return;
    };
    let mut pair = VARIANTS[usize::from(variant) % VARIANTS.len()].clone();
    let mut input = Unstructured::new(&data[..data.len().min(LONGEST)]);
    while let (false, Ok(operation)) = (input.is_empty(), input.arbitrary::<DriveStep>()) {
        if pair.now > MOST_TIME {
            break;
        }
        pair.happens(operation.what, reached);
        pair.wait(operation.wait, reached);
    }
    pair.compare();
}

/// The same, and the number of every cell that the drive goes through is given to `reached`.
///
/// # Panics
/// As [`drive`].
pub fn drive_counted(data: &[u8], reached: &mut impl FnMut(usize)) {
    drive_watched(data, &mut |cell| reached(cell.index()));
}

/// The same, and the cells are noted.
///
/// # Panics
/// As [`drive`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    drive_watched(data, &mut |cell| {
        assert!(
            cell.is_reachable(),
            "{} was called unreachable",
            cell.feature()
        );
        notes.note(|| cell.feature());
    });
}

impl Pair {
    fn new(properties: Properties) -> Self {
        let inputs = Inputs::default();
        Self {
            drive: Drive::new(properties, inputs, Instant::START),
            reference: Reference::new(properties, inputs),
            inputs,
            now: 0,
        }
    }

    fn at(&self) -> Instant {
        Instant::START + Span::from_millis(self.now)
    }

    fn happens(&mut self, what: DriveOperation, reached: &mut impl FnMut(DriveCell)) {
        let rx = self.drive.identifiers().0;
        let id = Id::base(rx).or(Id::base(DEFAULT_RX));
        let frame = match (what, id) {
            (DriveOperation::ToDrive(data, len), Some(id)) => Frame::new(id, &data[..len]),
            (DriveOperation::ToDelivered(data, len), _) => Frame::base(DEFAULT_RX, &data[..len]),
            (DriveOperation::Elsewhere(id, data, len), _) => Frame::new(id, &data[..len]),
            (DriveOperation::Remote(len), Some(id)) => Frame::remote(id, len),
            (DriveOperation::Switch(number, on), _) => return self.switch(number, on, reached),
            (DriveOperation::Force(number, raw), _) => return self.force(number, raw, reached),
            (DriveOperation::Time(millis), _) => return self.wait(millis, reached),
            (_, None) => return,
        };
        if let Ok(frame) = frame {
            self.frame(&frame, reached);
        }
    }

    fn switch(&mut self, number: usize, on: bool, reached: &mut impl FnMut(DriveCell)) {
        self.happened(Event::Input, reached);
        if let Some(input) = self.inputs.switch(Inputs::SWITCHES[number]) {
            *input = on;
        }
        self.connect();
    }

    fn force(&mut self, number: usize, raw: Option<u32>, reached: &mut impl FnMut(DriveCell)) {
        let faults = self.inputs.faults;
        let _known = self.inputs.force(Inputs::FORCED[number], raw);
        let event = if self.inputs.faults == faults {
            Event::Forced
        } else {
            Event::Fault
        };
        self.happened(event, reached);
        self.connect();
    }

    fn connect(&mut self) {
        self.drive.set_inputs(self.at(), self.inputs);
        self.reference.inputs = self.inputs;
    }

    /// An event in the present state of the drive.
    fn happened(&self, event: Event, reached: &mut impl FnMut(DriveCell)) {
        let state = CellState::of(&self.drive);
        reached(DriveCell { state, event });
    }

    fn frame(&mut self, frame: &Frame, reached: &mut impl FnMut(DriveCell)) {
        let request = self.drive.reads(frame).map(|(request, _)| request);
        self.happened(self.event(request), reached);
        if let Ok(Request::Write { register, data }) = request
            && let Some(event) = other_width(register, data)
        {
            self.happened(event, reached);
        }
        let taken = self.drive.receive(self.at(), frame);
        assert_eq!(taken, request, "{frame} is read differently");
        let expected = self.reference.frame(frame);
        if let Some(reply) = expected {
            // Section 11 of the reading: nothing but a request for sending is answered at once.
            let asked = match request {
                Ok(Request::Read { register } | Request::Cycle { register, .. }) => Some(register),
                _ => None,
            };
            assert_eq!(
                asked,
                reply.data().first().copied(),
                "{reply} answers {frame}"
            );
        }
        self.sends(expected, &mut |_| {});
        self.check();
    }

    /// What a frame is to the drive in its present state.
    fn event(&self, request: Result<Request, Ignored>) -> Event {
        let cycles = || self.drive.running_cycles();
        let has_cycle = |register| cycles().any(|(running, _)| running == register);
        match request {
            Err(Ignored::Extended | Ignored::OtherIdentifier | Ignored::OtherRate) => {
                Event::Foreign
            }
            Err(Ignored::Remote) => Event::Remote,
            Err(Ignored::TooShort | Ignored::FourBytes) => Event::TooShort,
            Ok(Request::Read { register }) if has_cycle(register) => Event::ReadOfCycle,
            Ok(Request::Read { .. }) => Event::Read,
            Ok(Request::Cycle { register, .. }) if has_cycle(register) => Event::Restart,
            Ok(Request::Cycle { .. }) if cycles().count() == CYCLES => Event::Ninth,
            Ok(Request::Cycle { .. }) => Event::Start,
            Ok(Request::Stop { register }) if has_cycle(register) => Event::Stop,
            Ok(Request::Stop { .. }) => Event::StopOfNone,
            Ok(Request::Write { register, data }) => {
                let homes = register == 0x78 && data.bits() & 0xFFFF == 1;
                if homes && self.drive.is_enabled() {
                    Event::Homing
                } else {
                    written(register, data)
                }
            }
        }
    }

    /// Time passes, millisecond by millisecond: both models send the same frames.
    fn wait(&mut self, millis: u64, reached: &mut impl FnMut(DriveCell)) {
        if millis == 0 {
            return;
        }
        let state = CellState::of(&self.drive);
        let homing = self.drive.is_homing();
        let timed_out = self.drive.register(0x8F) & ERROR_TIME_OUT;
        let mut quiet = true;
        let mut due = self.drive.next_scan();
        for _ in 0..millis {
            self.now += 1;
            let expected = self.reference.millisecond();
            // Between two scans that do something the drive sends nothing.
            let at = self.at();
            if due.is_some_and(|due| due <= at) {
                self.drive.advance(at);
                due = self.drive.next_scan();
            }
            if expected.is_empty() && self.drive.wants().is_none() {
                continue;
            }
            quiet = false;
            self.sends(expected, &mut |cause| {
                let event = match cause {
                    Cause::Asked => Event::Read,
                    Cause::Cycle(_) => Event::Cyclic,
                    Cause::Event => Event::StatusSent,
                };
                reached(DriveCell { state, event });
            });
        }
        self.drive.advance(self.at());
        let ended = homing && !self.drive.is_homing() && self.drive.is_enabled();
        let found = timed_out == 0 && self.drive.register(0x8F) & ERROR_TIME_OUT != 0;
        let events = [
            (quiet, Event::Quiet),
            (ended, Event::HomingEnds),
            (found, Event::TimedOut),
        ];
        for (_, event) in events.into_iter().filter(|(happened, _)| *happened) {
            reached(DriveCell { state, event });
        }
        self.check();
    }

    /// The drive has sent these frames now, and no other.
    fn sends(&mut self, expected: impl IntoIterator<Item = Frame>, cause: &mut impl FnMut(Cause)) {
        let now = self.at();
        for expected in expected {
            let sent = self.drive.sent();
            let found = sent.map(|waiting| (waiting.ready, waiting.frame));
            assert_eq!(found, Some((now, expected)), "at {} ms", self.now);
            assert!(
                matches!(expected.dlc(), 4 | 6),
                "{expected} is no reply (4.5)"
            );
            if let Some(sent) = sent {
                cause(sent.cause);
            }
        }
        let more = self.drive.wants();
        assert!(more.is_none(), "at {} ms it also sends {more:?}", self.now);
    }

    /// What holds at any time.
    fn check(&self) {
        let drive = &self.drive;
        assert!(
            drive.running_cycles().count() <= CYCLES,
            "more than 8 cycles (App 8)"
        );
        let enabled = drive.register(0x40) & status::ENABLED != 0;
        assert_eq!(enabled, drive.is_enabled(), "bit 0 of STATUS (ex 8)");
        let locked = drive.held()[0x51] & u32::from(MODE_LOCK) != 0;
        assert!(!(locked && enabled), "locked and enabled (ex 2)");
    }

    /// Both models hold the same and show the same.
    fn compare(&mut self) {
        self.drive.advance(self.at());
        let (drive, reference) = (&self.drive, &self.reference);
        if drive.held() != reference.held() {
            let pairs = drive.held().iter().zip(reference.held());
            let differing = (0..=u8::MAX).zip(pairs).find(|(_, (is, must))| is != must);
            panic!("register {differing:02X?} holds something else in the reference model");
        }
        for number in SHOWN {
            assert_eq!(
                drive.register(number),
                reference.read(number),
                "register {number:02X}"
            );
        }
    }
}

/// Registers that show the state of the drive and its motor; all others follow from these or hold what they show.
const SHOWN: [u8; 9] = [0x20, 0x30, 0x40, 0x6D, 0x70, 0x8F, 0x91, 0xD8, 0xEB];

/// What a write is by its register.
fn written(register: u8, data: Data) -> Event {
    let mode = data.bits() & u32::from(MODE_LOCK | MODE_EVENT);
    let (lock, event) = (u32::from(MODE_LOCK), u32::from(MODE_EVENT));
    match register {
        0x51 if mode == lock | event => Event::LockWithStatus,
        0x51 if mode == lock => Event::Lock,
        0x51 if mode == event => Event::ReleaseWithStatus,
        0x51 => Event::Release,
        0x52 => Event::Mask,
        0x31 => Event::Speed,
        0x90 => Event::Torque,
        0x6E => Event::Position,
        0x7A => Event::Preset,
        0x8E => Event::ClearErrors,
        0x84 if data.bits() & 0xFFFF < 2 => Event::Store,
        0x83 if data.bits() & 0xFFFF < 2 => Event::Load,
        0x68 | 0x69 => Event::Identifier,
        0xD0 => Event::TimeOut,
        0xDC => Event::Width,
        0x34 | 0x35 | 0xC7 | 0xC8 | 0xED => Event::Ramp,
        _ => match Register::of(register).access {
            Access::FN => Event::NoFunction,
            Access::RO | Access::UK => Event::ReadOnly,
            Access::RW | Access::SP => Event::Parameter,
        },
    }
}

/// A write with another width than the register has.
fn other_width(register: u8, data: Data) -> Option<Event> {
    match (Register::of(register).width, data) {
        (Width::Bits32, Data::Short(_)) => Some(Event::ShortWrite),
        (Width::Bits16, Data::Long(_)) => Some(Event::LongWrite),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variants that the first byte chooses: two profiles, and the other values of what the reference model knows.
    #[test]
    fn every_variant_differs() {
        assert_eq!(VARIANTS.len(), 30);
        for (place, one) in VARIANTS.iter().enumerate() {
            for other in &VARIANTS[..place] {
                assert_ne!(one.drive.properties(), other.drive.properties());
            }
        }
    }

    /// A wrong drive is found: its contents are changed behind the back of the reference model.
    #[test]
    #[should_panic(expected = "holds something else")]
    fn a_difference_is_found() {
        let mut pair = VARIANTS[0].clone();
        pair.drive.poke(0x1C, 11);
        pair.compare();
    }

    /// The same, with a reply.
    #[test]
    #[should_panic(expected = "at 0 ms")]
    fn a_wrong_reply_is_found() {
        let mut pair = VARIANTS[0].clone();
        pair.drive.poke(0x1C, 11);
        let read = Frame::base(0x201, &[0x3D, 0x1C, 0]);
        pair.frame(&read.expect("a frame"), &mut |_| {});
    }

    #[test]
    fn operations() {
        let operation = |bytes: [u8; 7]| {
            let read = DriveStep::arbitrary(&mut Unstructured::new(&bytes));
            read.expect("seven bytes")
        };
        let read = operation([3, 0x3D, 0x40, 0, 0, 0, 0xC2]);
        assert_eq!(
            read.what,
            DriveOperation::ToDrive([0x3D, 0x40, 0, 0, 0, 7, 8, 9], 3)
        );
        assert_eq!(read.wait, 2);
        let input = operation([0xD3, 1, 0, 0, 0, 0, 0xFF]);
        assert_eq!(
            (input.what, input.wait),
            (DriveOperation::Switch(3, true), 15)
        );
        let time = operation([0xFF, 0, 200, 0, 0, 0, 0]);
        assert_eq!((time.what, time.wait), (DriveOperation::Time(50), 0));
        let foreign = operation([0xB5, 0, 1, 2, 0, 0x80, 0]);
        assert!(matches!(foreign.what, DriveOperation::Elsewhere(id, _, 5) if id.is_extended()));
    }
}
