//! Rig files of NORDAC inverters: addresses, limits, and the simulated bench.

mod held;
pub(crate) mod interlock;
mod known;
mod observed;
mod permitted;
mod player;
mod profile;
mod qualify;
mod restore;
mod run;
mod session;
mod settle;
pub(crate) mod talk;
mod values;
mod walk;

pub(crate) use held::HeldBefore;
pub(crate) use permitted::limits;
pub(crate) use player::Player;
pub(crate) use session::{Inverters, OfNordac, Session};

use super::language::Nordac;
use super::simulate::Setup;
use harness_bench::command::rig_commands::RigCommands;
use harness_bench::rig::buses::PortRow;
use harness_bench::rig::port_file::{Node, Port, PortBus};
use harness_bench::scenario::parse::header::{Part, header_lines, read};
use harness_bench::scenario::plan::plan as settle;
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::guard::GuardedSlave;
use harness_proto::nordac::properties::{Choices, NordacProperty};
use harness_proto::profibus::BusRate;
use std::collections::BTreeSet;

/// The address of the bench's own master.
pub(crate) const MASTER: u8 = 2;

/// The address of the first simulated slave.
const FIRST: u8 = 8;

pub(crate) const PORT: PortRow = PortRow {
    bus: PortBus::Nordac,
    adapters: &["serial", "tcp", "port"],
    keys: &["transport", "marks", "echo"],
    limits: &[
        "allow_bus_settings",
        "allow_motor_data",
        "allow_other_stations",
        "allow_unsupervised",
        "max_setpoint",
        "max_frequency",
        "max_eeprom_writes",
    ],
    simulated,
    named,
    has_rate: |bits| BusRate::from_bits_per_second(bits).is_some(),
    drive: |_, node| (node.address.unwrap_or_default(), Vec::new()),
    setup_mistakes: |port, source| setup(port, source).err(),
    steps: |source| header_lines::<Nordac>(source).err(),
    register_mistakes: |_| Vec::new(),
    interlock: ("parameter", interlock::checked),
};

pub(crate) const COMMANDS: RigCommands = RigCommands::of_port::<Inverters, Nordac>();

/// Drives of a simulated bench, as its file lists them, and the limits with which all is permitted.
fn simulated(drives: u8) -> (String, String) {
    let nodes = (0..drives).map(|place| format!("{{ address = {} }}", FIRST + place));
    let limits = "allow_bus_settings = true\nallow_motor_data = true\nallow_other_stations = true\nallow_unsupervised = true\n";
    (nodes.collect::<Vec<_>>().join(", "), limits.to_owned())
}

const fn named(node: Node) -> Result<(), (&'static str, &'static str)> {
    let foreign = node.node.is_some() || node.rx.is_some() || node.tx.is_some();
    match (node.address, foreign) {
        (Some(MASTER), _) => Err((
            "address 2 is that of the bench's own master",
            "another address expected",
        )),
        (Some(_), false) => Ok(()),
        _ => Err((
            "a drive needs its address, and nothing but its PPO type beside it",
            "`address`, and `ppo` where it is known, expected",
        )),
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RigSlave {
    /// Its address, 1 to 126.
    pub(crate) address: u8,
    /// The PPO type that it is set to, as far as it is known.
    pub(crate) ppo: Option<PpoType>,
}

impl From<RigSlave> for GuardedSlave {
    fn from(slave: RigSlave) -> Self {
        Self {
            address: slave.address,
            ppo: slave.ppo,
        }
    }
}

/// The slaves of a port, as its file lists them.
#[must_use]
pub(crate) fn slaves(port: &Port) -> Vec<RigSlave> {
    let all = port.drives.iter();
    all.map(|node| RigSlave {
        address: node.address.unwrap_or_default(),
        ppo: node.ppo.and_then(PpoType::from_number),
    })
    .collect()
}

#[must_use]
pub(crate) fn rate(port: &Port) -> BusRate {
    // The file was checked.
    BusRate::from_bits_per_second(port.rate.bits_per_second()).unwrap_or_default()
}

/// The slaves of a simulated port, as they are switched on. `source` has header lines of a scenario about them. The bus controls them: their
/// interface is 2 (1621), unless a line says another.
///
/// # Errors
/// The lines have mistakes, or name a slave that the port does not have.
pub(crate) fn setup(port: &Port, source: &Source) -> Result<Setup, Problems> {
    let slaves = slaves(port);
    let lines = slaves.iter().map(|slave| {
        let (address, ppo) = (slave.address, slave.ppo.unwrap_or_default().number());
        format!("slave {address} ppo {ppo}\nslave {address} parameter 1621 = 2\n")
    });
    let base = Source::new("setup", lines.collect::<String>());
    let mut scenario: Scenario<Nordac> = read(&base, Part::Header)?;
    let more: Scenario<Nordac> = read(source, Part::Header)?;
    scenario.header.slaves.extend(more.header.slaves);
    scenario.header.master = more.header.master;
    scenario.steps.clear();
    let setup = settle(&scenario, source, None)?.setup;
    let there = |address: u8| slaves.iter().any(|slave| slave.address == address);
    if let Some(other) = setup.slaves.iter().find(|slave| !there(slave.address)) {
        let message = format!("the port has no slave {}", other.address);
        let problem = Problem::new(
            TextSpan::default(),
            message,
            "an address of `drives` expected",
        );
        return Err(Problems::new(
            &source.name,
            source.text.clone(),
            vec![problem],
        ));
    }
    Ok(Setup {
        rate: rate(port),
        ..setup
    })
}

/// The most numbers of a property that are all tried.
const MOST_NUMBERS: u8 = 20;

/// Values of a property: each of its words or numbers; of many numbers some from the least to the most.
pub(crate) fn values(property: &NordacProperty) -> Vec<String> {
    match property.accepts {
        Choices::Words(words) => words.iter().map(|word| (*word).to_owned()).collect(),
        Choices::Count { least, most, .. } if most - least < MOST_NUMBERS => {
            (least..=most).map(|number| number.to_string()).collect()
        }
        Choices::Count {
            least,
            default,
            most,
        } => {
            let numbers =
                BTreeSet::from([least, default, default.saturating_add(1).min(most), most]);
            numbers.iter().map(u8::to_string).collect()
        }
    }
}
