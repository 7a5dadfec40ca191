//! `drivebench verify` of the folder of a fuzz run.

use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::evidence::{SIGNATURE, SUMS, Signer, sealed, unsigned};
use crate::explore::files::read_text;
use crate::explore::{
    Differing as _, ExploreError, Finding, FuzzCase, JudgedAgain, KeptRun, LogLine, RECORD,
    count_finding, file_of, impossible, read_as,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// What no folder of a run confirms.
const UNCONFIRMED: &str = "unconfirmed  which cases were tried and showed nothing: the record has their number only\n\
     unconfirmed  that nothing more was found or kept: a finding that is removed with its line and its files leaves no trace\n\
     unconfirmed  the counts within the last round of cases, the numbers of cases within their rounds, the time on the line, the cases that were \
     kept, and in the first line what follows from no finding, such as the seed, `of` and `spices`\n";

/// Checks the files of a run of a bus, and judges its findings again; `None` where the folder holds none.
pub fn verify_as<C: FuzzCase>(
    folder: &Path,
    signer: Option<Signer<'_>>,
    output: &mut Output,
) -> Option<std::io::Result<Exit>> {
    let (kept, _) = read_as::<C>(folder).ok()?;
    Some(verify(folder, &kept, signer, output))
}

fn verify<C: FuzzCase>(
    folder: &Path,
    kept: &KeptRun<C>,
    signer: Option<Signer<'_>>,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let files = match sealed(folder, signer) {
        Ok(files) => files,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::of_evidence(&error));
        }
    };
    let has_sums = files.is_some();
    // A run that has sent nothing shows nothing.
    let mut complete = has_sums && kept.progress.not_sent < kept.progress.cases;
    let strange = strange(folder, kept);
    // What `shrink` makes of a finding comes behind the sums.
    let is_small = |wrong: &str| {
        let file = wrong.strip_suffix(" was added");
        let kind = file.and_then(|file| strange.get(file));
        matches!(kind, Some(Strange::Small))
    };
    let mut files = files.unwrap_or_default();
    files.retain(|wrong| !is_small(wrong));
    let mut wrong = files.len();
    for file in &files {
        output.result(&format!("{file}\n"))?;
    }
    for why in impossible(kept) {
        wrong += 1;
        output.result(&format!("{RECORD}: {why}\n"))?;
    }
    for (file, kind) in strange {
        let text = match kind {
            Strange::Added => {
                wrong += 1;
                format!("{file} is not a file of the run\n")
            }
            Strange::Small => format!("unconfirmed  {file}: `shrink` made it of a finding\n"),
            Strange::Unsettled => {
                complete = false;
                format!("unconfirmed  {file}: the record ends before its case\n")
            }
        };
        output.result(&text)?;
    }
    let mut judged = 0;
    let mut known = BTreeMap::new();
    for line in &kept.lines {
        let LogLine::Finding {
            number,
            signature,
            confirmed,
            file,
        } = line
        else {
            continue;
        };
        let judged_again = match *file == file_of(*number) {
            true => again(folder, file, kept, &known),
            false => Err(ExploreError::File(format!(
                "{file:?} is not the name of its files, which is {}",
                file_of(*number)
            ))),
        };
        let text = match judged_again {
            Ok((finding, JudgedAgain::Same)) if !is_of(&finding, line) => {
                wrong += 1;
                format!(
                    "differs      case {number}: {file}.json is not the finding of the record\n"
                )
            }
            Ok((_, JudgedAgain::Same)) => {
                judged += 1;
                format!("found again  case {number}\n")
            }
            Ok((_, JudgedAgain::Unknown)) => {
                complete = false;
                format!(
                    "unconfirmed  case {number}: what the drives behind the ports answered is not in the folder\n"
                )
            }
            Ok((_, JudgedAgain::Differs(why))) => {
                wrong += 1;
                format!("differs      case {number}: {why}\n")
            }
            Err(error) => {
                wrong += 1;
                format!("differs      case {number}: {error}\n")
            }
        };
        output.result(&text)?;
        count_finding(&mut known, signature, *confirmed);
    }
    output.result(UNCONFIRMED)?;
    match signer {
        Some(signer) if wrong == 0 => output.result(&format!("signed by    {}\n", signer.identity))?,
        None if has_sums => output.result(&format!("unconfirmed  {}\n", unsigned(folder)))?,
        None => output.result(
            "unconfirmed  that no file was changed: the folder has no sums, because the run did not end (`fuzz run --resume` ends it)\n",
        )?,
        Some(_) => {}
    }
    output.result(&format!(
        "{} judged again, {} wrong\n",
        counted(judged, "finding"),
        counted(wrong, "thing")
    ))?;
    Ok(match (wrong, complete) {
        (0, true) => Exit::Passed,
        (0, false) => Exit::Incomplete,
        _ => Exit::Failed,
    })
}

/// What a file is that no line of the record names.
enum Strange {
    /// Nothing of the run.
    Added,
    /// A finding that was made small.
    Small,
    /// Of a case behind the end of the record, as a run leaves it that was killed.
    Unsettled,
}

/// The files of the folder that no line of its record names, by name.
fn strange<C: FuzzCase>(folder: &Path, kept: &KeptRun<C>) -> BTreeMap<String, Strange> {
    let numbers = kept.lines.iter().filter_map(|line| match line {
        LogLine::Finding { number, .. } => Some(*number),
        _ => None,
    });
    let numbers: BTreeSet<_> = numbers.collect();
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let names = names.filter(|name| ![RECORD, SUMS, SIGNATURE].contains(&name.as_str()));
    let judged = names.filter_map(|name| {
        let kind = match finding_of(&name) {
            Some((number, small)) if numbers.contains(&number) => {
                small.then_some(Strange::Small)?
            }
            Some((number, _)) if number >= kept.progress.cases => Strange::Unsettled,
            _ => Strange::Added,
        };
        Some((name, kind))
    });
    judged.collect()
}

/// The number of the case of whose finding a file is, by its name, and whether it was made small.
fn finding_of(name: &str) -> Option<(u64, bool)> {
    let stem = [".json", ".scn"]
        .iter()
        .find_map(|suffix| name.strip_suffix(suffix))?;
    let plain = stem.strip_suffix("-small").unwrap_or(stem);
    let number = plain.strip_prefix("finding-")?.parse().ok()?;
    (plain == file_of(number)).then_some((number, plain != stem))
}

/// Whether a line of the record is about a finding.
fn is_of<C: FuzzCase>(finding: &Finding<C>, line: &LogLine<C>) -> bool {
    matches!(line, LogLine::Finding { number, signature, confirmed, .. }
        if *number == finding.number && *signature == finding.difference.key() && *confirmed == finding.confirmed)
}

/// Judges a finding again, beside its scenario and the record.
fn again<C: FuzzCase>(
    folder: &Path,
    file: &str,
    kept: &KeptRun<C>,
    known: &BTreeMap<String, u8>,
) -> Result<(Finding<C>, JudgedAgain), ExploreError> {
    let (finding, path) = Finding::<C>::read_as(&folder.join(file).with_extension("json"))?;
    let scenario = path.with_extension("scn");
    let about = &kept.about;
    if !finding.case.is_of(about) {
        let why = "it is for other drives than the run has".to_owned();
        return Ok((finding, JudgedAgain::Differs(why)));
    }
    let of = |of: &Finding<C>| (of.rig.clone(), of.setup.clone(), of.ports, of.seed);
    let same = (
        about.rig.clone(),
        about.setup.clone(),
        about.ports,
        about.seed,
    );
    let again = if read_text(&scenario)? != C::text(&finding)? {
        JudgedAgain::Differs(format!("{file}.scn is not the scenario of its finding"))
    } else if of(&finding) != same {
        JudgedAgain::Differs("it is of another run than the record".to_owned())
    } else {
        C::again(&finding, about, known)?
    };
    Ok((finding, again))
}
