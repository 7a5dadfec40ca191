//! `drivebench campaign`.

use super::args::CampaignArguments;
use crate::buses::BUSES;
use crate::campaign::counts::{CampaignCounts, CountsFile, WholeCampaign};
use crate::campaign::{Campaign, CampaignError, CaseFailure, PlayedCampaign, class_of, page};
use crate::command::args::TableFormat;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::command::page::{save, writable, write};
use crate::command::progress::progress_bar;
use crate::scenario::problem::nearest;
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// A campaign of any bus.
type AnyCampaign = Box<dyn Campaign>;

/// Plays campaigns.
pub(crate) fn campaign(
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let mut found = match find_all(&arguments.campaigns, output) {
        Ok(found) => found,
        Err(exit) => return Ok(exit),
    };
    if let Some(name) = &arguments.case {
        return replay(name, &found, output);
    }
    for path in arguments.html.iter().chain(&arguments.output) {
        if writable(path, output).is_err() {
            return Ok(Exit::Usage);
        }
    }
    if arguments.pairs {
        return pairs(&found, arguments, output);
    }
    let wholes = found.iter_mut();
    let wholes = wholes.map(|campaign| WholeCampaign::of(&mut **campaign, arguments.partition));
    let wholes: Vec<_> = wholes.collect();
    let all = match play(&found, arguments, output)? {
        Ok(all) => all,
        Err(defect) => {
            output.complain(&defect);
            return Ok(Exit::RigError);
        }
    };
    if let Some(path) = &arguments.html
        && !write(path, &page(&all), output)
    {
        return Ok(Exit::RigError);
    }
    let differs = all.iter().any(|played| !played.differs().is_empty());
    let counts = wholes.into_iter().zip(&all);
    let counts = counts.map(|(whole, run)| whole.counts(&**run)).collect();
    Ok(keep(counts, differs, arguments, output))
}

/// Writes counts where they are asked for; says how it ended.
fn keep(
    counts: Vec<CampaignCounts>,
    differs: bool,
    arguments: &CampaignArguments,
    output: &mut Output,
) -> Exit {
    let counts = CountsFile::new(arguments.partition, counts);
    if let Some(path) = &arguments.output
        && !save(path, &counts.text(), "the counts are", output)
    {
        return Exit::RigError;
    }
    let mut campaigns = counts.campaigns.iter();
    let nothing = campaigns.all(|campaign| campaign.played() == Some(0));
    match (&arguments.partition, differs) {
        (_, true) => Exit::Failed,
        (Some(part), false) if nothing => {
            output.complain(&format!("{part} has no case"));
            Exit::NothingSelected
        }
        (Some(part), false) => {
            output.say(&format!(
                "{part} was counted; `merge` adds all parts and compares them with [expect]\n"
            ));
            Exit::Passed
        }
        (None, false) => Exit::Passed,
    }
}

/// The names of the built-in campaigns: of rings, then all others.
pub(super) fn names() -> Vec<String> {
    let [of_rings, others @ ..] = &BUSES;
    let mut names: Vec<_> = others.iter().flat_map(|bus| (bus.campaigns)()).collect();
    names.sort_unstable();
    [(of_rings.campaigns)(), names].concat()
}

/// Finds the named campaigns, or all built-in ones. The exit code where one cannot be played, which has been reported.
fn find_all(named: &[PathBuf], output: &mut Output) -> Result<Vec<AnyCampaign>, Exit> {
    let wanted: Vec<PathBuf> = match named {
        [] => names().into_iter().map(PathBuf::from).collect(),
        named => named.to_vec(),
    };
    wanted.iter().map(|name| find(name, output)).collect()
}

fn find(name: &Path, output: &mut Output) -> Result<AnyCampaign, Exit> {
    // A file that names no bus is one of rings.
    let found = BUSES.iter().rev().find_map(|bus| (bus.campaign)(name));
    match found {
        Some(Ok(campaign)) => return Ok(campaign),
        Some(Err(CampaignError::Said(why))) => output.complain(&why),
        Some(Err(CampaignError::Mistakes(problems))) => output.mistakes(&problems),
        None => {
            let (wanted, known) = (name.display().to_string(), names());
            let bare = wanted.strip_suffix(".toml").unwrap_or(&wanted);
            let words: Vec<_> = known.iter().map(String::as_str).collect();
            let near = nearest(bare, &words).map(|near| format!("did you mean `{near}`? "));
            output.complain(&format!(
                "failed to find {wanted}: neither a file nor a built-in campaign; {}there are {}",
                near.unwrap_or_default(),
                words.join(", ")
            ));
        }
    }
    Err(Exit::Usage)
}

/// Plays campaigns, and shows them; or says which case is a defect of the bench.
fn play(
    campaigns: &[AnyCampaign],
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Result<Vec<Box<dyn PlayedCampaign>>, String>> {
    let threads = arguments.threads.unwrap_or_else(cores);
    let (mut all, mut listed) = (Vec::new(), Vec::new());
    for campaign in campaigns {
        let bar = progress_bar(campaign.cases(), output.progress);
        bar.set_message(campaign.name().to_owned());
        let played = campaign.run(threads, &|done| bar.inc(done));
        bar.finish_and_clear();
        let played = match played {
            Ok(played) => played,
            Err(defect) => return Ok(Err(defect)),
        };
        // A class that a campaign does not have leaves it out.
        let only = arguments.only.as_ref();
        let only = only.map(|class| class_of(&*played, &class.name()));
        match (arguments.format, only) {
            (_, Some(None)) => {}
            (TableFormat::Table, None) => output.result(&(played.table() + "\n"))?,
            (TableFormat::Table, Some(Some(class))) => output.result(&played.lines(class))?,
            (TableFormat::Json, class) => listed.push(played.json(class.flatten())),
        }
        all.push(played);
    }
    if arguments.format == TableFormat::Json {
        let all = serde_json::json!({ "schema": 1, "campaigns": listed });
        output.result(&format!("{all}\n"))?;
    }
    Ok(Ok(all))
}

/// Counts the pairs of cases of campaigns of single faults, and shows them.
fn pairs(
    found: &[AnyCampaign],
    arguments: &CampaignArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let mut wanted = Vec::new();
    for campaign in found {
        let Some(pairs) = campaign.pairs() else {
            let name = campaign.name();
            output.complain(&format!(
                "--pairs counts faults of rings; {name} has no ring"
            ));
            return Ok(Exit::Usage);
        };
        let count = match pairs.all(arguments.sample.is_some()) {
            Ok(all) => match (arguments.sample, arguments.partition) {
                (Some(sample), _) => sample.min(all),
                (None, Some(part)) => pairs.of_part(part),
                (None, None) => all,
            },
            Err(error) => {
                output.complain(&error);
                return Ok(Exit::Usage);
            }
        };
        wanted.push((campaign, pairs, count));
    }
    let threads = arguments.threads.unwrap_or_else(cores);
    let (mut listed, mut counts) = (Vec::new(), Vec::new());
    for (campaign, pairs, count) in wanted {
        let bar = progress_bar(
            usize::try_from(count).unwrap_or(usize::MAX),
            output.progress,
        );
        bar.set_message(campaign.name().to_owned());
        let progress = |done| bar.inc(done);
        let played = match arguments.sample {
            None => pairs.count(arguments.partition, threads, &progress),
            Some(sample) => pairs.sample((sample, arguments.seed), threads, &progress),
        };
        bar.finish_and_clear();
        let played = match played {
            Ok(played) => played,
            Err(error) => {
                output.complain(&error);
                return Ok(Exit::RigError);
            }
        };
        match arguments.format {
            TableFormat::Json => listed.push(played.json()),
            TableFormat::Table => output.result(&(played.table() + "\n"))?,
        }
        counts.push(WholeCampaign::of_pairs(&**campaign).counts_of_pairs(&played));
    }
    if arguments.format == TableFormat::Json {
        let all = serde_json::json!({ "schema": 1, "pairs": listed });
        output.result(&format!("{all}\n"))?;
    }
    Ok(keep(counts, false, arguments, output))
}

/// How many threads there is room for.
fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Prints the scenario of one case.
fn replay(name: &str, campaigns: &[AnyCampaign], output: &mut Output) -> std::io::Result<Exit> {
    let [campaign] = campaigns else {
        let why = "--case needs exactly one campaign; name the one that the case belongs to";
        output.complain(why);
        return Ok(Exit::Usage);
    };
    match campaign.scenario(name) {
        Ok(text) => output.result(&text).map(|()| Exit::Passed),
        Err(CaseFailure::Unknown(wrong)) => {
            output.complain(&wrong);
            Ok(Exit::Usage)
        }
        Err(CaseFailure::Defect(defect)) => {
            output.complain(&defect);
            Ok(Exit::RigError)
        }
    }
}

/// The classes on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClassName {
    /// Not noticed, and nothing differs.
    Harmless,
    /// The damaged link was named, everything is back.
    Located,
    /// No link was named, everything is back.
    Recovered,
    /// A sound link was named, everything is back.
    Mislocated,
    /// Noticed, and not everything is back.
    NotRecovered,
    /// Noticed and repaired, but a cell is wrong.
    Corrupted,
    /// Not noticed, and a value is wrong.
    SilentCorruption,
    /// On CAN: nothing is different.
    Answered,
    /// On CAN: a request was repeated, and nothing else is different.
    Retried,
    /// On CAN: the master reported the fault.
    Noticed,
    /// On CAN: the master reported nothing, and something is wrong.
    Unnoticed,
    /// On PROFIBUS: nothing is different.
    Unharmed,
    /// On PROFIBUS: a request was repeated, and nothing else is different.
    Repeated,
    /// On PROFIBUS: the master started the slave again, or gave up.
    FellBack,
    /// On PROFIBUS: the master noticed nothing, and a word is wrong.
    WrongWord,
}

impl ClassName {
    /// The name on the command line and in tables.
    fn name(self) -> String {
        let value = self.to_possible_value();
        value
            .map(|value| value.get_name().to_owned())
            .unwrap_or_default()
    }
}
