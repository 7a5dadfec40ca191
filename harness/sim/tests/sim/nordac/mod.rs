//! The NORDAC inverter and its PROFIBUS module on a shared line: printed telegrams, tables, and properties.

mod against_reference;
mod bodies;
mod common;
mod deviations;
mod exchange;
mod line;
mod profirust;
mod slave;
