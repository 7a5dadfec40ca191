//! The bench's own master on a computer that does something else meanwhile.

use crate::language::read::RingScenario;
use crate::language::run::over_bus::play_over_bus;
use crate::link::SimulatedLink;
use crate::simulate::bench;
use harness_bench::link::{Capability, Lead, Line, Link, Moment, PlacedFault, Trouble};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::scenario::run::AtMismatch;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;

/// How long the computer does something else.
const BUSY: Span = Span::from_millis(60);

/// A ring whose bench stands still before it sends its second piece.
struct Busy {
    link: SimulatedLink,
    sends: usize,
    tolerance: Span,
}

impl Line for Busy {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.sends += 1;
        if self.sends == 2 {
            let until = self.link.now() + BUSY;
            while self.link.now() < until {
                self.link.wait(until);
            }
        }
        self.link.send(ring, what)
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        self.link.receive(ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.link.wait(until)
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.link.trouble()
    }

    /// The driver waits for answers as it does where time is real.
    fn lead(&self) -> Lead {
        Lead {
            far: Span::from_millis(16),
            near: Span::ZERO,
        }
    }
}

impl Link for Busy {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }

    fn begin(&mut self) {
        self.link.begin();
    }

    fn busy(&self) -> bool {
        self.link.busy()
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(ring, fault, moment);
    }

    fn time_tolerance(&self) -> Span {
        self.tolerance
    }

    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        self.link.probe(ring, octets)
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, ring: usize) -> u8 {
        self.link.drives(ring)
    }

    fn trace(&self, ring: usize) -> Trace {
        self.link.trace(ring)
    }
}

/// ND21 9.1: a gap that the master leaves is its own fault where time is virtual, and a busy computer's where it is not. It is no drive's:
/// nothing has failed.
#[test]
fn a_gap_of_a_busy_computer_is_no_fault() {
    let source = Source {
        name: "test".to_owned(),
        text: "title x\nring 3\nmaster read-byte 0 FE10 = 00; read-byte 1 FE10 = 00; read-byte 2 FE10 = 00\n? rules kept\n".into(),
    };
    let entry =
        RingScenario::new(source, None).unwrap_or_else(|problems| panic!("{:#?}", problems.all()));
    let plan = entry.plan;
    let verdict = |tolerance| {
        let mut link = Busy {
            link: bench(&plan),
            sends: 0,
            tolerance: Span::from_millis(tolerance),
        };
        let outcome = play_over_bus(&plan, &mut link, AtMismatch::Stop);
        assert!(link.sends > 1, "{} pieces", link.sends);
        let finding = outcome.finding.map(|finding| finding.message);
        let gap = |message: String| message.contains("left a gap on the line behind");
        (outcome.verdict, finding.is_some_and(gap))
    };
    assert_eq!(verdict(100), (Verdict::Passed, false));
    assert_eq!(verdict(20), (Verdict::Marginal, true));
    assert_eq!(verdict(0), (Verdict::Failed, true));
}
