//! An interface of Linux's SocketCAN: frames as the kernel has them (`struct can_frame` of `linux/can.h`).
//!
//! Rate and listen-only are settings of the interface, which its administrator makes: `ip link set can0 type can bitrate 500000
//! listen-only on`. The socket needs the feature `socketcan`; its codec is tested, and the socket was never tried on a kernel with CAN.

use flag::{ERROR, EXTENDED, REMOTE};
use harness_proto::can::{CanError, CanEvent, Frame, Id, MAX_DATA};
use rustix::fd::{AsFd, BorrowedFd};
use rustix::io::Errno;
use std::fmt;
use std::io;

/// Flags beside an identifier, as Linux has them (`linux/can.h`).
pub mod flag {
    /// It has 29 bits.
    pub const EXTENDED: u32 = 0x8000_0000;
    /// A remote frame.
    pub const REMOTE: u32 = 0x4000_0000;
    /// An error frame: the identifier is its class.
    pub const ERROR: u32 = 0x2000_0000;
}

/// The bits of an error frame's class, as Linux numbers them (`linux/can/error.h`).
pub mod class {
    /// The interface is bus-off.
    pub const BUS_OFF: u32 = 0x40;
    /// No station acknowledged a frame.
    pub const NO_ACKNOWLEDGE: u32 = 0x20;
    /// A bus error.
    pub const BUS_ERROR: u32 = 0x80;
    /// A problem of the controller: error passive, a lost frame.
    pub const CONTROLLER: u32 = 0x04;
    /// A violation of the protocol on the bus.
    pub const PROTOCOL: u32 = 0x08;
    /// The interface was restarted.
    pub const RESTARTED: u32 = 0x100;
}

/// The length of the kernel's frame in bytes.
pub const LENGTH: usize = 16;

/// Where the data begins in it.
const DATA: usize = 8;

#[cfg(feature = "socketcan")]
type Socket = socketcan::CanSocket;
#[cfg(not(feature = "socketcan"))]
type Socket = std::os::fd::OwnedFd;

/// A raw socket of an interface, which never blocks.
#[derive(Debug)]
pub struct Interface(Socket);

/// Why an interface was not opened.
#[derive(Debug)]
pub enum OpenError {
    /// This build has no feature `socketcan`.
    NotBuilt,
    /// The interface is not in the mode listen-only, or `ip` of iproute2 does not say so.
    NotListenOnly,
    /// The operating system's error.
    System(io::Error),
}

impl fmt::Display for OpenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotBuilt => f.write_str("this build has no feature `socketcan`"),
            Self::NotListenOnly => f.write_str("the interface is not in the mode listen-only"),
            Self::System(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for OpenError {}

impl Interface {
    /// Opens an interface, with reports of its errors. With `listen_only` it has to be in that mode.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(name: &str, listen_only: bool) -> Result<Self, OpenError> {
        if cfg!(feature = "socketcan") && listen_only && !mode_is_listen_only(name) {
            return Err(OpenError::NotListenOnly);
        }
        socket(name).map(Self)
    }

    /// Hands a frame to the kernel; `false` while the interface's own queue is full.
    ///
    /// # Errors
    /// The operating system's, such as that of an interface that is down.
    pub fn send(&self, frame: &[u8; LENGTH]) -> io::Result<bool> {
        match rustix::io::retry_on_intr(|| rustix::io::write(&self.0, frame)) {
            Ok(_) => Ok(true),
            Err(Errno::AGAIN | Errno::NOBUFS) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Reads all that has come, and passes on what it reports.
    ///
    /// # Errors
    /// The operating system's. What came before it was passed on.
    pub fn receive(&self, mut heard: impl FnMut(CanEvent)) -> io::Result<()> {
        loop {
            let mut frame = [0; LENGTH];
            match rustix::io::retry_on_intr(|| rustix::io::read(&self.0, &mut frame)) {
                Ok(LENGTH) => decode(&frame).into_iter().for_each(&mut heard),
                Ok(_) => {}
                Err(Errno::AGAIN) => return Ok(()),
                Err(error) => return Err(error.into()),
            }
        }
    }
}

impl AsFd for Interface {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(feature = "socketcan")]
fn socket(name: &str) -> Result<Socket, OpenError> {
    use socketcan::{Socket as _, SocketOptions as _};
    let open = || {
        let socket = Socket::open(name)?;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        Ok(socket)
    };
    open().map_err(OpenError::System)
}

#[cfg(not(feature = "socketcan"))]
fn socket(_name: &str) -> Result<Socket, OpenError> {
    Err(OpenError::NotBuilt)
}

/// Whether an interface is in listen-only mode, as `ip` of iproute2 reads it back from the kernel.
fn mode_is_listen_only(interface: &str) -> bool {
    let arguments = ["-details", "-json", "link", "show", "dev", interface];
    let output = std::process::Command::new("ip").args(arguments).output();
    output.is_ok_and(|own| listens_only(&own.stdout))
}

/// The same, of what `ip` says.
fn listens_only(json: &[u8]) -> bool {
    let links: serde_json::Value = serde_json::from_slice(json).unwrap_or_default();
    let mode = links.pointer("/0/linkinfo/info_data/ctrlmode");
    let words = mode.and_then(serde_json::Value::as_array);
    words.is_some_and(|own| own.iter().any(|word| word == "LISTEN-ONLY"))
}

/// A frame as the kernel takes it.
pub fn encode(frame: &Frame) -> [u8; LENGTH] {
    let mut id = frame.id().number();
    if frame.id().is_extended() {
        id |= EXTENDED;
    }
    if frame.is_remote() {
        id |= REMOTE;
    }
    let mut bytes = [0; LENGTH];
    bytes[..4].copy_from_slice(&id.to_ne_bytes());
    bytes[4] = frame.dlc() as u8;
    bytes[DATA..DATA + frame.data().len()].copy_from_slice(frame.data());
    bytes
}

/// What a frame of the kernel reports; `None` for what says nothing of the bus.
fn decode(bytes: &[u8; LENGTH]) -> Option<CanEvent> {
    let id = u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let number = id & Id::MAX_EXTENDED;
    if id & ERROR != 0 {
        return match number {
            bits if bits & class::BUS_OFF != 0 => Some(CanEvent::Error(CanError::BusOff)),
            bits if bits & class::NO_ACKNOWLEDGE != 0 => {
                Some(CanEvent::Error(CanError::NoAcknowledge))
            }
            bits if bits & class::RESTARTED != 0 => None,
            _ => Some(CanEvent::Error(CanError::ErrorFrame)),
        };
    }
    let id_of = match id & EXTENDED != 0 {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let len = usize::from(bytes[4]).min(MAX_DATA);
    let frame = match id & REMOTE != 0 {
        true => Frame::remote(id_of?, len),
        false => Frame::new(id_of?, &bytes[DATA..DATA + len]),
    };
    frame.ok().map(CanEvent::Frame)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_kernel_survive() {
        for text in [
            "201#3D4000",
            "1FFFFFFF#R8",
            "181#",
            "00000181#0011223344556677",
        ] {
            let frame: Frame = text.parse().expect("a frame");
            assert_eq!(decode(&encode(&frame)), Some(CanEvent::Frame(frame)));
        }
        let error = |class: u32| {
            let mut bytes = [0; LENGTH];
            bytes[..4].copy_from_slice(&(ERROR | class).to_ne_bytes());
            decode(&bytes)
        };
        assert_eq!(
            error(class::BUS_OFF),
            Some(CanEvent::Error(CanError::BusOff))
        );
        assert_eq!(
            error(class::CONTROLLER),
            Some(CanEvent::Error(CanError::ErrorFrame))
        );
        assert_eq!(error(class::RESTARTED), None);
    }

    /// As iproute2 writes it.
    #[test]
    fn the_mode_is_read_back() {
        let of = |modes: &str| {
            format!(
                r#"[{{"ifname":"can0","linkinfo":{{"info_kind":"can","info_data":{{"ctrlmode":[{modes}],"state":"ERROR-ACTIVE"}}}}}}]"#
            )
        };
        assert!(listens_only(of(r#""LOOPBACK","LISTEN-ONLY""#).as_bytes()));
        assert!(!listens_only(of(r#""LOOPBACK""#).as_bytes()));
        assert!(!listens_only(b"Device \"can0\" does not exist."));
        assert!(Interface::open("can-none0", true).is_err());
    }

    #[test]
    fn an_interface_that_is_not_there_is_an_error_of_the_system() {
        let error = Interface::open("can-none0", false).expect_err("no interface");
        let built = matches!(error, OpenError::System(_));
        assert_eq!(built, cfg!(feature = "socketcan"), "{error:?}");
    }
}
