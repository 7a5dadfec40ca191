//! Rings whose drives have missed their master, brought back.

use super::*;
use crate::language::read::RingScenario;
use crate::simulate;
use harness_bench::scenario::source::Source;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;

/// A ring whose drives monitor time-outs and have missed their master.
fn timed_out(drives: u8) -> impl Link {
    let text = format!("title t\nring {drives}\ndrive 0..last eeprom 47 = 80\n> 80\n");
    let source = Source::from_bytes("ring.scn".to_owned(), text.into_bytes()).expect("a text");
    let entry = RingScenario::new(source, None).expect("a scenario");
    let mut link = simulate::bench(&entry.plan);
    link.run_until(link.now() + Span::from_millis(300));
    for sent in [&[SYNCO][..], &CHECK_SEQUENCE, &CHECK_SEQUENCE] {
        let left = link.send_octets(0, sent);
        settle(&mut link, left);
        while link.receive_octet(0).is_some() {}
        link.run_until(link.now() + Span::from_millis(500));
    }
    link
}

/// ND21 9.8, 9.9: drives time out one byte apart in a silence, and two check sequences do not bring back every ring.
#[test]
fn a_time_out_of_a_long_ring_ends() {
    let mut more = 0;
    for drives in 2..=20 {
        let mut link = timed_out(drives);
        end_time_out(&mut link, 0);
        let ends = comes_round(&mut link, 0, &[SYNCO], PATIENCE);
        assert!(ends, "{drives}");
        let mut link = timed_out(drives);
        let left = link.send_octets(0, &CHECK_SEQUENCE.repeat(2));
        settle(&mut link, left);
        more += u8::from(!comes_round(&mut link, 0, &[SYNCO], PATIENCE));
    }
    assert!(more > 0, "two were enough");
}
