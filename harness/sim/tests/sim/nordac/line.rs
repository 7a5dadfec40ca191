//! The shared line: faults, collisions, records, and the independence of how time is cut.

use super::common::{Desk, octets, setup};
use harness_proto::line::LineError;
use harness_proto::profibus::BusRate;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::octet_segment::{
    LineFault, LineFaultAt, LineHost, Octet, OctetSegment, TelegramFault, Wish,
};
use harness_sim::record::LineByte;

const STATUS: &str = "10 08 02 49 53 16";
const REPLY: &str = "10 02 08 00 0A 16";

/// Places a fault at an octet or telegram of a station of a desk, asks for the FDL status, and gives what comes.
fn faulty(station: usize, number: u64, fault: LineFault) -> (String, Desk) {
    let mut desk = Desk::standard();
    desk.line.inject(LineFaultAt {
        station: Some(station),
        number,
        fault,
    });
    let heard = desk.ask(STATUS);
    assert_eq!(desk.line.unused_faults(), []);
    (heard, desk)
}

fn flip(data: u8) -> LinkFault {
    LinkFault::Flip(Flips {
        data,
        ..Flips::default()
    })
}

/// No fault in one octet of a request is answered, except those that leave it whole.
#[test]
fn faults_in_a_request() {
    let parity = Flips {
        parity: true,
        ..Flips::default()
    };
    let stop = Flips {
        stop: true,
        ..Flips::default()
    };
    for octet in 1..=6 {
        for fault in [
            flip(1),
            LinkFault::Flip(parity),
            LinkFault::Flip(stop),
            LinkFault::Replace(0xAA),
            LinkFault::Drop,
            LinkFault::Insert(0x10),
            LinkFault::Break(Span::from_millis(1)),
            LinkFault::Overrun,
            LinkFault::Cut,
        ] {
            let (heard, mut desk) = faulty(0, octet, LineFault::Octet(fault));
            assert_eq!(heard, "", "{fault} at octet {octet}");
            desk.line.unplug(0, false);
            assert_eq!(desk.ask(STATUS), REPLY, "{fault} at octet {octet}");
        }
    }
    // A delay is a gap, except in front of the first octet.
    let late = LineFault::Octet(LinkFault::Delay(Span::from_micros(20)));
    assert_eq!(faulty(0, 1, late).0, REPLY);
    assert_eq!(faulty(0, 2, late).0, "");
    // With an octet right after it a telegram is longer than it announces.
    assert_eq!(faulty(0, 6, LineFault::Octet(LinkFault::Duplicate)).0, "");
    let (heard, _) = faulty(0, 3, LineFault::Octet(flip(3)));
    assert_eq!(
        heard, "",
        "two flips of one octet leave the parity right, and FCS wrong"
    );
}

#[test]
fn faults_in_a_reply() {
    for (fault, heard) in [
        (flip(1), "10 02 09! 00 0A 16"),
        (LinkFault::Replace(0x7F), "10 02 7F 00 0A 16"),
        (LinkFault::Drop, "10 02 00 0A 16"),
        (LinkFault::Duplicate, "10 02 08 08 00 0A 16"),
        (LinkFault::Insert(0x55), "10 02 55 08 00 0A 16"),
        (LinkFault::Delay(Span::from_millis(1)), REPLY),
        (LinkFault::Overrun, "10 02 08! 00 0A 16"),
        (LinkFault::Cut, "10 02"),
        (LinkFault::Break(Span::from_micros(50)), "10 02 00! 16"),
    ] {
        assert_eq!(faulty(1, 3, LineFault::Octet(fault)).0, heard, "{fault}");
    }
}

#[test]
fn faults_of_telegrams() {
    let late = TelegramFault::Late(Span::from_millis(1));
    for (fault, heard) in [
        (TelegramFault::Lost, String::new()),
        (TelegramFault::Doubled, format!("{REPLY} {REPLY}")),
        (late, REPLY.to_owned()),
        (TelegramFault::Former, String::new()),
    ] {
        assert_eq!(faulty(1, 1, LineFault::Telegram(fault)).0, heard, "{fault}");
    }
    let (_, desk) = faulty(1, 1, LineFault::Telegram(late));
    let asked = desk.line.record(0)[5].at;
    let begun = desk.line.record(1)[0].at - desk.rate.octet_time();
    assert_eq!(
        begun.since(asked),
        Span::from_millis(1) + desk.rate.bit_time() * 11
    );

    let mut desk = Desk::standard();
    desk.line.inject(LineFaultAt {
        station: None,
        number: 4,
        fault: LineFault::Telegram(TelegramFault::Former),
    });
    desk.ask(STATUS);
    assert_eq!(desk.diagnosis(), REPLY, "the answer to the former request");
}

/// Two stations that begin together damage each other's octets; each hears nothing of the other.
#[test]
fn collisions() {
    let rate = BusRate::K500;
    let octet = rate.octet_time();
    for late in [0, 5, 10, 11] {
        let mut line = OctetSegment::new(
            rate.format(),
            vec![
                LineHost::default(),
                LineHost::default(),
                LineHost::default(),
            ],
        );
        let at = Instant::START + Span::from_millis(1);
        for (place, start) in [(0, at), (1, at + rate.bit_time() * late)] {
            let wish = Wish {
                ready: start,
                idle_bits: 0,
            };
            line.station_mut(place).send(wish, vec![Octet::from(0x33)]);
        }
        line.run_until(at + octet * 3);
        let heard = |line: &mut OctetSegment<LineHost>, place| {
            std::iter::from_fn(|| line.station_mut(place).receive())
                .map(|(_, octet)| octet.error)
                .collect::<Vec<_>>()
        };
        let error = (late < 11).then_some(LineError::Framing);
        assert_eq!(heard(&mut line, 2), vec![error; 2], "{late} bits later");
        let others = if late < 11 { vec![] } else { vec![None] };
        assert_eq!(heard(&mut line, 0), others);
        assert_eq!(heard(&mut line, 1), others);
    }
    // Both have waited for the same idle time.
    let mut line = OctetSegment::new(
        rate.format(),
        vec![LineHost::default(), LineHost::default()],
    );
    for place in 0..2 {
        let wish = Wish {
            ready: Instant::START,
            idle_bits: 33,
        };
        line.station_mut(place).send(wish, vec![Octet::from(0x33)]);
    }
    line.run_until(Instant::START + Span::from_millis(1));
    for place in 0..2 {
        let heard = line.record(place)[0];
        assert_eq!(heard.error, Some(LineError::Framing));
        assert_eq!(heard.at, Instant::START + rate.bit_time() * 33 + octet);
    }
}

/// The record has each octet at both of its ends, per sender.
#[test]
fn the_record() {
    let (_, desk) = faulty(1, 2, LineFault::Octet(LinkFault::Insert(0x55)));
    let bit = desk.rate.bit_time();
    let record = desk.line.record(1);
    let seen: Vec<_> = record
        .iter()
        .map(|octet| (octet.sent, octet.received))
        .collect();
    assert_eq!(
        seen[..3],
        [
            (Some(0x10), Some(0x10)),
            (None, Some(0x55)),
            (Some(0x02), Some(0x02)),
        ]
    );
    let first = Instant::START + bit * (33 + 66 + 11 + 11);
    assert_eq!(
        record[0],
        LineByte::seen(first, Some(0x10), Some(0x10), None)
    );
    assert_eq!(desk.line.record(0).len(), 6);
    assert_eq!(desk.line.octets(), 12);
    assert_eq!(desk.line.telegrams(), 2);
}

/// A line without work has no next event; a host that is given work has one.
#[test]
fn idle_costs_nothing() {
    let mut desk = Desk::standard();
    assert_eq!(desk.line.next_event(), None);
    desk.ask(STATUS);
    assert_eq!(desk.line.next_event(), None);
}

/// One flipped bit of any request never gets an answer and never changes the slave.
#[test]
fn one_flipped_bit() {
    for request in [
        STATUS,
        "68 05 05 68 88 82 6C 3C 3E F0 16",
        "68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16",
    ] {
        let length = octets(request).len();
        for place in 0..length {
            for bit in 0..10 {
                let mut desk = Desk::standard();
                let mut all: Vec<Octet> = octets(request).into_iter().map(Octet::from).collect();
                all[place].flips = Flips {
                    data: if bit < 8 { 1 << bit } else { 0 },
                    parity: bit == 8,
                    stop: bit == 9,
                    start: false,
                };
                assert_eq!(desk.say(all), "", "{request}: bit {bit} of octet {place}");
                assert_eq!(desk.diagnosis(), "02 05 00 FF 75 31");
            }
        }
    }
}

/// A gap inside a telegram, and a telegram behind too short an idle time, are not answered.
#[test]
fn gaps_and_idle_times() {
    let bit = BusRate::K500.bit_time();
    for (bits, heard) in [(0, REPLY), (1, ""), (33, "")] {
        for place in 1..6 {
            let mut desk = Desk::standard();
            let mut all: Vec<Octet> = octets(STATUS).into_iter().map(Octet::from).collect();
            all[place].pause = bit * bits;
            assert_eq!(
                desk.say(all),
                heard,
                "{bits} bits in front of octet {place}"
            );
        }
    }
    for (idle_bits, heard) in [(32, ""), (33, REPLY), (34, REPLY)] {
        let mut desk = Desk::standard();
        assert_eq!(desk.ask("E5"), "");
        let all = octets(STATUS).into_iter().map(Octet::from).collect();
        let ready = desk.now();
        let wish = Wish {
            ready: Instant::START,
            idle_bits: 33,
        };
        desk.host()
            .send(Wish { ready, ..wish }, vec![Octet::from(0xE5)]);
        desk.host().send(Wish { ready, idle_bits }, all);
        assert_eq!(
            desk.wait(Span::from_millis(5)),
            heard,
            "{idle_bits} idle bits"
        );
    }
}

/// However the time is cut, the records are the same.
#[test]
fn cutting_the_time_changes_nothing() {
    let whole = conversation(u64::MAX);
    for step in [1_000, 9_973, 44_000, 100_003, 3_000_000] {
        assert_eq!(conversation(step), whole, "steps of {step} units");
    }
}

/// A start-up with a late and a damaged reply and two masters, run in steps of this many units.
fn conversation(step: u64) -> Vec<Vec<LineByte>> {
    let mut desk = Desk::at(BusRate::K500, &[setup(8, &[]), setup(9, &[])]);
    for (number, fault) in [
        (
            2,
            LineFault::Telegram(TelegramFault::Late(Span::from_micros(700))),
        ),
        (9, LineFault::Octet(flip(4))),
        (
            12,
            LineFault::Octet(LinkFault::Delay(Span::from_micros(40))),
        ),
    ] {
        desk.line.inject(LineFaultAt {
            station: Some(1),
            number,
            fault,
        });
    }
    let mut ready = Instant::START;
    for request in [
        STATUS,
        "10 09 02 49 54 16",
        "68 05 05 68 88 82 6C 3C 3E F0 16",
        "68 0C 0C 68 88 82 5C 3D 3E 88 01 01 0B 75 31 00 1C 16",
        "68 05 05 68 89 82 6C 3C 3E F1 16",
        "68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16",
    ] {
        let all = octets(request).into_iter().map(Octet::from).collect();
        desk.host().send(
            Wish {
                ready,
                idle_bits: 33,
            },
            all,
        );
        ready += Span::from_micros(900);
    }
    let end = Instant::START + Span::from_millis(20);
    let mut now = Instant::START;
    while now < end {
        now = (now + Span::from_units(step)).min(end);
        desk.line.run_until(now);
    }
    (0..3).map(|place| desk.line.take_record(place)).collect()
}
