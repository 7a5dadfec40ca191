//! `max_speed`: no bytes that pass make a motor turn faster, whatever the drive holds and whatever is at its inputs.

mod attacks;
mod random;

use super::size;
use crate::driver::{OpenRings, Options};
use crate::gate::{GuardsRings as _, guard_rings};
use crate::guard::learn::learn;
use crate::link::BesideTheBus as _;
use crate::link::SimulatedLink;
use harness_bench::guard::Guarded;
use harness_bench::link::{Line, Link, Moment, Octets, PlacedFault};
use harness_proto::line::Rate;
use harness_proto::nd21::bits::status;
use harness_proto::nd21::io::Input;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::units::{SpeedRange, speed_from_raw};
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::Span;
use harness_sim::nd21::{Nd21Drive, Nd21Properties, SRampWire, Stimulus, factory};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::ring::Ring;

const MOST: u16 = 300;
/// What a regulator overshoots, by the parameters of the factory's EEPROM: up to 3.3 % of the speed, and half a bit of a speed, in rpm.
const OVERSHOOT: f64 = 12.0;

fn limits() -> Limits {
    Limits {
        max_speed: Some(MOST),
        ..Limits::unlimited()
    }
}

/// What another program has left in a drive, and what is at its plugs.
#[derive(Clone, Debug)]
struct FoundDrive {
    /// `HwVersion`, `HwVersion2`, `SwVersion`, `SwVersion2`.
    configuration: [u8; 4],
    ref_speeds: [i16; 2],
    vtippen: i16,
    /// Cells of the RAM that it has written.
    cells: Vec<(u16, u16)>,
    data_in: u8,
    analogue: i32,
    inputs: u8,
    /// A byte of the EEPROM.
    stored: Option<(u8, u8)>,
    eeprom_read_time: Span,
}

impl Default for FoundDrive {
    /// As delivered; `nMax` and so `ps_v0` are 3000 rpm, and 10 V are at the analogue input.
    fn default() -> Self {
        Self {
            configuration: [0xC4, 0xFD, 0x43, 0xFF],
            ref_speeds: [7_550, -7_550],
            vtippen: 7_550,
            cells: Vec::new(),
            data_in: 8,
            analogue: 10_000,
            inputs: 0,
            stored: None,
            eeprom_read_time: Span::from_millis(1),
        }
    }
}

const SWITCHES: [Input; 6] = [
    Input::Gpin1,
    Input::Gpin2,
    Input::Gpin4,
    Input::Gpin6,
    Input::Gpin7,
    Input::Gpin8,
];

/// A ring of one that is blocked by its software and released by its inputs, left so by another program, behind a guard that has
/// read what it must know.
fn bench(left: &FoundDrive, limits: Limits) -> Guarded<SimulatedLink> {
    let mut eeprom = factory::eeprom();
    eeprom[0x20..0x24].copy_from_slice(&left.configuration);
    // Blocked after a reset, so that nothing turns before the guard is there.
    let stored = left.configuration[2];
    eeprom[0x22] |= 0x20;
    for (first, speed) in [
        (ee::REF_V1, left.ref_speeds[0]),
        (ee::REF_V2, left.ref_speeds[1]),
        (ee::VTIPPEN, left.vtippen),
    ] {
        let first = usize::from(first);
        eeprom[first..first + 2].copy_from_slice(&speed.to_be_bytes());
    }
    if let Some((place, byte)) = left.stored {
        eeprom[usize::from(place)] = byte;
    }
    harness_sim::nd21::set_parity(&mut eeprom);
    let ring = Ring::new(size(1), Rate::Baud38400, |_| {
        let choices = Nd21Properties {
            s_ramp_wire: SRampWire::Puffer,
            eeprom_read_time: left.eeprom_read_time,
            ..Nd21Properties::default()
        };
        let mut drive = Nd21Drive::new(Properties::default(), choices, eeprom);
        drive.stimulate(Stimulus::Input(Input::Gpin3, true));
        drive.stimulate(Stimulus::Input(Input::Gpin5, true));
        drive.stimulate(Stimulus::Analogue(left.analogue));
        drive.stimulate(Stimulus::Frequency(200_000));
        drive.stimulate(Stimulus::Cam(Input::Gpin4, 20_000, 40_000));
        for (place, input) in SWITCHES.iter().enumerate() {
            if *input != Input::Gpin4 {
                drive.stimulate(Stimulus::Input(*input, left.inputs >> place & 1 != 0));
            }
        }
        Drive::Nd21(drive)
    });
    let mut link = SimulatedLink::new(Bench::one(ring));
    {
        let bus =
            OpenRings::open(Box::new(&mut link), &[size(1)], Options::default()).expect("open");
        let drive = super::axis(0);
        bus.run(Span::from_millis(200));
        for (address, word) in &left.cells {
            bus.write_word(drive, *address, *word).expect("written");
        }
        bus.write_byte(drive, ram::SW_VERSION, stored)
            .expect("written");
        bus.write_byte(drive, ram::DATA_IN, left.data_in)
            .expect("written");
        bus.run(Span::from_millis(5));
        bus.close();
    }
    link.begin();
    let mut line = guard_rings(link, limits);
    line.synchronise();
    line.begin();
    learn(&mut line).expect("learnt");
    line.begin();
    line
}

/// A PLC, where there is one, orders what its mode switches say (13.1.6).
fn order_by_plc(line: &mut Guarded<SimulatedLink>, left: &FoundDrive) {
    if left.inputs == 0 {
        return;
    }
    for high in [false, true] {
        let input = harness_bench::link::AnyStimulus::Novobus(Stimulus::Input(Input::Gpin3, high));
        line.inject(0, PlacedFault::Stimulus(0, input), Moment::Now);
        watch(line, 4);
    }
}

/// The speed of the motor in rpm.
fn speed(line: &Guarded<SimulatedLink>) -> f64 {
    let byte = |address| line.peek(0, 0, address).expect("seen");
    let raw = i16::from_be_bytes([byte(ram::NIST), byte(ram::NIST + 1)]);
    let range = SpeedRange::from_sw_version2(byte(ram::SW_VERSION2));
    speed_from_raw(raw, range).to_f64()
}

/// Lets time pass; the highest speed in it.
fn watch(line: &mut Guarded<SimulatedLink>, millis: u64) -> f64 {
    let mut most = 0.0_f64;
    for _ in 0..millis.div_ceil(2) {
        let until = line.now() + Span::from_millis(2);
        while line.now() < until && line.wait(until) {}
        most = most.max(speed(line).abs());
        while line.receive(0).is_some() {}
    }
    most
}

/// A command with its checking byte in a telegram to the drive of a ring of one.
fn telegram(command: &[u8]) -> Vec<u8> {
    let sum = command
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    let length = command.len() as u8 + 1;
    [&[0x80 | length << 1, 0xFF], command, &[sum.max(1)]].concat()
}

fn word(address: u16, data: u16) -> Vec<u8> {
    let ([high, low], [upper, lower]) = (address.to_be_bytes(), data.to_be_bytes());
    telegram(&[0x63, lower, upper, low, high])
}

fn byte(address: u16, data: u8) -> Vec<u8> {
    let [high, low] = address.to_be_bytes();
    telegram(&[0x82, data, low, high])
}

fn or(address: u16, mask: u8) -> Vec<u8> {
    telegram(&[0xA5, mask, address.to_be_bytes()[1]])
}

fn and(address: u16, mask: u8) -> Vec<u8> {
    telegram(&[0xA4, mask, address.to_be_bytes()[1]])
}

const GO: u8 = !(status::BLOCK | status::STOP);

/// Sends telegrams until one is denied; which one, and the fastest that the motor turned.
fn play(
    line: &mut Guarded<SimulatedLink>,
    left: &FoundDrive,
    telegrams: &[Vec<u8>],
) -> (Option<usize>, f64) {
    let mut most = 0.0_f64;
    for (place, bytes) in telegrams.iter().enumerate() {
        order_by_plc(line, left);
        line.send_octets(0, bytes);
        most = most.max(watch(line, 10));
        if line.trouble().is_some() {
            return (Some(place), most.max(watch(line, 400)));
        }
    }
    (None, most.max(watch(line, 400)))
}

/// What the limit allows works: the whole of the driver's functions at speeds within it, counted in the drive's range.
#[test]
fn motion_within_the_limit_passes() {
    let left = FoundDrive {
        ref_speeds: [700, -100],
        ..FoundDrive::default()
    };
    let mut line = bench(&left, limits());
    {
        let bus =
            OpenRings::open(Box::new(&mut line), &[size(1)], Options::default()).expect("open");
        let drive = super::axis(0);
        let within = 1_132;
        bus.write_word(drive, ram::NSOLL, 0).expect("0 rpm");
        bus.delete_error(drive).expect("confirmed");
        bus.go(drive).expect("gone");
        bus.write_word(drive, ram::PS_V0, within).expect("ps_v0");
        bus.reference(drive).expect("referenced");
        bus.write_word(drive, ram::NSOLL, within).expect("300 rpm");
        bus.run(Span::from_millis(300));
        bus.write_word(drive, ram::NSOLL, 0).expect("0 rpm");
        bus.run(Span::from_millis(300));
        let way = Position::new(PositionMode::Relative, 65_536).expect("a way");
        bus.write_ps(drive, way).expect("calculated");
        bus.start_ps(drive).expect("started");
        bus.wait_for_end(drive).expect("there");
        bus.write_word(drive, ram::N_MAX, within).expect("nMax");
    }
    assert_eq!(line.trouble(), None);
}

/// Counted in the drive's own range where it was read; else in the one in which a bit is worth most, which the refusal says.
#[test]
fn the_range_of_speeds() {
    for (second, most, text) in [
        (0xFF, 1_132, "0.2649 rpm in the drive's range to 8000 rpm"),
        (0x7F, 566, "0.5298 rpm in the drive's range to 12000 rpm"),
    ] {
        let left = FoundDrive {
            configuration: [0xC4, 0xFF, 0x43, second],
            ..FoundDrive::default()
        };
        for sign in [1, -1_i16] {
            let raw = |raw: i16| (sign * raw).cast_unsigned();
            let mut line = bench(&left, limits());
            assert_eq!(
                play(&mut line, &left, &[word(ram::NSOLL, raw(most))]).0,
                None
            );
            assert_eq!(
                play(&mut line, &left, &[word(ram::NSOLL, raw(most + 1))]).0,
                Some(0)
            );
            let why = line.trouble().expect("denied").to_string();
            assert!(why.contains(text) && why.contains("(nsoll)"), "{why}");
        }
    }
    let mut line = guard_rings(super::link(1), limits());
    line.synchronise();
    line.send_octets(0, &word(ram::NSOLL, 567));
    let why = line.trouble().expect("denied").to_string();
    assert!(why.contains("range is not known"), "{why}");
}

/// A reset forgets what was read of the RAM and keeps the range; a doubt forgets what was written.
#[test]
fn what_is_forgotten() {
    let known = |line: &mut Guarded<SimulatedLink>, bytes: &[u8]| {
        line.send_octets(0, bytes);
        line.trouble().is_none()
    };
    let run = or(ram::FLAGS2, 0x08);
    let mut line = bench(&FoundDrive::default(), limits());
    assert!(known(&mut line, &word(ram::PS_V0, 100)) && known(&mut line, &run));
    line.synchronise();
    assert!(
        !known(&mut line, &run),
        "what was written before a recovery"
    );
    let slow = FoundDrive {
        cells: vec![(ram::PS_V0, 100)],
        ..FoundDrive::default()
    };
    let mut line = bench(&slow, limits());
    line.synchronise();
    assert!(known(&mut line, &run), "what was read");
    assert!(known(&mut line, &telegram(&[0xDD, 0x21])));
    line.synchronise();
    assert!(
        known(&mut line, &and(ram::STATUS, GO)),
        "nsoll is 0 behind a reset"
    );
    assert!(known(&mut line, &word(ram::NSOLL, 1_132)), "the range");
    assert!(!known(&mut line, &run), "ps_v0 is nMax behind a reset");
}

/// ND21 14.10.5.2: a read of the EEPROM that is under way puts its byte over the address that was written meanwhile, so that the next
/// write goes to the cell of this number. Once `EEPROMcontrol` was read with bit 5 set, the address stays.
#[test]
fn a_read_that_is_under_way_changes_what_is_written() {
    const SW_VERSION: u8 = 0x22;
    let left = FoundDrive {
        stored: Some((0x60, SW_VERSION)),
        eeprom_read_time: Span::from_millis(30),
        ..FoundDrive::default()
    };
    let poll = telegram(&[0xC0, 0x8A, 0xFD]);
    let address = || byte(ram::EEPROM_BUFFER, 0x60);
    let read = || byte(ram::EEPROM_CONTROL, 0x81);
    let write = || {
        [
            byte(ram::EEPROM_BUFFER + 1, 0x40),
            byte(ram::EEPROM_CONTROL, 0x82),
        ]
    };
    // 10 ms each, as after every telegram.
    let wait = || vec![Vec::new(); 5];
    let attack = |polls: Vec<Vec<u8>>, limits| {
        let mut line = bench(&left, limits);
        let begin = vec![address(), read()];
        let sent = [begin, polls, vec![address()], wait(), write().into()].concat();
        let denied = play(&mut line, &left, &sent).0;
        let last = denied.map(|place| place + 1 == sent.len());
        line.reset_after_denial();
        line.synchronise();
        let bus =
            OpenRings::open(Box::new(&mut line), &[size(1)], Options::default()).expect("open");
        let stored = bus.read_eeprom(super::axis(0), SW_VERSION);
        (last, stored.expect("read"))
    };
    // As `bench` stores it.
    let stored = left.configuration[2] | 0x20;
    let denied = (Some(true), stored);
    assert_eq!(attack(vec![], limits()), denied);
    let unlimited = attack(vec![], Limits::unlimited());
    assert_eq!(unlimited, (None, 0x40), "it is an attack");
    assert_eq!(attack(vec![poll.clone()], limits()), denied, "not read yet");
    let has_read = attack([wait(), vec![poll.clone()]].concat(), limits());
    assert_eq!(has_read, (None, stored));
    let again = [wait(), vec![[poll, read()].concat()]].concat();
    assert_eq!(attack(again, limits()), denied, "of the read before");
    let alike = telegram(&[0xC0, 0x8A, 0xFF]);
    let other = [wait(), vec![alike]].concat();
    assert_eq!(attack(other, limits()), denied, "of another cell"); // To an address that no drive has; it comes back as it was sent.
    let forged = vec![vec![0x88, 0x00, 0xC0, 0x8A, 0x20, 0x96]];
    assert_eq!(attack(forged, limits()), denied, "of nobody");
    // An answer from before the read, with check sequences around.
    let poll = telegram(&[0xC0, 0x8A, 0xFD]);
    let sequences = [
        &CHECK_SEQUENCE[..17],
        &[0x80],
        &CHECK_SEQUENCE[17..],
        &CHECK_SEQUENCE,
        &poll,
        &read(),
        &CHECK_SEQUENCE,
    ];
    let stale = [wait(), vec![sequences.concat()]].concat();
    assert_eq!(attack(stale, limits()), denied, "before check sequences");
}

/// ND21 14.10.3: process data are written where `DataIn` points, which may be an output (`AnOut`) or the switch of the monitoring (`Flags2`).
#[test]
fn process_data_go_where_they_may() {
    const AN_OUT: u8 = 0x7C;
    let motion = Limits {
        motion: true,
        ..Limits::default()
    };
    let outputs = Limits {
        outputs: true,
        ..motion
    };
    let data = || vec![0x85, 0xFF, 0x00, 0x40];
    let denied = |data_in, limits, sent: &[Vec<u8>]| {
        let left = FoundDrive {
            data_in,
            ..FoundDrive::default()
        };
        let mut line = bench(&left, limits);
        let denied = play(&mut line, &left, sent).0;
        if denied.is_some() {
            let why = line.trouble().expect("denied").to_string();
            assert!(why.contains("write 08 to DataIn first"), "{why}");
        }
        denied
    };
    let nsoll = byte(ram::DATA_IN, 8);
    assert_eq!(denied(AN_OUT, motion, &[data()]), Some(0));
    assert_eq!(denied(AN_OUT, motion, &[nsoll, data()]), None);
    assert_eq!(denied(AN_OUT, outputs, &[data()]), None);
    assert_eq!(denied(0x57, outputs, &[data()]), Some(0), "Flags2");
    assert_eq!(denied(0x08, motion, &[data()]), None);
    // What was read of it does not hold after a reset.
    let resets = Limits {
        reset: true,
        ..motion
    };
    let left = FoundDrive::default();
    let mut line = bench(&left, resets);
    assert_eq!(play(&mut line, &left, &[telegram(&[0xDD, 0x21])]).0, None);
    line.synchronise();
    assert_eq!(play(&mut line, &left, &[data()]).0, Some(0));
    // Until it is read again.
    line.reset_after_denial();
    line.synchronise();
    line.begin();
    let read = telegram(&[0xC0, 0x32, 0xFF]);
    assert_eq!(play(&mut line, &left, &[read, data()]).0, None);
}
