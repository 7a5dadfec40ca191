//! The ND21 behind its bus. So far its memory with the manual's access rules, errors and their
//! confirmation, and the EEPROM controller; nothing turns yet.

mod drive;
mod eeprom_controller;
mod memory;
mod properties;
#[cfg_attr(
    not(test),
    expect(
        dead_code,
        reason = "the drive's cycle, which runs it, comes with the motor"
    )
)]
mod s_ramp;
#[cfg_attr(
    not(test),
    expect(
        dead_code,
        reason = "the drive's cycle, which scans it, comes with the motor"
    )
)]
mod scope;
mod world;

pub use drive::Nd21Drive;
pub use memory::Nd21Memory;
pub use properties::{Nd21Properties, PROPERTIES, TimeProperty};
pub use world::{Mode, Shown, Stimulus};
