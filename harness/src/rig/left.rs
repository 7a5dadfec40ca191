//! What a scenario changes in drives, until it is put back: for a program that ends before it can.

use super::{Rig, state};
use crate::regular::{self, Links};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// The most bytes that are read of the file.
const MAX_SIZE: u64 = 1 << 16;

/// Sentences with the commands that put it back. They stand in the file `ID.left` beside the rig's lock too, for the next run behind one that
/// was killed.
#[derive(Clone, Debug, Default)]
pub(crate) struct NotPutBack {
    now: Arc<Mutex<Vec<String>>>,
    file: Option<PathBuf>,
    origin: String,
}

impl NotPutBack {
    /// Of a rig with ports. Without a folder of its state it is kept in memory alone.
    pub(crate) fn of(rig: &Rig) -> Self {
        let folder = state::folder().ok().filter(|_| !rig.is_simulated());
        Self {
            now: Arc::default(),
            file: folder.map(|own| own.join(format!("{}.left", rig.id()))),
            origin: rig.origin.clone(),
        }
    }

    /// The rig's file, as commands name it.
    pub(crate) fn origin(&self) -> &str {
        &self.origin
    }

    /// What may be changed from now on; nothing once all is put back.
    pub(crate) fn set(&self, now: Vec<String>) {
        // A file that is not written is missed only by a run that is killed.
        let _kept = self.file.as_ref().map(|file| match now.is_empty() {
            true => std::fs::remove_file(file),
            false => {
                state::create(file).and_then(|mut own| own.write_all(now.join("\n").as_bytes()))
            }
        });
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = now;
    }

    /// What may be changed now.
    pub(crate) fn all(&self) -> Vec<String> {
        let now = self.now.lock().unwrap_or_else(PoisonError::into_inner);
        now.clone()
    }

    /// What the run before has left, which is said once.
    pub(crate) fn before(&self) -> Option<String> {
        let file = self.file.as_ref()?;
        let kept = regular::read(file, Links::Refuse, MAX_SIZE).ok()?;
        let _said = std::fs::remove_file(file);
        let kept = String::from_utf8_lossy(&kept).replace('\n', "; ");
        (!kept.is_empty())
            .then(|| format!("the run before ended without putting back what it changed: {kept}"))
    }
}
