//! The bus's words, as written, for a ring of any size.

pub(crate) mod cell;
pub(crate) mod check;
pub(crate) mod header;
pub(crate) mod job;
