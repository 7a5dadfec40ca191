//! Sockets that listen: at addresses of this machine alone, unless others are allowed.

use std::io;
use std::net::{SocketAddr, TcpListener, ToSocketAddrs};

/// Why a socket does not listen.
#[derive(Debug, thiserror::Error)]
pub enum ListenError {
    /// Other machines could reach it.
    #[error(
        "{address} can be reached from other machines: a loopback address such as 127.0.0.1 expected, or --allow-remote"
    )]
    Remote { address: SocketAddr },
    /// The socket cannot listen.
    #[error("failed to listen at {address}: {error}; HOST:PORT expected, port 0 for a free one")]
    Failed {
        /// As written.
        address: String,
        error: io::Error,
    },
}

/// Listens at `HOST:PORT`, without blocking when it accepts.
///
/// # Errors
/// The address is not one of this machine alone and `allow_remote` is not given, or the system refuses it.
pub fn listen(text: &str, allow_remote: bool) -> Result<(TcpListener, SocketAddr), ListenError> {
    let failed = |error| ListenError::Failed {
        address: text.to_owned(),
        error,
    };
    let mut addresses = text.to_socket_addrs().map_err(failed)?;
    let address = addresses.next().ok_or_else(|| {
        let error = "the name has no address";
        failed(io::Error::new(io::ErrorKind::NotFound, error))
    })?;
    if !address.ip().is_loopback() && !allow_remote {
        return Err(ListenError::Remote { address });
    }
    let socket = TcpListener::bind(address).map_err(failed)?;
    socket.set_nonblocking(true).map_err(failed)?;
    let address = socket.local_addr().map_err(failed)?;
    Ok((socket, address))
}
