//! What a rig's file permits.

use harness_bench::rig::Rig;
use harness_proto::nordac::guard::{Highest, Limits};
use harness_proto::nordac::words::FULL;

/// What a rig's file and the command line allow together.
#[must_use]
pub(crate) fn limits(rig: &Rig, allow_motion: bool) -> Limits {
    let granted = &rig.file.limits;
    let more = &granted.port;
    // Rounded down.
    let setpoint = more.max_setpoint.map(|most| {
        let raw = (most.0 * f64::from(FULL) / 100.0).floor();
        Highest::Setpoint(raw.clamp(0.0, 32_767.0) as u16)
    });
    let frequency = more.max_frequency.map(|most| {
        let tenths = (most.0 * 10.0).floor();
        Highest::Frequency(tenths.clamp(0.0, 9_990.0) as u16)
    });
    Limits {
        motion: granted.allow_motion && (allow_motion || rig.is_simulated()),
        eeprom: granted.allow_eeprom,
        motor_data: more.allow_motor_data,
        bus_settings: more.allow_bus_settings,
        other_stations: more.allow_other_stations,
        unsupervised: more.allow_unsupervised,
        highest: setpoint.or(frequency),
        most_writes: more.max_eeprom_writes,
    }
}
