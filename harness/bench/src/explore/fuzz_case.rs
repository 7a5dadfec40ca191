//! What a bus implements so that a run can explore it: the conversation as a value, and how to make, compare and describe it.

use super::confirm::Confirmation;
use super::{ExploreError, Finding, FuzzSettings, KeptRun, Pool, Rehearsal, Swarm, Target};
use crate::explore::Dice;
use crate::html::Html;
use crate::manual::Manual;
use crate::scenario::problem::Problems;
use crate::scenario::settled::Settled;
use crate::scenario::source::Source;
use crate::scenario::syntax::ScenarioHead;
use crate::shown::SegmentReport;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::Arc;

/// Something that a conversation can have.
pub trait Spiced: Copy + Ord + Debug + 'static {
    /// All with their names.
    const ALL: &'static [(&'static str, Self)];

    fn name(self) -> &'static str {
        let named = Self::ALL.iter().find(|(_, known)| *known == self);
        named.map_or("", |(name, _)| name)
    }
}

/// A mismatch of a drive with the expected behaviour.
pub trait Differing: Clone + Debug + PartialEq + Eq + Serialize + DeserializeOwned {
    /// Whether another one is of the same kind: the same symptom, against the same rule of the same section.
    fn is_like(&self, other: &Self) -> bool;
    /// Identifies it within a run.
    fn key(&self) -> String;
    /// Its kind in words.
    fn signature(&self) -> String;
    /// The whole difference, as a sentence.
    fn about(&self) -> &str;
    /// The number of the received byte or frame, counted from 1; `None` if the difference is at none.
    fn place(&self) -> Option<usize>;
    /// Whether only the time of that byte or frame differs.
    fn is_time(&self) -> bool;
}

/// The result of judging a finding again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JudgedAgain {
    Same,
    /// Something else, and what.
    Differs(String),
    /// The folder lacks the files that it needs.
    Unknown,
}

/// A conversation with drives of one bus.
pub trait FuzzCase:
    Clone + Debug + PartialEq + Eq + Serialize + DeserializeOwned + 'static
{
    /// The manual of its bus.
    const MANUAL: Manual;
    /// How what its bus carries is shown.
    const REPORT: &'static dyn SegmentReport;

    /// What conversations of a run may have, and with what drives.
    type Scope: Clone + Debug;
    /// What the simulated drives are made of.
    type Setup: Clone + Debug + PartialEq + Eq + Serialize + DeserializeOwned;
    /// Something that a conversation can have.
    type Spice: Spiced;
    /// What the model answers.
    type Seen: Clone + Debug + Default;
    /// A mismatch with the expected behaviour.
    type Difference: Differing;
    /// An attempt with all that its difference rests on.
    type Attempt: Clone + Debug + PartialEq + Eq + Serialize + DeserializeOwned;
    /// A part of a conversation.
    type Act: Clone + Debug;

    /// The subset of a round of a run, of what the scope allows.
    fn swarm(seed: u64, round: u64, scope: &Self::Scope) -> Swarm<Self::Spice>;

    /// The queries of the drives before the first random case.
    fn tour(scope: &Self::Scope, about: &FuzzSettings<Self>) -> Vec<Self>;

    /// The case of a number; `tour_and_number` has the tour too. It depends on the numbers of `dice`, and on what was kept before.
    fn made(
        scope: &Self::Scope,
        swarm: &Swarm<Self::Spice>,
        tour_and_number: (&[Self], u64),
        pool: &Pool<Self>,
        dice: &mut Dice,
    ) -> Self;

    /// Whether it is for the drives of a run.
    fn is_of(&self, about: &FuzzSettings<Self>) -> bool;

    /// Which drives it is with, 0 or 1; cases with different ones are not mixed.
    fn lane(&self) -> usize;

    /// How the drives of a finding differ, in words for a title.
    fn kind(finding: &Finding<Self>) -> String {
        finding.difference.signature()
    }

    /// The title of a finding.
    fn title(finding: &Finding<Self>) -> String {
        format!("Found by fuzzing: {}", Self::kind(finding))
    }

    /// The scenario of a finding, with this title and this table of the manual, or that of the finding. On `deviating` drives, which have the
    /// planted deviations, it fails where the difference reaches the master.
    ///
    /// # Errors
    /// The model cannot be made.
    fn scenario(
        finding: &Finding<Self>,
        title: &str,
        source: Option<&str>,
        deviating: bool,
    ) -> Result<String, ExploreError>;

    /// The scenario as it stands beside the finding.
    ///
    /// # Errors
    /// The model cannot be made.
    fn text(finding: &Finding<Self>) -> Result<String, ExploreError> {
        Self::scenario(finding, &Self::title(finding), None, false)
    }

    /// Whether a deviation was planted in drives of these.
    fn deviates(setup: &Self::Setup) -> bool;

    /// The folder and the text of an input of the fuzz targets; `None` where the bus has none.
    fn input(finding: &Finding<Self>, title: &str) -> Option<(&'static str, String)> {
        let _no_input = (finding, title);
        None
    }

    /// Judges a finding again: on simulated drives it is played again, on a rig with ports its attempts are in its file. `known` says how
    /// often each difference was found before, by its key.
    ///
    /// # Errors
    /// The model cannot be made, or the attempts are not those of a run.
    fn again(
        finding: &Finding<Self>,
        about: &FuzzSettings<Self>,
        known: &BTreeMap<String, u8>,
    ) -> Result<JudgedAgain, ExploreError>;

    /// Reads and settles the scenario of a finding.
    ///
    /// # Errors
    /// Its mistakes.
    fn settled(source: &Source) -> Result<(ScenarioHead, Arc<dyn Settled>), Problems>;

    /// The deviations that are planted, as header lines.
    fn planted(setup: &Self::Setup) -> Vec<String>;

    /// What the kept cases of a run have reached, with a heading, for its page; `None` where that is not counted.
    ///
    /// # Errors
    /// A case of the record is damaged.
    fn reached(_kept: &KeptRun<Self>) -> Result<Option<(String, Html)>, ExploreError> {
        Ok(None)
    }

    /// Whether a finding that was read is within the bounds of what a run writes.
    fn is_sound(finding: &Finding<Self>) -> bool;

    /// Tries a finding again until it is confirmed, or is not. `before` is what was sent before its case.
    ///
    /// # Errors
    /// The rig cannot continue.
    fn confirm(
        confirmation: &mut Confirmation<'_>,
        finding: &mut Finding<Self>,
        rehearsal: &Rehearsal<Self>,
        before: Option<&[Self::Act]>,
        target: &mut dyn Target<Self>,
    ) -> Result<(), ExploreError> {
        let _begins_anew = before;
        confirmation.again(finding, rehearsal, target)?;
        if !finding.confirmed {
            confirmation.by_others(finding);
        }
        Ok(())
    }
}
