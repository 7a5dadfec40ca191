//! The bus's words, played.

pub(crate) mod bytes;
pub(crate) mod check;
pub(crate) mod drives;
pub(crate) mod look;
pub(crate) mod master;
pub(crate) mod now;
pub mod over_bus;
pub(crate) mod record;
pub(crate) mod state;
pub(crate) mod tapped;
