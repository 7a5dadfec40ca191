//! How telegrams of PROFIBUS read: a row a telegram, JSON, CSV, a picture.

pub mod csv;
pub(crate) mod curves;
pub mod diff;
pub mod json;
pub mod pcapng;
pub(crate) mod sequence;
pub mod table;
mod telegrams;
mod words;

pub use telegrams::{Said, said};
pub use words::{ProcessImage, Reader};
