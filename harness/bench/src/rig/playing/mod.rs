//! Scenarios on a rig whose stations share one segment: what running, recording and verifying ask of its bus.

pub mod observed;
pub mod run;

use super::{Attempt, End, Keeper, PlayedScenario, Rig, SessionError};
use crate::bus_name::BusName;
use crate::link::{Capability, Line as _, LinkEvent, Replay, Trouble};
use crate::scenario::parse;
use crate::scenario::run::{Outcome, Skip};
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::collections::VecDeque;

/// What the link of a rig with an adapter can do, within the limits of the rig.
pub const ON_PORT: [Capability; 3] = [Capability::Memory, Capability::Motion, Capability::Eeprom];

/// What the first line of a record says of such a rig.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedBench {
    /// Bits a second.
    pub rate: u32,
    /// How many drives the rig has.
    pub drives: u8,
    /// How exact its times are; zero where time is virtual.
    pub tolerance: Span,
    /// What its link can do.
    pub capabilities: Vec<Capability>,
    /// Whether every drive is reset before a scenario.
    pub anew: bool,
}

impl RecordedBench {
    /// What it says of a rig: its `rate` in bits a second, how exact its times are behind a port, what a simulated link can do, and whether
    /// motors may turn and EEPROMs be written.
    pub fn of(
        rig: &Rig,
        (rate, tolerance): (u32, Span),
        simulated: &[Capability],
        (motion, eeprom): (bool, bool),
    ) -> Self {
        let (all, tolerance) = match rig.is_simulated() {
            true => (simulated, Span::ZERO),
            false => (ON_PORT.as_slice(), tolerance),
        };
        let has = |capability: &&Capability| match capability {
            Capability::Motion => motion,
            Capability::Eeprom => eeprom,
            // No record shows them.
            Capability::Tap | Capability::Simulator | Capability::Power => false,
            _ => true,
        };
        let drives = rig.port().map_or(0, |port| port.drives.len());
        Self {
            rate,
            drives: u8::try_from(drives).unwrap_or(u8::MAX),
            tolerance,
            capabilities: all.iter().filter(has).copied().collect(),
            anew: false,
        }
    }
}

/// A scenario of this bus, which `read` reads, or why a rig of the bus does not play it.
///
/// # Errors
/// It is of another bus. A scenario with mistakes is refused where it is selected.
pub fn of_bus<S, E>(
    bus: BusName,
    source: &Source,
    read: impl FnOnce(&Source) -> Result<S, E>,
) -> Result<S, Skip> {
    let named = parse::bus(source);
    let scenario = (named == bus).then(|| read(source).ok()).flatten();
    scenario.ok_or_else(|| Skip::not_on_rig(named))
}

/// What a qualification comes to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Qualified {
    /// The text of `profile.toml`; `None` where the drives were not asked.
    pub profile: Option<String>,
    /// The text of `deviations.txt`: which deviations there are, and what was compared.
    pub deviations: String,
    /// The verdict on the drives.
    pub verdict: Verdict,
}

/// Plays a scenario into what keeps it.
pub type Play<'p> = dyn FnMut(Option<&mut dyn Keeper>) -> Result<PlayedScenario, SessionError> + 'p;

/// A qualification was ended by what keeps its scenarios.
#[derive(Clone, Copy, Debug)]
pub struct QualificationStopped;

/// What keeps and shows the scenarios that a qualification plays after the selected ones.
pub trait QualificationKeeper {
    /// When it began, as a date and time of day in UTC.
    fn began(&self) -> String;

    /// Plays a scenario into the folder of evidence, where there is one.
    ///
    /// # Errors
    /// Nothing more can be played or kept.
    fn play(
        &mut self,
        source: &Source,
        play: &mut Play<'_>,
    ) -> Result<PlayedScenario, QualificationStopped>;

    /// Shows the outcome of a scenario.
    ///
    /// # Errors
    /// It cannot be written.
    fn show(
        &mut self,
        source: &Source,
        played: &PlayedScenario,
    ) -> Result<(), QualificationStopped>;

    /// Shows a result.
    ///
    /// # Errors
    /// It cannot be written.
    fn tell(&mut self, text: &str) -> Result<(), QualificationStopped>;

    /// Says something for people.
    fn say(&mut self, text: &str);

    /// Reports an error.
    fn complain(&mut self, why: &str);
}

/// A rig in use, on which scenarios of its bus are played.
pub trait RigRun {
    /// What a record begins with.
    fn segment(&mut self) -> RecordedBench;

    /// Why scenarios are not played that need line errors, in sentences; see [`UseOptions::tries_line_errors`].
    ///
    /// # Errors
    /// The drives do not answer since then.
    ///
    /// [`UseOptions::tries_line_errors`]: crate::rig::UseOptions::tries_line_errors
    fn obstacles(&mut self) -> Result<Vec<String>, SessionError> {
        Ok(Vec::new())
    }

    /// Whether a scenario that the rig's limits do not permit to its end is skipped before anything of it is sent, where the bus can tell.
    /// By default it is.
    fn rehearse(&mut self, _rehearses: bool) {}

    /// Plays a scenario, and again if it did not pass, as often as the rig's file says. Afterwards the drives are in their safe state, with
    /// the registers that the scenario changed set back.
    ///
    /// # Errors
    /// The scenario cannot be read; it could be when it was selected.
    fn play(
        &mut self,
        source: &Source,
        keeper: Option<&mut dyn Keeper>,
    ) -> Result<PlayedScenario, SessionError>;

    /// Takes note of a selected scenario of a qualification, by its name in the folder of evidence.
    fn note(&mut self, _name: &str, _played: &PlayedScenario) {}

    /// Plays what a qualification plays after the selected scenarios; with `thorough` the long conversations too. Returns what all comes to.
    ///
    /// # Errors
    /// [`QualificationStopped`].
    fn qualify(
        &mut self,
        thorough: bool,
        keeper: &mut dyn QualificationKeeper,
    ) -> Result<Qualified, QualificationStopped>;

    /// Notes about the drives since the last call, in sentences.
    fn notes(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// Why nothing more is played, in a sentence; `None` if the next scenario can be.
    fn over(&mut self) -> Option<String>;

    /// Why the link carries nothing more.
    fn trouble(&mut self) -> Option<Trouble>;

    /// Whether nothing more can or may be played. `complain` is given the reason, where the link does not tell it.
    fn is_over(&mut self, complain: &mut dyn FnMut(&str)) -> bool {
        if let Some(why) = self.over() {
            complain(&why);
            return true;
        }
        self.trouble().is_some_and(|trouble| trouble.ends_a_run())
    }

    /// What the transport has measured in the run, in lines.
    fn measured(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    fn close(self: Box<Self>, error: bool) -> End;
}

/// An attempt as it is recorded.
#[derive(Clone, Copy, Debug)]
pub struct RecordedAttempt<'r> {
    pub events: &'r [LinkEvent],
    /// Number of line errors that the transport reported without their bytes.
    pub unplaced: u64,
}

/// An attempt judged again from its record.
#[derive(Clone, Debug)]
pub struct RepeatedVerdict {
    pub attempt: Attempt,
    /// What the record holds after the end of the attempt.
    pub left: Option<String>,
    /// Of simulated drives, for which the attempt was played again: what happened, and what the bus carried.
    pub played: Option<(Vec<LinkEvent>, Vec<Trace>)>,
    /// Whether it ends in trouble.
    pub trouble: bool,
    /// Whether the outcome must be the same to the last remark and moment.
    pub exact: bool,
}

impl RepeatedVerdict {
    /// Of an attempt that was played on its record.
    pub fn of(attempt: Attempt, record: &Replay, exact: bool) -> Self {
        Self {
            attempt,
            left: record.left(),
            played: None,
            trouble: record.trouble().is_some(),
            exact,
        }
    }
}

/// A scenario that a qualification plays after the selected ones.
#[derive(Clone, Debug)]
pub struct QualifyingScenario {
    pub source: Source,
    /// Whether it is played each time; a probe may end with its first conversation.
    pub always: bool,
}

/// A scenario of a record, as it was played.
#[derive(Clone, Debug)]
pub struct RecordedCase {
    pub name: String,
    /// The sum of its text.
    pub sum: String,
    /// Its attempts, judged again.
    pub played: PlayedScenario,
    /// Whether the rig's line was lost in it, or the like.
    pub ends_the_run: bool,
}

/// A part of a qualification that was split.
#[derive(Clone, Debug)]
pub struct RecordedPart {
    pub name: String,
    /// The selected scenarios, with their places in the list of all.
    pub selected: Vec<(usize, RecordedCase)>,
    /// What it has played after them.
    pub cases: VecDeque<RecordedCase>,
    /// Whether it was played to its end.
    pub whole: bool,
}

/// What was played in a qualification.
#[derive(Clone, Debug)]
pub enum QualificationRecord<'r> {
    /// The scenarios of one run, and how many of them were selected; `whole` if everything was played.
    Run {
        cases: VecDeque<RecordedCase>,
        selected: usize,
        whole: bool,
    },
    /// The parts of a run that was split, and what none of them has played, in sentences.
    Parts {
        parts: Vec<RecordedPart>,
        missing: &'r [String],
    },
}

/// Judges the attempts of a record again, in their order: what one of them found out about the drives counts for those after it.
pub trait RecordJudge {
    /// Takes the capabilities in the first line of a record, and returns what that line must say. They tell whether motors could turn.
    fn adopt(&mut self, capabilities: &[String]) -> RecordedBench;

    /// Whether attempts on simulated drives are played again one by one. Where drives are not restarted for each attempt, the whole run is.
    fn plays_again(&self) -> bool {
        true
    }

    /// Why a scenario is not begun on this rig; `None` if it is. The record gives these remarks for it.
    fn not_begun(&self, source: &Source, remarks: &[String]) -> Option<Outcome>;

    /// The scenarios that a qualification plays after the selected ones.
    fn conversations(&self) -> Vec<QualifyingScenario>;

    /// Whether a qualification makes scenarios of such a name from what it has heard.
    fn is_trial(&self, _name: &str) -> bool {
        false
    }

    /// The next attempts are those of another part of a qualification: nothing is known of its drives.
    fn begin_part(&mut self);

    /// What a qualification comes to that began at this date and time of day in UTC: each outcome that its record allows, none if the record
    /// ends where it has no outcome.
    ///
    /// # Errors
    /// The record is none of a qualification, in a sentence.
    fn qualified(
        &mut self,
        began: &str,
        record: QualificationRecord<'_>,
    ) -> Result<Vec<Qualified>, String>;

    /// Judges an attempt again.
    ///
    /// # Errors
    /// The text is no scenario of this bus, in a sentence.
    fn judge(
        &mut self,
        source: &Source,
        recorded: RecordedAttempt<'_>,
    ) -> Result<RepeatedVerdict, String>;
}
