//! What a rig's file and the command line permit on rings.

use harness_bench::file::values::MaxSpeed;
use harness_bench::rig::Rig;
use harness_proto::novobus::guard::Limits;

/// What a rig's file and the command line allow together.
pub(crate) fn limits(rig: &Rig, allow_motion: bool) -> Limits {
    let allowed = &rig.file.limits;
    let motion = allowed.allow_motion && (allow_motion || rig.is_simulated());
    let speeds = rig.file.drive.iter().filter_map(|drive| drive.max_speed);
    let slowest = speeds
        .chain(allowed.max_speed.and_then(|most| match most {
            MaxSpeed::Rpm(speed) => Some(speed),
            // Refused in the file of a ring.
            MaxSpeed::Percent(_) => None,
        }))
        .map(|speed| speed.0)
        .reduce(f64::min);
    Limits {
        motion: motion && rig.file.drive.iter().all(|drive| drive.motion),
        eeprom: allowed.allow_eeprom,
        reset: allowed.allow_reset,
        outputs: allowed.allow_outputs,
        monitoring: allowed.allow_monitoring,
        // Rounded down; what is not a number is not a speed.
        max_speed: slowest.map(|rpm| rpm.clamp(0.0, 65_535.0).floor() as u16),
        bytes_per_second: allowed.max_bytes_per_second,
        ..Limits::default()
    }
}

#[cfg(test)]
mod tests {
    use super::limits;
    use crate::rig::parse;
    use harness_bench::scenario::source::Source;

    /// The guard judges bytes to all drives alike: by the lowest speed of the file, and without motion if one motor must not turn.
    #[test]
    fn the_strictest_drive_counts_for_all() {
        let permitted = |drive: &str, allow_motion: bool| {
            let text = format!(
                "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 3\ntransport = \"tcp\"\nport = \"127.0.0.1:1\"\nmarks = \"in-band\"\n\
                 [limits]\nallow_motion = true\nmax_speed = \"300rpm\"\n[[drive]]\naddress = 0\nmax_speed = \"250rpm\"\n\
                 [[drive]]\naddress = 2\n{drive}\n"
            );
            let source = Source {
                name: "desk.toml".to_owned(),
                text: text.into(),
            };
            let limits = limits(&parse(&source).expect("a rig"), allow_motion);
            (limits.motion, limits.max_speed)
        };
        for (drive, allow_motion, expected) in [
            ("", true, (true, Some(250))),
            ("max_speed = \"199.9rpm\"", true, (true, Some(199))),
            ("max_speed = \"301rpm\"", true, (true, Some(250))),
            ("", false, (false, Some(250))),
            ("motion = false", true, (false, Some(250))),
        ] {
            assert_eq!(permitted(drive, allow_motion), expected, "{drive}");
        }
    }
}
