//! How drives of any bus are brought to a standstill.

use harness_proto::time::Span;

/// A step that brings all drives of a bus to a standstill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandstillStep {
    /// Stop on the ramp.
    Stop,
    /// Block: no torque, with a nominal speed of 0.
    Block,
}

/// How drives are taken to their safe state, and when they count as standing.
#[derive(Clone, Debug, PartialEq)]
pub struct Standstill {
    /// The steps, in this order.
    pub order: Vec<StandstillStep>,
    /// The speed below which a motor counts as standing, in rpm.
    pub rpm: f64,
    /// How long a drive may take to stop.
    pub within: Span,
}

impl Default for Standstill {
    fn default() -> Self {
        Self {
            order: vec![StandstillStep::Stop, StandstillStep::Block],
            rpm: 5.0,
            within: Span::from_millis(5_000),
        }
    }
}
