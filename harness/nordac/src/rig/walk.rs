//! The conversation that walks a right inverter: each state that control words lead to (NORDAC 3.3), at rest and turning, with each word.
//!
//! At rest it also writes the ends of the ranges of parameters. What comes by itself (faults, time-outs, the watchdog), what parameters do
//! and what other services do is left to the conversations in corpora/qualify/nordac.

use super::RigSlave;
use super::values::values;
use harness_bench::qualify::walk::{Walk, WalkBounds, WalkModel, walk};
use harness_proto::nordac::guard::{FcsDenial, GuardedSlave, Limits, OctetGate};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::{Image, Parameter, Pkw, Task};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::master::Requests;
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::inverter::Outputs;
use harness_sim::nordac::{Inverter, InverterSetup};
use std::sync::Arc;

const BOUNDS: WalkBounds = WalkBounds {
    conversation: Span::from_millis(6_000),
    all: Span::from_millis(24_000),
};

/// How long an exchange takes behind an adapter, at most, in ms (our choice).
const EXCHANGE: u64 = 4;

/// Number of exchanges with a task: its answer comes with the second reply after it.
const ANSWERED: usize = 3;

/// What is new in an exchange.
#[derive(Clone, Copy)]
enum ExchangeInput {
    /// A control word.
    Word(u16),
    /// A main setpoint; 4000 hex is 100 % (3.2.3).
    Setpoint(i16),
    /// A task that reads a parameter (3.4.1).
    Read(u16),
    /// Tasks that write a parameter and read it again, or why it is not written.
    Value(&'static Parameter, i32, Option<&'static str>),
}

use ExchangeInput::{Read, Setpoint, Value, Word};

/// An input of a walk: its name, and what it is.
type Input = (&'static str, ExchangeInput);

/// The inputs of a walk beside the values of parameters.
const INPUTS: [Input; 22] = [
    ("a read of a ramp", Read(1102)),
    ("a read of the control word in force", Read(967)),
    ("a read of the present fault", Read(1800)),
    ("a read of a parameter that is missing", Read(1001)),
    ("no setpoint", Setpoint(0)),
    ("a setpoint of 3.125 %", Setpoint(0x0200)),
    ("a setpoint of -3.125 %", Setpoint(-0x0200)),
    ("ready to start", Word(0x047E)),
    ("on", Word(0x047F)),
    ("on, without operation", Word(0x0477)),
    ("off 1 without operation", Word(0x0476)),
    ("off 2", Word(0x047D)),
    ("off 3", Word(0x047B)),
    ("a ramp generator that is locked", Word(0x046F)),
    ("a ramp that is held", Word(0x045F)),
    ("a setpoint that is locked", Word(0x043F)),
    ("an acknowledgement", Word(0x04FF)),
    ("bits that nothing uses", Word(0x077F)),
    ("parameter set 2", Word(0x447F)),
    ("a word without bit 10", Word(0x007F)),
    ("nothing without bit 10", Word(0x0000)),
    ("nothing but bit 10", Word(0x0400)),
];

/// What distinguishes the states of an inverter.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct State {
    /// That of the table, by its short name (NORDAC 3.3).
    of_machine: &'static str,
    turning: bool,
    set: u8,
}

/// A right inverter behind the guard of the rig's file.
#[derive(Clone)]
struct Model {
    inverter: Inverter,
    gate: OctetGate,
    requests: Requests,
    slave: RigSlave,
    image: Image,
    now: Instant,
    inputs: Arc<[Input]>,
    /// Whether it is walked with values alone: nothing turns until they are set back.
    writes_values: bool,
}

impl Model {
    fn new(slave: RigSlave, limits: Limits) -> Option<Self> {
        let first = Index::default();
        let setup = InverterSetup {
            parameters: vec![(1621, first, 2), (1625, first, 100)],
            ..InverterSetup::default()
        };
        let guarded = GuardedSlave {
            address: slave.address,
            ppo: slave.ppo,
        };
        let mut gate = OctetGate::new(limits, BusRate::K500, &[guarded]);
        gate.learn(slave.address, 1625, 0, 100);
        Some(Self {
            inverter: Inverter::new(&setup, Instant::START),
            gate,
            requests: Requests::new(super::MASTER, slave.address).ok()?,
            slave,
            image: Image::default(),
            now: Instant::START,
            inputs: inputs().into(),
            writes_values: false,
        })
    }

    /// One exchange with the words in force.
    fn exchange(&mut self) -> Result<(), String> {
        let ppo = self.slave.ppo.unwrap_or_default();
        let data = self.image.encode(ppo);
        let pdu = self.requests.request(Service::DataExchange, &data);
        let pdu = pdu.map_err(|error| error.to_string())?;
        for octet in Telegram::Pdu(pdu).encode().iter() {
            let admitted = self.gate.admit(self.now, *octet);
            admitted.map_err(|denial| match denial {
                FcsDenial::NotPermitted { missing, .. } => format!("needs {}", missing.name()),
                other => other.to_string(),
            })?;
        }
        let [stw, hsw, pzd3, pzd4, ..] = self.image.words;
        let outputs = Outputs {
            stw,
            hsw,
            pzd3,
            pzd4,
        };
        self.inverter.take(self.now, &outputs);
        self.pass(EXCHANGE);
        Ok(())
    }

    /// A task that reads a parameter.
    fn read(&mut self, number: u16) -> Result<Vec<String>, String> {
        let ak = Parameter::of(number).map_or(1, |parameter| Task::read(parameter).ak());
        self.task(Pkw::of(ak, number, 0, 0))
    }

    /// A task, until its answer has come (3.4.1).
    fn task(&mut self, task: Pkw) -> Result<Vec<String>, String> {
        let octets = task.encode();
        let octets: String = octets.iter().map(|octet| format!("{octet:02X}")).collect();
        self.image.pkw = task;
        for _ in 0..ANSWERED {
            self.exchange()?;
        }
        let line = format!("exchange {} PKW={octets}", self.slave.address);
        Ok(vec![line; ANSWERED])
    }

    fn pass(&mut self, millis: u64) {
        self.now += Span::from_millis(millis);
        self.inverter.advance(self.now);
    }

    /// Waits until the frequency stands at one value: the line that does so.
    fn settles(&mut self) -> Option<String> {
        let mut waited = 0;
        loop {
            let before = self.inverter.frequency(self.now);
            self.pass(20);
            if self.inverter.frequency(self.now) == before || waited > 4_000 {
                break;
            }
            waited += 20;
        }
        (waited > 0).then(|| format!("wait {}ms", waited * 5 / 4 + 20))
    }
}

impl WalkModel for Model {
    type State = State;

    fn state(&self) -> State {
        State {
            of_machine: self.inverter.state().short(),
            turning: !self.inverter.frequency(self.now).is_zero(),
            set: self.inverter.set(),
        }
    }

    fn takes(&self, input: usize) -> bool {
        matches!(self.inputs[input].1, Value(..)) == self.writes_values
    }

    fn put(&mut self, input: usize) -> Result<Vec<String>, String> {
        let address = self.slave.address;
        let exchange = format!("exchange {address}");
        let line = match self.inputs[input].1 {
            Word(stw) => {
                self.image.words[0] = stw;
                format!("{exchange} STW={stw:04X}")
            }
            Setpoint(hsw) => {
                let hsw = hsw.cast_unsigned();
                self.image.words[1] = hsw;
                format!("{exchange} HSW={hsw:04X}")
            }
            Read(number) => return self.read(number),
            Value(_, _, Some(why)) => return Err(why.to_owned()),
            Value(parameter, value, None) => {
                let word = u32::from(value as u16);
                let change = Task::change(parameter).ak();
                let mut lines = self.task(Pkw::of(change, parameter.number, 0, word))?;
                lines.extend(self.read(parameter.number)?);
                return Ok(lines);
            }
        };
        self.exchange()?;
        let mut lines = vec![line];
        lines.extend(self.settles());
        // The first reply shows the inverter as it was before the words.
        for _ in 0..2 {
            lines.push(exchange.clone());
            self.exchange()?;
        }
        Ok(lines)
    }

    fn now(&self) -> Instant {
        self.now
    }
}

/// A conversation of a walk, with the lines of the walk between the words that end a start-disable (3.3) and those that stop the motor.
const TEXT: &str = "title   A walk through the states of an inverter, with each word in each of them\n\
                    source  nordac 3.3\n\
                    bus     nordac\n\
                    slave {slave} ppo {ppo}\n\
                    slave {slave} parameter 1621 = 2\n\
                    slave {slave} parameter 1625 = 10s\n\n\
                    start {slave} watchdog 5s\n\
                    read {slave} 1625\n\
                    exchange {slave} STW=047E\n\
                    exchange {slave}\n\
                    {lines}\n\
                    exchange {slave} STW=047E HSW=0000\n\
                    wait 1s\n\
                    exchange {slave} STW=047D\n\
                    exchange {slave}\n\
                    exchange {slave}\n";

/// The walk of a slave; none where it has no parameter channel, by which it is made ready.
pub(super) fn walk_of(slave: RigSlave, limits: &Limits) -> Option<Walk<State>> {
    let mut model =
        Model::new(slave, *limits).filter(|_| slave.ppo.unwrap_or_default().has_pkw())?;
    model.image.words[0] = 0x047E;
    for _ in 0..2 {
        model.exchange().ok()?;
    }
    let values = Model {
        writes_values: true,
        ..model.clone()
    };
    let walk = |model: &Model| walk(model, model.inputs.len(), BOUNDS, &[]);
    Some(walk(&model).beside(walk(&values)))
}

/// The text of a conversation with these lines of a walk.
pub(super) fn walked(slave: RigSlave, lines: &[String]) -> String {
    let ppo = slave.ppo.unwrap_or_default().number().to_string();
    let text = TEXT.replace("{slave}", &slave.address.to_string());
    text.replace("{ppo}", &ppo)
        .replace("{lines}", &lines.join("\n"))
}

/// The inputs of a walk, in the order of their numbers.
fn inputs() -> Vec<Input> {
    let values = values().map(|value| {
        let put = Value(value.parameter, value.value, value.left_out);
        (value.name, put)
    });
    INPUTS.into_iter().chain(values).collect()
}

/// The names of the inputs, in the order of their numbers.
pub(super) fn names() -> Vec<&'static str> {
    inputs().into_iter().map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::player::RigScenario;
    use crate::simulate::{Bench, Setup};
    use harness_bench::link::Link as _;
    use harness_bench::scenario::run::{AtMismatch, play};
    use harness_bench::scenario::source::Source;
    use harness_proto::nordac::PpoType;
    use harness_sim::nordac::deviation::DEVIATIONS;

    const SLAVE: RigSlave = RigSlave {
        address: 8,
        ppo: None,
    };

    fn told(limits: &Limits) -> String {
        let walk = walk_of(SLAVE, limits).expect("a walk");
        walk.told(&names(), |_| true)
    }

    /// What is missing is named with what it would permit.
    #[test]
    fn what_the_rig_s_file_does_not_permit_is_named() {
        let all = told(&Limits::unlimited());
        assert!(all.starts_with("walked: 297 of 656 "), "{all}");
        assert!(!all.contains("allow_"), "{all}");
        let none = told(&Limits::default());
        assert!(none.contains("needs `allow_motion`"), "{none}");
    }

    /// No inverter is switched on with values that are tried.
    #[test]
    fn values_are_written_at_rest() {
        let walk = walk_of(SLAVE, &Limits::unlimited()).expect("a walk");
        // 1412, setpoint delay: 1001 is more than it can be.
        let beyond = "exchange 8 PKW=25840000000003E9";
        let part = walk
            .parts
            .iter()
            .find(|part| part.lines.iter().any(|line| line == beyond));
        let lines = &part.expect("the values").lines;
        assert!(
            lines.iter().all(|line| line.starts_with("exchange 8 PKW=")),
            "{lines:?}"
        );
    }

    /// What a slave sends in the whole walk, if it deviates.
    fn sent(deviates: Option<&str>) -> String {
        let walk = walk_of(SLAVE, &Limits::unlimited()).expect("a walk");
        let sent = walk.parts.iter().map(|part| {
            let source = Source {
                name: "walk".to_owned(),
                text: walked(SLAVE, &part.lines).into(),
            };
            let scenario = RigScenario::read(&source).expect("a conversation");
            let mut slaves = scenario.plan.setup.slaves.clone();
            slaves[0].deviation = deviates.map(|name| DEVIATIONS.named(name).expect("a deviation"));
            let rate = BusRate::K500;
            let setup = Setup {
                rate,
                slaves,
                master: None,
            };
            let mut bench = Bench::new(&setup);
            let outcome = play(&scenario.plan, &mut bench, AtMismatch::GoOn);
            format!("{:?} {:?}", outcome.verdict, bench.trace(0))
        });
        sent.collect()
    }

    /// Control words, setpoints and states that the walk was not written for show.
    #[test]
    fn wrong_inverters_send_something_else() {
        let right = sent(None);
        assert!(right.starts_with("Passed"), "{}", &right[..200]);
        for wrong in [
            "pzd-always-valid",
            "no-off2",
            "no-off3",
            "off1-coasts",
            "ramp-bit-ignored",
            "hold-bit-ignored",
            "setpoint-bit-ignored",
            "one-parameter-set",
            "starts-at-once",
            "setpoint-low-byte-first",
            "hides-off2",
            "hides-off3",
            "no-start-disable",
            "never-at-setpoint",
            "errors-are-not-reported",
        ] {
            assert_ne!(sent(Some(wrong)), right, "{wrong}");
        }
    }

    #[test]
    fn a_slave_without_a_parameter_channel_is_not_walked() {
        let slave = RigSlave {
            ppo: Some(PpoType::Three),
            ..SLAVE
        };
        assert!(walk_of(slave, &Limits::unlimited()).is_none());
    }
}
