//! Simulated buses and drives, in virtual time.
//!
//! A simulated run is a function of the bytes sent, the faults and the drives' cells: two runs give
//! the same bytes at the same times. No code sleeps or polls: a run jumps from event to event.
//!
//! [`novobus`] is the ring with its drives, [`nd21`] the whole drive on it, [`fault`] the faults of a line, and [`record`]
//! the records of a run. [`participant`] is a host or a drive on a shared line. [`segment`] is a CAN bus, and [`unitek`] the UNITEK drive on it;
//! [`octet_segment`] is a line of octets for several masters and slaves, and [`nordac`] the NORDAC inverter with its PROFIBUS module. [`fuzz`] is what
//! the fuzz targets of all buses share, and [`deviation`] the tables of what wrong drives and masters do.
#![forbid(unsafe_code)]

#[cfg(any(feature = "unitek", feature = "nordac"))]
mod compiled;
pub mod deviation;
pub mod fault;
pub mod fuzz;
#[cfg(feature = "novobus")]
pub mod nd21;
#[cfg(feature = "nordac")]
pub mod nordac;
#[cfg(feature = "novobus")]
pub mod novobus;
pub mod octet_segment;
pub mod participant;
pub mod record;
pub mod segment;
#[cfg(feature = "unitek")]
pub mod unitek;
