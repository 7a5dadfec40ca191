//! What a master is to do, and the faults that meet it.

use crate::fault::{Flips, LinkFault};
use arbitrary::{Arbitrary, Unstructured};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Job, MasterOptions, Packing};
use harness_proto::time::Span;

/// The most jobs: each has a cell of its own.
pub(super) const MOST_JOBS: usize = 20;

/// The most faults: fewer than the master may try to correct.
const MOST_FAULTS: usize = 3;

/// Cells that no job writes; every drive holds other bytes there.
pub(super) const CONSTANTS: u16 = 0xFD90;

/// How many of them there are.
pub(super) const CONSTANT_CELLS: u16 = 0x60;

/// A job, and when it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobOrder {
    /// The job.
    pub job: Job,
    /// The first cell that it reads or writes.
    pub address: u16,
    /// How many byte times after the order before it.
    pub gap: u16,
}

/// A fault on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobFault {
    /// Which link, counted from the master's outgoing one.
    pub link: usize,
    /// The byte on it, counted from 1.
    pub byte: u64,
    /// What happens.
    pub what: LinkFault,
}

/// What stands in front of the jobs and faults of an input.
#[derive(Arbitrary)]
struct Head {
    /// How many drives there are, less one; 1 to 6.
    drives: u8,
    /// Bits 0 and 1: the packing (all, none, no "next", not cut). Bit 2: process data is exchanged. Bit 3: time-outs are monitored.
    options: u8,
}

/// A job or a fault, in six bytes.
#[derive(Arbitrary)]
struct Record {
    /// The low half is 0 to 9 for a job, 10 to 13 for a fault at a byte, 14 for a cut, 15 for another byte on the last link.
    kind: u8,
    /// The drive, or the link.
    place: u8,
    /// The gap in front of a job, or the number of the byte.
    at: u8,
    data: [u8; 2],
    /// Of a job: bit 0 forbids a second run. Of a fault: how far it goes.
    last: u8,
}

/// What a master is to do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// How many drives its ring has.
    pub drives: u8,
    /// What it may pack.
    pub packing: Packing,
    /// Whether it exchanges process data with all drives (ND21 9.4).
    pub exchange: bool,
    /// Whether the drives report a time-out (9.9).
    pub monitoring: bool,
    /// The jobs, in order.
    pub orders: Vec<JobOrder>,
    /// The faults.
    pub faults: Vec<JobFault>,
}

impl<'a> Arbitrary<'a> for Work {
    /// A head of two bytes, then records of six bytes up to the end.
    fn arbitrary(input: &mut Unstructured<'a>) -> arbitrary::Result<Self> {
        let head: Head = input.arbitrary()?;
        let packing = match head.options & 3 {
            0 => Packing::ALL,
            1 => Packing::NONE,
            2 => Packing {
                next: false,
                ..Packing::ALL
            },
            _ => Packing {
                cut: false,
                ..Packing::ALL
            },
        };
        let mut work = Self {
            drives: 1 + head.drives % 6,
            packing,
            exchange: head.options & 4 != 0,
            monitoring: head.options & 8 != 0,
            orders: Vec::new(),
            faults: Vec::new(),
        };
        let mut replaced = None;
        while !input.is_empty() {
            let record: Record = input.arbitrary()?;
            match record.kind & 15 {
                0..10 => work.order(record),
                15 => {
                    let byte = u64::from(record.at) + 1 + 256 * u64::from(record.place & 1);
                    replaced = Some((byte, record.data[1]));
                }
                _ => work.fault(record),
            }
        }
        // A replaced byte with good parity can pass the 8-bit check in combination with other faults, so it must be the only fault.
        if let (Some((byte, other)), true) = (replaced, work.faults.is_empty()) {
            work.faults.push(JobFault {
                link: usize::from(work.drives),
                byte,
                what: LinkFault::Replace(other),
            });
        }
        Ok(work)
    }
}

impl Work {
    /// The work of an input. Every input is one: a byte that is missing at its end is 0.
    #[must_use]
    pub fn read(input: &[u8]) -> Self {
        Self::arbitrary(&mut Unstructured::new(input)).unwrap_or_else(|_never| Self::default())
    }

    fn order(
        &mut self,
        Record {
            kind,
            place,
            at,
            data,
            last,
        }: Record,
    ) {
        let number = self.orders.len() as u16;
        if self.orders.len() >= MOST_JOBS {
            return;
        }
        let drive = place % self.drives;
        let cell = 0xFE00 + 4 * number;
        let bit_cell = 0x40 + number as u8;
        let constant = CONSTANTS + u16::from(data[0]) % (CONSTANT_CELLS - 4);
        let word = u16::from_be_bytes(data);
        let (command, address) = match kind & 15 {
            0 | 1 => (Command::ReadByte { address: constant }, constant),
            2 => (Command::ReadWord { address: constant }, constant),
            3 => (Command::ReadLong { address: constant }, constant),
            4 | 5 => {
                let [_, data] = data;
                let address = cell;
                (Command::WriteByte { address, data }, cell)
            }
            6 | 7 => {
                let address = cell;
                (
                    Command::WriteWord {
                        address,
                        data: word,
                    },
                    cell,
                )
            }
            _ => {
                let (address_low, data) = (bit_cell, data[1]);
                let command = match kind & 15 {
                    8 => Command::And { address_low, data },
                    _ => Command::Or { address_low, data },
                };
                (command, 0xFF00 | u16::from(bit_cell))
            }
        };
        let job = Job::new(drive, command);
        self.orders.push(JobOrder {
            job: if last & 1 == 1 { job.once() } else { job },
            address,
            gap: u16::from(at % 64),
        });
    }

    fn fault(
        &mut self,
        Record {
            kind,
            place,
            at,
            data,
            last,
        }: Record,
    ) {
        if self.faults.len() >= MOST_FAULTS {
            return;
        }
        let flips = |data| {
            LinkFault::Flip(Flips {
                data,
                ..Flips::default()
            })
        };
        let what = match (kind & 15, data[1] % 8) {
            (14, _) => LinkFault::Cut,
            (_, 0..5) => flips(1 << (last % 8)),
            (_, 5) => LinkFault::Drop,
            (_, 6) => LinkFault::Duplicate,
            _ => LinkFault::Delay(Span::from_micros(100 * u64::from(last))),
        };
        self.faults.push(JobFault {
            link: usize::from(place) % (usize::from(self.drives) + 1),
            byte: 1 + u64::from(u16::from_be_bytes([data[0] & 1, at])),
            what,
        });
    }

    /// How its master works.
    #[must_use]
    pub fn options(&self) -> MasterOptions {
        MasterOptions {
            capacity: 64,
            packing: self.packing,
            ..MasterOptions::default()
        }
    }

    /// Whether a link is cut and stays so.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.faults.iter().any(|fault| fault.what == LinkFault::Cut)
    }

    /// Whether the master may stop the bus: a link is cut, or delays follow one another, of which the bytes behind them stay late.
    pub(super) fn may_stop(&self) -> bool {
        let late = |fault: &&JobFault| matches!(fault.what, LinkFault::Delay(_));
        self.is_cut() || self.faults.iter().filter(late).count() > 1
    }

    /// Whether bytes are lost or come twice. The 8-bit check misses that about once in ten thousand times, so a long fuzz run finds
    /// such a case: the reported outcome of jobs cannot be judged then.
    pub(super) fn may_fool(&self) -> bool {
        let fools = |fault: &JobFault| matches!(fault.what, LinkFault::Drop | LinkFault::Duplicate);
        self.faults.iter().any(fools)
    }

    /// Whether what has no check of its own, process data and the data of `ReadLong`, can come wrong and unnoticed.
    pub(super) fn unchecked(&self) -> bool {
        let other = |fault: &JobFault| matches!(fault.what, LinkFault::Replace(_));
        self.may_fool() || self.faults.iter().any(other)
    }

    /// The link on which one bit of one byte is inverted, where that is all that happens.
    pub(super) fn damaged(&self) -> Option<usize> {
        match self.faults.as_slice() {
            [
                JobFault {
                    link,
                    what: LinkFault::Flip(_),
                    ..
                },
            ] => Some(*link),
            _ => None,
        }
    }
}

/// What a drive holds in a cell that no job writes.
pub(super) fn constant(drive: u8, address: u16) -> u8 {
    let [_, low] = address.to_be_bytes();
    low.wrapping_mul(37) ^ drive.wrapping_mul(11) | 1
}

/// What it holds in the cells of And and Or.
pub(super) const BITS: u8 = 0x5A;

/// What it gets as process data.
pub(super) fn nominal(drive: u8) -> u16 {
    0x1234 + 0x0101 * u16::from(drive)
}
