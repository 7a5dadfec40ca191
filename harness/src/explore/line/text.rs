//! The scenario of a finding: it passes if everything is as the model predicts, and fails if it is not.

use super::{LineBus, LineSetup, LineTalk};
use crate::explore::{Differing as _, ExploreError, Finding};

/// The scenario of a finding, with this title.
///
/// # Errors
/// The header has mistakes.
pub(super) fn text<B: LineBus>(
    finding: &Finding<LineTalk<B>>,
    title: &str,
) -> Result<String, ExploreError> {
    let difference = &finding.difference;
    let (section, under, is_time) = B::basis(difference);
    let header = [&finding.setup.header[..], under].concat();
    let setup = LineSetup::new::<B>(header.clone(), Vec::new()).under_test::<B>()?;
    let seen = B::play(&setup, &finding.case);
    let (bus, source) = (B::BUS.name(), source::<B>(section));
    let mut text = format!("title   {title}\nsource  {bus} {source}\nbus     {bus}\n");
    for line in &header {
        text.push_str(&format!("{line}\n"));
    }
    text.push_str(&format!("\n# {}\n", difference.about()));
    for planted in &finding.setup.deviates {
        text.push_str(&format!("# found on {}\n", planted.line::<B>()));
    }
    let timed = difference.place().filter(|_| is_time);
    B::steps(&setup, &finding.case, &seen, timed, &mut text);
    Ok(text)
}

/// The table of the catalogue for a section.
fn source<B: LineBus>(section: &str) -> String {
    let tables = B::MANUAL.tables().unwrap_or_default();
    let of = |section: &str| tables.iter().find(|table| table.section == section);
    let known = of(section).or_else(|| of(B::USUAL_SECTION));
    known.map_or_else(
        || B::USUAL_SECTION.to_owned(),
        |table| {
            let id = table.id.trim_start_matches(B::BUS.name());
            id.trim_start().to_owned()
        },
    )
}
