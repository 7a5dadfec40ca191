//! The simulated UNITEK drive: registers, cycles, events and the motor behind them.
//!
//! What the manual says is cited as in [`harness_proto::unitek`]; plant and inputs are our choice.

pub mod cycles;
pub mod deviation;
pub mod drive;
pub mod fuzz;
pub mod inputs;
pub mod outbox;
pub mod plant;
pub mod reference;
mod station;

pub use drive::Drive;
pub use inputs::{Inputs, Stimulus};
pub use outbox::{Cause, Waiting};
pub use plant::Control;

/// A host or a drive.
pub type Member<D> = crate::participant::Participant<crate::segment::Host, D>;

use crate::segment::Segment;

crate::compiled::compiled_here!(
    Segment<Member<Box<deviation::Deviant>>>,
    Segment<Member<Box<Drive>>>
);
