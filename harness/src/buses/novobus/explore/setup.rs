//! How the simulated rings of a case are made: the header lines that its scenario has, and the deviations that are planted.

use super::case::Case;
use super::play::{Seen, play};
use super::text::{Page, head};
use crate::library::Entry;
use crate::link::SimulatedLink;
use crate::rig::Rig;
use crate::scenario::problem::Problems;
use crate::scenario::simulate;
use crate::scenario::source::Source;
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::novobus::deviation;
use serde::{Deserialize, Serialize};

/// The lines that make every drive of a ring a whole ND21.
const ALL_ND21: [&str; 2] = ["drive 0..last model nd21", "drive 2:0..last model nd21"];

/// A deviation that is planted in a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Planted {
    /// In which ring, counted from 0.
    #[serde(default, skip_serializing_if = "is_first")]
    pub ring: usize,
    /// Which drive.
    pub drive: u8,
    /// The name of the deviation.
    pub name: String,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde calls it with a reference"
)]
pub(crate) const fn is_first(ring: &usize) -> bool {
    *ring == 0
}

impl Planted {
    /// The line of a header.
    #[must_use]
    pub fn line(&self) -> String {
        let drive = drive_name(self.ring, self.drive);
        format!("drive {drive} deviates {}", self.name)
    }
}

/// What simulated rings are made of.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Lines of a header, without deviations.
    #[serde(default)]
    pub header: Vec<String>,
    /// What is planted in the ring under test, and not in its model.
    #[serde(default)]
    pub deviates: Vec<Planted>,
}

impl Setup {
    /// The rings of a simulated rig, with more deviations than its file plants. `sim:N` says nothing of its drives: they are plain,
    /// which the reference model knows too, unless a deviation needs a whole ND21 or `whole` asks for it.
    #[must_use]
    pub fn of_rig(rig: &Rig, more: &[Planted], whole: bool) -> Self {
        let own = rig.file.sim.iter().flat_map(|sim| &sim.setup);
        let (planted, mut header): (Vec<_>, Vec<_>) =
            own.cloned().partition(|line| line.contains(" deviates "));
        let mut deviates: Vec<_> = planted
            .iter()
            .flat_map(|line| planted_by(line, rig))
            .collect();
        deviates.extend_from_slice(more);
        let says_model = header.iter().any(|line| line.contains(" model "));
        let behind = |planted: &Planted| {
            deviation::deviation(&planted.name).is_some_and(|known| known.behind_the_bus)
        };
        let nothing_said = rig.is_simulated() && rig.id().starts_with("sim-");
        if !says_model {
            if nothing_said && !whole && !deviates.iter().any(behind) {
                header.clear();
            } else {
                header.splice(0..0, all_nd21(rig.rings().count()));
            }
        }
        Self { header, deviates }
    }

    /// Adds a hidden deviation: the model has it as well.
    #[must_use]
    pub fn hides(mut self, planted: &Planted) -> Self {
        self.header.push(planted.line());
        self
    }

    /// The model of a rig with ports and this number of rings.
    #[must_use]
    pub fn of_ports(rings: usize) -> Self {
        Self {
            header: all_nd21(rings),
            deviates: Vec::new(),
        }
    }

    /// The setup of one ring, as for a bench without another; the ring is counted from 0.
    #[must_use]
    pub fn of_ring(&self, ring: usize) -> Self {
        let own = |line: &String| match (line.strip_prefix("drive 2:"), ring) {
            (None, 0) => Some(line.clone()),
            (Some(rest), 1) => Some(format!("drive {}", rest.trim_start())),
            _ => None,
        };
        let planted = self.deviates.iter().filter(|own| own.ring == ring);
        Self {
            header: self.header.iter().filter_map(own).collect(),
            deviates: planted
                .map(|own| Planted {
                    ring: 0,
                    ..own.clone()
                })
                .collect(),
        }
    }

    /// Whether the drives have no setup: these are what the reference model describes.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.header.is_empty()
    }

    /// The first line that sets a bus property that the manual leaves open. The reference model, which judges if no deviation is planted,
    /// knows only the defaults.
    #[must_use]
    pub fn sets_property(&self) -> Option<&str> {
        let sets = |line: &&String| {
            let (_, setting) = line.split_once(" property ")?;
            let name = setting.split(['=', ' ']).find(|word| !word.is_empty())?;
            PROPERTIES.iter().find(|known| known.name == name)
        };
        let line = self.header.iter().find(|line| sets(line).is_some());
        line.map(String::as_str)
    }

    /// The lines with the deviations.
    #[must_use]
    pub fn lines_with_deviations(&self) -> Vec<String> {
        let planted = self.deviates.iter().map(Planted::line);
        self.header.iter().cloned().chain(planted).collect()
    }

    /// The model: rings of these sizes without deviations.
    ///
    /// # Errors
    /// The lines have mistakes, or name drives that these rings do not have.
    pub fn model(&self, sizes: &[u8]) -> Result<SimulatedLink, Box<Problems>> {
        rings(sizes, &self.header)
    }

    /// The rings under test.
    ///
    /// # Errors
    /// The same.
    pub fn under_test(&self, sizes: &[u8]) -> Result<SimulatedLink, Box<Problems>> {
        rings(sizes, &self.lines_with_deviations())
    }

    /// What the model answers.
    ///
    /// # Errors
    /// The same.
    pub fn model_answers(&self, case: &Case) -> Result<Seen, Box<Problems>> {
        Ok(play(&mut self.model(&case.sizes())?, case))
    }
}

/// A drive as a scenario writes it: `3`, or `2:3` in ring 2; the ring is counted from 0.
pub(crate) fn drive_name(ring: usize, drive: u8) -> String {
    let prefix = if ring == 0 { "" } else { "2:" };
    format!("{prefix}{drive}")
}

fn all_nd21(rings: usize) -> Vec<String> {
    let lines = ALL_ND21.iter().take(rings);
    lines.map(|line| (*line).to_owned()).collect()
}

/// The deviations of a header line, drive by drive.
fn planted_by(line: &str, rig: &Rig) -> Vec<Planted> {
    let Some((whom, name)) = line.split_once(" deviates ") else {
        return Vec::new();
    };
    let whom = whom.trim().trim_start_matches("drive").trim();
    let (ring, whom) = match whom.strip_prefix("2:") {
        Some(whom) => (1, whom),
        None => (0, whom),
    };
    let Some((_, own)) = rig.rings().nth(ring) else {
        return Vec::new();
    };
    let last = own.drives.saturating_sub(1);
    let (from, to) = whom.split_once("..").unwrap_or((whom, whom));
    let number = |text: &str| match text.trim() {
        "last" | "N-1" => Some(last),
        other => other.parse::<u8>().ok(),
    };
    let (Some(from), Some(to)) = (number(from), number(to)) else {
        return Vec::new();
    };
    let name = name.split('#').next().unwrap_or_default().trim();
    let planted = |drive| Planted {
        ring,
        drive,
        name: name.to_owned(),
    };
    (from..=to.min(last)).map(planted).collect()
}

fn rings(sizes: &[u8], header: &[String]) -> Result<SimulatedLink, Box<Problems>> {
    let page = Page {
        title: "rings",
        header,
        ..Page::default()
    };
    let entry = Entry::new(
        Source {
            name: "the rig".to_owned(),
            // A scenario has a step.
            text: (head(sizes, false, &page) + "\n> 80\n").into(),
        },
        None,
    )?;
    // Novobus is the bus where none is named.
    Ok(entry
        .plan
        .as_ref()
        .map_or_else(|| SimulatedLink::new(Default::default()), simulate::bench))
}
