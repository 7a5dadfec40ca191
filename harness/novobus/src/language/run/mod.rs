//! The bus's words, played.

pub(crate) mod bytes;
pub(crate) mod check;
pub(crate) mod drives;
pub(crate) mod look;
pub(crate) mod master;
pub(crate) mod now;
pub(crate) mod over_bus;
pub(crate) mod record;
pub(crate) mod state;
pub(crate) mod tapped;

/// A scenario of rings that is being played.
pub(crate) type Runner<'a> = harness_bench::scenario::run::player::Runner<'a, super::Novobus>;
