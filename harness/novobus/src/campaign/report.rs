//! The results of a campaign, for people and for tools.

use super::class::{CaseClass, CaseEvidence, WrongValue};
use super::html::maps;
use super::run::{CaseOutcome, PlayedCampaign};
use harness_bench::campaign::played::PlayedCase;
use harness_bench::html::Html;
use harness_bench::link::link_name;
use harness_proto::nd21::cells::cell_at;
use serde::Serialize;
use std::fmt;

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

impl PlayedCase for CaseOutcome {
    const SERIOUS: u8 = CaseClass::Recovered.outcome().gravity;
    const LETTERS: bool = false;

    fn class(&self) -> usize {
        self.class as usize
    }

    fn name(&self) -> String {
        self.case.name(self.drives)
    }

    fn disturbed(&self) -> Option<&str> {
        None
    }

    fn happened(&self) -> String {
        happened(&self.evidence, self.drives)
    }

    fn json(&self) -> serde_json::Value {
        let evidence = &self.evidence;
        serde_json::json!(JsonCase {
            noticed: evidence.noticed,
            named: evidence.named.map(|link| link_name(0, self.drives, link)),
            diagnosis: evidence.diagnosis.map(|fault| fault.to_string()),
            sequences: evidence.sequences,
            confirmed: evidence.confirmed,
            wrong: evidence.wrong.iter().map(JsonWrong::from).collect(),
        })
    }

    fn maps(played: &PlayedCampaign) -> Vec<(String, Html)> {
        maps(played)
    }
}

#[derive(Serialize)]
struct JsonCase {
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
