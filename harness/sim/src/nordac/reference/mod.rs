//! Models of inverter and module that share no code with them, to be compared with them.

mod bytes;
pub mod inverter;
pub mod slave;

pub use bytes::OctetList;
pub use inverter::ReferenceInverter;
pub use slave::ReferenceSlave;
