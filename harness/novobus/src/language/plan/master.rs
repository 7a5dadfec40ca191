//! What the driver is to do, settled.

use super::planner::Planner;
use super::types::{PlannedCall, RingAct};
use crate::language::syntax::{CellPlace, DriveRange, JobKind, MasterCall, Written, WrittenTarget};
use harness_bench::scenario::pattern::{Expected, Pattern};
use harness_bench::scenario::problem::Problem;
use harness_bench::scenario::quantity::Quantity;
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::units::turns_to_raw;

impl Planner {
    pub(crate) fn master(
        &self,
        calls: &[(DriveRange, MasterCall)],
        once: bool,
    ) -> Result<RingAct, Problem> {
        let ring = calls.first().map_or(0, |(drives, _)| drives.ring);
        let mut planned = Vec::new();
        for (drives, call) in calls {
            for drive in self.drives(drives)? {
                planned.push((drive, self.call((ring, drive), call)?));
            }
        }
        Ok(RingAct::Master(ring, planned, once))
    }

    fn call(&self, drive: (usize, u8), call: &MasterCall) -> Result<PlannedCall, Problem> {
        let ring = drive.0;
        Ok(match call {
            MasterCall::Command(kind, place, data) => {
                let moved = place.as_ref().map(|place| self.moved(place, drive.0));
                return self.driver_command(
                    drive,
                    *kind,
                    moved.transpose()?.as_ref(),
                    data.as_ref(),
                );
            }
            MasterCall::ReadEeprom(place, data) => {
                let expected = match data {
                    Some(data) => self.data(data, 1, ring)?[0],
                    None => Expected::Any,
                };
                PlannedCall::ReadEeprom(low(place), expected)
            }
            MasterCall::WriteEeprom(place, data) => {
                PlannedCall::WriteEeprom(low(place), self.known(data, 1, ring)?[0])
            }
            MasterCall::RamToEeprom => PlannedCall::RamToEeprom,
            MasterCall::Reference => PlannedCall::Reference,
            MasterCall::SetActualValue(target) => PlannedCall::SetActualValue(match target {
                WrittenTarget::Bytes(pattern) => self.long(pattern, ring)?,
                WrittenTarget::At(turns) | WrittenTarget::By(turns) => {
                    increments(*turns)?.cast_unsigned()
                }
            }),
            MasterCall::InitPs => PlannedCall::InitPs,
            MasterCall::WritePs(target) => PlannedCall::WritePs(match target {
                WrittenTarget::Bytes(pattern) => Position::decode(self.long(pattern, ring)?),
                WrittenTarget::At(turns) => position(PositionMode::Absolute, *turns)?,
                WrittenTarget::By(turns) => position(PositionMode::Relative, *turns)?,
            }),
            MasterCall::Exchange(send, receive) => {
                let sent = self.known(send, 2, ring)?;
                let expected = match receive {
                    Some(pattern) => self.data(pattern, 2, ring)?,
                    None => vec![Expected::Any; 2],
                };
                PlannedCall::Exchange(u16::from_be_bytes([sent[0], sent[1]]), expected)
            }
            MasterCall::StartPs => PlannedCall::StartPs,
            MasterCall::WaitForEnd => PlannedCall::WaitForEnd,
        })
    }

    fn driver_command(
        &self,
        drive: (usize, u8),
        kind: JobKind,
        place: Option<&CellPlace>,
        data: Option<&Written>,
    ) -> Result<PlannedCall, Problem> {
        let command = self.command(kind, drive, place, data)?;
        if let Some(place) = place {
            super::job::reaches(&command, place)?;
        }
        let width = usize::from(command.kind().width());
        let expected = match data {
            Some(data) if command.kind().reads() => {
                self.expected_data(data, place, width, drive)?
            }
            _ => Vec::new(),
        };
        Ok(PlannedCall::Command(command, expected))
    }

    fn long(&self, pattern: &Pattern, ring: usize) -> Result<u32, Problem> {
        let bytes = self.known(pattern, 4, ring)?;
        Ok(bytes
            .iter()
            .fold(0, |long, byte| long << 8 | u32::from(*byte)))
    }
}

fn low(place: &CellPlace) -> u8 {
    place.address.to_le_bytes()[0]
}

fn increments(turns: Quantity) -> Result<i32, Problem> {
    turns_to_raw(turns.value).map_err(|error| wrong(turns, &error.to_string()))
}

fn position(mode: PositionMode, turns: Quantity) -> Result<Position, Problem> {
    Position::from_turns(mode, turns.value).map_err(|error| wrong(turns, &error.to_string()))
}

fn wrong(turns: Quantity, message: &str) -> Problem {
    Problem::new(turns.span, message, "a position that fits expected here")
}
