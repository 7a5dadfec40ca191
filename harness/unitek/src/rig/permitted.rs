//! What a rig's file permits.

use harness_bench::file::values::MaxSpeed;
use harness_bench::rig::Rig;
use harness_bench::scenario::problem::nearest;
use harness_proto::unitek::Register;
use harness_proto::unitek::guard::{self, Limits, NAMED};

/// The register of `allow_registers`, one that only a rig's file that names it permits.
///
/// # Errors
/// What is wrong, and what was expected.
pub(crate) fn special_register(text: &str) -> Result<u8, (String, String)> {
    let known = || {
        let names = NAMED.map(|number| format!("0x{number:02X} ({})", Register::of(number).name));
        format!("one of {} expected here", names.join(", "))
    };
    match Register::named(text) {
        Ok(register) if NAMED.contains(&register.number) => Ok(register.number),
        Ok(register) => Err((
            format!(
                "register {:02X} ({}) needs no such permission, or none is enough",
                register.number, register.name
            ),
            known(),
        )),
        Err(_) => {
            let names = NAMED.map(|number| Register::of(number).name);
            let near = nearest(text, &names);
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            Err((format!("there is no register `{text}`{near}"), known()))
        }
    }
}

/// What a rig's file and the command line allow together.
#[must_use]
pub(crate) fn limits(rig: &Rig, allow_motion: bool) -> Limits {
    let own = &rig.file.limits;
    let named = own.port.allow_registers.iter();
    Limits {
        motion: own.allow_motion && (allow_motion || rig.is_simulated()),
        eeprom: own.allow_eeprom,
        bus_settings: own.port.allow_bus_settings,
        way_back: own.port.bit_rate_way_back.is_some(),
        store_bus_settings: own.port.store_bus_settings.is_some(),
        other_identifiers: own.port.allow_other_identifiers,
        max_speed: own.max_speed.map(|most| match most {
            // Rounded down.
            MaxSpeed::Rpm(speed) => {
                guard::HighestSpeed::Rpm(speed.0.clamp(0.0, 65_535.0).floor() as u16)
            }
            MaxSpeed::Percent(percent) => {
                // As a speed command of so many per cent is rounded.
                let raw = (percent * 32_767.0 / 100.0).round();
                guard::HighestSpeed::Raw(raw.clamp(0.0, 32_767.0) as u16)
            }
        }),
        named: named.flat_map(|name| special_register(name)).collect(),
    }
}
