//! The inverter behind the module.

use super::setup::Setup;
use harness_proto::nordac::pkw::{Answer, Pkw};
use harness_proto::nordac::words::zsw;
use harness_proto::nordac::{DEFAULT_ADDRESS, PpoType};
use harness_proto::time::Instant;

/// The words of an exchange that the inverter takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Control word.
    pub stw: u16,
    /// Main setpoint.
    pub hsw: u16,
    /// PZD3; 0 where the PPO type has none.
    pub pzd3: u16,
    /// PZD4; 0 where the PPO type has none.
    pub pzd4: u16,
}

/// The words of an exchange that the inverter gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inputs {
    /// Status word.
    pub zsw: u16,
    /// Main actual value.
    pub hiw: u16,
    /// PZD3.
    pub pzd3: u16,
    /// PZD4.
    pub pzd4: u16,
}

/// The parameters with which the module works: a change makes it begin anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// 1624: the address, 1 to 126.
    pub address: u8,
    /// 1622: the PPO type.
    pub ppo: PpoType,
    /// 1619: the bus mode.
    pub bus_mode: u8,
}

/// The inverter.
#[derive(Clone, Debug)]
pub struct Inverter {
    settings: Settings,
}

impl Inverter {
    /// The inverter at its first power-up, at `at`.
    #[must_use]
    pub fn new(setup: &Setup, at: Instant) -> Self {
        let _ = at;
        let stored = |number: u16, default: u8| {
            let mut all = setup.parameters.iter();
            let own = all.find(|(own, ..)| *own == number);
            own.and_then(|(.., raw)| u8::try_from(*raw).ok())
                .unwrap_or(default)
        };
        Self {
            settings: Settings {
                address: stored(1624, DEFAULT_ADDRESS),
                ppo: PpoType::from_raw(stored(1622, 0)).unwrap_or_default(),
                bus_mode: stored(1619, 2),
            },
        }
    }

    /// The power is back at `at`: everything but the stored parameters begins anew.
    pub fn power_up(&mut self, at: Instant) {
        let _ = at;
    }

    /// When it does something by itself.
    #[must_use]
    pub const fn next_action(&self) -> Option<Instant> {
        None
    }

    /// Does what is due up to and including `to`.
    pub fn advance(&mut self, to: Instant) {
        let _ = to;
    }

    /// Takes the words of an exchange.
    pub fn take(&mut self, at: Instant, outputs: &Outputs) {
        let _ = (at, outputs);
    }

    /// The words that it gives at `at`.
    #[must_use]
    pub fn inputs(&self, at: Instant) -> Inputs {
        let _ = at;
        Inputs {
            zsw: zsw::START_DISABLE | zsw::NO_OFF2 | zsw::NO_OFF3,
            ..Inputs::default()
        }
    }

    /// Executes a task of the parameter channel once.
    pub fn task(&mut self, at: Instant, task: Pkw, ppo: PpoType) -> Answer {
        self.current(at, task, ppo)
    }

    /// The answer to a task that was executed, with the current value.
    #[must_use]
    pub fn current(&self, at: Instant, task: Pkw, ppo: PpoType) -> Answer {
        let _ = (at, task, ppo);
        Answer::None
    }

    /// The parameters with which the module works.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// The watchdog of the module has expired, and the drive is to stop for it.
    pub fn watchdog_expired(&mut self, at: Instant) {
        let _ = at;
    }

    /// The module is lost.
    pub fn link_lost(&mut self, at: Instant) {
        let _ = at;
    }

    /// The module is there again.
    pub fn link_found(&mut self, at: Instant) {
        let _ = at;
    }
}
