//! Signals of the oscilloscope: cells FFxx, of which one byte is recorded (ND21 14.10.6.1).

use crate::language::argument::{MemoryKind, MemoryRange, cells, value_at};
use harness_bench::command::failure::Failure;
use harness_bench::scenario::problem::Problems;
use harness_proto::nd21::units::{DriveUnits, trigger_level_to_raw};

/// The cells of which one can be selected.
const PAGE: u8 = 0xFF;

/// A cell that can be recorded.
pub(crate) struct Signal {
    pub(crate) location: MemoryRange,
    /// The low byte of its address.
    pub(crate) selector: u8,
}

impl Signal {
    /// A signal as written.
    pub(crate) fn new(text: &str) -> Result<Self, Failure> {
        let mut cells = cells(&[text.to_owned()])?;
        let signal = cells.pop().and_then(|location| {
            let [page, selector] = location.address().to_be_bytes();
            let fits = location.memory == MemoryKind::Ram && page == PAGE;
            fits.then_some(Self { location, selector })
        });
        signal.ok_or_else(|| {
            Failure::refused(format!(
                "`{text}` is not a signal of the oscilloscope: a cell FF00 to FFFF expected (ND21 14.10.6.1)"
            ))
        })
    }

    /// The bytes of the cell that a recorded one stands for: it is the highest.
    pub(crate) fn bytes(&self, recorded: u8) -> Vec<u8> {
        let mut bytes = vec![0; usize::from(self.location.size)];
        if let Some(first) = bytes.first_mut() {
            *first = recorded;
        }
        bytes
    }

    /// `scope_level` for a value of this signal (14.10.6.3).
    pub(crate) fn level(&self, text: &str, units: DriveUnits) -> Result<u8, Failure> {
        let value = value_at(text, 0, &self.location);
        let bytes = value.and_then(|value| self.location.bytes(&value, units));
        match bytes {
            Ok(bytes) => {
                let byte = bytes.first().copied().unwrap_or(0);
                Ok(trigger_level_to_raw(byte.cast_signed()))
            }
            Err(problem) => Err(Problems::new("--level", text.into(), vec![problem]).into()),
        }
    }
}
