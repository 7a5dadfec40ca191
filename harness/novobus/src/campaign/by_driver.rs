//! A conversation of the driver: its master packs telegrams, compares every byte, names the fault and repairs the ring
//! (`bus`, ND21 11.5). What it reports is taken for what it knows.

use super::class::{CaseEvidence, WrongValue, named};
use super::sound::Sound;
use crate::campaign::fault::CaseFaults;
use crate::driver::{Axis, Error, OpenRings, Options};
use crate::language::plan::PlannedCall;
use crate::link::SimulatedLink;
use harness_bench::link::{Line, Link, Moment, Octets, PlacedFault};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Event, Job};
use harness_proto::time::{Instant, Span};

/// A cell that every drive has and no conversation should write: it is read in the end, so that half a command or a
/// telegram without an end does not stay unseen. It belongs to the oscilloscope's picture (ND21 14.2.1).
const QUIET: u16 = 0xFD90;

/// The conversation without a fault before one of its steps: all bytes are back, so every link has carried as many.
#[derive(Clone, Debug)]
struct UndisturbedStep {
    link: SimulatedLink,
    /// How many bytes the master has sent.
    sent: u64,
    /// What the jobs have brought.
    answers: Vec<Option<u32>>,
}

/// Calls of the driver that are ready to be disturbed.
#[derive(Clone, Debug)]
pub(crate) struct ByDriver {
    /// The conversation before each step: a case begins before the step of its first fault.
    before: Vec<UndisturbedStep>,
    calls: Vec<Vec<(u8, PlannedCall)>>,
    sound: Sound,
    /// What the jobs bring without a fault.
    answers: Vec<Option<u32>>,
    /// What the master sends in doing so.
    sent: Vec<u8>,
}

/// A command for a drive, as a job.
fn job(call: &(u8, PlannedCall)) -> Option<(Axis, Job)> {
    match call {
        (drive, PlannedCall::Command(command, _)) => {
            Some((Axis::new(0, *drive)?, Job::new(*drive, *command)))
        }
        _ => None,
    }
}

impl ByDriver {
    /// Lets the driver do it without a fault. `None` where a call is not one command, or where it fails without any fault.
    #[must_use]
    pub(crate) fn new(start: SimulatedLink, calls: Vec<Vec<(u8, PlannedCall)>>) -> Option<Self> {
        if calls.iter().flatten().any(|call| job(call).is_none()) {
            return None;
        }
        let mut by_driver = Self {
            sound: Sound::new(start.clone()),
            before: Vec::new(),
            calls,
            answers: Vec::new(),
            sent: Vec::new(),
        };
        let mut link = RecordingLink {
            link: start,
            sound: Some(by_driver.sound.clone()),
            sent: Vec::new(),
            quiet: false,
        };
        let mut before = Vec::new();
        let note = |link: &RecordingLink, answers: &[_]| {
            before.push(UndisturbedStep {
                link: link.link.clone(),
                sent: link.sent.len() as u64,
                answers: answers.to_vec(),
            });
        };
        let (evidence, answers) = by_driver.play_on(&mut link, 0, Vec::new(), note);
        if evidence.noticed || !evidence.confirmed {
            return None;
        }
        by_driver.before = before;
        by_driver.sent = link.sent;
        by_driver.sound = link.sound?;
        by_driver.answers = answers;
        Some(by_driver)
    }

    /// What the master sends without a fault, up to the end of the last job.
    #[must_use]
    pub(crate) fn sent(&self) -> &[u8] {
        &self.sent
    }

    /// Plays a case, from the start of the step in which its first fault happens.
    #[must_use]
    pub(crate) fn play(&self, case: &CaseFaults) -> CaseEvidence {
        let first = case.faults().map(|fault| fault.byte).min();
        let step = self
            .before
            .partition_point(|before| Some(before.sent) < first);
        self.play_from(step.saturating_sub(1), case)
    }

    /// Plays a case from the start of this step, before which no fault happens.
    fn play_from(&self, step: usize, case: &CaseFaults) -> CaseEvidence {
        let Some(before) = self.before.get(step) else {
            return CaseEvidence::default();
        };
        let mut link = RecordingLink {
            link: before.link.clone(),
            sound: None,
            sent: Vec::new(),
            quiet: false,
        };
        for fault in case.faults() {
            for (distance, what) in fault.what.on_link() {
                let placed = PlacedFault::Link(fault.link, what);
                link.link
                    .inject(0, placed, Moment::Byte(fault.byte + distance));
            }
        }
        let answers = before.answers.clone();
        self.play_on(&mut link, step, answers, |_, _| {}).0
    }

    /// Plays the steps from `from` on, before which the jobs have brought `answers`; `before` is called before each of them.
    fn play_on(
        &self,
        link: &mut RecordingLink,
        from: usize,
        mut answers: Vec<Option<u32>>,
        mut before: impl FnMut(&RecordingLink, &[Option<u32>]),
    ) -> (CaseEvidence, Vec<Option<u32>>) {
        let mut evidence = CaseEvidence {
            confirmed: true,
            ..CaseEvidence::default()
        };
        for calls in self.calls.iter().skip(from) {
            before(link, &answers);
            self.step(link, calls, &mut evidence, &mut answers);
            settle(&mut link.link);
        }
        link.quiet = true;
        evidence.wrong = self.sound.wrong(&link.link, evidence.confirmed);
        let both = answers.iter().zip(&self.answers);
        for ((value, expected), (drive, _)) in both.zip(self.calls.iter().flatten()) {
            if let (Some(value), Some(expected)) = (*value, *expected)
                && value != expected
            {
                let drive = *drive;
                evidence.wrong.push(WrongValue::Answer {
                    drive,
                    value,
                    expected,
                });
            }
        }
        // What is left half-done shows at the next telegram.
        let quiet = |drive| {
            (
                drive,
                PlannedCall::Command(Command::ReadByte { address: QUIET }, Vec::new()),
            )
        };
        let every: Vec<_> = (0..link.link.drives(0)).map(quiet).collect();
        self.step(link, &every, &mut evidence, &mut Vec::new());
        settle(&mut link.link);
        evidence.all_back = Sound::all_back(&link.link);
        (evidence, answers)
    }

    /// One step of the scenario, played as the scenario's player does.
    fn step(
        &self,
        link: &mut RecordingLink,
        calls: &[(u8, PlannedCall)],
        evidence: &mut CaseEvidence,
        answers: &mut Vec<Option<u32>>,
    ) {
        let drives = link.link.drives(0);
        let Ok(size) = RingSize::new(u64::from(drives)) else {
            return;
        };
        let bus = match OpenRings::open(Box::new(&mut *link), &[size], Options::default()) {
            Ok(bus) => bus,
            Err(error) => {
                evidence.fails(&error);
                return;
            }
        };
        let jobs = calls.iter().filter_map(job);
        let orders: Vec<_> = jobs.map(|(axis, job)| bus.start(axis, |_| job)).collect();
        for order in orders {
            match order.and_then(|order| bus.result(order)) {
                Ok(answer) => answers.push(answer),
                Err(error) => {
                    evidence.fails(&error);
                    answers.push(None);
                }
            }
        }
        evidence.hear(bus.take_events(), drives);
        bus.close();
    }
}

impl CaseEvidence {
    /// Notes a job that the driver reported as not confirmed.
    fn fails(&mut self, error: &Error) {
        self.noticed = true;
        self.confirmed = false;
        if let Error::Stopped(stop) = error {
            self.diagnosis.get_or_insert(stop.fault);
        }
    }

    /// What the master reported: the first fault that it named counts.
    fn hear(&mut self, events: Vec<(usize, Event)>, drives: u8) {
        for (_, event) in events {
            if let Event::Disturbed { fault, .. } = event {
                self.noticed = true;
                self.sequences += 1;
                if self.diagnosis.is_none() {
                    self.diagnosis = Some(fault);
                    self.named = named(fault, drives);
                }
            }
        }
    }
}

/// Waits until all bytes are back.
fn settle(link: &mut SimulatedLink) {
    let end = link.now() + Span::from_millis(3_600_000);
    while link.busy() && link.now() < end && link.wait(end) {}
    while link.receive_octet(0).is_some() {}
}

/// A link that keeps what the master sends and notes what drives hold.
struct RecordingLink {
    link: SimulatedLink,
    sound: Option<Sound>,
    sent: Vec<u8>,
    /// Nothing is kept any more.
    quiet: bool,
}

impl Line for RecordingLink {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, ring: usize, what: Out<'_>) -> Instant {
        if !self.quiet {
            self.sent.extend_from_slice(what.octets());
        }
        self.link.send(ring, what)
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, HeardPiece)> {
        self.link.receive(ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        let more = self.link.wait(until);
        if let Some(sound) = self.sound.as_mut().filter(|_| !self.quiet) {
            sound.note(&self.link);
        }
        more
    }
}

#[cfg(test)]
mod tests {
    use crate::campaign::find::{find, names};
    use std::path::Path;

    /// A case that begins before the step of its first fault against the same case from the start of the conversation: a random sample
    /// of every campaign of the driver.
    #[test]
    fn a_case_from_its_step_is_the_case_from_the_start() {
        let seed = std::env::var("DRIVEBENCH_SEED")
            .ok()
            .and_then(|seed| seed.parse().ok())
            .unwrap_or(9_800);
        let mut random = fastrand::Rng::with_seed(seed);
        let mut later = 0;
        for name in names() {
            let found = find(Path::new(&name)).expect("a built-in campaign");
            let campaign = found.expect("a campaign");
            let Some(by_driver) = campaign.driver() else {
                continue;
            };
            for _ in 0..60 {
                let case = random.choice(&campaign.cases).expect("cases");
                let first = case.faults().map(|fault| fault.byte).min();
                later += usize::from(first > Some(by_driver.before[1].sent));
                assert_eq!(
                    by_driver.play(case),
                    by_driver.play_from(0, case),
                    "{name}: {}; repeat with: DRIVEBENCH_SEED={seed} cargo test --lib a_case_from_its_step",
                    case.name(campaign.shape.drives)
                );
            }
        }
        assert!(later > 60, "{later} cases began behind the first step");
    }
}
