//! Where an observer notes the cells that a run reaches.

use super::{Reached, Transition};

/// Takes down the cells of the matrix that a drive goes through.
pub trait Notes: Clone + Default {
    /// A cell has been reached.
    fn note(&mut self, cell: Transition);

    /// Adds what another has noted.
    fn join(&mut self, other: &Self);

    /// Nothing.
    ///
    /// # Panics
    /// A cell is noted that the matrix calls unreachable; here at the latest, where [`Self::note`] has let it pass.
    fn assert_possible(&self);
}

impl Notes for Reached {
    #[inline]
    fn note(&mut self, cell: Transition) {
        self.add(cell);
    }

    fn join(&mut self, other: &Self) {
        Self::join(self, other);
    }

    fn assert_possible(&self) {
        Self::assert_possible(self);
    }
}
