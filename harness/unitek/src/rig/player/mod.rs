//! Attempts at scenarios on the drives of a rig, whose registers and properties are found out first.
//!
//! A scenario describes the drive of the manual; a rig has a drive of its own. So every scenario is played on a model of that drive first,
//! behind the same limits. It is skipped if a right drive with these registers would not meet its lines, or if the limits deny a frame of
//! it. A line that the rig does not meet then accuses the drive, unless a right drive with another value of a property that is not settled
//! would not meet it either, or the computer was late.

mod counted;
mod note;
#[cfg(test)]
mod own_tests;
mod ready;
mod rig_scenario;
mod verdict;
mod worlds;

pub(crate) use note::DriveNote;
pub(super) use rig_scenario::{RigScenario, stores};
use verdict::{are_judged, explained, unlike};
use worlds::{AttemptFrames, BESIDE_THE_BUS, Proof, STANDSTILL};

use super::Axis;
use super::known::KnownDrives;
use super::observed::{FrameNotes, Observed, WrittenRegisters};
use super::profile::ProfileSettings;
use super::set_back::foretell;
use crate::driver::Error;
use crate::gate::GuardsSegment as _;
use crate::gate::guarded;
use crate::language::plan::{node, octet_time};
use crate::language::syntax::{Header, PropertyValue, SetupKind};
use crate::simulate::{self, Bench};
use harness_bench::link::{Capability, Line, Link, LinkEvent, Recording, Replay, Trouble};
use harness_bench::medium::Medium;
use harness_bench::qualify::segment::CONVERSATION;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::playing::observed::{Beats, LinkTimes};
use harness_bench::scenario::expression::Scope;
use harness_bench::scenario::run::{AtMismatch, Outcome, Skip, Unlock, Why, lacks, play};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::can::{BitRate, Frame};
use harness_proto::limit::LimitSetting;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::guard;
use harness_proto::unitek::guard::Limits;
use harness_proto::unitek::properties::{PROFILES, PROPERTIES, Properties, Setting};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Registers that show what a drive makes of its inputs: a model that explains the drive reads the same at rest.
const AT_REST: [u8; 9] = [0x40, 0x8F, 0xCE, 0xD8, 0xE2, 0xE3, 0xEF, 0xF2, 0xF5];

/// What drives read at rest, by number and register.
type AtRest = Vec<(u8, u8, u32)>;

/// How long a drive behind an adapter may be silent that was asked for something, and in which steps it is waited for.
const SILENCE: Span = Span::from_millis(2_500);
const STEP: Span = Span::from_millis(50);

/// How late the clock of a drive makes its slowest cycle at most: 2 % of 253 ms, and some more (UNITEK 5.2).
const INEXACT: Span = Span::from_millis(10);

/// How many times the tolerance of times is waited for a frame that is missing.
const STILL_COMES: u64 = 5;

/// What a model is beside what is known of the drives.
#[derive(Clone, Copy, Default)]
struct ModelOptions {
    /// How far the clocks of the drives are ahead.
    phase: Span,
    /// The properties of the drive at a place, in place of those that are known.
    drive: Option<(usize, Properties)>,
    /// Whether play goes on after a line that is not met.
    goes_on: bool,
}

/// A scenario played on the model.
struct Rehearsal {
    outcome: Outcome,
    at_rest: AtRest,
    denied: Option<(String, Vec<LimitSetting>)>,
    noted: FrameNotes,
}

/// How an attempt went, before it is judged.
enum AttemptCourse {
    /// A drive did not become ready.
    Unanswered(Error),
    Skipped(Skip),
    /// The outcome, what the drives and their models read at rest, and the lines that the models did not meet.
    Played(Box<Outcome>, [AtRest; 2], Vec<usize>),
}

/// Plays attempts, on a rig or on a record, and judges them.
#[derive(Clone, Debug)]
pub(crate) struct Player {
    axes: Vec<Axis>,
    rate: BitRate,
    patience: Span,
    limits: Limits,
    /// What a record of the rig shows that it can do.
    capabilities: Vec<Capability>,
    /// Whether its adapter carries remote frames.
    remote: bool,
    /// What the rig's file says of the drives, unless they are qualified.
    profile: ProfileSettings,
    /// Known from the first attempt on.
    known: Option<Vec<KnownDrives>>,
    /// What was found out where finding out has failed.
    partly: Vec<KnownDrives>,
    /// What has been written since the registers were read.
    written: WrittenRegisters,
    /// The levels of the EEPROM that the last attempt may have stored, with the drives.
    levels: BTreeSet<(u16, u16)>,
    /// Whether something that was played may have stored parameters.
    stored: bool,
    /// What was received before the scenario of the last attempt; `None` where it was not begun.
    before: Option<String>,
    /// Of which register a frame may have been lost, none where something stood still, and in how many attempts one after the other, by scenario.
    lost: BTreeMap<String, (Option<u8>, usize)>,
    qualifies: bool,
    /// What shows that the program works while it plays on models.
    pub(super) beats: Beats,
    /// Where it says what a scenario or a probe changes, before it does.
    pub(super) left: NotPutBack,
    notes: Vec<DriveNote>,
}

impl Player {
    pub(super) fn of(
        axes: Vec<Axis>,
        rate: BitRate,
        patience: Span,
        limits: Limits,
        capabilities: Vec<Capability>,
        remote: bool,
    ) -> Self {
        Self {
            axes,
            rate,
            patience,
            limits,
            capabilities,
            remote,
            profile: ProfileSettings::default(),
            known: None,
            partly: Vec::new(),
            written: BTreeSet::new(),
            levels: BTreeSet::new(),
            stored: false,
            before: None,
            lost: BTreeMap::new(),
            qualifies: false,
            beats: Beats::default(),
            left: NotPutBack::default(),
            notes: Vec::new(),
        }
    }

    pub(super) fn with_profile(mut self, profile: ProfileSettings) -> Self {
        self.profile = profile;
        self
    }

    /// Keeps every attempt from now on, and settles by probes what the limits permit to find out.
    pub(super) const fn qualify(&mut self) {
        self.qualifies = true;
    }

    /// Reads and probes the drives again before the next scenario. What they hold stays known until then, to be set back.
    pub(super) fn forget(&mut self) {
        let drives = self.known.iter_mut().flatten();
        drives.for_each(|known| known.doubtful = true);
    }

    pub(super) const fn limits(&self) -> &Limits {
        &self.limits
    }

    pub(super) fn notes(&self) -> &[DriveNote] {
        &self.notes
    }

    /// What is known of the drives; nothing before the first attempt.
    pub(super) fn known(&self) -> &[KnownDrives] {
        self.known.as_deref().unwrap_or_default()
    }

    /// What was read of the drives, also where not everything could be.
    pub(super) fn read_so_far(&self) -> &[KnownDrives] {
        self.known.as_deref().unwrap_or(&self.partly)
    }

    /// The levels of the EEPROM that the last attempt may have stored, with the drives.
    pub(super) const fn stored_levels(&self) -> &BTreeSet<(u16, u16)> {
        &self.levels
    }

    fn take_notes(&mut self, noted: &FrameNotes) {
        self.written.extend(&noted.written);
        self.levels.extend(noted.stored());
    }

    /// The registers that may differ from what was read at first.
    pub(super) const fn written(&self) -> &WrittenRegisters {
        &self.written
    }

    /// Whether something that was played may have stored parameters.
    pub(super) const fn has_stored(&self) -> bool {
        self.stored
    }

    pub(super) const fn note_stored(&mut self) {
        self.stored = true;
    }

    /// Why a scenario is not begun, whatever the drives are; `None` if it is.
    pub(super) fn not_begun(&self, scenario: &RigScenario) -> Option<Skip> {
        let bench = &scenario.plan.setup;
        let axis = |node: u8| self.axes.iter().find(|axis| axis.node == node);
        for drive in &bench.drives {
            let wanted = drive.identifiers;
            let why = match axis(drive.node) {
                None => format!("the rig has no drive {}", drive.node),
                Some(axis) if (axis.rx, axis.tx) != wanted => format!(
                    "drive {} of the rig has the identifiers {:03X} and {:03X}, that of the scenario {:03X} and {:03X}",
                    drive.node, axis.rx, axis.tx, wanted.0, wanted.1
                ),
                Some(_) => continue,
            };
            return Some(Why::OtherDrives(why).into());
        }
        let stated = scenario.header.rate.is_some();
        if stated && bench.rate != self.rate {
            let why = format!(
                "the rig's bus has {} kbit/s, that of the scenario {}",
                self.rate.bits_per_second() / 1000,
                bench.rate.bits_per_second() / 1000
            );
            return Some(Why::OtherDrives(why).into());
        }
        if !self.remote && scenario.frames().any(Frame::is_remote) {
            let why = "the adapter's language has no remote frames; use SLCAN".to_owned();
            return Some(Why::OtherDrives(why).into());
        }
        lacks(&scenario.plan, &self.replay(&[], Span::ZERO))
    }

    /// What was recorded of the rig, as a link.
    pub(super) fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        let drives = u8::try_from(self.axes.len()).unwrap_or(u8::MAX);
        let medium = Medium::Frames(self.rate);
        let capabilities = self.capabilities.clone();
        Replay::new(
            events.to_vec(),
            medium,
            tolerance,
            vec![drives],
            capabilities,
        )
    }

    /// One attempt over a link: finds out about the drives, rehearses, makes them ready, plays and judges. With what was received
    /// before the scenario, in words.
    pub(super) fn attempt(
        &mut self,
        scenario: &Arc<RigScenario>,
        link: &mut dyn Link,
    ) -> (Outcome, String) {
        link.begin();
        let begun = self.qualifies.then(|| self.without_notes());
        let mut link = Observed::new(link);
        if begun.is_some() {
            link.noted.keep();
        }
        let gone = self.go(scenario, &mut link, true);
        let scenario = &Arc::new(scenario.with_firmware(self.known()));
        if let Some(begun) = begun {
            self.note(begun, scenario, &link, &gone);
        }
        let way = LinkTimes {
            late: link.take_late(),
            longest: link.noted.longest,
            tolerance: link.time_tolerance(),
        };
        let outcome = match gone {
            AttemptCourse::Unanswered(error) => self.unanswered(&error),
            AttemptCourse::Skipped(skip) => Outcome::skipped(skip),
            AttemptCourse::Played(outcome, [drives, models], foretold) => {
                let unlike = unlike(&drives, &models);
                // What differs at rest does so in each attempt: it is judged where a conversation asks for it.
                let asks = match scenario.name.starts_with(CONVERSATION) {
                    true => scenario.asks_for(),
                    false => BTreeSet::new(),
                };
                let (asked, mut explained_so): (Vec<_>, Vec<_>) =
                    unlike.iter().partition(|differs| asks.contains(&differs.1));
                explained_so.extend(explained(&asked, &drives));
                let told = AttemptFrames {
                    talk: std::mem::take(&mut link.noted.exchange),
                    way,
                    explained: explained_so,
                    unlike,
                    follows: scenario.by_frames,
                };
                let exact = way.tolerance == Span::ZERO;
                let shown = match scenario.acts_beside_the_bus() {
                    true => Proof::Unknown(BESIDE_THE_BUS),
                    false => self.shown(&told),
                };
                let failed = outcome.verdict == Verdict::Failed;
                let shown = match shown {
                    Proof::Unknown(BESIDE_THE_BUS) if exact => self.replayed(scenario, &told),
                    Proof::Unknown(_) if exact && failed && scenario.is_foretold() => {
                        self.replayed(scenario, &told)
                    }
                    shown => self.lost_again(scenario, shown),
                };
                let wrong = matches!(shown, Proof::Wrong(_));
                let unlike = &told.unlike;
                let outcome = self.judged(scenario, *outcome, unlike, &foretold, shown);
                if let Some(note) = self.notes.last_mut() {
                    note.told(told, wrong);
                }
                outcome
            }
        };
        if let Some(note) = self.notes.last_mut() {
            note.judge(&outcome);
        }
        let before = match &self.before {
            Some(before) => before.clone(),
            None => link.noted.received(),
        };
        (outcome, before)
    }

    /// Finds out about the drives, makes them ready, and plays; with `rehearses` only what their model meets.
    fn go(
        &mut self,
        scenario: &RigScenario,
        link: &mut Observed<'_>,
        rehearses: bool,
    ) -> AttemptCourse {
        self.before = None;
        self.levels.clear();
        if let Err(error) = self.learn(link) {
            self.take_notes(&link.noted);
            return AttemptCourse::Unanswered(error);
        }
        let scenario = &scenario.with_firmware(self.known());
        let real = link.time_tolerance() > Span::ZERO;
        let rehearsal = rehearses.then(|| self.rehearsed(scenario, real));
        let (model, foretold) = match rehearsal.transpose() {
            Ok(rehearsal) => rehearsal.map_or_else(Default::default, |rehearsal| {
                foretell(
                    &self.left,
                    self.known(),
                    &rehearsal.noted.written,
                    &rehearsal.noted.given,
                );
                (rehearsal.at_rest, rehearsal.outcome.unmet)
            }),
            Err(skip) => return AttemptCourse::Skipped(skip),
        };
        outlast(link);
        link.noted.exchange.begin(Instant::START);
        let at_rest = self.prepare(scenario, self.limits.motion, link);
        self.before = Some(link.noted.received());
        self.take_notes(&link.noted);
        let at_rest = match at_rest {
            Ok(at_rest) => at_rest,
            Err(error) => return AttemptCourse::Unanswered(error),
        };
        if scenario.may_time_out(self.known()) {
            link.without_pauses();
        }
        outlast(link);
        link.begin();
        link.take_late();
        // Where time is real, right drives are compared to the end, whichever line frames have come too late for.
        let at_mismatch = match real {
            true => AtMismatch::GoOn,
            false => AtMismatch::Stop,
        };
        let outcome = play(&scenario.plan, link, at_mismatch);
        if real || outcome.verdict == Verdict::Failed {
            // What is missing may still be under way. The clock of a drive is not exact even where time is virtual (5.2).
            let tolerance = link.time_tolerance();
            let stalls = link.noted.exchange.last_late() > tolerance;
            let under_way = match outcome.verdict {
                Verdict::Failed => tolerance.max(INEXACT) * STILL_COMES,
                _ if stalls => tolerance * STILL_COMES,
                _ => Span::ZERO,
            };
            // So is all of it, where the drive has been silent since it was asked last.
            let end = link.now() + under_way;
            let silent_until = match outcome.verdict {
                Verdict::Failed => end.max(link.now() + SILENCE),
                _ => end,
            };
            let mut heard = link.noted.exchange.answers_last();
            loop {
                let now = link.now();
                link.wait(end.max(now + STEP).min(silent_until));
                while link.receive(0).is_some() {
                    heard = true;
                }
                let until = if heard { end } else { silent_until };
                if link.now() >= until || link.trouble().is_some() {
                    break;
                }
            }
            let now = link.now();
            link.wait(now);
            while link.receive(0).is_some() {}
        }
        self.take_notes(&link.noted);
        AttemptCourse::Played(Box::new(outcome), [at_rest, model], foretold)
    }

    /// Plays a scenario on the model.
    ///
    /// # Errors
    /// Why the rig does not play it.
    fn rehearsed(&self, scenario: &RigScenario, real: bool) -> Result<Rehearsal, Skip> {
        if let Some(why) = self.other_properties(&scenario.header) {
            return Err(Why::OtherDrives(why).into());
        }
        let first = self.rehearse(scenario, &self.limits, ModelOptions::default());
        if first.denied.is_none() && first.outcome.verdict == Verdict::Passed {
            return Ok(first);
        }
        // A drive with other registers than that of the scenario is qualified with it all the same, where right drives are compared.
        if self.qualifies && real && self.limits.motion && scenario.is_foretold() {
            let whole = ModelOptions {
                goes_on: true,
                ..ModelOptions::default()
            };
            let whole = self.rehearse(scenario, &self.limits, whole);
            let failed = whole.outcome.verdict == Verdict::Failed;
            if whole.denied.is_none() && failed && are_judged(scenario, &whole.outcome) {
                return Ok(whole);
            }
        }
        let mut limits = self.limits.clone();
        let mut unlocks = BTreeSet::new();
        let mut last = self.rehearse(scenario, &limits, ModelOptions::default());
        for _ in 0..4 {
            let wanted = match &last.denied {
                Some((_, settings)) => settings.clone(),
                // The drives stay locked without it.
                None if !limits.motion => vec![LimitSetting::Motion],
                None => break,
            };
            let before = limits.clone();
            for setting in wanted {
                permit(&mut limits, setting);
                unlocks.insert(Unlock::Limit(setting));
            }
            if limits == before {
                break;
            }
            last = self.rehearse(scenario, &limits, ModelOptions::default());
        }
        let found = |outcome: &Outcome| {
            let finding = outcome.finding.as_ref();
            let finding = finding.map(|finding| finding.message.clone());
            let remark = outcome.remarks.first().cloned();
            finding.or(remark).unwrap_or_default()
        };
        let denied = first.denied.as_ref();
        let plays = last.denied.is_none() && last.outcome.verdict == Verdict::Passed;
        Err(match (denied, plays) {
            (None, true) => {
                let why = "the drives stay locked without `allow_motion` and --allow-motion";
                Skip::from(Why::Denied(why.to_owned())).and(unlocks)
            }
            (Some((why, _)), true) => Skip::from(Why::Denied(why.clone())).and(unlocks),
            // Nothing that can be permitted is enough.
            (Some((why, settings)), false) if settings.is_empty() => {
                Why::Denied(why.clone()).into()
            }
            (_, false) => Why::OtherDrives(format!(
                "a correct drive with the same registers does not meet it: {}",
                found(&last.outcome)
            ))
            .into(),
        })
    }

    /// The first property of the header that the rig's drives have another value of, or that is not settled.
    fn other_properties(&self, header: &Header) -> Option<String> {
        header.drives.iter().find_map(|line| {
            let node = node(&line.drive, Scope::default()).ok()?;
            let known = self.known().iter().find(|known| known.axis.node == node)?;
            let mut wanted = known.properties;
            let named: Vec<_> = match &line.what {
                SetupKind::Property(property, value) => {
                    let setting = match value {
                        PropertyValue::Word(word) => Setting::Word(word),
                        PropertyValue::Time(time) => Setting::Time(time.on(octet_time(self.rate))),
                    };
                    let _fits = property.set(&mut wanted, setting);
                    vec![*property]
                }
                SetupKind::Profile(name) => {
                    wanted = Properties::profile(name)?;
                    let differs = |property: &&_| differs_between_profiles(property);
                    PROPERTIES.iter().filter(differs).collect()
                }
                _ => return None,
            };
            named.into_iter().find_map(|property| {
                let (value, settled) = (
                    property.of_drive(&wanted),
                    property.of_drive(&known.properties),
                );
                let name = property.name;
                match known.settled.contains(name) {
                    false => Some(format!(
                        "it is for a drive with {name} = {value}; that of drive {node} is not settled"
                    )),
                    true => (value != settled).then(|| {
                        format!("it is for a drive with {name} = {value}; drive {node} has {settled}")
                    }),
                }
            })
        })
    }

    fn rehearse(&self, scenario: &RigScenario, limits: &Limits, other: ModelOptions) -> Rehearsal {
        self.beats.beat();
        let known = self.known().iter().enumerate();
        let drives = known.map(|(place, known)| {
            let other = other.drive.filter(|changed| changed.0 == place);
            known.model(other.map_or(known.properties, |changed| changed.1))
        });
        let setup = simulate::Setup::new(self.rate, drives.collect());
        let identifiers: Vec<_> = self.axes.iter().map(|axis| (axis.rx, axis.tx)).collect();
        let mut bench = Bench::new(&setup);
        bench.wait(Instant::START + other.phase);
        let mut link = guarded(bench, limits.clone(), &identifiers, false);
        if let Some(gate) = link.segment_mut() {
            self.tell(self.known(), gate);
        }
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut forgotten);
        let mut observed = Observed::new(&mut recording);
        let at_rest = self.prepare(scenario, limits.motion, &mut observed);
        observed.noted.exchange.begin(Instant::START);
        observed.begin();
        let at_mismatch = match other.goes_on {
            true => AtMismatch::GoOn,
            false => AtMismatch::Stop,
        };
        let (outcome, at_rest) = match at_rest {
            Ok(at_rest) => (play(&scenario.plan, &mut observed, at_mismatch), at_rest),
            Err(error) => (self.unanswered(&error), Vec::new()),
        };
        let noted = std::mem::take(&mut observed.noted);
        let denied = match link.trouble() {
            Some(Trouble::Denied(why)) => Some((why.clone(), link.denying().to_vec())),
            _ => None,
        };
        Rehearsal {
            outcome,
            at_rest,
            denied,
            noted,
        }
    }

    /// Tells a model's gate what the gate in front of the drives knows of them.
    fn tell(&self, drives: &[KnownDrives], gate: &mut guard::FrameGate) {
        for known in drives {
            let [full, limit] = [0xC8, 0x34].map(|register| (known.cell(register) & 0xFFFF) as u16);
            gate.learn(known.axis.rx, full, limit);
        }
    }
}

/// Receives the replies that are still to come: a request that was repeated because its reply was late has two of them, and the second one
/// answers nothing that follows.
fn outlast(link: &mut Observed<'_>) {
    let end = link.now() + STANDSTILL;
    while link.noted.awaits() && link.now() < end && link.trouble().is_none() {
        link.wait(end.min(link.now() + STEP));
        while link.receive(0).is_some() {}
    }
}

fn differs_between_profiles(property: &harness_proto::unitek::properties::UnitekProperty) -> bool {
    let profiles = PROFILES.iter().filter_map(|name| Properties::profile(name));
    let values = profiles.map(|profile| property.of_drive(&profile));
    let values: Vec<_> = values.collect();
    values.windows(2).any(|pair| pair[0] != pair[1])
}

const fn permit(limits: &mut Limits, setting: LimitSetting) {
    match setting {
        LimitSetting::Motion => limits.motion = true,
        LimitSetting::Eeprom => limits.eeprom = true,
        LimitSetting::MaxSpeed => limits.max_speed = None,
        _ => {}
    }
}
