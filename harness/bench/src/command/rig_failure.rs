//! Messages and exit codes for a rig that cannot be used, and for how its use ended.

use super::exit::Exit;
use super::output::Output;
use crate::link::Trouble;
use crate::rig::buses::RigBuses;
use crate::rig::find::folder;
use crate::rig::lock::LockError;
use crate::rig::{Alarm, End, FindError, Rig, SessionError, UseOptions, find};
use crate::signals::interrupt_flag;
use crate::top::screen;
use std::io::Write;
use std::time::{Duration, Instant};

/// Finds the rig of this name, whatever its bus; reports what is wrong with it.
pub fn find_any_rig(name: &str, buses: &'static RigBuses, output: &mut Output) -> Option<Rig> {
    match find(name, &folder(), buses) {
        Ok(rig) => Some(rig),
        Err(FindError::Mistakes(problems)) => {
            output.mistakes(&problems);
            None
        }
        Err(error) => {
            output.complain(&error.to_string());
            None
        }
    }
}

/// The alarm of a program that hangs: it prints why and exits with the code for an unconfirmed safe state.
pub fn alarm() -> Alarm {
    Alarm::new(|why| {
        let why = format!("error: {why}\n");
        // Standard error may be what hangs.
        let said = std::thread::spawn(move || {
            screen::leave();
            let _nobody_reads = std::io::stderr().write_all(why.as_bytes());
        });
        let end = Instant::now() + Duration::from_secs(1);
        while !said.is_finished() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(10));
        }
        std::process::exit(i32::from(Exit::NotSafe as u8));
    })
}

/// How a command uses a rig, with the program's own interrupt and alarm.
pub fn use_options(purpose: &str, allow_motion: bool, wait: Option<Duration>) -> UseOptions {
    UseOptions {
        purpose: purpose.to_owned(),
        wait: wait.unwrap_or_default(),
        allow_motion,
        interrupt: interrupt_flag(),
        alarm: alarm(),
        ..UseOptions::default()
    }
}

/// Reports why a rig cannot be used, and gives the exit code for it.
pub fn tell_session(error: &SessionError, output: &mut Output) -> Exit {
    match error {
        SessionError::Mistakes(problems) => output.mistakes(problems),
        error => output.complain(&error.to_string()),
    }
    exit_of(error)
}

/// The exit code for a rig that cannot be used.
pub fn exit_of(error: &SessionError) -> Exit {
    match error {
        SessionError::OtherBus { .. } | SessionError::Mistakes(_) => Exit::Usage,
        SessionError::Lock(LockError::Busy { .. }) | SessionError::PortInUse { .. } => Exit::Busy,
        SessionError::Interrupted { end: Some(end), .. } if end.is_unsafe() => Exit::NotSafe,
        SessionError::Interrupted { .. } => Exit::Interrupted,
        SessionError::Lock(LockError::Io { .. })
        | SessionError::Drives { .. }
        | SessionError::Quarantine { .. }
        | SessionError::State(_)
        | SessionError::Hook { .. }
        | SessionError::Watchdog(_)
        | SessionError::Ill { .. } => Exit::RigError,
    }
}

/// The exit code of work that this trouble has ended.
pub fn exit_of_end(trouble: Option<&Trouble>, exit: Exit, output: &mut Output) -> Exit {
    match trouble {
        Some(Trouble::Interrupted) => Exit::Interrupted,
        // It may have shown behind the last call of a command that went well.
        Some(Trouble::Interlock(why)) => {
            if exit != Exit::Interlock {
                output.complain(why);
            }
            Exit::Interlock
        }
        // It may have come behind the last scenario, which has judged everything by then; the bench has failed all the same.
        Some(Trouble::Lost(_) | Trouble::Garbled(_)) => Exit::RigError,
        Some(Trouble::Denied(_)) | None => exit,
    }
}

/// Reports how a rig was given back. A safe state that is not confirmed is more serious than anything else.
pub fn tell_end(end: &End, exit: Exit, output: &mut Output) -> Exit {
    for remark in &end.remarks {
        output.complain(remark);
    }
    for power in &end.power {
        output.complain(power);
    }
    match &end.safe {
        Some(safe) if safe.confirmed => output.say(&format!("{safe}\n")),
        Some(safe) => output.complain(&safe.to_string()),
        None => {}
    }
    if end.is_unsafe() {
        return Exit::NotSafe;
    }
    match end.remarks.is_empty() {
        true => exit,
        false => exit.with_rig_error(),
    }
}
