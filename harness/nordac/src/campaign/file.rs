//! What stands in a campaign file of this bus (`corpora/campaigns/nordac/*.toml`).

use super::{TABLE, Telegrams};
use harness_bench::campaign::line::{LineKeys, LineText};
use harness_bench::file::values::Time;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::parameter::ParameterRef;
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::octet_segment::{LineFault, TelegramFault};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct TelegramCampaignFile {
    /// The version of this schema: 1.
    schema: u32,
    /// The bus: `nordac`.
    bus: String,
    /// What the campaign shows, in a line.
    title: String,
    /// The PPO type, 1 to 4; 1 where nothing is said.
    #[serde(default = "one")]
    ppo: u8,
    /// What the master does, see [`CampaignStep`].
    steps: Vec<String>,
    faults: Vec<FaultName>,
    /// By how much `late` delays.
    #[serde(default)]
    delays: Vec<Time>,
    /// How often a request without a reply is repeated; once where nothing is said.
    #[serde(default = "one")]
    repeats: u8,
    /// How many cases there must be of each class, and of all `cases`; what is not named is not looked at.
    #[serde(default)]
    expect: BTreeMap<String, u64>,
}

const fn one() -> u8 {
    1
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum FaultName {
    /// Each of the eleven bits of each octet, one at a time.
    Bits,
    /// Two neighbouring data bits of each octet, which parity does not show.
    TwoBits,
    /// Each octet does not arrive.
    Dropped,
    /// Each telegram is not sent.
    Lost,
    /// Each telegram is sent twice.
    Doubled,
    /// Each telegram begins later.
    Late,
    /// In place of each telegram its sender sends its former one.
    Former,
}

impl FaultName {
    pub(super) fn faults(self, delays: &[Time]) -> Vec<LineFault> {
        let flip = |flips| LineFault::Octet(LinkFault::Flip(flips));
        let data = |bits: u8| {
            flip(Flips {
                data: bits,
                ..Flips::default()
            })
        };
        let one = LineFault::Telegram;
        match self {
            Self::Bits => {
                let usual = Flips::default();
                let others = [
                    Flips {
                        start: true,
                        ..usual
                    },
                    Flips {
                        parity: true,
                        ..usual
                    },
                    Flips {
                        stop: true,
                        ..usual
                    },
                ];
                let bits = (0..8).map(|bit| data(1 << bit));
                bits.chain(others.map(flip)).collect()
            }
            Self::TwoBits => (0..7).map(|bit| data(3 << bit)).collect(),
            Self::Dropped => vec![LineFault::Octet(LinkFault::Drop)],
            Self::Lost => vec![one(TelegramFault::Lost)],
            Self::Doubled => vec![one(TelegramFault::Doubled)],
            Self::Late => delays
                .iter()
                .map(|time| one(TelegramFault::Late(time.span())))
                .collect(),
            Self::Former => vec![one(TelegramFault::Former)],
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CampaignStep {
    /// `start`: Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag.
    Start,
    /// `exchange 047F 2000`: one Data_Exchange with this control word and setpoint.
    Exchange(u16, u16),
    /// `read 1202`: a parameter, by exchanges with the words in force.
    Read(ParameterRef),
    /// `write 1202 = 100`: the same with its raw value.
    Write(ParameterRef, u32),
    /// `wait 20ms`.
    Wait(Span),
}

/// Reads a campaign file, its PPO type and its steps.
///
/// # Errors
/// What is wrong, where, and what is expected.
pub(super) fn read(text: &str) -> Result<(Telegrams, LineText), String> {
    let file: TelegramCampaignFile = toml::from_str(text).map_err(|error| error.to_string())?;
    let ppo = PpoType::from_number(file.ppo)
        .ok_or_else(|| format!("ppo {} is none: 1 to 4 are expected", file.ppo))?;
    let known = || std::iter::once("cases").chain(TABLE.classes.iter().map(|class| class.name));
    if let Some(name) = file
        .expect
        .keys()
        .find(|name| !known().any(|known| known == *name))
    {
        let names: Vec<_> = known().collect();
        return Err(format!(
            "`{name}` in [expect] is no class: {} are expected",
            names.join(", ")
        ));
    }
    let keys = LineKeys {
        schema: file.schema,
        steps: &file.steps,
        late: file.faults.contains(&FaultName::Late),
        delays: &file.delays,
    };
    let steps = keys.steps(&TABLE, |text| match step(text)? {
        CampaignStep::Read(_) | CampaignStep::Write(..) if !ppo.has_pkw() => Err(format!(
            "{ppo} has no parameter channel: ppo = 1 or 2 is expected"
        )),
        step => Ok(step),
    })?;
    let telegrams = Telegrams {
        ppo,
        steps,
        faults: file.faults,
        delays: file.delays,
        repeats: file.repeats,
    };
    let pinned = known().filter_map(|name| Some((name, *file.expect.get(name)?)));
    let text = LineText {
        title: file.title,
        steps: file.steps,
        expect: pinned.collect(),
        header: format!(
            "source  nordac 3.3\nbus     nordac\nslave 8\nslave 8 ppo {}\nslave 8 parameter 1621 = 2\n",
            ppo.number()
        ),
    };
    Ok((telegrams, text))
}

fn step(text: &str) -> Result<CampaignStep, String> {
    let words: Vec<_> = text.split_whitespace().collect();
    let parameter = |name: &str| ParameterRef::parse(name).map_err(|error| error.to_string());
    let word = |text: &str| {
        let word = u16::from_str_radix(text, 16)
            .ok()
            .filter(|_| text.len() == 4);
        word.ok_or_else(|| format!("`{text}` is no word: four hexadecimal digits are expected"))
    };
    Ok(match words[..] {
        ["start"] => CampaignStep::Start,
        ["exchange", control, setpoint] => CampaignStep::Exchange(word(control)?, word(setpoint)?),
        ["read", name] => CampaignStep::Read(parameter(name)?),
        ["write", name, "=", value] => {
            let parameter = parameter(name)?;
            let raw = value.parse().ok().and_then(|number| parameter.parameter.raw_of(number));
            CampaignStep::Write(parameter, raw.ok_or_else(|| format!("`{value}` is no value of {name}: a raw decimal number that fits it is expected"))?)
        }
        ["wait", time] => {
            let time: Option<u64> = time.strip_suffix("ms").and_then(|digits| digits.parse().ok());
            let time = time.filter(|time| (1..=10_000).contains(time));
            CampaignStep::Wait(Span::from_millis(time.ok_or("1ms to 10000ms are expected behind `wait`")?))
        }
        _ => return Err("this is no step: `start`, `exchange STW HSW`, `read PNU`, `write PNU = NUMBER` or `wait TIME` is expected".to_owned()),
    })
}
