//! The memory as a deviant drive's bus end finds it.

use super::how::{Deviation, How, Write};
use harness_proto::novobus::bus_end::{ParameterByte, Place};
use harness_proto::novobus::command::Kind;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::novobus::output::OutputChange;

/// A memory behind deviations.
pub(super) struct Proxy<'a> {
    pub(super) memory: &'a mut dyn Memory,
    pub(super) deviations: &'a [&'static Deviation],
    /// What the byte in hand is taken for.
    pub(super) place: Place,
    /// Whether no byte of its telegram stands behind it.
    pub(super) last: bool,
    /// The commands that have been executed.
    pub(super) counts: Counts,
}

/// How many commands a drive has executed since power-up.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) writes: u64,
    pub(super) reads: u64,
}

impl Memory for Proxy<'_> {
    fn read(&mut self, address: u16) -> u8 {
        let mut from = address;
        for deviation in self.deviations {
            if let How::ReadsFrom(other) = deviation.injection.how {
                from = other(self.place, from);
            }
        }
        let mut data = seen(self.deviations, &mut |a| self.memory.read(a), from);
        for deviation in self.deviations {
            if let (How::Misreads(other), Place::Parameter(ParameterByte { kind, .. })) =
                (&deviation.injection.how, self.place)
                && kind.reads()
            {
                data = other(self.counts.reads + 1, address, data);
            }
        }
        data
    }

    fn write(&mut self, address: u16, data: u8) {
        let mut write = Write {
            place: self.place,
            address,
            data,
            old: self.memory.read(address),
            last: self.last,
            of_a_command: matches!(self.place, Place::Parameter(_)),
            nth: self.counts.writes + 1,
        };
        for deviation in self.deviations {
            if let How::Writes(other) = deviation.injection.how {
                let Some((address, data)) = other(write) else {
                    return;
                };
                write = Write {
                    address,
                    data,
                    ..write
                };
            }
        }
        self.memory.write(write.address, write.data);
    }

    fn permits(&self, kind: Kind, address: u16) -> bool {
        let right = self.memory.permits(kind, address);
        let differs = |d: &&Deviation| match d.injection.how {
            How::Permits(permits) => permits(kind, address) != right,
            _ => false,
        };
        right != self.deviations.iter().copied().any(|d| differs(&d))
    }

    fn write_output(&mut self, change: OutputChange) {
        let changed = self
            .deviations
            .iter()
            .try_fold(change, |change, d| match d.injection.how {
                How::Outputs(other) => other(change),
                _ => Some(change),
            });
        if let Some(change) = changed {
            self.memory.write_output(change);
        }
    }

    fn reset(&mut self) {
        let other = self.deviations.iter().find_map(|d| match d.injection.how {
            How::Resets(reset) => Some(reset),
            _ => None,
        });
        match other {
            Some(reset) => reset(self.memory),
            None => self.memory.reset(),
        }
    }

    fn bus_error(&mut self, error: BusError) {
        let reported = self
            .deviations
            .iter()
            .try_fold(error, |error, d| match d.injection.how {
                How::Reports(other) => other(error),
                _ => Some(error),
            });
        if let Some(error) = reported {
            self.memory.bus_error(error);
        }
    }

    fn monitors_time_out(&self) -> bool {
        monitors(self.deviations).unwrap_or_else(|| self.memory.monitors_time_out())
    }
}

/// Whether time-outs are monitored, where a deviation decides it.
pub(super) fn monitors(deviations: &[&'static Deviation]) -> Option<bool> {
    deviations.iter().find_map(|d| match d.injection.how {
        How::Monitors(on) => Some(on),
        _ => None,
    })
}

/// What a cell seems to hold: each deviation sees what those before it show.
pub(super) fn seen(
    deviations: &[&'static Deviation],
    peek: &mut dyn FnMut(u16) -> u8,
    address: u16,
) -> u8 {
    let Some((last, before)) = deviations.split_last() else {
        return peek(address);
    };
    match last.injection.how {
        How::Reads(reads) => reads(&mut |a| seen(before, peek, a), address),
        _ => seen(before, peek, address),
    }
}
