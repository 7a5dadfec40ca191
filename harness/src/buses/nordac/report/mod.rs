//! How telegrams of PROFIBUS read: a row a telegram, JSON, CSV, a capture, a picture.

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
pub(super) use telegrams::{TelegramRun, octets, runs};
pub(super) use words::{CONTROL, PRM};
pub use words::{ProcessImage, Reader};
