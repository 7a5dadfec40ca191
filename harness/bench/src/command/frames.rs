//! Where `sim` serves drives on a bus of frames, and the drives of a shared line.

use crate::bus_name::BusName;
use crate::serve::ServedAt;
use crate::serve::frames::{FramePlace, Protocol};
use clap::Args;
use std::path::PathBuf;

/// Options of `sim` for drives on CAN.
#[derive(Clone, Debug, Args)]
pub struct FrameArguments {
    /// The bus and its drives.
    #[arg(long, value_enum, default_value_t = BusName::DEFAULT)]
    pub bus: BusName,
    /// How many drives are on the CAN bus: nodes 1 to N, beside those of --setup. By default node 1, if --setup has none.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(1..=127))]
    pub drives: Option<u8>,
    /// Addresses of slaves on a PROFIBUS segment, such as 8 or 8,9,20. They have factory settings but for their address and their interface: the
    /// bus controls them (1621 = 2). By default 8, if there is no --setup.
    #[arg(long, value_name = "ADDRESS", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=126))]
    pub slaves: Option<Vec<u8>>,
    /// Serve a CAN bus as a serial CAN adapter (SLCAN) behind a socket: HOST:PORT, port 0 for a free one. Several clients share the bus.
    #[arg(long, value_name = "ADDRESS", group = "place")]
    pub slcan: Vec<String>,
    /// Serve a CAN bus as a serial CAN adapter on a pseudo terminal; this path is a symbolic link to it.
    #[arg(long, value_name = "PATH", group = "place")]
    pub slcan_pty: Vec<PathBuf>,
    /// Serve a CAN bus by the protocol of socketcand: HOST:PORT, port 0 for a free one. Several clients share the bus.
    #[arg(long, value_name = "ADDRESS", group = "place")]
    pub socketcand: Vec<String>,
}

impl FrameArguments {
    /// Where the bus is served.
    pub fn places(&self) -> Vec<FramePlace> {
        let place = |protocol, at| FramePlace { protocol, at };
        let slcan = self.slcan.iter().cloned().map(ServedAt::Tcp);
        let pty = self.slcan_pty.iter().cloned().map(ServedAt::Pty);
        let socketcand = self.socketcand.iter().cloned().map(ServedAt::Tcp);
        let slcan = slcan.chain(pty).map(|at| place(Protocol::Slcan, at));
        slcan
            .chain(socketcand.map(|at| place(Protocol::Socketcand, at)))
            .collect()
    }
}
