//! Trouble of a link ends an attempt wherever it comes: at a step, at the last one, behind it, before the first. No later step need
//! notice it.

use super::link;
use crate::gate::guard_rings;
use crate::language::plan::Plan;
use crate::language::read::RingScenario;
use crate::language::run::over_bus::play_over_bus;
use crate::simulate::bench;
use harness_bench::link::{
    Capability, Lead, Line, Link, LinkEvent, Moment, PlacedFault, Recording, Replay, Trouble,
};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::scenario::run::{AtMismatch, Outcome, play};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::guard::Limits;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;

fn plan(text: &str) -> Plan {
    let source = Source {
        name: "test".to_owned(),
        text: format!("title x\n{text}").into(),
    };
    let entry =
        RingScenario::new(source, None).unwrap_or_else(|problems| panic!("{:#?}", problems.all()));
    entry.plan
}

/// Plays on a guarded link, and again from what was recorded.
fn guarded(text: &str, limits: Limits) -> Outcome {
    let plan = plan(text);
    let [outcome, in_real_time] = [Span::ZERO, Span::from_millis(20)].map(|tolerance| {
        let never = FailingLink::new(
            bench(&plan),
            Trouble::Interrupted,
            TroubleMoment::Begin(usize::MAX),
        );
        let mut line = guard_rings(FailingLink { tolerance, ..never }, limits);
        line.assume_fresh();
        twice(&plan, &mut line)
    });
    assert_eq!(in_real_time.verdict, outcome.verdict);
    outcome
}

/// Plays on a link, and again from what was recorded, which must come to the same.
fn twice(plan: &Plan, link: &mut dyn Link) -> Outcome {
    let mut events: Vec<LinkEvent> = Vec::new();
    let mut recording = Recording::new(link, &mut events);
    let capabilities = recording.capabilities().to_vec();
    recording.begin();
    let outcome = play_over_bus(plan, &mut recording, AtMismatch::Stop);
    let drives = plan.rings.iter().map(|ring| ring.drives()).collect();
    let (rate, tolerance) = (Rate::default(), link.time_tolerance());
    let mut replay = Replay::new(events.clone(), rate, tolerance, drives, capabilities);
    replay.begin();
    let again = play_over_bus(plan, &mut replay, AtMismatch::Stop);
    let last = &events[events.len().saturating_sub(6)..];
    assert_eq!(said(&again), said(&outcome), "{last:?}");
    assert_eq!(replay.left(), None, "{last:?}");
    outcome
}

fn said(outcome: &Outcome) -> (Verdict, String) {
    let finding = outcome.finding.iter().map(|found| found.message.clone());
    let all: Vec<_> = finding.chain(outcome.remarks.clone()).collect();
    (outcome.verdict, all.join("; "))
}

#[track_caller]
fn ends(outcome: &Outcome, verdict: Verdict, words: &str) {
    let (found, text) = said(outcome);
    assert_eq!(found, verdict, "{text}");
    assert!(text.contains(words), "{words:?} is not in {text:?}");
}

/// The guard keeps a byte back, and nothing behind it waits for an answer.
#[test]
fn a_denial_is_noticed_at_the_line_that_it_meets() {
    let none = Limits::default;
    let motion = "a telegram with process data needs `allow_motion`";
    let aborts = |text: &str, words: &str| {
        ends(&guarded(text, none()), Verdict::Aborted, words);
    };
    aborts("ring 2\n> 85 FF 0F A0\n? sent 4 bytes\n", motion);
    aborts("ring 2\n> 80\n> 85 FF 0F A0\n", motion);
    aborts("ring 2\n> 85 FF 0F A0\nwait 1ms\n", motion);
    // The line behind it does not hold, which is the effect of the denial.
    aborts("ring 2\n> 80 85 FF 0F A0\n? sent 4 bytes\n", motion);
    aborts("ring 2\n> 85 FF 0F A0\n< 80\n", motion);
    let fault = "the fault";
    aborts("ring 2\n> 80\n! 1->0: drop\n", fault);
    aborts("ring 2\n! 1->0: drop\n> 80\n< 80\n", fault);
    aborts("ring 2\n> 80\n! 1->0 byte 9: drop\n", fault);
    aborts("ring 2\n> 80\n! 1->0 @50ms: drop\n", fault);
    aborts(
        "ring 2\nmaster write-word 1 nsoll = 0400\n",
        "`allow_motion`",
    );
    aborts("ring 2\nwrite-word 1 nsoll = 0400\n", "`allow_motion`");
    // A cell of the header, before the first step.
    let plan = plan("ring 2\ndrive 1 memory FF08 = 04\n> 80\n");
    let mut line = guard_rings(link(2), none());
    line.assume_fresh();
    ends(&twice(&plan, &mut line), Verdict::Aborted, "`allow_motion`");
}

/// A ring that may not be asked for its address spells out none, and no drive is to blame.
#[test]
fn a_denied_probe_is_no_finding() {
    let limits = Limits {
        most_bytes: 20,
        ..Limits::default()
    };
    let text = "ring 2\n> 80 00\n? located 1\n";
    ends(&guarded(text, limits), Verdict::Aborted, "20 bytes");
}

/// The driver sends a telegram in pieces, and the guard denies any of them: what was not sent has no answer that is waited for.
#[test]
fn a_denial_in_a_telegram_is_played_again() {
    for most_bytes in 1..16 {
        let limits = Limits {
            most_bytes,
            ..Limits::default()
        };
        let text = "ring 2\nmaster read-byte 1 FE10 = 00; read-byte 0 FE10 = 00\n";
        let words = format!("{most_bytes} byte");
        ends(&guarded(text, limits), Verdict::Aborted, &words);
    }
}

/// When a link gets into trouble.
#[derive(Clone, Copy, Debug, PartialEq)]
enum TroubleMoment {
    /// As soon as this number of bytes has been sent.
    Sent(usize),
    /// As soon as this number of bytes has been received.
    Received(usize),
    /// With this beginning of a conversation, the first being 1.
    Begin(usize),
    /// Once this time has come, which is noticed while time passes.
    At(Span),
}

/// A link that gets into trouble, or into a record without room.
struct FailingLink<L> {
    link: L,
    trouble: Trouble,
    full: bool,
    /// Of a link in real time.
    tolerance: Span,
    when: TroubleMoment,
    counts: [usize; 3],
    failed: bool,
}

impl<L: Link> FailingLink<L> {
    fn new(link: L, trouble: Trouble, when: TroubleMoment) -> Self {
        Self {
            link,
            trouble,
            full: false,
            tolerance: Span::ZERO,
            when,
            counts: [0; 3],
            failed: false,
        }
    }

    fn look(&mut self) {
        let [sent, received, begun] = self.counts;
        self.failed |= match self.when {
            TroubleMoment::Sent(n) => sent >= n,
            TroubleMoment::Received(n) => received >= n,
            TroubleMoment::Begin(n) => begun >= n,
            TroubleMoment::At(at) => self.link.now() >= Instant::START + at,
        };
    }
}

impl<L: Link> Line for FailingLink<L> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }
    fn now(&self) -> Instant {
        self.link.now()
    }
    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        if self.failed {
            return self.link.now();
        }
        let end = self.link.send(ring, what);
        self.counts[0] += what.len();
        self.look();
        end
    }
    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        let byte = self.link.receive(ring)?;
        self.counts[1] += 1;
        self.look();
        Some(byte)
    }
    fn wait(&mut self, until: Instant) -> bool {
        let more = self.link.wait(until);
        self.look();
        more && !self.failed
    }
    fn trouble(&self) -> Option<&Trouble> {
        Some(&self.trouble).filter(|_| self.failed && !self.full)
    }
    fn lead(&self) -> Lead {
        match self.tolerance {
            Span::ZERO => Lead::NONE,
            far => Lead {
                far,
                near: Span::ZERO,
            },
        }
    }
}

impl<L: Link> Link for FailingLink<L> {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }
    fn begin(&mut self) {
        self.link.begin();
        self.counts[2] += 1;
        self.look();
    }
    fn busy(&self) -> bool {
        self.link.busy()
    }
    fn time_tolerance(&self) -> Span {
        self.tolerance
    }
    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(ring, fault, moment);
    }
    fn probe(&mut self, ring: usize, octets: &[u8]) -> Vec<Received> {
        self.link.probe(ring, octets)
    }
    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }
    fn carried(&self) -> u64 {
        if self.failed && self.full {
            return u64::MAX;
        }
        self.link.carried()
    }
    fn drives(&self, ring: usize) -> u8 {
        self.link.drives(ring)
    }
    fn trace(&self, ring: usize) -> Trace {
        self.link.trace(ring)
    }
}

/// Every kind of trouble, and what an attempt comes to that it ends.
fn troubles() -> [(Trouble, Verdict); 5] {
    let text = || "the words".to_owned();
    [
        (Trouble::Denied(text()), Verdict::Aborted),
        (Trouble::Interrupted, Verdict::Aborted),
        (Trouble::Lost(text()), Verdict::RigError),
        (Trouble::Garbled(text()), Verdict::RigError),
        (Trouble::Interlock(text()), Verdict::RigError),
    ]
}

/// A scenario whose lines hold all the same, and when trouble comes into it.
const PLACES: &[(&str, TroubleMoment)] = &[
    // With the last byte, which no line waits for.
    ("> 80 80\n", TroubleMoment::Sent(2)),
    // While the last bytes come round, after the last step.
    ("> 80 80\n", TroubleMoment::Received(1)),
    // At a step that lets no time pass.
    (
        "> 80\n< 80\n? received 1 bytes\n",
        TroubleMoment::Received(1),
    ),
    (
        "> 80\n< 80\nwait 5ms\n",
        TroubleMoment::At(Span::from_millis(3)),
    ),
    ("> 80\n< 80\nrecover\n", TroubleMoment::Sent(23)),
    ("read-byte 0 FE10 = 00\n", TroubleMoment::Received(4)),
    (
        "master count = 2\n",
        TroubleMoment::At(Span::from_millis(1)),
    ),
    // A line does not hold, and the trouble comes behind it.
    ("> 80 80\n< 81\n", TroubleMoment::Received(2)),
];

#[test]
fn trouble_ends_an_attempt_wherever_it_comes() {
    for (trouble, verdict) in troubles() {
        for (steps, when) in PLACES {
            let plan = plan(&format!("ring 2\n{steps}"));
            let mut link = FailingLink::new(bench(&plan), trouble.clone(), *when);
            let outcome = twice(&plan, &mut link);
            assert_eq!(outcome.verdict, verdict, "{steps:?} {when:?}: {outcome:?}");
            ends(&outcome, verdict, &trouble.to_string());
        }
    }
}

/// The cells of a header are set before the first step and set back after the last one.
#[test]
fn trouble_around_the_steps_ends_the_attempt_too() {
    let text = "ring 2\ndrive 1 memory FE10 = 11\n> 80\n< 80\n";
    // Drives whose cells are not as the header says.
    let other = || bench(&plan("ring 2\n> 80\n"));
    ends(&twice(&plan(text), &mut other()), Verdict::Passed, "");
    for (trouble, verdict) in troubles() {
        // The second conversation is the scenario's own, the third one sets the cells back.
        for when in [
            TroubleMoment::Sent(1),
            TroubleMoment::Begin(2),
            TroubleMoment::Begin(3),
        ] {
            let mut link = FailingLink::new(other(), trouble.clone(), when);
            let outcome = twice(&plan(text), &mut link);
            ends(&outcome, verdict, &trouble.to_string());
        }
    }
}

/// A record without room shows less than was asked for.
#[test]
fn a_full_record_is_noticed_behind_the_last_step() {
    for (steps, when) in PLACES.iter().take(4) {
        let plan = plan(&format!("ring 2\n{steps}"));
        let mut link = FailingLink {
            full: true,
            ..FailingLink::new(bench(&plan), Trouble::Interrupted, *when)
        };
        let outcome = play(&plan, &mut link, AtMismatch::Stop);
        ends(
            &outcome,
            Verdict::Aborted,
            "bytes on the ring's links: too long",
        );
    }
}

/// Without trouble the same scenarios pass: it is the trouble that ends them.
#[test]
fn without_trouble_nothing_is_aborted() {
    for (steps, _) in PLACES.iter().take(PLACES.len() - 1) {
        let plan = plan(&format!("ring 2\n{steps}"));
        ends(&twice(&plan, &mut bench(&plan)), Verdict::Passed, "");
    }
}
