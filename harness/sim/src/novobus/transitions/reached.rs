//! The cells of the matrix that a run has reached.

use super::{CELLS, Transition};
use std::sync::OnceLock;

const WORDS: usize = CELLS.div_ceil(64);

/// A set of cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reached([u64; WORDS]);

impl Default for Reached {
    fn default() -> Self {
        Self([0; WORDS])
    }
}

impl Reached {
    /// Adds a cell.
    #[inline]
    pub const fn add(&mut self, cell: Transition) {
        let index = cell.index();
        self.0[index / 64] |= 1 << (index % 64);
    }

    /// Adds those of another.
    pub fn join(&mut self, other: &Self) {
        for (word, other) in self.0.iter_mut().zip(&other.0) {
            *word |= other;
        }
    }

    /// The cells that are not in another set.
    #[must_use]
    pub fn beyond(&self, other: &Self) -> Self {
        let mut beyond = self.clone();
        for (word, other) in beyond.0.iter_mut().zip(&other.0) {
            *word &= !other;
        }
        beyond
    }

    /// Whether a cell is among them.
    #[must_use]
    pub const fn contains(&self, cell: Transition) -> bool {
        let index = cell.index();
        self.0[index / 64] >> (index % 64) & 1 != 0
    }

    /// How many they are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Their numbers, see [`Transition::index`]; in order.
    pub fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        self.0.iter().enumerate().flat_map(|(place, word)| {
            let mut left = *word;
            std::iter::from_fn(move || {
                let bit = left.trailing_zeros() as usize;
                left &= left.wrapping_sub(1);
                (bit < 64).then_some(place * 64 + bit)
            })
        })
    }

    /// A cell among them that the matrix calls unreachable; there is none unless the matrix or the drive is wrong.
    #[must_use]
    pub fn impossible(&self) -> Option<Transition> {
        static UNREACHABLE: OnceLock<Reached> = OnceLock::new();
        let unreachable = UNREACHABLE.get_or_init(|| {
            let mut cells = Self::default();
            Transition::all()
                .filter(|cell| cell.number().is_none())
                .for_each(|cell| cells.add(cell));
            cells
        });
        let pairs = self.0.iter().zip(&unreachable.0);
        // No end before the last word: nearly always there is none, and without branches this costs next to nothing.
        if pairs.fold(0, |all, (reached, not)| all | reached & not) == 0 {
            return None;
        }
        Transition::all().find(|cell| self.contains(*cell) && unreachable.contains(*cell))
    }

    /// Nothing.
    ///
    /// # Panics
    /// A cell is among them that the matrix calls unreachable.
    pub fn assert_possible(&self) {
        if let Some(cell) = self.impossible() {
            cell.assert_possible();
        }
    }
}
