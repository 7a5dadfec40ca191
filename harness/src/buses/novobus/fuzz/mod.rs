//! What the kept inputs reach of the bus's transitions.

pub mod coverage;
pub(crate) mod noted;
