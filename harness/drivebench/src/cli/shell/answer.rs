//! What requests of a session give, as JSON.

use super::request::SessionRequest;
use crate::command::output::Output;
use crate::library::Entry;
use crate::scenario::run::Outcome;
use crate::scenario::source::line_number;
use serde_json::{Value, json};

/// What came of a scenario.
pub(super) fn object(entry: &Entry, outcome: &Outcome) -> Value {
    let finding = outcome.finding.as_ref().map(|found| {
        json!({"line": line_number(&entry.source.text, found.span.start), "what": found.message})
    });
    json!({
        "name": entry.short_name(), "title": entry.scenario.title, "verdict": outcome.verdict.name(),
        "took_ms": outcome.took.as_millis_f64(), "finding": finding, "notes": outcome.remarks,
    })
}

/// The result of a command: values that were read, or the JSON that it prints.
pub(super) fn data(request: &SessionRequest, output: &Output) -> Value {
    let text = output.collected_result();
    match request {
        SessionRequest::Read { .. } => json!({"values": values(text)}),
        SessionRequest::State { .. } => {
            json!({"data": serde_json::from_str::<Value>(text.trim()).unwrap_or_default()})
        }
        _ => json!({}),
    }
}

/// The columns of `watch --format csv`: `0 nist [rpm]`, and below each its value.
pub(super) fn values(text: &str) -> Vec<Value> {
    let mut lines = text.lines().map(|line| line.split(',').skip(1));
    let (Some(heading), Some(row)) = (lines.next(), lines.next()) else {
        return Vec::new();
    };
    let value = |(column, digits): (&str, &str)| {
        let (drive, rest) = column.split_once(' ').unwrap_or((column, ""));
        let unit = rest
            .rsplit_once(" [")
            .and_then(|(name, unit)| Some((name, unit.strip_suffix(']')?)));
        let (name, unit) = unit.unwrap_or((rest, ""));
        let number = digits
            .parse::<f64>()
            .ok()
            .filter(|_| unit != crate::command::watch::HEX);
        let value = match number {
            Some(number) => json!(number),
            None if digits.is_empty() => Value::Null,
            None => json!(digits),
        };
        json!({"drive": drive, "name": name, "value": value, "unit": unit})
    };
    heading.zip(row).map(value).collect()
}
