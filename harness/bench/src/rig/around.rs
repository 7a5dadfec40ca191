//! What a rig's file wants to be run around its use: hooks, and switches for power.

use super::Rig;
use super::file::{HookEntry, Power};
use super::hook::{self, HookError};

/// A rig whose hook `before` has run and whose power is on. However its use ends, and where it could not be opened at all, the
/// hook `after` runs, and after an error `on_error` too.
#[derive(Debug)]
pub(super) struct Around {
    rig: Rig,
    /// Switches that were off before.
    switched: Vec<String>,
    used: bool,
    ended: bool,
}

impl Around {
    /// Runs the hook `before` and switches on every power that is not on.
    ///
    /// # Errors
    /// A program did not do its work; what was switched on is off again.
    pub(super) fn begin(rig: &Rig) -> Result<Self, Box<HookError>> {
        run(rig, "before", rig.file.hooks.before.as_ref())?;
        let mut around = Self {
            rig: rig.clone(),
            switched: Vec::new(),
            used: false,
            ended: false,
        };
        for (name, power) in &rig.file.power {
            if is_on(rig, name, power)? == Some(true) {
                continue;
            }
            around.switched.push(name.clone());
            hook::run(rig, &format!("power {name} on"), &power.on, power.timeout.0)?;
        }
        Ok(around)
    }

    /// Notes that the rig has been opened: its power stays on unless its safe state requires it off.
    pub(super) fn used(&mut self) {
        self.used = true;
    }

    /// Switches every power off and asks each that can be asked whether it is. What went wrong, in sentences.
    pub(super) fn power_off(&self) -> Vec<String> {
        power_off(&self.rig)
    }

    /// Runs the hook `after`, and `on_error` after an error. What went wrong, in sentences.
    pub(super) fn end(&mut self, error: bool) -> Vec<String> {
        if std::mem::replace(&mut self.ended, true) {
            return Vec::new();
        }
        let hooks = &self.rig.file.hooks;
        let on_error = hooks.on_error.as_ref().filter(|_| error);
        let entries = [("after", hooks.after.as_ref()), ("on_error", on_error)];
        let run = |(name, entry)| run(&self.rig, name, entry).err();
        let errors = entries.into_iter().filter_map(run);
        errors.map(|error| error.to_string()).collect()
    }
}

impl Drop for Around {
    /// The rig could not be opened, or a panic unwinds through here.
    fn drop(&mut self) {
        if self.ended {
            return;
        }
        if !self.used {
            for name in &self.switched {
                let power = self.rig.file.power.get(name);
                let _told_by_nobody = power.and_then(|power| switch_off(&self.rig, name, power));
            }
        }
        let _told_by_nobody = self.end(true);
    }
}

/// Switches every power of a rig off. What went wrong, in sentences.
pub(super) fn power_off(rig: &Rig) -> Vec<String> {
    let all = rig.file.power.iter();
    all.filter_map(|(name, power)| switch_off(rig, name, power))
        .collect()
}

fn switch_off(rig: &Rig, name: &str, power: &Power) -> Option<String> {
    let what = format!("power {name} off");
    let off = hook::run(rig, &what, &power.off, power.timeout.0);
    match off.map_err(Box::new).and_then(|_| is_on(rig, name, power)) {
        Ok(Some(true)) => Some(format!("{what}: it is still on")),
        Ok(_) => None,
        Err(error) => Some(format!("{what}: {error}")),
    }
}

/// Whether a power is on; `None` where its file names no program that says so.
fn is_on(rig: &Rig, name: &str, power: &Power) -> Result<Option<bool>, Box<HookError>> {
    let Some(command) = &power.status else {
        return Ok(None);
    };
    let finished = hook::status(
        rig,
        &format!("power {name} status"),
        command,
        power.timeout.0,
    )?;
    match finished.status.code() {
        Some(0) => Ok(Some(true)),
        Some(1) => Ok(Some(false)),
        _ => Err(Box::new(HookError::Failed {
            command: command.join(" "),
            finished,
        })),
    }
}

fn run(rig: &Rig, name: &str, entry: Option<&HookEntry>) -> Result<(), Box<HookError>> {
    if let Some(entry) = entry {
        hook::run(rig, name, &entry.command, entry.timeout.0)?;
    }
    Ok(())
}
