//! How the simulated rings of a case are made: the header lines that its scenario has, and the deviations that are planted.

use super::case::Case;
use super::play::{Seen, play};
use super::text::{Page, text};
use crate::library::Entry;
use crate::link::SimulatedLink;
use crate::rig::Rig;
use crate::scenario::problem::Problems;
use crate::scenario::simulate;
use crate::scenario::source::Source;
use harness_sim::deviation;
use serde::{Deserialize, Serialize};

/// The line that makes every drive a whole ND21.
const ALL_ND21: &str = "drive 0..last model nd21";

/// A deviation that is planted in a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Planted {
    /// Which drive.
    pub drive: u8,
    /// The name of the deviation.
    pub name: String,
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
                header.insert(0, ALL_ND21.to_owned());
            }
        }
        Self { header, deviates }
    }

    /// The model of a rig with ports.
    #[must_use]
    pub fn of_ports() -> Self {
        Self {
            header: vec![ALL_ND21.to_owned()],
            deviates: Vec::new(),
        }
    }

    /// Whether nothing is said of the drives: the reference model is one of them.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.header.is_empty()
    }

    /// The lines with the deviations.
    #[must_use]
    pub fn lines_with_deviations(&self) -> Vec<String> {
        let planted = self.deviates.iter();
        let planted = planted.map(|p| format!("drive {} deviates {}", p.drive, p.name));
        self.header.iter().cloned().chain(planted).collect()
    }

    /// The model: a ring of `drives` without deviations.
    ///
    /// # Errors
    /// The lines have mistakes, or speak of drives that this ring has not.
    pub fn model(&self, drives: u8) -> Result<SimulatedLink, Box<Problems>> {
        ring(drives, &self.header)
    }

    /// The ring under test.
    ///
    /// # Errors
    /// The same.
    pub fn under_test(&self, drives: u8) -> Result<SimulatedLink, Box<Problems>> {
        ring(drives, &self.lines_with_deviations())
    }

    /// What the model answers.
    ///
    /// # Errors
    /// The same.
    pub fn model_answers(&self, case: &Case) -> Result<Seen, Box<Problems>> {
        Ok(play(&mut self.model(case.drives)?, case))
    }
}

/// The deviations of a header line, drive by drive.
fn planted_by(line: &str, rig: &Rig) -> Vec<Planted> {
    let drives = rig.file.ring.first.drives;
    let Some((whom, name)) = line.split_once(" deviates ") else {
        return Vec::new();
    };
    let whom = whom.trim().trim_start_matches("drive").trim();
    let (from, to) = whom.split_once("..").unwrap_or((whom, whom));
    let number = |text: &str| match text.trim() {
        "last" | "N-1" => Some(drives.saturating_sub(1)),
        other => other.parse::<u8>().ok(),
    };
    let (Some(from), Some(to)) = (number(from), number(to)) else {
        return Vec::new();
    };
    let name = name.split('#').next().unwrap_or_default().trim();
    let planted = |drive| Planted {
        drive,
        name: name.to_owned(),
    };
    (from..=to.min(drives.saturating_sub(1)))
        .map(planted)
        .collect()
}

fn ring(drives: u8, header: &[String]) -> Result<SimulatedLink, Box<Problems>> {
    let case = Case {
        drives,
        acts: Vec::new(),
    };
    let page = Page {
        title: "a ring",
        header,
        ..Page::default()
    };
    let entry = Entry::new(
        Source {
            name: "the rig".to_owned(),
            // A scenario has a step.
            text: (text(&case, &page) + "> 80\n").into(),
        },
        None,
    )?;
    // Novobus is the bus where none is named.
    Ok(entry
        .plan
        .as_ref()
        .map_or_else(|| SimulatedLink::new(Default::default()), simulate::bench))
}
