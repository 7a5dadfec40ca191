//! Drives for another program: opened by the name of a rig, read and written by the names of their cells.

use super::Error;
use crate::buses::find_rig_in;
use crate::buses::novobus::driver::cell::{CellFound, find, write};
use crate::buses::novobus::driver::{self, Axis, OpenRings, State};
use crate::buses::novobus::drives::{released_header, simulated, units_of};
use crate::buses::novobus::language::argument::{assignments, cells, encode};
use crate::buses::novobus::language::plan::Plan;
use crate::buses::novobus::link::SimulatedLink;
use crate::buses::novobus::rig::Session;
use crate::buses::novobus::rig::shared::Shared;
use crate::buses::novobus::rig::sim::RigOfRings as _;
use crate::rig;
use crate::scenario::problem::{Problem, Problems};
use crate::scenario::source::Source;
use harness_proto::nd21::units;
use harness_proto::time::Span;
use std::fmt;
use std::time::Duration;

/// How long a simulated bench has been on when it is used: the self-tests are over (11.8).
const WARM: Span = Span::from_millis(200);

impl From<driver::Error> for Error {
    fn from(error: driver::Error) -> Self {
        Self::Drive(error.to_string())
    }
}

/// What is wrong with a cell or a value as it was written.
fn mistake(written: &str, problems: &Problems) -> Error {
    let sentences: Vec<_> = problems.all().iter().map(Problem::sentence).collect();
    Error::Mistake(format!("{written}: {}", sentences.join("; ")))
}

/// One simulated ring of this size. Where `setup` is empty, every drive is released and started by its inputs.
///
/// # Errors
/// `setup` has mistakes.
pub(crate) fn released(drives: u8, setup: &str) -> Result<(Plan, SimulatedLink), Error> {
    let source = match setup {
        "" => released_header(&[drives]),
        setup => Source::from_bytes("setup".to_owned(), setup.as_bytes().to_vec())?,
    };
    Ok(simulated(&source, Some(&[drives]))?)
}

/// The drives of a rig or of a simulated ring, by their axis numbers (ND21 12.2): 0 to 249 on the first ring, 0x100 to 0x1F9 on the
/// second. A call blocks until the drive has answered, 5 s at most.
pub struct Drives {
    bus: Option<OpenRings<'static>>,
    plan: Plan,
    rig: Option<Shared>,
}

impl fmt::Debug for Drives {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Drives")
            .field("rig", &self.rig)
            .finish_non_exhaustive()
    }
}

impl Drives {
    /// A simulated ring of `drives` whole ND21, 1 to 250, in virtual time. `setup` holds header lines of a scenario. If it is empty, the
    /// inputs of every drive release and start it.
    ///
    /// # Errors
    /// `setup` has mistakes.
    pub fn simulated(drives: u8, setup: &str) -> Result<Self, Error> {
        let (plan, link) = released(drives, setup)?;
        let bus = OpenRings::open(Box::new(link), &plan.rings, driver::Options::default())?;
        bus.run(WARM);
        Ok(Self {
            bus: Some(bus),
            plan,
            rig: None,
        })
    }

    /// The drives of a rig: the path of its file, or a name that `drivebench rig list` shows. The rig is locked for other programs until
    /// this value is dropped. Nothing is sent that the `[limits]` of its file deny; without `allow_motion` no motor may turn. The opening puts
    /// the drives in error 0504 (ND21 9.8); [`delete_error`](Self::delete_error) confirms it.
    ///
    /// # Errors
    /// There is no such rig, its file has mistakes, it is in use, or its rings do not answer.
    pub fn open(rig: &str, allow_motion: bool) -> Result<Self, Error> {
        let rig = find_rig_in(rig, &rig::find::folder())?;
        let plan = rig.plan()?;
        let options = rig::UseOptions {
            purpose: "another program".to_owned(),
            allow_motion,
            ..rig::UseOptions::default()
        };
        let session = Session::open(&rig, &options)?;
        let sizes = session.rings().to_vec();
        let shared = Shared::new(session);
        let opened = OpenRings::open(Box::new(shared.line()), &sizes, driver::Options::default());
        let drives = Self {
            bus: opened.as_ref().ok().cloned(),
            plan,
            rig: Some(shared),
        };
        opened?;
        Ok(drives)
    }

    /// The axis numbers of all drives.
    #[must_use]
    pub fn axes(&self) -> Vec<u16> {
        let axes = self.bus.iter().flat_map(OpenRings::axes);
        axes.map(Axis::number).collect()
    }

    /// Reads a cell by its name in the manual or by its address: `nist`, `EE_pole`, `FF0C`, `FF0C:2`, `ee:47`.
    ///
    /// # Errors
    /// There is no such cell or drive, or the drive does not answer.
    pub fn read(&self, axis: u16, cell: &str) -> Result<Reading, Error> {
        let (bus, axis) = self.drive(axis)?;
        let locations = cells(&[cell.to_owned()]).map_err(|wrong| mistake(cell, &wrong))?;
        let [location] = locations.as_slice() else {
            return Err(Error::Mistake(format!("{cell}: one cell is expected here")));
        };
        let units = self.units(bus, axis)?;
        Ok(Reading::of(&find(bus, (axis, units), location)?))
    }

    /// Writes a cell: `nsoll=1500rpm`, `nsoll=0x161E`, `Status=80`. A cell with a unit takes a number with its unit, or bytes behind `0x`;
    /// any other cell takes hexadecimal bytes.
    ///
    /// # Errors
    /// The cell cannot be written or cannot hold the value, the rig's file denies it, or the drive does not answer.
    pub fn write(&self, axis: u16, value: &str) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        let texts = [value.to_owned()];
        let wrong = |problems| mistake(value, &problems);
        let values = assignments(&texts).map_err(wrong)?;
        let bytes = encode(&texts, &values, self.units(bus, axis)?).map_err(wrong)?;
        for ((location, _), bytes) in values.iter().zip(bytes) {
            write(bus, axis, location, &bytes)?;
        }
        Ok(())
    }

    /// Reads the mode and the error of a drive (ND21 11.8, 14.4).
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn state(&self, axis: u16) -> Result<State, Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.state(axis)?)
    }

    /// Confirms the error of a drive (`DeleteError`, ND21 12.4). Where the cause is still there, the error comes back.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn delete_error(&self, axis: u16) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.delete_error(axis)?)
    }

    /// Releases and starts a drive (`Go`, ND21 12.4): its motor follows the nominal speed from now on.
    ///
    /// # Errors
    /// There is no such drive, the rig's file denies motion, or the drive does not answer.
    pub fn go(&self, axis: u16) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.go(axis)?)
    }

    /// Stops a drive (`Stop`, ND21 12.4): its motor brakes and is held.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn stop(&self, axis: u16) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.stop(axis)?)
    }

    /// Blocks a drive (`Block`, ND21 12.4): its motor is without current.
    ///
    /// # Errors
    /// There is no such drive, or it does not answer.
    pub fn block(&self, axis: u16) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.block(axis)?)
    }

    /// Lets time pass while the bus stays at work. Simulated time passes at once.
    pub fn wait(&self, time: Duration) {
        let nanos = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        if let Some(bus) = &self.bus {
            bus.run(Span::from_nanos(nanos));
        }
    }

    /// Takes a rig to its safe state and gives it back: every drive stands and is blocked. A drop does the same and reports nothing.
    ///
    /// # Errors
    /// The safe state is not confirmed: switch the power off.
    pub fn close(mut self) -> Result<(), Error> {
        match self.end() {
            Some(end) if end.is_unsafe() => Err(Error::Rig(end.to_string())),
            _ => Ok(()),
        }
    }

    fn end(&mut self) -> Option<rig::End> {
        if let Some(bus) = self.bus.take() {
            bus.close();
        }
        self.rig.take()?.close(false)
    }

    fn drive(&self, axis: u16) -> Result<(&OpenRings<'static>, Axis), Error> {
        let known = || {
            let axes = self.axes();
            let last = axes.last().copied().unwrap_or_default();
            Error::Mistake(format!("there is no drive {axis}: 0 to {last} expected"))
        };
        let found = self.bus.as_ref().zip(Axis::from_number(axis));
        found
            .filter(|(bus, axis)| bus.axes().contains(axis))
            .ok_or_else(known)
    }

    /// What the scales of a drive's cells depend on (14.3.2).
    fn units(&self, bus: &OpenRings<'_>, axis: Axis) -> Result<units::DriveUnits, Error> {
        Ok(units_of(&self.plan, bus, axis)?)
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        let _nobody_to_tell = self.end();
    }
}

/// What was read from a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    bytes: Vec<u8>,
    number: Option<f64>,
    unit: &'static str,
    text: String,
}

impl Reading {
    fn of(found: &CellFound<'_>) -> Self {
        Self {
            bytes: found.bytes.clone(),
            number: found.number().as_f64(),
            unit: found.unit(),
            text: found.text(),
        }
    }

    /// The bytes, the highest first.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The value in its [unit](Self::unit); `None` for a cell that holds no number.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        self.number
    }

    /// The unit of the value, such as `rpm`; empty if there is none.
    #[must_use]
    pub fn unit(&self) -> &'static str {
        self.unit
    }
}

impl fmt::Display for Reading {
    /// Bytes with value or bits: `0652 (428.44 rpm)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
