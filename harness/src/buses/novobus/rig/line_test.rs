//! The line test: SYNCO without a gap on a ring, and what comes back (ND21 9.2). It changes nothing in a drive.

use crate::link::{self, Octets, wait_keeping};
use crate::rig::file::LineFormat;
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// SYNCO in one pass: long enough that an adapter that holds bytes for 16 ms does not look like another rate.
pub(super) const SENT: usize = 256;

/// How long the test listens before it sends.
const LISTEN: Span = Span::from_millis(100);

/// For how long bytes that were sent before may still come, also from a ring at a quarter of the rate.
const REST: Span = Span::from_millis(1_000);

/// Silence after which a pass has ended: a round of 250 drives at 38400 bit/s takes 72 ms (ND21 8.2).
const PASS_ENDS: Span = Span::from_millis(200);

/// The longest wait for the first byte: a round of 250 drives at 9600 bit/s takes 286 ms.
const FIRST_BYTE: Span = Span::from_millis(500);

/// Passes whose spacing is measured before a ring counts as slower than its file says; the fastest one counts.
const RATE_PASSES: usize = 3;

/// The longest time for which an adapter holds bytes. A longer gap between two bytes of a pass is the computer's: at 9600 bit/s a byte
/// takes 1.1 ms.
const HELD: Span = Span::from_millis(20);

/// Bytes that came back, with their times.
pub(super) type Pass = Vec<(Instant, Received)>;

/// What the line test heard on one ring.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Bytes that came before anything was sent.
    pub unasked: Vec<Received>,
    /// What came back for [`SENT`] SYNCO, twice.
    pub passes: [Pass; 2],
}

impl From<LineFormat> for Rate {
    fn from(line: LineFormat) -> Self {
        match line {
            LineFormat::Baud38400 => Self::Baud38400,
            LineFormat::Baud19200 => Self::Baud19200,
            LineFormat::Baud9600 => Self::Baud9600,
        }
    }
}

/// Listens, and sends SYNCO twice.
pub(crate) fn listen(line: &mut dyn link::Line, ring: usize) -> Heard {
    let unasked = babble(line, ring);
    let passes = [pass(line, ring), pass(line, ring)];
    Heard { unasked, passes }
}

/// Bytes that come for [`REST`] although nothing is sent. Bytes that stop were sent before.
fn babble(line: &mut dyn link::Line, ring: usize) -> Vec<Received> {
    let rest = line.now() + REST;
    loop {
        let end = line.now() + LISTEN;
        let mut heard = Vec::new();
        while line.now() < end && line.trouble().is_none() {
            line.wait(end);
            heard.extend(std::iter::from_fn(|| line.receive_octet(ring)).map(|(_, byte)| byte));
        }
        if heard.is_empty() || line.now() >= rest || line.trouble().is_some() {
            return heard;
        }
    }
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

/// A telegram to no drive with a net byte FF (ND21 9.3), which in-band marks double.
const WITH_FF: [u8; 5] = [0x82, 0x00, 0xFF, SYNCO, SYNCO];

/// Whether a ring behind a port with in-band marks answers as one that knows none: it sees FF FF in place of the net byte FF, and the
/// second one is no sync byte (ND21 9.2). Its FF and the first zero of its error mode then look like a damaged byte.
pub(crate) fn lacks_marks(line: &mut dyn link::Line, ring: usize) -> bool {
    let heard = answers(line, ring, &WITH_FF, FIRST_BYTE);
    matches!(heard[..], [(_, sync), (_, address), (_, damaged), ..]
        if sync.is(WITH_FF[0]) && address.error.is_none() && damaged.byte == 0 && damaged.error.is_some())
}

/// The rate of a ring whose bytes come back slower than they were sent; `None` if they do not. The fastest of three passes counts, so
/// that a computer that is late often does not look like a slow ring.
pub(crate) fn slower(line: &mut dyn link::Line, ring: usize, stated: Rate) -> Option<Rate> {
    (0..RATE_PASSES)
        .map(|_| slower_in(&pass(line, ring), stated))
        .try_fold(None, |least: Option<Rate>, found| {
            let found = found?;
            Some(Some(least.map_or(found, |least| faster(least, found))))
        })
        .flatten()
}

pub(super) fn faster(one: Rate, other: Rate) -> Rate {
    if one.bits_per_second() > other.bits_per_second() {
        one
    } else {
        other
    }
}

/// The rate below the stated one whose byte time is nearest to the spacing of a whole pass.
pub(super) fn slower_in(pass: &Pass, stated: Rate) -> Option<Rate> {
    if pass.len() < SENT {
        return None;
    }
    let gaps = pass.windows(2).map(|own| own[1].0.since(own[0].0));
    let slow = gaps.map(|gap| match gap > HELD {
        true => stated.byte_time().units(),
        false => gap.units(),
    });
    let spacing = slow.sum::<u64>() / (pass.len() as u64 - 1);
    let apart = |rate: &Rate| rate.byte_time().units().abs_diff(spacing);
    // Half as long again: nearer to half the rate than to the stated one.
    if spacing < stated.byte_time().units() * 3 / 2 {
        return None;
    }
    let slower = |rate: &Rate| rate.bits_per_second() < stated.bits_per_second();
    Rate::ALL.into_iter().filter(slower).min_by_key(apart)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::library::Entry;
    use crate::scenario::simulate;
    use crate::scenario::source::Source;

    fn source(name: &str, text: String) -> Source {
        Source::from_bytes(name.to_owned(), text.into_bytes()).expect("a text")
    }

    /// A simulated ring of three drives at a rate.
    pub(in super::super) fn ring(line: &str) -> crate::buses::SimulatedLink {
        let text = format!("title t\nring 3\nline {line}\n> 80\n");
        let entry = Entry::new(source("ring.scn", text), None).expect("a scenario");
        simulate::bench(&entry.plan.expect("a plan"))
    }

    #[test]
    fn a_slow_ring_is_found_by_the_spacing_of_its_bytes() {
        for (line, found) in [
            ("38400", None),
            ("19200", Some(Rate::Baud19200)),
            ("9600", Some(Rate::Baud9600)),
        ] {
            let mut link = ring(line);
            assert_eq!(slower(&mut link, 0, Rate::Baud38400), found, "{line}");
        }
        let mut link = ring("19200");
        assert_eq!(slower(&mut link, 0, Rate::Baud19200), None);
    }

    #[test]
    fn one_stalled_pass_is_not_a_slow_ring() {
        let slow = |rate: Rate| -> Pass {
            let pass = (1..=SENT as u64)
                .map(|n| (Instant::START + rate.byte_time() * n, Received::good(SYNCO)));
            pass.collect()
        };
        let stated = Rate::Baud38400;
        assert_eq!(slower_in(&slow(stated), stated), None);
        assert_eq!(
            slower_in(&slow(Rate::Baud19200), stated),
            Some(Rate::Baud19200)
        );
        // A pass that is not whole says nothing of the rate.
        let part = slow(Rate::Baud19200)[..SENT - 1].to_vec();
        assert_eq!(slower_in(&part, stated), None);
    }
}
