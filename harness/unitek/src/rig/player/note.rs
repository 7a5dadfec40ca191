//! The attempts of a qualification, and whether a model with something changed explains them.
//!
//! An attempt is explained by a model that ends it in the same way, at the same line, and sends the same frames. How often a frame is sent and
//! when is not compared, since the clock of a drive stands anywhere when an attempt begins; lines of scenarios compare that.

use super::super::known::KnownDrives;
use super::super::observed::Observed;
use super::worlds::AttemptFrames;
use super::{AttemptCourse, Player, RigScenario};
use crate::driver::{Driver, Error};
use crate::gate::GuardsSegment as _;
use crate::gate::guarded;
use crate::simulate::{self, Bench, DriveSetup};
use harness_bench::link::{Line as _, Link as _, LinkEvent, Recording};
use harness_bench::medium::Out;
use harness_bench::qualify::segment::{AttemptSummary, Note};
use harness_bench::scenario::run::{Outcome, Why};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::properties::Properties;
use harness_proto::unitek::{Access, REGISTERS, Register, Request};
use harness_sim::unitek::deviation::{DEVIATIONS, Deviation};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// How many frames a drive may have heard before an attempt, counted in the cycle of a deviation that shows in each fifth one.
const HEARD_BEFORE: std::ops::Range<u8> = 1..5;

/// Every how many phases of a drive's clock one is tried for a drive that is wrong.
const EACH_PHASE: usize = 8;

/// How a drive differs from what is known of it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum KnownDifference {
    /// Nothing differs but what is not settled of it: it is right.
    Right,
    /// The drive at this place has a deviation.
    Deviates(usize, &'static Deviation),
}

#[derive(Clone, Debug)]
pub(crate) struct DriveNote {
    scenario: Arc<RigScenario>,
    /// What was known when it began.
    begun: Player,
    /// What was known of the drives in it.
    drives: Vec<KnownDrives>,
    shown: AttemptShown,
    /// Its frames and their times, where time is real or they alone judge.
    told: Option<AttemptFrames>,
    /// Whether no right drive could have sent them then.
    wrong: bool,
    noted: AttemptSummary,
}

#[derive(Clone, Debug, PartialEq)]
struct AttemptShown {
    /// Why the drives were not ready.
    unanswered: Option<Error>,
    /// How it ended, and at which place of the text.
    ended: Option<(Verdict, Option<usize>)>,
    /// The frames that were received before the scenario, without what means nothing.
    before: BTreeSet<String>,
    /// The frames of the scenario: by identifier, length and register the contents, in order, where they change.
    within: BTreeMap<String, Vec<String>>,
}

impl AttemptShown {
    fn of(gone: &AttemptCourse, link: &Observed<'_>, exact: bool) -> Self {
        let [before, frames] = link.noted.kept();
        let before = before.iter().map(|frame| meaning(frame, false));
        let mut within: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (head, contents) in frames.iter().map(|frame| meaning(frame, exact)) {
            let all = within.entry(head).or_default();
            if all.last() != Some(&contents) {
                all.push(contents);
            }
        }
        let (unanswered, ended) = match gone {
            AttemptCourse::Unanswered(error) => (Some(error.clone()), None),
            AttemptCourse::Skipped(_) => (None, None),
            AttemptCourse::Played(outcome, ..) => {
                let place = outcome.finding.as_ref().map(|finding| finding.span.start);
                (None, Some((outcome.verdict, place)))
            }
        };
        Self {
            unanswered,
            ended,
            before: before.map(|(head, contents)| head + &contents).collect(),
            within,
        }
    }
}

/// Registers that follow a motor that turns: their contents depend on remainders that no register shows. Lines of scenarios compare them.
const MOVING: [u8; 15] = [
    0x20, 0x26, 0x27, 0x28, 0x30, 0x32, 0x33, 0x42, 0x43, 0x5C, 0x5D, 0x5F, 0x6D, 0x70, 0xA8,
];

/// Identifier, length and register of a frame, and its contents without what means nothing: the stuff byte, what follows a motor, and with
/// `all` unset what a register that cannot be written reads, which may change by itself.
pub(super) fn meaning(frame: &Frame, all: bool) -> (String, String) {
    let (register, contents) = frame.data().split_at(frame.data().len().min(1));
    let changes = register.first().is_some_and(|register| {
        let read_only = Register::of(*register).access == Access::RO;
        MOVING.contains(register) || read_only && !all
    });
    let shown = match contents {
        [_, _, _] | [_, _, _, _, _] if changes => &[],
        [shown @ .., _] if matches!(shown.len(), 2 | 4) => shown,
        _ => contents,
    };
    let head = (frame.id(), frame.is_remote(), frame.data().len());
    let head = format!("{} {} {} {register:02X?} ", head.0, head.1, head.2);
    (head, format!("{shown:02X?}"))
}

impl DriveNote {
    pub(super) fn judge(&mut self, outcome: &Outcome) {
        self.noted.verdict = outcome.verdict;
        let unready = match &self.shown.unanswered {
            // The rig's line was lost.
            None | Some(Error::Link(_)) => false,
            Some(_) => self.noted.received > 0,
        };
        self.noted.accuses = outcome.verdict == Verdict::Failed || unready;
    }

    /// Notes its frames and their times, and whether no right drive could have sent them.
    pub(super) fn told(&mut self, told: AttemptFrames, wrong: bool) {
        self.wrong = wrong;
        self.told = Some(told).filter(|_| !self.noted.exact || self.scenario.by_frames);
    }

    /// Whether the frames and their times are those that a drive with a deviation could have sent; `None` where that is not compared.
    fn told_by(&self, place: usize, deviation: &'static Deviation) -> Option<bool> {
        let (told, known) = (self.told.as_ref()?, self.drives.get(place)?);
        let setup = deviant(known, known.properties, deviation);
        let before = match deviation.counts() {
            true => HEARD_BEFORE,
            false => 0..0,
        };
        let tried = std::iter::once(0).chain(before).map(|heard| {
            self.begun
                .could_deviate(known, &setup, heard, told, self.wrong)
        });
        let mut refuted = Some(false);
        for shows in tried {
            match shows {
                Some(true) => return shows,
                None => refuted = None,
                Some(false) => {}
            }
        }
        refuted
    }

    /// Whether it has shown something: the scenario was tried, or the drives were asked for everything.
    pub(crate) fn shows_something(&self) -> bool {
        self.noted.was_tried() || self.begun.known.is_none()
    }

    /// The values of a property of the drive at a place with which it would have shown the same, among those that are possible.
    pub(crate) fn explaining<'v>(
        &self,
        place: usize,
        values: &'v [Properties],
    ) -> Vec<&'v Properties> {
        let explains = |value: &&Properties| {
            let mut all: Vec<_> = self.drives.iter().map(|known| known.properties).collect();
            if let Some(properties) = all.get_mut(place) {
                *properties = **value;
            }
            phases(EACH_PHASE).any(|phase| self.shows(KnownDifference::Right, &all, phase, 0))
        };
        values.iter().filter(explains).collect()
    }

    /// Whether drives that differ so would have shown the same; `None` where that was not compared to its end. Behind an adapter its frames and
    /// their times alone say it.
    fn is_explained_by(&self, other: KnownDifference) -> Option<bool> {
        let told = match other {
            KnownDifference::Deviates(place, deviation) if self.told.is_some() => {
                self.told_by(place, deviation)
            }
            KnownDifference::Deviates(..) => Some(true),
            KnownDifference::Right => Some(!self.wrong),
        };
        let by_times = self.told.is_some() && !self.noted.exact;
        match told {
            Some(true) if !by_times => Some(self.is_shown_by(other)),
            None if !by_times && !self.is_shown_by(other) => Some(false),
            told => told,
        }
    }

    fn is_shown_by(&self, other: KnownDifference) -> bool {
        let known: Vec<_> = self.drives.iter().map(|known| known.properties).collect();
        let each = match other {
            KnownDifference::Right => 1,
            KnownDifference::Deviates(..) => EACH_PHASE,
        };
        if phases(each).any(|phase| self.shows(other, &known, phase, 0)) {
            return true;
        }
        match other {
            KnownDifference::Deviates(..) => {
                let mut heard = HEARD_BEFORE;
                heard.any(|heard| self.shows(other, &known, Span::ZERO, heard))
            }
            KnownDifference::Right => self.drives.iter().enumerate().any(|(place, drive)| {
                drive.candidates().into_iter().any(|properties| {
                    let mut all = known.clone();
                    all[place] = properties;
                    self.shows(other, &all, Span::ZERO, 0)
                })
            }),
        }
    }

    /// Plays the attempt on a model, whose clock is ahead and which has heard some requests before.
    fn shows(
        &self,
        other: KnownDifference,
        properties: &[Properties],
        phase: Span,
        heard: u8,
    ) -> bool {
        let mut player = self.begun.clone();
        player.beats.beat();
        let drives = self.drives.iter().zip(properties).enumerate();
        let drives = drives.map(|(place, (known, properties))| match other {
            KnownDifference::Deviates(deviates, deviation) if deviates == place => {
                deviant(known, *properties, deviation)
            }
            _ => right(known, *properties),
        });
        let setup = simulate::Setup::new(player.rate, drives.collect());
        let mut bench = Bench::new(&setup);
        for axis in player.axes.iter().cycle().take(heard.into()) {
            let firmware = Request::Read { register: 0x1B };
            let frame = firmware.encode(axis.rx).into_iter();
            bench.send(0, Out::Frames(&frame.collect::<Vec<_>>()));
            let now = bench.now();
            bench.wait(now + Span::from_millis(10));
        }
        bench.wait(Instant::START + phase);
        bench.begin();
        let identifiers: Vec<_> = player.axes.iter().map(|axis| (axis.rx, axis.tx)).collect();
        let mut link = guarded(bench, player.limits.clone(), &identifiers, false);
        if let Some(gate) = link.segment_mut() {
            player.tell(&self.drives, gate);
        }
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut forgotten);
        let mut link = Observed::new(&mut recording);
        link.noted.keep();
        let gone = match self.noted.was_tried() {
            true => player.go(&self.scenario, &mut link, false),
            false => match player.learn(&mut link) {
                Ok(()) => AttemptCourse::Skipped(Why::RunEnded.into()),
                Err(error) => AttemptCourse::Unanswered(error),
            },
        };
        AttemptShown::of(&gone, &link, self.noted.exact) == self.shown
    }
}

impl Note for DriveNote {
    type Deviation = Deviation;

    fn deviations() -> Vec<&'static Deviation> {
        DEVIATIONS.all().collect()
    }

    fn words(deviation: &Deviation) -> String {
        deviation.sentence("UNITEK")
    }

    fn noted(&self) -> &AttemptSummary {
        &self.noted
    }

    fn drives(&self) -> Vec<String> {
        let axes = self.begun.axes.iter();
        axes.map(|axis| format!("drive {}", axis.node)).collect()
    }

    fn is_right(&self) -> bool {
        self.is_explained_by(KnownDifference::Right) == Some(true)
    }

    fn explains(&self, place: usize, deviation: &'static Deviation) -> Option<bool> {
        self.is_explained_by(KnownDifference::Deviates(place, deviation))
    }
}

/// How far apart the places are at which the clock of a drive of 1 ms may stand when a scenario begins: cycles, ramps and events go by it.
const PHASE: Span = Span::from_nanos(31_250);

/// Where the clock of a drive may stand: every `each`th place, and the first one.
pub(super) fn phases(each: usize) -> impl Iterator<Item = Span> {
    let phases = std::iter::once(0).chain((1..32).step_by(each));
    phases.map(|place| PHASE * place)
}

/// A drive as it is known; as delivered where nothing was read of it.
fn right(known: &KnownDrives, properties: Properties) -> DriveSetup {
    match known.cells.is_empty() {
        true => DriveSetup {
            identifiers: (known.axis.rx, known.axis.tx),
            ..DriveSetup::new(known.axis.node)
        },
        false => known.model(properties),
    }
}

/// A drive with a deviation, whose registers hold what makes it send what was read of it.
fn deviant(
    known: &KnownDrives,
    properties: Properties,
    deviation: &'static Deviation,
) -> DriveSetup {
    let mut guess = known.clone();
    // What a correct drive works out from others is left as it is.
    let usual = read(known, right(known, properties));
    for tried in 0..2 {
        let setup = DriveSetup {
            deviation: Some(deviation),
            ..right(&guess, properties)
        };
        let reads = read(known, setup);
        let kept = |(register, wanted): &(&u8, &u32)| usual.get(register) == Some(wanted);
        for (register, wanted) in known.cells.iter().filter(kept) {
            // A deviation that exchanges something gives the contents back when it is applied again.
            let better = match reads.get(register) {
                Some(reads) if reads != wanted && tried == 0 => *reads,
                Some(reads) if reads != wanted => Register::of(*register).dump,
                _ => continue,
            };
            guess.cells.insert(*register, better);
        }
    }
    DriveSetup {
        deviation: Some(deviation),
        ..right(&guess, properties)
    }
}

/// What the registers of a simulated drive read.
fn read(known: &KnownDrives, setup: DriveSetup) -> BTreeMap<u8, u32> {
    let setup = simulate::Setup {
        drives: vec![setup],
        ..simulate::Setup::of(1)
    };
    let mut bench = Bench::new(&setup);
    let mut driver = Driver::new(Box::new(&mut bench), &[known.axis], Span::from_millis(20));
    let registers = REGISTERS.iter().map(|register| register.number);
    let asked = registers.filter(|register| known.cells.contains_key(register));
    asked
        .filter_map(|register| {
            let reply = driver.read(known.axis, register).ok()?;
            let mask = Register::of(register).mask();
            Some((register, reply.data.bits() & mask))
        })
        .collect()
}

impl Player {
    /// A copy that keeps no attempts.
    pub(super) fn without_notes(&mut self) -> Self {
        let notes = std::mem::take(&mut self.notes);
        let copy = self.clone();
        self.notes = notes;
        copy
    }

    pub(super) fn note(
        &mut self,
        begun: Self,
        scenario: &Arc<RigScenario>,
        link: &Observed<'_>,
        gone: &AttemptCourse,
    ) {
        let drives = self.known.as_ref().unwrap_or(&self.partly).iter();
        let first = begun.known.is_none();
        let drives = drives.map(|known| match first {
            // Probes have changed what they read at first.
            true => known.as_at_first(),
            false => known.clone(),
        });
        let exact = link.time_tolerance() == Span::ZERO;
        let shown = AttemptShown::of(gone, link, exact);
        let note = DriveNote {
            scenario: Arc::clone(scenario),
            begun,
            drives: drives.collect(),
            told: None,
            wrong: false,
            noted: AttemptSummary {
                name: scenario.name.clone(),
                verdict: Verdict::Skipped,
                accuses: false,
                exact,
                received: link.noted.kept().iter().map(|piece| piece.len()).sum(),
                was_ready: shown.ended.is_some(),
                was_unanswered: shown.unanswered.is_some(),
            },
            shown,
        };
        self.notes.push(note);
    }
}
