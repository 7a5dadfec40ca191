//! What a master sends, read back with the codec alone (ND21 9.1-9.5, 10); its jobs in their two orders;
//! and what it calls a fault.

use super::diagnosis::{DisturbanceSign, Evidence, Spelled};
use super::in_flight::{ByteInFlight, ComposedByte};
use super::store::Store;
use super::*;
use crate::novobus::address::passed_on;
use crate::novobus::command::Command;
use crate::novobus::decode::Decoded;
use crate::novobus::properties::ReadLongAnswer;
use crate::novobus::telegram::{Address, Telegram};
use alloc::vec;
use proptest::prelude::*;
use std::collections::BTreeMap;

fn size(drives: u8) -> RingSize {
    RingSize::new(u64::from(drives)).expect("1 to 250")
}

/// A master that has counted its drives and may send long without an answer.
fn ready(drives: u8, packing: Packing) -> Master {
    let options = MasterOptions {
        packing,
        slack: Span::from_millis(60_000),
        ..MasterOptions::default()
    };
    let mut master = Master::new(size(drives), Rate::Baud38400, options);
    let start: Vec<u8> = (0..4)
        .filter_map(|_| master.poll_transmit(Instant::START))
        .collect();
    // Address byte 00: no drive is meant, and it comes back as the number of drives (9.3).
    assert_eq!(start, [0x82, 0x00, 0x80, 0x80]);
    for byte in [0x82, drives, 0x80] {
        assert_eq!(master.phase(), Phase::Counting);
        master.handle_byte(Instant::START, Received::good(byte));
    }
    assert_eq!(master.phase(), Phase::Running);
    assert_eq!(master.poll_event(), Some(Event::Ready));
    assert_eq!(master.poll_event(), None);
    master
}

/// What the drives of a ring receive: the parameter bytes of each, and the process data.
#[derive(Default)]
struct Told {
    parameters: BTreeMap<u8, Vec<u8>>,
    process_data: Vec<(u8, u16)>,
}

/// Reads a stream as drives do: every one keeps its sum, and is meant where that is 0 (9.2, 9.3).
fn told(drives: u8, mut bytes: &[u8]) -> Told {
    let mut told = Told::default();
    // The sums of drive 0, 1 ...; none is known at first.
    let mut sums: Option<Vec<u8>> = None;
    while let Some(&first) = bytes.first() {
        if first == SYNCO {
            bytes = &bytes[1..];
            continue;
        }
        let (value, used) = match Telegram::decode(bytes) {
            Decoded::Value { value, used } => (value, used),
            // Looked at no longer.
            Decoded::NeedMore => break,
            Decoded::Bad { .. } => panic!("{bytes:02X?}"),
        };
        bytes = &bytes[used..];
        match (value.address(), &mut sums) {
            (Address::Byte(byte), _) => {
                let passed = |k| (k..drives).fold(byte, |sum, _| passed_on(sum));
                sums = Some((0..drives).map(passed).collect());
            }
            (Address::SameDrive, Some(_)) => {}
            (Address::NextDrive, Some(sums)) => {
                for sum in sums {
                    *sum = passed_on(*sum);
                }
            }
            (_, None) => panic!("a short address before any other"),
        }
        let sums = sums.as_deref().unwrap_or_default();
        let meant = sums.iter().position(|sum| *sum == 0).expect("a drive");
        let drive = u8::try_from(meant).expect("a drive");
        told.process_data
            .extend(value.process_data().map(|data| (drive, data)));
        let parameters = told.parameters.entry(drive).or_default();
        parameters.extend(value.parameters());
    }
    told
}

fn commands(mut bytes: &[u8]) -> Vec<Command> {
    let mut commands = Vec::new();
    while !bytes.is_empty() {
        let Decoded::Value { value, used } = Command::decode(bytes) else {
            panic!("{bytes:02X?}");
        };
        commands.push(value);
        bytes = &bytes[used..];
    }
    commands
}

fn any_command() -> impl Strategy<Value = Command> {
    let cell = 0xFD80u16..0xFF7C;
    prop_oneof![
        cell.clone()
            .prop_map(|address| Command::ReadByte { address }),
        cell.clone()
            .prop_map(|address| Command::ReadWord { address }),
        cell.clone()
            .prop_map(|address| Command::ReadLong { address }),
        (cell.clone(), any::<u8>())
            .prop_map(|(address, data)| Command::WriteByte { address, data }),
        (cell, any::<u16>()).prop_map(|(address, data)| Command::WriteWord { address, data }),
        (0u8..0x80, any::<u8>()).prop_map(|(address_low, data)| Command::And { address_low, data }),
        Just(Command::ResetH8),
    ]
}

fn any_packing() -> impl Strategy<Value = Packing> {
    any::<[bool; 4]>().prop_map(|[same, next, share, cut]| Packing {
        same,
        next,
        share,
        cut,
    })
}

proptest! {
    /// Every drive receives its commands in the order in which they were submitted, with any packing.
    #[test]
    fn every_drive_is_told_its_commands_in_order(
        drives in 1u8..=10,
        packing in any_packing(),
        jobs in prop::collection::vec((any::<u8>(), any_command()), 0..30),
        exchange in prop::collection::vec(any::<u8>(), 0..6),
    ) {
        let mut master = ready(drives, packing);
        let mut expected: BTreeMap<u8, Vec<Command>> = BTreeMap::new();
        for (drive, command) in jobs {
            let drive = drive % drives;
            master.submit(Job::new(drive, command)).expect("a job that can be done");
            expected.entry(drive).or_default().push(command);
        }
        let exchange: Vec<u8> = exchange.iter().map(|k| k % drives).collect();
        for &k in &exchange {
            master.set_nominal(k, 0xA500 | u16::from(k)).expect("a drive");
        }
        master.set_exchange(&exchange, CyclePace::OnRequest).expect("drives");
        for _ in 0..200 {
            master.start_round();
        }
        let bytes: Vec<u8> = (0..4000)
            .filter_map(|_| master.poll_transmit(Instant::START))
            .collect();
        let told = told(drives, &bytes);
        for (drive, parameters) in told.parameters {
            let expected = expected.remove(&drive).unwrap_or_default();
            prop_assert_eq!(commands(&parameters), expected, "drive {}", drive);
        }
        prop_assert!(expected.is_empty());
        // Rounds are whole, in ascending order, with the values that were set.
        let mut round = exchange;
        round.sort_unstable();
        round.dedup();
        let values: Vec<_> = round.iter().map(|k| (*k, 0xA500 | u16::from(*k))).collect();
        for (given, expected) in told.process_data.iter().zip(values.iter().cycle()) {
            prop_assert_eq!(given, expected);
        }
        prop_assert!(round.is_empty() || told.process_data.len() >= round.len());
    }

    /// Packing saves bytes and never costs any.
    #[test]
    fn packing_costs_nothing(
        drives in 1u8..=20,
        packing in any_packing(),
        jobs in prop::collection::vec((any::<u8>(), any_command()), 1..60),
    ) {
        let length = |packing| {
            let mut master = ready(drives, packing);
            for (drive, command) in &jobs {
                let job = Job::new(drive % drives, *command);
                master.submit(job).expect("a job that can be done");
            }
            let sent = (0..1000).filter_map(|_| master.poll_transmit(Instant::START));
            assert_eq!(sent.count(), 1000);
            master.counters().sent - master.counters().idle
        };
        prop_assert!(length(packing) <= length(Packing::NONE));
        prop_assert!(length(Packing::ALL) <= length(packing));
    }
}

/// Both orders of the store, through removal in the middle and a restart.
#[test]
fn the_store_keeps_both_orders() {
    let mut store = Store::new(size(3), 6);
    let read = Command::ReadByte { address: 0xFE00 };
    let ids: Vec<JobId> = [0, 1, 0, 2, 1, 0]
        .iter()
        .filter_map(|drive| store.add(&Job::new(*drive, read), ReadLongAnswer::FourData))
        .collect();
    assert_eq!(ids.len(), 6);
    let another = Job::new(1, read);
    assert_eq!(store.add(&another, ReadLongAnswer::FourData), None);
    let order = |store: &Store| {
        let mut order = Vec::new();
        let mut next = store.first();
        while let Some(entry) = next.and_then(|slot| store.get(slot)) {
            order.push(entry.id.number());
            next = entry.behind();
        }
        order
    };
    let of = |store: &Store, drive| {
        let mut order = Vec::new();
        let mut next = store.first_of(drive);
        while let Some(entry) = next.and_then(|slot| store.get(slot)) {
            order.push(entry.id.number());
            next = entry.behind_in_drive();
        }
        order
    };
    let first_of_1 = store.first_of(1).expect("a job");
    while store
        .get_mut(first_of_1)
        .and_then(|e| e.compose())
        .is_some()
    {}
    store.unlink(first_of_1);
    assert_eq!(order(&store), [0, 2, 3, 4, 5]);
    assert_eq!(of(&store, 1), [4]);
    // It has been sent, and is sent again; drive 2's is given up.
    assert_eq!(store.restart(|job| job.drive != 2), 1);
    assert_eq!(order(&store), [0, 1, 2, 4, 5]);
    assert_eq!(of(&store, 0), [0, 2, 5]);
    assert_eq!(of(&store, 1), [1, 4]);
    assert_eq!(of(&store, 2), []);
    assert_eq!(store.len(), 5);
}

/// ND21 9.7: at most 25 zeros, then the address; more zeros are the address of drive 0.
#[test]
fn an_address_is_believed_when_it_stays() {
    let sent = ByteInFlight {
        composed: ComposedByte::SYNCO,
        due: Instant::START,
    };
    let settled = |bytes: &[u8]| {
        let mut evidence = Evidence::new(DisturbanceSign::Wrong(sent), [].into_iter());
        let mut settled = None;
        for byte in bytes {
            evidence.see(Received::good(*byte));
            settled = settled.or_else(|| evidence.settled(size(200)));
        }
        settled
    };
    let zeros_and = |zeros: usize, byte: u8, times| [vec![0; zeros], vec![byte; times]].concat();
    assert_eq!(settled(&zeros_and(25, 7, 8)), None);
    assert_eq!(settled(&zeros_and(25, 7, 10)), Some(Spelled::Address(7)));
    assert_eq!(settled(&[0; 34]), None);
    assert_eq!(settled(&[0; 35]), Some(Spelled::Address(0)));
    assert_eq!(settled(&zeros_and(20, 3, 6)), None, "too short");
    // 80 is SYNCO, and the address of drive 128: before that come zeros.
    assert_eq!(
        settled(&zeros_and(20, 128, 30)),
        Some(Spelled::Address(128))
    );
    assert_eq!(settled(&zeros_and(1, 128, 40)), Some(Spelled::Sound));
    assert_eq!(settled(&zeros_and(20, 250, 40)), None, "no drive");
}

/// ND21 9.7, 9.9: a byte that was missed and comes after all was late. What a drive spells out behind it is a damaged byte and no silence.
#[test]
fn a_late_byte_is_no_silence() {
    let sent = ByteInFlight {
        composed: ComposedByte::SYNCO,
        due: Instant::START,
    };
    let link = RingLink::into(size(3), 1);
    for (before, fault) in [
        (&[0x80, 0x80][..], Fault::Damaged(link)),
        (&[][..], Fault::Broken(link)),
    ] {
        let mut evidence = Evidence::new(DisturbanceSign::Missed(sent), [].into_iter());
        for byte in [before, &[0; 25], &[1; 10]].concat() {
            evidence.see(Received::good(byte));
        }
        let spelled = evidence.settled(size(3)).expect("an address");
        assert_eq!(evidence.name(size(3), spelled, true, None), fault);
    }
}

/// Nothing is sent to a ring that does not answer, once all that may be is under way.
#[test]
fn what_is_under_way_is_bounded() {
    let mut master = Master::new(size(5), Rate::Baud38400, MasterOptions::default());
    let sent = (0..1000)
        .filter_map(|_| master.poll_transmit(Instant::START))
        .count();
    assert_eq!(sent, master.under_way());
    // 6 byte times for the ring, and 20 ms of slack.
    assert_eq!(sent, 6 + 69 + 2);
}
