//! Simulated benches, and what the scales of their cells depend on.

use super::driver;
use super::driver::Axis;
use super::driver::OpenRings;
use super::language::parse::header::parse_setup;
use super::language::plan::Plan;
use super::link::SimulatedLink;
use super::simulate;
use harness_bench::scenario::plan::plan;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_proto::nd21::units;

/// Default header of a simulated bench: every drive is released and started by its inputs.
const RELEASED: &str = "drive 0..last input GPIN3 GPIN5 high\n";

/// The default header of a simulated bench of one ring or two.
pub(crate) fn released_header(sizes: &[u8]) -> Source {
    let second = RELEASED.replace("0..last", "2:0..last");
    let text = match sizes {
        [_, _] => format!("{RELEASED}{second}"),
        _ => RELEASED.to_owned(),
    };
    Source {
        name: "the simulated bench".to_owned(),
        text: text.into(),
    }
}

/// Simulated rings with the header that `source` holds, their drives whole ND21 unless it names another model. `sizes` replaces the sizes of
/// its `ring` lines, ring by ring; where neither says any, there is one ring of three.
///
/// # Errors
/// The header has mistakes.
pub(crate) fn simulated(
    source: &Source,
    sizes: Option<&[u8]>,
) -> Result<(Plan, SimulatedLink), Problems> {
    let mut scenario = parse_setup(source, sizes.unwrap_or(&[3]))?;
    for (range, size) in scenario
        .header
        .rings
        .iter_mut()
        .zip(sizes.unwrap_or_default())
    {
        range.default = *size;
    }
    let rings = scenario.header.rings.len();
    scenario.header = scenario.header.nd21_by_default(rings);
    let plan = plan(&scenario, source, None)?;
    let mut link = simulate::bench(&plan);
    link.stop_recording();
    Ok((plan, link))
}

/// The values that the scales of a drive's cells depend on: its type, which the plan knows, and its range of speeds, which is read from the
/// drive (14.3.2).
///
/// # Errors
/// The drive does not answer.
pub(crate) fn units_of(
    plan: &Plan,
    bus: &OpenRings<'_>,
    axis: Axis,
) -> Result<units::DriveUnits, driver::Error> {
    Ok(units::DriveUnits {
        range: bus.speed_range(axis)?,
        ..plan.units(axis.ring(), axis.drive())
    })
}
