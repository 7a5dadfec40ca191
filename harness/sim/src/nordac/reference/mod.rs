//! Models of the drive that share no code with it, to be compared with it.

pub mod inverter;

pub use inverter::ReferenceInverter;
