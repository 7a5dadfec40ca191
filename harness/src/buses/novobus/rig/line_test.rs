//! The line test: SYNCO without a gap on a ring, and what comes back (ND21 9.2). It changes nothing in a drive.
//!
//! [`cause`] names the likely cause when a ring does not open. It is a pure function of what the test heard.

use super::health::Unhealthy;
use crate::buses::novobus::locate::locate;
use crate::link::{self, Octets, wait_keeping};
use crate::rig::Rig;
use crate::rig::file::{Endpoint, Hooks, LineFormat, Marks, Transport};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::MAX_DRIVES;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};

/// SYNCO in one pass: long enough that an adapter that holds bytes for 16 ms does not look like another rate.
const SENT: usize = 256;

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
type Pass = Vec<(Instant, Received)>;

/// What the line test heard on one ring.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Bytes that came before anything was sent.
    pub unasked: Vec<Received>,
    /// What came back for [`SENT`] SYNCO, twice.
    pub passes: [Pass; 2],
}

/// The likely cause of a ring that does not open, and what to do next.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Cause {
    /// No byte came back.
    #[error(
        "the ring is open, a drive has no power, or this is another port. Next: check the power of every drive and the cable from drive 0 back to the bench; put the final connector on X4 of a drive in the middle to find the sound half (ND21 8.2)"
    )]
    Nobody,
    /// Zeros come without being asked for.
    #[error(
        "drives with time-out monitoring miss their bytes and send zeros (ND21 9.9), or the transmitter of one drive is defective. Next: `drivebench recover`; if the zeros go on, switch the drives off and on"
    )]
    Babbling,
    /// Bytes that differ each time.
    #[error(
        "noise on the cable, or another master on this line. Next: disconnect every other controller, then check shield, ground and connectors"
    )]
    Noise,
    /// The ring works at another rate.
    #[error(
        "the drives run at {} bit/s. Next: set `line = \"{} 8O1\"` in the rig's file, or set the drives to {} bit/s (ND21 8.3)",
        found.bits_per_second(), found.bits_per_second(), stated.bits_per_second()
    )]
    Rate {
        /// The rate of the drives.
        found: Rate,
        /// The rate in the rig's file.
        stated: Rate,
    },
    /// The bytes are damaged in the same way each time.
    #[error(
        "the drives run at another rate or with another parity. Next: try `line = \"19200 8O1\"` and `line = \"9600 8O1\"` in the rig's file (ND21 8.3)"
    )]
    RateOrParity,
    /// The rig's file is wrong about in-band marks.
    #[error(
        "the other end of the port {}. Next: set `marks = \"{}\"` for this ring in the rig's file",
        match right { Marks::InBand => "sends and expects in-band marks", Marks::None => "knows no in-band marks" },
        match right { Marks::InBand => "in-band", Marks::None => "none" }
    )]
    Marks {
        /// What the file should say.
        right: Marks,
    },
    /// The number of drives in the rig's file is not that of the ring.
    #[error(
        "the rig's file is not about this ring, or a drive was added or taken out. Next: compare `drives = {stated}` with the cabinet; with {found} drives set `drives = {found}`"
    )]
    Count {
        /// How many answer.
        found: u8,
        /// How many the file says.
        stated: u8,
    },
    /// A drive spells out its address and does not leave the error mode.
    #[error(
        "the link in front of drive {0} damages bytes, or drive {0} is defective. Next: check the cable and the connectors in front of drive {0} (ND21 9.7)"
    )]
    LinkInFront(u8),
    /// SYNCO comes back well, and no answer does.
    #[error(
        "SYNCO passes and commands do not: a drive may still be testing itself (ND21 11.8). Next: wait a second and try again; then switch the drives off and on"
    )]
    NoCommands,
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

fn faster(one: Rate, other: Rate) -> Rate {
    if one.bits_per_second() > other.bits_per_second() {
        one
    } else {
        other
    }
}

/// The rate below the stated one whose byte time is nearest to the spacing of a whole pass.
fn slower_in(pass: &Pass, stated: Rate) -> Option<Rate> {
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

/// The likely cause, from what the health check and the line test found.
pub(crate) fn cause(ill: &Unhealthy, heard: &Heard, stated: Rate) -> Cause {
    if !heard.unasked.is_empty() {
        return unasked(&heard.unasked);
    }
    let values = |pass: &Pass| -> Vec<Received> { pass.iter().map(|(_, byte)| *byte).collect() };
    let [first, second] = [values(&heard.passes[0]), values(&heard.passes[1])];
    let clean = |bytes: &[Received]| bytes.len() == SENT && bytes.iter().all(|b| b.is(SYNCO));
    let damaged = |bytes: &[Received]| bytes.iter().filter(|byte| byte.error.is_some()).count();
    if first.is_empty() && second.is_empty() {
        return Cause::Nobody;
    }
    let slow: Vec<_> = heard
        .passes
        .iter()
        .filter_map(|p| slower_in(p, stated))
        .collect();
    if let &[one, other] = slow.as_slice() {
        return Cause::Rate {
            found: faster(one, other),
            stated,
        };
    }
    if let (true, Unhealthy::Size { found, stated }) = (clean(&first) && clean(&second), ill) {
        return Cause::Count {
            found: *found,
            stated: *stated,
        };
    }
    let most = u8::try_from(MAX_DRIVES).unwrap_or(u8::MAX);
    let spelt = [&first, &second].map(|pass| locate(pass, most).map(|location| location.drive));
    if let (&Unhealthy::Broken(drive), _) | (_, [_, Some(drive)]) = (ill, spelt) {
        return Cause::LinkInFront(drive);
    }
    if clean(&first) && clean(&second) {
        return Cause::NoCommands;
    }
    // The same damage each time follows from the bytes, and noise does not.
    let mostly_damaged = 2 * damaged(&first) >= first.len();
    if first == second || (mostly_damaged && 2 * damaged(&second) >= second.len()) {
        Cause::RateOrParity
    } else {
        Cause::Noise
    }
}

/// The likely cause of bytes that come although nothing was sent.
pub(crate) fn unasked(bytes: &[Received]) -> Cause {
    if bytes.iter().all(|byte| byte.is(0)) {
        Cause::Babbling
    } else {
        Cause::Noise
    }
}

/// Rigs that differ from this one in one setting of its line, each with the cause that it proves when it opens. None where power
/// would be switched.
pub(crate) fn neighbours(rig: &Rig) -> Vec<(Cause, Rig)> {
    let Some(first) = rig.file.rings().next().map(|ring| &ring.endpoint) else {
        return Vec::new();
    };
    if rig.is_simulated() || !rig.file.power.is_empty() {
        return Vec::new();
    }
    let with = |change: &dyn Fn(&mut Endpoint)| {
        let mut other = rig.clone();
        // The hooks of the rig have run.
        other.file.hooks = Hooks::default();
        if let Some(rings) = &mut other.file.ring {
            for ring in std::iter::once(&mut rings.first).chain(&mut rings.second) {
                change(&mut ring.endpoint);
            }
        }
        other
    };
    match first.transport {
        Transport::Pty | Transport::Tcp => {
            let right = match first.marks {
                Marks::None => Marks::InBand,
                Marks::InBand => Marks::None,
            };
            vec![(Cause::Marks { right }, with(&|end| end.marks = right))]
        }
        Transport::Serial | Transport::Rfc2217 => [
            LineFormat::Baud38400,
            LineFormat::Baud19200,
            LineFormat::Baud9600,
        ]
        .into_iter()
        .filter(|line| *line != first.line)
        .map(|line| {
            let cause = Cause::Rate {
                found: line.into(),
                stated: first.line.into(),
            };
            (cause, with(&|end| end.line = line))
        })
        .collect(),
        Transport::Sim => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::Entry;
    use crate::scenario::simulate;
    use crate::scenario::source::Source;
    use harness_proto::line::LineError;

    fn source(name: &str, text: String) -> Source {
        Source::from_bytes(name.to_owned(), text.into_bytes()).expect("a text")
    }

    /// A simulated ring of three drives at a rate.
    fn ring(line: &str) -> crate::buses::SimulatedLink {
        let text = format!("title t\nring 3\nline {line}\n> 80\n");
        let entry = Entry::new(source("ring.scn", text), None).expect("a scenario");
        simulate::bench(&entry.plan.expect("a plan"))
    }

    fn pass_of(bytes: impl IntoIterator<Item = Received>) -> Pass {
        let byte_time = Rate::Baud38400.byte_time();
        (1..)
            .zip(bytes)
            .map(|(n, byte)| (Instant::START + byte_time * n, byte))
            .collect()
    }

    fn heard(first: Vec<Received>, second: Vec<Received>) -> Heard {
        Heard {
            unasked: Vec::new(),
            passes: [pass_of(first), pass_of(second)],
        }
    }

    fn named(ill: &Unhealthy, heard: &Heard) -> Cause {
        cause(ill, heard, Rate::Baud38400)
    }

    const FOREIGN: fn() -> Unhealthy = || Unhealthy::Foreign {
        bytes: String::new(),
    };

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
        let heard = listen(&mut link, 0);
        let found = Rate::Baud19200;
        let stated = Rate::Baud38400;
        assert_eq!(named(&FOREIGN(), &heard), Cause::Rate { found, stated });
    }

    #[test]
    fn a_sound_ring_is_not_blamed_for_its_rate_or_for_noise() {
        let heard = listen(&mut ring("38400"), 0);
        assert_eq!(named(&FOREIGN(), &heard), Cause::NoCommands);
        let ill = Unhealthy::Size {
            found: 3,
            stated: 4,
        };
        let (found, stated) = (3, 4);
        assert_eq!(named(&ill, &heard), Cause::Count { found, stated });
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

    #[test]
    fn every_way_not_to_open_has_a_cause() {
        let nothing = heard(Vec::new(), Vec::new());
        assert_eq!(named(&Unhealthy::Silent, &nothing), Cause::Nobody);

        let unasked = |bytes: &[u8]| Heard {
            unasked: bytes.iter().copied().map(Received::good).collect(),
            ..Heard::default()
        };
        assert_eq!(named(&FOREIGN(), &unasked(&[0; 9])), Cause::Babbling);
        assert_eq!(named(&FOREIGN(), &unasked(&[0, 0x55, 0])), Cause::Noise);

        let damaged = |byte: u8| vec![Received::bad(byte, LineError::Framing); SENT / 2];
        let other_rate = heard(damaged(0x78), damaged(0x78));
        assert_eq!(named(&FOREIGN(), &other_rate), Cause::RateOrParity);
        // Without marks the same bytes come back each time, and they are not SYNCO.
        let wrong = |byte: u8| vec![Received::good(byte); SENT / 2];
        let unmarked = heard(wrong(0xE6), wrong(0xE6));
        assert_eq!(named(&FOREIGN(), &unmarked), Cause::RateOrParity);

        let noise = |seed: u8| -> Vec<Received> {
            (0..200u8)
                .map(|n| Received::good(n.wrapping_mul(seed) ^ 0x5A))
                .collect()
        };
        let ill = Unhealthy::Size {
            found: 124,
            stated: 3,
        };
        assert_eq!(named(&ill, &heard(noise(37), noise(91))), Cause::Noise);

        let address = |k: u8| {
            let zeros = std::iter::repeat_n(Received::good(0), 20);
            zeros
                .chain(std::iter::repeat_n(Received::good(k), 100))
                .collect::<Vec<_>>()
        };
        let spelt = heard(address(1), address(1));
        assert_eq!(named(&FOREIGN(), &spelt), Cause::LinkInFront(1));
        assert_eq!(named(&Unhealthy::Broken(2), &spelt), Cause::LinkInFront(2));
    }

    #[test]
    fn neighbours_differ_in_one_setting_and_switch_nothing() {
        let rig = |ring: &str, more: &str| {
            let text =
                format!("schema = 1\n[rig]\nid = \"x\"\n[ring.1]\ndrives = 3\n{ring}\n{more}");
            crate::rig::parse(&source("x.toml", text)).expect("a rig")
        };
        let tcp = "transport = \"tcp\"\nport = \"127.0.0.1:4021\"";
        let found = neighbours(&rig(tcp, "[hooks.before]\ncommand = [\"true\"]\n"));
        let right = Marks::InBand;
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].0, Cause::Marks { right });
        assert_eq!(
            found[0]
                .1
                .file
                .rings()
                .next()
                .map(|ring| ring.endpoint.marks),
            Some(right)
        );
        assert_eq!(found[0].1.file.hooks, Hooks::default());
        let serial = "transport = \"serial\"\nport = \"/dev/ttyUSB0\"\nline = \"19200 8O1\"";
        let lines: Vec<_> = neighbours(&rig(serial, ""))
            .iter()
            .flat_map(|(_, rig)| {
                rig.file
                    .rings()
                    .map(|ring| ring.endpoint.line)
                    .collect::<Vec<_>>()
            })
            .collect();
        assert_eq!(lines, [LineFormat::Baud38400, LineFormat::Baud9600]);
        let power = "[power.main]\non = [\"true\"]\noff = [\"true\"]\n";
        assert!(neighbours(&rig(serial, power)).is_empty());
    }
}
