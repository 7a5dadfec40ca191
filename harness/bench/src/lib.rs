//! The engine of drivebench: links, ports, rigs, scenarios, captures, pages, and what the commands of all buses share. It knows no bus.
#![forbid(unsafe_code)]
#![expect(missing_docs, reason = "only the crates of this workspace use it")]

pub use harness_proto::counted;

pub mod bus;
pub mod bus_name;
pub mod campaign;
pub mod capture;
pub mod command;
pub mod embed;
pub mod evidence;
pub mod explore;
pub mod file;
pub mod frames;
pub mod fuzz;
pub mod guard;
pub mod html;
pub mod link;
pub mod listen;
pub mod manual;
pub mod medium;
pub mod partition;
pub mod port;
pub mod qualify;
pub mod regular;
pub mod report;
pub mod rig;
pub mod scenario;
pub mod serve;
pub mod shown;
pub mod signals;
pub mod top;
pub mod traffic;
pub mod trouble;
pub mod web;
