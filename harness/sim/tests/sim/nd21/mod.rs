//! The ND21 behind its bus: what it does of its own, held against calculation by hand.

mod any_operations;
mod common;
mod cycle_control;
mod motion;
mod positioning;
mod recording;
mod s_ramp;
