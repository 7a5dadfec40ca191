//! Plays a campaign on a shared line: reads its file, plans its cases and classifies their outcomes.

use super::{LineCase, LineOutcome};
use crate::bus_name::BusName;
use crate::campaign::played::{CampaignResult, each_on_threads};
use crate::campaign::{Campaign, CampaignError, CaseFailure, OutcomeClass, PlayedCampaign, names};
use crate::file::values::Time;
use harness_proto::time::{Instant, Span};
use include_dir::Dir;
use std::fmt::{Debug, Display, Write as _};
use std::path::Path;

/// The longest delay of a fault.
const LONGEST: Span = Span::from_millis(10_000);

/// The place of the class of faults that the master did not notice.
const UNNOTICED: usize = 3;

/// What the campaigns of a bus have in common.
#[derive(Debug)]
pub struct LineTable {
    pub bus: BusName,
    /// The campaigns that the binary carries.
    pub built_in: &'static Dir<'static>,
    /// What is disturbed, in the plural: frames or telegrams.
    pub units: &'static str,
    /// The heading above what was disturbed.
    pub heading: &'static str,
    /// The most steps of a conversation.
    pub most_steps: usize,
    /// The longest delay, as messages write it.
    pub longest: &'static str,
    /// The classes: nothing is different; a request was repeated; the master noticed the fault; it did not, and something is wrong.
    pub classes: [OutcomeClass; 4],
}

/// The conversation of a campaign file, which the bus plays with a fault or without.
pub trait DisturbedLine: Debug + Sized + Sync + 'static {
    /// A fault and its place on the line.
    type Fault: Copy + Debug + Sync;
    /// The result of a step. Tables show its text.
    type End: Debug + Display + PartialEq + Sync;
    /// What the drive holds.
    type State: Debug + PartialEq + Sync;
    /// What the master sends and receives.
    type Piece: Debug + Sync;
    /// What the line carries.
    type Carried: Debug + Sync;

    const TABLE: &'static LineTable;

    /// Reads a campaign file.
    ///
    /// # Errors
    /// What is wrong, where, and what is expected.
    fn read(text: &str) -> Result<(Self, LineText), String>;

    /// Plays the conversation; `None` is a defect of the bench.
    fn play(&self, fault: Option<Self::Fault>) -> Option<Conversation<Self>>;

    /// What is wrong with a conversation that was played without a fault.
    fn unsound(steps: &[String], sound: &Conversation<Self>) -> Option<String>;

    /// Every fault at every place.
    fn cases(&self, carried: &[Self::Carried]) -> Vec<(LineCase, Self::Fault)>;

    /// What happened, in a line.
    fn happened(sound: &Conversation<Self>, played: &Conversation<Self>) -> String;

    /// A piece as a scenario writes it.
    fn written(piece: &Self::Piece) -> String;

    /// Lines of a scenario that show what is wrong in the drive at its end.
    fn left(_state: &Self::State, _sound: &Self::State) -> String {
        String::new()
    }
}

/// What a campaign file says besides its faults.
#[derive(Clone, Debug)]
pub struct LineText {
    /// What the campaign shows, in a line.
    pub title: String,
    pub steps: Vec<String>,
    /// The figures that the file pins: of a class, or of all `cases`.
    pub expect: Vec<(&'static str, u64)>,
    /// The source, the bus and the drive in the header of a case's scenario.
    pub header: String,
}

/// What a conversation gave.
#[derive(Debug)]
pub struct Conversation<L: DisturbedLine> {
    /// What each step brought; or how it failed.
    pub ends: Vec<Result<L::End, String>>,
    /// What the master reported besides.
    pub troubles: Vec<String>,
    /// How often the master started the drive again.
    pub starts: u64,
    /// How much the master sent, or repeated: more than without the fault means that it repeated a request.
    pub requests: u64,
    /// What the line carried, in order.
    pub carried: Vec<L::Carried>,
    /// What the drive holds at the end.
    pub state: Option<L::State>,
    /// What the master sent and received, in order.
    pub log: Vec<MasterPiece<L::Piece>>,
    /// How long it took.
    pub end: Instant,
}

/// A piece at the master.
#[derive(Debug)]
pub enum MasterPiece<P> {
    /// It was sent at this time, or as soon as the line was free.
    Sent(Instant, P),
    Received(P),
}

impl<L: DisturbedLine> Conversation<L> {
    /// How each step ended.
    pub fn words(&self) -> Vec<String> {
        let words = |end: &Result<L::End, String>| match end {
            Ok(end) => end.to_string(),
            Err(why) => why.clone(),
        };
        self.ends.iter().map(words).collect()
    }

    /// The first step that failed, counted from 0.
    pub fn failed(&self) -> Option<usize> {
        self.ends.iter().position(Result::is_err)
    }
}

/// The keys that the campaign files of all shared lines have.
pub struct LineKeys<'f> {
    pub schema: u32,
    pub steps: &'f [String],
    /// Whether `late` is among the faults.
    pub late: bool,
    pub delays: &'f [Time],
}

impl LineKeys<'_> {
    /// Checks the keys, and reads the steps.
    ///
    /// # Errors
    /// What is wrong, where, and what is expected.
    pub fn steps<S>(
        &self,
        table: &LineTable,
        step: impl Fn(&str) -> Result<S, String>,
    ) -> Result<Vec<S>, String> {
        let (schema, count, most) = (self.schema, self.steps.len(), table.most_steps);
        if schema != 1 {
            return Err(format!("schema {schema} is not known: write schema = 1"));
        }
        if !(1..=most).contains(&count) {
            return Err(format!(
                "`steps` has {count} entries: 1 to {most} are expected"
            ));
        }
        if self.late == self.delays.is_empty() {
            return Err(
                "`late` in `faults` needs `delays`, such as [\"5ms\"], and `delays` needs `late`"
                    .to_owned(),
            );
        }
        if let Some(long) = self.delays.iter().find(|time| time.span() > LONGEST) {
            return Err(format!(
                "a delay of {long} is too long: at most {} are expected",
                table.longest
            ));
        }
        let read = |(text, number): (&String, usize)| {
            step(text).map_err(|wrong| format!("step {number} (`{text}`): {wrong}"))
        };
        self.steps.iter().zip(1..).map(read).collect()
    }
}

/// A campaign that was read.
#[derive(Debug)]
pub struct LineCampaign<L: DisturbedLine> {
    name: String,
    text: String,
    file: LineText,
    line: L,
    sound: Conversation<L>,
    pub(super) cases: Vec<(LineCase, L::Fault)>,
}

/// The names of the built-in campaigns, in order.
pub fn line_names<L: DisturbedLine>() -> Vec<String> {
    names(L::TABLE.built_in, &folder::<L>())
}

/// In front of the names of the built-in campaigns.
fn folder<L: DisturbedLine>() -> String {
    format!("{}/", L::TABLE.bus.name())
}

/// [`LineCampaign::find`], as a campaign of any bus.
pub fn found<L: DisturbedLine>(name: &Path) -> Option<Result<Box<dyn Campaign>, CampaignError>> {
    let found = LineCampaign::<L>::find(name)?;
    let found = found.map(|campaign| -> Box<dyn Campaign> { Box::new(campaign) });
    Some(found.map_err(CampaignError::Said))
}

impl<L: DisturbedLine> LineCampaign<L> {
    /// Finds and reads a campaign: a file that names the bus, or a built-in one by its name. `None` where it is neither.
    ///
    /// # Errors
    /// What is wrong with it, with file, place and remedy.
    pub fn find(name: &Path) -> Option<Result<Self, String>> {
        let shown = name.display().to_string();
        if name.is_file() {
            let text = std::fs::read_to_string(name).ok()?;
            let table: toml::Table = toml::from_str(&text).ok()?;
            let bus = table.get("bus")?.as_str()?;
            return (bus == L::TABLE.bus.name()).then(|| Self::new(&shown, &text));
        }
        let bare = shown.strip_suffix(".toml").unwrap_or(&shown);
        let inner = bare.strip_prefix(&folder::<L>())?;
        let file = L::TABLE.built_in.get_file(format!("{inner}.toml"))?;
        Some(Self::new(bare, file.contents_utf8()?))
    }

    /// Reads a campaign, and plays its conversation without a fault.
    ///
    /// # Errors
    /// A mistake in the text, or a conversation that does not end well without a fault.
    pub fn new(name: &str, text: &str) -> Result<Self, String> {
        let wrong = |message: String| format!("{name}: {message}");
        let (line, file) = L::read(text).map_err(wrong)?;
        let sound = line.play(None);
        let sound = sound.ok_or_else(|| wrong("the conversation cannot be played".to_owned()))?;
        if let Some(why) = L::unsound(&file.steps, &sound) {
            return Err(wrong(why));
        }
        Ok(Self {
            name: name.to_owned(),
            text: text.to_owned(),
            file,
            cases: line.cases(&sound.carried),
            line,
            sound,
        })
    }

    /// Plays one case: the place of its class, and what the conversation gave.
    pub(super) fn play(
        &self,
        case: &(LineCase, L::Fault),
    ) -> Result<(usize, Conversation<L>), String> {
        let (sound, (case, fault)) = (&self.sound, case);
        let played = self.line.play(Some(*fault)).ok_or_else(|| {
            let (name, case) = (&self.name, case.name());
            format!("{name}: the case {case} cannot be played; please report it")
        })?;
        let noticed = played.failed().is_some() || !played.troubles.is_empty() || played.starts > 0;
        let class = if noticed {
            2
        } else if played.ends != sound.ends || played.state != sound.state {
            UNNOTICED
        } else {
            usize::from(played.requests > sound.requests)
        };
        Ok((class, played))
    }

    /// Plays every case; see [`each_on_threads`].
    ///
    /// # Errors
    /// A case cannot be played: a defect of the bench.
    pub(super) fn played(
        &self,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<CampaignResult<LineOutcome>, String> {
        let outcome = |case: &(LineCase, L::Fault)| {
            let (class, played) = self.play(case)?;
            Ok::<_, String>(LineOutcome {
                case: case.0.clone(),
                table: L::TABLE,
                class,
                happened: L::happened(&self.sound, &played),
                steps: played.words(),
                troubles: played.troubles,
            })
        };
        Ok(CampaignResult {
            name: self.name.trim_end_matches(".toml").to_owned(),
            title: self.file.title.clone(),
            scenario: None,
            drives: 1,
            count: self.sound.carried.len() as u64,
            units: L::TABLE.units,
            classes: &L::TABLE.classes,
            expect: self.file.expect.clone(),
            facts: [("bus".to_owned(), L::TABLE.bus.name().into())]
                .into_iter()
                .collect(),
            outcomes: each_on_threads(&self.cases, threads, progress, || outcome)?,
        })
    }

    /// The scenario of a case: the fault, what the master sent at its time and what it received. What the drive holds unnoticed
    /// stands at its end.
    fn written(&self, case: &LineCase, class: usize, played: &Conversation<L>) -> String {
        let (name, campaign) = (case.name(), self.name.trim_end_matches(".toml"));
        let (header, happened) = (&self.file.header, L::happened(&self.sound, played));
        let OutcomeClass {
            name: of, about, ..
        } = L::TABLE.classes[class];
        let mut text = format!(
            "title   {name} of {campaign}\n{header}\n# {of}: {about}\n# {happened}\n! {}\n\n",
            case.step
        );
        for piece in &played.log {
            // Writing to a String cannot fail.
            let _infallible = match piece {
                MasterPiece::Sent(at, piece) => {
                    writeln!(text, "@{} > {}", time(*at), L::written(piece))
                }
                MasterPiece::Received(piece) => writeln!(text, "< {}", L::written(piece)),
            };
        }
        let _infallible = writeln!(text, "@{} ? quiet", time(played.end));
        if class == UNNOTICED
            && let (Some(state), Some(sound)) = (&played.state, &self.sound.state)
        {
            text += &L::left(state, sound);
        }
        text
    }
}

/// A time of a case, in milliseconds, as a scenario has it.
fn time(at: Instant) -> String {
    let nanos = at.since_start().as_nanos();
    match nanos % 1_000_000 {
        0 => format!("{}ms", nanos / 1_000_000),
        rest => format!("{}.{rest:06}ms", nanos / 1_000_000),
    }
}

impl<L: DisturbedLine> Campaign for LineCampaign<L> {
    fn name(&self) -> &str {
        &self.name
    }

    fn texts(&self) -> Vec<&str> {
        vec![&self.text]
    }

    fn names(&self) -> Vec<String> {
        self.cases.iter().map(|(case, _)| case.name()).collect()
    }

    fn pinned(&self) -> Vec<(&'static str, u64)> {
        self.file.expect.clone()
    }

    fn keep(&mut self, at: &dyn Fn(usize) -> bool) {
        let mut place = 0..;
        self.cases.retain(|_| place.next().is_some_and(at));
        self.file.expect.clear();
    }

    fn cases(&self) -> usize {
        self.cases.len()
    }

    fn scenario(&self, name: &str) -> Result<String, CaseFailure> {
        let found = self.cases.iter().find(|(case, _)| case.name() == name);
        let case = found.ok_or_else(|| {
            let such = self.cases.first().map(|(case, _)| case.name());
            let such = such.unwrap_or_default();
            CaseFailure::Unknown(format!(
                "there is no case `{name}`; a name that --format json lists expected, such as `{such}`"
            ))
        })?;
        let (class, played) = self.play(case).map_err(CaseFailure::Defect)?;
        Ok(self.written(&case.0, class, &played))
    }

    fn run(
        &self,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Box<dyn PlayedCampaign>, String> {
        Ok(Box::new(self.played(threads, progress)?))
    }
}
