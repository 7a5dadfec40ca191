//! The buses that drivebench speaks, byte by byte.
//!
//! This crate holds rules and no machinery: nothing in it learns the time, draws a random number,
//! blocks or prints. Bytes and time are arguments; bytes and deadlines are return values. Each rule
//! stands in one place with the section of the manual that it obeys ("ND21 9.6" is section 9.6 of the
//! *ND21 User Manual 1/96*).
//!
//! * [`time`]: virtual time, exact for every rate of every line; [`decode`]: what a decoder answers;
//! * [`counted`]: numbers with their nouns;
//! * [`can`]: frames of a CAN bus, their length on the wire, bit rates;
//! * [`line`](mod@line): an asynchronous serial line: its rate, and what a receiver reads from it;
//! * [`marks`]: how a stream of bytes carries line errors;
//! * [`novobus`]: the ring of the Novotron ND21;
//! * [`nd21`]: the cells of that drive that its bus end itself needs;
//! * [`unitek`]: registers of UNITEK drives over CAN frames;
//! * [`profibus`]: telegrams and services of PROFIBUS DP;
//! * [`nordac`]: NORDAC *vector* inverters on PROFIBUS DP.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;
#[cfg(test)]
extern crate std;

pub mod can;
pub mod counted;
pub mod decode;
pub mod limit;
pub mod line;
pub mod marks;
#[cfg(feature = "novobus")]
pub mod nd21;
#[cfg(feature = "nordac")]
pub mod nordac;
#[cfg(feature = "novobus")]
pub mod novobus;
#[cfg(any(feature = "unitek", feature = "nordac"))]
mod open_words;
#[cfg(feature = "nordac")]
pub mod profibus;
pub mod ratio;
pub mod time;
#[cfg(feature = "unitek")]
pub mod unitek;
