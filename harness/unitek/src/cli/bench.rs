//! What the scales of a drive depend on.

use crate::driver::{Driver, Error};
use crate::rig::Axis;
use harness_proto::unitek::units::Scaling;

/// What the scales of a drive depend on: the rpm of 100 %, the device's current and the current's scale (App 7).
pub(super) fn scaling(driver: &mut Driver<'_>, axis: Axis) -> Result<Scaling, Error> {
    let mut read = |register| {
        let reply = driver.read(axis, register)?;
        Ok::<_, Error>((reply.data.bits() & 0xFFFF) as u16)
    };
    Ok(Scaling {
        rpm_max: read(0xCE)?,
        device_current: read(0xC6)?,
        units_at_200: read(0xD9)?,
    })
}
