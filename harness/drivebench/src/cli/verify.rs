//! `drivebench verify`: every verdict of a folder of evidence, judged again.

use super::args::VerifyArguments;
use crate::buses::BUSES;
use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::evidence::{MERGE, Signer, verify as judge_again, verify_merged};

/// Judges a folder again.
pub(crate) fn verify(arguments: &VerifyArguments, output: &mut Output) -> std::io::Result<Exit> {
    let signer = arguments
        .allowed_signers
        .as_deref()
        .zip(arguments.identity.as_deref());
    let signer = signer.map(|(allowed, identity)| Signer { allowed, identity });
    let is_merged = arguments.folder.join(MERGE).exists();
    for rigs in BUSES.iter().filter_map(|bus| bus.rigs.as_ref()) {
        if let Some(exit) = (rigs.fuzz.verify)(&arguments.folder, signer, output) {
            return exit;
        }
    }
    let judged = match is_merged {
        true => verify_merged(&arguments.folder, signer).map(|(verified, _)| verified),
        false => judge_again(&arguments.folder, signer),
    };
    let verified = match judged {
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
    for what in &verified.unconfirmed {
        output.result(&format!("unconfirmed  {what}\n"))?;
    }
    if let Some(signer) = signer.filter(|_| wrong == 0) {
        output.result(&format!("signed by    {}\n", signer.identity))?;
    }
    let count = verified.attempts.len();
    output.result(&format!(
        "{} judged again, {} wrong{}\n",
        counted(count, "attempt"),
        counted(wrong, "thing"),
        if verified.complete {
            ""
        } else {
            "; incomplete: the run did not come to its end, or not all of it can be compared"
        }
    ))?;
    Ok(match (wrong, verified.complete) {
        (0, true) => Exit::Passed,
        (0, false) => Exit::Incomplete,
        _ => Exit::Failed,
    })
}
