//! Captures of a ring: two side by side, a scenario made of one, and one judged against the model.

mod begin;
pub mod diff;
pub(crate) mod faults;
pub mod judge;
mod open;
pub mod scenario;
pub(crate) mod stimuli;
#[cfg(test)]
mod tests;
