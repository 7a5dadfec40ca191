//! What is known of a slave: what its parameters read.

use super::RigSlave;
use super::talk::{Talk, TalkError};
use crate::simulate::SlaveSetup;
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{NordacProperty, PROPERTIES, Properties, SubindexBits};
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Answer, Image, PARAMETERS, Parameter, Pkw, PpoType, Task};
use harness_sim::nordac::History;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How many exchanges a task may take (3.4.1 says 2; `pkw-latency`).
const MOST_EXCHANGES: u32 = 40;

/// The address and the PPO type, which the setup of a slave has apart.
const APART: [u16; 2] = [PPO_TYPE, ADDRESS];

/// Who controls an inverter: the first of the settings of the bus in which a scenario may differ from the rig (2.5.1).
pub(super) const INTERFACE: u16 = 1621;

/// The PPO type. The module restarts with another one.
pub(super) const PPO_TYPE: u16 = 1622;

/// The address. The module restarts with another one.
pub(super) const ADDRESS: u16 = 1624;

/// What loads the factory settings: every other parameter may have another value then, and the address is 126 (4.1.3, 5.5).
pub(super) const WIPES: [u16; 2] = [970, 1602];

/// The control word in force, and the pending or last fault (4.1.3).
const CONTROL_WORD: u16 = 967;
const LAST_FAULT: u16 = 947;

/// A slave, as far as it is known.
#[derive(Clone, Debug)]
pub(super) struct KnownInverters {
    pub(super) slave: RigSlave,
    /// What the parameters read, by number and IND. The notes of all attempts share it.
    pub(super) values: Arc<Values>,
    /// The whole PWE of each of these answers: a wrong slave may show a word in PWE1.
    pub(super) shown: Arc<Values>,
    /// What it keeps of the time before: see [`Self::read_history`].
    pub(super) history: History,
    /// How it behaves where the manual leaves that open, as far as a conversation has shown it.
    pub(super) properties: Properties,
    /// How it may behave as well, each with the words of the difference.
    pub(super) open: Vec<(String, Properties)>,
}

impl KnownInverters {
    pub(super) fn new(slave: RigSlave) -> Self {
        Self {
            slave,
            values: Arc::default(),
            shown: Arc::default(),
            history: History::default(),
            properties: Properties::default(),
            open: candidates(Properties::default(), |_| true),
        }
    }

    pub(super) fn ppo(&self) -> PpoType {
        self.slave.ppo.unwrap_or_default()
    }

    /// Whether every value of a property but that of [`Self::properties`] is excluded.
    pub(super) fn is_settled(&self, property: &NordacProperty) -> bool {
        let held = value_of(property, &self.properties);
        let mut open = self.open.iter();
        open.all(|(_, other)| value_of(property, other) == held)
    }

    pub(super) fn settle(&mut self, property: &NordacProperty, word: &str) {
        let mut all = std::mem::take(&mut self.open);
        all.retain_mut(|(_, other)| property.set(other, word));
        let _fits = property.set(&mut self.properties, word);
        all.retain(|(_, other)| *other != self.properties);
        self.open = all;
    }

    /// Reads every parameter that can be written. Where one is refused, it is not known. The slave is in the exchange afterwards.
    ///
    /// # Errors
    /// The slave does not reply, or does not get into the exchange.
    pub(super) fn read_all(&mut self, talk: &mut Talk<'_>) -> Result<(), TalkError> {
        talk.start(self.slave.address, self.ppo(), None)?;
        if !self.ppo().has_pkw() {
            return Ok(());
        }
        let values = Arc::make_mut(&mut self.values);
        let shown = Arc::make_mut(&mut self.shown);
        let all = PARAMETERS.iter().filter(|row| !row.has(Flag::ReadOnly));
        for parameter in all.filter(|row| !row.needs_posicon()) {
            for ind in indices(parameter) {
                let task = Pkw::of(Task::read(parameter).ak(), parameter.number, ind, 0);
                let answer = confirmed(self.slave, talk, task)?;
                if let Some((answer, value)) = answer.and_then(|word| Some((word, value(word)?))) {
                    values.insert((parameter.number, ind), value);
                    shown.insert((parameter.number, ind), answer.pwe);
                }
            }
        }
        Ok(())
    }

    /// Reads what the slave keeps of the time before: the control word in force (967), which outlives a master where the terminals control the
    /// inverter, and its last fault (947). The slave is in the exchange afterwards.
    ///
    /// # Errors
    /// The slave does not reply, or does not get into the exchange.
    pub(super) fn read_history(&self, talk: &mut Talk<'_>) -> Result<History, TalkError> {
        if !self.ppo().has_pkw() {
            return Ok(History::default());
        }
        talk.start(self.slave.address, self.ppo(), None)?;
        let mut read = |number: u16| {
            let parameter = Parameter::of(number);
            let ak = parameter.map_or(0, |parameter| Task::read(parameter).ak());
            let word = self.task(talk, Pkw::of(ak, number, 0, 0))?;
            Ok::<_, TalkError>(word.and_then(|word| u16::try_from(word).ok()))
        };
        // The bench's own words replace the one that a slave holds which takes them.
        let word = match self.is_bus_controlled() {
            true => None,
            false => read(CONTROL_WORD)?,
        };
        let fault = read(LAST_FAULT)?.and_then(|number| u8::try_from(number).ok());
        Ok(History {
            // Before the first valid word it shows one that is not valid.
            stw: word.filter(|word| word & stw::VALID != 0),
            faults: fault.filter(|fault| *fault != 0).into_iter().collect(),
        })
    }

    /// Whether the inverter takes its control word from the bus (1621).
    pub(super) fn is_bus_controlled(&self) -> bool {
        matches!(self.values.get(&(INTERFACE, 0)), Some(2 | 3 | 5 | 6))
    }

    /// Carries a task out; `None` where it is refused, or not answered. Words that are not valid go with it.
    ///
    /// # Errors
    /// The exchange fails.
    pub(super) fn task(&self, talk: &mut Talk<'_>, task: Pkw) -> Result<Option<u32>, TalkError> {
        Ok(answer(self.slave, talk, task)?.and_then(value))
    }

    /// The model of the slave as it is, just switched on.
    pub(super) fn model(&self, properties: Properties) -> SlaveSetup {
        let mut slave = SlaveSetup::new(self.slave.address);
        slave.ppo = self.ppo();
        slave.properties = properties;
        slave.history = self.history.clone();
        slave.parameters.extend(stated(&self.values));
        slave
    }
}

/// The answer of a slave to a task, whatever it says.
pub(super) fn answer(
    slave: RigSlave,
    talk: &mut Talk<'_>,
    task: Pkw,
) -> Result<Option<Pkw>, TalkError> {
    let (address, ppo) = (slave.address, slave.ppo.unwrap_or_default());
    let mut outputs = Image::default();
    // Another number or IND, or no task: a former answer is not taken for this one.
    for _ in 0..MOST_EXCHANGES {
        let shown = talk.exchange(address, ppo, &outputs)?.pkw;
        if shown.ak() == 0 || (shown.number(), shown.ind) != (task.number(), task.ind) {
            break;
        }
    }
    outputs.pkw = task;
    for _ in 0..MOST_EXCHANGES {
        let shown = talk.exchange(address, ppo, &outputs)?.pkw;
        if shown.ak() == 0 || (shown.number(), shown.ind) != (task.number(), task.ind) {
            continue;
        }
        return Ok(Some(shown));
    }
    Ok(None)
}

/// An answer that the next exchange repeats: a value is put back later, and a wrong slave may show the one of an earlier answer first.
fn confirmed(slave: RigSlave, talk: &mut Talk<'_>, task: Pkw) -> Result<Option<Pkw>, TalkError> {
    let Some(mut last) = answer(slave, talk, task)? else {
        return Ok(None);
    };
    let (address, ppo) = (slave.address, slave.ppo.unwrap_or_default());
    let outputs = Image::from(task);
    for _ in 0..MOST_EXCHANGES {
        let shown = talk.exchange(address, ppo, &outputs)?.pkw;
        if shown == last {
            return Ok(Some(last));
        }
        last = shown;
    }
    Ok(None)
}

/// What an answer says that a parameter holds; `None` for a refusal.
pub(super) fn value(answer: Pkw) -> Option<u32> {
    match answer.answer()? {
        Answer::Error(_) | Answer::None => None,
        answer => Some(answer.pwe()),
    }
}

/// What parameters read, by number and IND.
pub(super) type Values = BTreeMap<(u16, u16), u32>;

/// Values in the form of a slave's setup.
pub(super) fn stated(
    values: &Values,
) -> impl Iterator<Item = (&'static Parameter, Index, i64)> + use<'_> {
    let apart = |number: &u16| APART.contains(number);
    let values = values.iter().filter(move |((number, _), _)| !apart(number));
    values.filter_map(|((number, ind), raw)| {
        let parameter = Parameter::of(*number)?;
        let index = Index::of(parameter, *ind, SubindexBits::default());
        Some((parameter, index, parameter.number_of(*raw)))
    })
}

/// The IND of each value of a parameter.
fn indices(parameter: &Parameter) -> impl Iterator<Item = u16> {
    let count = match parameter.has(Flag::Set) {
        true => u16::from(parameter.sets()),
        false => 1,
    };
    (0..count).map(|set| set << 8)
}

/// The properties that differ from these in one point that the manual leaves open and that `may` differ, each with the words of the difference.
pub(super) fn candidates(
    base: Properties,
    may: impl Fn(&NordacProperty) -> bool,
) -> Vec<(String, Properties)> {
    let mut all = Vec::new();
    for property in PROPERTIES.iter().filter(|property| may(property)) {
        for word in super::values(property) {
            let mut other = base;
            if property.set(&mut other, &word) && other != base {
                all.push((format!("{} = {word}", property.name), other));
            }
        }
    }
    all
}

pub(super) fn value_of(property: &NordacProperty, properties: &Properties) -> String {
    let holds = |word: &String| {
        let mut changed = *properties;
        property.set(&mut changed, word) && changed == *properties
    };
    let number = (0..=u8::MAX).map(|number| number.to_string());
    let mut all = super::values(property).into_iter().chain(number);
    all.find(holds).unwrap_or_default()
}
