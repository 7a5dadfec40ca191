//! What stands in a campaign file of this bus (`corpora/campaigns/unitek/*.toml`).

use super::FrameClass;
use harness_bench::file::values::Time;
use harness_proto::time::Span;
use harness_proto::unitek::master::{Job, Options};
use harness_proto::unitek::{Data, Register};
use harness_sim::segment::FrameFault;
use serde::Deserialize;

/// The most steps of a conversation.
const MOST_STEPS: usize = 200;

/// The longest wait and the longest delay, in ms.
const LONGEST: u64 = 10_000;

/// A campaign file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct FrameCampaignFile {
    /// The version of this schema: 1.
    pub(crate) schema: u32,
    /// The bus: `unitek`.
    pub(crate) bus: String,
    /// What the campaign shows, in a line.
    pub(crate) title: String,
    /// What the master does, see [`CampaignStep`].
    pub(crate) steps: Vec<String>,
    /// The kinds of faults.
    pub(crate) faults: Vec<FaultName>,
    /// By how much `late` delays.
    #[serde(default)]
    pub(crate) delays: Vec<Time>,
    /// How often a request without a reply is repeated; 2 where nothing is said.
    pub(crate) repeats: Option<u8>,
    /// Whether writes are read back; they are where nothing is said.
    pub(crate) read_back: Option<bool>,
    /// How many cases there must be of each class; what is not named is not looked at.
    #[serde(default)]
    pub(crate) expect: FrameExpect,
}

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum FaultName {
    /// No station receives it, and its sender does not notice.
    Lost,
    /// It arrives twice.
    Doubled,
    /// It arrives later.
    Late,
    /// It is damaged, and repeated by its sender's controller.
    Corrupt,
    /// No station acknowledges it, and its sender's controller repeats it.
    NoAcknowledge,
    /// Its sender's controller goes to bus-off.
    BusOff,
}

/// The figures that a campaign pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FrameExpect {
    /// All cases together.
    pub(crate) cases: Option<u64>,
    /// See [`FrameClass::Answered`].
    pub(crate) answered: Option<u64>,
    /// See [`FrameClass::Retried`].
    pub(crate) retried: Option<u64>,
    /// See [`FrameClass::Noticed`].
    pub(crate) noticed: Option<u64>,
    /// See [`FrameClass::Unnoticed`].
    pub(crate) unnoticed: Option<u64>,
}

impl FrameExpect {
    /// How many cases of a class are expected.
    #[must_use]
    pub(crate) const fn of(&self, class: FrameClass) -> Option<u64> {
        match class {
            FrameClass::Answered => self.answered,
            FrameClass::Retried => self.retried,
            FrameClass::Noticed => self.noticed,
            FrameClass::Unnoticed => self.unnoticed,
        }
    }
}

/// A step of the conversation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CampaignStep {
    /// `read REGISTER`, `write REGISTER = HEX`, `cycle REGISTER MS`, `stop REGISTER`, `start-up`: a job, to its end.
    Job(Job),
    /// `wait MS`.
    Wait(Span),
}

impl FrameCampaignFile {
    /// The faults, each delay of its own.
    #[must_use]
    pub(super) fn faults(&self) -> Vec<FrameFault> {
        let delays = || self.delays.iter().map(|time| FrameFault::Late(span(*time)));
        let faults = self.faults.iter().flat_map(|name| match name {
            FaultName::Lost => vec![FrameFault::Lost],
            FaultName::Doubled => vec![FrameFault::Doubled],
            FaultName::Late => delays().collect(),
            FaultName::Corrupt => vec![FrameFault::Corrupt],
            FaultName::NoAcknowledge => vec![FrameFault::NoAcknowledge],
            FaultName::BusOff => vec![FrameFault::BusOff],
        });
        faults.collect()
    }

    /// The settings of the master.
    #[must_use]
    pub(super) fn options(&self) -> Options {
        let usual = Options::default();
        Options {
            repeats: self.repeats.unwrap_or(usual.repeats),
            read_back: self.read_back.unwrap_or(usual.read_back),
            ..usual
        }
    }
}

fn span(time: Time) -> Span {
    Span::from_nanos(u64::try_from(time.0.as_nanos()).unwrap_or(u64::MAX))
}

/// Whether a text names this bus.
pub(super) fn is_of_this_bus(text: &str) -> bool {
    let table: Result<toml::Table, _> = toml::from_str(text);
    table.is_ok_and(|table| table.get("bus").and_then(|bus| bus.as_str()) == Some("unitek"))
}

/// Reads a campaign file and its steps.
///
/// # Errors
/// What is wrong, where, and what is expected.
pub(super) fn read(text: &str) -> Result<(FrameCampaignFile, Vec<CampaignStep>), String> {
    let file: FrameCampaignFile = toml::from_str(text).map_err(|error| error.to_string())?;
    if file.schema != 1 {
        return Err(format!(
            "schema {} is not known: write schema = 1",
            file.schema
        ));
    }
    if file.steps.is_empty() || file.steps.len() > MOST_STEPS {
        return Err(format!(
            "`steps` has {} entries: 1 to {MOST_STEPS} are expected",
            file.steps.len()
        ));
    }
    if file.faults.contains(&FaultName::Late) == file.delays.is_empty() {
        return Err(
            "`late` in `faults` needs `delays`, such as [\"5ms\"], and `delays` needs `late`"
                .to_owned(),
        );
    }
    if let Some(long) = file
        .delays
        .iter()
        .find(|time| span(**time) > Span::from_millis(LONGEST))
    {
        return Err(format!(
            "a delay of {long} is too long: at most {LONGEST} ms are expected"
        ));
    }
    let read = |(index, text): (usize, &String)| {
        step(text).map_err(|wrong| format!("step {} (`{text}`): {wrong}", index + 1))
    };
    let steps = file
        .steps
        .iter()
        .enumerate()
        .map(read)
        .collect::<Result<_, _>>()?;
    Ok((file, steps))
}

/// One step.
fn step(text: &str) -> Result<CampaignStep, String> {
    let words: Vec<_> = text.split_whitespace().collect();
    let register = |name: &str| Register::named(name).map_err(|error| error.to_string());
    Ok(match words[..] {
        ["read", name] => CampaignStep::Job(Job::Read { register: register(name)?.number }),
        ["stop", name] => CampaignStep::Job(Job::Stop { register: register(name)?.number }),
        ["write", name, "=", value] => {
            let register = register(name)?;
            let raw = u32::from_str_radix(value, 16).ok().filter(|raw| raw & !register.mask() == 0);
            let width = register.width.bits() / 4;
            let raw = raw.ok_or_else(|| format!("`{value}` is no value of {name}: at most {width} hexadecimal digits are expected"))?;
            CampaignStep::Job(Job::Write { register: register.number, data: Data::of(register, raw) })
        }
        ["cycle", name, time] => {
            let every = millis(time)?;
            let every = u8::try_from(every).ok().filter(|every| (1..=254).contains(every));
            let every = every.ok_or_else(|| format!("`{time}` is no interval: 1ms to 254ms are expected"))?;
            CampaignStep::Job(Job::Cycle { register: register(name)?.number, every })
        }
        ["start-up"] => CampaignStep::Job(Job::StartUp { patience: Span::from_millis(300) }),
        ["wait", time] => CampaignStep::Wait(Span::from_millis(millis(time)?)),
        _ => return Err("this is no step: `read REGISTER`, `write REGISTER = HEX`, `cycle REGISTER TIME`, `stop REGISTER`, `start-up` or `wait TIME` is expected".to_owned()),
    })
}

/// A time in whole milliseconds, such as `35ms`.
fn millis(text: &str) -> Result<u64, String> {
    let digits = text
        .strip_suffix("ms")
        .and_then(|digits| digits.parse().ok());
    digits
        .filter(|millis| (1..=LONGEST).contains(millis))
        .ok_or_else(|| format!("`{text}` is no time: 1ms to {LONGEST}ms are expected"))
}
