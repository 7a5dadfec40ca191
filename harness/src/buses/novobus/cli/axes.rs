//! Drives on the command line: `3`, `2:3` in ring 2, `0..2`, `2:0..1`, `all`.

use crate::buses::novobus::driver::Axis;
use crate::command::failure::Failure;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// One drive, some in a row, or all of the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Axes {
    /// From one to another in a ring, counted from 0.
    Some(usize, RangeInclusive<u8>),
    /// Every drive of every ring.
    All,
}

impl FromStr for Axes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is not a drive: a number (3, or 2:3 in the second ring), a range (0..2) or `all` expected"
            )
        };
        if text == "all" {
            return Ok(Self::All);
        }
        let (ring, drives) = match text.split_once(':') {
            Some(("1", drives)) => (0, drives),
            Some(("2", drives)) => (1, drives),
            Some(_) => return Err(wrong()),
            None => (0, text),
        };
        let number = |text: &str| match text.parse::<u8>() {
            Ok(drive) if text.starts_with(|c: char| c.is_ascii_digit()) => Ok(drive),
            _ => Err(wrong()),
        };
        let (first, last) = drives.split_once("..").unwrap_or((drives, drives));
        let (first, last) = (number(first)?, number(last)?);
        if last < first {
            return Err(format!("the range {text} ends before it begins"));
        }
        Ok(Self::Some(ring, first..=last))
    }
}

/// The drives of a bus that are meant, each once, in the order in which they are named.
pub(crate) fn select(wanted: &[Axes], bus: &[Axis]) -> Result<Vec<Axis>, Failure> {
    let mut selected: Vec<Axis> = Vec::new();
    for axes in wanted {
        let found: Vec<Axis> = match axes {
            Axes::All => bus.to_vec(),
            Axes::Some(ring, drives) => {
                let of_ring = bus.iter().filter(|axis| axis.ring() == *ring);
                let last = of_ring.clone().map(|axis| axis.drive()).max();
                let Some(last) = last else {
                    return Err(Failure::refused(format!(
                        "the bus has no ring {}",
                        ring + 1
                    )));
                };
                if *drives.end() > last {
                    return Err(Failure::refused(format!(
                        "there is no drive {} in a ring of {}: 0 to {last} expected (ND21 8.5)",
                        drives.end(),
                        u16::from(last) + 1
                    )));
                }
                of_ring
                    .filter(|axis| drives.contains(&axis.drive()))
                    .copied()
                    .collect()
            }
        };
        for axis in found {
            if !selected.contains(&axis) {
                selected.push(axis);
            }
        }
    }
    Ok(selected)
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
