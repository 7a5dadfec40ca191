//! The safe state that a rig's file wants.

use super::file;
use crate::guard::{Standstill, StandstillStep};
use harness_proto::time::Span;

/// The safe state of a rig's file, as far as drives go.
pub fn standing(wanted: &file::SafeState) -> Standstill {
    let step = |step: &file::SafeStep| match step {
        file::SafeStep::Stop => Some(StandstillStep::Stop),
        file::SafeStep::Block => Some(StandstillStep::Block),
        file::SafeStep::PowerOff => None,
    };
    Standstill {
        order: wanted.order.iter().filter_map(step).collect(),
        rpm: wanted.speed_tolerance.0,
        within: Span::from_nanos(u64::try_from(wanted.within.0.as_nanos()).unwrap_or(u64::MAX)),
    }
}
