//! Simulated rings for a controller under test, served from a thread of another program.

use super::Error;
use super::drives::released;
use crate::buses::novobus::serve::Server;
use crate::medium::ErrorMarks;
use crate::serve::{EndRequest, Pace, ServeError, ServeHost, ServeOptions, ServedAt, serve_until};
use std::io;
use std::net::SocketAddr;
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Sender, channel};
use std::thread::{JoinHandle, spawn};

/// A simulated ring that a controller reaches over TCP, in real time: the socket takes the place of its serial port. It is served until
/// this value is dropped.
#[derive(Debug)]
pub struct Served {
    address: SocketAddr,
    handle: Option<UnixStream>,
    thread: Option<JoinHandle<Result<(), ServeError>>>,
}

impl Served {
    /// Serves a ring of `drives` whole ND21, 1 to 250, at an address of this machine, such as `127.0.0.1:0` for a free port. `setup`
    /// holds header lines of a scenario, such as `drive 1 deviates writes-ignored`. If it is empty, the inputs of every drive release and
    /// start it. A byte that comes back damaged is given as it was read.
    ///
    /// # Errors
    /// `setup` has mistakes, the address is in use, or other machines would reach it.
    pub fn ring(drives: u8, setup: &str, address: &str) -> Result<Self, Error> {
        let (plan, link) = released(drives, setup)?;
        let server = Server::new(plan, link, Pace::Line, ErrorMarks::None);
        let options = ServeOptions {
            places: vec![ServedAt::Tcp(address.to_owned())],
            ..ServeOptions::default()
        };
        let (handle, ending) = EndRequest::by_handle().map_err(ServeError::Wait)?;
        let (listens, listening) = channel();
        let thread = spawn(move || {
            serve_until(ending, server, &options, &mut Teller(listens)).map(|_end| ())
        });
        let Ok(address) = listening.recv() else {
            return Err(match thread.join() {
                Ok(Err(error)) => error.into(),
                _ => Error::Serve(format!("failed to serve a ring at {address}")),
            });
        };
        Ok(Self {
            address,
            handle: Some(handle),
            thread: Some(thread),
        })
    }

    /// Where the controller connects.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        drop(self.handle.take());
        if let Some(thread) = self.thread.take() {
            // A ring that has failed before leaves nothing to give back.
            let _ended = thread.join();
        }
    }
}

/// Passes the address on. The lines about clients are for the user of `drivebench sim`.
struct Teller(Sender<SocketAddr>);

impl ServeHost for Teller {
    fn tell(&mut self, _line: &str) -> io::Result<()> {
        Ok(())
    }

    fn say(&mut self, _line: &str) {}

    fn listens(&mut self, at: SocketAddr) {
        // Only the first address is waited for.
        let _not_awaited = self.0.send(at);
    }
}
