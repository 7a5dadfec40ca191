//! Sockets that listen: for several clients, or for one at a time.

use super::arrival::{ClientStream, ask};
use crate::listen::{ListenError, listen};
use harness_proto::time::Span;
use rustix::event::{PollFd, PollFlags};
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::time::Instant;

/// Connections taken at a time.
const TAKEN: usize = 16;

/// A socket that listens.
#[derive(Debug)]
pub(super) struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    since: Instant,
}

impl Listener {
    /// Listens at an address of this machine's own, unless another one is allowed.
    pub(super) fn open(text: &str, allow_remote: bool) -> Result<Self, ListenError> {
        let since = Instant::now();
        let (socket, address) = listen(text, allow_remote)?;
        ask(&socket);
        Ok(Self {
            socket,
            address,
            since,
        })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    pub(super) fn poll(&self) -> PollFd<'_> {
        PollFd::new(&self.socket, PollFlags::IN)
    }

    /// Accepts waiting connections, a bounded number at a time.
    pub(super) fn accept(&self) -> impl Iterator<Item = (ClientStream, SocketAddr)> {
        // A connection that fails here has closed again or will be accepted later.
        let waiting = std::iter::from_fn(|| self.socket.accept().ok()).take(TAKEN);
        waiting.filter_map(|(stream, address)| {
            stream.set_nonblocking(true).ok()?;
            // Bytes are to be sent at once. If this fails, they arrive later, but they arrive.
            let _late = stream.set_nodelay(true);
            Some((ClientStream::new(stream, self.since), address))
        })
    }
}

/// A socket and its present client.
#[derive(Debug)]
pub(super) struct Tcp {
    listener: Listener,
    client: Option<ClientStream>,
}

impl Tcp {
    /// Listens at an address of this machine's own, unless another one is allowed.
    pub(super) fn listen(text: &str, allow_remote: bool) -> Result<Self, ListenError> {
        Ok(Self {
            listener: Listener::open(text, allow_remote)?,
            client: None,
        })
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.listener.address()
    }

    pub(super) fn taken(&self) -> bool {
        self.client.is_some()
    }

    /// Accepts waiting connections: who comes, and from where.
    pub(super) fn accept(&self) -> Vec<(ClientStream, SocketAddr)> {
        self.listener.accept().collect()
    }

    /// Accepts a client; there must be none.
    pub(super) fn seat(&mut self, client: ClientStream) {
        self.client = Some(client);
    }

    /// Reads from the client; 0 bytes if it has disconnected. The second value is the age of the last byte.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> io::Result<(usize, Span)> {
        match &mut self.client {
            Some(client) => client.read(buffer),
            None => Err(io::ErrorKind::WouldBlock.into()),
        }
    }

    pub(super) fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.client {
            Some(client) => client.write(bytes),
            None => Err(io::ErrorKind::WouldBlock.into()),
        }
    }

    pub(super) fn close(&mut self) {
        self.client = None;
    }

    /// What to wait for: the listener, and the client if any events of it are wanted.
    pub(super) fn polls(&self, events: PollFlags) -> (PollFd<'_>, Option<PollFd<'_>>) {
        let door = self.listener.poll();
        let client = self.client.as_ref().filter(|_| !events.is_empty());
        (door, client.map(|client| PollFd::new(client, events)))
    }
}
