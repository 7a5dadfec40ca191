//! Slaves made ready for a scenario: off, with the parameters of its header, and without a master.

use super::{Player, RigScenario};
use crate::rig::known::{INTERFACE, KnownInverters, PPO_TYPE};
use crate::rig::observed::Observed;
use crate::rig::talk::{Talk, TalkError};
use crate::simulate::SlaveSetup;
use harness_bench::link::{DriveFault, Link, Moment, PlacedFault};
use harness_proto::nordac::master::ExchangeError;
use harness_proto::nordac::words::{stw, zsw};
use harness_proto::nordac::{Image, Parameter, Pkw, PpoType, Task};
use harness_proto::time::Span;

/// The word that a slave holds when a scenario begins: OFF2 and OFF3 are not active, as after power-up, and ON without enabling: an ON that
/// stands does nothing before an OFF1 (3.3, rule 2).
const IDLE: u16 = 0x0477;

/// How often it is sent: what the next reply shows may lag behind.
const IDLE_TIMES: usize = 2;

/// How often each word that acknowledges a fault is sent.
const ACKNOWLEDGED: usize = 4;

/// The watchdog by which a slave forgets its master before a scenario begins, where it may not be unlocked: 100 ms.
const FORGET: [u8; 2] = [1, 10];

/// How long that takes, at most.
const FORGOTTEN: Span = Span::from_millis(150);

impl Player {
    /// Makes the slaves ready: output off, with the parameters of the header, and without a master, as after power-up. Returns whether a fault
    /// came meanwhile, which the memory of a slave holds since then (5.7): one of a time-out, where the computer stood still before.
    pub(super) fn prepare(
        &self,
        scenario: &RigScenario,
        link: &mut Observed<'_>,
        switches: bool,
    ) -> Result<bool, TalkError> {
        let mut faulted = false;
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        for slave in &scenario.plan.setup.slaves {
            let address = slave.address;
            let Some(known) = self.known_at(address) else {
                continue;
            };
            let ppo = known.ppo();
            talk.restart(address);
            talk.start(address, ppo, None)?;
            let off = Image::of_words(stw::SAFE, 0);
            talk.exchange(address, ppo, &off)?;
            if !self.restarts {
                // A slave whose terminals control it during the scenario goes on holding this word.
                idle(address, ppo, &mut talk)?;
            }
            for (parameter, index, value) in &slave.parameters {
                let ind = index.ind(parameter);
                let Some(raw) = parameter.raw_of(*value) else {
                    continue;
                };
                if known.values.get(&(parameter.number, ind)) != Some(&raw) {
                    let ak = Task::change(parameter).ak();
                    known.task(&mut talk, Pkw::of(ak, parameter.number, ind, raw))?;
                }
            }
            if switches {
                switch(known, slave, &mut talk)?;
            }
        }
        match self.restarts {
            true => {
                drop(talk);
                for slave in &scenario.plan.setup.slaves {
                    for fault in [DriveFault::Off, DriveFault::On] {
                        let fault = PlacedFault::Drive(slave.address, fault);
                        link.inject(0, fault, Moment::Now);
                    }
                }
                link.noted.begin_fresh();
                // A slave that looks for the rate may miss the first telegram (`autobaud`); a request for its status changes nothing.
                let mut talk = Talk::new(Box::new(&mut *link), self.patience);
                for slave in &scenario.plan.setup.slaves {
                    talk.status(slave.address)?;
                }
            }
            false => {
                for slave in &scenario.plan.setup.slaves {
                    let known = self.known_at(slave.address);
                    let ppo = match switches {
                        true => slave.ppo,
                        false => known.map(KnownInverters::ppo).unwrap_or_default(),
                    };
                    if switches {
                        talk.start(slave.address, ppo, None)?;
                    }
                    let zsw = idle(slave.address, ppo, &mut talk)?;
                    faulted |= zsw & zsw::FAULT != 0;
                    self.without_fault(slave.address, ppo, zsw, &mut talk)?;
                    match self.limits.bus_settings {
                        true => talk.unlock(slave.address)?,
                        false => talk.start(slave.address, ppo, Some(FORGET))?,
                    }
                }
                if !self.limits.bus_settings {
                    talk.pass(FORGOTTEN)?;
                }
                for slave in &scenario.plan.setup.slaves {
                    talk.restart(slave.address);
                    talk.diagnose(slave.address)?;
                }
            }
        }
        Ok(faulted)
    }
}

impl Player {
    /// Acknowledges a fault that a slave in the exchange shows, where the bench may: the terminals may start the motor then. It is idle afterwards.
    pub(in crate::rig) fn without_fault(
        &self,
        slave: u8,
        ppo: PpoType,
        zsw: u16,
        talk: &mut Talk<'_>,
    ) -> Result<(), TalkError> {
        if zsw & zsw::FAULT == 0 {
            return Ok(());
        }
        if !self.acknowledges() {
            return Err(TalkError::Fault { slave, zsw });
        }
        let mut shown = zsw;
        for word in [stw::SAFE, stw::SAFE | stw::ACKNOWLEDGE, stw::SAFE, IDLE] {
            let image = Image::of_words(word, 0);
            for _ in 0..ACKNOWLEDGED {
                shown = talk.exchange(slave, ppo, &image)?.words[0];
            }
        }
        match shown & zsw::FAULT {
            0 => Ok(()),
            _ => Err(TalkError::Fault { slave, zsw: shown }),
        }
    }
}

/// Gives a slave in the exchange the word that it holds when a scenario begins. Returns its status word.
pub(in crate::rig) fn idle(slave: u8, ppo: PpoType, talk: &mut Talk<'_>) -> Result<u16, TalkError> {
    let image = Image::of_words(IDLE, 0);
    let mut zsw = 0;
    for _ in 0..IDLE_TIMES {
        zsw = talk.exchange(slave, ppo, &image)?.words[0];
    }
    Ok(zsw)
}

/// Switches the settings of the bus of a slave to those of a scenario, the PPO type last.
fn switch(
    known: &KnownInverters,
    slave: &SlaveSetup,
    talk: &mut Talk<'_>,
) -> Result<(), TalkError> {
    let mut stated = slave.parameters.iter();
    let stated = stated.any(|(parameter, ..)| parameter.number == INTERFACE);
    // Without a line about it the scenario has the factory setting: the terminals control the inverter.
    let local = (!stated).then_some((INTERFACE, 0));
    let ppo = (known.ppo() != slave.ppo).then_some((PPO_TYPE, u32::from(slave.ppo.raw())));
    for (number, raw) in local.into_iter().chain(ppo) {
        let Some(parameter) = Parameter::of(number) else {
            continue;
        };
        if known.values.get(&(number, 0)) == Some(&raw) {
            continue;
        }
        let ak = Task::change(parameter).ak();
        match known.task(talk, Pkw::of(ak, number, 0, raw)) {
            // The module begins anew.
            Err(TalkError::Exchange {
                why: ExchangeError::Left,
                ..
            }) if number == PPO_TYPE => {}
            other => {
                other?;
            }
        }
    }
    Ok(())
}
