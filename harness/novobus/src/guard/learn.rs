//! What a guard has to know of drives, read from them.

use crate::driver::{Axis, Error, OpenRings, Options, Width};
use crate::gate::GuardsRings as _;
use harness_bench::guard::Guarded;
use harness_bench::link::Line;
use harness_proto::nd21::{ee, ram};
use harness_proto::novobus::guard::{Configuration, Found};
use harness_proto::time::Span;

/// How long a drive may take to answer.
const PATIENCE: Span = Span::from_millis(2_000);

/// The cells that determine the speed at which a drive would turn.
const CELLS: [(u16, Width); 9] = [
    (ram::HW_VERSION, Width::Word),
    (ram::SW_VERSION, Width::Word),
    (ram::NSOLL, Width::Word),
    (ram::PS_V0, Width::Word),
    (ram::REF_V1, Width::Word),
    (ram::REF_V2, Width::Word),
    (ram::PS_STATUS, Width::Byte),
    (ram::FLAGS2, Width::Byte),
    (ram::DATA_IN, Width::Byte),
];

/// Reads from every drive at which speeds it would turn, so that the guard can hold it to `max_speed`: the range of speeds,
/// `nsoll` and its source, the speeds of positioning and referencing, `DataIn`; where resets are allowed, also the
/// configuration in the EEPROM. Without a `max_speed` it is `DataIn` alone, and nothing where everything is allowed or where motors
/// must not turn: process data need that they may.
///
/// A drive that does not answer is not known: what could make it turn is denied.
///
/// # Errors
/// See [`Error`]: the first drive that did not answer.
pub(crate) fn learn<L: Line>(line: &mut Guarded<L>) -> Result<(), Error> {
    let limits = line.limits();
    if !limits.motion || limits.allow_everything() {
        return Ok(());
    }
    let sizes = line.sizes();
    let (found, data_in) = {
        let options = Options {
            patience: PATIENCE,
            ..Options::default()
        };
        let bus = OpenRings::open(Box::new(&mut *line), &sizes, options)?;
        let found = match limits.max_speed {
            Some(_) => read(&bus, limits.reset).map(|found| (found, Vec::new())),
            None => read_data_in(&bus).map(|data_in| (Vec::new(), data_in)),
        };
        bus.close();
        found?
    };
    for (axis, found) in found {
        line.learn_of(axis, |guard, address| guard.learn(address, &found));
    }
    for (axis, data_in) in data_in {
        line.learn_of(axis, |guard, address| {
            guard.learn_data_in(address, data_in);
        });
    }
    Ok(())
}

fn read_data_in(bus: &OpenRings<'_>) -> Result<Vec<(Axis, u8)>, Error> {
    let axes = bus.axes();
    let cells = axes.iter().map(|axis| (*axis, ram::DATA_IN, Width::Byte));
    let words = bus.read_many(cells)?;
    let bytes = words.into_iter().map(|word| word.to_be_bytes()[1]);
    Ok(axes.into_iter().zip(bytes).collect())
}

fn read(bus: &OpenRings<'_>, resets: bool) -> Result<Vec<(Axis, Found)>, Error> {
    let axes = bus.axes();
    let cells = axes
        .iter()
        .flat_map(|axis| CELLS.map(|(address, width)| (*axis, address, width)));
    let words = bus.read_many(cells)?;
    let stored = match resets {
        true => Some([
            bus.read_eeprom_of(&axes, ee::RAM)?,
            bus.read_eeprom_of(&axes, ee::RAM + 2)?,
            bus.read_eeprom_of(&axes, ee::RAM + 3)?,
        ]),
        false => None,
    };
    let drives = axes.iter().zip(words.chunks_exact(CELLS.len())).enumerate();
    let found = drives.filter_map(|(index, (axis, words))| {
        let &[
            hardware,
            software,
            nsoll,
            ps_v0,
            ref_v1,
            ref_v2,
            status,
            flags2,
            data_in,
        ] = words
        else {
            return None;
        };
        let high = |word: u16| word.to_be_bytes()[0];
        let low = |word: u16| word.to_be_bytes()[1];
        let stored = stored.as_ref().and_then(|[hardware, first, second]| {
            Some(Configuration {
                hw_version: *hardware.get(index)?,
                sw_version: *first.get(index)?,
                sw_version2: *second.get(index)?,
            })
        });
        let found = Found {
            configuration: Configuration {
                hw_version: high(hardware),
                sw_version: high(software),
                sw_version2: low(software),
            },
            nsoll,
            ps_v0,
            ref_speeds: [ref_v1, ref_v2],
            ps_status: low(status),
            flags2: low(flags2),
            data_in: low(data_in),
            stored,
        };
        Some((*axis, found))
    });
    Ok(found.collect())
}
