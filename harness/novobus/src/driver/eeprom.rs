//! Reading and writing the EEPROM (ND21 12.5), by the steps of 14.10.5.

use super::access::narrow;
use super::{Axis, Error, OpenRings, value_of};
use harness_proto::nd21::ram;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::Outcome;

/// The commands of 14.10.5.1.
const READ_BYTE: u8 = 0x81;
const WRITE_BYTE: u8 = 0x82;
const PROG_PARAM: u8 = 0x84;
/// What ends a read (14.10.5.2).
const READ_DONE: u8 = 0x10;
/// Bit 5 of `EEPROMcontrol`: a byte has been read; bit 4: writing is completed.
const READ: u8 = 1 << 5;
const WRITTEN: u8 = 1 << 4;

/// How often a byte is read on a line that disturbs.
const ATTEMPTS: u8 = 8;

impl OpenRings<'_> {
    /// Reads a byte of the EEPROM.
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_ReadEEPROM")]
    pub(crate) fn read_eeprom(&self, axis: Axis, address: u8) -> Result<u8, Error> {
        let bytes = self.read_eeprom_of(&[axis], address)?;
        bytes.first().copied().ok_or(Error::NoSuchOrder)
    }

    /// Reads the same byte of the EEPROM of many drives, each step of all of them before the next.
    ///
    /// # Errors
    /// See [`Error`]; the first one where several drives fail.
    pub(crate) fn read_eeprom_of(&self, axes: &[Axis], address: u8) -> Result<Vec<u8>, Error> {
        for _ in 0..ATTEMPTS {
            if let Some(bytes) = self.read_eeprom_once(axes, address)? {
                return Ok(bytes);
            }
        }
        Err(Error::Disturbed {
            what: format!("reading the EEPROM at {address:02X} (ND21 14.10.5.2)"),
            attempts: ATTEMPTS,
        })
    }

    /// The steps of 14.10.5.2. `None` where the command may have run twice: the byte that was read stands where the address stood
    /// (14.10.5.1), so that the second time another byte is read.
    fn read_eeprom_once(&self, axes: &[Axis], address: u8) -> Result<Option<Vec<u8>>, Error> {
        let all = |command| axes.iter().map(move |axis| (*axis, command));
        let write = |address, data| all(Command::WriteByte { address, data });
        let read = |address| self.run_commands(all(Command::ReadByte { address }));
        self.run_commands(write(ram::EEPROM_BUFFER, address))?;
        let mut twice = false;
        for outcome in self.run_outcomes(write(ram::EEPROM_CONTROL, READ_BYTE))? {
            let perhaps_twice = true;
            twice |= outcome == Outcome::Done { perhaps_twice };
            value_of(outcome)?;
        }
        // Most have it by now, as many telegrams have passed; those that do not are asked again.
        for (axis, control) in axes.iter().zip(read(ram::EEPROM_CONTROL)?) {
            if narrow::<u8>(control)? & READ == 0 {
                self.wait_for_eeprom(*axis, READ)?;
            }
        }
        let bytes = read(ram::EEPROM_BUFFER)?;
        self.run_commands(write(ram::EEPROM_CONTROL, READ_DONE))?;
        let bytes: Vec<u8> = bytes.into_iter().map(narrow).collect::<Result<_, _>>()?;
        Ok((!twice).then_some(bytes))
    }

    /// Reads bytes of the EEPROM from `address` on; those beyond FF are left out.
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn read_eeprom_bytes(
        &self,
        axis: Axis,
        address: u8,
        count: u16,
    ) -> Result<Vec<u8>, Error> {
        (u16::from(address)..u16::from(address) + count)
            .filter_map(|address| u8::try_from(address).ok())
            .map(|address| self.read_eeprom(axis, address))
            .collect()
    }

    /// Writes a byte of the EEPROM and waits until it is written.
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_WriteEEPROM")]
    pub(crate) fn write_eeprom(&self, axis: Axis, address: u8, data: u8) -> Result<(), Error> {
        self.write_byte(axis, ram::EEPROM_BUFFER, address)?;
        self.write_byte(axis, ram::EEPROM_BUFFER + 1, data)?;
        self.write_byte(axis, ram::EEPROM_CONTROL, WRITE_BYTE)?;
        self.wait_for_eeprom(axis, WRITTEN)
    }

    /// Copies the parameters FF60-FF7F into the EEPROM and waits until they are written.
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_RAMtoEEPROM")]
    #[doc(alias = "ProgParam")]
    pub(crate) fn ram_to_eeprom(&self, axis: Axis) -> Result<(), Error> {
        self.write_byte(axis, ram::EEPROM_CONTROL, PROG_PARAM)?;
        self.wait_for_eeprom(axis, WRITTEN)
    }

    fn wait_for_eeprom(&self, axis: Axis, bit: u8) -> Result<(), Error> {
        let patience = self.options.drive_patience;
        self.poll_byte(axis, ram::EEPROM_CONTROL, patience, "the EEPROM", |byte| {
            Ok(byte & bit != 0)
        })?;
        Ok(())
    }
}
