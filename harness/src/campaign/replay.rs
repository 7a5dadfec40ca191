//! One case as a scenario, to be looked at with `drivebench trace`.

use super::fault::Case;
use super::run::{Campaign, Contradiction};
use crate::link::link_name;
use std::fmt::Write as _;

/// Bytes in a line.
const BYTES: usize = 24;

/// The scenario that replays a case: the header of the campaign's scenario, the faults, and the bytes that the master sent in
/// this case; or, if the driver plays, its calls.
///
/// # Errors
/// The case fits no class.
pub fn scenario(campaign: &Campaign, case: &Case) -> Result<String, Contradiction> {
    let (outcome, said) = campaign.play(case)?;
    let drives = campaign.shape.drives;
    let entry = &campaign.entry;
    let slice = |start: usize, end: usize| entry.source.text.get(start..end).unwrap_or_default();
    // Writing to a String cannot fail.
    let mut text = format!("title   {} of {}\n", case.name(drives), entry.short_name());
    for source in &entry.scenario.sources {
        let _infallible = writeln!(text, "source  {}", source.text);
    }
    let _infallible = writeln!(text, "ring    {drives}");
    let _infallible = writeln!(
        text,
        "line    {}",
        entry
            .scenario
            .header
            .rate
            .unwrap_or_default()
            .bits_per_second()
    );
    for setup in &entry.scenario.header.setups {
        let _infallible = writeln!(text, "{}", slice(setup.span.start, setup.span.end).trim());
    }
    let _infallible = write!(text, "\n# {}: {}", outcome.class, outcome.class.about());
    if let Some(link) = outcome.evidence.named {
        let _infallible = write!(text, "; named was {}", link_name(0, drives, link));
    }
    text.push('\n');
    for wrong in &outcome.evidence.wrong {
        let _infallible = writeln!(text, "# {wrong}");
    }
    for fault in case.faults() {
        for (distance, what) in fault.what.lines() {
            let link = link_name(0, drives, fault.link);
            let _infallible = writeln!(text, "! {link} byte {}: {what}", fault.byte + distance);
        }
    }
    if campaign.by_driver() {
        for step in &entry.scenario.steps {
            let line = slice(step.span.start, step.span.end).trim();
            if line.starts_with("master") {
                let _infallible = writeln!(text, "{line}");
            }
        }
    }
    for said in said {
        let _infallible = writeln!(text, "\n# {}", said.why);
        for line in said
            .bytes
            .chunk_by(|a, b| a == b)
            .collect::<Runs<'_>>()
            .lines()
        {
            let _infallible = writeln!(text, "> {line}");
        }
    }
    Ok(text)
}

/// Runs of equal bytes, for lines such as `88 FB 80*12`.
struct Runs<'a>(Vec<&'a [u8]>);

impl<'a> FromIterator<&'a [u8]> for Runs<'a> {
    fn from_iter<I: IntoIterator<Item = &'a [u8]>>(runs: I) -> Self {
        Self(runs.into_iter().collect())
    }
}

impl Runs<'_> {
    fn lines(self) -> Vec<String> {
        let mut words = Vec::new();
        for run in self.0 {
            match run {
                [byte, _, _, ..] => words.push(format!("{byte:02X}*{}", run.len())),
                few => words.extend(few.iter().map(|byte| format!("{byte:02X}"))),
            }
        }
        words.chunks(BYTES).map(|line| line.join(" ")).collect()
    }
}
