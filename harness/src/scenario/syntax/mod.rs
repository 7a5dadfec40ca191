//! A scenario as written, for a bench of any size.

mod scenario;

pub use scenario::*;
