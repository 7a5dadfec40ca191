//! Rig files of UNITEK drives: identifiers, limits, and the simulated bench.

mod permitted;
mod session;

pub use permitted::limits;
pub(crate) use permitted::special_register;
pub use session::Session;

use super::simulate::{DriveSetup, Setup};
use crate::rig::Rig;
use crate::rig::port_file::{Node, Port};
use harness_proto::can::BitRate;
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX};

/// A drive of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its number, 1 to 127.
    pub node: u8,
    /// The identifier on which it receives.
    pub rx: u16,
    /// The identifier on which it sends.
    pub tx: u16,
}

/// The drive that stands at a place of a port's list: its number, and its identifiers to receive and to send (UNITEK 3.1).
#[must_use]
pub fn drive(index: usize, node: Node) -> (u8, (u16, u16)) {
    let place = u8::try_from(index + 1).unwrap_or(u8::MAX);
    let number = node.node.unwrap_or(place);
    let offset = u16::from(number) - 1;
    let own = (node.rx, node.tx);
    let rx = own.0.unwrap_or(DEFAULT_RX + offset);
    let tx = own.1.unwrap_or(DEFAULT_TX + offset);
    (number, (rx, tx))
}

/// The drives of a port.
#[must_use]
pub fn axes(port: &Port) -> Vec<Axis> {
    let all = port.drives.iter().enumerate();
    all.map(|(index, node)| {
        let (node, (rx, tx)) = drive(index, *node);
        Axis { node, rx, tx }
    })
    .collect()
}

/// The bit rate of a port.
#[must_use]
pub fn rate(port: &Port) -> BitRate {
    let bits = port.rate.saturating_mul(1000);
    // The file was checked.
    BitRate::from_bits_per_second(bits).unwrap_or(BitRate::K500)
}

/// The drives of a simulated rig, as they are switched on: their hardware enable and power are on. `None` of a rig without `[port.1]`.
#[must_use]
pub fn setup(rig: &Rig) -> Option<Setup> {
    let port = rig.port()?;
    let drives = axes(port).into_iter().map(|axis| {
        let mut drive = DriveSetup::new(axis.node);
        drive.identifiers = (axis.rx, axis.tx);
        (drive.inputs.run, drive.inputs.rfe) = (true, true);
        drive
    });
    Some(Setup {
        rate: rate(port),
        drives: drives.collect(),
    })
}
