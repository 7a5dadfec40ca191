//! Cells that were recorded while a scenario was played.

use harness_proto::nd21::units::{self, Scale, Value};
use harness_proto::time::{Instant, Span};

/// Maximum number of samples and changes in a run: its records are kept in memory.
pub const MAX_SAMPLES: usize = 1_000_000;

/// What was recorded of a cell of a drive.
#[derive(Clone, Debug)]
pub struct CellRecord {
    /// In which ring, counted from 0.
    pub ring: usize,
    pub drive: u8,
    /// The cell as the scenario names it.
    pub name: String,
    pub address: u16,
    /// How many bytes.
    pub size: usize,
    /// The scale of its bytes, if the manual gives one.
    pub scale: Option<Scale>,
    /// What that scale depends on.
    pub units: units::DriveUnits,
    /// How often it was noted; `None` where its changes were.
    pub every: Option<Span>,
    /// What was found, in order of time.
    pub samples: Vec<Sample>,
}

/// What a cell held at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    pub at: Instant,
    bytes: [u8; 4],
    size: u8,
}

impl Sample {
    /// The first four of these bytes at a time; no record has more.
    #[must_use]
    pub fn new(at: Instant, found: &[u8]) -> Self {
        let mut bytes = [0; 4];
        for (byte, found) in bytes.iter_mut().zip(found) {
            *byte = *found;
        }
        let size = u8::try_from(found.len().min(bytes.len())).unwrap_or(0);
        Self { at, bytes, size }
    }

    /// The bytes, in the order of their addresses.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.size)]
    }
}

impl CellRecord {
    /// The unit of the values; empty where they are plain numbers.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.scale.map_or("", Scale::unit)
    }

    /// What a sample is in [`Self::unit`]; without a scale the bytes as a number without a sign. `None`
    /// where the manual gives the bytes no meaning.
    #[must_use]
    pub fn value(&self, sample: &Sample) -> Option<f64> {
        let bytes = sample.bytes();
        match self.scale {
            Some(scale) => physical(scale, bytes, self.units),
            None => {
                let number = bytes.iter().fold(0, |n, byte| n << 8 | u32::from(*byte));
                Some(f64::from(number))
            }
        }
    }

    /// The bytes of a sample as written: `0652`.
    #[must_use]
    pub fn raw(sample: &Sample) -> String {
        hex(sample.bytes())
    }
}

/// The number that the bytes of a cell are; `None` where they are none.
pub fn physical(scale: Scale, bytes: &[u8], units: units::DriveUnits) -> Option<f64> {
    match scale.value(bytes, units)?.ok()? {
        Value::Exact(ratio) => Some(ratio.to_f64()),
        Value::Approximate(value) => Some(value),
        Value::Off | Value::Date(_) => None,
    }
}

/// Bytes as written: `0652`.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// The bytes of hexadecimal digits in pairs; `None` for any other text.
pub fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digit = |digit: u8| char::from(digit).to_digit(16);
    let byte = |[high, low]: &[u8; 2]| u8::try_from(digit(*high)? << 4 | digit(*low)?).ok();
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    let bytes = pairs.iter().map(byte).collect::<Option<_>>();
    bytes.filter(|_| rest.is_empty())
}
