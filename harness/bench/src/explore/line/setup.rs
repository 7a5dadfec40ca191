//! What the simulated drives of a run are made of.

use super::LineBus;
use crate::explore::{ExploreError, Planted};
use crate::rig::Rig;
use crate::rig::session::setup_lines;
use crate::scenario::source::Source;
use serde::{Deserialize, Serialize};

/// The header of a simulated line, and what is planted in its drives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineSetup {
    /// The name of the bus, by which a finding is known.
    pub bus: String,
    /// Header lines about the line and its drives, without deviations.
    pub header: Vec<String>,
    /// What is planted in the drives under test, and not in their model.
    #[serde(default)]
    pub deviates: Vec<Planted>,
}

impl Planted {
    /// As a header line of a shared line.
    #[must_use]
    pub fn line<B: LineBus>(&self) -> String {
        format!("{} {} deviates {}", B::DRIVE, self.drive, self.name)
    }

    /// The deviation of a header line; `None` for any other line.
    fn of_line<B: LineBus>(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split_whitespace().collect();
        match words[..] {
            [word, drive, "deviates", name] if word == B::DRIVE => Some(Self {
                ring: 0,
                drive: drive.parse().ok()?,
                name: name.to_owned(),
            }),
            _ => None,
        }
    }
}

impl LineSetup {
    /// A line with these header lines. Deviations among them are planted in the drives under test.
    #[must_use]
    pub fn new<B: LineBus>(header: Vec<String>, more: Vec<Planted>) -> Self {
        let planted = |line: &String| Planted::of_line::<B>(line);
        let (deviations, others): (Vec<_>, Vec<_>) =
            header.into_iter().partition(|line| planted(line).is_some());
        let mut deviates: Vec<_> = deviations.iter().filter_map(planted).collect();
        deviates.extend(more);
        Self {
            bus: B::BUS.name().to_owned(),
            header: others,
            deviates,
        }
    }

    /// The line of a rig, with more deviations than its file plants.
    #[must_use]
    pub fn of_rig<B: LineBus>(rig: &Rig, stations: &[B::Station], more: Vec<Planted>) -> Self {
        let lines = B::header(rig, stations).into_iter().chain(setup_lines(rig));
        Self::new::<B>(lines.collect(), more)
    }

    /// The drives under test.
    ///
    /// # Errors
    /// The header has mistakes, or a deviation or its drive does not exist.
    pub fn under_test<B: LineBus>(&self) -> Result<B::Setup, ExploreError> {
        let source = Source {
            name: format!("the header of the {}s", B::DRIVE),
            text: self.header.join("\n").into(),
        };
        let mut setup = B::simulated(&source).map_err(Box::new)?;
        for Planted { drive, name, .. } in &self.deviates {
            let (kind, bus) = (B::DRIVES, B::BUS.name());
            match B::plant(&mut setup, *drive, name) {
                Some(true) => {}
                Some(false) => {
                    let missing = format!("the rig has no {} {drive}", B::DRIVE);
                    return Err(ExploreError::Usage(missing));
                }
                None => {
                    return Err(ExploreError::Usage(format!(
                        "{kind} have no deviation `{name}`; `drivebench deviations --bus {bus}` lists them"
                    )));
                }
            }
        }
        Ok(setup)
    }
}
