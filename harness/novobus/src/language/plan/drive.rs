//! What must hold of drives, what happens to them from outside the bus, and what of them is recorded.

use super::planner::Planner;
use super::setup::{OUTSIDE, in_memory, number_bytes};
use super::types::{
    CellTest, LOOK, PlannedCell, PlannedCondition, PlannedDriveCheck, PlannedLooks, PlannedRecord,
};
use crate::language::syntax::{
    CellCheck, CellPlace, CellRecording, Condition, DriveCheck, DriveRange, Influence, Looks,
    Relation, Written,
};
use harness_bench::link::Capability;
use harness_bench::scenario::language::Settle as _;
use harness_bench::scenario::pattern::{Expected, MAX_CELLS, Pattern};
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_proto::time::Span;
use std::collections::BTreeSet;

/// Maximum number of records of a scenario, each of one cell of one drive.
const MAX_RECORDS: usize = 1_000;

/// The longest cell that is a number.
const NUMBER: usize = 4;

impl Planner {
    pub(crate) fn drive_check(
        &self,
        check: &DriveCheck,
        needs: &mut Vec<Capability>,
    ) -> Result<PlannedDriveCheck, Problem> {
        let drives = self.drives(&check.drives)?;
        let ring = check.drives.ring;
        let condition = match &check.condition {
            Condition::InError(expected) => {
                // That a drive is not in the error mode shows in a telegram that comes back from it.
                if *expected {
                    needs.push(Capability::Tap);
                }
                PlannedCondition::InError(*expected)
            }
            Condition::Memory(place, pattern) => {
                let bytes = pattern.expand(self.size(ring), MAX_CELLS)?;
                in_memory(place, bytes.len())?;
                PlannedCondition::Memory(place.address, bytes)
            }
            Condition::Cell(cell) => PlannedCondition::Cell(self.cell(&check.drives, cell)?),
            Condition::Shows(showing) => {
                needs.push(Capability::Simulator);
                self.only_nd21(&check.drives, OUTSIDE, check.span)?;
                PlannedCondition::Shows(*showing)
            }
        };
        Ok(PlannedDriveCheck {
            ring,
            drives,
            condition,
        })
    }

    fn cell(&self, drives: &DriveRange, check: &CellCheck) -> Result<PlannedCell, Problem> {
        let place = &check.place;
        let width = place.cell.map_or(1, |cell| usize::from(cell.size));
        let whole = place
            .scale()
            .map_or(width, |scale| usize::from(scale.size()));
        let (size, test) = match &check.value {
            Written::Number(_) | Written::Off(_) => (whole, self.number_test(drives, check)?),
            Written::Bytes(pattern) => {
                let bytes = pattern.expand(self.size(drives.ring), MAX_CELLS)?;
                // Both words of a position, or the beginning of a cell that is no number.
                let fits = bytes.len() == width
                    || bytes.len() == whole
                    || width > NUMBER && (1..width).contains(&bytes.len());
                if !fits {
                    return Err(wrong_length(place, pattern, bytes.len(), width));
                }
                let size = bytes.len();
                let test = match (&check.mask, check.relation) {
                    (Some(mask), _) => self.masked(drives, place, mask, pattern)?,
                    (None, Relation::Equal) => CellTest::Bytes(bytes),
                    (None, relation) => {
                        let raw = self.raw(drives, place, pattern)?;
                        let signed = place.cell.is_some_and(|cell| cell.signed);
                        CellTest::Raw(relation, number(&raw, signed), signed)
                    }
                };
                (size, test)
            }
        };
        Ok(PlannedCell::new(place, size, test))
    }

    fn number_test(&self, drives: &DriveRange, check: &CellCheck) -> Result<CellTest, Problem> {
        let scale = check.place.scale();
        if check.relation == Relation::Equal {
            for (units, _) in self.alike(drives.ring, self.drives(drives)?) {
                number_bytes(scale, &check.value, units)?;
            }
        }
        match (&check.value, scale) {
            (Written::Number(expected), Some(scale)) => Ok(CellTest::Number {
                scale,
                relation: check.relation,
                expected: *expected,
                tolerance: check.tolerance,
            }),
            (_, scale) => Ok(CellTest::Bytes(
                // A limit that is switched off is the same bytes in every drive.
                number_bytes(scale, &check.value, self.units_of(drives.ring, 0))?
                    .into_iter()
                    .map(Expected::Byte)
                    .collect(),
            )),
        }
    }

    fn masked(
        &self,
        drives: &DriveRange,
        place: &CellPlace,
        mask: &Pattern,
        value: &Pattern,
    ) -> Result<CellTest, Problem> {
        let bits = self.raw(drives, place, mask)?;
        let wanted = self.raw(drives, place, value)?;
        if bits
            .iter()
            .zip(&wanted)
            .any(|(bits, wanted)| wanted & !bits != 0)
        {
            return Err(Problem::new(
                value.span,
                "the expected value has a bit that the mask excludes",
                "bits of the mask expected here",
            ));
        }
        Ok(CellTest::Masked(bits, wanted))
    }

    /// As many known bytes as the cell has, and no more than a number has.
    fn raw(
        &self,
        drives: &DriveRange,
        place: &CellPlace,
        pattern: &Pattern,
    ) -> Result<Vec<u8>, Problem> {
        let size = place.cell.map_or(1, |cell| usize::from(cell.size));
        if size > NUMBER {
            return Err(Problem::new(
                place.span,
                format!("`{}` has {size} bytes and is not a number", place.name),
                "a cell of at most four bytes expected here",
            ));
        }
        let bytes = pattern.expand_known(self.size(drives.ring), MAX_CELLS)?;
        if bytes.len() == size {
            Ok(bytes)
        } else {
            Err(wrong_length(place, pattern, bytes.len(), size))
        }
    }

    /// Refuses what happens from outside the bus to a drive that has no outside.
    pub(crate) fn influence(
        &self,
        drives: &DriveRange,
        influence: &Influence,
        span: TextSpan,
    ) -> Result<(), Problem> {
        match influence {
            Influence::Stimuli(_) => self.only_nd21(drives, OUTSIDE, span),
            Influence::Power(_) => self.drives(drives).map(|_| ()),
        }
    }

    pub(crate) fn record(&self, recording: &CellRecording) -> Result<PlannedRecord, Problem> {
        let place = &recording.place;
        let scale = place.scale();
        let width = place.cell.map_or(1, |cell| usize::from(cell.size));
        let size = scale.map_or(width, |scale| usize::from(scale.size()));
        if size > NUMBER {
            return Err(Problem::new(
                place.span,
                format!("`{}` has {size} bytes and is not a number", place.name),
                "a cell of at most four bytes expected here",
            ));
        }
        in_memory(place, size)?;
        let looks = match recording.looks {
            Looks::Every(every) => {
                let time = every.on(self.byte_time());
                if time < LOOK {
                    return Err(Problem::new(
                        every.span(),
                        format!("{time} is too short"),
                        format!("at least {LOOK} expected here"),
                    ));
                }
                PlannedLooks::Every(time)
            }
            Looks::Changes => PlannedLooks::Changes,
            Looks::Off => PlannedLooks::Off,
        };
        Ok(PlannedRecord {
            ring: recording.drives.ring,
            drives: self.drives(&recording.drives)?,
            name: place.name.clone(),
            address: place.address,
            size,
            scale,
            looks,
            span: place.span,
        })
    }
}

/// Records that run, by ring, drive and address, and how many there were.
#[derive(Debug, Default)]
pub(crate) struct RunningRecords {
    cells: BTreeSet<(usize, u8, u16)>,
    records: usize,
}

impl RunningRecords {
    /// What does not run cannot be ended, and a report has an end too.
    pub(crate) fn take(&mut self, record: &PlannedRecord) -> Result<(), Problem> {
        for drive in record.drives.clone() {
            let cell = (record.ring, drive, record.address);
            if record.looks != PlannedLooks::Off {
                self.cells.insert(cell);
                self.records += 1;
            } else if !self.cells.remove(&cell) {
                return Err(Problem::new(
                    record.span,
                    format!("no record of `{}` of drive {drive} runs here", record.name),
                    "a cell that is being recorded expected here",
                ));
            }
        }
        if self.records > MAX_RECORDS {
            return Err(Problem::new(
                record.span,
                format!("more than {MAX_RECORDS} records in one scenario"),
                "fewer drives or cells expected here",
            ));
        }
        Ok(())
    }
}

/// The number that these bytes are, the highest first.
pub(crate) fn number(bytes: &[u8], signed: bool) -> i64 {
    let negative = signed && bytes.first().is_some_and(|byte| byte & 0x80 != 0);
    let start = if negative { -1 } else { 0 };
    bytes
        .iter()
        .fold(start, |n, byte| n << 8 | i64::from(*byte))
}

fn wrong_length(place: &CellPlace, pattern: &Pattern, found: usize, size: usize) -> Problem {
    let s = |n: usize| if n == 1 { "" } else { "s" };
    Problem::new(
        pattern.span,
        format!("{found} byte{} where `{}` has {size}", s(found), place.name),
        format!(
            "{size} byte{} or a number with a unit expected here",
            s(size)
        ),
    )
}

/// Ten minutes of looks: a run that looks longer at cells is too long.
pub(crate) const MAX_LOOKS: u64 = Span::from_millis(600_000).units() / LOOK.units() + 1;
