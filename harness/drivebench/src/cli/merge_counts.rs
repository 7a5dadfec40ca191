//! `drivebench merge` of files: the counts of parts of campaigns.

use super::merge::MergeArguments;
use crate::campaign::counts::{CampaignCounts, CountsError, MergedCounts, merge};
use crate::campaign::share::share;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::save;
use std::fmt::Write as _;

/// Adds the counts of parts, and compares them with the pinned figures.
pub(crate) fn merge_counts(
    arguments: &MergeArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let merged = match merge(&arguments.folders) {
        Ok(merged) => merged,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(match &error {
                CountsError::File { error, .. } => Exit::of_file(error),
                CountsError::Wrong(_) => Exit::Usage,
            });
        }
    };
    if arguments.output.exists() {
        let path = arguments.output.display();
        output.complain(&format!("{path} exists; name a new file for the counts"));
        return Ok(Exit::Usage);
    }
    if !save(
        &arguments.output,
        &merged.file.text(),
        "the counts are",
        output,
    ) {
        return Ok(Exit::RigError);
    }
    let MergedCounts { file, missing } = merged;
    for campaign in &file.campaigns {
        output.result(&table(campaign, missing.is_empty()))?;
    }
    for part in &missing {
        output.result(&format!("incomplete   part {part} is missing\n"))?;
    }
    let mut campaigns = file.campaigns.iter();
    let nothing = campaigns.all(|campaign| campaign.played() == Some(0));
    let mut campaigns = file.campaigns.iter();
    let differs = campaigns.any(|campaign| !campaign.differs().is_empty());
    Ok(match (missing.is_empty(), differs) {
        (false, _) => Exit::Incomplete,
        (true, true) => Exit::Failed,
        (true, false) if nothing => Exit::NothingSelected,
        (true, false) => Exit::Passed,
    })
}

/// The counts of a campaign; what is pinned is compared only where no part is missing.
fn table(campaign: &CampaignCounts, whole: bool) -> String {
    if let Some(pairs) = campaign.pairs() {
        return pairs.table() + "\n";
    }
    let played = campaign.played().unwrap_or(u64::MAX);
    let CampaignCounts { name, cases, .. } = campaign;
    let mut text = format!("{name}: {played} of {cases} cases\n\n");
    // Writing to a String cannot fail.
    let _infallible = writeln!(text, "  {:18} {:>8} {:>9}", "class", "cases", "share");
    for count in &campaign.counts {
        let part = share(count.cases, played);
        let _infallible = writeln!(text, "  {:18} {:>8} {part:>9}", count.class, count.cases);
    }
    for (class, expected, found) in campaign.differs().into_iter().filter(|_| whole) {
        let _infallible = writeln!(
            text,
            "  differs: {class} is {found}, the file pins {expected}"
        );
    }
    text + "\n"
}
