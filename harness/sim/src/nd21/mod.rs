//! The ND21 behind its bus.
//!
//! [`Program`] is the drive's program; every 432 us it runs one cycle, module by module: `world` and `monitor`
//! (inputs and error detection), `cycle_control`
//! (orders of a PLC), `referencing`, `positioning`, `s_ramp`
//! and `source` (nominal values), `motion` and `plant` (regulators and motor), `outputs` and `clock` (outputs
//! and counters); `scope` samples every 108 us. The modules
//! communicate through the drive's own cells, as the parts of the firmware do, so that a bus master sees every step.
//!
//! Not modelled, because the bus shows no effect that the manual describes: `HwVersion2` bits 0, 2 and
//! 3 (to be 1, 14.3.4) and bit 5 (5 kHz); `SwVersion` bit 2 (frequency converter) and bit 4 (error 701 comes from
//! a scenario only, 14.3.1); a current limit that falls with the temperature; the analogue input has no
//! offset, so that its calibration every second leaves `VCOoffset` as it is (14.7.2).

mod clock;
mod cycle_control;
mod drive;
mod eeprom_controller;
mod error_state;
pub mod factory;
mod invariants;
mod memory_rules;
mod monitor;
mod motion;
mod outputs;
mod plant;
mod positioning;
mod program;
mod properties;
mod referencing;
mod s_ramp;
mod scope;
mod source;
mod wave;
mod world;

pub use drive::Nd21Drive;
pub use eeprom_controller::set_parity;
pub use plant::PlantParameters;
pub use program::Program;
pub use properties::{BusErrors, Nd21Properties, PROPERTIES, Property, PsPosition};
pub use s_ramp::SRampWire;
pub use world::{Mode, OutputLevels, Stimulus};
