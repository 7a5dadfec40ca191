//! Playing back a record: what it returns, and what happens if the caller does something else.

use super::*;
use crate::link::Octets;
use harness_proto::line::Rate;
use harness_sim::fault::Flips;

fn ms(at: u64) -> Instant {
    Instant::START + Span::from_millis(at)
}

/// A byte that comes long after the time until which it was waited for, and one that is sent then.
fn overslept(tolerance: Span) -> Replay {
    let byte = HeardPiece::Octet(Received::good(0x80));
    let events = vec![
        LinkEvent::Begin(Instant::START),
        LinkEvent::Sent(0, ms(1), Pieces::Octets(vec![0x80])),
        LinkEvent::Received(0, ms(300), byte),
        LinkEvent::Sent(0, ms(301), Pieces::Octets(vec![0x81])),
    ];
    Replay::new(events, Rate::default(), tolerance, vec![1], Vec::new())
}

/// Sends a byte, waits for answers until 50 ms, and sends the next byte.
fn play(replay: &mut Replay) -> Vec<Instant> {
    replay.begin();
    replay.send_octets(0, &[0x80]);
    let mut came = Vec::new();
    while replay.now() < ms(50) {
        replay.wait(ms(50));
        while let Some((at, _)) = replay.receive(0) {
            came.push(at);
        }
    }
    replay.send_octets(0, &[0x81]);
    came
}

#[test]
fn whoever_slept_too_long_has_fetched_what_came_meanwhile() {
    let mut replay = overslept(Span::from_millis(20));
    assert_eq!(play(&mut replay), [ms(300)]);
    assert_eq!((replay.trouble(), replay.left()), (None, None));
}

#[test]
fn nobody_sleeps_too_long_where_time_is_virtual() {
    let mut replay = overslept(Span::ZERO);
    assert_eq!(play(&mut replay), []);
    let trouble = replay.trouble().expect("trouble").to_string();
    assert!(
        trouble.contains("something else than what is sent"),
        "{trouble}"
    );
}

/// Where a wait ended without a byte, the caller looked at an inner link. It does so again, at the same times.
#[test]
fn a_wait_ends_at_a_look_at_an_inner_link() {
    let byte = || Received::good(0x80);
    let events = vec![
        LinkEvent::Begin(Instant::START),
        LinkEvent::Tapped(0, 1, Instant::START, vec![byte()]),
        LinkEvent::Tapped(0, 1, ms(3), Vec::new()),
        LinkEvent::Received(0, ms(4), HeardPiece::Octet(byte())),
    ];
    let mut replay = Replay::new(events, Rate::default(), Span::ZERO, vec![1], Vec::new());
    replay.begin();
    assert_eq!(replay.tapped(0, 1), Some(vec![byte()]));
    replay.wait(ms(10));
    assert_eq!(replay.now(), ms(3));
    assert_eq!(replay.tapped(0, 1), Some(vec![byte()]));
    replay.wait(ms(10));
    assert_eq!(replay.receive_octet(0), Some((ms(4), byte())));
    assert_eq!((replay.trouble(), replay.left()), (None, None));
}

/// The calls that a caller may need for a record of a few events.
const CALLS: u32 = 500;

/// Goes on until a time as a player of scenarios does, which looks at trouble only where it waits.
fn pass_until(replay: &mut Replay, until: Instant, calls: &mut u32) {
    while replay.now() < until && *calls < CALLS {
        *calls += 1;
        let due = replay.pause_due().filter(|_| !replay.busy());
        match due {
            Some(due) if due <= replay.now() => replay.pause(),
            due => {
                replay.wait(due.map_or(until, |due| due.min(until)));
            }
        }
    }
}

/// A whole conversation. With the calls in loops that it took.
fn converse(replay: &mut Replay) -> u32 {
    let mut calls = 0;
    replay.begin();
    replay.step(7);
    replay.inject(0, PlacedFault::Link(0, LinkFault::Duplicate), Moment::Now);
    replay.send_octets(0, &[0x80]);
    pass_until(replay, ms(3), &mut calls);
    let _column = replay.tapped(0, 0);
    pass_until(replay, ms(10), &mut calls);
    while replay.receive(0).is_some() {
        calls += 1;
    }
    replay.probe(0, &[0x81]);
    replay.step(9);
    pass_until(replay, ms(20), &mut calls);
    let end = ms(3_600_000);
    while replay.busy() && replay.now() < end && calls < CALLS && replay.wait(end) {
        calls += 1;
    }
    replay.begin();
    pass_until(replay, ms(5), &mut calls);
    calls
}

/// What [`converse`] was recorded with, with looks or without.
fn recorded(looks: bool) -> Vec<LinkEvent> {
    let good = Received::good(0x80);
    let look = |at, pause: Option<u64>| {
        LinkEvent::Look(Look {
            at: ms(at),
            busy: false,
            lead: None,
            pause: pause.map(ms),
            since: None,
        })
    };
    let fault = PlacedFault::Link(0, LinkFault::Duplicate);
    let events = vec![
        LinkEvent::Begin(Instant::START),
        look(0, Some(5)),
        LinkEvent::Step(7),
        LinkEvent::Fault(0, Instant::START, fault, Moment::Now),
        LinkEvent::Sent(0, ms(1), Pieces::Octets(vec![0x80])),
        look(2, Some(5)),
        LinkEvent::Received(0, ms(2), HeardPiece::Octet(good)),
        look(3, Some(5)),
        LinkEvent::Tapped(0, 0, ms(3), vec![good]),
        look(5, Some(5)),
        look(5, Some(40)),
        look(10, Some(40)),
        LinkEvent::Probe(0, ms(10), vec![0x81], vec![good]),
        look(11, Some(40)),
        LinkEvent::Step(9),
        look(20, Some(40)),
        LinkEvent::Trouble(Trouble::Denied("a byte".to_owned())),
        LinkEvent::Begin(ms(21)),
        look(0, None),
        look(5, None),
    ];
    let kept = |event: &LinkEvent| looks || !matches!(event, LinkEvent::Look(_));
    events.into_iter().filter(kept).collect()
}

/// Replay ends although a line of the record is moved, deleted or doubled. The work is bounded, not the time.
#[test]
fn no_order_of_the_record_holds_the_caller() {
    for looks in [true, false] {
        let all = recorded(looks);
        let mut edits = vec![Vec::new(), all.clone()];
        for from in 0..all.len() {
            let mut without = all.clone();
            let event = without.remove(from);
            edits.push(without.clone());
            for to in 0..=without.len() {
                let mut moved = without.clone();
                moved.insert(to, event.clone());
                edits.push(moved);
                let mut doubled = all.clone();
                doubled.insert(to, event.clone());
                edits.push(doubled);
            }
        }
        for tolerance in [Span::ZERO, Span::from_millis(20)] {
            for events in &edits {
                let rate = Rate::default();
                let mut replay = Replay::new(events.clone(), rate, tolerance, vec![1], Vec::new());
                let calls = converse(&mut replay);
                assert!(calls < CALLS, "{events:#?}");
            }
        }
    }
}

/// After trouble of the record a difference is reported too, where the record holds all that the caller saw.
#[test]
fn a_difference_behind_a_denial_is_reported() {
    let mut all = recorded(true);
    let mut replay = Replay::new(
        all.clone(),
        Rate::default(),
        Span::ZERO,
        vec![1],
        Vec::new(),
    );
    converse(&mut replay);
    assert_eq!(replay.left(), None);
    all.pop();
    let mut replay = Replay::new(all, Rate::default(), Span::ZERO, vec![1], Vec::new());
    converse(&mut replay);
    let left = replay.left().expect("a difference");
    assert!(left.contains("a look at the ports"), "{left}");
}

/// A byte with a wrong parity bit may wait for a silent line, for a while and within the rig's tolerance; no other byte may. The first one of a
/// conversation may wait for a line that is not free yet.
#[test]
fn bytes_may_leave_later_than_the_next_look() {
    let byte = Rate::default().byte_time();
    let parity = LinkFault::Flip(Flips {
        parity: true,
        ..Flips::default()
    });
    let left = |fault, silence: Span, occupied: Span, tolerance: Span| {
        let fault = PlacedFault::Link(0, fault);
        let first = Instant::START + occupied + byte;
        let sent = |end, byte| LinkEvent::Sent(0, end, Pieces::Octets(vec![byte]));
        let look = |at| {
            LinkEvent::Look(Look {
                at,
                busy: true,
                lead: None,
                pause: None,
                since: None,
            })
        };
        let events = vec![
            LinkEvent::Begin(Instant::START),
            look(Instant::START),
            sent(first, 0x88),
            LinkEvent::Fault(0, Instant::START, fault, Moment::Now),
            sent(first + silence + byte, 0xFE),
            look(Instant::START + byte),
        ];
        let mut replay = Replay::new(events, Rate::default(), tolerance, vec![3], Vec::new());
        replay.begin();
        replay.send_octets(0, &[0x88]);
        replay.inject(0, fault, Moment::Now);
        replay.send_octets(0, &[0xFE]);
        replay.wait(Instant::START + byte);
        replay.left()
    };
    let (allowed, none) = (Span::from_millis(5), Span::ZERO);
    assert_eq!(left(parity, allowed, none, allowed), None);
    assert!(left(parity, allowed + byte, none, allowed).is_some());
    assert!(left(LinkFault::Drop, allowed, none, allowed).is_some());
    // Bytes of the conversation before occupy the line, as far ahead as they are given to the operating system.
    assert_eq!(left(LinkFault::Drop, none, AHEAD, allowed), None);
    assert!(left(LinkFault::Drop, none, AHEAD + byte, allowed).is_some());
}
