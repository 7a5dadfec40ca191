//! A scenario as written, for a bench of any size.

pub mod scenario;

pub use scenario::*;
