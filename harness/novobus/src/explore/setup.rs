//! How the simulated rings of a case are made: the header lines that its scenario has, and the deviations that are planted.

use super::case::Case;
use super::play::{MasterView, play};
use crate::language::plan::plan_header;
use crate::language::syntax::{DriveRange, Header, Setup as HeaderLine, SetupKind};
use crate::link::SimulatedLink;
use crate::rig::sim;
use crate::simulate;
use harness_bench::explore::Planted;
use harness_bench::rig::Rig;
use harness_bench::scenario::expression::{Located, Scope};
use harness_bench::scenario::problem::Problems;
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::novobus::deviation;
use serde::{Deserialize, Serialize};

/// The line of a header that plants a deviation.
#[must_use]
pub(super) fn planted_line(planted: &Planted) -> String {
    let drive = drive_name(planted.ring, planted.drive);
    format!("drive {drive} deviates {}", planted.name)
}

/// The same as a header; `None` where there is no such deviation.
#[must_use]
pub(crate) fn planted_setup(planted: &Planted) -> Option<HeaderLine> {
    let known = deviation::deviation(&planted.name)?;
    Some(HeaderLine::deviates(
        DriveRange::one(planted.ring, planted.drive),
        known,
    ))
}

/// What simulated rings are made of.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RingSetup {
    /// The header of the rings, without deviations; a list of its lines in a file.
    #[serde(default)]
    pub header: Header,
    /// What is planted in the ring under test, and not in its model.
    #[serde(default)]
    pub deviates: Vec<Planted>,
}

impl RingSetup {
    /// The rings of a simulated rig, with more deviations than its file plants. `sim:N` says nothing of its drives: they are plain,
    /// which the reference model knows too, unless a deviation needs a whole ND21 or `whole` asks for it.
    #[must_use]
    pub(crate) fn of_rig(rig: &Rig, more: &[Planted], whole: bool) -> Self {
        let setup = sim::setup(rig);
        let mut header = setup.only(|setup| planted_by(setup, rig).is_empty());
        let mut deviates: Vec<_> = setup
            .setups
            .iter()
            .flat_map(|setup| planted_by(setup, rig))
            .collect();
        deviates.extend_from_slice(more);
        let behind = |planted: &Planted| {
            deviation::deviation(&planted.name).is_some_and(|known| known.is_behind_the_bus())
        };
        let nothing_said = rig.is_simulated() && rig.id().starts_with("sim-");
        if !header.names_a_model() && nothing_said && !whole && !deviates.iter().any(behind) {
            header = Header::default();
        } else {
            header = header.nd21_by_default(rig.rings().count());
        }
        Self { header, deviates }
    }

    /// Adds a hidden deviation: the model has it as well.
    #[must_use]
    pub(crate) fn hides(mut self, planted: &Planted) -> Self {
        self.header.setups.extend(planted_setup(planted));
        self
    }

    /// The model of a rig with ports and this number of rings.
    #[must_use]
    pub(crate) fn of_ports(rings: usize) -> Self {
        Self {
            header: Header::whole(rings),
            deviates: Vec::new(),
        }
    }

    /// The setup of one ring, as for a bench without another; the ring is counted from 0.
    #[must_use]
    pub(crate) fn of_ring(&self, ring: usize) -> Self {
        let mut header = self.header.only(|setup| setup.drives.ring == ring);
        for setup in &mut header.setups {
            setup.drives.ring = 0;
        }
        let planted = self.deviates.iter().filter(|planted| planted.ring == ring);
        Self {
            header,
            deviates: planted
                .map(|planted| Planted {
                    ring: 0,
                    ..planted.clone()
                })
                .collect(),
        }
    }

    /// Whether the drives have no setup: these are what the reference model describes.
    #[must_use]
    pub(crate) fn is_plain(&self) -> bool {
        self.header.is_empty()
    }

    /// The first line that sets a bus property that the manual leaves open. The reference model, which judges if no deviation is planted,
    /// knows only the defaults.
    #[must_use]
    pub(crate) fn sets_property(&self) -> Option<String> {
        let of_the_bus = |name: &str| PROPERTIES.iter().any(|known| known.name == name);
        let mut setups = self.header.setups.iter();
        let first = setups.find(|setup| setup.sets().is_some_and(of_the_bus));
        first.map(ToString::to_string)
    }

    #[must_use]
    pub(crate) fn with_deviations(&self) -> Header {
        let mut header = self.header.clone();
        let planted = self.deviates.iter().filter_map(planted_setup);
        header.setups.extend(planted);
        header
    }

    /// The model: rings of these sizes without deviations.
    ///
    /// # Errors
    /// The lines have mistakes, or name drives that these rings do not have.
    pub(crate) fn model(&self, sizes: &[u8]) -> Result<SimulatedLink, Box<Problems>> {
        rings(sizes, &self.header)
    }

    /// The rings under test.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn under_test(&self, sizes: &[u8]) -> Result<SimulatedLink, Box<Problems>> {
        rings(sizes, &self.with_deviations())
    }

    /// What the model answers.
    ///
    /// # Errors
    /// The same.
    pub(crate) fn model_answers(&self, case: &Case) -> Result<MasterView, Box<Problems>> {
        Ok(play(&mut self.model(&case.sizes())?, case))
    }
}

/// A drive as a scenario writes it: `3`, or `2:3` in ring 2; the ring is counted from 0.
pub(crate) fn drive_name(ring: usize, drive: u8) -> String {
    let prefix = if ring == 0 { "" } else { "2:" };
    format!("{prefix}{drive}")
}

/// The deviations that a line of a header plants, drive by drive.
fn planted_by(setup: &HeaderLine, rig: &Rig) -> Vec<Planted> {
    let SetupKind::Deviates(deviation) = setup.what else {
        return Vec::new();
    };
    let DriveRange { ring, from, to } = &setup.drives;
    let drives = rig.rings().nth(*ring).map_or(0, |(_, ring)| ring.drives);
    let number = |end: &Located| {
        let value = end.value(Scope::new(drives.into())).ok();
        value.and_then(|value| u8::try_from(value).ok())
    };
    let (Some(from), Some(to)) = (number(from), number(to.as_ref().unwrap_or(from))) else {
        return Vec::new();
    };
    let planted = |drive| Planted {
        ring: *ring,
        drive,
        name: deviation.name.to_owned(),
    };
    let drives = from.min(to)..=from.max(to).min(drives.saturating_sub(1));
    drives.map(planted).collect()
}

fn rings(sizes: &[u8], header: &Header) -> Result<SimulatedLink, Box<Problems>> {
    let plan = plan_header("the rig", header, sizes).map_err(Box::new)?;
    Ok(simulate::bench(&plan))
}
