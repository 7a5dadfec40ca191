//! What a served drive shows beside the bus, for a line of control.

use crate::language::argument::{MemoryKind, MemoryRange};
use crate::link::BesideTheBus;
use harness_bench::link::Link;
use harness_sim::nd21::{Mode, OutputLevels};

/// The state of a drive: what these cells of its memory hold, in hexadecimal digits, or without cells its error on the bus and what it
/// shows outside.
///
/// # Errors
/// A cell is in the EEPROM, or the link shows no memory; in a sentence.
pub(crate) fn state_of(
    link: &dyn Link,
    ring: usize,
    drive: u8,
    cells: &[MemoryRange],
) -> Result<String, String> {
    let mut found = Vec::new();
    for location in cells {
        if location.memory == MemoryKind::Eeprom {
            let name = location.name();
            return Err(format!(
                "`{name}` is in the EEPROM; a cell of the memory expected"
            ));
        }
        let bytes: Option<String> = (location.address()..=u16::MAX)
            .take(usize::from(location.size))
            .map(|address| link.peek(ring, drive, address))
            .map(|byte| byte.map(|byte| format!("{byte:02X}")))
            .collect();
        let bytes = bytes.ok_or("the drive's memory cannot be seen")?;
        found.push(format!("{}={bytes}", location.name()));
    }
    if cells.is_empty() {
        let bus = match link.error_of(ring, drive).flatten() {
            Some(error) => format!("{:04X}", error.code()),
            None => "normal".to_owned(),
        };
        found.push(format!("bus={bus}"));
        found.extend(link.shown(ring, drive).map(|shown| outside(&shown)));
    }
    Ok(found.join(" "))
}

/// What stands outside the bus (ND21 5.3, 11.8): the analogue output in mV.
fn outside(shown: &OutputLevels) -> String {
    let level = |high| if high { "high" } else { "low" };
    let contact = if shown.ready { "closed" } else { "open" };
    let mode = Mode::NAMES.iter().find(|(_, mode)| *mode == shown.mode);
    let mode = mode.map_or("", |(name, _)| name);
    let digits = |digits: [u8; 3]| digits.iter().map(|digit| format!("{digit:X}")).collect();
    let display: String = shown.display.map_or("blank".to_owned(), digits);
    format!(
        "mode={mode} GPO1={} GPO2={} ready={contact} analogue-output={} encoder={} display={display}",
        level(shown.gpo1),
        level(shown.gpo2),
        shown.analogue,
        shown.encoder,
    )
}
