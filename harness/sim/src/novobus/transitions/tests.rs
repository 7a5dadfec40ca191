//! The matrix: what it says of itself, and the tour through it.

use super::tour::{TourStep, file, stimulus, way};
use super::*;
use crate::novobus::device::Device;
use crate::novobus::plain::PlainDrive;
use crate::novobus::ring::Ring;
use harness_proto::line::Rate;
use harness_proto::nd21;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::Deadline;
use harness_proto::novobus::properties::Properties;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

fn monitored() -> Watched {
    let mut eeprom = [0; 256];
    eeprom[usize::from(nd21::ee::SELFTEST)] = nd21::bits::selftest::MONITORING;
    Watched::new(PlainDrive::new(Properties::default(), eeprom))
}

fn feed(drive: &mut Watched, now: &mut Instant, stimulus: TourStep) {
    *now += Span::from_micros(287);
    match stimulus {
        TourStep::Byte(received) => {
            drive.receive(*now, received);
        }
        TourStep::Silence => {
            if let Some(Deadline::At(at) | Deadline::LineFree(at)) = drive.deadline() {
                *now = at.max(*now);
                drive.handle_deadline(*now);
            }
        }
    }
}

#[test]
fn the_size_is_what_it_was_reviewed_at() {
    let reachable = Transition::reachable().count();
    let size = (State::ALL.len(), Event::ALL.len(), CELLS, reachable);
    assert_eq!(size, (49, 34, 1_666, REACHABLE));
    let names: BTreeSet<_> = State::ALL.iter().map(|state| state.name()).collect();
    assert_eq!(names.len(), State::ALL.len());
    let names: BTreeSet<_> = Event::ALL.iter().map(|event| event.name()).collect();
    assert_eq!(names.len(), Event::ALL.len());
}

/// No reason that is not needed, none without words, and no event with two.
#[test]
fn every_reason_holds_for_something() {
    for rule in &RULES {
        assert!(!rule.reason.is_empty() && !rule.section.is_empty());
        assert!(!rule.only_in.is_empty() && rule.only_in.len() < State::ALL.len());
    }
    let spoken: Vec<_> = RULES.iter().flat_map(|rule| rule.events).collect();
    let once: BTreeSet<_> = spoken.iter().collect();
    assert_eq!(once.len(), spoken.len());
}

/// Each way leads to its state, and each event there is the one that it is called: so what the matrix calls reachable
/// is reached.
#[test]
fn the_tour_reaches_every_reachable_cell() {
    let mut all = Reached::default();
    for cell in Transition::reachable() {
        let mut drive = monitored();
        let mut now = Instant::START;
        for step in way(cell.state) {
            feed(&mut drive, &mut now, step);
        }
        let there = state(drive.drive().bus_end(), drive.drive().memory());
        assert_eq!(there, cell.state, "{cell}");
        let before = drive.reached().clone();
        feed(&mut drive, &mut now, stimulus(cell).expect("a stimulus"));
        assert!(drive.reached().contains(cell), "{cell}");
        drive.reached().assert_possible();
        assert!(drive.reached().count() <= before.count() + 1);
        all.join(drive.reached());
    }
    assert_eq!(all.count(), Transition::reachable().count());
    assert_eq!(all.indices().count(), all.count());
}

/// Each cell has a number of its own, and none is left out; those without time-outs come first.
#[test]
fn the_numbers_of_the_cells() {
    let numbers: BTreeSet<_> = Transition::reachable()
        .filter_map(Transition::number)
        .collect();
    assert!(numbers.into_iter().eq(0..REACHABLE));
    for cell in Transition::reachable() {
        let first = cell
            .number()
            .is_some_and(|number| number < WITHOUT_TIME_OUT);
        assert_eq!(
            first,
            matrix::without_time_out(cell.state, cell.event),
            "{cell}"
        );
    }
    let unreachable = Transition::all().filter(|cell| why_unreachable(*cell).is_some());
    assert!(
        unreachable
            .map(Transition::number)
            .all(|number| number.is_none())
    );
}

/// Reaching a cell that the matrix calls unreachable fails the test.
#[test]
#[should_panic(expected = "called unreachable")]
fn a_wrong_matrix_is_noticed() {
    let mut reached = Reached::default();
    reached.add(Transition {
        state: State::Passing,
        event: Event::OwnAddress,
    });
    reached.assert_possible();
}

/// No sync byte, no address and no silence makes a random run leave the matrix.
#[test]
fn random_runs_stay_within_the_matrix() {
    let likely = [
        0, 0, 0, 0xFF, 0x44, 0x72, 0x4C, 0x41, 0x80, 0x88, 0x85, 0xC0, 0x13, 0xFE, 0xD1, 0xA2,
    ];
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let mut all = Reached::default();
    for _ in 0..2_000 {
        let mut drive = monitored();
        let mut now = Instant::START;
        let begin = State::ALL[(random() % State::ALL.len() as u64) as usize];
        for step in way(begin) {
            feed(&mut drive, &mut now, step);
        }
        for _ in 0..60 {
            let byte = likely[(random() % 16) as usize];
            let stimulus = match random() % 40 {
                0 => TourStep::Silence,
                1 => TourStep::decode(&mut &[0xFF, (random() % 4) as u8, byte][..])
                    .expect("a whole one"),
                _ => TourStep::Byte(harness_proto::line::Received::good(byte)),
            };
            feed(&mut drive, &mut now, stimulus);
        }
        drive.reached().assert_possible();
        all.join(drive.reached());
    }
    assert!(all.count() > 200, "{}", all.count());
}

/// The place in the ring makes no difference: a drive alone with the bytes of its inbound link goes the same way.
#[test]
fn a_drive_knows_its_inbound_link_only() {
    let size = RingSize::new(3).expect("a size");
    let sent: Vec<u8> = State::ALL
        .iter()
        .flat_map(|state| way(*state))
        .filter_map(|step| match step {
            TourStep::Byte(received) => Some(received.byte),
            TourStep::Silence => None,
        })
        .chain(harness_proto::novobus::check_sequence::CHECK_SEQUENCE)
        .chain([0x88, 0xFD, 0xC0, 0x13, 0xFE, 0xD1])
        .collect();
    let mut ring = Ring::new(size, Rate::Baud38400, |_| Watched::<Reached>::default());
    ring.send(Instant::START, &sent);
    ring.run_until(Instant::START + Span::from_millis(2_000));
    for (index, k) in (0..3).rev().enumerate() {
        let mut alone = Watched::<Reached>::default();
        for byte in ring.trace().channels[index].octets() {
            let received = byte.arrival().expect("nothing is lost");
            alone.receive(Instant::START, received);
        }
        let inside = ring.drive(k).expect("a drive");
        assert_eq!(alone.reached(), inside.reached(), "drive {k}");
    }
}

#[test]
fn stimuli_are_read_as_they_are_written() {
    for cell in Transition::reachable() {
        let stimulus = stimulus(cell).expect("a stimulus");
        let mut bytes = Vec::new();
        stimulus.encode(&mut bytes);
        let mut rest = &bytes[..];
        assert_eq!(TourStep::decode(&mut rest), Some(stimulus));
        assert!(rest.is_empty());
    }
}

#[test]
fn no_two_states_share_a_file() {
    let names: BTreeSet<_> = State::ALL.iter().map(|state| file(*state).0).collect();
    assert_eq!(names.len(), State::ALL.len());
}
