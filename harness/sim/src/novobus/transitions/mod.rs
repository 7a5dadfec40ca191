//! The matrix of protocol transitions of a drive's end of the bus: [`State`]s times [`Event`]s (ND21 9.1-9.9).
//!
//! A cell is reachable, or unreachable with a reason ([`why_unreachable`]). [`classify`] names the cell of a byte or a
//! silence at a bus end and changes nothing. [`Watched`] is a drive with that observer around it, and
//! [`Reached`] holds the cells of a run. [`tour`] leads to every reachable cell.
//!
//! The place of a drive in its ring is no dimension of the matrix. A drive receives only its inbound link, and a
//! damaged link can carry any byte, so every drive can reach the same cells. The tests check this:
//! a single drive that receives the bytes of one link of a ring goes through the same cells as the drive in the ring.
//!
//! The matrix is that of a drive with default properties.

mod classify;
mod event;
mod matrix;
mod named;
mod notes;
mod reached;
mod state;
pub mod tour;
mod watched;

pub use classify::{classify, state};
pub use event::Event;
pub use matrix::{RULES, Rule, why_unreachable};
pub use notes::Notes;
pub use reached::Reached;
pub use state::State;
pub use watched::Watched;

/// A cell of the matrix: what happened, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Transition {
    /// The state of the bus end before.
    pub state: State,
    /// What happened to it.
    pub event: Event,
}

/// How many cells the matrix has.
pub const CELLS: usize = State::ALL.len() * Event::ALL.len();

/// How many cells of the matrix can be reached.
pub const REACHABLE: usize = 435;

/// How many of these a drive can reach on which no time-out is monitored (ND21 9.9) and that reads no line error but that of the parity.
pub const WITHOUT_TIME_OUT: usize = 175;

impl Transition {
    /// All of them, state by state.
    pub fn all() -> impl Iterator<Item = Self> {
        let row = |state: &State| {
            let state = *state;
            Event::ALL.iter().map(move |event| Self {
                state,
                event: *event,
            })
        };
        State::ALL.iter().flat_map(row)
    }

    /// The reachable cells.
    pub fn reachable() -> impl Iterator<Item = Self> {
        Self::all().filter(|cell| why_unreachable(*cell).is_none())
    }

    /// Its number, below [`CELLS`].
    #[must_use]
    pub const fn index(self) -> usize {
        self.state.index() * Event::ALL.len() + self.event.index()
    }

    /// Its number among the reachable cells, from 0 to [`REACHABLE`] less 1; those [`WITHOUT_TIME_OUT`] have
    /// the first numbers. `None` for an unreachable cell.
    #[must_use]
    #[inline]
    pub fn number(self) -> Option<usize> {
        let number = matrix::NUMBERS[self.index()];
        (number != matrix::UNREACHABLE).then_some(usize::from(number))
    }

    /// Nothing.
    ///
    /// # Panics
    /// The matrix calls it unreachable.
    pub fn assert_possible(self) {
        if let Some(rule) = why_unreachable(self) {
            panic!("reached, and called unreachable: {self} ({})", rule.reason);
        }
    }
}

impl std::fmt::Display for Transition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.state.name(), self.event.name())
    }
}

#[cfg(test)]
mod tests;
