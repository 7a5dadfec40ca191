//! Verdicts of attempts on a port whose bytes come late or early, or unasked.

use super::tests::{READ, judged_early, judged_on, judged_with, link, plan};
use crate::link::SimulatedLink;
use crate::qualify::{Meant, Sighting};
use crate::rig::run::Way;
use harness_bench::link::{Capability, Lead, Line, Link, Moment, Octets, PlacedFault};
use harness_bench::medium::{self, Medium, Out};
use harness_bench::scenario::verdict::Verdict;
use harness_bench::scenario::verdict::Verdict::{Failed, Inconclusive, Marginal, Passed};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::cell::Cell;
use std::collections::VecDeque;

/// A port whose bytes come late from the tenth on: the link gives them up before, as one behind a computer that stands still.
struct LatePort {
    link: SimulatedLink,
    late: Span,
    /// Whether the bench looks for them.
    looks: bool,
    /// Bytes held back, and how many have come.
    held: VecDeque<(Instant, Received)>,
    came: usize,
    free: Instant,
}

impl LatePort {
    /// How long the link waits for a byte.
    const GIVES_UP: Span = Span::from_millis(40);

    fn fetch(&mut self) {
        while let Some((at, byte)) = self.link.receive_octet(0) {
            self.came += 1;
            let late = if self.came < 10 {
                Span::ZERO
            } else {
                self.late
            };
            self.held.push_back((at + late, byte));
        }
    }
}

impl Line for LatePort {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        self.free = self.link.send(ring, what);
        self.free
    }

    fn receive(&mut self, _: usize) -> Option<(Instant, medium::HeardPiece)> {
        self.fetch();
        let now = self.now();
        let (at, _) = self.held.front()?;
        let (at, byte) = (*at <= now).then(|| self.held.pop_front()).flatten()?;
        Some((at, medium::HeardPiece::Octet(byte)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let end = (self.now() + self.byte_time()).min(until);
        while self.link.now() < end {
            self.link.wait(end);
        }
        self.fetch();
        true
    }

    fn lead(&self) -> Lead {
        Lead {
            far: Span::from_millis(16),
            near: Span::ZERO,
        }
    }
}

impl Link for LatePort {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }

    fn begin(&mut self) {
        self.link.begin();
        self.held.clear();
        (self.came, self.free) = (0, Instant::START);
    }

    fn busy(&self) -> bool {
        let open = self.link.busy() || !self.held.is_empty();
        open && self.now() < self.free + Self::GIVES_UP
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(ring, fault, moment);
    }

    fn time_tolerance(&self) -> Span {
        Span::from_millis(3)
    }

    fn unwatched_since(&self) -> Option<Instant> {
        (!self.looks).then_some(Instant::START)
    }

    fn probe(&mut self, ring: usize, bytes: &[u8]) -> Vec<Received> {
        self.link.probe(ring, bytes)
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

/// A byte that comes after the link has given it up was late, and settles nothing. One that never comes is lost: the drive's fault.
#[test]
fn late_bytes_fail_no_drive() {
    const SCENARIO: &str = "> 80*4\n< 80*4\nrecover\n> 80*4\n< 80*4\n";
    let judged = |looks: bool, late: u64, scenario: &str| {
        let plan = plan(format!("title x\nring 3\nstrict\n{scenario}"));
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: false,
        };
        let mut link = LatePort {
            link: link(""),
            late: Span::from_millis(late),
            looks,
            held: VecDeque::new(),
            came: 0,
            free: Instant::START,
        };
        judged_on(&mut link, "", (&plan, &way), &|_, _| {})
    };
    let asked = format!("{READ}< 88 01 C0 13 xx xx\n{READ}< 88 01 C0 13 xx xx\n");
    // A line waits longer for its bytes than a recovery does.
    for (scenario, late, wanted) in [
        (SCENARIO, 100, Inconclusive),
        (SCENARIO, 900, Inconclusive),
        (&asked, 100, Marginal),
        (&asked, 900, Marginal),
        (&asked, 1_500, Inconclusive),
        (&asked, 2_300, Inconclusive),
    ] {
        for looks in [true, false] {
            assert_eq!(judged(looks, 0, scenario).verdict, Passed);
            let outcome = judged(looks, late, scenario);
            // It came at a time at which the bench did not look, and may have been in time.
            let wanted = match wanted {
                Marginal if !looks => Passed,
                other => other,
            };
            assert_eq!(outcome.verdict, wanted, "{looks} {late}: {outcome:#?}");
            // Longer than any computer holds it.
            let lost = judged(looks, 60_000, scenario);
            assert_eq!(lost.verdict, Failed, "{scenario}");
        }
    }
}

/// ND21 11.8: with drives that are silent in their self-test, the model expects bytes at other times. These times are no silence of the bench,
/// and excuse no wrong byte. The bytes come early, as over a socket.
#[test]
fn a_choice_that_moves_the_model_excuses_no_wrong_byte() {
    let judged = |wrong: &str, expected: Verdict| {
        let plan =
            plan("title x\nring 3\nwrite-byte 1 FE13 = 43\nread-byte 1 FE13 = 43\n".to_owned());
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: true,
        };
        let ring = format!("drive 0..last property self-test-time = 0ms\n{wrong}");
        let early = Span::from_micros(230);
        let outcome = judged_early(&mut link(&ring), "", (&plan, &way), &|_, _| {}, (early, 0));
        assert_eq!(outcome.verdict, expected, "{outcome:#?}");
    };
    judged("", Passed);
    judged("drive 1 deviates writes-ignored\n", Failed);
}

/// ND21 9.9: bytes that come back before they can show that the bench noted wrong times, and drives that monitor may have heard a longer silence
/// than it knows. After any silence they send zeros and their numbers, and not a wrong checking byte.
#[test]
fn a_silence_excuses_nothing_that_no_right_drive_sends_after_one() {
    let judged = |wrong: &str| {
        let scenario = "drive 0..last memory Flags2 = 04\nread-byte 0 Flags2\nread-byte 1 FE13\n";
        let plan = plan(format!("title x\nring 3\n{scenario}"));
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: true,
        };
        let early = Span::from_millis(6);
        judged_early(&mut link(wrong), "", (&plan, &way), &|_, _| {}, (early, 0)).verdict
    };
    assert_ne!(judged(""), Failed);
    assert_eq!(judged("drive 1 deviates checksum-wrong\n"), Failed);
}

/// ND21 9.8: a check sequence that comes back whole ends what a silence may have begun. Behind a fault of the scenario it is not known whether
/// the drives monitor time-outs (14.3.6), and the zeros of the bench's own check sequences are no sign that they do.
#[test]
fn zeros_of_the_bench_excuse_no_wrong_byte() {
    let judged = |wrong: &str, expected: Verdict| {
        let plan = plan(
            "title x\nring 3\nwrite-byte last DataIn = 4E\nwrite-word last FF4E = 1122\n> 85 (last-N) 33\n\
             ! master->last: flip p\n> 44 00*30\nrecover\nread-word last FF4E = 1122\nexchange last 5566\n\
             read-word last FF4E = 5566\n"
                .to_owned(),
        );
        let way = Way {
            rings: plan.rings.clone(),
            attempts: None,
            anew: true,
        };
        let early = Span::from_micros(230);
        let outcome = judged_early(&mut link(wrong), "", (&plan, &way), &|_, _| {}, (early, 0));
        assert_eq!(outcome.verdict, expected, "{outcome:#?}");
    };
    judged("", Passed);
    judged("drive 2 deviates process-data-high-byte-early\n", Failed);
}

/// ND21 9.8, 9.9, 14.10.2, 14.11.14: all drives that monitor have missed a master that was silent for 20 ms, and after the check sequence
/// that ends the race of their clocks what they hold is compared again.
#[test]
fn the_code_of_a_time_out_is_judged() {
    let outcome = |ring: &str, monitoring: &str, silence: &str, between: &str| {
        let errors =
            |k: u8| format!("delete-error {k}\nuntil drive {k} errorcode = 0000 within 1s\n");
        let codes = |k: u8| {
            let address = 0xFD + k;
            format!("> 88 {address:02X} C0 82 FD 3F 88 {address:02X} C0 83 FD 40\n")
        };
        let all = |text: &dyn Fn(u8) -> String| (0..3).map(text).collect::<String>();
        let scenario = format!(
            "drive {monitoring} memory Flags2 = 04\n{}wait {silence}\n{between}> 00*17 FF 44 72 4C 41\n{}> 80*2\n",
            all(&errors),
            all(&codes)
        );
        let (meant, byte_time) = (Cell::new(None), link("").byte_time());
        let outcome = judged_with(ring, "", &scenario, &|conversations, comparisons| {
            let mut all = comparisons.iter().enumerate();
            let found = all.find(|(_, result)| result.divergence.is_some());
            let sighting =
                found.and_then(|result| Sighting::of(conversations, result, 3, byte_time));
            meant.set(sighting.map(|sighting| sighting.meant));
        });
        (outcome.verdict, meant.get())
    };
    let verdict = |ring: &str, monitoring: &str, silence: &str, between: &str| {
        outcome(ring, monitoring, silence, between).0
    };
    let wrong = "drive 1 deviates reports-time-out-as-sync";
    let of_drive_1 = (Failed, Some(Meant::Own(1)));
    assert_eq!(outcome(wrong, "0..last", "80ms", ""), of_drive_1);
    assert_eq!(verdict(wrong, "0..last", "80ms", "> 80*4\n"), Failed);
    let late = "drive 1 property time-out = 20ms";
    for right in ["", late, "drive 0 property time-out = 15ms"] {
        assert_eq!(verdict(right, "0..last", "80ms", ""), Passed, "{right}");
    }
    // What a drive in normal mode would have taken, a drive that does not say whether it monitors, and a shorter silence.
    for (monitoring, silence, between) in [
        ("0..last", "80ms", "> 88 FE C0 13 FE D1\n"),
        ("0", "80ms", ""),
        ("0..last", "21ms", ""),
    ] {
        let verdict = verdict(wrong, monitoring, silence, between);
        assert_ne!(verdict, Failed, "{monitoring}, {silence}, {between}");
    }
}

/// ND21 9.4, 9.9, 14.10.3: process data are not written where a time-out has cut their low byte off. The zero that comes in its place is none.
#[test]
fn process_data_that_a_time_out_cuts_are_judged() {
    let scenario = "drive 0..last memory Flags2 = 04\nwrite-byte 1 DataIn = 4E\nwrite-word 1 FF4E = 1234\n> 80*20 85 FE A5\nwait 80ms\n\
         > 00*17 FF 44 72 4C 41\n> 88 FE C0 4E FF 0D 88 FE C0 4F FF 0E\n> 80*2\n";
    let verdict = |ring: &str| judged_with(ring, "", scenario, &|_, _| {}).verdict;
    assert_eq!(verdict(""), Passed);
    assert_eq!(
        verdict("drive 1 deviates process-data-high-byte-early"),
        Failed
    );
}

/// ND21 9.9, 14.10.2: a drive that alone monitors has detected a time-out "no later than 20 ms" after the last byte, whichever drives are behind it.
#[test]
fn a_time_out_that_does_not_come_is_the_drives_fault() {
    let verdict = |ring: &str, silence: &str| {
        let scenario = format!(
            "drive 1 memory Flags2 = 04\nread-byte 0 Flags2\nread-byte 2 Flags2\n> 80*20\nwait {silence}\n> 80*20\nwait 80ms\n\
             > 00*17 FF 44 72 4C 41\n> 8A FE 82 00 57 FF D8 80*2\n"
        );
        judged_with(ring, "", &scenario, &|_, _| {}).verdict
    };
    for right in ["", "drive 1 property time-out = 20ms"] {
        assert_eq!(verdict(right, "22.5ms"), Passed, "{right}");
    }
    let late = "drive 1 deviates time-out-after-25ms";
    assert_eq!(verdict(late, "22.5ms"), Failed);
    assert_ne!(verdict(late, "20ms"), Failed);
}
