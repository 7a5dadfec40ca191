//! `drivebench verify`: every verdict of a folder of evidence, judged again.

use super::exit::Exit;
use super::output::Output;
use crate::evidence::verify as judge_again;
use std::path::Path;

/// Judges a folder again.
pub(super) fn verify(folder: &Path, output: &mut Output) -> std::io::Result<Exit> {
    let verified = match judge_again(folder) {
        Ok(verified) => verified,
        Err(error) => {
            output.complain(&error.to_string());
            return Ok(Exit::Usage);
        }
    };
    let mut wrong = verified.files.len();
    for file in &verified.files {
        output.result(&format!("{file}\n"))?;
    }
    for attempt in &verified.attempts {
        let recorded = attempt.recorded.as_deref().unwrap_or("unfinished");
        let text = match &attempt.differs {
            None => format!("{recorded:12} {}\n", attempt.name),
            Some(differs) => {
                wrong += 1;
                format!("differs      {}: {differs}\n", attempt.name)
            }
        };
        output.result(&text)?;
        for fault in &attempt.unused {
            output.result(&format!(
                "             this fault never happened: {fault}\n"
            ))?;
        }
    }
    let count = verified.attempts.len();
    output.result(&format!(
        "{count} attempts judged again, {wrong} things wrong{}\n",
        if verified.complete {
            ""
        } else {
            "; incomplete: the run did not come to its end"
        }
    ))?;
    Ok(match (wrong, verified.complete) {
        (0, true) => Exit::Passed,
        (0, false) => Exit::Incomplete,
        _ => Exit::Failed,
    })
}
