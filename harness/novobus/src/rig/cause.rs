//! Why a ring does not open: the likely cause and the next step, from what the health check and the line test heard.
//!
//! [`cause`] is a pure function of what was heard.

use super::health::Unhealthy;
use super::line_test::{LineTestBytes, Pass, RingPace, SENT, pace_of};
use crate::locate::locate;
use harness_bench::medium::ErrorMarks;
use harness_bench::rig::Rig;
use harness_bench::rig::file::{Endpoint, Hooks, LineFormat, Ring, Transport};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::MAX_DRIVES;
use harness_proto::novobus::sync::SYNCO;

/// The likely cause of a ring that does not open, and what to do next.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum LikelyCause {
    /// No byte came back.
    #[error(
        "the ring is open, a drive has no power, or this is another port. Next: check the power of every drive and the cable from drive 0 back to the bench; put the final connector on X4 of a drive in the middle to find the sound half (ND21 8.2)"
    )]
    Nobody,
    /// Zeros come without end although nothing is sent.
    #[error(
        "drive 0 sends zeros by itself, because it monitors time-outs and hears nothing on the link in front of it (ND21 9.9) or because its transmitter is defective; or the cable leads to another device. Next: disconnect drive 0 from the bench: if zeros still come, check the port and its adapter; if not, check the link in front of drive 0, then switch the drives off and on"
    )]
    Babbling,
    /// Zeros with line errors come without end although nothing is sent.
    #[error(
        "the line to the bench's receiver is held at 0: its two wires are swapped, open or short, or a device with a much lower rate sends. Next: check the wires between drive 0 and the bench (ND21 8.2), then the rate"
    )]
    HeldLine,
    /// The port receives what it sends.
    #[error(
        "the adapter echoes what it sends (RS-485 with two wires), or a plug joins its transmitter to its receiver. Next: use an adapter with separate pairs for sending and receiving, or switch its echo off, and connect drive 0 to its receiver (ND21 8.2)"
    )]
    OwnBytes,
    /// The other end of the port is gone.
    #[error("{}", gone(*.0))]
    Gone(Transport),
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
    /// The bytes are whole, and as far apart as at another rate: no byte shows that this is the rate of the drives.
    #[error(
        "the drives, or a device server in front of them, run at {} bit/s, or the program at the other end is as slow as that. Next: look at the setting of the drives (ND21 8.3) and of the server; if it is {} bit/s, set `line = \"{} 8O1\"` in the rig's file; if it is not, stop other programs and try again",
        found.bits_per_second(), found.bits_per_second(), found.bits_per_second()
    )]
    AsAtRate {
        /// The rate at which bytes would be as far apart.
        found: Rate,
    },
    /// The bytes are whole and late, at no rate.
    #[error(
        "the computer, the network or the program at the other end is too slow, the adapter collects bytes, or a device server has another rate. Next: stop other programs, set the adapter's latency timer to 1 ms, and compare the rate of a device server with `line`; `time_tolerance` permits single late bytes only"
    )]
    HeldUp,
    /// The bytes are damaged in the same way each time.
    #[error(
        "the drives run at another rate or with another parity. Next: try {} in the rig's file (ND21 8.3)", other_lines(*stated)
    )]
    RateOrParity {
        /// The rate in the rig's file.
        stated: Rate,
    },
    /// As many bytes come back as were sent, and each is damaged.
    #[error(
        "every byte has a parity error: the other end may have another parity. Next: set the device server or the converter at the other end to 8 data bits, odd parity, 1 stop bit, which the drives have (ND21 8.3)"
    )]
    Parity,
    /// The rig's file is wrong about in-band marks.
    #[error(
        "the other end of the port {}. Next: set `marks = \"{}\"` for this ring in the rig's file",
        match right { ErrorMarks::InBand => "sends and expects in-band marks", ErrorMarks::None => "knows no in-band marks" },
        match right { ErrorMarks::InBand => "in-band", ErrorMarks::None => "none" }
    )]
    Marks {
        /// What the file should say.
        right: ErrorMarks,
    },
    /// The number of drives in the rig's file is not that of the ring.
    #[error(
        "the rig's file is not about this ring, a drive was added or taken out, or a drive does not add 1 to the address of a telegram (ND21 9.3). Next: compare `drives = {stated}` with the cabinet; with {found} drives set `drives = {found}`"
    )]
    Count {
        /// How many answer.
        found: u8,
        /// How many the file says.
        stated: u8,
    },
    /// A drive spells out its address and does not leave the error mode.
    #[error(
        "drive {0} receives bytes that are damaged or missing, or is defective. Next: check the cable and the connectors in front of drive {0} (ND21 9.7); if they are sound, exchange drive {0}, and then the drive in front of it"
    )]
    LinkInFront(u8),
    /// A drive and all drives behind it add 1 to each byte.
    #[error(
        "drive {0} stays in the error mode with all drives behind it: each adds 1 to a byte (ND21 9.7), so the check sequence does not reach drive {0} whole, or drive {0} does not know it (ND21 9.8). Next: check the cable and the connectors in front of drive {0}; if they are sound, exchange drive {0}, and then the drive in front of it"
    )]
    StaysInErrorMode(u8),
    /// SYNCO comes back well, and no answer does.
    #[error(
        "SYNCO passes and telegrams do not: a drive may still be testing itself (ND21 11.8), or changes telegrams. Next: wait a second and try again; switch the drives off and on; then put the final connector on X4 of a drive in the middle to find the half that changes them (ND21 8.2)"
    )]
    NoCommands,
}

/// The likely cause, from what the health check and the line test found.
pub(crate) fn cause(
    ill: &Unhealthy,
    heard: &LineTestBytes,
    (drives, stated): (u8, Rate),
) -> LikelyCause {
    if !heard.unasked.is_empty() {
        return unasked(&heard.unasked);
    }
    if let Unhealthy::HearsItself = ill {
        return LikelyCause::OwnBytes;
    }
    let values = |pass: &Pass| -> Vec<Received> { pass.iter().map(|(_, byte)| *byte).collect() };
    let [first, second] = [values(&heard.passes[0]), values(&heard.passes[1])];
    let clean = |bytes: &[Received]| bytes.len() == SENT && bytes.iter().all(|b| b.is(SYNCO));
    let damaged = |bytes: &[Received]| bytes.iter().filter(|byte| byte.error.is_some()).count();
    if first.is_empty() && second.is_empty() {
        return LikelyCause::Nobody;
    }
    let [one, other] = [0, 1].map(|pass: usize| pace_of(&heard.passes[pass], stated));
    let pace = one.or_faster(other, stated);
    // The same damage each time follows from the bytes, and noise does not.
    let mostly_damaged = [&first, &second].map(|bytes| 2 * damaged(bytes) >= bytes.len());
    if let RingPace::Slower(found) = pace {
        return match mostly_damaged {
            [true, true] => LikelyCause::Rate { found, stated },
            _ => LikelyCause::AsAtRate { found },
        };
    }
    if let (true, Unhealthy::Size { found, stated }) = (clean(&first) && clean(&second), ill) {
        return LikelyCause::Count {
            found: *found,
            stated: *stated,
        };
    }
    let most = u8::try_from(MAX_DRIVES).unwrap_or(u8::MAX);
    let spelt = [&first, &second].map(|pass| locate(pass, most).map(|location| location.drive));
    if let (&Unhealthy::Broken(drive), _) | (_, [_, Some(drive)]) = (ill, spelt) {
        return LikelyCause::LinkInFront(drive);
    }
    if let Some(cause) = in_error_mode(&first, drives).filter(|_| first == second) {
        return cause;
    }
    if clean(&first) && clean(&second) {
        if let RingPace::Late(_) = pace {
            return LikelyCause::HeldUp;
        }
        return LikelyCause::NoCommands;
    }
    let all_damaged = |bytes: &[Received]| bytes.len() == SENT && damaged(bytes) == SENT;
    if all_damaged(&first) && all_damaged(&second) {
        LikelyCause::Parity
    } else if first == second || mostly_damaged == [true, true] {
        LikelyCause::RateOrParity { stated }
    } else {
        LikelyCause::Noise
    }
}

/// The lines of the other rates, as a rig's file has them.
fn other_lines(stated: Rate) -> String {
    let rates = [Rate::Baud38400, Rate::Baud19200, Rate::Baud9600];
    let others = rates.iter().filter(|rate| **rate != stated);
    let lines = others.map(|rate| format!("`line = \"{} 8O1\"`", rate.bits_per_second()));
    lines.collect::<Vec<_>>().join(" and ")
}

/// What a ring says that gives the same good byte for each SYNCO: it spells out a drive, or the drives that are in the error mode add 1 each
/// (ND21 9.7).
fn in_error_mode(heard: &[Received], drives: u8) -> Option<LikelyCause> {
    let first = heard.first().filter(|first| first.error.is_none())?;
    let all_alike = heard.len() == SENT && heard.iter().all(|byte| byte == first);
    let added = first.byte.checked_sub(SYNCO);
    match (all_alike, added) {
        (true, None) if first.byte < drives => Some(LikelyCause::LinkInFront(first.byte)),
        (true, Some(added)) if (1..=drives).contains(&added) => {
            Some(LikelyCause::StaysInErrorMode(added - 1))
        }
        _ => None,
    }
}

/// Marks that are missing: SYNCO comes back as 80 plus the number of drives, so that each is in the error mode and adds 1 (ND21 9.7), and no
/// check sequence has ended it (9.8). With in-band marks its FF is a mark.
pub(crate) fn of_marks(ring: &Ring, heard: &LineTestBytes) -> Option<LikelyCause> {
    let can_mark = matches!(ring.endpoint.transport, Transport::Pty | Transport::Tcp);
    let sum = SYNCO.wrapping_add(ring.drives);
    let counts_up = |pass: &Pass| !pass.is_empty() && pass.iter().all(|(_, byte)| byte.is(sum));
    let right = ErrorMarks::InBand;
    let is_mistaken = can_mark && ring.endpoint.marks != right && heard.unasked.is_empty();
    (is_mistaken && heard.passes.iter().all(counts_up)).then_some(LikelyCause::Marks { right })
}

/// The cause of a lost port.
const fn gone(transport: Transport) -> &'static str {
    match transport {
        Transport::Tcp => {
            "the server ended, serves another client, or is no server of raw bytes. Next: check that the server runs and that no other program is connected; compare `port` and `transport` in the rig's file"
        }
        Transport::Rfc2217 => {
            "the server ended, or serves another client. Next: check that the server runs and that no other program is connected"
        }
        Transport::Serial => {
            "the adapter was unplugged or has no power. Next: check its cable; `drivebench rig scan` lists the ports"
        }
        Transport::Pty | Transport::Sim => {
            "the program at the other end of the pseudo terminal ended. Next: start it again"
        }
    }
}

/// The likely cause of bytes that come although nothing was sent.
pub(crate) fn unasked(bytes: &[Received]) -> LikelyCause {
    if bytes.iter().all(|byte| byte.is(0)) {
        LikelyCause::Babbling
    } else if bytes.iter().all(|byte| byte.byte == 0) {
        LikelyCause::HeldLine
    } else {
        LikelyCause::Noise
    }
}

/// Rigs that differ from this one in one setting of its line, each with the cause that it proves when it opens. None where power
/// would be switched.
pub(crate) fn neighbours(rig: &Rig) -> Vec<(LikelyCause, Rig)> {
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
                ErrorMarks::None => ErrorMarks::InBand,
                ErrorMarks::InBand => ErrorMarks::None,
            };
            vec![(LikelyCause::Marks { right }, with(&|end| end.marks = right))]
        }
        Transport::Serial | Transport::Rfc2217 => [
            LineFormat::Baud38400,
            LineFormat::Baud19200,
            LineFormat::Baud9600,
        ]
        .into_iter()
        .filter(|line| *line != first.line)
        .map(|line| {
            let cause = LikelyCause::Rate {
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
    use super::super::line_test::listen;
    use super::super::line_test::tests::ring;
    use super::*;
    use harness_bench::scenario::source::Source;
    use harness_proto::line::LineError;
    use harness_proto::time::{Instant, Span};

    fn source(name: &str, text: String) -> Source {
        Source::from_bytes(name.to_owned(), text.into_bytes()).expect("a text")
    }

    fn pass_of(bytes: impl IntoIterator<Item = Received>) -> Pass {
        let byte_time = Rate::Baud38400.byte_time();
        (1..)
            .zip(bytes)
            .map(|(n, byte)| (Instant::START + byte_time * n, byte))
            .collect()
    }

    fn heard(first: Vec<Received>, second: Vec<Received>) -> LineTestBytes {
        LineTestBytes {
            unasked: Vec::new(),
            passes: [pass_of(first), pass_of(second)],
        }
    }

    fn named(ill: &Unhealthy, heard: &LineTestBytes) -> LikelyCause {
        cause(ill, heard, (3, Rate::Baud38400))
    }

    const FOREIGN: fn() -> Unhealthy = || Unhealthy::Foreign {
        bytes: String::new(),
    };

    #[test]
    fn a_ring_at_another_rate_is_told_its_rate() {
        let mut heard = listen(&mut ring("19200"), 0);
        let found = Rate::Baud19200;
        assert_eq!(named(&FOREIGN(), &heard), LikelyCause::AsAtRate { found });
        // Damaged bytes as far apart show that the rate is another one.
        for (_, byte) in heard.passes.iter_mut().flatten() {
            *byte = Received::bad(0x78, LineError::Framing);
        }
        let stated = Rate::Baud38400;
        assert_eq!(
            named(&FOREIGN(), &heard),
            LikelyCause::Rate { found, stated }
        );
    }

    /// Bytes that come whole and in bursts are no sign of another rate.
    #[test]
    fn a_ring_that_is_held_up_is_told_no_rate() {
        let mut heard = listen(&mut ring("38400"), 0);
        for pass in &mut heard.passes {
            for (n, (at, _)) in (0..).zip(pass) {
                *at += Span::from_millis(8) * (n / 20);
            }
        }
        assert_eq!(named(&FOREIGN(), &heard), LikelyCause::HeldUp);
        let said = LikelyCause::HeldUp.to_string();
        assert!(said.contains("stop other programs"), "{said}");
        assert!(!said.contains("set `line"), "{said}");
        let late = Span::from_millis(50);
        let said = Unhealthy::Late { late }.to_string();
        assert!(said.contains("bytes come back whole and later"), "{said}");
    }

    #[test]
    fn a_sound_ring_is_not_blamed_for_its_rate_or_for_noise() {
        let heard = listen(&mut ring("38400"), 0);
        assert_eq!(named(&FOREIGN(), &heard), LikelyCause::NoCommands);
        let ill = Unhealthy::Size {
            found: 3,
            stated: 4,
        };
        let (found, stated) = (3, 4);
        assert_eq!(named(&ill, &heard), LikelyCause::Count { found, stated });
    }

    #[test]
    fn every_way_not_to_open_has_a_cause() {
        let nothing = heard(Vec::new(), Vec::new());
        assert_eq!(named(&Unhealthy::Silent, &nothing), LikelyCause::Nobody);

        let unasked = |bytes: &[u8]| LineTestBytes {
            unasked: bytes.iter().copied().map(Received::good).collect(),
            ..LineTestBytes::default()
        };
        assert_eq!(named(&FOREIGN(), &unasked(&[0; 9])), LikelyCause::Babbling);
        assert_eq!(
            named(&FOREIGN(), &unasked(&[0, 0x55, 0])),
            LikelyCause::Noise
        );
        let held = LineTestBytes {
            unasked: vec![Received::bad(0, LineError::Framing); 9],
            ..LineTestBytes::default()
        };
        assert_eq!(named(&FOREIGN(), &held), LikelyCause::HeldLine);

        let stated = Rate::Baud38400;
        let even = || vec![Received::bad(0, LineError::Break); SENT];
        assert_eq!(
            named(&FOREIGN(), &heard(even(), even())),
            LikelyCause::Parity
        );

        let damaged = |byte: u8| vec![Received::bad(byte, LineError::Framing); SENT / 2];
        let other_rate = heard(damaged(0x78), damaged(0x78));
        assert_eq!(
            named(&FOREIGN(), &other_rate),
            LikelyCause::RateOrParity { stated }
        );
        // Without marks the same bytes come back each time, and they are not SYNCO.
        let wrong = |byte: u8| vec![Received::good(byte); SENT / 2];
        let unmarked = heard(wrong(0xE6), wrong(0xE6));
        assert_eq!(
            named(&FOREIGN(), &unmarked),
            LikelyCause::RateOrParity { stated }
        );

        let noise = |seed: u8| -> Vec<Received> {
            (0..200u8)
                .map(|n| Received::good(n.wrapping_mul(seed) ^ 0x5A))
                .collect()
        };
        let ill = Unhealthy::Size {
            found: 124,
            stated: 3,
        };
        assert_eq!(
            named(&ill, &heard(noise(37), noise(91))),
            LikelyCause::Noise
        );

        // A check sequence that does not end the error mode: SYNCO comes back as 80 and the number of drives that are in it, or as the
        // address of the first that is.
        let same = |byte: u8| {
            let all = || vec![Received::good(byte); SENT];
            named(&FOREIGN(), &heard(all(), all()))
        };
        assert_eq!(same(0x81), LikelyCause::StaysInErrorMode(0));
        assert_eq!(same(0x83), LikelyCause::StaysInErrorMode(2));
        assert_eq!(same(0x84), LikelyCause::RateOrParity { stated });
        assert_eq!(same(0x02), LikelyCause::LinkInFront(2));
        assert_eq!(same(0x03), LikelyCause::RateOrParity { stated });

        let address = |k: u8| {
            let zeros = std::iter::repeat_n(Received::good(0), 20);
            zeros
                .chain(std::iter::repeat_n(Received::good(k), 100))
                .collect::<Vec<_>>()
        };
        let spelt = heard(address(1), address(1));
        assert_eq!(named(&FOREIGN(), &spelt), LikelyCause::LinkInFront(1));
        assert_eq!(
            named(&Unhealthy::Broken(2), &spelt),
            LikelyCause::LinkInFront(2)
        );
    }

    /// ND21 9.7, 9.8: three drives that no check sequence takes out of the error mode make 83 of SYNCO.
    #[test]
    fn a_ring_that_counts_up_lacks_marks() {
        let of = |port: &str, byte: u8| {
            let text = format!("schema = 1\n[rig]\nid = \"x\"\n[ring.1]\ndrives = 3\n{port}\n");
            let rig = crate::rig::parse(&source("x.toml", text)).expect("a rig");
            let ring = rig.file.rings().next().expect("a ring").clone();
            let pass = || vec![Received::good(byte); SENT];
            of_marks(&ring, &heard(pass(), pass()))
        };
        let tcp = "transport = \"tcp\"\nport = \"127.0.0.1:4021\"";
        let right = ErrorMarks::InBand;
        assert_eq!(of(tcp, 0x83), Some(LikelyCause::Marks { right }));
        assert_eq!(of(tcp, 0x84), None);
        assert_eq!(of(&format!("{tcp}\nmarks = \"in-band\""), 0x83), None);
        let serial = "transport = \"serial\"\nport = \"/dev/ttyUSB0\"";
        assert_eq!(of(serial, 0x83), None);
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
        let right = ErrorMarks::InBand;
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].0, LikelyCause::Marks { right });
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
