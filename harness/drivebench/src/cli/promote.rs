//! `drivebench promote`: a finding that is kept.

use crate::bus_name::BusName;
use crate::buses::fuzz_of;
use crate::command::exit::Exit;
use crate::command::fuzz::promote::PromoteArguments;
use crate::command::output::Output;
use crate::command::play::{PlayedOnce, play_entry};
use crate::explore::{ExploreError, bus_of};
use crate::library::Entry;
use crate::library::page::page;
use crate::scenario::run::AtMismatch;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;

/// Keeps a finding, whatever its bus.
pub(crate) fn promote(arguments: &PromoteArguments, output: &mut Output) -> std::io::Result<Exit> {
    match fuzz_of(bus_of(&arguments.finding).unwrap_or(BusName::DEFAULT)) {
        Some(fuzz) => (fuzz.promote)(arguments, played, output),
        None => Ok(Exit::Usage),
    }
}

/// What comes of a scenario on simulated drives, why, and its page.
///
/// # Errors
/// The scenario has mistakes.
pub fn played(name: &str, text: &str) -> Result<(Verdict, String, String), ExploreError> {
    let source = Source {
        name: name.to_owned(),
        text: text.to_owned().into(),
    };
    let entry = Entry::new(source, None)?;
    let PlayedOnce { outcome, traces } = play_entry(&entry, AtMismatch::Stop);
    let page = page(&entry, &outcome, &traces);
    let why = outcome.finding.map(|finding| finding.message);
    Ok((outcome.verdict, why.unwrap_or_default(), page))
}
