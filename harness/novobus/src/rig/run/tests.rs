//! Which scenarios a rig does not play, and why.

use super::*;
use crate::language::read::RingScenario;
use harness_bench::link::Replay;
use harness_bench::scenario::source::Source;
use harness_proto::line::Rate;

/// A UART has one parity setting for both directions. Two flipped bits keep the parity right.
#[test]
fn an_interposer_with_one_uart_takes_no_wrong_parity() {
    let named = Capability::NAMES.iter().map(|(_, name)| *name).collect();
    let link = Replay::new(Vec::new(), Rate::default(), Span::ZERO, vec![3], named);
    let link = link.reaching([(0, 0), (0, 1)]).keeping_parity([(0, 1)]);
    let rings = [RingSize::new(3).expect("a ring")];
    let skip = |fault: &str| {
        let text = format!("title t\nsource nd21 9.7\nring 3\n! {fault}\n> 80\n");
        let source = Source::from_bytes("t.scn".to_owned(), text.into_bytes());
        let entry = RingScenario::new(source.expect("a text"), None).expect("a scenario");
        let skip = not_played(&entry.plan, &link, &rings);
        skip.map(|skip| (skip.why.to_string(), skip.unlocks.into_iter().collect()))
    };
    let (why, unlocks): (String, Vec<_>) = skip("2->1: flip 0").expect("a reason");
    let sentence = "the interposer at 2->1 has one port: a UART has one parity setting for both directions, so wrong parity needs two ports, one for each direction";
    assert_eq!(why, sentence);
    assert_eq!(unlocks, [Unlock::TwoPorts("2->1".to_owned())]);
    for played in [
        "2->1: flip 0 1",
        "2->1: drop",
        "2->1: break 1ms",
        "master->2: flip p",
    ] {
        assert_eq!(skip(played), None, "{played}");
    }
}

/// No ring behind a port has what only the simulator has: the size is then no reason.
#[test]
fn what_needs_the_simulator_is_not_for_another_size() {
    let link = Replay::new(Vec::new(), Rate::default(), Span::ZERO, vec![1], Vec::new());
    let reason = |needs: &str| {
        let text = format!("title t\nsource nd21 9.1\nring 3\n{needs}\n> 80\n");
        let source = Source::from_bytes("t.scn".to_owned(), text.into_bytes());
        let entry = RingScenario::new(source.expect("a text"), None).expect("a scenario");
        let rings = [RingSize::new(1).expect("a ring")];
        let skip = not_played(&entry.plan, &link, &rings);
        let skip = skip.expect("a reason");
        (skip.why.group(), skip.unlocks.into_iter().collect())
    };
    let simulator = "the rig has no simulator".to_owned();
    assert_eq!(reason("needs power"), (simulator, vec![Unlock::Simulated]));
    let size = "it is for rings of another size".to_owned();
    assert_eq!(reason(""), (size, vec![Unlock::Rings(vec![(3, 3)])]));
}
