//! Scenarios played on a model of the slaves first: what a right slave with these parameters would not meet, and what the limits deny, is not
//! begun.

use super::{Player, RigScenario};
use crate::language::syntax;
use crate::rig::MASTER;
use crate::rig::known::value_of;
use crate::rig::observed::{Observed, ReceivedOctets, Turn, WrittenParameter};
use crate::rig::settle::Assumptions;
use crate::rig::talk::TalkError;
use crate::simulate::Bench;
use harness_bench::link::{Line as _, Link as _, LinkEvent, Recording, Trouble};
use harness_bench::scenario::run::outcome::Unready;
use harness_bench::scenario::run::{AtMismatch, Outcome, Why, play};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::nordac::guard::Limits;
use harness_proto::nordac::words::State;
use harness_sim::nordac::History;
use std::collections::BTreeSet;

/// What a model is beside what is known of the slaves.
#[derive(Clone, Copy, Default)]
pub(super) struct ModelOptions<'o> {
    /// The properties of the slaves in place of those that are known.
    pub(super) properties: Option<&'o Assumptions>,
    /// Whether the settings of the bus are switched to those of the scenario.
    pub(super) switches: bool,
    /// What came from the slaves, where the model is played up to the first difference from it.
    pub(super) came: Option<&'o ReceivedOctets>,
    /// What the slaves keep of the time before.
    pub(super) past: Past,
}

/// What slaves keep of the time before.
#[derive(Clone, Copy, Default)]
pub(super) enum Past {
    /// What was read of them.
    #[default]
    AsRead,
    /// Nothing: they were just switched on, and never had a fault.
    Nothing,
    /// Earlier faults, the oldest first, of those that had one. Only the last one was read.
    Faults(&'static [u8]),
}

/// Two fault memories in which every place and the counters of every fault differ.
const PAST_FAULTS: [&[u8]; 2] = [
    &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13],
    &[25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14],
];

/// A scenario that the rig plays.
pub(in crate::rig) struct PlayableScenario {
    /// Whether the settings of the bus are switched to those of the scenario.
    pub(super) switches: bool,
    /// The addresses that it gives to slaves: the slave, and its new one.
    pub(in crate::rig) moved: BTreeSet<(u8, u8)>,
    pub(in crate::rig) written: BTreeSet<WrittenParameter>,
}

/// A scenario played on the model.
pub(super) struct Rehearsal {
    pub(super) outcome: Outcome,
    pub(super) denied: Option<String>,
    /// The slave that has a fault at the end.
    faulted: Option<u8>,
    /// Why the slaves could not be put back.
    lost: Option<String>,
    moved: BTreeSet<(u8, u8)>,
    written: BTreeSet<WrittenParameter>,
    /// What came from the first telegram on that makes the slaves ready.
    pub(super) came: ReceivedOctets,
    /// The telegrams of the bench, with what came after each.
    pub(super) turns: Vec<Turn>,
}

impl Rehearsal {
    pub(super) fn passes(&self) -> bool {
        self.denied.is_none() && self.outcome.verdict == Verdict::Passed
    }
}

impl Player {
    /// Plays a scenario on the model: with the settings of the bus as they are, or if that is permitted and needed with those of the scenario.
    ///
    /// # Errors
    /// Why the rig does not play it.
    pub(super) fn rehearsed(&self, scenario: &RigScenario) -> Result<PlayableScenario, Why> {
        let other = self.other_port(scenario);
        let other = other.or_else(|| self.other_properties(scenario));
        if let Some(why) = other {
            return Err(Why::OtherDrives(why));
        }
        let with = |switches| ModelOptions {
            switches,
            ..ModelOptions::default()
        };
        let first = self.rehearse_all(scenario, with(false));
        if first.passes() {
            return self.begins(first, false);
        }
        let permitted = may_switch_settings(&self.limits);
        if permitted {
            let switched = self.rehearse_all(scenario, with(true));
            if switched.passes() {
                return self.begins(switched, true);
            }
        }
        if let Some(why) = first.denied {
            return Err(Why::Denied(why));
        }
        let all = Limits {
            motion: true,
            eeprom: true,
            bus_settings: true,
            ..self.limits
        };
        let why = if !permitted && self.rehearse(scenario, &all, with(true)).passes() {
            "it is for other settings of the bus (1621, 1622) than the slaves have; the bench switches them with `allow_motion` and \
             --allow-motion, `allow_eeprom` and `allow_bus_settings`"
                .to_owned()
        } else if let Some(kept) = self.keeps_too_much(scenario, permitted) {
            kept
        } else {
            let finding = first.outcome.finding.map(|finding| finding.message);
            let remark = first.outcome.remarks.into_iter().next();
            let found = finding.or(remark).unwrap_or_default();
            format!("a right slave with the same parameters does not meet it: {found}")
        };
        Err(Why::OtherDrives(why))
    }

    /// Whether a scenario that a model meets is begun.
    ///
    /// # Errors
    /// Behind it a slave could not be put back, or stays with a fault.
    fn begins(&self, played: Rehearsal, switches: bool) -> Result<PlayableScenario, Why> {
        if let Some(why) = played.lost {
            return Err(Why::Denied(why));
        }
        match played.faulted.filter(|_| !self.acknowledges()) {
            Some(slave) => Err(left_in_fault(slave)),
            None => Ok(PlayableScenario {
                switches,
                moved: played.moved,
                written: played.written,
            }),
        }
    }

    /// Plays a scenario on the model with what was read of the slaves; where they had faults before, with other fault memories too: what these
    /// hold is not known, and a scenario that would show it is not met.
    fn rehearse_all(&self, scenario: &RigScenario, other: ModelOptions<'_>) -> Rehearsal {
        let mut played = self.rehearse(scenario, &self.limits, other);
        let had_faults = self
            .known()
            .iter()
            .any(|known| !known.history.faults.is_empty());
        for past in PAST_FAULTS.iter().filter(|_| had_faults) {
            if played.passes() {
                let past = Past::Faults(past);
                played = self.rehearse(scenario, &self.limits, ModelOptions { past, ..other });
            }
        }
        played
    }

    /// What the slaves keep of the time before, where that alone keeps a scenario from being played.
    fn keeps_too_much(&self, scenario: &RigScenario, permitted: bool) -> Option<String> {
        let kept = self.known().iter().filter_map(|known| {
            let word = known
                .history
                .stw
                .map(|word| format!("control word {word:04X} is in force (967)"));
            let fault = known.history.faults.first();
            let fault = fault.map(|fault| format!("fault {fault} was its last one (947)"));
            let all: Vec<_> = word.into_iter().chain(fault).collect();
            (!all.is_empty()).then(|| format!("slave {}: {}", known.slave.address, all.join(", ")))
        });
        let kept: Vec<_> = kept.collect();
        let past = Past::Nothing;
        let meets = |switches| {
            let other = ModelOptions {
                past,
                switches,
                ..ModelOptions::default()
            };
            self.rehearse(scenario, &self.limits, other).passes()
        };
        let fresh = !kept.is_empty() && (meets(false) || permitted && meets(true));
        fresh.then(|| {
            format!(
                "it is for a slave that was just switched on and had no fault before; {}",
                kept.join("; ")
            )
        })
    }

    /// Why slaves could not be put back after a scenario that was played on their model.
    fn loses(&self, bench: &Bench, moved: &BTreeSet<(u8, u8)>) -> Option<String> {
        let taken = |to: u8| to == MASTER || self.slaves.iter().any(|slave| slave.address == to);
        let moved = moved.iter().find(|(slave, to)| slave != to && taken(*to));
        if let Some((slave, to)) = moved {
            return Some(format!(
                "it gives slave {slave} the address {to}, which another station of the rig has: it is played with simulated slaves only"
            ));
        }
        self.known().iter().find_map(|known| {
            let slave = known.slave.address;
            let ppo = bench.drive(slave)?.inverter().settings().ppo;
            (known.ppo().has_pkw() && !ppo.has_pkw()).then(|| {
                format!(
                    "it leaves slave {slave} with PPO type {} (1622), which has no parameter channel to set it back: it is played with simulated \
                     slaves only",
                    ppo.number()
                )
            })
        })
    }

    /// What of the line and of the addresses and PPO types of its slaves is another than the scenario has, and is not switched.
    fn other_port(&self, scenario: &RigScenario) -> Option<String> {
        let bench = &scenario.plan.setup;
        for slave in &bench.slaves {
            let address = slave.address;
            let Some(known) = self.known_at(address) else {
                return Some(format!("the rig has no slave {address}"));
            };
            if !self.may_switch(known.ppo(), slave.ppo) {
                return Some(format!(
                    "slave {address} of the rig is set to another PPO type than that of the scenario, {}; the bench switches 1622 with `allow_motion`, \
                     `allow_eeprom` and `allow_bus_settings`, if it can switch it back through a parameter channel",
                    slave.ppo.number()
                ));
            }
            if !known.ppo().has_pkw() {
                return Some(format!(
                    "slave {address} is set to PPO type {}, which has no parameter channel: its parameters are not known",
                    known.ppo().number()
                ));
            }
            if slave.posicon {
                return Some(format!(
                    "slave {address} of the scenario has the option PosiCon"
                ));
            }
        }
        let other = scenario.header.rate.is_some() && bench.rate != self.rate;
        other.then(|| {
            format!(
                "the rig's line has {} kbit/s, that of the scenario {}",
                self.rate.name(),
                bench.rate.name()
            )
        })
    }

    /// The first property of the header of which a slave of the rig has another value, as far as is known.
    fn other_properties(&self, scenario: &RigScenario) -> Option<String> {
        let lines = scenario.header.slaves.iter();
        let mut named = lines.filter_map(|line| match &line.what {
            syntax::SetupKind::Property(property, _) => Some(*property),
            _ => None,
        });
        named.find_map(|property| {
            scenario.plan.setup.slaves.iter().find_map(|slave| {
                let address = slave.address;
                let known = self.known_at(address)?;
                let wanted = value_of(property, &slave.properties);
                let has = value_of(property, &known.properties);
                let name = property.name;
                let why = format!("it is for a slave with {name} = {wanted}; slave {address} has {has}, as far as is known");
                (wanted != has).then_some(why)
            })
        })
    }

    pub(super) fn rehearse(
        &self,
        scenario: &RigScenario,
        limits: &Limits,
        other: ModelOptions<'_>,
    ) -> Rehearsal {
        let known = self.known().iter().enumerate();
        let slaves = known.map(|(place, known)| {
            let properties = other.properties.and_then(|all| all.get(place));
            let mut slave = known.model(*properties.unwrap_or(&known.properties));
            slave.history = match other.past {
                Past::Nothing => History::default(),
                Past::Faults(faults) if !slave.history.faults.is_empty() => History {
                    faults: faults.to_vec(),
                    ..slave.history
                },
                _ => slave.history,
            };
            slave
        });
        let mut link = self.model(slaves.collect(), limits);
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut forgotten);
        recording.begin();
        let mut observed = Observed::new(&mut recording);
        let ready = self.prepare(scenario, &mut observed, other.switches);
        let outcome = match ready {
            Ok(_) => {
                observed.begin();
                if let Some(came) = other.came {
                    observed.noted.expect(came, observed.noted.fresh, true);
                }
                play(&scenario.plan, &mut observed, AtMismatch::Stop)
            }
            Err(TalkError::Line(trouble)) => Outcome::trouble(&trouble),
            Err(error) => {
                let remark = error.to_string();
                Outcome::not_ready(Verdict::Inconclusive, Unready::Differs, remark)
            }
        };
        let came = observed.noted.came();
        let turns = std::mem::take(&mut observed.noted.turns);
        let moved = std::mem::take(&mut observed.noted.moved);
        let written = std::mem::take(&mut observed.noted.written);
        let faulted = self.known().iter().map(|known| known.slave.address);
        let faulted = faulted.into_iter().find(|slave| {
            let drive = link.inner().drive(*slave);
            drive.is_some_and(|drive| drive.inverter().state() == State::Fault)
        });
        let denied = match link.trouble() {
            Some(Trouble::Denied(why)) => Some(why.clone()),
            _ => None,
        };
        let lost = (!self.restarts)
            .then(|| self.loses(link.inner(), &moved))
            .flatten();
        Rehearsal {
            outcome,
            denied,
            faulted,
            lost,
            moved,
            written,
            came,
            turns,
        }
    }

    /// Whether a fault that a scenario leaves behind is taken away before the next one.
    pub(super) const fn acknowledges(&self) -> bool {
        self.restarts || self.limits.motion
    }
}

/// Whether the settings of the bus may be switched for a scenario: who controls an inverter may start its motor.
pub(super) const fn may_switch_settings(limits: &Limits) -> bool {
    limits.motion && limits.eeprom && limits.bus_settings
}

/// A scenario after which an inverter has a fault is not begun where the bench may not acknowledge it: it would stay for later scenarios.
fn left_in_fault(slave: u8) -> Why {
    Why::Denied(format!(
        "it leaves slave {slave} with a fault, and to acknowledge one needs `allow_motion` in the rig's [limits] and --allow-motion"
    ))
}
