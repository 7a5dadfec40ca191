//! What stands in a campaign file of this bus (`corpora/campaigns/unitek/*.toml`).

use super::{Frames, TABLE};
use harness_bench::campaign::line::{LineKeys, LineText};
use harness_bench::file::values::Time;
use harness_proto::time::Span;
use harness_proto::unitek::master::{Job, Options};
use harness_proto::unitek::{Data, Register};
use harness_sim::segment::FrameFault;
use serde::Deserialize;

/// The longest wait, in ms.
const LONGEST: u64 = 10_000;

#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FrameCampaignFile {
    /// The version of this schema: 1.
    schema: u32,
    /// The bus: `unitek`.
    bus: String,
    /// What the campaign shows, in a line.
    title: String,
    /// What the master does, see [`CampaignStep`].
    steps: Vec<String>,
    faults: Vec<FaultName>,
    /// By how much `late` delays.
    #[serde(default)]
    delays: Vec<Time>,
    /// How often a request without a reply is repeated; 2 where nothing is said.
    repeats: Option<u8>,
    /// Whether writes are read back; they are where nothing is said.
    read_back: Option<bool>,
    /// How many cases there must be of each class; what is not named is not looked at.
    #[serde(default)]
    expect: FrameExpect,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum FaultName {
    /// No station receives it, and its sender does not notice.
    Lost,
    Doubled,
    Late,
    /// It is damaged, and repeated by its sender's controller.
    Corrupt,
    /// No station acknowledges it, and its sender's controller repeats it.
    NoAcknowledge,
    /// Its sender's controller goes to bus-off.
    BusOff,
}

/// The figures that a campaign pins: of all cases, and of each class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct FrameExpect {
    cases: Option<u64>,
    answered: Option<u64>,
    retried: Option<u64>,
    noticed: Option<u64>,
    unnoticed: Option<u64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CampaignStep {
    /// `read REGISTER`, `write REGISTER = HEX`, `cycle REGISTER MS`, `stop REGISTER`, `start-up`: a job, to its end.
    Job(Job),
    /// `wait MS`.
    Wait(Span),
}

impl FrameCampaignFile {
    /// The faults, each delay of its own.
    fn faults(&self) -> Vec<FrameFault> {
        let delays = || self.delays.iter().map(|time| FrameFault::Late(time.span()));
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

    fn options(&self) -> Options {
        let usual = Options::default();
        Options {
            repeats: self.repeats.unwrap_or(usual.repeats),
            read_back: self.read_back.unwrap_or(usual.read_back),
            ..usual
        }
    }
}

/// Reads a campaign file and its steps.
///
/// # Errors
/// What is wrong, where, and what is expected.
pub(super) fn read(text: &str) -> Result<(Frames, LineText), String> {
    let file: FrameCampaignFile = toml::from_str(text).map_err(|error| error.to_string())?;
    let keys = LineKeys {
        schema: file.schema,
        steps: &file.steps,
        late: file.faults.contains(&FaultName::Late),
        delays: &file.delays,
    };
    let frames = Frames {
        steps: keys.steps(&TABLE, step)?,
        faults: file.faults(),
        options: file.options(),
    };
    let expect = file.expect;
    let expect = [
        ("cases", expect.cases),
        ("answered", expect.answered),
        ("retried", expect.retried),
        ("noticed", expect.noticed),
        ("unnoticed", expect.unnoticed),
    ];
    let expect = expect
        .into_iter()
        .filter_map(|(name, count)| Some((name, count?)));
    let text = LineText {
        title: file.title,
        expect: expect.collect(),
        steps: file.steps,
        header: "source  unitek 5.2\nbus     unitek\ndrive 1\n".to_owned(),
    };
    Ok((frames, text))
}

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
