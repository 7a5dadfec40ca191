//! The inverter behind the PROFIBUS module: process words, state machine, ramps, time-outs and faults (3.2, 3.3, 5, 2.6).
//!
//! The inverter has no cycle. Words arrive, the motor comes to rest, a time-out expires: each of these happens at an exact instant. In between the
//! frequency is a formula, so that an idle inverter costs nothing.

mod course;
mod show;
mod task;

use super::InverterSetup;
use super::faults::{FaultMemory, Past, TIME_OUT};
use super::frequency::Frequency;
use super::machine;
use super::parameters::Parameters;
use super::ramp::Ramp;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{
    Off1BeatsDisable, Properties, PzdInvalid, Reinit, TimeoutCounts, TimeoutExactly,
    TimeoutWith1614,
};
use harness_proto::nordac::words::{State, set_of, stw};
use harness_proto::nordac::{Parameter, PpoType};
use harness_proto::time::{Instant, Span};
use std::hash::{Hash as _, Hasher};

/// The control word before the first valid one: OFF1 alone (section 5 of the reading).
const INITIAL: u16 = stw::NO_OFF2 | stw::NO_OFF3;
/// How long module and inverter may have lost each other before fault 10 (2.6).
const APART: Span = Span::from_millis(100);
/// The unit of 1625.
const TIMEOUT_UNIT: Span = Span::from_millis(100);
/// The shortest time there is.
const MOMENT: Span = Span::from_units(1);

/// The process words of a Data_Exchange. What the PPO type does not carry is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Outputs {
    /// The control word.
    pub stw: u16,
    /// The main setpoint.
    pub hsw: u16,
    /// The low word of a position.
    pub pzd3: u16,
    /// The second setpoint.
    pub pzd4: u16,
}

/// The process words of a reply.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct InverterInputs {
    /// The status word.
    pub zsw: u16,
    /// The main actual value.
    pub hiw: u16,
    /// 0: the model does not position.
    pub pzd3: u16,
    /// Actual value 2.
    pub pzd4: u16,
}

/// What the module works with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Settings {
    /// 1624: 1 to 126.
    pub address: u8,
    /// 1622.
    pub ppo: PpoType,
    /// How often the module had to restart because 1619, 1622 or 1624 changed or the factory settings were loaded.
    pub restarts: u32,
}

/// What happens by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InverterEvent {
    /// The motor has come to rest, and the state ends with it.
    Standstill,
    /// 1625 has expired.
    BusTimeout,
    /// Module and inverter have lost each other for too long.
    Apart,
}

/// The simulated inverter.
#[derive(Clone, Debug)]
pub struct Inverter {
    properties: Properties,
    posicon: bool,
    parameters: Parameters,
    settings: Settings,
    faults: FaultMemory,
    state: State,
    /// The words in force: those of the last valid exchange that the interface lets through.
    words: Outputs,
    /// Whether a valid control word has come since power-up.
    controlled: bool,
    ramp: Ramp,
    /// The last exchange that counts for 1625; `None` while it is not armed.
    heard: Option<Instant>,
    /// Since when module and inverter have lost each other.
    lost: Option<Instant>,
    /// When fault 10 comes for that.
    apart: Option<Instant>,
    /// The fault whose cause is there.
    cause: Option<u8>,
    /// What happens next by itself.
    due: Option<(Instant, InverterEvent)>,
    now: Instant,
}

impl Inverter {
    /// An inverter that is switched on at `at`.
    #[must_use]
    pub fn new(setup: &InverterSetup, at: Instant) -> Self {
        let mut parameters = Parameters::default();
        for (number, index, value) in &setup.parameters {
            let known = Parameter::of(*number);
            if let Some(parameter) = known.filter(|known| known.raw_of((*value).into()).is_some()) {
                parameters.store(parameter, *index, *value);
            }
        }
        let mut inverter = Self {
            properties: setup.properties,
            posicon: setup.posicon,
            parameters,
            settings: Settings {
                address: 0,
                ppo: PpoType::One,
                restarts: 0,
            },
            faults: FaultMemory::default(),
            state: State::StartDisable,
            words: Outputs::default(),
            controlled: false,
            ramp: Ramp::default(),
            heard: None,
            lost: None,
            apart: None,
            cause: None,
            due: None,
            now: at,
        };
        inverter.power_up(at);
        for code in &setup.history.faults {
            inverter.faults.record(Past {
                code: *code,
                ..Past::default()
            });
            inverter.faults.acknowledge();
        }
        if let Some(word) = setup.history.stw {
            inverter.obey(word);
            inverter.settle();
        }
        inverter
    }

    /// The power is back at `at`, and nothing has happened since it went. Parameters and past faults stay; a cause of a fault and a lost
    /// link stay too.
    pub fn power_up(&mut self, at: Instant) {
        self.now = self.now.max(at);
        self.words = Outputs {
            stw: INITIAL,
            ..Outputs::default()
        };
        self.controlled = false;
        self.heard = None;
        self.lost = self.lost.map(|_| at);
        self.apart = self.lost.map(|since| since + APART);
        self.faults.acknowledge();
        self.state = State::StartDisable;
        self.settings = Settings {
            restarts: self.settings.restarts + 1,
            ..self.stored_settings()
        };
        self.steer();
        if let Some(code) = self.cause {
            self.fail(code);
        }
        self.settle();
    }

    /// Lets the time pass until `to`.
    pub fn advance(&mut self, to: Instant) {
        while let Some((at, event)) = self.due.filter(|(at, _)| *at <= to) {
            self.now = self.now.max(at);
            self.happen(event);
            self.due = self.next_event();
        }
        self.now = self.now.max(to);
    }

    /// When something happens by itself: the state, the fault memory or the status word change then. Ramps are no events.
    #[must_use]
    pub fn next_action(&self) -> Option<Instant> {
        self.due.map(|(at, _)| at)
    }

    /// Until when the frequency certainly moves no more; `None` where it does not move.
    #[must_use]
    pub fn moves_until(&self) -> Option<Instant> {
        self.ramp.moves_until(self.now)
    }

    /// Feeds all that decides what it does from `at` on, but its properties, to a checksum.
    pub fn hash_state(&self, at: Instant, sum: &mut impl Hasher) {
        let ago = |instant: Option<Instant>| instant.map(|instant| at.since(instant));
        (&self.parameters, self.settings, self.faults, self.state).hash(sum);
        (self.words, self.controlled, self.cause).hash(sum);
        // Where 1625 is 0, the last exchange counts only for who sets it later, to less than has passed since.
        let heard = self.heard.filter(|_| self.value(1625) != 0);
        (ago(heard), self.heard.is_some(), ago(self.lost)).hash(sum);
        self.apart.map(|instant| instant.since(at)).hash(sum);
        self.ramp.hash_state(at, sum);
    }

    /// Takes over the process words of an exchange.
    pub fn take(&mut self, at: Instant, outputs: &Outputs) {
        self.advance(at);
        let interface = self.value(1621);
        if interface == 0 {
            return;
        }
        let valid = outputs.stw & stw::VALID != 0;
        if valid || self.properties.timeout_counts == TimeoutCounts::AnyDataExchange {
            self.heard = Some(at);
        }
        let controls = !matches!(interface, 1 | 4);
        if valid {
            self.words.hsw = outputs.hsw;
            self.words.pzd3 = outputs.pzd3;
            if matches!(interface, 3 | 6) {
                self.words.pzd4 = outputs.pzd4;
            }
        }
        match self.properties.pzd_invalid {
            _ if !controls => self.steer(),
            _ if valid => self.obey(outputs.stw),
            PzdInvalid::Hold => {}
            PzdInvalid::SetpointOnly => self.obey(outputs.stw),
            PzdInvalid::Stop => self.switch_off(),
        }
        self.settle();
    }

    /// The DP watchdog of the module has expired at `at`, and the drive stops for it (`watchdog-action`).
    pub fn watchdog_expired(&mut self, at: Instant) {
        self.advance(at);
        self.switch_off();
        self.settle();
    }

    /// Module and inverter lose each other at `at` (2.6).
    pub fn link_lost(&mut self, at: Instant) {
        self.advance(at);
        if self.lost.is_none() {
            self.lost = Some(at);
            self.apart = Some(at + APART);
        }
        self.settle();
    }

    /// Module and inverter find each other again at `at`.
    pub fn link_found(&mut self, at: Instant) {
        self.advance(at);
        self.lost = None;
        self.apart = None;
        self.settle();
    }

    /// A cause of a fault (1 to 25) comes at `at`, or goes.
    pub fn set_cause(&mut self, at: Instant, code: Option<u8>) {
        self.advance(at);
        self.cause = code;
        if let Some(code) = code {
            self.fail(code);
        }
        self.settle();
    }

    /// What the module works with now.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// The state; the time must have advanced to now.
    #[must_use]
    pub const fn state(&self) -> State {
        self.state
    }

    /// The process words in force.
    #[must_use]
    pub const fn words(&self) -> Outputs {
        self.words
    }

    /// The exact frequency at `at`, which must not be before the last call.
    #[must_use]
    pub fn frequency(&self, at: Instant) -> Frequency {
        self.ramp.at(at)
    }

    /// The active parameter set, 0 to 3.
    #[must_use]
    pub const fn set(&self) -> u8 {
        set_of(self.words.stw)
    }

    /// The value of a parameter in the active set.
    fn value(&self, number: u16) -> i32 {
        self.parameters.value(number, self.set())
    }

    /// A value that is never negative: a time, a frequency, a size.
    fn size(&self, number: u16) -> u16 {
        u16::try_from(self.value(number)).unwrap_or(0)
    }

    /// Takes over a control word.
    fn obey(&mut self, word: u16) {
        let acknowledges = word & !self.words.stw & stw::ACKNOWLEDGE != 0;
        self.words.stw = word;
        self.controlled = true;
        if self.state == State::Fault {
            if acknowledges && self.cause.is_none() && self.lost.is_none() {
                self.faults.acknowledge();
                self.state = State::StartDisable;
            }
        } else {
            let standing = self.ramp.at(self.now).is_zero();
            let off1_first = self.properties.off1_beats_disable == Off1BeatsDisable::Yes;
            while let Some((_, state)) = machine::next(self.state, word, standing, off1_first) {
                self.state = state;
            }
        }
        self.steer();
    }

    /// OFF1 for a motor that runs.
    fn switch_off(&mut self) {
        if self.state == State::OperationEnabled {
            self.obey(self.words.stw & !stw::ON);
        }
    }

    /// A fault occurs (rule 12). In the state "fault" a further one is not recorded.
    fn fail(&mut self, code: u8) {
        if self.state == State::Fault {
            return;
        }
        self.faults.record(self.snapshot(code));
        let at_once = code == TIME_OUT && self.properties.timeout_with_1614 == TimeoutWith1614::Off;
        let stops = self.value(1614) == 1 && !self.ramp.at(self.now).is_zero() && !at_once;
        self.state = if stops {
            State::FaultReaction
        } else {
            State::Fault
        };
        self.steer();
    }

    /// Something has changed: finds out what happens next, and lets happen what is due.
    fn settle(&mut self) {
        self.due = self.next_event();
        self.advance(self.now);
    }

    fn next_event(&self) -> Option<(Instant, InverterEvent)> {
        let standstill =
            machine::at_standstill(self.state, self.words.stw).and_then(|_| self.ramp.zero_at());
        let timeout = self.bus_timeout();
        let events = [
            standstill.map(|at| (at, InverterEvent::Standstill)),
            timeout.map(|at| (at, InverterEvent::BusTimeout)),
            self.apart.map(|at| (at, InverterEvent::Apart)),
        ];
        events.into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    fn bus_timeout(&self) -> Option<Instant> {
        let heard = self.heard?;
        let time = TIMEOUT_UNIT * u64::from(self.size(1625));
        let survives = self.properties.timeout_exactly == TimeoutExactly::Survives;
        let more = if survives { MOMENT } else { Span::ZERO };
        (time != Span::ZERO).then_some(heard + time + more)
    }

    fn happen(&mut self, event: InverterEvent) {
        match event {
            InverterEvent::Standstill => {
                if let Some((_, state)) = machine::at_standstill(self.state, self.words.stw) {
                    self.state = state;
                }
                self.steer();
            }
            InverterEvent::BusTimeout => {
                self.heard = None;
                self.fail(TIME_OUT);
            }
            InverterEvent::Apart => {
                self.apart = None;
                self.fail(TIME_OUT);
            }
        }
    }

    /// What the fault memory keeps of a fault that occurs now.
    fn snapshot(&self, code: u8) -> Past {
        let word = |number: i128| u16::try_from(number).unwrap_or(u16::MAX);
        Past {
            code,
            hours: 0,
            frequency: word(self.ramp.at(self.now).abs().cut(1, 1)),
            voltage: word(self.output_voltage(self.now)),
            current: self.output_current() / 10,
            temperature: show::HEAT_SINK * 10,
            set: self.set(),
        }
    }

    /// The settings as they are stored.
    fn stored_settings(&self) -> Settings {
        let raw = u8::try_from(self.value(1622)).unwrap_or(0);
        Settings {
            address: u8::try_from(self.value(1624)).unwrap_or(0),
            ppo: PpoType::from_raw(raw).unwrap_or_default(),
            restarts: self.settings.restarts,
        }
    }

    /// A parameter has changed at [`Inverter::now`]; `restart` says whether the module must restart.
    fn changed(&mut self, restart: bool) {
        if restart && self.properties.reinit == Reinit::AtOnce {
            self.settings = Settings {
                restarts: self.settings.restarts + 1,
                ..self.stored_settings()
            };
        }
        self.steer();
        self.settle();
    }

    /// The value of a parameter as it reads now; `None` where there is no such parameter or index.
    #[must_use]
    pub fn parameter(&self, parameter: &'static Parameter, index: Index) -> Option<i64> {
        let there = self.has(parameter)
            && index.element < self.elements(parameter)
            && index.set < parameter.sets();
        there.then(|| self.shown(self.now, parameter, index))
    }
}

#[cfg(test)]
mod tests;
