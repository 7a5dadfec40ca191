//! Random traffic of two hosts and two drives on a segment with faults: what always holds, and no drive influences another.

use super::common::{Member, property};
use harness_proto::can::{BitRate, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Reply;
use harness_proto::unitek::properties::Properties;
use harness_sim::record::{FrameEnd, LineFrame};
use harness_sim::segment::{FrameFault, Host, Placed, Segment};
use harness_sim::unitek::{Drive, Inputs};
use proptest::prelude::*;

const FIRST: (u16, u16) = (0x201, 0x181);
const SECOND: (u16, u16) = (0x202, 0x182);

/// The host that sends, when, and what.
type Sent = (usize, u64, Frame);

fn frames() -> impl Strategy<Value = Vec<Sent>> {
    let known = vec![
        0x30u8, 0x31, 0x40, 0x51, 0x52, 0x6E, 0x78, 0x90, 0xE2, 0xF4, 0xD0, 0x8F,
    ];
    let register = prop_oneof![5 => prop::sample::select(known), 1 => any::<u8>()]
        // They change the identifiers or the widths, on which the checks below depend.
        .prop_filter("no bus settings", |register| {
            !matches!(register, 0x68 | 0x69 | 0xDC | 0x83)
        });
    let byte = prop_oneof![2 => 0..6u8, 1 => Just(0xFF), 2 => any::<u8>()];
    let request = prop_oneof![
        3 => (register.clone(), byte.clone()).prop_map(|(register, time)| vec![0x3D, register, time]),
        3 => (register, prop::collection::vec(byte, 0..=7)).prop_map(|(register, data)| [vec![register], data].concat()),
    ];
    let id = prop_oneof![5 => Just(FIRST.0), 4 => Just(SECOND.0), 1 => 0x300..0x400u16];
    let frame = (id, request).prop_map(|(id, data)| Frame::base(id, &data).expect("a frame"));
    prop::collection::vec((0..2usize, 0..4_000u64, frame), 0..60).prop_map(|gaps| {
        let mut at = 0;
        gaps.into_iter()
            .map(|(host, gap, frame)| {
                at += gap;
                (host, at, frame)
            })
            .collect()
    })
}

fn faults() -> impl Strategy<Value = Vec<Placed>> {
    let fault = prop_oneof![
        Just(FrameFault::Lost),
        Just(FrameFault::Doubled),
        Just(FrameFault::Corrupt),
        Just(FrameFault::NoAcknowledge),
        (0..5_000u64).prop_map(|micros| FrameFault::Late(Span::from_micros(micros))),
    ];
    let placed = (0..4usize, 1..20u64, fault).prop_map(|(station, frame, fault)| Placed {
        station: Some(station),
        frame,
        fault,
    });
    prop::collection::vec(placed, 0..4)
}

fn drive((rx, tx): (u16, u16)) -> Member {
    let setup = [(0x68, rx.into()), (0x69, tx.into())];
    Member::Drive(Box::new(
        Drive::new(Properties::default(), Inputs::default(), Instant::START).with_setup(&setup),
    ))
}

fn play(drives: &[(u16, u16)], frames: &[Sent], faults: &[Placed]) -> Segment<Member> {
    let mut stations = vec![Member::Host(Host::default()), Member::Host(Host::default())];
    stations.extend(drives.iter().map(|identifiers| drive(*identifiers)));
    let mut segment = Segment::new(BitRate::K500, stations);
    for (host, micros, frame) in frames {
        let Member::Host(host) = segment.station_mut(*host) else {
            panic!("a host")
        };
        host.send(Instant::START + Span::from_micros(*micros), *frame);
    }
    faults.iter().for_each(|fault| segment.inject(*fault));
    let end = frames.last().map_or(0, |(_, at, _)| *at) + 300_000;
    segment.run_until(Instant::START + Span::from_micros(end));
    segment
}

/// Checks the record: times, order, and what the drives send.
fn check(record: &[LineFrame], doubled: bool) -> Result<(), TestCaseError> {
    let mut free = Instant::START;
    for line in record {
        prop_assert!(line.start >= free, "{line:?} begins on a busy bus");
        free = line.at + BitRate::K500.time_of(3);
        let tx = match line.from {
            Some(2) => FIRST.1,
            Some(3) => SECOND.1,
            _ => continue,
        };
        let reply = Reply::decode(&line.frame, tx);
        prop_assert!(reply.is_ok(), "{line:?}");
        if line.ended == FrameEnd::Good {
            // One that is doubled has an error frame (17 bits) in place of its intermission (3).
            let lasts = BitRate::K500.time_of(line.frame.wire_bits() - 3);
            let longer = lasts + BitRate::K500.time_of(17 - 3);
            let passed = line.at.since(line.start);
            prop_assert!(passed == lasts || (doubled && passed == longer), "{line:?}");
        }
    }
    Ok(())
}

/// A drive sends a register only if it was asked for it, or STATUS.
fn only_what_was_asked(record: &[LineFrame], identifiers: (u16, u16)) -> Result<(), TestCaseError> {
    let mut asked = [false; 256];
    asked[0x40] = true;
    for line in record {
        let number = line.frame.id().number();
        if number == u32::from(identifiers.0) {
            if let [0x3D, register, ..] = *line.frame.data() {
                asked[usize::from(register)] = true;
            }
        } else if number == u32::from(identifiers.1) && line.from > Some(1) {
            prop_assert!(asked[usize::from(line.frame.data()[0])], "{line:?}");
        }
    }
    Ok(())
}

#[test]
fn what_always_holds() {
    property(
        "what_always_holds",
        100,
        &(frames(), faults()),
        |(frames, faults)| {
            let mut segment = play(&[FIRST, SECOND], &frames, &faults);
            let doubled = faults
                .iter()
                .any(|placed| placed.fault == FrameFault::Doubled);
            check(segment.record(), doubled)?;
            only_what_was_asked(segment.record(), FIRST)?;
            only_what_was_asked(segment.record(), SECOND)?;
            for place in [2, 3] {
                let Member::Drive(drive) = segment.station_mut(place) else {
                    panic!("a drive")
                };
                prop_assert!(drive.running_cycles().count() <= 8);
                let locked = drive.register(0x51) & 4 != 0;
                prop_assert!(!(locked && drive.register(0x40) & 1 != 0));
                prop_assert_eq!(drive.register(0x40) & 1 != 0, drive.is_enabled());
            }
            // Two runs are one run.
            let again = play(&[FIRST, SECOND], &frames, &faults);
            prop_assert_eq!(segment.record(), again.record());
            Ok(())
        },
    );
}

/// With frames far enough apart for the bus, the first drive sends the same whether the second one is there or not.
#[test]
fn drives_do_not_influence_each_other() {
    let apart = frames().prop_map(|frames| {
        let spaced = frames.into_iter().enumerate();
        // No cycles and events: they could meet on the bus, which moves frames in time.
        spaced
            .filter(|(_, (_, _, frame))| match *frame.data() {
                [0x3D, _, time, ..] => time == 0,
                [0x51, ..] => false,
                _ => true,
            })
            .map(|(place, (_, _, frame))| (0usize, place as u64 * 3_000, frame))
            .collect::<Vec<_>>()
    });
    property("drives_do_not_influence", 100, &apart, |frames| {
        let alone = play(&[FIRST], &frames, &[]);
        let both = play(&[FIRST, SECOND], &frames, &[]);
        let of_first = |segment: &Segment<Member>| -> Vec<(Instant, Frame)> {
            let lines = segment.record().iter().filter(|line| line.from == Some(2));
            lines.map(|line| (line.start, line.frame)).collect()
        };
        prop_assert_eq!(of_first(&alone), of_first(&both));
        Ok(())
    });
}
