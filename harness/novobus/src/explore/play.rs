//! A case on simulated rings without the way over its text: thousands a second. A test holds that both ways are one.

use super::case::{ActKind, Case};
use crate::link::SimulatedLink;
use harness_bench::link::{DriveFault, Line, Link, Moment, Octets, PlacedFault};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};

/// How long bytes may be on their way round: far more than the longest case takes.
const MOST_ROUND: Span = Span::from_millis(60_000);

/// Room for the bytes of most cases, so that links and queues do not grow byte by byte.
const USUAL: usize = 128;

/// What the master saw.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct MasterView {
    /// What it received, and when.
    pub received: Vec<(Instant, Received)>,
    /// How long it took on the line.
    pub took: Span,
}

/// Plays a case on a ring to which nothing has been sent, in the steps of a scenario.
pub(crate) fn play(link: &mut SimulatedLink, case: &Case) -> MasterView {
    let ring = case.ring();
    link.reserve(ring, USUAL);
    for (place, byte, harm) in case.faults() {
        let fault = PlacedFault::Link(usize::from(place), harm.fault());
        link.inject(ring, fault, Moment::Byte(byte));
    }
    // When the line before was done.
    let mut line_before = link.now();
    for act in &case.acts {
        match act.what {
            ActKind::Wait(ms) => {
                line_before = line_before.max(link.now()) + Span::from_millis(u64::from(ms));
                link.run_until(line_before);
            }
            ActKind::Power { drive, on } => {
                let fault = if on { DriveFault::On } else { DriveFault::Off };
                link.inject(ring, PlacedFault::Drive(drive, fault), Moment::Now);
            }
            _ => {
                act.each_part(case.drives, |part| {
                    if !part.is_empty() {
                        line_before = link.send_octets(ring, part);
                    }
                });
            }
        }
    }
    let end = link.now() + MOST_ROUND;
    // The last byte is under way until then at least, so that nothing ends before.
    link.run_until(line_before);
    while link.busy() && link.now() < end && link.wait(end) {}
    let mut received = Vec::with_capacity(USUAL);
    received.extend(std::iter::from_fn(|| link.receive_octet(ring)));
    MasterView {
        received,
        took: link.now().since_start(),
    }
}
