//! NORDAC *vector* on PROFIBUS DP: process words, parameter channel, parameters.
//!
//! The document is the manual *PROFIBUS DP for NORDAC vector and vector mc* (Getriebebau NORD). "NORDAC 3.4.1" is its section 3.4.1; "E12" is
//! entry 12 of the ledger of its errata. The *vector* is meant; what is true of the *mc* only is not here.
//!
//! * [`ppo`]: the four layouts of the process data; [`words`]: control word, status word, states; [`pkw`]: the parameter channel;
//! * [`parameter`] and [`PARAMETERS`]: the 172 parameters; [`units`]: seconds, hertz, ampere and raw numbers;
//! * [`properties`]: what the manual leaves open;
//! * [`guard`]: what a telegram may do to a physical inverter;
//! * [`master`]: one inverter as its master sees it.

pub mod guard;
pub mod master;
pub mod parameter;
pub mod pkw;
pub mod ppo;
pub mod properties;
mod table;
pub mod units;
pub mod words;

pub use parameter::{Parameter, ParameterRef};
pub use pkw::{Answer, Pkw, PkwError, Task};
pub use ppo::{Image, PpoType};
pub use properties::Properties;
pub use table::PARAMETERS;

/// The ident number of the module (GSD).
pub const IDENT: u16 = 0x7531;
/// The address as delivered, and after the factory settings (NORDAC 2.5.1).
pub const DEFAULT_ADDRESS: u8 = 126;

#[cfg(test)]
mod tests;
