//! The wrapper around a deviant drive: without a deviation it changes nothing, and no deviation hangs.

use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::Place;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::properties::Properties;
use harness_proto::novobus::telegram::{Address, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::nd21::{Nd21Drive, Nd21Properties, factory};
use harness_sim::novobus::deviation::{DEVIATIONS, Deviant, Deviation, deviation};
use harness_sim::novobus::device::Device;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;
use harness_sim::record::{Channel, Trace};
use proptest::prelude::*;

const DRIVES: u8 = 3;

/// A piece of what a master sends.
#[derive(Clone, Debug)]
enum Piece {
    /// A command to a drive.
    Command(u8, Command),
    /// The check sequence.
    Sequence,
    /// Anything.
    Bytes(Vec<u8>),
    /// Silence for this number of ms.
    Silence(u64),
}

fn piece() -> impl Strategy<Value = Piece> {
    let command = prop_oneof![
        any::<u16>().prop_map(|address| Command::ReadByte { address }),
        (0xFD80..=0xFF7E_u16).prop_map(|address| Command::ReadWord { address }),
        (0xFF00..=0xFF7F_u16, any::<u8>())
            .prop_map(|(address, data)| Command::WriteByte { address, data }),
        Just(Command::ResetH8),
    ];
    prop_oneof![
        4 => (0..DRIVES, command).prop_map(|(drive, command)| Piece::Command(drive, command)),
        1 => Just(Piece::Sequence),
        1 => proptest::collection::vec(any::<u8>(), 0..12).prop_map(Piece::Bytes),
        1 => (0..40_u64).prop_map(Piece::Silence),
    ]
}

fn drive(nd21: bool) -> Drive {
    let properties = Properties::default();
    if nd21 {
        let mut eeprom = factory::eeprom();
        eeprom[0x47] |= 0x80;
        Drive::Nd21(Nd21Drive::new(
            properties,
            Nd21Properties::default(),
            eeprom,
        ))
    } else {
        let mut eeprom = [0; 256];
        eeprom[0x47] = 0x80;
        Drive::Plain(PlainDrive::new(properties, eeprom))
    }
}

fn wrong(nd21: bool, with: &[&'static Deviation]) -> Drive {
    Drive::Deviant(Box::new(Deviant::new(drive(nd21), with.to_vec())))
}

/// What the ring carries and remarks when all that is sent.
fn play(pieces: &[Piece], flip: Option<u64>, device: impl Fn() -> Drive) -> Trace {
    let size = RingSize::new(u64::from(DRIVES)).expect("1 to 250");
    let mut ring = Ring::new(size, Rate::Baud38400, |_| device());
    if let Some(byte) = flip {
        let flips = Flips {
            data: 1,
            ..Flips::default()
        };
        ring.arm_link(1, byte, LinkFault::Flip(flips));
    }
    for piece in pieces {
        let start = ring.now();
        let bytes = match piece {
            Piece::Command(drive, command) => {
                let address = Address::Byte(size.address_byte(*drive).expect("a drive"));
                let telegram = Telegram::new(address, None, &command.encode());
                telegram.expect("at most 7 net bytes").encode()
            }
            Piece::Sequence => CHECK_SEQUENCE.to_vec(),
            Piece::Bytes(bytes) => bytes.clone(),
            Piece::Silence(ms) => {
                ring.run_until(start + Span::from_millis(*ms));
                continue;
            }
        };
        ring.send(start, &bytes);
        ring.run_until(start + ring.byte_time() * (bytes.len() as u64 + 4));
    }
    ring.trace()
}

fn carried(trace: &Trace) -> Vec<&[harness_sim::record::LineByte]> {
    trace.channels.iter().map(Channel::octets).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// The same bytes at the same times on every link, and the same marks.
    #[test]
    fn without_a_deviation_nothing_changes(
        pieces in proptest::collection::vec(piece(), 1..12),
        flip in proptest::option::of(1..60_u64),
        nd21 in any::<bool>(),
    ) {
        let plain = play(&pieces, flip, || drive(nd21));
        let wrapped = play(&pieces, flip, || wrong(nd21, &[]));
        prop_assert_eq!(carried(&plain), carried(&wrapped));
        prop_assert_eq!(&plain.remarks, &wrapped.remarks);
    }

    /// Every deviation, and every two of them, come to an end with every input: nothing panics, nothing hangs,
    /// and no drive sends more than its line carries.
    #[test]
    fn deviations_end(
        pieces in proptest::collection::vec(piece(), 1..12),
        flip in proptest::option::of(1..60_u64),
        first in any::<proptest::sample::Index>(),
        second in any::<proptest::sample::Index>(),
    ) {
        let all: Vec<_> = DEVIATIONS.all().collect();
        let with = [*first.get(&all), *second.get(&all)];
        let trace = play(&pieces, flip, || wrong(true, &with));
        for link in &trace.channels {
            prop_assert!(link.octets().windows(2).all(|two| two[0].at < two[1].at));
        }
    }
}

#[test]
fn power_restores_the_drive_and_not_its_manners() {
    let twice = deviation("increments-twice").expect("a deviation");
    let Drive::Deviant(mut drive) = wrong(false, &[twice]) else {
        unreachable!("it was made so");
    };
    let now = Instant::START;
    let address = |drive: &mut Deviant| {
        drive.receive(now, Received::good(0x88));
        drive.receive(now, Received::good(0x10)).byte
    };
    assert_eq!(address(&mut drive), Some(0x12));
    drive.power_on(now);
    assert_eq!(address(&mut drive), Some(0x12));
}

/// ND21 9.7: the numbers of the error mode are kept over a reset of the drive's processor, too.
#[test]
fn a_reset_keeps_the_deviation() {
    let sixteen = deviation("sends-16-zeros").expect("a deviation");
    let Drive::Deviant(mut drive) = wrong(false, &[sixteen]) else {
        unreachable!("it was made so");
    };
    let mut now = Instant::START;
    let mut say = |bytes: &[u8]| -> Vec<u8> {
        let answer = |&byte| {
            now += Span::from_micros(287);
            drive.receive(now, Received::good(byte)).byte
        };
        bytes.iter().filter_map(answer).collect()
    };
    say(&[0x86, 0xFF, 0xDD, 0x21, 0xFE]);
    let zeros = say(&[0; 20]);
    assert_eq!(zeros.iter().position(|&byte| byte != 0), Some(16));
}

/// What the table looks at: the place of the next byte, as the bus end itself sees it.
#[test]
fn places_follow_the_telegram() {
    use harness_proto::novobus::bus_end::BusEnd;
    let Drive::Plain(sound) = drive(false) else {
        unreachable!("it was made so");
    };
    let (mut end, mut memory): (BusEnd, _) = (sound.bus_end().clone(), sound.memory().clone());
    let mut places = Vec::new();
    // 8D: an address, two bytes of process data, four of the parameter channel.
    for byte in [0x8D, 0xFF, 0x12, 0x34, 0xC0, 0x13, 0xFE, 0xD1] {
        places.push(end.place());
        end.receive(Instant::START, Received::good(byte), &mut memory);
    }
    assert!(matches!(
        places[..],
        [
            Place::Sync,
            Place::Address,
            Place::ProcessHigh,
            Place::ProcessLow,
            Place::Command,
            Place::Parameter(_),
            Place::Parameter(_),
            Place::Parameter(_)
        ]
    ));
    assert_eq!(end.place(), Place::Sync);
}
