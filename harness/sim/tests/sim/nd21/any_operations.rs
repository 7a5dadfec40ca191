//! Any bytes on the bus, any inputs and any time: the drive never panics, never leaves its memory map, and
//! its invariants hold after every cycle (they are debug assertions of the model, which these tests run
//! with). A failing list of operations is shrunk to a minimal one.

use harness_proto::line::Received;
use harness_proto::nd21::bits::{flags2, ps_status, scope_status};
use harness_proto::nd21::cells::{CellAccess, RAM, cell_at};
use harness_proto::nd21::errors::ErrorCode;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};
use harness_sim::nd21::{
    BusErrors, Mode, Nd21Drive, Nd21Properties, PsPosition, SRampWire, Stimulus, factory,
    set_parity,
};
use harness_sim::novobus::device::Device;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::cell::RefCell;

/// What can happen to a drive.
#[derive(Clone, Debug)]
enum Operation {
    /// A write to a cell, by its place in the table, so that small cells are met as often as large ones.
    Cell(usize, u16, u8),
    /// A write to any address.
    Byte(u16, u8),
    Bytes(Vec<u8>),
    CheckSequence,
    World(Stimulus),
    /// Time in microseconds.
    Wait(u64),
    PowerFailure,
    Reset,
    /// Everything that keeps it from turning is taken away, for chance hardly ever does so.
    Release,
    /// A job that turns it: what is written to which cell.
    Job(&'static [(u16, u8)]),
}

/// Speed, a target, a referencing run, a relative way.
const JOBS: [&[(u16, u8)]; 4] = [
    &[(ram::SW_VERSION, 0x43), (ram::NSOLL, 0x10)],
    &[
        (ram::SW_VERSION, 0x43),
        (ram::NSOLL, 0),
        (ram::PS_STATUS, 0x01),
        (ram::PS_POSITION_H, 0),
        (ram::FLAGS2, 0x08),
        (ram::PS_STATUS, 0x50),
    ],
    &[(ram::SW_VERSION, 0x43), (ram::FLAGS2, 0x80)],
    &[(ram::SW_VERSION, 0x43), (ram::PS_STATUS, 0x51)],
];

/// Cells that set something going, more often than chance would.
const LIVELY: [u16; 14] = [
    ram::STATUS,
    ram::NSOLL,
    ram::PS_STATUS,
    ram::FLAGS2,
    ram::PS_POSITION_H,
    ram::PS_POSITION_L,
    ram::SCOPE_STATUS,
    ram::EEPROM_CONTROL,
    ram::ERRORCODE,
    ram::HW_VERSION,
    ram::HW_VERSION2,
    ram::SW_VERSION,
    ram::SW_VERSION2,
    ram::D_LAGE,
];

fn stimulus() -> impl Strategy<Value = Stimulus> {
    let input = (0..Input::ALL.len()).prop_map(|i| Input::ALL[i]);
    prop_oneof![
        6 => (input.clone(), any::<bool>()).prop_map(|(input, high)| Stimulus::Input(input, high)),
        1 => (input, -200_000_i64..200_000, 0_i64..100_000)
            .prop_map(|(input, from, length)| Stimulus::Cam(input, from, from + length)),
        1 => any::<i32>().prop_map(Stimulus::Analogue),
        1 => any::<u32>().prop_map(Stimulus::Frequency),
        1 => (-2_000..3_000).prop_map(Stimulus::Cooler),
        1 => any::<u32>().prop_map(Stimulus::MotorSensor),
        1 => (0_u32..1_000).prop_map(Stimulus::Rail),
        1 => any::<bool>().prop_map(Stimulus::Resolver),
        1 => any::<i32>().prop_map(Stimulus::Load),
        1 => any::<bool>().prop_map(Stimulus::Jammed),
        1 => any::<bool>().prop_map(Stimulus::Short),
        1 => (0..ErrorCode::ALL.len()).prop_map(|i| Stimulus::Error(ErrorCode::ALL[i])),
    ]
}

fn operation() -> impl Strategy<Value = Operation> {
    prop_oneof![
        4 => (0..RAM.len(), any::<u16>(), any::<u8>())
            .prop_map(|(cell, offset, byte)| Operation::Cell(cell, offset, byte)),
        6 => (0..LIVELY.len(), 0_u16..2, any::<u8>())
            .prop_map(|(cell, offset, byte)| Operation::Byte(LIVELY[cell] + offset, byte)),
        1 => (any::<u16>(), any::<u8>()).prop_map(|(address, byte)| Operation::Byte(address, byte)),
        5 => Just(Operation::Release),
        5 => (0..JOBS.len()).prop_map(|i| Operation::Job(JOBS[i])),
        1 => prop::collection::vec(any::<u8>(), 1..12).prop_map(Operation::Bytes),
        1 => Just(Operation::CheckSequence),
        6 => stimulus().prop_map(Operation::World),
        6 => (0_u64..200_000).prop_map(Operation::Wait),
        1 => Just(Operation::PowerFailure),
        1 => Just(Operation::Reset),
    ]
}

fn properties() -> impl Strategy<Value = Nd21Properties> {
    any::<[bool; 4]>().prop_map(|[whole, blocking, puffer, quick]| Nd21Properties {
        ps_position: if whole {
            PsPosition::WholeWords
        } else {
            PsPosition::ModeBit
        },
        bus_errors: if blocking {
            BusErrors::Block
        } else {
            BusErrors::TimeOutOnly
        },
        s_ramp_wire: if puffer {
            SRampWire::Puffer
        } else {
            SRampWire::None
        },
        self_test_time: Span::from_millis(if quick { 0 } else { 100 }),
        ps_calculation_time: Span::from_millis(if quick { 0 } else { 10 }),
        ..Nd21Properties::default()
    })
}

/// ND21 14.2.1: a write changes neither a read-only cell nor a read-only bit.
fn write(drive: &mut Nd21Drive, address: u16, byte: u8) {
    let kept = cell_at(address).map_or(0xFF, |cell| match cell.access {
        CellAccess::Read => 0xFF,
        CellAccess::Write | CellAccess::Reserved => cell.read_only_bits,
    });
    let before = drive.program().cells().peek(address);
    drive.program_mut().write(address, byte);
    let after = drive.program().cells().peek(address);
    // AF in errorcode is a command, and so is EEPROMcontrol.
    if ![ram::STATUS, ram::ERRORCODE].contains(&address) || byte != 0xAF {
        assert_eq!(before & kept, after & kept, "{address:04X}");
    }
}

/// How many of the cases had the motor turning, a positioning, a referencing run, a recording.
#[derive(Default)]
struct Seen([u32; 4]);

impl Seen {
    fn look(&mut self, drive: &Nd21Drive) {
        let byte = |address| drive.program().cells().peek(address);
        let phases = ps_status::CONSTANT | ps_status::BRAKING | ps_status::TARGET_BRAKING;
        for (count, seen) in self.0.iter_mut().zip([
            byte(ram::NIST + 1) != 0 && drive.shown().mode == Mode::Go,
            byte(ram::PS_STATUS) & phases != 0 && drive.shown().mode == Mode::Go,
            byte(ram::FLAGS2) & flags2::REFERENCING != 0 && drive.shown().mode == Mode::Go,
            byte(ram::SCOPE_STATUS) & scope_status::STOPPED == 0,
        ]) {
            *count += u32::from(seen);
        }
    }
}

fn play(properties: Nd21Properties, seeded: Option<u8>, operations: &[Operation], seen: &mut Seen) {
    let mut eeprom = seeded.map_or_else(factory::eeprom, |byte| [byte; 256]);
    set_parity(&mut eeprom);
    let mut drive = Nd21Drive::new(Properties::default(), properties, eeprom);
    let mut now = Instant::START;
    for operation in operations {
        match operation {
            Operation::Cell(cell, offset, byte) => {
                let cell = &RAM[*cell];
                write(&mut drive, cell.address + offset % cell.size, *byte);
            }
            Operation::Byte(address, byte) => write(&mut drive, *address, *byte),
            Operation::Bytes(bytes) => {
                for byte in bytes {
                    now += Span::from_micros(287);
                    drive.advance(now);
                    drive.receive(now, Received::good(*byte));
                }
            }
            Operation::CheckSequence => {
                for byte in [0; 17].into_iter().chain(CHECK_SEQUENCE) {
                    now += Span::from_micros(287);
                    drive.advance(now);
                    drive.receive(now, Received::good(byte));
                }
            }
            Operation::World(stimulus) => drive.stimulate(*stimulus),
            Operation::Wait(us) => {
                now += Span::from_micros(*us);
                drive.advance(now);
            }
            Operation::Release => {
                for stimulus in [
                    Stimulus::Rail(560),
                    Stimulus::Resolver(true),
                    Stimulus::Short(false),
                    Stimulus::Cooler(250),
                    Stimulus::Jammed(false),
                    Stimulus::Load(0),
                    Stimulus::Frequency(0),
                    Stimulus::Input(Input::Gpin3, true),
                    Stimulus::Input(Input::Gpin5, true),
                ] {
                    drive.stimulate(stimulus);
                }
                drive.program_mut().write(ram::ERRORCODE, 0xAF);
                drive.program_mut().write(ram::STATUS, 0);
                now += Span::from_millis(1);
                drive.advance(now);
            }
            Operation::Job(writes) => {
                for (address, byte) in *writes {
                    drive.program_mut().write(*address, *byte);
                    now += Span::from_millis(1);
                    drive.advance(now);
                }
            }
            Operation::PowerFailure => drive.power_on(now),
            Operation::Reset => drive.program_mut().reset(),
        }
        for address in 0..=u16::MAX {
            // Every 64th address: reading what is not there is 00, not a panic.
            if address % 64 == 0 {
                drive.program_mut().read(address);
            }
        }
        seen.look(&drive);
    }
}

/// `DRIVEBENCH_SEED` chooses another course.
#[test]
fn any_operations_keep_the_invariants() {
    let seed: u64 = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400);
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    let config = Config {
        cases: 600,
        failure_persistence: None,
        max_shrink_iters: 20_000,
        ..Config::default()
    };
    let mut runner =
        TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &bytes));
    let eeprom = prop_oneof![4 => Just(None), 1 => any::<u8>().prop_map(Some)];
    let operations = prop::collection::vec(operation(), 1..80);
    let seen = RefCell::new(Seen::default());
    let result = runner.run(
        &(properties(), eeprom, operations),
        |(choices, eeprom, list)| {
            play(choices, eeprom, &list, &mut seen.borrow_mut());
            Ok(())
        },
    );
    if let Err(error) = result {
        panic!(
            "{error}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-sim-tests --test sim any_operations"
        );
    }
    let seen = seen.into_inner().0;
    assert!(seen.iter().all(|&count| count > 100), "too tame: {seen:?}");
}
