//! What a rig's file permits.

use crate::value::register;
use harness_bench::file::values::MaxSpeed;
use harness_bench::rig::Rig;
use harness_bench::rig::buses::RegisterMistake;
use harness_bench::rig::port_file::{PortLimits, RegisterRange};
use harness_bench::scenario::problem::nearest;
use harness_proto::unitek::Register;
use harness_proto::unitek::guard::{self, Limits, NAMED, ValueRange};

/// What is wrong with the registers that `[limits]` name.
pub(super) fn register_mistakes(limits: &PortLimits) -> Vec<RegisterMistake> {
    let special = limits.allow_registers.iter().enumerate();
    let special =
        special.map(|(index, name)| ("allow_registers", index, special_register(name).err()));
    let ranges = limits.ranges.iter().enumerate();
    let ranges = ranges.map(|(index, range)| ("ranges", index, value_range(range).err()));
    let mistakes = special.chain(ranges).filter_map(|(key, index, mistake)| {
        let (message, expected) = mistake?;
        Some(RegisterMistake {
            key,
            index,
            message,
            expected,
        })
    });
    mistakes.collect()
}

/// The values that a rig's file permits in a register.
///
/// # Errors
/// What is wrong, and what was expected.
fn value_range(range: &RegisterRange) -> Result<ValueRange, (String, String)> {
    let register = register(&range.register).map_err(|message| {
        let expected = "a register of `drivebench cells --bus unitek` expected here";
        (message, expected.to_owned())
    })?;
    let whole = ValueRange::whole(register);
    let (least, most) = (
        range.min.unwrap_or(whole.least),
        range.max.unwrap_or(whole.most),
    );
    let room = format!("{} to {}", whole.least, whole.most);
    match least <= most && whole.least <= least && most <= whole.most {
        true if register.access.holds_writes() => Ok(ValueRange {
            least,
            most,
            ..whole
        }),
        true => Err((
            format!(
                "register {:02X} ({}) holds nothing that is written to it",
                register.number, register.name
            ),
            "a register of type RW or SP expected here".to_owned(),
        )),
        false => Err((
            format!(
                "register {:02X} ({}) has no values from {least} to {most}",
                register.number, register.name
            ),
            format!("`min` and `max` within {room} expected here, the smaller one first"),
        )),
    }
}

/// The register of `allow_registers`, one that only a rig's file that names it permits.
///
/// # Errors
/// What is wrong, and what was expected.
fn special_register(text: &str) -> Result<u8, (String, String)> {
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
    let granted = &rig.file.limits;
    let named = granted.port.allow_registers.iter();
    Limits {
        motion: granted.allow_motion && (allow_motion || rig.is_simulated()),
        eeprom: granted.allow_eeprom,
        bus_settings: granted.port.allow_bus_settings,
        way_back: granted.port.bit_rate_way_back.is_some(),
        store_bus_settings: granted.port.store_bus_settings.is_some(),
        other_identifiers: granted.port.allow_other_identifiers,
        max_speed: granted.max_speed.map(|most| match most {
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
        ranges: granted.port.ranges.iter().flat_map(value_range).collect(),
    }
}
