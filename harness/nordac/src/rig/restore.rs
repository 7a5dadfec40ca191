//! What a scenario leaves changed in the slaves of a rig: put back, and read again to see it.
//!
//! Parameters are stored, the address and the PPO type among them; a fault and the control word in force stay until the power goes. What cannot be
//! put back is printed with the command that does it.

use super::RigSlave;
use super::known::{ADDRESS, INTERFACE, KnownInverters, PPO_TYPE, WIPES, answer, value};
use super::observed::WrittenParameter;
use super::player::{PlayableScenario, Player, idle};
use super::talk::{Talk, TalkError};
use crate::gate::GuardsSlaves as _;
use crate::safe_state::{found, last_words};
use crate::value::shown;
use harness_bench::guard::Guarded;
use harness_bench::link::Line;
use harness_bench::medium::Pieces;
use harness_proto::nordac::guard::{TaskClass, class};
use harness_proto::nordac::master::ExchangeError;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::SubindexBits;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, Parameter, ParameterRef, Pkw, Task};
use std::collections::BTreeSet;

#[cfg(test)]
mod tests;

/// The bus mode (5.5): the module restarts with another one, as with another PPO type or address.
const BUS_MODE: u16 = 1619;

/// The most places at which slaves that a scenario moves are stopped by a watchdog: each takes it up to 1.3 s.
const MOST_STOPPED: usize = 8;

/// How often a parameter is put back where the exchange is left meanwhile.
const TRIES: usize = 3;

/// A parameter: its number and IND.
type Place = (u16, u16);

/// The order in which parameters are put back: those after which the slave is reached in another way are last.
const fn rank(number: u16) -> u8 {
    match number {
        INTERFACE => 1,
        PPO_TYPE => 2,
        ADDRESS => 3,
        _ => 0,
    }
}

/// Whether the module restarts, and does not answer the task.
const fn restarts(number: u16) -> bool {
    matches!(number, BUS_MODE | PPO_TYPE | ADDRESS)
}

impl Player {
    /// Puts back what the last attempt has changed, on slaves in their safe state. Returns what is left to say.
    pub(super) fn put_back<L: Line>(&self, line: &mut Guarded<L>, origin: &str) -> Vec<String> {
        let mut notes = Vec::new();
        for known in self.known() {
            let listed = known.slave;
            let places: Vec<_> = match line.slaves() {
                Some(gate) => gate.places(listed.address).collect(),
                None => vec![listed.address],
            };
            let changed = changed(known, &places, &self.written);
            let mut talk = Talk::new(Box::new(&mut *line), self.patience());
            let slave = match found(&mut talk, &places) {
                Ok((address, _)) => RigSlave { address, ..listed },
                Err(why) => {
                    let back = commands(known, listed, &changed, origin);
                    notes.push(format!("{why}{back}"));
                    continue;
                }
            };
            drop(talk);
            let mut back = Restoration::new(line, self, known, slave);
            // Terminals that control it again do not let the bus acknowledge.
            let mut fault = back.without_fault(self);
            let left = back.all(&changed);
            let slave = back.slave;
            drop(back);
            line.reset_after_denial();
            if !changed.is_empty() || fault.is_err() {
                fault = Restoration::new(line, self, known, slave).without_fault(self);
            }
            if let Some((kept, why)) = left {
                let commands = commands(known, slave, &kept, origin);
                notes.push(format!("slave {}: {why}{commands}", listed.address));
            }
            if let Err(error) = fault {
                notes.push(error.to_string());
            }
        }
        notes
    }

    /// Says what a scenario is about to write, and which addresses it gives to slaves, with what puts it back. A slave is stopped where it may be
    /// then, with the PPO type that it may have.
    pub(super) fn foretell(&self, begun: &PlayableScenario) {
        let writes = |known: &KnownInverters| {
            let slave = known.slave;
            let changed = changed(known, &[slave.address], &begun.written);
            let commands = commands(known, slave, &changed, self.left.origin());
            let nothing = format!("slave {}: nothing was put back{commands}", slave.address);
            (!commands.is_empty()).then_some(nothing)
        };
        let mut all: Vec<_> = self.known().iter().filter_map(writes).collect();
        let moved = begun.moved.iter().filter(|(slave, to)| slave != to);
        all.extend(moved.clone().map(|(slave, to)| {
            format!("slave {slave} may be at address {to} (1624): with `address = {to}` in the rig's file it is found there")
        }));
        let known = self.known().iter();
        let same = known.map(|known| (known, known.slave.address));
        let moved = moved.filter_map(|(slave, to)| Some((self.known_at(*slave)?, *to)));
        let elsewhere = same.chain(moved).filter_map(|(known, address)| {
            let ppo = known.slave.ppo.filter(|_| !may_switch(known, begun));
            let slave = RigSlave { address, ppo };
            (slave != known.slave).then_some(slave)
        });
        let elsewhere: Vec<_> = elsewhere.take(MOST_STOPPED).collect();
        let stops = Pieces::Octets(last_words(&elsewhere).concat());
        self.left
            .foretell(all, (!elsewhere.is_empty()).then_some(stops));
    }
}

/// Whether a scenario may give a slave another PPO type.
fn may_switch(known: &KnownInverters, begun: &PlayableScenario) -> bool {
    let address = known.slave.address;
    let moved = begun.moved.iter().filter(|change| change.0 == address);
    let places: Vec<_> = moved.map(|change| change.1).chain([address]).collect();
    let all = changed(known, &places, &begun.written);
    all.iter().any(|change| change.0 == PPO_TYPE)
}

/// What may have been `written` to a slave that was at these addresses, in the order in which it is put back.
fn changed(
    known: &KnownInverters,
    places: &[u8],
    written: &BTreeSet<WrittenParameter>,
) -> Vec<Place> {
    let written: Vec<_> = written
        .iter()
        .filter(|write| places.contains(&write.0))
        .collect();
    let wiped = written.iter().any(|(_, number, _)| WIPES.contains(number));
    let all = known.values.keys().copied();
    let mut all: Vec<_> = all
        .filter(|(number, ind)| {
            let mut told = written.iter().map(|write| (write.1, write.2));
            let tells = told.any(|place| place == (*number, *ind));
            !WIPES.contains(number) && (wiped || tells)
        })
        .collect();
    all.sort_by_key(|(number, ind)| (rank(*number), *number, *ind));
    all
}

/// The end of a sentence: the commands that put parameters back; nothing for none.
fn commands(known: &KnownInverters, at: RigSlave, places: &[Place], origin: &str) -> String {
    let one = |place: &Place| {
        let raw = known.values.get(place)?;
        let parameter = Parameter::of(place.0)?;
        let index = Index::of(parameter, place.1, SubindexBits::default());
        let parameter = ParameterRef { parameter, index };
        let value = shown(&parameter, parameter.parameter.number_of(*raw));
        Some(format!(" \"{parameter}={value}\""))
    };
    let values: String = places.iter().filter_map(one).collect();
    if values.is_empty() {
        return String::new();
    }
    let moves = places
        .iter()
        .any(|place| class(place.0) == TaskClass::Speed);
    let moves = if moves { " --move" } else { "" };
    let (slave, at) = (known.slave.address, at.address);
    let first = match slave == at {
        true => String::new(),
        false => format!(
            "write `address = {at}` into the rig's file, which puts it back to {slave} behind that, and "
        ),
    };
    format!("; to put it back, {first}`drivebench write {at}{values}{moves} --rig {origin}`")
}

/// A slave that is put back.
struct Restoration<'k, 'l> {
    talk: Talk<'l>,
    known: &'k KnownInverters,
    /// Where it is, and its PPO type there.
    slave: RigSlave,
}

impl<'k, 'l> Restoration<'k, 'l> {
    fn new<L: Line>(
        line: &'l mut Guarded<L>,
        player: &Player,
        known: &'k KnownInverters,
        slave: RigSlave,
    ) -> Self {
        let talk = Talk::new(Box::new(line), player.patience());
        Self { talk, known, slave }
    }

    /// Takes it into the exchange, with the PPO type that it has now.
    fn begin(&mut self) -> Result<(), TalkError> {
        let address = self.slave.address;
        self.talk.restart(address);
        let ppo = self.talk.configuration(address)?;
        self.slave.ppo = ppo.or(self.slave.ppo);
        self.talk
            .start(address, self.slave.ppo.unwrap_or_default(), None)
    }

    fn task(&mut self, ak: u8, (number, ind): Place, pwe: u32) -> Result<Option<u32>, TalkError> {
        let task = Pkw::of(ak, number, ind, pwe);
        Ok(answer(self.slave, &mut self.talk, task)?.and_then(value))
    }

    /// Puts parameters back, one after another. Returns the first that is not as it was with those after it, and why.
    fn all(&mut self, places: &[Place]) -> Option<(Vec<Place>, String)> {
        if places.is_empty() {
            return None;
        }
        if let Err(error) = self.begin() {
            return Some((places.to_vec(), error.to_string()));
        }
        let has_pkw = self.slave.ppo.is_some_and(|ppo| ppo.has_pkw());
        if !has_pkw {
            let why = "it is set to a PPO type that has no parameter channel: set 1622 at its keys";
            return Some((places.to_vec(), why.to_owned()));
        }
        let mut left = Vec::new();
        let mut reasons = Vec::new();
        for place in places {
            if let Err(why) = self.insist(*place) {
                left.push(*place);
                reasons.push(why);
            }
        }
        let why = reasons.join(", ");
        (!left.is_empty()).then_some((left, why))
    }

    /// Puts a parameter back; again where the exchange was left, as by the watchdog of a slave while the computer stood still.
    fn insist(&mut self, place: Place) -> Result<(), String> {
        let mut done = self.one(place);
        for _ in 1..TRIES {
            if done.is_err() && self.begin().is_ok() {
                done = self.one(place);
            }
        }
        done.unwrap_or_else(|error| Err(error.to_string()))
    }

    /// Puts a parameter back that does not read as it did. The inner error says how the slave refuses it.
    fn one(&mut self, place: Place) -> Result<Result<(), String>, TalkError> {
        let (Some(raw), Some(parameter)) = (self.known.values.get(&place), Parameter::of(place.0))
        else {
            return Ok(Ok(()));
        };
        let (raw, number) = (*raw, place.0);
        let (reads, writes) = (Task::read(parameter).ak(), Task::change(parameter).ak());
        let was = self.task(reads, place, 0)?;
        if was == Some(raw) {
            return Ok(Ok(()));
        }
        if number == INTERFACE {
            // The terminals control it from then on, and it goes on holding this word.
            let ppo = self.slave.ppo.unwrap_or_default();
            idle(self.slave.address, ppo, &mut self.talk)?;
        }
        match self.task(writes, place, raw) {
            Err(TalkError::Exchange {
                why: ExchangeError::Left | ExchangeError::NoReply,
                ..
            }) if restarts(number) => {}
            other => {
                other?;
            }
        }
        if number == ADDRESS {
            self.slave.address = self.known.slave.address;
        }
        if restarts(number) {
            self.begin()?;
        }
        Ok(match self.task(reads, place, 0)? {
            Some(reads) if reads == raw => Ok(()),
            Some(reads) => Err(format!(
                "{number} ({}) reads {reads}, and was {raw}",
                parameter.name
            )),
            None => Err(format!("{number} ({}) is not read", parameter.name)),
        })
    }

    /// Acknowledges a fault that the scenario has left, where the bench may.
    fn without_fault(&mut self, player: &Player) -> Result<(), TalkError> {
        self.begin()?;
        let (slave, ppo) = (self.slave.address, self.slave.ppo.unwrap_or_default());
        let off = Image::of_words(stw::SAFE, 0);
        let zsw = self.talk.exchange(slave, ppo, &off)?.words[0];
        player.without_fault(slave, ppo, zsw, &mut self.talk)
    }
}
