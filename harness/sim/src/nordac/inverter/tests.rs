//! The inverter alone, without module and line. Sections are those of the manual; rules are those of the state machine.

mod channel;
mod invariants;
mod open;
mod words;

use super::{Inverter, InverterInputs, Outputs};
use crate::nordac::InverterSetup;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{NordacProperty, Properties};
use harness_proto::nordac::words::State;
use harness_proto::nordac::{Parameter, Pkw, PpoType};
use harness_proto::time::{Instant, Span};

/// A parameter in set 1.
fn first(number: u16, value: i32) -> (u16, Index, i32) {
    (number, Index::default(), value)
}

/// An inverter with a clock.
struct Bench {
    inverter: Inverter,
    now: Instant,
    ppo: PpoType,
}

impl Bench {
    /// Control by the bus, and these parameters.
    fn new(parameters: &[(u16, i32)]) -> Self {
        Self::with(Properties::default(), false, parameters)
    }

    /// A property has another value than its default.
    fn open(name: &str, word: &str, parameters: &[(u16, i32)]) -> Self {
        Self::with(properties(name, word), false, parameters)
    }

    fn with(properties: Properties, posicon: bool, parameters: &[(u16, i32)]) -> Self {
        let mut all = vec![first(1621, 2), first(1622, 1)];
        all.extend(
            parameters
                .iter()
                .map(|&(number, value)| first(number, value)),
        );
        let setup = InverterSetup {
            properties,
            posicon,
            parameters: all,
            ..InverterSetup::default()
        };
        Self {
            inverter: Inverter::new(&setup, Instant::START),
            now: Instant::START,
            ppo: PpoType::Two,
        }
    }

    fn wait(&mut self, millis: u64) -> &mut Self {
        self.now += Span::from_millis(millis);
        self.inverter.advance(self.now);
        self
    }

    /// Process words without PZD3 and PZD4.
    fn send(&mut self, stw: u16, hsw: u16) -> &mut Self {
        let outputs = Outputs {
            stw,
            hsw,
            ..Outputs::default()
        };
        self.inverter.take(self.now, &outputs);
        self
    }

    fn with_second(&mut self, stw: u16, hsw: u16, pzd4: u16) -> &mut Self {
        let outputs = Outputs {
            stw,
            hsw,
            pzd3: 0,
            pzd4,
        };
        self.inverter.take(self.now, &outputs);
        self
    }

    /// Enabled, and at this setpoint after the ramp.
    fn run(&mut self, hsw: u16) -> &mut Self {
        self.send(0x047E, 0).send(0x047F, hsw).wait(60_000)
    }

    /// The cause of this fault comes.
    fn fault(&mut self, code: u8) -> &mut Self {
        self.inverter.set_cause(self.now, Some(code));
        self
    }

    /// Module and inverter lose or find each other.
    fn link(&mut self, found: bool) -> &mut Self {
        if found {
            self.inverter.link_found(self.now);
        } else {
            self.inverter.link_lost(self.now);
        }
        self
    }

    /// The DP watchdog expires.
    fn watchdog(&mut self) -> &mut Self {
        self.inverter.watchdog_expired(self.now);
        self
    }

    fn inputs(&self) -> InverterInputs {
        self.inverter.inputs(self.now)
    }

    fn zsw(&self) -> u16 {
        self.inputs().zsw
    }

    /// HIW.
    fn actual(&self) -> u16 {
        self.inputs().hiw
    }

    fn state(&self) -> State {
        self.inverter.state()
    }

    /// The answer to a task, both in the manual's four groups.
    fn task(&mut self, task: &str) -> String {
        let task = pkw(task);
        let answer = self.inverter.task(self.now, task, self.ppo);
        self.inverter.encode(answer, task).to_string()
    }

    /// The value of a parameter in set 1.
    fn read(&self, number: u16) -> i64 {
        self.element(number, 0)
    }

    fn element(&self, number: u16, element: u16) -> i64 {
        let parameter = Parameter::of(number).unwrap();
        self.inverter
            .parameter(parameter, Index { element, set: 0 })
            .unwrap()
    }
}

fn properties(name: &str, word: &str) -> Properties {
    let mut properties = Properties::default();
    let description =
        NordacProperty::of(name).unwrap_or_else(|| panic!("there is no property {name}"));
    assert!(description.set(&mut properties, word), "{name} = {word}");
    properties
}

/// Four groups of four digits.
fn pkw(text: &str) -> Pkw {
    let mut octets = Vec::new();
    for group in text.split(' ') {
        octets.extend(u16::from_str_radix(group, 16).unwrap().to_be_bytes());
    }
    Pkw::decode(octets.try_into().unwrap())
}
