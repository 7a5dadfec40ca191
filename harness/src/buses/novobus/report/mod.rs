//! How the ring's bytes read, and its tables and pictures: a column a drive.

pub mod csv;
pub(crate) mod diagram;
pub mod json;
pub mod meaning;
pub(crate) mod sequence;
pub mod svg;
pub mod table;
pub mod walk;
