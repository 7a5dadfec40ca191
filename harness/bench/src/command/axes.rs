//! Drives on the command line: `3`, `2:3` in ring 2, `0..2`, `2:0..1`, `all`.

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
