//! What a simulated bench of each bus carries, as it is recorded again.

use crate::capture::{Carries, Piece, Tape, later};
use crate::library::{Entry, sources};
use crate::scenario::run::AtMismatch;
use harness_proto::line::Rate;
use harness_proto::time::Span;

fn tape(name: &str) -> Tape {
    let found = sources(&[name.into()]).expect("a scenario");
    let entry = Entry::new(found[0].clone(), None).expect("no mistakes");
    let plan = entry.settled().expect("a bus");
    let mut link = plan.simulate();
    let _outcome = plan.play(&mut *link, AtMismatch::GoOn);
    let traces: Vec<_> = (0..plan.ports()).map(|port| link.trace(port)).collect();
    Tape::of(&traces, Rate::default())
}

/// Each bus is heard whole and in order, at its own rate.
#[test]
fn every_bus_is_heard() {
    for (name, places, carries, bits, first) in [
        ("9.8-check-sequence", 101, Carries::Link, 38_400, 0x88),
        ("unitek-3.1-rate-250", 1, Carries::Frames, 250_000, 0),
        ("nordac-3.3-start-up", 1, Carries::Line, 500_000, 0x68),
    ] {
        let own = tape(name);
        assert_eq!(own.places.len(), places, "{name}");
        assert!(own.places.iter().all(|own| own.carries == carries));
        assert_eq!(own.places[0].bits_per_second, bits, "{name}");
        assert!(own.pieces.is_sorted_by_key(|(at, ..)| *at), "{name}");
        let begins = match &own.pieces[0].2 {
            Piece::Telegram(None, octets) => octets[0].sent,
            Piece::Octet(byte) => byte.sent,
            _ => Some(first),
        };
        assert_eq!(begins, Some(first), "{name}");
        let hour = Span::from_millis(3_600_000);
        let (at, _, piece) = &own.pieces[0];
        let moved = match later(piece, hour) {
            Piece::Telegram(_, octets) => octets.last().map(|own| own.at),
            Piece::Octet(own) => Some(own.at),
            Piece::Frame(own) => Some(own.at),
            Piece::Event(..) => None,
        };
        assert_eq!(moved, Some(*at + hour), "{name}");
    }
}
