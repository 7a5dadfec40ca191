//! `drivebench recover`: a ring is brought back from the error mode (ND21 9.7, 9.8) and its drives are counted
//! (9.3).

use super::rig;
use crate::driver::{self, Axis, Recovery, SpelledOut, SpellingCause};
use crate::rig::OfRings as _;
use harness_bench::command::drive::{OutputForm, RecoverArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::tell_end;
use harness_bench::command::rig_name::{RigName, Use};
use harness_bench::counted::counted;
use harness_bench::link::Line;
use harness_proto::novobus::address::MAX_DRIVES;
use serde_json::json;

/// Recovers every ring of a bench.
pub(crate) fn recover(arguments: &RecoverArguments, output: &mut Output) -> Result<Exit, Failure> {
    let Some(RigName::Named(_)) = &arguments.rig.rig else {
        let sizes = arguments.rig.rig.as_ref().and_then(RigName::sizes);
        let (plan, mut link) = rig::link(&arguments.rig, sizes)?;
        return show(arguments, &every(&mut link, plan.rings.len()), output);
    };
    let rig = rig::named(&arguments.rig)?;
    let mut session = rig::take(rig, &arguments.rig, Use::look("recover"), true)?;
    let rings = session.rings().len();
    let before = session.drives().opening.clone();
    let mut found = every(session.link(), rings);
    // What drives spelled out before the rig was opened.
    for (ring, spelled) in before.into_iter().flat_map(|health| health.reported) {
        let recovery = found.get_mut(ring);
        if let Some(recovery) = recovery.filter(|recovery| recovery.fault().is_none()) {
            recovery.before = Some(spelled);
        }
    }
    let trouble = session.link().trouble().cloned();
    let end = session.release();
    let exit = match trouble {
        Some(trouble) => Err(driver::Error::Link(trouble).into()),
        None => show(arguments, &found, output),
    };
    let exit = exit.unwrap_or_else(|failure| failure.tell(output));
    Ok(tell_end(&end, exit, output))
}

pub(super) fn every(link: &mut dyn Line, rings: usize) -> Vec<Recovery> {
    (0..rings).map(|ring| driver::recover(link, ring)).collect()
}

fn show(
    arguments: &RecoverArguments,
    found: &[Recovery],
    output: &mut Output,
) -> Result<Exit, Failure> {
    match arguments.format {
        OutputForm::Text => {
            for (ring, recovery) in found.iter().enumerate() {
                output.result(&text(ring, recovery))?;
            }
        }
        OutputForm::Json => {
            let rings: Vec<_> = found
                .iter()
                .map(|recovery| {
                    let drive = |spelled: Option<SpelledOut>| spelled.map(|spelled| spelled.drive);
                    let missed = |spelled: &SpelledOut| spelled.why == SpellingCause::MissedMaster;
                    json!({
                        "reported": drive(recovery.fault()),
                        "missed_master": drive(recovery.before.filter(missed)),
                        "drives": recovery.drives.map(|size| size.drives()),
                        "still": recovery.after,
                        "zeros_unasked": recovery.zeros_unasked,
                        "heard": hex(&recovery.heard),
                    })
                })
                .collect();
            output.result(&format!("{}\n", json!({"schema": 1, "rings": rings})))?;
        }
    }
    if found.iter().all(|recovery| recovery.drives.is_some()) {
        Ok(Exit::Passed)
    } else {
        Ok(Exit::RigError)
    }
}

fn hex(bytes: &[u8]) -> String {
    let all: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    all.join(" ")
}

/// What a ring does behind the check sequence that is not back and of which no drive reports.
fn come_back(heard: &[u8]) -> String {
    match heard {
        [] => "nothing comes back behind the check sequence: the ring is broken, or the drive in front of the master has no power (ND21 9.9)"
            .to_owned(),
        [first, rest @ ..] if rest.iter().all(|byte| byte == first) => {
            let spelled = match MAX_DRIVES > u16::from(*first) {
                true => format!(", or drive {first}, if the ring has it, stays in the error mode and spells out its address (ND21 9.7)"),
                false => String::new(),
            };
            format!(
                "{first:02X} comes back all the time, whatever is sent: a drive's transmitter sends the same byte for ever{spelled}"
            )
        }
        _ => format!(
            "bytes come back behind the check sequence, and they are not those of a ring ({} ...): another rate, another device, or a drive that \
             damages what it passes on",
            hex(heard)
        ),
    }
}

pub(super) fn text(ring: usize, recovery: &Recovery) -> String {
    let name = |drive: u8| Axis::new(ring, drive).map_or(String::new(), |axis| axis.to_string());
    let fault = |drive: u8| {
        format!(
            "drive {} spells out its address: the fault is in front of it, on its link or in the sender there (ND21 9.7, 9.9)",
            name(drive)
        )
    };
    let before = match (recovery.before, recovery.drives) {
        (Some(SpelledOut { drive, why }), _) => match why {
            SpellingCause::Fault => fault(drive),
            SpellingCause::FaultOrSilence => format!(
                "drive {} spells out its address: it may monitor time-outs and have heard no byte for 10 ms, because no master sent or the \
                 computer was held up, or the fault is on its link or in the sender there (ND21 9.7, 9.9)",
                name(drive)
            ),
            SpellingCause::MissedMaster => format!(
                "drive {} monitors time-outs and had heard no byte for 10 ms, because no master sent; no fault reported (ND21 9.9, 14.10.2)",
                name(drive)
            ),
        },
        (None, Some(_)) => "no fault reported".to_owned(),
        (None, None) => "no drive reports".to_owned(),
    };
    let behind = match (recovery.drives, recovery.after) {
        (Some(size), _) => {
            format!(
                "{} answered after the check sequence",
                counted(size.drives(), "drive")
            )
        }
        (None, Some(drive)) => format!("behind the check sequence still: {}", fault(drive)),
        (None, None) if recovery.zeros_unasked => {
            "zeros come without end although nothing is sent: drive 0 hears nothing on the link in \
             front of it and monitors time-outs, or it is defective (ND21 9.9)"
                .to_owned()
        }
        (None, None) => come_back(&recovery.heard),
    };
    format!("ring {}: {before}; {behind}\n", ring + 1)
}
