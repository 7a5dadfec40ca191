//! What the EEPROM controller must have done when it says that it is done (ND21 14.10.5).

use super::cells::{Image, at};
use crate::novobus::cells::Cells;
use crate::novobus::reference::Bytes;
use harness_proto::nd21::cells::CellAccess;
use harness_proto::nd21::{EE_PARAMETERS, PARAMETER_COUNT, PARAMETERS, eeprom, ram};

/// Bit 4 of `EEPROMcontrol`: writing is completed (14.10.5.3).
const READY: u8 = 1 << 4;
/// Bit 5: a byte has been read (14.10.5.2).
const READ: u8 = 1 << 5;

/// The cells of the controller.
const CELLS: std::ops::RangeInclusive<u16> = ram::EEPROM_BUFFER..=ram::EEPROM_CONTROL;

/// An order that was given over the bus, and what stood in `EEPROMbuffer` then.
#[derive(Clone, Copy, Debug)]
pub(super) enum Job {
    /// 81.
    Read(u8),
    /// 82: the address and the byte.
    Write(u8, u8),
    /// 84.
    Parameters,
}

/// The order under way behind these commands; `before` are the cells in front of them.
pub(super) fn order(job: Option<Job>, executed: &[Bytes], before: &Image) -> Option<Job> {
    let mut job = job;
    for command in executed {
        let busy = at(before, ram::EEPROM_CONTROL) & (READY | READ) == 0;
        let buffer = at(before, ram::EEPROM_BUFFER);
        let [high, low] = ram::EEPROM_CONTROL.to_be_bytes();
        job = match **command {
            [0x82, code, l, h] if [h, l] == [high, low] && !busy => match code {
                0x81 => Some(Job::Read(buffer)),
                0x82 => Some(Job::Write(buffer, at(before, ram::EEPROM_BUFFER + 1))),
                0x84 => Some(Job::Parameters),
                _ => None,
            },
            // A cell that is written meanwhile cannot be distinguished from the controller's own change.
            [0x82 | 0x63, .., low, high] => {
                let cell = u16::from_be_bytes([high, low]);
                let parameters = cell >= PARAMETERS - 1 && matches!(job, Some(Job::Parameters));
                job.filter(|_| !parameters && !(*CELLS.start() - 1..=*CELLS.end()).contains(&cell))
            }
            [0xC0 | 0xC1 | 0xC7, ..] => job,
            _ => job.filter(|job| !matches!(job, Job::Parameters)),
        };
    }
    job
}

/// Checks the result of an order once the controller reports that it is done; `None` while it is not done.
pub(super) fn done(job: Job, is: &Image, cells: &Cells) -> Option<Result<(), String>> {
    let control = at(is, ram::EEPROM_CONTROL);
    if control & (READY | READ) == 0 {
        return None;
    }
    let must = if matches!(job, Job::Read(_)) {
        READ
    } else {
        READY
    };
    let stands = |address: u8| cells.eeprom()[usize::from(address)];
    let ill = match job {
        _ if control & must == 0 => Some(format!("EEPROMcontrol shows {control:02X}")),
        Job::Read(address) => {
            let (read, stored) = (at(is, ram::EEPROM_BUFFER), stands(address));
            (read != stored)
                .then(|| format!("{address:02X} was read as {read:02X} and holds {stored:02X}"))
        }
        Job::Write(address, data) => {
            let free =
                eeprom::cell_at(address).is_some_and(|cell| cell.access == CellAccess::Write);
            let stored = stands(address);
            let otherwise = free && stored != data;
            otherwise.then(|| format!("{address:02X} holds {stored:02X}, {data:02X} was written"))
        }
        Job::Parameters => (0..PARAMETER_COUNT).find_map(|n| {
            let place = u16::from(EE_PARAMETERS) + n;
            let stored = cells.eeprom()[usize::from(place)];
            (stored != at(is, PARAMETERS + n)).then(|| format!("{place:02X} holds {stored:02X}"))
        }),
    };
    Some(ill.map_or(Ok(()), |ill| {
        Err(format!("{job:02X?} of the EEPROM is done, and {ill}"))
    }))
}
