//! A ring with ports: whether it is sound, what its line is like, and its figures.

pub mod figures;
pub(crate) mod health;
pub(crate) mod interlock;
pub(crate) mod judge;
pub(crate) mod left_open;
pub(crate) mod line_test;
pub(crate) mod sim;
