//! What a rig's file permits and wants: the guard's limits, and the safe state of the drives.

use super::{Rig, file};
use crate::file::values::MaxSpeed;
use crate::guard::{Limits, Standstill, StandstillStep};
use harness_proto::time::Span;

/// The safe state of a rig's file, as far as drives go.
pub(crate) fn standing(wanted: &file::SafeState) -> Standstill {
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

/// What a rig's file and the command line allow together.
pub(crate) fn limits(rig: &Rig, allow_motion: bool) -> Limits {
    let own = &rig.file.limits;
    let motion = own.allow_motion && (allow_motion || rig.is_simulated());
    let speeds = rig.file.drive.iter().filter_map(|drive| drive.max_speed);
    let slowest = speeds
        .chain(own.max_speed.and_then(|most| match most {
            MaxSpeed::Rpm(speed) => Some(speed),
            // Refused in the file of a ring.
            MaxSpeed::Percent(_) => None,
        }))
        .map(|speed| speed.0)
        .reduce(f64::min);
    Limits {
        motion: motion && rig.file.drive.iter().all(|drive| drive.motion),
        eeprom: own.allow_eeprom,
        reset: own.allow_reset,
        outputs: own.allow_outputs,
        monitoring: own.allow_monitoring,
        // Rounded down; what is not a number is not a speed.
        max_speed: slowest.map(|rpm| rpm.clamp(0.0, 65_535.0).floor() as u16),
        bytes_per_second: own.max_bytes_per_second,
        ..Limits::default()
    }
}
