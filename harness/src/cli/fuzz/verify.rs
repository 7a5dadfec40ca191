//! `drivebench verify` of the folder of a fuzz run.

use crate::cli::exit::Exit;
use crate::cli::output::Output;
use crate::counted::counted;
use crate::evidence::{Signer, sealed};
use crate::explore::{ExploreError, Finding, KeptRun, LogLine, OnSim, Target as _};
use std::path::Path;

/// What no folder of a run confirms.
const UNCONFIRMED: &str =
    "unconfirmed  which cases were tried and showed nothing: the record has their number only\n";

/// Checks the files of a run, and plays its findings again where its drives were simulated ones.
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
    let complete = files.is_some();
    let files = files.unwrap_or_default();
    let mut wrong = files.len();
    for file in &files {
        output.result(&format!("{file}\n"))?;
    }
    let mut judged = 0;
    for line in &kept.lines {
        let LogLine::Finding { number, file, .. } = line else {
            continue;
        };
        let text = match again(&folder.join(file).with_extension("json"), kept) {
            Ok(Some(true)) => {
                judged += 1;
                format!("found again  case {number}\n")
            }
            Ok(None) => format!(
                "unconfirmed  case {number}: what the drives behind the ports answered is not in the folder\n"
            ),
            Ok(Some(false)) => {
                wrong += 1;
                format!(
                    "differs      case {number}: its conversation does not differ as the finding says\n"
                )
            }
            Err(error) => {
                wrong += 1;
                format!("differs      case {number}: {error}\n")
            }
        };
        output.result(&text)?;
    }
    output.result(UNCONFIRMED)?;
    match signer.filter(|_| wrong == 0) {
        Some(signer) => output.result(&format!("signed by    {}\n", signer.identity))?,
        None if !complete => output.result(
            "unconfirmed  that no file was changed: the folder has no sums (`fuzz run --sign KEY` makes and signs them)\n",
        )?,
        None => {}
    }
    output.result(&format!(
        "{} played again, {} wrong\n",
        counted(judged, "finding"),
        counted(wrong, "thing")
    ))?;
    Ok(match (wrong, complete) {
        (0, true) => Exit::Passed,
        (0, false) => Exit::Incomplete,
        _ => Exit::Failed,
    })
}

/// Whether a finding differs as it says when it is played again; `None` for one of a rig with ports.
fn again(file: &Path, kept: &KeptRun) -> Result<Option<bool>, ExploreError> {
    let (finding, _) = Finding::read(file)?;
    if kept.about.ports || finding.ports {
        return Ok(None);
    }
    let mut target = OnSim::new(finding.setup.clone());
    let rehearsal = target.rehearse(&finding.case)?;
    let tried = target.attempt(&finding.case, &rehearsal)?;
    let same = tried.difference.is_some_and(|found| {
        found.is_like(&finding.difference) && found.byte == finding.difference.byte
    });
    Ok(Some(same && finding.setup == kept.about.setup))
}
