//! Cells that are recorded while a scenario is played.

use super::look::{hex, physical};
use crate::buses::novobus::language::plan::{LOOK, MAX_LOOKS, PlannedLooks, PlannedRecord};
use crate::scenario::run::player::Runner;
use harness_proto::nd21::units::{self, Scale};
use harness_proto::time::{Instant, Span};

/// Maximum number of samples and changes in a run: its records are kept in memory.
pub const MAX_SAMPLES: usize = 1_000_000;

/// What was recorded of a cell of a drive.
#[derive(Clone, Debug)]
pub struct CellRecord {
    /// In which ring, counted from 0.
    pub ring: usize,
    /// Of which drive.
    pub drive: u8,
    /// The cell as the scenario names it.
    pub name: String,
    /// Its address.
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
    /// When.
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

/// The records of a run.
#[derive(Default)]
pub(crate) struct Recorder {
    /// Every record, in order of their beginnings.
    pub(crate) records: Vec<CellRecord>,
    /// The records that go on: which, and when the cell is looked at next.
    running: Vec<(usize, Instant)>,
    samples: usize,
    looks: u64,
}

impl Recorder {
    /// When a cell is looked at next.
    pub(crate) fn next(&self) -> Instant {
        let times = self.running.iter().map(|(_, at)| *at);
        times.fold(Instant::NEVER, Instant::min)
    }

    /// Counts a look at cells.
    pub(crate) fn count_look(&mut self) {
        self.looks += 1;
    }

    /// The message, if there was too much to record.
    pub(crate) fn too_much(&self) -> Option<String> {
        if self.samples > MAX_SAMPLES {
            return Some(format!(
                "more than {MAX_SAMPLES} samples recorded: too long"
            ));
        }
        (self.looks > MAX_LOOKS)
            .then(|| format!("more than {MAX_LOOKS} looks at cells, every {LOOK}: too long"))
    }
}

impl Runner<'_> {
    /// Begins or ends records. A cell has one record at a time.
    pub(crate) fn record(&mut self, record: &PlannedRecord) {
        for drive in record.drives.clone() {
            let recorder = &mut self.own.recorder;
            recorder.running.retain(|(index, _)| {
                let other = &recorder.records[*index];
                (other.ring, other.drive, other.address) != (record.ring, drive, record.address)
            });
            let every = match record.looks {
                PlannedLooks::Off => continue,
                PlannedLooks::Every(every) => Some(every),
                PlannedLooks::Changes => None,
            };
            recorder
                .running
                .push((recorder.records.len(), self.link.now()));
            recorder.records.push(CellRecord {
                ring: record.ring,
                drive,
                name: record.name.clone(),
                address: record.address,
                size: record.size,
                scale: record.scale,
                units: self.plan.units(record.ring, drive),
                every,
                samples: Vec::new(),
            });
        }
        self.note();
    }

    /// Samples the cells that are due.
    pub(crate) fn note(&mut self) {
        let now = self.link.now();
        if self.own.recorder.next() > now {
            return;
        }
        self.own.recorder.count_look();
        for place in 0..self.own.recorder.running.len() {
            let (index, at) = self.own.recorder.running[place];
            if at > now {
                continue;
            }
            let record = &self.own.recorder.records[index];
            let step = record.every.unwrap_or(LOOK);
            let found = self.bytes(record.ring, record.drive, record.address, record.size);
            let next = at + step;
            self.own.recorder.running[place].1 = if next > now { next } else { now + step };
            // A cell that the link does not show gets no sample.
            let Some(found) = found else { continue };
            let sample = Sample::new(now, &found);
            let record = &mut self.own.recorder.records[index];
            let same = record
                .samples
                .last()
                .is_some_and(|last| last.bytes() == sample.bytes());
            if record.every.is_some() || !same {
                record.samples.push(sample);
                self.own.recorder.samples += 1;
            }
        }
    }
}
