//! Rig files of UNITEK drives: identifiers, limits, and the simulated bench.

mod interlock;
mod known;
mod observed;
mod permitted;
mod player;
mod probe;
mod profile;
mod qualify;
mod run;
mod session;
mod set_back;
mod values;
mod walk;

pub(crate) use permitted::limits;
use permitted::register_mistakes;
pub(crate) use player::Player;
pub(crate) use session::{OfUnitek, Session, UnitekDrives};
pub(crate) use set_back::HeldBefore;

use super::language::Unitek;
use super::serve;
use super::simulate::{DriveSetup, Setup};
use harness_bench::command::rig_commands::RigCommands;
use harness_bench::rig::buses::PortRow;
use harness_bench::rig::port_file::{CONFIRMATION, Node, Port, PortBus};
use harness_bench::scenario::parse::header::header_lines;
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::Source;
use harness_proto::can::BitRate;
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX};

pub(crate) const PORT: PortRow = PortRow {
    bus: PortBus::Unitek,
    adapters: &["slcan", "socketcand", "socketcan"],
    keys: &["channel"],
    limits: &[
        "max_speed",
        "allow_bus_settings",
        "allow_other_identifiers",
        "allow_registers",
        "ranges",
        "bit_rate_way_back",
        "store_bus_settings",
    ],
    simulated,
    named,
    has_rate: |bits| BitRate::from_bits_per_second(bits).is_some(),
    drive: |index, node| {
        let (number, (rx, tx)) = drive(index, node);
        (number, vec![rx, tx])
    },
    setup_mistakes: |port, source| setup(port, source).err(),
    steps: |source| header_lines::<Unitek>(source).err(),
    register_mistakes,
    interlock: ("register", interlock::checked),
};

pub(crate) const COMMANDS: RigCommands = RigCommands::of_port::<UnitekDrives, Unitek>();

fn simulated(drives: u8) -> (String, String) {
    let nodes = (1..=drives).map(|node| format!("{{ node = {node} }}"));
    let limits = format!(
        "allow_bus_settings = true\nallow_other_identifiers = true\nbit_rate_way_back = \"it is simulated\"\n\
         store_bus_settings = \"{CONFIRMATION}\"\n"
    );
    (nodes.collect::<Vec<_>>().join(", "), limits)
}

const fn named(node: Node) -> Result<(), (&'static str, &'static str)> {
    let named = match (node.rx, node.tx) {
        (Some(_), Some(_)) => true,
        (None, None) => node.node.is_some(),
        _ => false,
    };
    match named && node.address.is_none() && node.ppo.is_none() {
        true => Ok(()),
        false => Err((
            "a drive needs its number or both identifiers",
            "`node`, or `rx` and `tx`, expected",
        )),
    }
}

/// A drive of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Axis {
    /// Its number, 1 to 127.
    pub(crate) node: u8,
    /// The identifier on which it receives.
    pub(crate) rx: u16,
    /// The identifier on which it sends.
    pub(crate) tx: u16,
}

/// The drive that stands at a place of a port's list: its number, and its identifiers to receive and to send (UNITEK 3.1).
#[must_use]
pub(crate) fn drive(index: usize, node: Node) -> (u8, (u16, u16)) {
    let place = u8::try_from(index + 1).unwrap_or(u8::MAX);
    let number = node.node.unwrap_or(place);
    let offset = u16::from(number) - 1;
    let given = (node.rx, node.tx);
    let rx = given.0.unwrap_or(DEFAULT_RX + offset);
    let tx = given.1.unwrap_or(DEFAULT_TX + offset);
    (number, (rx, tx))
}

/// The drives of a port.
#[must_use]
pub(crate) fn axes(port: &Port) -> Vec<Axis> {
    let all = port.drives.iter().enumerate();
    all.map(|(index, node)| {
        let (node, (rx, tx)) = drive(index, *node);
        Axis { node, rx, tx }
    })
    .collect()
}

#[must_use]
pub(crate) fn rate(port: &Port) -> BitRate {
    // The file was checked.
    BitRate::from_bits_per_second(port.rate.bits_per_second()).unwrap_or(BitRate::K500)
}

/// The drives of a simulated port, as they are switched on. `source` has header lines of a scenario about them; a drive that they do not
/// name is as delivered. The identifiers are those of the port.
///
/// # Errors
/// The lines have mistakes.
pub(crate) fn setup(port: &Port, source: &Source) -> Result<Setup, Problems> {
    let named = serve::bench(Some(0), Some(source))?.setup.drives;
    let axes = axes(port);
    let missing = |drive: &&DriveSetup| axes.iter().all(|axis| axis.node != drive.node);
    if let Some(drive) = named.iter().find(missing) {
        let message = format!("the port has no drive {}", drive.node);
        let problem = Problem::new(TextSpan::default(), message, "a drive of `drives` expected");
        return Err(Problems::new(
            &source.name,
            source.text.clone(),
            vec![problem],
        ));
    }
    let drive = |axis: Axis| {
        let named = named.iter().find(|drive| drive.node == axis.node);
        DriveSetup {
            identifiers: (axis.rx, axis.tx),
            ..named.cloned().unwrap_or_else(|| DriveSetup::new(axis.node))
        }
    };
    let drives = axes.iter().copied().map(drive);
    Ok(Setup::new(rate(port), drives.collect()))
}
