//! Captures of a ring: two side by side, a scenario made of one, and one judged against the model.

mod begin;
pub(crate) mod diff;
pub(crate) mod faults;
pub(crate) mod judge;
#[cfg(test)]
mod judged_tests;
mod open;
#[cfg(test)]
mod portion_tests;
pub(crate) mod scenario;
pub(crate) mod stimuli;
#[cfg(test)]
mod tests;
pub(crate) mod told;
