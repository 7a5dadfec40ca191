//! `drivebench verify` of the folder of a fuzz run.

use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::counted::counted;
use crate::evidence::{Signer, sealed};
use crate::explore::files::read_text;
use crate::explore::{
    Differing as _, ExploreError, Finding, FuzzCase, JudgedAgain, KeptRun, LogLine, count_finding,
};
use std::collections::BTreeMap;
use std::path::Path;

/// What no folder of a run confirms.
const UNCONFIRMED: &str =
    "unconfirmed  which cases were tried and showed nothing: the record has their number only\n";

/// Checks the files of a run, and judges its findings again.
pub(crate) fn verify<C: FuzzCase>(
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
    let mut complete = has_sums;
    let files = files.unwrap_or_default();
    let mut wrong = files.len();
    for file in &files {
        output.result(&format!("{file}\n"))?;
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
        let text = match again(folder, file, kept, &known) {
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
    match signer.filter(|_| wrong == 0) {
        Some(signer) => output.result(&format!("signed by    {}\n", signer.identity))?,
        None if !has_sums => output.result(
            "unconfirmed  that no file was changed: the folder has no sums (`fuzz run --sign KEY` makes and signs them)\n",
        )?,
        None => {}
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
    let of = |own: &Finding<C>| (own.rig.clone(), own.setup.clone(), own.ports, own.seed);
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
