//! Names of features for the acts and events of a master and for the bytes of a line.

use crate::fuzz::{Feature, Notebook};
use harness_proto::line::Received;
use harness_proto::novobus::command::{Kind, LAYOUTS};
use harness_proto::novobus::master::{Event, Fault, Outcome, Phase, Refused};

/// The section of the manual and the name of a command.
pub(super) fn kind(kind: Kind) -> (&'static str, &'static str) {
    let layout = LAYOUTS.iter().find(|layout| layout.kind == kind);
    layout.map_or(("10", "a command"), |layout| {
        (layout.section, layout.printed_name)
    })
}

/// The section of the manual and the name of what a master is doing.
pub(super) const fn phase(phase: Phase) -> (&'static str, &'static str) {
    match phase {
        Phase::Counting => ("9.1", "counting the drives"),
        Phase::Running => ("11.6", "at work"),
        Phase::Locating => ("9.7", "waiting for an address to be spelled out"),
        Phase::Draining => ("9.9", "silent after a failed recovery"),
        Phase::Resetting => ("9.8", "sending the check sequence"),
        Phase::Verifying => ("9.8", "waiting for the check sequence"),
        Phase::Stopped => ("11.5", "stopped"),
    }
}

/// What was wrong.
pub(super) const fn fault(fault: Fault) -> &'static str {
    match fault {
        Fault::Damaged(_) => "a damaged link",
        Fault::Broken(_) => "a broken link",
        Fault::Silent => "silence",
        Fault::WrongRingSize { .. } => "another number of drives",
        Fault::Late => "late answers",
        Fault::Lost { .. } => "lost bytes",
        Fault::Extra { .. } => "extra bytes",
        Fault::Protocol { .. } => "a byte that a drive must not send",
        Fault::Rejected { .. } => "a command that a drive does not accept",
        Fault::Unclear => "wrong bytes, and nothing shows from where",
    }
}

/// How a job ended.
pub(super) const fn outcome(outcome: &Outcome) -> &'static str {
    match outcome {
        Outcome::Read(_) => "read",
        Outcome::Done {
            perhaps_twice: false,
        } => "done",
        Outcome::Done {
            perhaps_twice: true,
        } => "done, perhaps twice",
        Outcome::Unknown(_) => "unknown",
        Outcome::Failed(_) => "failed",
    }
}

/// What was wrong where a job ended without a result.
pub(super) const fn reason(outcome: &Outcome) -> Option<Fault> {
    match outcome {
        Outcome::Read(_) | Outcome::Done { .. } => None,
        Outcome::Unknown(fault) => Some(*fault),
        Outcome::Failed(stop) => Some(stop.fault),
    }
}

/// What came back in a byte time: nothing, or a byte; `due`: what a sound ring would have sent.
pub(super) fn heard(received: Option<Received>, due: Option<u8>) -> &'static str {
    match received {
        None => "nothing came",
        Some(Received { error: Some(_), .. }) => "a line error came",
        Some(Received { byte, .. }) if due == Some(byte) => "the right byte came",
        Some(Received { byte: 0, .. }) => "a zero came",
        Some(_) => "another byte came",
    }
}

/// The byte times of a master. One like that before it is noted no more.
#[derive(Default)]
pub(super) struct Steps {
    last: Option<(Phase, &'static str, Phase)>,
}

impl Steps {
    /// What it was doing, what came, and what it does then.
    pub(super) fn note(
        &mut self,
        notes: &mut Notebook<'_>,
        before: Phase,
        heard: &'static str,
        behind: Phase,
    ) {
        let step = Some((before, heard, behind));
        if std::mem::replace(&mut self.last, step) == step {
            return;
        }
        let (section, place) = phase(before);
        notes.note(|| match before == behind {
            true => Feature::new(section, place, heard),
            false => Feature::new(section, place, format!("{heard}; then {}", phase(behind).1)),
        });
    }
}

/// What a master tells; `job`: of an end, which command it was and what the master was doing when it was given the job.
pub(super) fn told(notes: &mut Notebook<'_>, event: &Event, job: Option<(Kind, Phase)>) {
    match event {
        Event::Ready => notes.note(|| Feature::new("9.1", "told", "the ring answers")),
        Event::Round { .. } => {
            notes.note(|| Feature::new("9.4", "told", "a round of process data"))
        }
        Event::Disturbed {
            fault: wrong,
            attempt,
        } => {
            notes.note(|| {
                Feature::new(
                    "9.7",
                    format!("disturbed by {}", fault(*wrong)),
                    times(*attempt),
                )
            });
        }
        Event::Recovered { attempts } => {
            notes.note(|| Feature::new("9.8", "recovered", times(*attempts)));
        }
        Event::Stopped(stop) => {
            notes.note(|| Feature::new("11.5", "stopped", fault(stop.fault)));
        }
        Event::Ended { outcome: ended, .. } => {
            if let Some((command, given)) = job {
                let (section, name) = kind(command);
                notes.note(|| Feature::new(section, name, outcome(ended)));
                let given = phase(given).1;
                notes.note(|| {
                    Feature::new("11.6", format!("a job given while {given}"), outcome(ended))
                });
            }
            if let Some(wrong) = reason(ended) {
                let ended = outcome(ended);
                notes
                    .note(|| Feature::new("11.5", format!("a job ended as {ended}"), fault(wrong)));
            }
        }
    }
}

/// A word for a count: the master tries eight times (ND21 11.5), and the last word covers more than three tries.
const fn times(count: u8) -> &'static str {
    match count {
        0 | 1 => "once",
        2 => "twice",
        3 => "three times",
        _ => "more than three times",
    }
}

/// Why a job was not taken.
pub(super) fn refused(notes: &mut Notebook<'_>, refused: &Refused) {
    let why = match refused {
        Refused::Drive(_) => "no such drive",
        Refused::OutOfRange { .. } => "out of range",
        Refused::Full { .. } => "no room",
        Refused::Stopped(_) => "stopped",
    };
    notes.note(|| Feature::new("11.6", "a job is not taken", why));
}
