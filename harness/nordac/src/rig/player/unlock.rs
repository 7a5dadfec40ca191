//! What in the rig's file would let a scenario be played that is skipped.

use super::{Player, RigScenario};
use crate::rig::known::{INTERFACE, KnownInverters};
use crate::rig::{MASTER, RigSlave};
use harness_bench::scenario::run::Unlock;
use harness_proto::limit::LimitSetting;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::guard::{Highest, Limits};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A setting of `[limits]` that can keep a scenario from being played.
#[derive(Clone, Copy)]
enum Setting {
    Unsupervised,
    OtherStations,
    MotorData,
    BusSettings,
    Eeprom,
    Motion,
    Highest,
    MostWrites,
}

impl Setting {
    const ALL: [Self; 8] = [
        Self::Unsupervised,
        Self::OtherStations,
        Self::MotorData,
        Self::BusSettings,
        Self::Eeprom,
        Self::Motion,
        Self::Highest,
        Self::MostWrites,
    ];

    /// Limits with this setting of others.
    const fn of(self, from: &Limits, mut into: Limits) -> Limits {
        match self {
            Self::Unsupervised => into.unsupervised = from.unsupervised,
            Self::OtherStations => into.other_stations = from.other_stations,
            Self::MotorData => into.motor_data = from.motor_data,
            Self::BusSettings => into.bus_settings = from.bus_settings,
            Self::Eeprom => into.eeprom = from.eeprom,
            Self::Motion => into.motion = from.motion,
            Self::Highest => into.highest = from.highest,
            Self::MostWrites => into.most_writes = from.most_writes,
        }
        into
    }

    /// The change of the rig's file, where these are its limits.
    const fn unlock(self, limits: &Limits) -> Unlock {
        Unlock::PortLimit(match self {
            Self::Motion => return Unlock::Limit(LimitSetting::Motion),
            Self::Eeprom => return Unlock::Limit(LimitSetting::Eeprom),
            Self::Unsupervised => "`allow_unsupervised`",
            Self::OtherStations => "`allow_other_stations`",
            Self::MotorData => "`allow_motor_data`",
            Self::BusSettings => "`allow_bus_settings`",
            Self::Highest => match limits.highest {
                Some(Highest::Frequency(_)) => "no `max_frequency`",
                _ => "no `max_setpoint`",
            },
            Self::MostWrites => "a higher `max_eeprom_writes`",
        })
    }
}

impl Player {
    /// What in the rig's file would together let a scenario be played, as far as the model shows it: with all of this it is played, with less of
    /// it is not. Nothing where no file would.
    pub(super) fn unlocks(&self, scenario: &RigScenario) -> BTreeSet<Unlock> {
        let Some((mut other, mut unlocks)) = self.at_another_port(scenario) else {
            return BTreeSet::new();
        };
        if other.rehearsed(scenario).is_err() {
            return BTreeSet::new();
        }
        for setting in Setting::ALL {
            let less = setting.of(&self.limits, other.limits);
            if less == other.limits {
                continue;
            }
            let more = std::mem::replace(&mut other.limits, less);
            if other.rehearsed(scenario).is_err() {
                other.limits = more;
                unlocks.insert(setting.unlock(&self.limits));
            }
        }
        unlocks
    }

    /// The same rig without limits, at a line with the rate of a scenario, and with its slaves; and what in `[port.1]` is changed for that.
    /// A slave of which nothing was read is as delivered, with the bus in control. `None` where no rig has
    /// such a slave, or where its parameters cannot be read.
    fn at_another_port(&self, scenario: &RigScenario) -> Option<(Self, BTreeSet<Unlock>)> {
        let setup = &scenario.plan.setup;
        let mut other = Self::of(
            self.slaves.clone(),
            self.rate,
            self.patience,
            Limits::unlimited(),
            self.capabilities.clone(),
            self.restarts,
        );
        other.beats = self.beats.clone();
        let mut unlocks = BTreeSet::new();
        if scenario.header.rate.is_some() && setup.rate != self.rate {
            other.rate = setup.rate;
            unlocks.insert(Unlock::Port(format!("`rate = {}`", setup.rate.name())));
        }
        let mut all = self.known().to_vec();
        for slave in &setup.slaves {
            let address = slave.address;
            let listed = all.iter().find(|known| known.slave.address == address);
            let fits = |ppo: PpoType| ppo.has_pkw() && other.may_switch(ppo, slave.ppo);
            if listed.is_some_and(|known| fits(known.ppo())) {
                continue;
            }
            // The bench's own master has its address.
            if address == MASTER {
                return None;
            }
            let ppo = [slave.ppo, PpoType::default()]
                .into_iter()
                .find(|ppo| fits(*ppo))?;
            let wanted = RigSlave {
                address,
                ppo: Some(ppo),
            };
            let mut known = listed
                .cloned()
                .unwrap_or_else(|| KnownInverters::new(wanted));
            known.slave = wanted;
            if known.values.is_empty() {
                Arc::make_mut(&mut known.values).insert((INTERFACE, 0), 2);
            }
            all.retain(|known| known.slave.address != address);
            all.push(known);
            let ppo = ppo.number();
            let words = format!("a drive `{{ address = {address}, ppo = {ppo} }}`");
            unlocks.insert(Unlock::Port(words));
        }
        other.known = Some(all);
        Some((other, unlocks))
    }
}
