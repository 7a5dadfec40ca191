//! Campaigns on a line of PROFIBUS: one conversation of a master with a slave, disturbed at every octet and telegram, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, `converse` plays the conversation with one fault or none, and this module
//! classifies the outcomes.

mod case;
mod converse;
pub(crate) mod file;
#[cfg(test)]
mod tests;

pub(crate) use converse::{Conversation, StepEnd};
pub(crate) use file::{CampaignStep, TelegramCampaignFile};

use harness_bench::bus_name::BusName;
use harness_bench::campaign::line::{LineOutcome, PlayedLine, case_of};
use harness_bench::campaign::{Campaign, CaseFailure, OutcomeClass, PlayedCampaign};
use harness_proto::nordac::PpoType;
use harness_sim::octet_segment::{LineFault, LineFaultAt};
use include_dir::{Dir, include_dir};
use std::path::Path;

/// The campaigns that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns/nordac");

/// In front of the names of the built-in ones.
const FOLDER: &str = "nordac/";

/// The most octets of a telegram that are shown.
const SHOWN: usize = 8;

/// The classes, in order.
pub(crate) const CLASSES: [OutcomeClass; 4] = [
    OutcomeClass {
        name: "unharmed",
        about: "every step ended as without the fault, and no request was repeated",
        letter: '.',
        gravity: 0,
    },
    OutcomeClass {
        name: "repeated",
        about: "every step ended as without the fault, after a repeated request",
        letter: 'R',
        gravity: 2,
    },
    OutcomeClass {
        name: "fell-back",
        about: "the master started the slave again, or gave up",
        letter: 'F',
        gravity: 4,
    },
    OutcomeClass {
        name: "wrong-word",
        about: "the master noticed nothing, and a word or what the slave holds is wrong",
        letter: 'W',
        gravity: 6,
    },
];

/// A fault at an octet or a telegram of the conversation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TelegramCase {
    /// The telegram, counted from 1 over both stations.
    pub(crate) telegram: usize,
    /// Its octet, counted from 1; `None` for a fault of the whole telegram.
    pub(crate) octet: Option<usize>,
    placed: LineFaultAt,
}

impl TelegramCase {
    #[must_use]
    pub(crate) fn name(&self) -> String {
        format!("{}:{}", self.telegram, self.fault())
    }

    /// The fault, as a scenario writes it, behind the octet that it happens to.
    #[must_use]
    pub(crate) fn fault(&self) -> String {
        let fault = match self.placed.fault {
            LineFault::Octet(own) => own.to_string(),
            LineFault::Telegram(own) => own.to_string(),
        };
        match self.octet {
            Some(octet) => format!("byte {octet} {fault}"),
            None => fault,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct TelegramCampaign {
    name: String,
    /// The text of its file.
    text: String,
    file: TelegramCampaignFile,
    ppo: PpoType,
    steps: Vec<CampaignStep>,
    /// The conversation without a fault.
    sound: Conversation,
    /// The cases, in order of telegrams.
    pub(crate) cases: Vec<TelegramCase>,
}

/// The names of the built-in campaigns, in order.
#[must_use]
pub(crate) fn names() -> Vec<String> {
    let files = BUILT_IN.files();
    let mut names: Vec<_> = files
        .filter_map(|file| file.path().to_str()?.strip_suffix(".toml"))
        .map(|name| format!("{FOLDER}{name}"))
        .collect();
    names.sort_unstable();
    names
}

/// Finds and reads a campaign of telegrams: a file that names this bus, or a built-in one by its name. `None` where it is neither.
///
/// # Errors
/// What is wrong with it, with file, place and remedy.
#[must_use]
pub(crate) fn find(name: &Path) -> Option<Result<TelegramCampaign, String>> {
    let shown = name.display().to_string();
    if name.is_file() {
        let text = std::fs::read_to_string(name).ok()?;
        return file::is_of_this_bus(&text).then(|| TelegramCampaign::new(&shown, &text));
    }
    let bare = shown.strip_suffix(".toml").unwrap_or(&shown);
    let found = BUILT_IN.get_file(format!("{}.toml", bare.strip_prefix(FOLDER)?))?;
    Some(TelegramCampaign::new(bare, found.contents_utf8()?))
}

impl TelegramCampaign {
    /// Reads a campaign, and plays its conversation without a fault.
    ///
    /// # Errors
    /// A mistake in the text, or a conversation that does not end well without a fault.
    pub(crate) fn new(name: &str, text: &str) -> Result<Self, String> {
        let wrong = |message: String| format!("{name}: {message}");
        let (file, ppo, steps) = file::read(text).map_err(wrong)?;
        let sound = converse::converse(&file, ppo, &steps, None)
            .ok_or_else(|| wrong("the conversation cannot be played".to_owned()))?;
        let mut ends = sound.ends.iter().enumerate();
        let bad = ends.find(|(_, end)| !end.is_well());
        if let Some((step, end)) = bad.or_else(|| (sound.starts > 0).then(|| (0, &sound.ends[0]))) {
            return Err(wrong(format!(
                "step {} (`{}`) ends without any fault as: {}; a conversation is expected that begins with `start` and that the slave answers",
                step + 1,
                file.steps[step],
                end.words()
            )));
        }
        let mut campaign = Self {
            name: name.to_owned(),
            text: text.to_owned(),
            cases: Vec::new(),
            file,
            ppo,
            steps,
            sound,
        };
        campaign.cases = campaign.planned();
        Ok(campaign)
    }

    /// Every fault at every place.
    fn planned(&self) -> Vec<TelegramCase> {
        let mut cases = Vec::new();
        let mut before = 0;
        for (number, (_, octets)) in (1..).zip(&self.sound.telegrams) {
            for kind in &self.file.faults {
                for fault in kind.faults(&self.file.delays) {
                    let places = match kind.is_of_octets() {
                        true => (1..=octets.len()).map(Some).collect(),
                        false => vec![None],
                    };
                    cases.extend(places.into_iter().map(|octet| TelegramCase {
                        telegram: number,
                        octet,
                        placed: LineFaultAt {
                            station: None,
                            number: octet.map_or(number, |octet| before + octet) as u64,
                            fault,
                        },
                    }));
                }
            }
            before += octets.len();
        }
        cases
    }

    /// How many telegrams the conversation has without a fault.
    #[must_use]
    pub(crate) fn telegrams(&self) -> usize {
        self.sound.telegrams.len()
    }

    /// Plays one case: the place of its class, and what the conversation gave.
    #[must_use]
    pub(crate) fn play(&self, case: TelegramCase) -> Option<(usize, Conversation)> {
        let played = converse::converse(&self.file, self.ppo, &self.steps, Some(case.placed))?;
        Some((self.class(&played), played))
    }

    fn class(&self, played: &Conversation) -> usize {
        let (sound, gave_up) = (&self.sound, played.ends.iter().any(|end| !end.is_well()));
        if gave_up || played.starts > 0 {
            2
        } else if played.ends != sound.ends || played.state != sound.state {
            3
        } else {
            usize::from(played.repeats > sound.repeats)
        }
    }

    fn outcome(&self, case: &TelegramCase) -> Option<LineOutcome> {
        let (class, played) = self.play(*case)?;
        let (_, octets) = self.sound.telegrams.get(case.telegram.checked_sub(1)?)?;
        let steps: Vec<_> = played.ends.iter().map(StepEnd::words).collect();
        let ends = steps.iter().zip(&self.sound.ends).zip(1..);
        let differing = ends.filter(|((own, sound), _)| **own != sound.words());
        let mut parts: Vec<_> = differing
            .map(|((own, _), step)| format!("step {step}: {own}"))
            .take(3)
            .collect();
        if played.starts > 0 {
            parts.push(format!("started again {}", times(played.starts)));
        }
        if played.repeats > 0 {
            parts.push(format!("repeated {}", times(played.repeats)));
        }
        if parts.is_empty() {
            parts.push("as without the fault".to_owned());
        }
        let more = if octets.len() > SHOWN { " .." } else { "" };
        let octets: Vec<_> = octets
            .iter()
            .take(SHOWN)
            .map(|own| format!("{own:02X}"))
            .collect();
        Some(LineOutcome {
            case: case.name(),
            place: case.telegram as u64,
            fault: case.fault(),
            disturbed: octets.join(" ") + more,
            class,
            happened: parts.join("; "),
            steps,
            troubles: Vec::new(),
        })
    }
}

/// `once`, `twice`, `3 times`.
fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        2 => "twice".to_owned(),
        more => format!("{more} times"),
    }
}

impl TelegramCampaign {
    /// Plays every case, in order; `progress` is called behind each.
    ///
    /// # Errors
    /// A case cannot be played: a defect of the bench.
    fn played(&self, progress: &dyn Fn(u64)) -> Result<PlayedLine, String> {
        let play = |case: &TelegramCase| {
            let outcome = self.outcome(case);
            progress(1);
            outcome.ok_or_else(|| self.defect(case))
        };
        let outcomes: Result<Vec<_>, _> = self.cases.iter().map(play).collect();
        Ok(PlayedLine {
            name: self.name.trim_end_matches(".toml").to_owned(),
            bus: BusName::Nordac.name(),
            title: self.file.title.clone(),
            units: "telegrams",
            count: self.telegrams(),
            heading: "First octets",
            classes: &CLASSES,
            expect: self.pinned(),
            outcomes: outcomes?,
        })
    }

    fn defect(&self, case: &TelegramCase) -> String {
        format!(
            "{}: the case {} cannot be played; please report it",
            self.name,
            case.name()
        )
    }
}

impl Campaign for TelegramCampaign {
    fn name(&self) -> &str {
        &self.name
    }

    fn texts(&self) -> Vec<&str> {
        vec![&self.text]
    }

    fn names(&self) -> Vec<String> {
        self.cases.iter().map(TelegramCase::name).collect()
    }

    fn pinned(&self) -> Vec<(&'static str, u64)> {
        let names = std::iter::once("cases").chain(CLASSES.iter().map(|own| own.name));
        let pinned = names.filter_map(|name| Some((name, *self.file.expect.get(name)?)));
        pinned.collect()
    }

    fn keep(&mut self, at: &dyn Fn(usize) -> bool) {
        let mut place = 0..;
        self.cases.retain(|_| place.next().is_some_and(at));
        self.file.expect = Default::default();
    }

    fn cases(&self) -> usize {
        self.cases.len()
    }

    fn scenario(&self, case: &str) -> Result<String, CaseFailure> {
        let case = case_of(&self.cases, case, TelegramCase::name)?;
        let played = self.outcome(&case).zip(self.play(case));
        let (outcome, (_, conversation)) =
            played.ok_or_else(|| CaseFailure::Defect(self.defect(&case)))?;
        Ok(case::scenario(self, (&case, &outcome), &conversation))
    }

    fn run(
        &self,
        _: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Box<dyn PlayedCampaign>, String> {
        Ok(Box::new(self.played(progress)?))
    }
}
