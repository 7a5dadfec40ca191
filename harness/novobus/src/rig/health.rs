//! Checks whether a ring is healthy and has the size given in the rig's file.

use super::line_test;
use crate::driver::{Recovery, SpelledOut, count_behind, recover_up_to, unasked};
use harness_bench::counted::counted;
use harness_bench::link::{Link, Octets, Trouble, wait_keeping};
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::Span;
use std::fmt::Write as _;

/// Maximum number of unexpected bytes shown.
const SHOWN: usize = 8;

/// How long bytes are waited for that an attempt has not received, so that the next one does not take them for its own. A busy computer
/// can hold them back for longer than a ring does.
pub(super) const LATEST: Span = Span::from_millis(250);

/// How long a line is listened to where nothing more came, beside the time for which it was waited before.
const STANDSTILL: Span = Span::from_millis(1_500);

/// What is wrong with a ring.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unhealthy {
    /// Bytes come although the bench sends nothing.
    #[error("{} came although nothing was sent ({bytes})", counted(*.count, "byte"))]
    Talking {
        count: usize,
        /// The first of them.
        bytes: String,
    },
    /// Bytes come back slower than they are sent.
    #[error(
        "bytes come back whole and at the pace of {found} bit/s, they are sent at {stated} bit/s"
    )]
    Slow {
        /// The rate at which they come back, in bit/s.
        found: u32,
        /// The rate of the rig's file, in bit/s.
        stated: u32,
    },
    /// Bytes come back whole and late.
    #[error(
        "bytes come back whole and later than they are sent, at no rate of the line (ND21 8.3): the last one of 256 by {late}"
    )]
    Late {
        /// How late the last byte of a row was.
        late: Span,
    },
    /// Nothing comes back.
    #[error("nothing comes back for the bytes that were sent")]
    Silent,
    /// The bytes that come back are not the answer of a ring.
    #[error("the bytes that come back are not those of a ring: {bytes}")]
    Foreign {
        /// The first bytes.
        bytes: String,
    },
    /// What is sent comes back, and no drive has counted an address up.
    #[error(
        "every byte comes back as it was sent, and no drive counts the address of a telegram up (ND21 9.3)"
    )]
    HearsItself,
    /// A drive still spells out its address after the check sequence.
    #[error(
        "the ring does not leave the error mode: drive {0} reports a fault in front of it (ND21 9.7)"
    )]
    Broken(u8),
    /// Another number of drives.
    #[error("the ring has {}, the rig's file says {stated}", counted(*.found, "drive"))]
    Size {
        /// How many answered.
        found: u8,
        /// How many the file says.
        stated: u8,
    },
    /// The link.
    #[error("{0}")]
    Trouble(Trouble),
}

/// What a healthy ring showed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RingHealth {
    /// How many drives each ring has.
    pub rings: Vec<RingSize>,
    /// Drives that reported a fault before the ring was brought back: ring and drive.
    pub reported: Vec<(usize, SpelledOut)>,
}

/// Recovers every ring (9.8), counts its drives and compares the number with the rig's file.
///
/// # Errors
/// The first unhealthy ring, and what is wrong with it.
pub(crate) fn examine(
    link: &mut dyn Link,
    rings: &[RingSize],
    attempts: u8,
) -> Result<RingHealth, (usize, Unhealthy)> {
    let mut health = RingHealth {
        rings: rings.to_vec(),
        reported: Vec::new(),
    };
    link.begin();
    for (ring, size) in rings.iter().enumerate() {
        let mut left = attempts.max(1);
        loop {
            // Behind it commands pass the guard.
            let sent = link.send_octets(ring, &CHECK_SEQUENCE);
            while link.now() < sent && wait_keeping(link, sent) {}
            match examine_once(link, ring, *size) {
                Ok(recovery) => {
                    let fault = recovery.fault().map(|spelled| (ring, spelled));
                    health.reported.extend(fault);
                    break;
                }
                Err(ill) => {
                    left -= 1;
                    if left == 0 || link.trouble().is_some() {
                        return Err((ring, ill));
                    }
                    if link.time_tolerance() > Span::ZERO {
                        outlast_standstill(link, rings.len());
                    }
                }
            }
        }
    }
    link.begin();
    Ok(health)
}

/// Receives what still comes: an adapter or a computer that stands still for up to two seconds loses nothing, and is then not taken for a
/// drive that has not answered.
pub(super) fn outlast_standstill(link: &mut dyn Link, rings: usize) {
    let end = link.now() + STANDSTILL;
    let mut until = end;
    while link.now() < until && link.trouble().is_none() && wait_keeping(link, until) {
        for ring in 0..rings {
            while link.receive(ring).is_some() {
                until = end.min(link.now() + LATEST);
            }
        }
    }
}

fn examine_once(link: &mut dyn Link, ring: usize, stated: RingSize) -> Result<Recovery, Unhealthy> {
    let recovery = recover_up_to(link, ring, stated.drives().into());
    if let Some(trouble) = link.trouble() {
        return Err(Unhealthy::Trouble(trouble.clone()));
    }
    match recovery.drives {
        Some(found) if found == stated => Ok(recovery),
        // Noise can look like an answer once, and not twice.
        Some(found) if count_behind(link, ring, &[]) == Some(found) => Err(Unhealthy::Size {
            found: found.drives(),
            stated: stated.drives(),
        }),
        _ => Err(ill(link, ring, stated, &recovery)),
    }
}

/// What is wrong with a ring that cannot be counted.
fn ill(link: &mut dyn Link, ring: usize, stated: RingSize, recovery: &Recovery) -> Unhealthy {
    let found = match recovery.after {
        Some(drive) => Unhealthy::Broken(drive),
        None => {
            let talk = unasked(link, ring);
            let bytes = link.probe(ring, &vec![SYNCO; 4 * usize::from(stated.drives()) + 8]);
            if !talk.is_empty() {
                Unhealthy::talking(&talk)
            } else if bytes.is_empty() {
                Unhealthy::Silent
            } else if line_test::hears_itself(link, ring) {
                Unhealthy::HearsItself
            } else {
                Unhealthy::Foreign {
                    bytes: shown(&bytes),
                }
            }
        }
    };
    let trouble = link.trouble().cloned();
    trouble.map_or(found, Unhealthy::Trouble)
}

/// Whether unasked bytes are those of drives that have missed their master (ND21 9.9): zeros, and then addresses that climb up to that of
/// the drive behind the silence. The last bytes of a conversation may stand in front of them.
pub(crate) fn sounds_timed_out(heard: &[Received], ring: Option<RingSize>) -> bool {
    let address = |received: &Received| {
        received.error.is_none() && ring.is_some_and(|size| received.byte < size.drives())
    };
    let spelled: Vec<u8> = heard
        .rsplit(|received| !address(received))
        .next()
        .map_or(Vec::new(), |tail| {
            tail.iter().map(|received| received.byte).collect()
        });
    // Another master sends sync bytes all the time.
    2 * spelled.len() > heard.len() && spelled.is_sorted()
}

impl Unhealthy {
    pub(crate) fn talking(bytes: &[Received]) -> Self {
        Self::Talking {
            count: bytes.len(),
            bytes: shown(bytes),
        }
    }
}

fn shown(bytes: &[Received]) -> String {
    let mut text = String::new();
    for byte in bytes.iter().take(SHOWN) {
        // Writing to a String cannot fail.
        let _infallible = write!(text, "{:02X} ", byte.byte);
    }
    if bytes.len() > SHOWN {
        text.push_str("...");
    }
    text.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::line_test::RingPace;
    use super::*;
    use crate::driver::{OpenRings, Options, SpellingCause, recover};
    use crate::gate::guard_rings;
    use crate::language::read::RingScenario;
    use crate::link::BesideTheBus as _;
    use crate::link::SimulatedLink;
    use crate::simulate;
    use harness_bench::link::{Line, LinkFault, Moment, PlacedFault};
    use harness_bench::medium::{HeardPiece, Medium, Out};
    use harness_bench::scenario::source::Source;
    use harness_proto::line::Rate;
    use harness_proto::novobus::guard::Limits;
    use harness_proto::novobus::sync::SYNCO;
    use harness_proto::time::Instant;

    /// A ring some of whose drives monitor time-outs from power-up (ND21 14.3.6). Its self-tests are over.
    fn monitoring(drives: u8, monitor: &str) -> SimulatedLink {
        let text = format!("title t\nring {drives}\ndrive {monitor} eeprom 47 = 80\n> 80\n");
        let source = Source::from_bytes("ring.scn".to_owned(), text.into_bytes()).expect("a text");
        let entry = RingScenario::new(source, None).expect("a scenario");
        let mut link = simulate::bench(&entry.plan);
        link.run_until(link.now() + Span::from_millis(300));
        link
    }

    /// ND21 9.2, 9.9: from the check sequence on a drive that monitors time-outs hears no gap, also where a round takes longer than the
    /// 10 ms of silence that it allows.
    #[test]
    fn opening_leaves_no_gap_for_drives_that_monitor() {
        for drives in [3, 60] {
            let size = RingSize::new(drives.into()).expect("a size");
            let mut link = monitoring(drives, "0..last");
            link.send_octets(0, &[SYNCO]);
            link.run_until(link.now() + Span::from_millis(300));
            let mut link = guard_rings(link, Limits::default());
            link.keep_lines();
            assert!(matches!(link.error_of(0, drives - 1), Some(Some(_))));
            let health = examine(&mut link, &[size], 1).expect("a healthy ring");
            assert_eq!(health.reported, []);
            assert_eq!(
                line_test::pace(&mut link, 0, Rate::Baud38400),
                RingPace::AsSent
            );
            assert!(!line_test::lacks_marks(&mut link, 0));
            let recovery = recover(&mut link, 0);
            assert_eq!((recovery.before, recovery.drives), (None, Some(size)));
            let bus =
                OpenRings::open(Box::new(&mut link), &[size], Options::default()).expect("a bus");
            assert_eq!((drives, bus.counters()[0].disturbed), (drives, 0));
        }
    }

    /// ND21 9.9: the first drive behind the master that monitors time-outs names itself when no master sends. That is no fault of a link.
    #[test]
    fn a_drive_that_missed_its_master_blames_no_link() {
        let size = RingSize::new(3).expect("a size");
        for (monitor, drive) in [("0..last", 2), ("1", 1), ("0..1", 1)] {
            let recovery = recover(&mut monitoring(3, monitor), 0);
            let why = SpellingCause::MissedMaster;
            assert_eq!(
                recovery.before,
                Some(SpelledOut { drive, why }),
                "{monitor}"
            );
            assert_eq!((recovery.fault(), recovery.drives), (None, Some(size)));
        }
        // A damaged byte in front of a drive is one, if the drive does not monitor. If it is not the first that does, it may be one.
        for (monitor, drive, why) in [
            ("0..last", 1, SpellingCause::FaultOrSilence),
            ("0", 1, SpellingCause::Fault),
            ("0", 2, SpellingCause::Fault),
        ] {
            let mut link = guard_rings(monitoring(3, monitor), Limits::unlimited());
            link.keep_lines();
            let _health = examine(&mut link, &[size], 1).expect("a healthy ring");
            let fault = PlacedFault::Link(usize::from(2 - drive), LinkFault::Replace(0x11));
            link.inject(0, fault, Moment::Now);
            link.send_octets(0, &[SYNCO]);
            let recovery = recover(&mut link, 0);
            assert_eq!(
                recovery.fault(),
                Some(SpelledOut { drive, why }),
                "{monitor}"
            );
            assert_eq!(recovery.drives, Some(size));
        }
    }

    /// A computer that stands still in front of one of its sends.
    struct Late {
        link: SimulatedLink,
        sends: usize,
    }

    impl Line for Late {
        fn medium(&self, port: usize) -> Medium {
            self.link.medium(port)
        }

        fn now(&self) -> Instant {
            self.link.now()
        }

        fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
            if self.sends == 0 {
                self.link
                    .run_until(self.link.now() + Span::from_millis(300));
            }
            self.sends = self.sends.wrapping_sub(1);
            self.link.send(ring, what)
        }

        fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
            self.link.receive(ring)
        }

        fn wait(&mut self, until: Instant) -> bool {
            self.link.wait(until)
        }
    }

    /// ND21 9.8, 9.9: drives that time out again while they are asked whether they monitor answer behind as many sequences as the ring needs.
    #[test]
    fn drives_that_time_out_again_have_missed_their_master() {
        for drives in [5, 12, 30] {
            let link = monitoring(drives, "0..last");
            // In front of the first question.
            let recovery = recover(&mut Late { link, sends: 2 }, 0);
            let why = recovery.before.map(|spelled| spelled.why);
            assert_eq!(why, Some(SpellingCause::MissedMaster), "{drives}");
        }
    }

    /// ND21 9.9: a ring of three behind a silence sends 00, then 02 for ever; another master sends anything.
    #[test]
    fn drives_that_timed_out_are_no_other_master() {
        let heard = |bytes: &[u8]| {
            let bytes: Vec<_> = bytes.iter().map(|byte| Received::good(*byte)).collect();
            sounds_timed_out(&bytes, RingSize::new(3).ok())
        };
        assert!(heard(&[0, 0, 0, 2, 2, 2]) && heard(&[2, 2]) && heard(&[0, 0]));
        // The figure of 9.9, also behind a conversation that was broken off.
        assert!(heard(&[0, 0, 1, 2, 2]) && heard(&[0x80, 0x80, 0, 0, 1, 2, 2, 2]));
        assert!(!heard(&[]) && !heard(&[3, 3]) && !heard(&[2, 2, 0]));
        assert!(!heard(&[0x88, 0xFF, 0xC0]) && !heard(&[0x80, 0x80]));
    }
}
