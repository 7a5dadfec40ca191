//! Campaigns on a CAN segment: one conversation of the master with a drive, disturbed at every frame, and what came of it.
//!
//! [`file`](mod@file) says what stands in a campaign file, `converse` plays the conversation with one fault or none, and this module
//! classifies the outcomes and counts them.

mod case;
mod converse;
pub(crate) mod file;

pub(crate) use converse::{Conversation, JobEnd};
pub(crate) use file::{CampaignStep, FrameCampaignFile};

use harness_bench::bus_name::BusName;
use harness_bench::campaign::line::{LineOutcome, PlayedLine, case_of};
use harness_bench::campaign::{Campaign, CaseFailure, OutcomeClass, PlayedCampaign};
use harness_sim::segment::{FrameFault, Placed};
use include_dir::{Dir, include_dir};
use std::fmt;
use std::path::Path;

/// The campaigns that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/campaigns/unitek");

/// In front of the names of the built-in ones.
const FOLDER: &str = "unitek/";

/// What came of a fault; the least serious class comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FrameClass {
    /// Nothing is different, and the master sent nothing again.
    Answered,
    /// The master sent a request again, and nothing else is different.
    Retried,
    /// The master reported it: a job without a right end, or a disturbance.
    Noticed,
    /// The master reported nothing, and a result or what the drive holds is wrong.
    Unnoticed,
}

impl FrameClass {
    /// All of them, in order.
    pub(crate) const ALL: [Self; 4] = [
        Self::Answered,
        Self::Retried,
        Self::Noticed,
        Self::Unnoticed,
    ];
}

/// The classes, in order.
const CLASSES: [OutcomeClass; 4] = [
    OutcomeClass {
        name: "answered",
        about: "every job ended as without the fault",
        letter: '.',
        gravity: 0,
    },
    OutcomeClass {
        name: "retried",
        about: "every job ended as without the fault, after a repeated request",
        letter: 'R',
        gravity: 2,
    },
    OutcomeClass {
        name: "noticed",
        about: "the master reported the fault",
        letter: 'N',
        gravity: 4,
    },
    OutcomeClass {
        name: "unnoticed",
        about: "the master reported nothing, and a result or what the drive holds is wrong",
        letter: 'U',
        gravity: 6,
    },
];

/// A fault at a frame of the conversation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FrameCase {
    /// The frame, counted from 1 over both stations.
    pub(crate) frame: u64,
    pub(crate) fault: FrameFault,
}

impl fmt::Display for FrameCase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.frame, self.fault)
    }
}

/// A case that was played.
#[derive(Clone, Debug)]
pub(crate) struct FrameOutcome {
    pub(crate) case: FrameCase,
    /// The disturbed frame, as candump writes it.
    pub(crate) disturbed: String,
    /// The class of the outcome.
    pub(crate) class: FrameClass,
    /// What the conversation gave.
    pub(crate) conversation: Conversation,
}

#[derive(Clone, Debug)]
pub(crate) struct FrameCampaign {
    /// Its name, for messages: a path, or the name of a built-in one.
    pub(crate) name: String,
    /// The text of its file.
    text: String,
    /// What its file says.
    pub(crate) file: FrameCampaignFile,
    steps: Vec<CampaignStep>,
    /// The conversation without a fault.
    sound: Conversation,
    /// The cases, in order of frames.
    pub(crate) cases: Vec<FrameCase>,
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

/// Finds and reads a campaign of frames: a file that names this bus, or a built-in one by its name. `None` where it is neither.
///
/// # Errors
/// What is wrong with it, with file, place and remedy.
#[must_use]
pub(crate) fn find(name: &Path) -> Option<Result<FrameCampaign, String>> {
    let shown = name.display().to_string();
    if name.is_file() {
        let text = std::fs::read_to_string(name).ok()?;
        return file::is_of_this_bus(&text).then(|| FrameCampaign::new(&shown, &text));
    }
    let bare = shown.strip_suffix(".toml").unwrap_or(&shown);
    let found = BUILT_IN.get_file(format!("{}.toml", bare.strip_prefix(FOLDER)?))?;
    Some(FrameCampaign::new(bare, found.contents_utf8()?))
}

impl FrameCampaign {
    /// Reads a campaign, and plays its conversation without a fault.
    ///
    /// # Errors
    /// A mistake in the text, or a conversation that does not end well without a fault.
    pub(crate) fn new(name: &str, text: &str) -> Result<Self, String> {
        let wrong = |message: String| format!("{name}: {message}");
        let (file, steps) = file::read(text).map_err(wrong)?;
        let sound = converse::converse(&file, &steps, None);
        if let Some((step, end)) = sound
            .ends
            .iter()
            .enumerate()
            .find(|(_, end)| !end.is_well())
        {
            return Err(wrong(format!(
                "step {} ({}) ends without any fault as {}; a conversation is expected that the drive answers",
                step + 1,
                file.steps[step],
                end.words()
            )));
        }
        if let Some(disturbance) = sound.disturbances.first() {
            return Err(wrong(format!(
                "the master reports {disturbance} without any fault; give the steps more time"
            )));
        }
        let faults = file.faults();
        let frames = 1..=sound.frames.len() as u64;
        let cases =
            frames.flat_map(|frame| faults.iter().map(move |&fault| FrameCase { frame, fault }));
        Ok(Self {
            name: name.to_owned(),
            text: text.to_owned(),
            cases: cases.collect(),
            file,
            steps,
            sound,
        })
    }

    /// How many frames the conversation has without a fault.
    #[must_use]
    pub(crate) fn frames(&self) -> usize {
        self.sound.frames.len()
    }

    /// Plays one case.
    #[must_use]
    pub(crate) fn play(&self, case: FrameCase) -> FrameOutcome {
        let placed = Placed {
            station: None,
            frame: case.frame,
            fault: case.fault,
        };
        let conversation = converse::converse(&self.file, &self.steps, Some(placed));
        let place = usize::try_from(case.frame).unwrap_or(usize::MAX);
        let disturbed = self.sound.frames.get(place.wrapping_sub(1));
        FrameOutcome {
            case,
            disturbed: disturbed.map(ToString::to_string).unwrap_or_default(),
            class: self.class(&conversation),
            conversation,
        }
    }

    fn class(&self, played: &Conversation) -> FrameClass {
        let reported = !played.disturbances.is_empty() || !played.ends.iter().all(JobEnd::is_well);
        if reported {
            FrameClass::Noticed
        } else if played.ends != self.sound.ends || played.state != self.sound.state {
            FrameClass::Unnoticed
        } else if played.sent > self.sound.sent {
            FrameClass::Retried
        } else {
            FrameClass::Answered
        }
    }
}

impl FrameOutcome {
    /// What happened, in a line.
    fn happened(&self) -> String {
        let played = &self.conversation;
        let jobs = played
            .ends
            .iter()
            .enumerate()
            .filter(|(_, end)| !end.is_well());
        let jobs = jobs.map(|(step, end)| format!("step {}: {}", step + 1, end.words()));
        let parts: Vec<_> = jobs
            .chain(played.disturbances.iter().cloned())
            .take(4)
            .collect();
        if parts.is_empty() {
            let ends: Vec<_> = played.ends.iter().map(JobEnd::words).collect();
            return format!("reported: {}", ends.join(", "));
        }
        parts.join("; ")
    }

    /// In no bus's words.
    fn line(&self) -> LineOutcome {
        LineOutcome {
            case: self.case.to_string(),
            place: self.case.frame,
            fault: self.case.fault.to_string(),
            disturbed: self.disturbed.clone(),
            class: self.class as usize,
            happened: self.happened(),
            steps: self.conversation.ends.iter().map(JobEnd::words).collect(),
            troubles: self.conversation.disturbances.clone(),
        }
    }
}

impl FrameCampaign {
    /// Plays every case, in order; `progress` is called behind each.
    fn played(&self, progress: &dyn Fn(u64)) -> PlayedLine {
        let play = |case: &FrameCase| {
            let outcome = self.play(*case).line();
            progress(1);
            outcome
        };
        PlayedLine {
            name: self.name.trim_end_matches(".toml").to_owned(),
            bus: BusName::Unitek.name(),
            title: self.file.title.clone(),
            units: "frames",
            count: self.frames(),
            heading: "As candump writes it",
            classes: &CLASSES,
            expect: self.pinned(),
            outcomes: self.cases.iter().map(play).collect(),
        }
    }
}

impl Campaign for FrameCampaign {
    fn name(&self) -> &str {
        &self.name
    }

    fn texts(&self) -> Vec<&str> {
        vec![&self.text]
    }

    fn names(&self) -> Vec<String> {
        self.cases.iter().map(FrameCase::to_string).collect()
    }

    fn pinned(&self) -> Vec<(&'static str, u64)> {
        let expect = &self.file.expect;
        let all = expect.cases.map(|count| ("cases", count));
        let classes = CLASSES.iter().zip(FrameClass::ALL);
        let pinned = classes.filter_map(|(class, own)| Some((class.name, expect.of(own)?)));
        all.into_iter().chain(pinned).collect()
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
        let case = case_of(&self.cases, case, ToString::to_string)?;
        Ok(case::scenario(self, &self.play(case)))
    }

    fn run(
        &self,
        _: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Box<dyn PlayedCampaign>, String> {
        Ok(Box::new(self.played(progress)))
    }
}

#[cfg(test)]
mod tests;
