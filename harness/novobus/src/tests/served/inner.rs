//! Taps and interposers on a ring that is served, over sockets and pseudo terminals: the same bytes on
//! the same links as in the simulator.

use super::ServedRings;
use crate::language::plan::Plan;
use crate::language::read::RingScenario;
use crate::language::run::over_bus::{play_over_bus, start_anew};
use crate::link::SimulatedLink;
use crate::rig::parse;
use crate::simulate;
use crate::stream::StreamLink;
use harness_bench::link::{
    InnerLink, InnerPorts, Line, Link, LinkFault, Moment, Octets, PlacedFault, PortLink as _,
    Trouble,
};
use harness_bench::port::Wire;
use harness_bench::scenario::run::{AtMismatch, lacks};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_bench::serve::{ClientRole, Inner};
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::time::Span;
use harness_sim::fault::Flips;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Reads of FE13 from the drives 3 and 2 of a ring of four, one telegram behind the other (ND21 9.2, 10.1).
const READS: [u8; 12] = [
    0x88, 0xFF, 0xC0, 0x13, 0xFE, 0xD1, 0x88, 0xFE, 0xC0, 0x13, 0xFE, 0xD1,
];

/// What shows an error at the master, and lets drives in error mode count (ND21 9.7).
const SYNCOS: [u8; 40] = [0x80; 40];

/// The link in the middle of a ring of four, 2->1, counted from the master's.
const MIDDLE: usize = 2;

const TAP: [ClientRole; 1] = [ClientRole::Tap];
const CUT: [ClientRole; 1] = [ClientRole::Cut];
const CUT_BY_TWO: [ClientRole; 2] = [ClientRole::Upstream, ClientRole::Downstream];

/// An observed byte: what was sent, what arrived, with which error.
type ObservedByte = (Option<u8>, Option<u8>, Option<LineError>);

/// A ring of four that is served; it ends with this value.
struct ServedRing {
    /// The ring, then the inner links.
    rings: ServedRings,
    marks: bool,
}

impl ServedRing {
    /// Serves a ring of four, with inner links: what the client does there, and the link. Several places are as many ports.
    fn start(transport: &str, marks: bool, inner: &[(&[ClientRole], usize)]) -> Self {
        let roles = inner.iter().flat_map(|(roles, link)| {
            roles.iter().map(|role| Inner {
                ring: 0,
                link: *link,
                role: *role,
            })
        });
        let setup = "drive 0..last model plain\n";
        Self {
            rings: ServedRings::start(setup, &[4], transport, marks, roles.collect()),
            marks,
        }
    }

    fn wire(&self, index: usize) -> Wire {
        self.rings.wire(index, self.marks)
    }

    fn link(&self, inner: Vec<InnerLink>) -> StreamLink {
        let ring = vec![(self.wire(0), 4)];
        StreamLink::new(ring, inner, Rate::default(), Arc::default())
    }

    /// A link with an interposer in the middle.
    fn interposed(&self) -> StreamLink {
        let ports = InnerPorts::Interposer(self.wire(1));
        self.link(vec![InnerLink::new(0, MIDDLE, ports)])
    }
}

fn simulated() -> SimulatedLink {
    let text = "title t\nsource nd21 9.7\nring 4\ndrive 0..3 model plain\n> 80\n";
    let source = Source::from_bytes("t.scn".to_owned(), text.into()).expect("a text");
    let entry = RingScenario::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
    simulate::bench(&entry.plan)
}

/// Sends bytes and gives what comes back until the ring is quiet.
fn exchange(link: &mut dyn Link, bytes: &[u8]) -> Vec<Received> {
    let end = link.send_octets(0, bytes) + Span::from_millis(5_000);
    let mut back = Vec::new();
    while link.busy() && link.now() < end && link.wait(end) {
        while let Some((_, byte)) = link.receive_octet(0) {
            back.push(byte);
        }
    }
    while let Some((_, byte)) = link.receive_octet(0) {
        back.push(byte);
    }
    assert_eq!(link.trouble(), None);
    back
}

/// Plays two telegrams with faults in the middle, waits for silence, and asks with SYNCO: what comes back.
fn play(link: &mut dyn Link, faults: &[(u64, LinkFault)]) -> [Vec<Received>; 2] {
    link.begin();
    for (byte, fault) in faults {
        let fault = PlacedFault::Link(MIDDLE, *fault);
        link.inject(0, fault, Moment::Byte(*byte));
    }
    [exchange(link, &READS), exchange(link, &SYNCOS)]
}

/// What a link carried.
fn column(link: &dyn Link, place: usize) -> Vec<ObservedByte> {
    let bytes = link.trace(0).channels[place].octets().to_vec();
    let seen = bytes
        .iter()
        .map(|byte| (byte.sent, byte.received, byte.error));
    seen.collect()
}

fn flip(data: u8) -> LinkFault {
    LinkFault::Flip(Flips {
        data,
        ..Flips::default()
    })
}

/// Faults by name, each with bytes that are damaged by it on their way.
fn faults() -> Vec<(&'static str, Vec<(u64, LinkFault)>)> {
    let parity = Flips {
        parity: true,
        ..Flips::default()
    };
    vec![
        ("none", vec![]),
        ("flip 0", vec![(10, flip(1))]),
        ("flip 0 1, which nobody notices", vec![(10, flip(3))]),
        ("flip p", vec![(4, LinkFault::Flip(parity))]),
        ("flip 0 twice", vec![(8, flip(1)), (8, flip(1))]),
        ("replace", vec![(9, LinkFault::Replace(0xC1))]),
        ("drop", vec![(5, LinkFault::Drop)]),
        ("duplicate", vec![(7, LinkFault::Duplicate)]),
        ("insert", vec![(7, LinkFault::Insert(0x80))]),
        (
            "insert and flip",
            vec![(7, LinkFault::Insert(0x81)), (11, flip(0x80))],
        ),
        ("break", vec![(12, LinkFault::Break(Span::from_millis(1)))]),
        ("delay", vec![(6, LinkFault::Delay(Span::from_millis(20)))]),
        (
            "cut and join",
            vec![(5, LinkFault::Cut), (12, LinkFault::Join)],
        ),
    ]
}

/// Every fault at an interposer against the simulator: at the master and on the link itself.
fn interposer(transport: &str) {
    let served = ServedRing::start(transport, true, &[(&CUT, MIDDLE)]);
    let mut link = served.interposed();
    // The served ring may take a while to begin.
    let begun = (0..50).any(|_| !exchange(&mut link, &SYNCOS).is_empty());
    assert!(begun, "nothing comes back");
    for (name, faults) in faults() {
        plays_alike(&mut link, name, &faults);
        recover(&mut link);
    }
    let delay = link.inner_links()[0].delay();
    assert!(delay.bytes > 12, "{delay:?}");
    assert!(delay.longest >= delay.mean(), "{delay:?}");
    assert!(delay.mean() > Duration::ZERO, "{delay:?}");
}

/// How often something is played on a served ring: the thread that serves it may stand still, and then bytes come behind the end.
const TRIES: usize = 4;

/// A served ring gives what the simulator gives: at the master, and on the link itself.
#[track_caller]
fn plays_alike(link: &mut StreamLink, name: &str, faults: &[(u64, LinkFault)]) {
    let mut model = simulated();
    let expected = (play(&mut model, faults), column(&model, MIDDLE));
    let mut shown = (play(link, faults), column(link, MIDDLE));
    for _ in 1..TRIES {
        if shown == expected {
            break;
        }
        recover(link);
        shown = (play(link, faults), column(link, MIDDLE));
    }
    let (telegrams, on_link) = shown;
    assert_eq!(telegrams, expected.0, "{name}: the telegrams, and SYNCO");
    assert_eq!(on_link, expected.1, "{name}: 2->1");
    assert_eq!(link.unused_faults(), [""; 0], "{name}");
}

/// The check sequence brings all drives back (ND21 9.8), whatever they wait for.
fn recover(link: &mut StreamLink) {
    link.begin();
    let mut back = Vec::new();
    for _ in 0..TRIES {
        for _ in 0..3 {
            exchange(link, &SYNCOS);
            exchange(link, &[0x00; 32]);
            exchange(link, &[0xFF, 0x44, 0x72, 0x4C, 0x41]);
        }
        back = exchange(link, &[0x80; 3]);
        if back == [Received::good(0x80); 3] {
            return;
        }
    }
    panic!("the ring is not normal again: {back:?}");
}

#[test]
fn every_fault_at_an_interposer_on_a_socket() {
    interposer("tcp");
}

#[test]
fn every_fault_at_an_interposer_on_a_pty() {
    interposer("pty");
}

#[test]
fn an_interposer_with_two_ports() {
    let served = ServedRing::start("tcp", true, &[(&CUT_BY_TWO, MIDDLE)]);
    let ports = InnerPorts::TwoPortInterposer(served.wire(1), served.wire(2));
    let mut link = served.link(vec![InnerLink::new(0, MIDDLE, ports)]);
    plays_alike(&mut link, "flip 0", &[(10, flip(1))]);
}

/// The end of our conversation does not cut the ring of another client's conversation.
#[test]
fn an_interposer_goes_on_behind_an_interruption() {
    let served = ServedRing::start("tcp", true, &[(&CUT, MIDDLE)]);
    let inner = InnerLink::new(0, MIDDLE, InnerPorts::Interposer(served.wire(1)));
    let ring = vec![(served.wire(0), 4)];
    let interrupt: Arc<AtomicBool> = Arc::default();
    let mut link = StreamLink::new(ring, vec![inner], Rate::default(), Arc::clone(&interrupt));
    link.begin();
    link.send_octets(0, &READS);
    interrupt.store(true, Ordering::Relaxed);
    let passed = |link: &StreamLink| link.inner_links()[0].delay().bytes;
    let end = link.now() + Span::from_millis(5_000);
    while passed(&link) < READS.len() as u64 && link.now() < end {
        assert!(!link.wait(end), "nothing more is said");
    }
    assert_eq!(link.trouble(), Some(&Trouble::Interrupted));
    assert_eq!(passed(&link), READS.len() as u64);
}

/// The column of a tapped link is the simulator's, byte for byte; a byte is seen when it has arrived, and then it is
/// as late as the ring is long.
fn tapped(transport: &str, marks: bool) {
    let served = ServedRing::start(transport, marks, &[(&TAP, 1), (&TAP, 3)]);
    let taps = [(1, 1), (2, 3)];
    let inner =
        taps.map(|(wire, place)| InnerLink::new(0, place, InnerPorts::Tap(served.wire(wire))));
    let mut link = served.link(inner.into());
    let arrived = |link: &dyn Link, place: usize| -> Vec<_> {
        let column = column(link, place);
        column
            .iter()
            .map(|(_, got, error)| (*got, *error))
            .collect()
    };
    let shown = |link: &mut dyn Link| {
        let played = play(link, &[]);
        (played, taps.map(|(_, place)| arrived(link, place)))
    };
    let expected = shown(&mut simulated());
    let mut seen = shown(&mut link);
    for _ in 1..TRIES {
        if seen == expected {
            break;
        }
        recover(&mut link);
        seen = shown(&mut link);
    }
    assert_eq!(seen, expected);
    for (_, place) in taps {
        let times = link.trace(0).channels[place].octets().to_vec();
        assert!(times.windows(2).all(|two| two[0].at <= two[1].at));
        assert!(!link.reaches(0, place), "a tap changes nothing");
    }
}

#[test]
fn taps_on_sockets_and_ptys() {
    tapped("tcp", true);
    tapped("tcp", false);
    tapped("pty", true);
}

const TITLE: &str = "title t\nsource nd21 9.7\nring 4\n";

fn plan_of(steps: &str) -> Plan {
    let text = format!("{TITLE}{steps}");
    let source = Source::from_bytes("t.scn".to_owned(), text.into()).expect("a text");
    let entry = RingScenario::new(source, None).unwrap_or_else(|p| panic!("{:#?}", p.all()));
    entry.plan
}

/// The 9.7 scenario on a small ring, in the words of the language; a fault elsewhere is skipped, its link named.
#[test]
fn scenarios_at_an_interposer() {
    let served = ServedRing::start("tcp", true, &[(&CUT, MIDDLE)]);
    let mut link = served.interposed();
    let plan = plan_of(
        "drive 0..3 model plain\ndrive 2..3 memory FE13 = 88\n\n> 88 FF C0 13 FE D1\n> 88 FE C0 13 FE D1\n! 2->1 byte 10: flip 0\n\
         > 80*40\n? located 1\n? within 25 zeros\n",
    );
    assert_eq!(lacks(&plan, &link), None);
    let played = std::iter::repeat_with(|| {
        start_anew(&mut link, &plan.rings).expect("it answers");
        play_over_bus(&plan, &mut link, AtMismatch::Stop)
    });
    let mut outcomes = played.take(TRIES);
    let passed = outcomes.find(|outcome| outcome.verdict == Verdict::Passed);
    assert!(passed.is_some(), "it has not passed {TRIES} times");
    drop(outcomes);

    let plan = plan_of("! 3->2 byte 1: flip 0\n> 80\n");
    let outcome = play_over_bus(&plan, &mut link, AtMismatch::Stop);
    assert_eq!(outcome.verdict, Verdict::Skipped);
    assert!(outcome.remarks[0].contains("3->2"), "{outcome:?}");
}

/// A cut link without a client is open: no byte comes back.
#[test]
fn a_cut_link_with_nobody_there_is_open() {
    let served = ServedRing::start("tcp", true, &[(&CUT, MIDDLE)]);
    let mut link = served.link(Vec::new());
    assert_eq!(exchange(&mut link, &[0x80; 4]), []);
}

/// One port may be both ends of an interposer; two interposers need two.
#[test]
fn one_port_for_both_ends_in_a_rig_file() {
    let ring = "schema = 1\n[rig]\nid = \"a\"\n[ring.1]\ndrives = 4\ntransport = \"tcp\"\nport = \"h:1\"\n";
    let interposer = |link: &str| {
        let end = "{ transport = \"tcp\", port = \"h:2\" }";
        format!("[[interposer]]\nlink = \"{link}\"\nupstream = {end}\ndownstream = {end}\n")
    };
    let parsed = |text: String| {
        let source = Source::from_bytes("a.toml".to_owned(), text.into()).expect("a text");
        parse(&source)
    };
    let one = parsed(format!("{ring}{}", interposer("2->1")));
    assert!(one.is_ok(), "{one:?}");
    let two = parsed(format!(
        "{ring}{}{}",
        interposer("2->1"),
        interposer("1->0")
    ));
    let problems = two.expect_err("the port is taken");
    assert!(problems.all()[0].message.contains("named twice"));
}
