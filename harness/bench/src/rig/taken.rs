//! A rig that this program holds: not in quarantine, locked, its hook `before` run and its power on.

use super::Rig;
use super::around::Around;
use super::in_use::UseOptions;
use super::lock::RigLock;
use super::session_error::SessionError;
use super::state;

/// A rig in the hands of this program, before its ports are opened. The lock is given back last.
#[derive(Debug)]
pub(super) struct TakenRig {
    pub(super) around: Around,
    pub(super) lock: Option<RigLock>,
}

impl TakenRig {
    /// Runs the hook `before` and switches the power on.
    pub(super) fn begin(rig: &Rig, lock: Option<RigLock>) -> Result<Self, SessionError> {
        let around = Around::begin(rig).map_err(|error| SessionError::Hook {
            rig: rig.id().to_owned(),
            error,
        })?;
        Ok(Self { around, lock })
    }
}

/// Takes a rig. A simulated one needs no lock.
pub(super) fn take(rig: &Rig, options: &UseOptions) -> Result<TakenRig, SessionError> {
    let forbidden = |quarantine: &super::file::Quarantine| SessionError::Quarantine {
        rig: rig.id().to_owned(),
        since: quarantine.since.clone(),
        reason: quarantine.reason.clone(),
    };
    if let Some(quarantine) = &rig.file.quarantine {
        return Err(forbidden(quarantine));
    }
    let lock = if rig.is_simulated() {
        None
    } else {
        let folder = state::folder().map_err(SessionError::State)?;
        let kept = state::quarantine(&folder, rig.id()).map_err(SessionError::State)?;
        if let Some(quarantine) = kept {
            return Err(forbidden(&quarantine));
        }
        let lock = RigLock::acquire(rig, &options.purpose, options.wait, &options.interrupt);
        options.unless_interrupted(rig)?;
        Some(lock?)
    };
    let taken = TakenRig::begin(rig, lock)?;
    options.unless_interrupted(rig)?;
    Ok(taken)
}
