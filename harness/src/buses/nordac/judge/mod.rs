//! How replies of slaves can differ from those of a right one.

mod symptom;

pub use symptom::{Place, Symptom};
