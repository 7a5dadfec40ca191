//! Records cells while a scenario is played.

use super::Runner;
use crate::language::plan::{LOOK, MAX_LOOKS, PlannedLooks, PlannedRecord};
use harness_bench::scenario::run::record::{CellRecord, MAX_SAMPLES, Sample};
use harness_proto::time::Instant;

/// The records of a run.
#[derive(Default)]
pub(crate) struct CellRecorder {
    /// Every record, in order of their beginnings.
    pub(crate) records: Vec<CellRecord>,
    /// The records that go on: which, and when the cell is looked at next.
    running: Vec<(usize, Instant)>,
    samples: usize,
    looks: u64,
}

impl CellRecorder {
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

/// Begins or ends records. A cell has one record at a time.
pub(crate) fn record(runner: &mut Runner<'_>, record: &PlannedRecord) {
    for drive in record.drives.clone() {
        let recorder = &mut runner.own.recorder;
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
            .push((recorder.records.len(), runner.link.now()));
        recorder.records.push(CellRecord {
            ring: record.ring,
            drive,
            name: record.name.clone(),
            address: record.address,
            size: record.size,
            scale: record.scale,
            units: runner.plan.units(record.ring, drive),
            every,
            samples: Vec::new(),
        });
    }
    note(runner);
}

/// Samples the cells that are due.
pub(crate) fn note(runner: &mut Runner<'_>) {
    let now = runner.link.now();
    if runner.own.recorder.next() > now {
        return;
    }
    runner.own.recorder.count_look();
    for place in 0..runner.own.recorder.running.len() {
        let (index, at) = runner.own.recorder.running[place];
        if at > now {
            continue;
        }
        let record = &runner.own.recorder.records[index];
        let step = record.every.unwrap_or(LOOK);
        let found = super::look::bytes(
            runner,
            record.ring,
            record.drive,
            record.address,
            record.size,
        );
        let next = at + step;
        runner.own.recorder.running[place].1 = if next > now { next } else { now + step };
        // A cell that the link does not show gets no sample.
        let Some(found) = found else { continue };
        let sample = Sample::new(now, &found);
        let record = &mut runner.own.recorder.records[index];
        let same = record
            .samples
            .last()
            .is_some_and(|last| last.bytes() == sample.bytes());
        if record.every.is_some() || !same {
            record.samples.push(sample);
            runner.own.recorder.samples += 1;
        }
    }
}
