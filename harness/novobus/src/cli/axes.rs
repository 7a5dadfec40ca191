//! Drives of rings that a command line names.

use crate::driver::Axis;
use harness_bench::command::axes::Axes;
use harness_bench::command::failure::Failure;
use harness_bench::command::port_bench::each_once;

/// The drives of a bus that are meant, each once, in the order in which they are named.
pub(crate) fn select(wanted: &[Axes], bus: &[Axis]) -> Result<Vec<Axis>, Failure> {
    each_once(wanted, |axes| {
        let Axes::Some(ring, drives) = axes else {
            return Ok(bus.to_vec());
        };
        let of_ring = bus.iter().filter(|axis| axis.ring() == *ring);
        let last = of_ring.clone().map(|axis| axis.drive()).max();
        let last = last.ok_or_else(|| format!("the bus has no ring {}", ring + 1))?;
        if *drives.end() > last {
            return Err(format!(
                "there is no drive {} in a ring of {}: 0 to {last} expected (ND21 8.5)",
                drives.end(),
                u16::from(last) + 1
            ));
        }
        let meant = of_ring.filter(|axis| drives.contains(&axis.drive()));
        Ok(meant.copied().collect())
    })
}

/// The only drive that is meant.
pub(crate) fn single(wanted: &Axes, bus: &[Axis]) -> Result<Axis, Failure> {
    match select(std::slice::from_ref(wanted), bus)?[..] {
        [axis] => Ok(axis),
        _ => Err(Failure::refused("one drive expected here, not several")),
    }
}
/// Drives in a sentence: `drive 0`, `drives 0, 2:1`.
pub(crate) fn named(axes: &[Axis]) -> String {
    let names: Vec<_> = axes.iter().map(Axis::to_string).collect();
    let s = if names.len() == 1 { "" } else { "s" };
    format!("drive{s} {}", names.join(", "))
}
