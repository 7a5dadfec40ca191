//! The bus's words, read.

pub(crate) mod check;
pub(crate) mod drive;
pub(crate) mod header;
pub(crate) mod job;
pub(crate) mod master;
pub(crate) mod step;
pub(crate) mod value;
pub(crate) mod words;
