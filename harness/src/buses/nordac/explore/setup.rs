//! What the simulated slaves of a run are made of.

use crate::buses::Bus;
use crate::buses::nordac::rig::{rate, slaves};
use crate::buses::nordac::serve;
use crate::buses::nordac::simulate::Setup;
use crate::explore::ExploreError;
use crate::rig::Rig;
use crate::scenario::source::Source;
use harness_proto::nordac::Properties;
use harness_sim::nordac::deviation::deviation;
use serde::{Deserialize, Serialize};

/// The header of a simulated line, and what is planted in its slaves.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TelegramSetup {
    /// The name of the bus, by which a finding is known.
    pub bus: String,
    /// Header lines about the line and its slaves, without deviations.
    pub header: Vec<String>,
    /// What is planted in the slaves under test, and not in their model.
    #[serde(default)]
    pub deviates: Vec<PlantedSlave>,
}

/// A deviation of a slave.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantedSlave {
    /// The slave's address.
    pub slave: u8,
    /// The name of the deviation.
    pub name: String,
}

impl PlantedSlave {
    /// As a header line.
    #[must_use]
    pub fn line(&self) -> String {
        format!("slave {} deviates {}", self.slave, self.name)
    }

    /// The deviation of a header line; `None` for any other line.
    #[must_use]
    pub fn of_line(line: &str) -> Option<Self> {
        let words: Vec<_> = line.split_whitespace().collect();
        match words[..] {
            ["slave", slave, "deviates", name] => Some(Self {
                slave: slave.parse().ok()?,
                name: name.to_owned(),
            }),
            _ => None,
        }
    }
}

impl TelegramSetup {
    /// A line with these header lines. Deviations among them are planted in the slaves under test.
    #[must_use]
    pub fn new(header: Vec<String>, more: Vec<PlantedSlave>) -> Self {
        let planted = |line: &String| PlantedSlave::of_line(line);
        let (own, others): (Vec<_>, Vec<_>) =
            header.into_iter().partition(|line| planted(line).is_some());
        let mut deviates: Vec<_> = own.iter().filter_map(planted).collect();
        deviates.extend(more);
        Self {
            bus: Bus::Nordac.name().to_owned(),
            header: others,
            deviates,
        }
    }

    /// The line of a simulated rig, with more deviations than its file plants.
    #[must_use]
    pub fn of_rig(rig: &Rig, more: Vec<PlantedSlave>) -> Self {
        let port = rig.port();
        let rate = port.map(|port| format!("rate {}", rate(port).name()));
        let own = port.map(slaves).unwrap_or_default();
        let own = own.iter().flat_map(|own| {
            let (address, ppo) = (own.address, own.ppo.unwrap_or_default().number());
            let there = format!("slave {address} ppo {ppo}");
            [there, format!("slave {address} parameter 1621 = 2")]
        });
        let lines = rig.file.sim.iter().flat_map(|sim| sim.setup.clone());
        Self::new(rate.into_iter().chain(own).chain(lines).collect(), more)
    }

    /// The slaves under test.
    ///
    /// # Errors
    /// The header has mistakes, or a deviation or its slave does not exist.
    pub fn under_test(&self) -> Result<Setup, ExploreError> {
        let source = Source {
            name: "the header of the slaves".to_owned(),
            text: self.header.join("\n").into(),
        };
        let plan = serve::bench(Some(&[]), Some(&source)).map_err(Box::new)?;
        let mut setup = plan.setup;
        for planted in &self.deviates {
            let known = deviation(&planted.name).ok_or_else(|| {
                ExploreError::Usage(format!(
                    "NORDAC inverters have no deviation `{}`; `drivebench deviations --bus nordac` lists them",
                    planted.name
                ))
            })?;
            let mut slaves = setup.slaves.iter_mut();
            let slave = slaves.find(|own| own.address == planted.slave);
            let slave = slave.ok_or_else(|| {
                ExploreError::Usage(format!("the rig has no slave {}", planted.slave))
            })?;
            slave.deviation = Some(known);
        }
        Ok(setup)
    }
}

/// The same slaves as the manual has them, each with these properties.
#[must_use]
pub fn model(under_test: &Setup, properties: &[Properties]) -> Setup {
    let mut model = under_test.clone();
    model.master = None;
    for (slave, own) in model.slaves.iter_mut().zip(properties) {
        slave.deviation = None;
        slave.properties = *own;
    }
    model
}
