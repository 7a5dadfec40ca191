//! `drivebench verify` of the folder of a fuzz run.

use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::counted::counted;
use crate::evidence::{Signer, sealed};
use crate::explore::files::read_text;
use crate::explore::{
    ExploreError, Finding, KeptRun, LogLine, OnSim, Target as _, count_finding, judged_again,
};
use std::collections::BTreeMap;
use std::path::Path;

/// What no folder of a run confirms.
const UNCONFIRMED: &str =
    "unconfirmed  which cases were tried and showed nothing: the record has their number only\n";

/// Checks the files of a run, and judges its findings again.
pub(crate) fn verify(
    folder: &Path,
    kept: &KeptRun,
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
            Ok(Again::Same(finding)) if !is_of(&finding, line) => {
                wrong += 1;
                format!(
                    "differs      case {number}: {file}.json is not the finding of the record\n"
                )
            }
            Ok(Again::Same(_)) => {
                judged += 1;
                format!("found again  case {number}\n")
            }
            Ok(Again::Unknown) => {
                complete = false;
                format!(
                    "unconfirmed  case {number}: what the drives behind the ports answered is not in the folder\n"
                )
            }
            Ok(Again::Differs(why)) => {
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

/// What came of judging a finding again.
enum Again {
    /// The same.
    Same(Box<Finding>),
    /// Something else, and what.
    Differs(String),
    /// The folder does not have what it rests on.
    Unknown,
}

/// Whether a line of the record is about a finding.
fn is_of(finding: &Finding, line: &LogLine) -> bool {
    matches!(line, LogLine::Finding { number, signature, confirmed, .. }
        if *number == finding.number && *signature == finding.difference.key() && *confirmed == finding.confirmed)
}

/// Judges a finding again: on simulated drives it is played again, on a ring with ports its attempts are in its file.
fn again(
    folder: &Path,
    file: &str,
    kept: &KeptRun,
    known: &BTreeMap<String, u8>,
) -> Result<Again, ExploreError> {
    let (finding, path) = Finding::read(&folder.join(file).with_extension("json"))?;
    let scenario = path.with_extension("scn");
    if read_text(&scenario)? != finding.text()? {
        let why = format!("{file}.scn is not the scenario of its finding");
        return Ok(Again::Differs(why));
    }
    let about = &kept.about;
    let of = |own: &Finding| (own.rig.clone(), own.setup.clone(), own.ports, own.seed);
    if of(&finding)
        != (
            about.rig.clone(),
            about.setup.clone(),
            about.ports,
            about.seed,
        )
    {
        let why = "it is of another run than the record";
        return Ok(Again::Differs(why.to_owned()));
    }
    if about.ports {
        return Ok(match judged_again(&finding, about, known)? {
            None => Again::Unknown,
            Some(own) if own == finding => Again::Same(Box::new(finding)),
            Some(own) => Again::Differs(format!(
                "the file has \"{}\", its attempts give \"{}\"",
                told(&finding),
                told(&own)
            )),
        });
    }
    let mut target = OnSim::new(finding.setup.clone());
    let rehearsal = target.rehearse(&finding.case)?;
    let tried = target.attempt(&finding.case, &rehearsal)?;
    let same = tried.difference.is_some_and(|found| {
        found.is_like(&finding.difference) && found.byte == finding.difference.byte
    });
    Ok(match same {
        true => Again::Same(Box::new(finding)),
        false => Again::Differs("its conversation does not differ as the finding says".to_owned()),
    })
}

/// A finding in a line.
fn told(finding: &Finding) -> String {
    let Finding { seen_again, of, .. } = finding;
    let sent = counted(finding.case.bytes().len(), "byte");
    format!(
        "{}; seen again {seen_again} of {of} times; {sent} sent",
        finding.difference.about
    )
}
