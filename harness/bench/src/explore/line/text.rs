//! The scenario of a finding: it passes if everything is as the model predicts, and fails if it is not.

use super::{LineBus, LineSetup, LineTalk, PlantedDrive};
use crate::explore::{Differing as _, ExploreError, Finding};

/// The scenario of a finding, with this title and this table of the manual, or that of the finding. `deviating` gives the drives what was planted
/// in them, and leaves out the values of open points with which the model explains most: those are not the drives' own.
///
/// # Errors
/// The header has mistakes.
pub fn text<B: LineBus>(
    finding: &Finding<LineTalk<B>>,
    title: &str,
    source: Option<&str>,
    deviating: bool,
) -> Result<String, ExploreError> {
    let difference = &finding.difference;
    let (section, under, is_time) = B::basis(difference);
    let mut header = [&finding.setup.header[..], under].concat();
    let setup = LineSetup::new::<B>(header.clone(), Vec::new()).under_test::<B>()?;
    let planted = finding.setup.deviates.iter().map(PlantedDrive::line::<B>);
    if deviating {
        header = finding.setup.header.clone();
        header.extend(planted.clone());
    }
    let seen = B::play(&setup, &finding.case);
    let bus = B::BUS.name();
    let source = source.map_or_else(|| table::<B>(section), str::to_owned);
    let mut text = format!("title   {title}\nsource  {source}\nbus     {bus}\n");
    for line in &header {
        text.push_str(&format!("{line}\n"));
    }
    text.push_str(&format!("\n# {}\n", difference.about()));
    for planted in planted {
        text.push_str(&format!("# found on {planted}\n"));
    }
    let timed = difference.place().filter(|_| is_time);
    B::steps(&setup, &finding.case, &seen, timed, &mut text);
    Ok(text)
}

/// The table of the catalogue for a section.
fn table<B: LineBus>(section: &str) -> String {
    let tables = B::MANUAL.tables().unwrap_or_default();
    let of = |section: &str| tables.iter().find(|table| table.section == section);
    let known = of(section).or_else(|| of(B::USUAL_SECTION));
    known.map_or_else(
        || format!("{} {}", B::BUS.name(), B::USUAL_SECTION),
        |table| table.id.clone(),
    )
}
