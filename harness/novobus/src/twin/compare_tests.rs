//! Tests of what is compared, and what is not.

use super::*;
use crate::link::BesideTheBus;
use crate::simulate::bench;
use harness_bench::link::{Line, Octets};
use harness_bench::scenario::source::Source;
use harness_proto::line::LineError;
use harness_proto::novobus::role::roles;

/// ND21 14.2.1: cells that a drive changes by itself, standing or turning, are not compared.
#[test]
fn what_changes_by_itself_is_not_compared() {
    let text = "title x\nring 1\ndrive 0 model nd21\ndrive 0 input GPIN3 GPIN5 high\nwrite-word 0 nsoll = 0400\n";
    let source = Source {
        name: "test".to_owned(),
        text: text.to_owned().into(),
    };
    let plan = crate::language::read::RingScenario::new(source, None)
        .expect("no mistakes")
        .plan;
    let mut link = bench(&plan);
    // 9.3, 10.2: nsoll of drive 0 becomes 0400.
    let turn = [0x8C, 0xFF, 0x63, 0x00, 0x04, 0x08, 0xFF, 0x6E];
    let cells = |link: &crate::link::SimulatedLink| -> Vec<(u16, Option<u8>)> {
        (0xFD80..=0xFF7F)
            .map(|cell| (cell, link.peek(0, 0, cell)))
            .collect()
    };
    let mut changed = BTreeSet::new();
    for sent in [&[][..], &turn] {
        link.send_octets(0, sent);
        link.run_until(link.now() + Span::from_millis(10));
        let before = cells(&link);
        for _ in 0..300 {
            link.run_until(link.now() + Span::from_millis(1));
            let pairs = cells(&link).into_iter().zip(&before);
            changed.extend(pairs.filter(|(now, was)| now != *was).map(|(now, _)| now.0));
        }
    }
    assert!(
        changed.contains(&ram::CNT2) && changed.contains(&ram::LAGEIST),
        "{changed:04X?}"
    );
    let compared: Vec<_> = changed
        .iter()
        .filter(|cell| own::kept(**cell, 0).bits == 0xFF)
        .collect();
    assert!(compared.is_empty(), "{compared:04X?}");
}

/// What differs at each byte of a ring of one drive.
fn rows(
    line_errors: bool,
    knowledge: &mut Knowledge,
    sent: &[u8],
    (expected, received): (&[Received], &[Received]),
) -> Vec<Option<Symptom>> {
    let size = RingSize::new(1).expect("a ring");
    let bytes: Vec<_> = sent.iter().map(|byte| (*byte, true)).collect();
    let at = |bytes: &[Received]| -> Vec<_> {
        bytes.iter().map(|byte| (Instant::START, *byte)).collect()
    };
    let mut comparer = Comparer {
        unwatched: &[],
        exactness: Exactness {
            tolerance: Span::ZERO,
            line_errors,
            knows_cells: false,
            looks: None,
        },
        byte_time: Span::from_micros(286),
        knowledge,
        recording: BTreeSet::new(),
        comparison: Comparison::default(),
    };
    let rows = Rows {
        ring: 0,
        before: 0,
        size,
        roles: &roles(size, &bytes),
        sent,
        known: sent.len(),
        expected: &at(expected),
        received: &at(received),
    };
    (0..sent.len())
        .map(|index| comparer.row(&rows, index, || None))
        .collect()
}

/// ND21 9.7: a byte with a line error differs from the same byte without one, where the link shows line errors.
#[test]
fn the_line_status_is_compared() {
    let damaged = Received {
        error: Some(LineError::Parity),
        ..Received::good(0x80)
    };
    let good = Received::good(0x80);
    let differs = |line_errors, sides: (Received, Received)| {
        let sides = (&[sides.0][..], &[sides.1][..]);
        rows(line_errors, &mut Knowledge::default(), &[0x80], sides)[0]
    };
    for sides in [(good, damaged), (damaged, good)] {
        assert_eq!(differs(true, sides), Some(Symptom::LineStatus));
        assert_eq!(differs(false, sides), None);
    }
}

/// ND21 9.6, 9.7: no checking byte is 00. A drive that sends one is in the error mode, and the zero in front of it is no content of a cell.
#[test]
fn a_checking_byte_00_teaches_nothing() {
    let read = [0x88, 0xFF, 0xC0, 0x20, 0xFE, 0xDE];
    let answer = |data, check| [0x88, 0x00, 0xC0, 0x20, data, check].map(Received::good);
    let (refused, zero, other) = (answer(0, 0), answer(0, 0x20), answer(0x5A, 0xC6));
    let last = |first: &[Received]| {
        let mut known = Knowledge::default();
        rows(true, &mut known, &read, (first, first));
        rows(true, &mut known, &read, (&zero, &other))[4]
    };
    assert_eq!(last(&refused), None);
    assert_eq!(last(&zero), Some(Symptom::Value));
}
