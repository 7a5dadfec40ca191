//! Opening a CAN adapter: the handshake of its language.

use super::adapter::{Adapter, Socketcand};
use super::kernel::Kernel;
use super::talk::Talk;
use super::transport::FrameTransport;
use crate::frames::slcan::{BitTiming, SlcanCommand, rate_of};
use crate::port::{OpenError, PortAddress, open_adapter};
use crate::trouble::Trouble;
use harness_proto::can::BitRate;
use std::fmt;
use std::str::FromStr;
use std::sync::atomic::AtomicBool;

/// The rate of the serial line of adapters with a UART; those on USB ignore it.
pub(crate) const DEFAULT_BAUD: u32 = 115_200;

/// A CAN adapter, and how to reach it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AdapterPlace {
    /// An adapter that speaks SLCAN.
    Slcan {
        /// A serial port, a pseudo terminal or a socket.
        at: PortAddress,
        /// Bits a second on its serial line.
        baud: u32,
    },
    /// A server that speaks the protocol of socketcand.
    Socketcand {
        /// `host:port`.
        address: String,
        /// The bus, such as `can0`.
        channel: String,
    },
    /// An interface of Linux's SocketCAN.
    Kernel {
        /// Its name, such as `can0`.
        interface: String,
    },
}

impl AdapterPlace {
    /// An SLCAN adapter as rig files and options name it: a path is a serial port or a pseudo terminal, everything else `host:port`.
    #[must_use]
    pub fn slcan(place: &str) -> Self {
        let at = match place.contains('/') {
            true => PortAddress::Serial(place.into()),
            false => PortAddress::Tcp(place.to_owned()),
        };
        Self::Slcan {
            at,
            baud: DEFAULT_BAUD,
        }
    }
}

impl FromStr for AdapterPlace {
    type Err = String;

    /// `slcan:/dev/ttyACM0`, `slcan:host:port`, `socketcand:host:port/can0` or `socketcan:can0`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no CAN adapter; slcan:/dev/ttyACM0, slcan:HOST:PORT, socketcand:HOST:PORT/can0 or socketcan:can0 expected"
            )
        };
        let (kind, place) = text.split_once(':').ok_or_else(wrong)?;
        match kind {
            _ if place.is_empty() => Err(wrong()),
            "slcan" => Ok(Self::slcan(place)),
            "socketcand" => {
                let (address, channel) = place.split_once('/').unwrap_or((place, "can0"));
                Ok(Self::Socketcand {
                    address: address.to_owned(),
                    channel: channel.to_owned(),
                })
            }
            "socketcan" => Ok(Self::Kernel {
                interface: place.to_owned(),
            }),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for AdapterPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slcan { at, .. } => write!(f, "slcan:{at}"),
            Self::Socketcand { address, channel } => write!(f, "socketcand:{address}/{channel}"),
            Self::Kernel { interface } => write!(f, "socketcan:{interface}"),
        }
    }
}

/// A CAN adapter and the settings of its bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSettings {
    pub place: AdapterPlace,
    /// The rate of the bus. A server of socketcand and an interface of the kernel have a rate of their own, which is not changed; that of
    /// an interface has to be this one.
    pub rate: BitRate,
    /// Whether the adapter sends nothing: with SLCAN not even acknowledges.
    pub listen_only: bool,
    /// Whether an adapter that is to listen only, and cannot or does not confirm that it does, is opened all the same.
    pub may_acknowledge: bool,
}

/// What is known of an adapter's acknowledgements, the most first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Listening {
    /// It took this command or setting, in which it sends nothing on the bus.
    Only(&'static str),
    /// It was sent its command, which its firmware never confirms.
    Unconfirmed(&'static str),
    /// It acknowledges frames, or may do so.
    MayAcknowledge,
}

/// Why a CAN adapter cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AdapterError {
    /// Its stream cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The stream ended or failed.
    #[error("{0}")]
    Trouble(Trouble),
    /// It does not answer.
    #[error(
        "{port} does not answer {command}: {expected} expected; check that it is one, and the rate of its serial line"
    )]
    Silent {
        port: String,
        command: &'static str,
        expected: &'static str,
    },
    /// It answers something else.
    #[error("{port} is no {expected}: {received}")]
    Other {
        port: String,
        expected: &'static str,
        received: String,
    },
    /// It refuses a command.
    #[error("{port} refuses {what}: {remedy}")]
    Refused {
        port: String,
        what: String,
        remedy: &'static str,
    },
    /// An SLCAN adapter cannot have the rate.
    #[error(
        "an SLCAN adapter cannot run at {0}: its clock of 8 MHz is no multiple; S0 to S8 are 10, 20, 50, 100, 125, 250, 500, 800 and 1000 \
         kbit/s"
    )]
    Rate(BitRate),
    /// An interface of the kernel cannot be used: why, and what to do.
    #[error("{0}")]
    Interface(String),
    /// The program was interrupted.
    #[error("interrupted")]
    Interrupted,
}

/// Opens an adapter: its stream, and the language on it.
pub(super) fn open(
    settings: &AdapterSettings,
    interrupt: &AtomicBool,
) -> Result<(Box<dyn FrameTransport>, Listening), AdapterError> {
    match &settings.place {
        AdapterPlace::Slcan { at, baud } => {
            let commands = rate_commands(settings.rate)?;
            let wire = open_adapter(at, *baud)?;
            let mut talk = Talk::new(wire, interrupt);
            let end = talk.open_slcan(commands, settings);
            if end.is_err() {
                talk.close();
            }
            let (adapter, listening) = end?;
            Ok((talk.opened(Adapter::Slcan(adapter)), listening))
        }
        AdapterPlace::Socketcand { address, channel } => {
            let wire = open_adapter(&PortAddress::Tcp(address.clone()), DEFAULT_BAUD)?;
            let mut talk = Talk::new(wire, interrupt);
            talk.open_socketcand(channel)?;
            let opened = talk.opened(Adapter::Socketcand(Socketcand::new()));
            Ok((opened, Listening::MayAcknowledge))
        }
        AdapterPlace::Kernel { interface } => {
            let (kernel, listening) = Kernel::open(interface, settings)?;
            Ok((Box::new(kernel), listening))
        }
    }
}

/// The command that chooses a rate: a code, or bit timing registers.
fn rate_commands(rate: BitRate) -> Result<SlcanCommand, AdapterError> {
    let code = (0..=8).find(|code| rate_of(*code) == Some(rate));
    let timing = || BitTiming::of(rate).map(SlcanCommand::Timing);
    let command = code.map(SlcanCommand::Rate).or_else(timing);
    command.ok_or(AdapterError::Rate(rate))
}
