//! What came of judging a capture, in the words of the command line.

use super::judge::{CaptureVerdict, judge};
use super::scenario::scenario;
use harness_bench::capture::{Capture, JudgeOptions, JudgedCapture};
use harness_bench::counted::counted;
use harness_bench::report::pcapng::name;
use harness_bench::scenario::verdict::Verdict;
use harness_sim::record::LineByte;

/// Judges a capture.
///
/// # Errors
/// There is no judgement, in a sentence.
pub(crate) fn judged(
    capture: &Capture,
    options: &JudgeOptions<'_>,
) -> Result<JudgedCapture, String> {
    all_drives(options)?;
    let judged = judge(capture, options).map_err(|error| error.to_string())?;
    let links = capture.traces.iter().map(|trace| trace.channels.len());
    let mut remarks = damaged(capture);
    remarks.extend(notes(&judged));
    Ok(JudgedCapture {
        verdict: judged.verdict,
        about: format!(
            "{} on {} in {}",
            counted(capture.bytes(), "byte"),
            counted(links.sum::<usize>(), "link"),
            capture.end(),
        ),
        differences: Vec::new(),
        remarks,
        shown: shown(&judged),
    })
}

/// Makes a scenario of a capture.
///
/// # Errors
/// There is none in it, in a sentence.
pub(crate) fn replayed(capture: &Capture, options: &JudgeOptions<'_>) -> Result<String, String> {
    all_drives(options)?;
    scenario(capture, options).map_err(|error| error.to_string())
}

fn all_drives(options: &JudgeOptions<'_>) -> Result<(), String> {
    match options.stations {
        [] => Ok(()),
        _ => Err("`--judge` names slaves or drives of a line that they share; of a ring all drives are judged".to_owned()),
    }
}

/// Where bytes arrived damaged: it is a cable or a sender, and no drive that receives them.
fn damaged(capture: &Capture) -> Vec<String> {
    let mut all = Vec::new();
    for (ring, trace) in capture.traces.iter().enumerate() {
        for link in &trace.channels {
            let bad = |byte: &&LineByte| byte.error.is_some() || byte.received.is_none();
            let count = link.octets().iter().filter(bad).count();
            if count > 0 {
                all.push(format!(
                    "{} damaged over {}: by the cable there, or by the sender in front of it",
                    counted(count, "byte"),
                    name(ring, link)
                ));
            }
        }
    }
    all
}

fn notes(judged: &CaptureVerdict) -> Vec<String> {
    let mut all = Vec::new();
    if judged.adopted > 0 {
        all.push(format!(
            "{} taken to hold the first value that the drives reported",
            counted(judged.adopted, "cell")
        ));
    }
    if judged.unforeseen > 0 {
        all.push(format!(
            "{} not compared: data that changes by itself, and its checking bytes",
            counted(judged.unforeseen, "byte")
        ));
    }
    all.extend(judged.remarks.iter().cloned());
    if let Some((ring, drive)) = judged.located {
        let ring = if ring == 0 { "" } else { " of ring 2" };
        all.push(format!(
            "the ring spells out drive {drive}{ring}: it saw a fault first"
        ));
    }
    all
}

/// The bytes around what differs.
fn shown(judged: &CaptureVerdict) -> String {
    let right = match judged.verdict {
        Verdict::Passed if judged.links.differ == 0 => return String::new(),
        Verdict::Passed => {
            "what the master received is right; what a link between drives carried is not that of the model:\n"
        }
        _ => "",
    };
    format!("\n{right}{}", judged.links.show("capture", "model"))
}
