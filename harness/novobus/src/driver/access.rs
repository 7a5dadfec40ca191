//! Reading and writing cells (ND21 12.2-12.4).

use super::{Axis, Error, OpenRings, OrderNumber, value_of};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Job, Outcome, Refused};
use harness_proto::time::Span;
use std::collections::VecDeque;

/// The numbers that a read brings have the width of the cell.
pub(crate) fn narrow<T: TryFrom<u32>>(value: Option<u32>) -> Result<T, Error> {
    value
        .and_then(|value| T::try_from(value).ok())
        .ok_or(Error::Open(
            "the answer leaves a byte out (ReadLong as printed, ND21 10.1)",
        ))
}

/// The bit commands reach one page only (10.3).
fn page(address: u16) -> Result<u8, Error> {
    let [high, low] = address.to_be_bytes();
    if high == 0xFF && low <= 0x7F {
        return Ok(low);
    }
    Err(Error::Value(format!(
        "And and Or reach FF00 to FF7F and not {address:04X} (ND21 10.3)"
    )))
}

/// How much of a cell is read at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    Byte,
    /// A word: two bytes from an even address on.
    Word,
}

impl OpenRings<'_> {
    /// Reads a byte of RAM, ROM or the register field (12.3).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_ReadByte")]
    pub(crate) fn read_byte(&self, axis: Axis, address: u16) -> Result<u8, Error> {
        narrow(self.run_job(axis, |drive| Job::new(drive, Command::ReadByte { address }))?)
    }

    /// Reads a word of RAM or ROM (12.3).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_ReadWord")]
    pub(crate) fn read_word(&self, axis: Axis, address: u16) -> Result<u16, Error> {
        narrow(self.run_job(axis, |drive| Job::new(drive, Command::ReadWord { address }))?)
    }

    /// Reads four bytes of RAM (12.3).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_ReadLong")]
    pub(crate) fn read_long(&self, axis: Axis, address: u16) -> Result<u32, Error> {
        narrow(self.run_job(axis, |drive| Job::new(drive, Command::ReadLong { address }))?)
    }

    /// Reads `count` bytes from `address` on, pipelined.
    ///
    /// # Errors
    /// See [`Error`]; the first one where several reads fail.
    pub(crate) fn read_bytes(
        &self,
        axis: Axis,
        address: u16,
        count: u16,
    ) -> Result<Vec<u8>, Error> {
        let addresses = (0..count).map_while(|offset| address.checked_add(offset));
        let reads = addresses.map(|address| (axis, Command::ReadByte { address }));
        self.run_commands(reads)?.into_iter().map(narrow).collect()
    }

    /// Reads bytes and words of many drives without waiting for an answer before the next is asked for: an address, and 1 or 2
    /// bytes from it on, the high byte first (12.3). What was read, in their order.
    ///
    /// # Errors
    /// See [`Error`]; the first one where several reads fail.
    pub(crate) fn read_many(
        &self,
        cells: impl IntoIterator<Item = (Axis, u16, Width)>,
    ) -> Result<Vec<u16>, Error> {
        let reads = cells.into_iter().map(|(axis, address, width)| {
            let command = match width {
                Width::Byte => Command::ReadByte { address },
                Width::Word => Command::ReadWord { address },
            };
            (axis, command)
        });
        self.run_commands(reads)?.into_iter().map(narrow).collect()
    }

    /// Runs commands, of one drive or of many, without waiting for an answer before the next is sent; what
    /// they read, in their order.
    pub(crate) fn run_commands(
        &self,
        commands: impl IntoIterator<Item = (Axis, Command)>,
    ) -> Result<Vec<Option<u32>>, Error> {
        let outcomes = self.run_outcomes(commands)?;
        outcomes.into_iter().map(value_of).collect()
    }

    /// The same, and how each of them ended.
    pub(crate) fn run_outcomes(
        &self,
        commands: impl IntoIterator<Item = (Axis, Command)>,
    ) -> Result<Vec<Outcome>, Error> {
        let mut orders = VecDeque::new();
        let mut ended = Vec::new();
        let end = commands
            .into_iter()
            .try_for_each(|(axis, command)| {
                loop {
                    match self.start(axis, |drive| Job::new(drive, command)) {
                        Ok(order) => {
                            orders.push_back(order);
                            return Ok(());
                        }
                        // The master's queue is full: wait for the oldest job first.
                        Err(full @ Error::Refused(Refused::Full { .. })) => {
                            ended.push(self.outcome(orders.pop_front().ok_or(full)?)?);
                        }
                        Err(error) => return Err(error),
                    }
                }
            })
            .and_then(|()| {
                while let Some(order) = orders.pop_front() {
                    ended.push(self.outcome(order)?);
                }
                Ok(())
            });
        for OrderNumber { ring, id } in orders {
            self.lock().forget(ring, id);
        }
        end.map(|()| ended)
    }

    /// Writes a byte of RAM (12.2).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_WriteByte")]
    pub(crate) fn write_byte(&self, axis: Axis, address: u16, data: u8) -> Result<(), Error> {
        let command = Command::WriteByte { address, data };
        self.run_job(axis, |drive| Job::new(drive, command))?;
        Ok(())
    }

    /// Writes a word of RAM (12.2).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_WriteWord")]
    pub(crate) fn write_word(&self, axis: Axis, address: u16, data: u16) -> Result<(), Error> {
        let command = Command::WriteWord { address, data };
        self.run_job(axis, |drive| Job::new(drive, command))?;
        Ok(())
    }

    /// Clears the bits of a cell FF00-FF7F that `mask` has as 0 (10.3).
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn and(&self, axis: Axis, address: u16, mask: u8) -> Result<(), Error> {
        let address_low = page(address)?;
        let command = Command::And {
            address_low,
            data: mask,
        };
        self.run_job(axis, |drive| Job::new(drive, command))?;
        Ok(())
    }

    /// Sets the bits of a cell FF00-FF7F that `mask` has as 1 (10.3).
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn or(&self, axis: Axis, address: u16, mask: u8) -> Result<(), Error> {
        let address_low = page(address)?;
        let command = Command::Or {
            address_low,
            data: mask,
        };
        self.run_job(axis, |drive| Job::new(drive, command))?;
        Ok(())
    }

    /// Reads a byte until `done` says that it is as it should be.
    pub(crate) fn poll_byte(
        &self,
        axis: Axis,
        address: u16,
        patience: Span,
        what: &str,
        mut done: impl FnMut(u8) -> Result<bool, Error>,
    ) -> Result<u8, Error> {
        let end = self.lock().now() + patience;
        loop {
            let byte = self.read_byte(axis, address)?;
            if done(byte)? {
                return Ok(byte);
            }
            if self.lock().now() >= end {
                return Err(Error::TimeOut {
                    waited: patience,
                    what: format!("{what} of drive {axis} (found {byte:02X})"),
                });
            }
        }
    }
}
