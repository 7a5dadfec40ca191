//! What the simulated drives of a run are made of.

use crate::buses::Bus;
use crate::buses::unitek::rig::axes;
use crate::buses::unitek::serve;
use crate::buses::unitek::simulate::Setup;
use crate::explore::ExploreError;
use crate::rig::Rig;
use crate::scenario::source::Source;
use harness_proto::unitek::properties::Properties;
use harness_sim::unitek::deviation::deviation;
use serde::{Deserialize, Serialize};

/// The header of a simulated segment, and what is planted in its drives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameSetup {
    /// The name of the bus, by which a finding is known.
    pub bus: String,
    /// Header lines about the segment and its drives, without deviations.
    pub header: Vec<String>,
    /// What is planted in the drives under test, and not in their model.
    #[serde(default)]
    pub deviates: Vec<PlantedDrive>,
}

/// A deviation of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantedDrive {
    /// The drive's number.
    pub drive: u8,
    /// The name of the deviation.
    pub name: String,
}

impl PlantedDrive {
    /// As a header line.
    #[must_use]
    pub fn line(&self) -> String {
        format!("drive {} deviates {}", self.drive, self.name)
    }
}

impl FrameSetup {
    /// A segment with these header lines.
    #[must_use]
    pub fn new(header: Vec<String>, deviates: Vec<PlantedDrive>) -> Self {
        Self {
            bus: Bus::Unitek.name().to_owned(),
            header,
            deviates,
        }
    }

    /// The segment of a simulated rig, with more deviations than its file plants.
    #[must_use]
    pub fn of_rig(rig: &Rig, more: Vec<PlantedDrive>) -> Self {
        let port = rig.port();
        let rate = port.map(|port| format!("rate {}", port.rate));
        let drives = port.map(axes).unwrap_or_default();
        let drives = drives
            .iter()
            .map(|own| format!("drive {} rx {:03X} tx {:03X}", own.node, own.rx, own.tx));
        let lines = rig.file.sim.iter().flat_map(|sim| sim.setup.clone());
        let planted = |line: &String| {
            let words: Vec<_> = line.split_whitespace().collect();
            match words[..] {
                ["drive", drive, "deviates", name] => Some(PlantedDrive {
                    drive: drive.parse().ok()?,
                    name: name.to_owned(),
                }),
                _ => None,
            }
        };
        let (own, others): (Vec<_>, Vec<_>) = lines.partition(|line| planted(line).is_some());
        let mut deviates: Vec<_> = own.iter().filter_map(planted).collect();
        deviates.extend(more);
        Self::new(
            rate.into_iter().chain(drives).chain(others).collect(),
            deviates,
        )
    }

    /// The drives under test.
    ///
    /// # Errors
    /// The header has mistakes, or a deviation or its drive does not exist.
    pub fn under_test(&self) -> Result<Setup, ExploreError> {
        let source = Source {
            name: "the header of the drives".to_owned(),
            text: self.header.join("\n").into(),
        };
        let plan = serve::bench(Some(0), Some(&source)).map_err(Box::new)?;
        let mut setup = plan.setup.setup;
        for planted in &self.deviates {
            let known = deviation(&planted.name).ok_or_else(|| {
                ExploreError::Usage(format!(
                    "UNITEK drives have no deviation `{}`; `drivebench deviations --bus unitek` lists them",
                    planted.name
                ))
            })?;
            let drive = setup
                .drives
                .iter_mut()
                .find(|own| own.node == planted.drive);
            let drive = drive.ok_or_else(|| {
                ExploreError::Usage(format!("the rig has no drive {}", planted.drive))
            })?;
            drive.deviation = Some(known);
        }
        Ok(setup)
    }
}

/// The same drives as the manual has them, each with these properties.
#[must_use]
pub fn model(under_test: &Setup, properties: &[Properties]) -> Setup {
    let mut model = under_test.clone();
    for (drive, own) in model.drives.iter_mut().zip(properties) {
        drive.deviation = None;
        drive.properties = *own;
    }
    model
}
