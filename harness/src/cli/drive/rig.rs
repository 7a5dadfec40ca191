//! The benches that commands on drives know, simulated ones as yet: `sim:3`, and `sim:2,3` with two rings.

use super::args::RigArguments;
use super::failure::Failure;
use crate::bus::{Axis, Bus, Options};
use crate::link::SimulatedLink;
use crate::rig::sim::all_nd21;
use crate::scenario::parse::parse_setup;
use crate::scenario::plan::{Plan, plan};
use crate::scenario::simulate;
use crate::scenario::source::Source;
use harness_proto::nd21::units::Drive;
use harness_proto::time::Span;
use std::path::Path;
use std::str::FromStr;

/// The drives of a simulated bench of which nothing else is said: released and started by their inputs.
const RELEASED: &str = "drive 0..last input GPIN3 GPIN5 high\n";

/// How long a simulated bench has been switched on when a command comes to it: the self-tests are over (11.8).
const WARM: Span = Span::from_millis(200);

/// The name of a bench.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RigName {
    /// Simulated rings of so many drives.
    Simulated(Vec<u8>),
}

impl FromStr for RigName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some(sizes) = text.strip_prefix("sim:") else {
            return Err(format!(
                "there is no bench `{text}`: the commands on drives know simulated benches only, as yet: \
                 sim:N, a simulated ring of N drives (sim:3), and sim:N,M, two of them (sim:2,3)"
            ));
        };
        crate::rig::find::sizes(sizes).map(Self::Simulated)
    }
}

/// A bench that has been opened.
pub(super) struct Bench {
    pub(super) bus: Bus<'static>,
    plan: Plan,
}

impl Bench {
    /// What the scales of a drive's cells depend on: its type, which the bench knows, and its range of speeds,
    /// which the drive is asked for (14.3.2).
    pub(super) fn units(&self, axis: Axis) -> Result<Drive, Failure> {
        Ok(Drive {
            range: self.bus.speed_range(axis)?,
            ..self.plan.units(axis.ring(), axis.drive())
        })
    }
}

/// Opens a bench.
pub(super) fn open(arguments: &RigArguments) -> Result<Bench, Failure> {
    let (plan, link) = link(arguments)?;
    let bus = Bus::open(Box::new(link), &plan.rings, Options::default())?;
    bus.run(WARM);
    Ok(Bench { bus, plan })
}

/// The link to a bench, with nothing sent on it.
pub(super) fn link(arguments: &RigArguments) -> Result<(Plan, SimulatedLink), Failure> {
    let given = arguments
        .rig
        .as_ref()
        .map(|RigName::Simulated(sizes)| sizes);
    let sizes = given.cloned().unwrap_or_else(|| vec![3]);
    let source = match &arguments.setup {
        Some(path) => read(path)?,
        None => released(&sizes),
    };
    let mut scenario = parse_setup(&source, &sizes)?;
    if let Some(sizes) = given {
        if sizes.len() != scenario.rings.len() {
            return Err(Failure::refused(format!(
                "{} is for {} ring(s), the bench has {}",
                source.name,
                scenario.rings.len(),
                sizes.len()
            )));
        }
        for (range, size) in scenario.rings.iter_mut().zip(sizes) {
            range.default = *size;
        }
    }
    all_nd21(&mut scenario);
    let plan = plan(&scenario, &source, None)?;
    let mut link = simulate::bench(&plan);
    link.stop_recording();
    Ok((plan, link))
}

fn read(path: &Path) -> Result<Source, Failure> {
    Source::read(path).map_err(|error| Failure::File(error.into()))
}

/// The header of a bench of which nothing is said.
fn released(sizes: &[u8]) -> Source {
    let second = RELEASED.replace("0..last", "2:0..last");
    let text = match sizes {
        [_, _] => format!("{RELEASED}{second}"),
        _ => RELEASED.to_owned(),
    };
    Source {
        name: "the simulated bench".to_owned(),
        text: text.into(),
    }
}
