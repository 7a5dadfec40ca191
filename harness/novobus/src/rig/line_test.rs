//! The line test: SYNCO without a gap on a ring, and what comes back (ND21 9.2). It changes nothing in a drive.

use crate::driver::{COUNT, unasked};
use harness_bench::link::{self, Octets, wait_keeping};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// SYNCO in one pass: long enough that an adapter that holds bytes for 16 ms does not look like another rate.
pub(super) const SENT: usize = 256;

/// Silence after which a pass has ended: a round of 250 drives at 38400 bit/s takes 72 ms (ND21 8.2).
const PASS_ENDS: Span = Span::from_millis(200);

/// The longest wait for the first byte: a round of 250 drives at 9600 bit/s takes 286 ms.
const FIRST_BYTE: Span = Span::from_millis(500);

/// Passes whose spacing is measured before a ring counts as slower than its file says; the fastest one counts.
const RATE_PASSES: usize = 3;

/// Gaps between the bytes of a pass.
const GAPS: u64 = SENT as u64 - 1;

/// The bytes of a pass at a lower rate are off their places by at most this fraction of the pass.
const UNEVEN: u64 = 16;

/// The longest time for which an adapter holds bytes. A longer gap between two bytes of a pass is the computer's: at 9600 bit/s a byte
/// takes 1.1 ms.
const HELD: Span = Span::from_millis(20);

/// Bytes that came back, with their times.
pub(super) type Pass = Vec<(Instant, Received)>;

/// What the line test heard on one ring.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineTestBytes {
    /// Bytes that came before anything was sent.
    pub unasked: Vec<Received>,
    /// What came back for [`SENT`] SYNCO, twice.
    pub passes: [Pass; 2],
}

/// Listens, and sends SYNCO twice.
pub(crate) fn listen(line: &mut dyn link::Line, ring: usize) -> LineTestBytes {
    let unasked = unasked(line, ring);
    let passes = [pass(line, ring), pass(line, ring)];
    LineTestBytes { unasked, passes }
}

/// The first bytes that come back for SYNCO without a gap.
fn pass(line: &mut dyn link::Line, ring: usize) -> Pass {
    while line.receive_octet(ring).is_some() {}
    let sent = line.send_octets(ring, &[SYNCO; SENT]);
    let mut end = sent + FIRST_BYTE;
    let mut heard = Pass::new();
    while heard.len() < SENT && line.now() < end && line.trouble().is_none() {
        wait_keeping(line, end);
        heard.extend(std::iter::from_fn(|| line.receive_octet(ring)));
        if let Some((last, _)) = heard.last() {
            end = (*last).max(sent) + PASS_ENDS;
        }
    }
    heard.truncate(SENT);
    heard
}

/// Sends telegrams and returns the bytes that come back for them within `patience`. SYNCO in front of them was sent before.
pub(crate) fn answers(
    line: &mut dyn link::Line,
    ring: usize,
    telegrams: &[u8],
    patience: Span,
) -> Pass {
    while line.receive_octet(ring).is_some() {}
    let end = line.send_octets(ring, telegrams) + patience;
    let mut heard = Pass::new();
    while heard.len() < telegrams.len() && line.now() < end && line.trouble().is_none() {
        wait_keeping(line, end);
        let none = heard.is_empty();
        let bytes = std::iter::from_fn(|| line.receive_octet(ring));
        heard.extend(bytes.skip_while(|(_, byte)| none && byte.is(SYNCO)));
    }
    heard.truncate(telegrams.len());
    heard
}

/// Whether a telegram to no drive comes back with the address that was sent: no drive has counted it up (ND21 9.3), so the port hears
/// what it sends itself.
pub(crate) fn hears_itself(line: &mut dyn link::Line, ring: usize) -> bool {
    let heard = answers(line, ring, &COUNT, FIRST_BYTE);
    heard.len() == COUNT.len()
        && heard
            .iter()
            .zip(COUNT)
            .all(|((_, byte), counted)| byte.is(counted))
}

/// A telegram to no drive with a net byte FF (ND21 9.3), which in-band marks double.
const WITH_FF: [u8; 5] = [0x82, 0x00, 0xFF, SYNCO, SYNCO];

/// Whether a ring behind a port with in-band marks answers as one that knows none: it sees FF FF in place of the net byte FF, and the
/// second one is no sync byte (ND21 9.2). Its FF and the first zero of its error mode then look like a damaged byte.
pub(crate) fn lacks_marks(line: &mut dyn link::Line, ring: usize) -> bool {
    let heard = answers(line, ring, &WITH_FF, FIRST_BYTE);
    matches!(heard[..], [(_, sync), (_, address), (_, damaged), ..]
        if sync.is(WITH_FF[0]) && address.error.is_none() && damaged.byte == 0 && damaged.error.is_some())
}

/// How fast the bytes of a pass came back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RingPace {
    /// As fast as they were sent; or not all of them came back, which says nothing of the rate.
    AsSent,
    /// Evenly, at a lower rate.
    Slower(Rate),
    /// Whole, and evenly at no rate: something on the way holds bytes up. The last byte was late by this much.
    Late(Span),
}

/// The pace of a ring. The fastest of three passes counts, so that a computer that is late often does not look like a slow ring.
pub(crate) fn pace(line: &mut dyn link::Line, ring: usize, stated: Rate) -> RingPace {
    let mut fastest = RingPace::AsSent;
    for number in 0..RATE_PASSES {
        let found = pace_of(&pass(line, ring), stated);
        fastest = match number {
            0 => found,
            _ => fastest.or_faster(found, stated),
        };
        if fastest == RingPace::AsSent {
            break;
        }
    }
    fastest
}

impl RingPace {
    /// The faster one of two passes. A pass at a rate counts as fast as one that is a little faster.
    pub(super) fn or_faster(self, other: Self, stated: Rate) -> Self {
        let late = |pace: Self| match pace {
            Self::AsSent => 0,
            Self::Slower(rate) => {
                let late = rate.byte_time().units() - stated.byte_time().units();
                late * GAPS - rate.byte_time().units() * GAPS / UNEVEN
            }
            Self::Late(late) => late.units(),
        };
        if late(other) < late(self) {
            other
        } else {
            self
        }
    }
}

/// The pace of one pass. At a lower rate each byte is near its place in a row of such bytes. Lateness has another slope, or steps.
pub(super) fn pace_of(pass: &Pass, stated: Rate) -> RingPace {
    if pass.len() < SENT {
        return RingPace::AsSent;
    }
    let byte_time = stated.byte_time().units();
    let gaps = pass.windows(2).map(|pair| pair[1].0.since(pair[0].0));
    let gaps: Vec<u64> = gaps
        .map(|gap| if gap > HELD { byte_time } else { gap.units() })
        .collect();
    let took: u64 = gaps.iter().sum();
    // Half as long again: nearer to half the rate than to the stated one.
    if took < byte_time * GAPS * 3 / 2 {
        return RingPace::AsSent;
    }
    let even = |rate: &Rate| {
        let byte = rate.byte_time().units();
        let (mut came, mut early, mut late) = (0, 0, 0);
        for (n, gap) in (1..).zip(&gaps) {
            came += gap;
            early = early.max((byte * n).saturating_sub(came));
            late = late.max(u64::saturating_sub(came, byte * n));
        }
        early + late <= byte * GAPS / UNEVEN
    };
    let slower = |rate: &Rate| rate.bits_per_second() < stated.bits_per_second();
    let rate = Rate::ALL.into_iter().filter(slower).find(|rate| even(rate));
    rate.map_or_else(
        || RingPace::Late(Span::from_units(took - byte_time * GAPS)),
        RingPace::Slower,
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::language::read::RingScenario;
    use crate::simulate;
    use harness_bench::scenario::source::Source;

    fn source(name: &str, text: String) -> Source {
        Source::from_bytes(name.to_owned(), text.into_bytes()).expect("a text")
    }

    /// A simulated ring of three drives at a rate.
    pub(in super::super) fn ring(line: &str) -> crate::link::SimulatedLink {
        let text = format!("title t\nring 3\nline {line}\n> 80\n");
        let entry = RingScenario::new(source("ring.scn", text), None).expect("a scenario");
        simulate::bench(&entry.plan)
    }

    #[test]
    fn a_slow_ring_is_found_by_the_spacing_of_its_bytes() {
        for (line, found) in [
            ("38400", RingPace::AsSent),
            ("19200", RingPace::Slower(Rate::Baud19200)),
            ("9600", RingPace::Slower(Rate::Baud9600)),
        ] {
            let mut link = ring(line);
            assert_eq!(pace(&mut link, 0, Rate::Baud38400), found, "{line}");
        }
        let mut link = ring("19200");
        assert_eq!(pace(&mut link, 0, Rate::Baud19200), RingPace::AsSent);
    }

    /// A pass with gaps of this length, in microseconds.
    fn pass_of(gap: impl Fn(u64) -> u64) -> Pass {
        let mut at = Instant::START;
        let bytes = (0..SENT as u64).map(|n| {
            at += Span::from_nanos(gap(n) * 1_000);
            (at, Received::good(SYNCO))
        });
        bytes.collect()
    }

    /// A rate is named where each byte takes longer, and not where bytes are only late: by a third, by two thirds, or in bursts that come to
    /// half the rate.
    #[test]
    fn late_bytes_are_no_other_rate() {
        let stated = Rate::Baud38400;
        let found = |gap: &dyn Fn(u64) -> u64| pace_of(&pass_of(gap), stated);
        let half = RingPace::Slower(Rate::Baud19200);
        assert_eq!(found(&|_| 286), RingPace::AsSent);
        assert_eq!(found(&|_| 573), half);
        assert_eq!(
            found(&|n| if n.is_multiple_of(2) { 540 } else { 606 }),
            half
        );
        // A server that collects bytes for some milliseconds.
        let collected = |n: u64| if n.is_multiple_of(8) { 8 * 573 } else { 0 };
        assert_eq!(found(&collected), half);
        assert_eq!(found(&|_| 1_146), RingPace::Slower(Rate::Baud9600));
        assert_eq!(found(&|_| 286 * 13 / 10), RingPace::AsSent);
        assert!(
            matches!(found(&|_| 286 * 17 / 10), RingPace::Late(late) if late > Span::from_millis(50))
        );
        let bursts = |n: u64| {
            if n.is_multiple_of(40) {
                40 * 573 - 39 * 286
            } else {
                286
            }
        };
        assert!(matches!(found(&bursts), RingPace::Late(_)));
        let stalls = |n: u64| if n.is_multiple_of(32) { 18_000 } else { 286 };
        assert!(matches!(found(&stalls), RingPace::Late(_)));
    }

    #[test]
    fn one_stalled_pass_is_not_a_slow_ring() {
        let stated = Rate::Baud38400;
        let half = RingPace::Slower(Rate::Baud19200);
        let late = |ms| RingPace::Late(Span::from_millis(ms));
        for (one, other, faster) in [
            (half, RingPace::AsSent, RingPace::AsSent),
            (RingPace::Slower(Rate::Baud9600), half, half),
            // A pass at half the rate with a stall, and one that was faster than half the rate.
            (late(90), half, half),
            (late(75), half, half),
            (late(50), half, late(50)),
        ] {
            assert_eq!(one.or_faster(other, stated), faster);
            assert_eq!(other.or_faster(one, stated), faster);
        }
        // A pass that is not whole says nothing of the rate.
        let part = pass_of(|_| 573)[..SENT - 1].to_vec();
        assert_eq!(pace_of(&part, stated), RingPace::AsSent);
    }
}
