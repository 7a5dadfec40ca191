//! Captures of a ring: their JSON, a scenario made of one, and one judged against the model.

mod begin;
pub(crate) mod json;
pub(crate) mod judge;
mod open;
pub(crate) mod scenario;
pub(crate) mod stimuli;
