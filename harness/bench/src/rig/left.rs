//! What a scenario changes in drives, until it is put back: for a program that ends before it can.

use super::{Rig, state};
use crate::medium::Pieces;
use crate::regular::{self, Links};
use std::io::Write as _;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The most bytes that are read of the file.
const MAX_SIZE: u64 = 1 << 20;

/// What may be changed.
#[derive(Debug, Default)]
struct ChangedNotes {
    /// By scenarios before, which could not put it back.
    kept: Vec<String>,
    /// By the scenario that is played now.
    now: Vec<String>,
    /// What stops the drives where that scenario may have moved them.
    stops: Option<Pieces>,
}

/// Sentences with the commands that put it back. They stand in the file `ID.left` beside the rig's lock too, for the next run after one that
/// was killed.
#[derive(Clone, Debug, Default)]
pub struct NotPutBack {
    changed: Arc<Mutex<ChangedNotes>>,
    file: Option<PathBuf>,
    origin: String,
}

impl NotPutBack {
    /// Of a rig with ports. Without a folder of its state it is kept in memory alone.
    pub fn of(rig: &Rig) -> Self {
        let folder = state::folder().ok().filter(|_| !rig.is_simulated());
        Self {
            changed: Arc::default(),
            file: folder.map(|folder| folder.join(format!("{}.left", rig.id()))),
            origin: rig.origin.clone(),
        }
    }

    /// The rig's file, as commands name it.
    pub fn origin(&self) -> &str {
        &self.origin
    }

    fn changed(&self) -> MutexGuard<'_, ChangedNotes> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a scenario is about to change, and what stops drives that it moves.
    pub fn foretell(&self, now: Vec<String>, stops: Option<Pieces>) {
        let mut changed = self.changed();
        (changed.now, changed.stops) = (now, stops);
        drop(changed);
        self.write();
    }

    /// All that was foretold is put back but for this.
    pub fn keep(&self, notes: &[String]) {
        let mut changed = self.changed();
        let fresh = notes.iter().filter(|note| !changed.kept.contains(note));
        let fresh: Vec<_> = fresh.cloned().collect();
        changed.kept.extend(fresh);
        drop(changed);
        self.foretell(Vec::new(), None);
    }

    /// Writes the file. One that is not written is missed only by a run that is killed.
    fn write(&self) {
        let Some(file) = &self.file else { return };
        let all = self.all().join("\n");
        let _kept = match all.is_empty() {
            true => std::fs::remove_file(file),
            false => state::create(file).and_then(|mut file| file.write_all(all.as_bytes())),
        };
    }

    /// What the scenario that is played now may have changed.
    pub(crate) fn foretold(&self) -> Vec<String> {
        self.changed().now.clone()
    }

    /// The same, and what those before have.
    pub fn all(&self) -> Vec<String> {
        let changed = self.changed();
        [&changed.kept[..], &changed.now].concat()
    }

    /// What stops drives that may have been moved.
    pub fn stops(&self) -> Option<Pieces> {
        self.changed().stops.clone()
    }

    /// What the run before has left.
    pub fn before(&self) -> Option<String> {
        let kept = regular::read(self.file.as_ref()?, Links::Refuse, MAX_SIZE).ok()?;
        let kept = String::from_utf8_lossy(&kept).replace('\n', "; ");
        (!kept.is_empty())
            .then(|| format!("the run before ended without putting back what it changed: {kept}"))
    }

    /// The same, which is said once.
    pub fn take_before(&self) -> Option<String> {
        let before = self.before();
        let _said = self.file.as_ref().map(std::fs::remove_file);
        before
    }
}
