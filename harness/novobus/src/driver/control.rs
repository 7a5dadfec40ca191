//! Starting and stopping drives, errors, reset, outputs (ND21 11.8, 12.6-12.8, 14.10).

use super::{Axis, Error, OpenRings};
use harness_proto::nd21::bits::status;
use harness_proto::nd21::{self, ram};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::Job;

impl OpenRings<'_> {
    /// Takes the software block and the software stop away: the drive starts if its inputs let it.
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_Go")]
    pub(crate) fn go(&self, axis: Axis) -> Result<(), Error> {
        self.and(axis, ram::STATUS, !(status::BLOCK | status::STOP))
    }

    /// Stops the drive on its ramp (software stop; the print has the text of `NB_Go`, E48).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_Stop")]
    pub(crate) fn stop(&self, axis: Axis) -> Result<(), Error> {
        self.or(axis, ram::STATUS, status::STOP)
    }

    /// Blocks the regulator: no torque (software block).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_Sperre")]
    pub(crate) fn block(&self, axis: Axis) -> Result<(), Error> {
        self.or(axis, ram::STATUS, status::BLOCK)
    }

    /// Confirms the drive's error (14.10.1).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_DeleteError")]
    pub(crate) fn delete_error(&self, axis: Axis) -> Result<(), Error> {
        self.write_byte(axis, ram::ERRORCODE, nd21::CONFIRM_ERROR)
    }

    /// Resets the drive: what is not in its EEPROM is lost. Where the answer is lost it is not known whether
    /// the drive was reset, and it is not tried again.
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_ResetH8")]
    pub(crate) fn reset(&self, axis: Axis) -> Result<(), Error> {
        self.run_job(axis, |drive| Job::new(drive, Command::ResetH8))?;
        Ok(())
    }

    /// Refuses what cannot be done while the drive is in reset or in error mode.
    pub(crate) fn check_ready(&self, axis: Axis) -> Result<(), Error> {
        let byte = self.read_byte(axis, ram::STATUS)?;
        if byte & status::RESET != 0 {
            return Err(Error::InReset { axis });
        }
        if byte & status::ERROR != 0 {
            let code = self.read_word(axis, ram::ERRORCODE)?;
            return Err(Error::InErrorMode { axis, code });
        }
        Ok(())
    }
}
