//! How far ahead of the line bytes are handed over, in virtual time.

use crate::driver::{Axis, OpenRings, Options};
use crate::link::SimulatedLink;
use harness_bench::link::{Lead, Line, Link, LinkFault, Moment, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::bench::Bench;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;
use std::sync::{Arc, Mutex};

const DRIVES: u8 = 3;

/// The byte time of 38400 bit/s (ND21 8.1): 11 bits.
fn byte() -> Span {
    Rate::Baud38400.byte_time()
}

/// A simulated ring that takes bytes ahead.
struct Ahead<'l> {
    link: &'l mut SimulatedLink,
    lead: Lead,
    /// When something was waited for.
    attended: Arc<Mutex<Vec<Instant>>>,
}

impl Line for Ahead<'_> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.link.send(ring, what)
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        self.link.receive(ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.link.wait(until)
    }

    fn attend(&mut self, _ring: usize, at: Instant) {
        self.attended.lock().expect("no panic").push(at);
    }

    fn lead(&self) -> Lead {
        self.lead
    }
}

fn size() -> RingSize {
    RingSize::new(u64::from(DRIVES)).expect("a size")
}

fn simulated() -> SimulatedLink {
    let ring = Ring::new(size(), Rate::Baud38400, |_| {
        Drive::Plain(PlainDrive::default())
    });
    SimulatedLink::new(Bench::one(ring))
}

/// What the master sent while a bus ran `act`, with the time of each byte, and when `act` had ended.
fn played(
    lead: Lead,
    late: Span,
    act: impl FnOnce(&OpenRings<'_>),
) -> (Vec<(Instant, u8)>, Instant) {
    let mut link = simulated();
    if late > Span::ZERO {
        let fault = PlacedFault::Link(usize::from(DRIVES), LinkFault::Delay(late));
        for number in 1..60 {
            link.inject(0, fault, Moment::Byte(number));
        }
    }
    let line = Ahead {
        link: &mut link,
        lead,
        attended: Arc::default(),
    };
    let bus = OpenRings::open(Box::new(line), &[size()], Options::default()).expect("an open bus");
    act(&bus);
    assert_eq!(bus.corrected_errors(), 0);
    let end = bus.now();
    bus.close();
    // SYNCO after the last answer may still be on its way.
    link.run_until(link.now() + Span::from_millis(50));
    let sent = link.trace(0).channels[0].octets().to_vec();
    let sent = sent
        .iter()
        .map(|byte| (byte.at, byte.sent.expect("a byte")));
    (sent.collect(), end)
}

fn reads(bus: &OpenRings<'_>) {
    for drive in [0, 1, 2, 0, 1] {
        let axis = Axis::new(0, drive).expect("an axis");
        assert_eq!(bus.read_byte(axis, 0xFE13), Ok(0));
    }
}

/// The longest time between two bytes.
fn gap(sent: &[(Instant, u8)]) -> Span {
    let gaps = sent.windows(2).map(|two| two[1].0.since(two[0].0 + byte()));
    gaps.max().unwrap_or(Span::ZERO)
}

fn ahead(near: Span) -> Lead {
    Lead {
        far: Span::from_millis(16),
        near,
    }
}

/// A job after an awaited answer sends the same bytes at the same times as without a lead.
#[test]
fn a_job_does_not_wait_behind_synco() {
    let (expected, end) = played(Lead::NONE, Span::ZERO, reads);
    let (sent, took) = played(ahead(Span::ZERO), Span::ZERO, reads);
    let count = expected.iter().filter(|(at, _)| *at <= end).count();
    assert_eq!(sent[..count], expected[..count]);
    assert_eq!(took, end);
}

/// Behind an adapter SYNCO goes on beyond the answer, so that the line has no gap (ND21 9.2): a job comes later by that, and no more.
#[test]
fn an_adapter_is_never_without_bytes() {
    let near = Span::from_millis(4);
    let (_, end) = played(Lead::NONE, Span::ZERO, reads);
    let (sent, took) = played(ahead(near), Span::ZERO, reads);
    assert_eq!(gap(&sent), Span::ZERO);
    // The count of the drives and five reads.
    assert!(
        took > end && took <= end + (near + byte()) * 6,
        "{took} {end}"
    );
}

/// The pump tells the link when an awaited answer is due, whatever is sent after the request.
#[test]
fn an_answer_is_attended_to_when_it_comes() {
    for near in [Span::ZERO, Span::from_millis(4)] {
        let attended = Arc::<Mutex<Vec<Instant>>>::default();
        let mut link = simulated();
        let line = Ahead {
            link: &mut link,
            lead: ahead(near),
            attended: Arc::clone(&attended),
        };
        let last = || attended.lock().expect("no panic").last().copied();
        let bus =
            OpenRings::open(Box::new(line), &[size()], Options::default()).expect("an open bus");
        assert_eq!(last(), Some(bus.now()), "the count of the drives");
        for _ in 0..3 {
            let axis = Axis::new(0, 1).expect("an axis");
            assert_eq!(bus.read_byte(axis, 0xFE13), Ok(0));
            assert_eq!(last(), Some(bus.now()), "an answer");
        }
    }
}

/// If an answer is late, SYNCO goes on a byte time after the answer was due.
#[test]
fn synco_goes_on_where_an_answer_is_late() {
    let (sent, _) = played(ahead(Span::ZERO), Span::from_millis(3), reads);
    let gap = gap(&sent);
    assert!(gap > Span::ZERO && gap <= byte() + byte(), "{gap}");
}

/// A caller of `run` or `keep` may come back late: SYNCO is sent ahead, and its next job leaves behind that SYNCO.
#[test]
fn the_line_is_kept_while_nobody_waits() {
    let lead = ahead(Span::ZERO);
    let (sent, _) = played(lead, Span::ZERO, |bus| {
        bus.run(Span::from_millis(50));
        let before = bus.now();
        reads(bus);
        bus.keep();
        let took = bus.now().since(before);
        // Sync, address, four bytes, a round and a byte on its way: 9.3, 10.1.
        let most = lead.far + byte() * (5 * (6 + u64::from(DRIVES) + 2) + 1);
        assert!(
            took <= most,
            "{took} for five reads, {most} expected at most"
        );
    });
    assert_eq!(gap(&sent), Span::ZERO);
    let behind = sent.iter().rev().take_while(|(_, byte)| *byte == 0x80);
    assert!(byte() * behind.count() as u64 >= lead.far);
}
