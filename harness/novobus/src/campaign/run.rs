//! A campaign, read and played.

use super::fault::CaseFaults;
use super::file::{CampaignFile, read};
use super::plan::{Shape, cases};
use crate::campaign::by_driver::ByDriver;
use crate::campaign::by_manual::{ByManual, MasterBytes};
use crate::campaign::class::{CaseClass, CaseEvidence, OUTCOMES};
use crate::campaign::conversation::{MasterTalk, talk, telegrams};
use crate::campaign::sharing::Sharing;
use crate::language::read::RingScenario;
use crate::language::syntax::{Setup, SetupKind};
use crate::simulate::bench;
use harness_bench::bus_name::BusName;
use harness_bench::campaign::played::{CampaignResult, each_on_threads};
use harness_bench::scenario::files::{LibraryError, sources};
use harness_bench::scenario::parse;
use harness_bench::scenario::problem::{Problem, Problems};
use harness_bench::scenario::source::Source;
use serde_json::Map;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A campaign that can be played.
#[derive(Debug)]
pub(crate) struct Campaign {
    /// Its name, for messages: a path, or the name of a built-in one.
    pub name: String,
    /// The text of its file.
    text: Arc<str>,
    /// What its file says.
    pub file: CampaignFile,
    /// The scenario whose conversation is disturbed.
    pub entry: RingScenario,
    /// How many drives the ring has, and where telegrams begin.
    pub shape: Shape,
    /// The cases, in order.
    pub cases: Vec<CaseFaults>,
    played: ReadyConversation,
}

/// What plays the campaign's conversation.
#[derive(Debug)]
enum ReadyConversation {
    ByManual(Box<ByManual>),
    ByDriver(Box<ByDriver>),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CaseOutcome {
    pub case: CaseFaults,
    /// How many drives the ring has: links are named by them.
    pub drives: u8,
    /// The class of the outcome.
    pub class: CaseClass,
    /// The evidence for this class.
    pub evidence: CaseEvidence,
}

/// A case that fits no class: a defect of the bench.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{campaign}: the case {case} fits no class: {why}; please report it")]
pub(crate) struct Contradiction {
    pub campaign: String,
    pub case: String,
    pub why: &'static str,
}

/// A campaign that has been played.
pub(crate) type PlayedCampaign = CampaignResult<CaseOutcome>;

impl Campaign {
    /// Reads a campaign and its scenario; `folder` is where a scenario's path is looked for first.
    ///
    /// # Errors
    /// Mistakes in either, or a scenario that is not there.
    pub(crate) fn load(source: &Source, folder: &Path) -> Result<Self, Box<Problems>> {
        let read = read(source).map_err(Box::new)?;
        let mistake = |problem: Problem| Box::new(read.problems(problem));
        let beside = folder.join(&read.file.scenario);
        let path = if beside.is_file() {
            beside
        } else {
            PathBuf::from(&read.file.scenario)
        };
        let missing = |error| match error {
            LibraryError::Mistakes(problems) => problems,
            error => {
                let expected = "a built-in scenario, or a file, expected here";
                mistake(read.wrong(&["scenario"], error.to_string(), expected))
            }
        };
        let found = sources(std::slice::from_ref(&path)).map_err(missing)?;
        let Ok([scenario]) = <[Source; 1]>::try_from(found) else {
            let message = "a folder is no scenario";
            return Err(mistake(read.wrong(
                &["scenario"],
                message,
                "one scenario expected here",
            )));
        };
        if parse::bus(&scenario) != BusName::DEFAULT {
            let message = "its bus is not built yet";
            return Err(mistake(read.wrong(
                &["scenario"],
                message,
                "a scenario of a bus that is built is expected here",
            )));
        }
        let entry = RingScenario::new(scenario, read.file.drives)?;
        let plan = &entry.plan;
        let in_scenario = |problem| {
            let source = &entry.source;
            Box::new(Problems::new(
                &source.name,
                source.text.clone(),
                vec![problem],
            ))
        };
        let deviates = |setup: &&Setup| matches!(setup.what, SetupKind::Deviates(_));
        if let Some(setup) = entry.scenario.header.setups.iter().find(deviates) {
            let message = "what a wrong drive does is no measure of the bus";
            return Err(in_scenario(Problem::new(
                setup.span,
                message,
                "drives by the manual expected in a campaign",
            )));
        }
        if let Some(master) = &entry.scenario.header.master {
            let message = "what a wrong master does is no measure of the bus";
            return Err(in_scenario(Problem::new(
                master.span,
                message,
                "a master by the manual expected in a campaign",
            )));
        }
        let start = {
            let mut link = bench(plan);
            link.stop_recording();
            link
        };
        let drives = plan.rings.first().map_or(0, |ring| ring.drives());
        let (played, shape) = match talk(plan).map_err(in_scenario)? {
            MasterTalk::Bytes(bytes) => {
                let Some(by_manual) = ByManual::new(start, bytes) else {
                    let message =
                        "played twice, the conversation leaves other cells than played once";
                    let expected =
                        "a conversation whose telegrams can be repeated is expected there";
                    return Err(mistake(read.wrong(&["scenario"], message, expected)));
                };
                let shape = by_manual.answers().shape.clone();
                (ReadyConversation::ByManual(Box::new(by_manual)), shape)
            }
            MasterTalk::Calls(calls) => {
                let Some(by_driver) = ByDriver::new(start, calls) else {
                    let message = "the driver does not get through it without a fault, or a call is more than one command";
                    return Err(mistake(read.wrong(
                        &["scenario"],
                        message,
                        "calls of one command each expected there",
                    )));
                };
                let telegrams = telegrams(by_driver.sent());
                (
                    ReadyConversation::ByDriver(Box::new(by_driver)),
                    Shape { drives, telegrams },
                )
            }
        };
        read.fits(drives, shape.length()).map_err(mistake)?;
        let cases = cases(&read.file, &shape).map_err(|many| {
            mistake(read.wrong(
                &["faults"],
                many.to_string(),
                "fewer, or `sample`, expected",
            ))
        })?;
        Ok(Self {
            name: source.name.clone(),
            text: source.text.clone(),
            file: read.file,
            entry,
            shape,
            cases,
            played,
        })
    }

    /// The texts of its file and of its scenario.
    #[must_use]
    pub(crate) fn texts(&self) -> [&str; 2] {
        [&self.text, &self.entry.source.text]
    }

    /// Whether the driver plays, and not a master by the manual alone.
    #[must_use]
    pub(crate) fn by_driver(&self) -> bool {
        matches!(self.played, ReadyConversation::ByDriver(_))
    }

    /// The driver, where it plays.
    #[cfg(test)]
    pub(crate) fn driver(&self) -> Option<&ByDriver> {
        match &self.played {
            ReadyConversation::ByDriver(by_driver) => Some(by_driver),
            ReadyConversation::ByManual(_) => None,
        }
    }

    /// Plays one case on a ring of its own.
    ///
    /// # Errors
    /// It fits no class.
    pub(crate) fn play(
        &self,
        case: &CaseFaults,
    ) -> Result<(CaseOutcome, Vec<MasterBytes>), Contradiction> {
        let (evidence, said) = match &self.played {
            ReadyConversation::ByManual(by_manual) => by_manual.play(case),
            ReadyConversation::ByDriver(by_driver) => (by_driver.play(case), Vec::new()),
        };
        Ok((self.outcome(case, evidence)?, said))
    }

    /// The outcome of a case of which this was seen.
    pub(super) fn outcome(
        &self,
        case: &CaseFaults,
        evidence: CaseEvidence,
    ) -> Result<CaseOutcome, Contradiction> {
        let class = evidence.class(&case.links()).map_err(|why| Contradiction {
            campaign: self.name.clone(),
            case: case.name(self.shape.drives),
            why,
        })?;
        Ok(CaseOutcome {
            case: *case,
            drives: self.shape.drives,
            class,
            evidence,
        })
    }

    /// Plays cases one after another, which share what they have in common. The outcomes are those of [`Self::play`].
    #[must_use]
    pub(crate) fn player(&self) -> CasePlayer<'_> {
        CasePlayer {
            campaign: self,
            sharing: self.sharing(),
        }
    }

    /// What its cases share; `None` where they have to be played from the start.
    pub(super) fn sharing(&self) -> Option<Sharing<'_>> {
        match &self.played {
            ReadyConversation::ByManual(by_manual) => Sharing::new(by_manual),
            ReadyConversation::ByDriver(_) => None,
        }
    }

    /// Plays every case on `threads` threads; `progress` is called with the number of cases done since its last call. The outcome
    /// does not depend on the number of threads.
    ///
    /// # Errors
    /// The first case, in the order of the plan, that fits no class.
    pub(crate) fn run(
        &self,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<PlayedCampaign, Contradiction> {
        let player = || {
            let mut player = self.player();
            move |case: &CaseFaults| player.play(case)
        };
        Ok(PlayedCampaign {
            name: self.name.trim_end_matches(".toml").to_owned(),
            title: self.file.title.clone(),
            scenario: Some(self.entry.short_name().to_owned()),
            drives: self.shape.drives,
            count: self.shape.length(),
            units: "bytes",
            classes: &OUTCOMES,
            expect: self.file.expect.pinned(),
            facts: Map::new(),
            outcomes: each_on_threads(&self.cases, threads, progress, player)?,
        })
    }
}

/// Plays cases of a campaign one after another; see [`Campaign::player`].
#[derive(Debug)]
pub(crate) struct CasePlayer<'a> {
    campaign: &'a Campaign,
    /// `None` where cases have to be played from the start.
    sharing: Option<Sharing<'a>>,
}

impl CasePlayer<'_> {
    /// Whether cases share what they have in common.
    #[must_use]
    pub(crate) const fn shares(&self) -> bool {
        self.sharing.is_some()
    }

    /// Plays one case.
    ///
    /// # Errors
    /// It fits no class.
    pub(crate) fn play(&mut self, case: &CaseFaults) -> Result<CaseOutcome, Contradiction> {
        match self.sharing.as_mut().and_then(|sharing| sharing.play(case)) {
            Some(evidence) => self.campaign.outcome(case, evidence.as_ref().clone()),
            None => self.campaign.play(case).map(|(outcome, _)| outcome),
        }
    }
}
