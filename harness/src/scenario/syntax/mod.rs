//! A scenario as written, for a bench of any size.

mod scenario;

pub use crate::buses::Bus;
pub use scenario::*;
