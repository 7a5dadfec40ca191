//! A ring with ports: whether it is sound, what its line is like, and its figures.

pub mod figures;
pub(crate) mod health;
pub(crate) mod line_test;
