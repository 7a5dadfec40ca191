//! The Novotron ND21: what its cells are, in which units, and its error codes.
//!
//! The high byte of a word stands at the lower address (the drive's H8 is big-endian). [`cells`] and
//! [`eeprom`] are the manual's tables 14.2.1 and 14.2.2, [`ram`] and [`ee`] their addresses by name, [`bits`]
//! the bits of the status and configuration bytes.

pub mod bits;
pub mod cells;
pub mod eeprom;
pub mod errors;
pub mod functions;
pub mod io;
pub mod own;
pub mod position;
pub mod s_ramp;
mod state;
pub mod units;

pub use cells::ram;
pub use eeprom::ee;
pub use state::State;

/// What is written to `errorcode` to confirm an error (ND21 14.10.1).
pub const CONFIRM_ERROR: u8 = 0xAF;

/// The first parameter cell; FF60-FF7F are loaded from EEPROM 20-3F at reset (ND21 14.2.1, 14.2.2).
pub const PARAMETERS: u16 = 0xFF60;
/// The EEPROM address of the first parameter.
pub const EE_PARAMETERS: u8 = 0x20;
/// How many parameters there are.
pub const PARAMETER_COUNT: u16 = 0x20;
