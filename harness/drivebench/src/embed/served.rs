//! Simulated rings for a controller under test, served from a thread of another program.

use super::{Error, embedding};
use harness_bench::serve::ServedThread;
use std::net::SocketAddr;

/// A simulated ring that a controller reaches over TCP, in real time: the socket takes the place of its serial port. It is served until
/// this value is dropped.
#[derive(Debug)]
pub struct Served {
    address: SocketAddr,
    _thread: ServedThread,
}

impl Served {
    /// Serves a ring of `drives` whole ND21, 1 to 250, at an address of this machine, such as `127.0.0.1:0` for a free port. `setup`
    /// holds header lines of a scenario, such as `drive 1 deviates writes-ignored`. If it is empty, the inputs of every drive release and
    /// start it. A byte that comes back damaged is given as it was read.
    ///
    /// # Errors
    /// `setup` has mistakes, the address is in use, or other machines would reach it.
    pub fn ring(drives: u8, setup: &str, address: &str) -> Result<Self, Error> {
        let thread = (embedding().served)(drives, setup, address)?;
        let place = thread.places().first().and_then(|place| place.parse().ok());
        let address =
            place.ok_or_else(|| Error::Serve(format!("failed to serve a ring at {address}")))?;
        Ok(Self {
            address,
            _thread: thread,
        })
    }

    /// Where the controller connects.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}
