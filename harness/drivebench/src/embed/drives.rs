//! Drives for another program: opened by the name of a rig, read and written by the names of their cells.

use super::{Error, Reading, embedding};
use crate::buses::find_rig_in;
use crate::rig::find;
use harness_bench::embed::{AxisCommand, AxisDrives};
use harness_proto::nd21::State;
use std::time::Duration;

/// The drives of a rig or of a simulated ring, by their axis numbers (ND21 12.2): 0 to 249 on the first ring, 0x100 to 0x1F9 on the
/// second. A call blocks until the drive has answered, 5 s at most.
#[derive(Debug)]
pub struct Drives(Box<dyn AxisDrives>);

impl Drives {
    /// A simulated ring of `drives` whole ND21, 1 to 250, in virtual time. `setup` holds header lines of a scenario. If it is empty, the
    /// inputs of every drive release and start it.
    ///
    /// # Errors
    /// `setup` has mistakes.
    pub fn simulated(drives: u8, setup: &str) -> Result<Self, Error> {
        Ok(Self((embedding().simulated)(drives, setup)?))
    }

    /// The drives of a rig: the path of its file, or a name that `drivebench rig list` shows. The rig is locked for other programs until
    /// this value is dropped. Nothing is sent that the `[limits]` of its file deny; without `allow_motion` no motor may turn. The opening puts
    /// the drives in error 0504 (ND21 9.8); [`delete_error`](Self::delete_error) confirms it.
    ///
    /// # Errors
    /// There is no such rig, its file has mistakes, it is in use, or its rings do not answer.
    pub fn open(rig: &str, allow_motion: bool) -> Result<Self, Error> {
        let rig = find_rig_in(rig, &find::folder())?;
        Ok(Self((embedding().open)(&rig, allow_motion)?))
    }

    /// The axis numbers of all drives.
    #[must_use]
    pub fn axes(&self) -> Vec<u16> {
        self.0.axes()
    }

    /// Reads a cell by its name in the manual or by its address: `nist`, `EE_pole`, `FF0C`, `FF0C:2`, `ee:47`.
    ///
    /// # Errors
    /// There is no such cell or drive, or the drive does not answer.
    pub fn read(&self, axis: u16, cell: &str) -> Result<Reading, Error> {
        self.0.read(axis, cell)
    }

    /// Writes a cell: `nsoll=1500rpm`, `nsoll=0x161E`, `Status=80`. A cell with a unit takes a number with its unit, or bytes behind `0x`;
    /// any other cell takes hexadecimal bytes.
    ///
    /// # Errors
    /// The cell cannot be written or cannot hold the value, the rig's file denies it, or the drive does not answer.
    pub fn write(&self, axis: u16, value: &str) -> Result<(), Error> {
        self.0.write(axis, value)
    }

    /// Reads the mode and the error of a drive (ND21 11.8, 14.4).
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn state(&self, axis: u16) -> Result<State, Error> {
        self.0.state(axis)
    }

    /// Confirms the error of a drive (`DeleteError`, ND21 12.4). Where the cause is still there, the error comes back.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn delete_error(&self, axis: u16) -> Result<(), Error> {
        self.0.command(axis, AxisCommand::DeleteError)
    }

    /// Releases and starts a drive (`Go`, ND21 12.4): its motor follows the nominal speed from now on.
    ///
    /// # Errors
    /// There is no such drive, the rig's file denies motion, or the drive does not answer.
    pub fn go(&self, axis: u16) -> Result<(), Error> {
        self.0.command(axis, AxisCommand::Go)
    }

    /// Stops a drive (`Stop`, ND21 12.4): its motor brakes and is held.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn stop(&self, axis: u16) -> Result<(), Error> {
        self.0.command(axis, AxisCommand::Stop)
    }

    /// Blocks a drive (`Block`, ND21 12.4): its motor is without current.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn block(&self, axis: u16) -> Result<(), Error> {
        self.0.command(axis, AxisCommand::Block)
    }

    /// Lets time pass while the bus stays at work. Simulated time passes at once.
    pub fn wait(&self, time: Duration) {
        self.0.wait(time);
    }

    /// Takes a rig to its safe state and gives it back: every drive stands and is blocked. A drop does the same and reports nothing.
    ///
    /// # Errors
    /// The safe state is not confirmed: switch the power off.
    pub fn close(mut self) -> Result<(), Error> {
        match self.0.close() {
            Some(end) if end.is_unsafe() => Err(Error::Rig(end.to_string())),
            _ => Ok(()),
        }
    }
}
