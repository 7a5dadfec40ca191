//! The results of a campaign, for people and for tools.

use super::class::{CaseClass, CaseEvidence, WrongValue};
use crate::campaign::run::{CaseOutcome, PlayedCampaign};
use harness_bench::campaign::PlayedCampaign as _;
use harness_bench::campaign::share::counts;
use harness_bench::link::link_name;
use harness_proto::nd21::cells::cell_at;
use serde::Serialize;
use std::fmt;
use std::fmt::Write as _;

/// How many of the worst cases a table shows.
pub(crate) const WORST: usize = 10;

/// How many wrong values a line shows.
const VALUES: usize = 4;

impl fmt::Display for WrongValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cell {
                drive,
                address,
                value,
                expected,
            } => {
                let name = cell_at(*address).map(|cell| format!(" ({})", cell.printed));
                write!(
                    f,
                    "drive {drive}: {address:04X}{} holds {value:02X} in place of {expected:02X}",
                    name.unwrap_or_default()
                )
            }
            Self::Answer {
                drive,
                value,
                expected,
            } => write!(
                f,
                "drive {drive}: a job brought {value:02X} in place of {expected:02X}"
            ),
        }
    }
}

/// What happened in a case, in a line.
#[must_use]
pub(crate) fn happened(evidence: &CaseEvidence, drives: u8) -> String {
    let mut parts = Vec::new();
    if let Some(link) = evidence.named {
        parts.push(format!("named {}", link_name(0, drives, link)));
    } else if let Some(fault) = evidence.diagnosis {
        parts.push(fault.to_string());
    }
    match evidence.sequences {
        0 => {}
        1 => parts.push("1 check sequence".to_owned()),
        many => parts.push(format!("{many} check sequences")),
    }
    if !evidence.confirmed {
        parts.push("a job not confirmed".to_owned());
    }
    parts.extend(
        evidence
            .wrong
            .iter()
            .take(VALUES)
            .map(WrongValue::to_string),
    );
    if evidence.wrong.len() > VALUES {
        parts.push(format!("{} more", evidence.wrong.len() - VALUES));
    }
    parts.join("; ")
}

#[must_use]
pub(crate) fn line(outcome: &CaseOutcome, drives: u8) -> String {
    let name = outcome.case.name(drives);
    let happened = happened(&outcome.evidence, drives);
    let line = format!("{:18} {name:28} {happened}", outcome.class.name());
    line.trim_end().to_owned() + "\n"
}

/// How many cases there are of each class, what differs from the file, and the worst cases.
#[must_use]
pub(crate) fn table(finished: &PlayedCampaign) -> String {
    let all = finished.outcomes.len() as u64;
    let mut text = format!(
        "{}\n{}: {all} cases; {} drives, {} bytes of {}\n\n",
        finished.title,
        finished.name.trim_end_matches(".toml"),
        finished.drives,
        finished.bytes,
        finished.scenario
    );
    text += &counts(finished);
    let mut worst: Vec<_> = finished
        .outcomes
        .iter()
        .filter(|outcome| outcome.class >= CaseClass::Recovered)
        .collect();
    worst.sort_by_key(|outcome| std::cmp::Reverse(outcome.class));
    if !worst.is_empty() {
        text.push_str("\n  the worst\n");
    }
    for outcome in worst.into_iter().take(WORST) {
        // Writing to a String cannot fail.
        let _infallible = write!(text, "  {}", line(outcome, finished.drives));
    }
    text
}

/// A campaign for tools.
#[derive(Serialize)]
struct Json<'a> {
    name: &'a str,
    title: &'a str,
    scenario: &'a str,
    drives: u8,
    bytes: u64,
    classes: Vec<JsonClass>,
    differs: Vec<JsonDiffers>,
    cases: Vec<JsonCase>,
}

#[derive(Serialize)]
struct JsonClass {
    class: CaseClass,
    cases: u64,
}

#[derive(Serialize)]
struct JsonDiffers {
    class: Option<&'static str>,
    expected: u64,
    found: u64,
}

#[derive(Serialize)]
struct JsonCase {
    case: String,
    class: CaseClass,
    noticed: bool,
    named: Option<String>,
    diagnosis: Option<String>,
    sequences: u32,
    confirmed: bool,
    wrong: Vec<JsonWrong>,
}

#[derive(Serialize)]
struct JsonWrong {
    drive: u8,
    address: Option<u16>,
    cell: Option<&'static str>,
    value: u32,
    expected: u32,
}

impl From<&WrongValue> for JsonWrong {
    fn from(wrong: &WrongValue) -> Self {
        match *wrong {
            WrongValue::Cell {
                drive,
                address,
                value,
                expected,
            } => Self {
                drive,
                address: Some(address),
                cell: cell_at(address).map(|cell| cell.printed),
                value: value.into(),
                expected: expected.into(),
            },
            WrongValue::Answer {
                drive,
                value,
                expected,
            } => Self {
                drive,
                address: None,
                cell: None,
                value,
                expected,
            },
        }
    }
}

impl<'a> Json<'a> {
    fn of(finished: &'a PlayedCampaign, only: Option<CaseClass>) -> Self {
        let drives = finished.drives;
        let wanted = |outcome: &&CaseOutcome| only.is_none_or(|class| outcome.class == class);
        let case = |outcome: &CaseOutcome| {
            let evidence = &outcome.evidence;
            JsonCase {
                case: outcome.case.name(drives),
                class: outcome.class,
                noticed: evidence.noticed,
                named: evidence.named.map(|link| link_name(0, drives, link)),
                diagnosis: evidence.diagnosis.map(|fault| fault.to_string()),
                sequences: evidence.sequences,
                confirmed: evidence.confirmed,
                wrong: evidence.wrong.iter().map(JsonWrong::from).collect(),
            }
        };
        let count = |class| JsonClass {
            class,
            cases: finished.count(class),
        };
        let differs = finished.differs().into_iter();
        let differs = differs.map(|(class, expected, found)| JsonDiffers {
            class: (class != "cases").then_some(class),
            expected,
            found,
        });
        Self {
            name: finished.name.trim_end_matches(".toml"),
            title: &finished.title,
            scenario: &finished.scenario,
            drives,
            bytes: finished.bytes,
            classes: CaseClass::ALL.map(count).into(),
            differs: differs.collect(),
            cases: finished.outcomes.iter().filter(wanted).map(case).collect(),
        }
    }
}

/// A campaign for tools, as `corpora/campaigns/README.md` describes; of its cases those of one class, where `only` is given.
#[must_use]
pub(crate) fn json(finished: &PlayedCampaign, only: Option<CaseClass>) -> serde_json::Value {
    serde_json::json!(Json::of(finished, only))
}
