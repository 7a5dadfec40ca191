//! Scenarios on a rig whose stations share one segment: what running, recording and verifying ask of its bus.

pub mod observed;
pub mod run;

use super::{End, Keeper, PlayedScenario, Rig, SessionError};
use crate::link::{Capability, LinkEvent, Trouble};
use crate::scenario::run::Outcome;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_sim::record::Trace;

/// What the link of a rig with an adapter can do, within the limits of the rig.
pub const ON_PORT: [Capability; 3] = [Capability::Memory, Capability::Motion, Capability::Eeprom];

/// What the first line of a record says of such a rig.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OnSegment {
    /// Bits a second.
    pub rate: u32,
    /// How many drives the rig has.
    pub drives: u8,
    /// How exact its times are; zero where time is virtual.
    pub tolerance: Span,
    /// What its link can do.
    pub capabilities: Vec<Capability>,
}

impl OnSegment {
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
        let has = |own: &&Capability| match own {
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
        }
    }
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

/// A rig in use, on which scenarios of its bus are played.
pub trait SegmentRun {
    /// What a record begins with.
    fn segment(&self) -> OnSegment;

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

    /// The scenarios that a qualification plays behind the selected ones.
    fn conversations(&self) -> Vec<Source> {
        Vec::new()
    }

    /// What the attempts so far come to, in a qualification that began at this date and time of day in UTC; `whole` if everything was played.
    /// `None` for a bus whose drives cannot be qualified.
    fn qualified(&mut self, _began: &str, _whole: bool) -> Option<Qualified> {
        None
    }

    /// Notes about the drives since the last call, in sentences.
    fn notes(&mut self) -> Vec<String>;

    /// Why nothing more is played, in a sentence; `None` if the next scenario can be.
    fn over(&mut self) -> Option<String>;

    /// Why the link carries nothing more.
    fn trouble(&self) -> Option<Trouble>;

    /// Takes the rig to its safe state and gives it back; `error` after a rig error or an interlock.
    fn close(self: Box<Self>, error: bool) -> End;
}

/// An attempt judged again from its record.
#[derive(Clone, Debug)]
pub struct RepeatedVerdict {
    pub outcome: Outcome,
    /// What was received before the scenario, in words.
    pub before: Option<String>,
    /// What the record holds behind the end of the attempt.
    pub left: Option<String>,
    /// Of simulated drives, for which the attempt was played again: what happened, and what the bus carried.
    pub played: Option<(Vec<LinkEvent>, Vec<Trace>)>,
    /// Whether it ends in trouble.
    pub trouble: bool,
}

/// Judges the attempts of a record again, in their order: what one of them found out about the drives counts for those behind it.
pub trait SegmentJudge {
    /// What the first line of the record must say. It names the capabilities of the rig with and without `--allow-motion`.
    fn segments(&self) -> [OnSegment; 2];

    /// Why a scenario is not begun on this rig; `None` if it is.
    fn not_begun(&self, source: &Source) -> Option<Outcome>;

    /// The scenarios that a qualification plays behind the selected ones.
    fn conversations(&self) -> Vec<Source> {
        Vec::new()
    }

    /// The attempts behind are those of another part of a qualification: nothing is known of its drives.
    fn begin_part(&mut self);

    /// What the attempts of all parts judged so far come to; see [`SegmentRun::qualified`].
    fn qualified(&mut self, _began: &str, _whole: bool) -> Option<Qualified> {
        None
    }

    /// Judges an attempt again.
    ///
    /// # Errors
    /// The text is no scenario of this bus, in a sentence.
    fn judge(&mut self, source: &Source, events: &[LinkEvent]) -> Result<RepeatedVerdict, String>;

    /// Something was lost in the attempt that was judged last.
    fn doubt(&mut self) {}
}
