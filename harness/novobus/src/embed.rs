//! Drives and served rings for other programs.

use crate::driver::cell::{find, write};
use crate::driver::{self, Axis, OpenRings};
use crate::drives::{released_header, simulated, units_of};
use crate::language::argument::{assignments, cells, encode};
use crate::language::plan::Plan;
use crate::link::SimulatedLink;
use crate::rig::shared::Shared;
use crate::rig::sim::RigOfRings as _;
use crate::rig::{OfRings as _, session};
use crate::serve::Server;
use harness_bench::embed::{AxisCommand, AxisDrives, Embedding, Error, Reading};
use harness_bench::medium::ErrorMarks;
use harness_bench::rig::{End, Rig, UseOptions};
use harness_bench::scenario::problem::{Problem, Problems};
use harness_bench::scenario::source::Source;
use harness_bench::serve::{Pace, ServeOptions, ServedAt, ServedThread};
use harness_proto::nd21::State;
use harness_proto::nd21::units::DriveUnits;
use harness_proto::time::Span;
use std::fmt;
use std::time::Duration;

pub(crate) const EMBEDDING: Embedding = Embedding {
    simulated: |drives, setup| Ok(Box::new(Drives::simulated(drives, setup)?)),
    open: |rig, allow_motion| Ok(Box::new(Drives::open(rig, allow_motion)?)),
    served,
};

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
fn released(drives: u8, setup: &str) -> Result<(Plan, SimulatedLink), Error> {
    let source = match setup {
        "" => released_header(&[drives]),
        setup => Source::from_bytes("setup".to_owned(), setup.as_bytes().to_vec())?,
    };
    Ok(simulated(&source, Some(&[drives]))?)
}

fn served(drives: u8, setup: &str, address: &str) -> Result<ServedThread, Error> {
    let (plan, link) = released(drives, setup)?;
    let server = Server::new(plan, link, Pace::Line, ErrorMarks::None);
    let options = ServeOptions {
        places: vec![ServedAt::Tcp(address.to_owned())],
        ..ServeOptions::default()
    };
    Ok(ServedThread::start(server, options)?)
}

/// The drives of a rig or of a simulated ring.
struct Drives {
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
    fn simulated(drives: u8, setup: &str) -> Result<Self, Error> {
        let (plan, link) = released(drives, setup)?;
        let bus = OpenRings::open(Box::new(link), &plan.rings, driver::Options::default())?;
        bus.run(WARM);
        Ok(Self {
            bus: Some(bus),
            plan,
            rig: None,
        })
    }

    fn open(rig: &Rig, allow_motion: bool) -> Result<Self, Error> {
        let plan = rig.plan()?;
        let options = UseOptions {
            purpose: "another program".to_owned(),
            allow_motion,
            ..UseOptions::default()
        };
        let session = session::open(rig, &options)?;
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
    fn units(&self, bus: &OpenRings<'_>, axis: Axis) -> Result<DriveUnits, Error> {
        Ok(units_of(&self.plan, bus, axis)?)
    }
}

impl AxisDrives for Drives {
    fn axes(&self) -> Vec<u16> {
        let axes = self.bus.iter().flat_map(OpenRings::axes);
        axes.map(Axis::number).collect()
    }

    fn read(&self, axis: u16, cell: &str) -> Result<Reading, Error> {
        let (bus, axis) = self.drive(axis)?;
        let locations = cells(&[cell.to_owned()]).map_err(|wrong| mistake(cell, &wrong))?;
        let [location] = locations.as_slice() else {
            return Err(Error::Mistake(format!("{cell}: one cell is expected here")));
        };
        let units = self.units(bus, axis)?;
        let found = find(bus, (axis, units), location)?;
        let value = (found.number().as_f64(), found.unit());
        Ok(Reading::new(found.bytes.clone(), value, found.text()))
    }

    fn write(&self, axis: u16, value: &str) -> Result<(), Error> {
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

    fn state(&self, axis: u16) -> Result<State, Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(bus.state(axis)?)
    }

    fn command(&self, axis: u16, command: AxisCommand) -> Result<(), Error> {
        let (bus, axis) = self.drive(axis)?;
        Ok(match command {
            AxisCommand::DeleteError => bus.delete_error(axis),
            AxisCommand::Go => bus.go(axis),
            AxisCommand::Stop => bus.stop(axis),
            AxisCommand::Block => bus.block(axis),
        }?)
    }

    fn wait(&self, time: Duration) {
        let nanos = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        if let Some(bus) = &self.bus {
            bus.run(Span::from_nanos(nanos));
        }
    }

    fn close(&mut self) -> Option<End> {
        if let Some(bus) = self.bus.take() {
            bus.close();
        }
        self.rig.take()?.close(false)
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        let _nobody_to_tell = self.close();
    }
}
