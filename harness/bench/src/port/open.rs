//! Opening, with an error of its own for everything that can be wrong.

use super::holder::{OtherProgram, holder};
use super::rfc2217::{self, NegotiationError};
use super::serial;
use super::wire::{Coding, Wire};
use harness_proto::line::{Format, Parity};
use harness_proto::marks::Unmark;
use rustix::fs::{Mode, OFlags};
use rustix::termios::{OptionalActions, QueueSelector};
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(5);

/// What to do about a server that speaks telnet where bytes alone are expected.
const RAW: &str = "let the server carry the bytes alone (ser2net: `accepter: tcp,PORT`, without telnet and rfc2217)";

/// The same where the rig's file can name the protocol.
const RFC_2217_OR_RAW: &str = "say transport = \"rfc2217\" and `port` in the rig's file, or let the server carry the bytes alone (ser2net: \
                               `accepter: tcp,PORT`, without telnet and rfc2217)";

/// Where a stream is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PortAddress {
    /// A serial port: `/dev/ttyUSB0`.
    Serial(PathBuf),
    /// A pseudo terminal: its slave end.
    Pty(PathBuf),
    /// A socket: `host:port`.
    Tcp(String),
    /// A serial port behind a socket: `host:port`.
    Rfc2217(String),
}

impl std::fmt::Display for PortAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Serial(path) | Self::Pty(path) => write!(f, "{}", path.display()),
            Self::Tcp(address) | Self::Rfc2217(address) => f.write_str(address),
        }
    }
}

/// What to open, and how.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortSettings {
    pub address: PortAddress,
    /// The rate and the format of a serial line, with 8 data bits.
    pub format: Format,
    /// Whether a pty or a socket carries line errors as in-band marks.
    pub marks: bool,
    /// Whether to ask a USB adapter for its lowest latency. It is not an error if it cannot.
    pub low_latency: bool,
}

/// Why a port cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no such port.
    #[error(
        "there is no port {0}: check that the adapter is plugged in; `drivebench rig scan` lists the ports"
    )]
    Missing(String),
    /// The user has no right to open it.
    #[error(
        "no permission to open {0}: on most systems users of the group `dialout` have it (ls -l {0})"
    )]
    Denied(String),
    /// Another program has it.
    #[error("{port} is in use by another program{}", by(holder.as_ref()))]
    InUse {
        port: String,
        /// Which program, where the kernel shows it.
        holder: Option<OtherProgram>,
    },
    /// The path is something else than a port.
    #[error("{0} is not a {1}")]
    NotA(String, &'static str),
    /// A pty where a serial port should be.
    #[error("{0} is a pseudo terminal, which has no parity: say transport = \"pty\"")]
    PseudoTerminal(String),
    /// The port does not take the settings.
    #[error("{port}: the adapter refused {what}; the line needs it: use another adapter")]
    Setting {
        port: String,
        /// What it does not do.
        what: String,
    },
    /// The chip makes another rate.
    #[error(
        "{port}: the port cannot make {asked} bit/s: its driver takes the rate, and its chip makes {made} bit/s, the nearest part of its base rate; use an \
         adapter that makes it (the guide's page on wiring has a list)"
    )]
    Rate {
        port: String,
        /// The rate that it was asked for.
        asked: u32,
        /// The rate that it makes.
        made: u32,
    },
    /// No host, or it refuses.
    #[error("failed to connect to {address}: {error}. {}", unconnected(error))]
    Connect { address: String, error: io::Error },
    /// The other end is no RFC 2217 server, or cannot do 8O1.
    #[error("{address}: {error}")]
    Negotiation {
        address: String,
        /// What was refused.
        error: NegotiationError,
    },
    /// Anything else.
    #[error("failed to open {port}: {error}")]
    Other { port: String, error: io::Error },
}

fn by(holder: Option<&OtherProgram>) -> String {
    holder.map_or(String::new(), |holder| format!(": {holder}"))
}

/// The likely cause of a connection that cannot be made, and what to do next.
fn unconnected(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::ConnectionRefused => {
            "Likely cause: no server listens at this port. Next: start the server, or correct the address"
        }
        io::ErrorKind::TimedOut
        | io::ErrorKind::HostUnreachable
        | io::ErrorKind::NetworkUnreachable => {
            "Likely cause: the host is switched off, or it is not on this network. Next: check its power and its cable, and the address"
        }
        _ => "Next: check the address",
    }
}

impl OpenError {
    pub(super) fn of(port: &Path, error: &io::Error) -> Self {
        let name = port.display().to_string();
        match error.kind() {
            io::ErrorKind::NotFound => Self::Missing(name),
            io::ErrorKind::PermissionDenied => Self::Denied(name),
            io::ErrorKind::ResourceBusy => Self::InUse {
                port: name,
                holder: holder(port),
            },
            _ if error.raw_os_error() == Some(rustix::io::Errno::NODEV.raw_os_error()) => {
                Self::Missing(name)
            }
            kind => Self::Other {
                port: name,
                error: error
                    .raw_os_error()
                    .map_or_else(|| kind.into(), io::Error::from_raw_os_error),
            },
        }
    }
}

/// A format as it is printed: `8O1`.
pub(super) fn printed(format: Format) -> String {
    let parity = match format.parity {
        Parity::None => 'N',
        Parity::Odd => 'O',
        Parity::Even => 'E',
    };
    format!("8{parity}{}", format.stop_bits)
}

/// Opens a stream: raw, with nothing sent, and what was received before dropped.
///
/// # Errors
/// [`OpenError`]; the port is unchanged.
pub fn open(settings: &PortSettings) -> Result<Wire, OpenError> {
    let name = settings.address.to_string();
    let plain = || match settings.marks {
        true => Coding::Marked(Unmark::default()),
        false => Coding::Plain,
    };
    match &settings.address {
        PortAddress::Serial(path) => {
            let (fd, serial) = serial::open(path, settings.format, settings.low_latency)?;
            let coding = Coding::Serial(Unmark::default(), Box::new(serial));
            Ok(Wire::new(fd, name, coding))
        }
        PortAddress::Pty(path) => Ok(Wire::new(pty(path)?, name, plain())),
        PortAddress::Tcp(address) => {
            let wire = Wire::new(connect(address)?.into(), name, plain());
            Ok(wire.without_telnet(RFC_2217_OR_RAW))
        }
        PortAddress::Rfc2217(address) => {
            let stream = connect(address)?;
            let telnet = rfc2217::negotiate(&stream, settings.format).map_err(|error| {
                OpenError::Negotiation {
                    address: address.clone(),
                    error,
                }
            })?;
            Ok(Wire::new(
                stream.into(),
                name,
                Coding::Telnet(Box::new(telnet)),
            ))
        }
    }
}

/// Opens the stream of an adapter that speaks in characters: a serial port with 8N1 at this rate, a pseudo terminal or a socket. Nothing
/// is sent, and what was received before is dropped.
///
/// # Errors
/// [`OpenError`]; the port is unchanged.
pub(crate) fn open_adapter(address: &PortAddress, bits_per_second: u32) -> Result<Wire, OpenError> {
    let name = address.to_string();
    match address {
        PortAddress::Serial(path) | PortAddress::Pty(path) => {
            match serial::open_plain(path, bits_per_second) {
                Ok((fd, serial)) => Ok(Wire::new(fd, name, Coding::Plain).keeping(serial)),
                Err(OpenError::PseudoTerminal(_)) => Ok(Wire::new(pty(path)?, name, Coding::Plain)),
                Err(error) => Err(error),
            }
        }
        PortAddress::Tcp(address) | PortAddress::Rfc2217(address) => {
            let wire = Wire::new(connect(address)?.into(), name, Coding::Plain);
            Ok(wire.without_telnet(RAW))
        }
    }
}

fn pty(path: &Path) -> Result<rustix::fd::OwnedFd, OpenError> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let fd = rustix::fs::open(path, flags, Mode::empty())
        .map_err(|error| OpenError::of(path, &error.into()))?;
    let other = |error: rustix::io::Errno| match error {
        rustix::io::Errno::NOTTY => OpenError::NotA(path.display().to_string(), "terminal"),
        error => OpenError::of(path, &error.into()),
    };
    let mut termios = rustix::termios::tcgetattr(&fd).map_err(other)?;
    termios.make_raw();
    rustix::termios::tcsetattr(&fd, OptionalActions::Now, &termios).map_err(other)?;
    rustix::termios::tcflush(&fd, QueueSelector::IFlush).map_err(other)?;
    Ok(fd)
}

fn connect(address: &str) -> Result<TcpStream, OpenError> {
    let failed = |error| OpenError::Connect {
        address: address.to_owned(),
        error,
    };
    let mut last = io::ErrorKind::AddrNotAvailable.into();
    for address in address.to_socket_addrs().map_err(failed)? {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(failed)?;
                stream.set_nonblocking(true).map_err(failed)?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(failed(last))
}
