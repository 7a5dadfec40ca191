//! An interface of Linux's SocketCAN: frames as the kernel has them (`struct can_frame` of `linux/can.h`).
//!
//! Rate and listen-only are settings of the interface, which its administrator makes: `ip link set can0 up type can bitrate 500000
//! listen-only on`. [`State`] reads them.

mod state;

pub use state::State;

use flag::{ERROR, EXTENDED, REMOTE};
use harness_proto::can::{CanError, CanEvent, Frame, Id, MAX_DATA};
use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
use rustix::io::Errno;
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
    /// Another station had the bus first; the frame is sent behind it.
    pub const LOST_ARBITRATION: u32 = 0x02;
    /// A message of the controller; `data[1]` says which.
    pub const CONTROLLER: u32 = 0x04;
    /// A violation of the protocol on the bus.
    pub const PROTOCOL: u32 = 0x08;
    /// No station acknowledged a frame.
    pub const NO_ACKNOWLEDGE: u32 = 0x20;
    /// The interface is bus-off.
    pub const BUS_OFF: u32 = 0x40;
    /// A bus error.
    pub const BUS_ERROR: u32 = 0x80;
    /// The interface was restarted.
    pub const RESTARTED: u32 = 0x100;
    /// The error counters are in the data.
    pub const COUNTERS: u32 = 0x200;
}

/// Bits of `data[1]` of a message of the controller, as Linux numbers them (`linux/can/error.h`).
mod controller {
    /// A queue was full: of received frames, or of those to be sent.
    pub(super) const OVERFLOW: u8 = 0x03;
    /// The error counters have reached the limits of warning and passive.
    pub(super) const LIMITS: u8 = 0x3C;
}

/// The length of the kernel's frame in bytes.
pub const LENGTH: usize = 16;

/// Where the data begins in it.
const DATA: usize = 8;

/// The receive buffer in bytes: some 10,000 frames, more than half a second of a full bus at 1 Mbit/s.
const BUFFER: usize = 4 << 20;

/// What an interface reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// A frame or an error on the bus.
    Heard(CanEvent),
    /// This many frames were lost since the computer read too late.
    Late(u32),
    /// The controller has lost frames; it does not say how many.
    Lost,
    /// The controller has sent a message of which the meaning is not known: it may have lost frames.
    MayBeLost,
    /// An ordinary message of the controller: lost arbitration, back in the state error-active, restarted.
    Message,
}

/// A raw socket of an interface, which never blocks.
#[derive(Debug)]
pub struct Interface {
    socket: OwnedFd,
    /// Frames that the kernel had no room for, as it counts them.
    dropped: u32,
}

impl Interface {
    /// Opens an interface by its [index](State::index), with reports of its errors. Opening one that is down succeeds.
    ///
    /// # Errors
    /// The operating system's.
    pub fn open(index: u32) -> io::Result<Self> {
        let socket = system::socket(index)?;
        // More than the limit of the system needs CAP_NET_ADMIN; without it the system's limit counts.
        use rustix::net::sockopt;
        if sockopt::set_socket_recv_buffer_size_force(&socket, BUFFER).is_err() {
            sockopt::set_socket_recv_buffer_size(&socket, BUFFER)?;
        }
        Ok(Self { socket, dropped: 0 })
    }

    /// Hands a frame to the kernel; `false` while the interface's own queue is full.
    ///
    /// # Errors
    /// The operating system's, such as that of an interface that is down.
    pub fn send(&self, frame: &[u8; LENGTH]) -> io::Result<bool> {
        match rustix::io::retry_on_intr(|| rustix::io::write(&self.socket, frame)) {
            Ok(_) => Ok(true),
            Err(Errno::AGAIN | Errno::NOBUFS) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Reads all that has come, and passes on what it reports.
    ///
    /// # Errors
    /// The operating system's. What came before it was passed on: the kernel gives an error first, and then the frames that were waiting.
    pub fn receive(&mut self, mut heard: impl FnMut(Report)) -> io::Result<()> {
        let mut failed = Ok(());
        loop {
            let mut frame = [0; LENGTH];
            match rustix::io::retry_on_intr(|| rustix::io::read(&self.socket, &mut frame)) {
                Ok(LENGTH) => decode(&frame, &mut heard),
                Ok(_) => {}
                Err(Errno::AGAIN) => break,
                Err(error) if failed.is_ok() => failed = Err(error.into()),
                Err(_) => break,
            }
        }
        // The count that comes with a frame (SO_RXQ_OVFL) tells of a loss only when another frame comes.
        let dropped = system::dropped(&self.socket).unwrap_or(self.dropped);
        let late = dropped.wrapping_sub(std::mem::replace(&mut self.dropped, dropped));
        if late > 0 {
            heard(Report::Late(late));
        }
        failed
    }
}

impl AsFd for Interface {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

/// What neither the standard library nor rustix has.
#[cfg(target_os = "linux")]
mod system {
    #![expect(
        unsafe_code,
        reason = "addresses and options of CAN sockets go to libc as they are"
    )]

    use rustix::fd::{AsRawFd, OwnedFd};
    use rustix::net::{AddressFamily, Protocol, SocketFlags, SocketType, socket_with};
    use std::ffi::c_int;
    use std::io;

    /// `struct sockaddr_can` (`linux/can.h`).
    #[repr(C)]
    struct Address {
        family: u16,
        index: c_int,
        of_protocols: [u64; 2],
    }

    /// The fields of SO_MEMINFO, and the place of the frames dropped (`linux/sock_diag.h`).
    const FIELDS: usize = 9;
    const DROPPED: usize = 8;

    pub(super) fn socket(index: u32) -> io::Result<OwnedFd> {
        let family = AddressFamily::from_raw(libc::AF_CAN as u16);
        let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
        let raw = u32::try_from(libc::CAN_RAW)
            .ok()
            .and_then(std::num::NonZero::new);
        let protocol = raw.map(Protocol::from_raw);
        let socket = socket_with(family, SocketType::RAW, flags, protocol)?;
        let every_error = libc::CAN_ERR_MASK;
        // SAFETY: the pointer and the length are those of a local that outlives the call.
        let set = unsafe {
            let value = std::ptr::from_ref(&every_error).cast();
            let (level, option) = (libc::SOL_CAN_RAW, libc::CAN_RAW_ERR_FILTER);
            libc::setsockopt(socket.as_raw_fd(), level, option, value, length::<u32>())
        };
        done(set)?;
        let address = Address {
            family: libc::AF_CAN as u16,
            index: index as c_int,
            of_protocols: [0; 2],
        };
        // SAFETY: as above.
        let bound = unsafe {
            let address = std::ptr::from_ref(&address).cast();
            libc::bind(socket.as_raw_fd(), address, length::<Address>())
        };
        done(bound).map(|()| socket)
    }

    /// How many frames the kernel had no room for since the socket was opened.
    pub(super) fn dropped(socket: &OwnedFd) -> io::Result<u32> {
        let mut fields = [0_u32; FIELDS];
        let mut size = length::<[u32; FIELDS]>();
        // SAFETY: the kernel writes at most `size` bytes, the length of the local that outlives the call.
        let got = unsafe {
            let value = std::ptr::from_mut(&mut fields).cast();
            let (level, option) = (libc::SOL_SOCKET, libc::SO_MEMINFO);
            libc::getsockopt(socket.as_raw_fd(), level, option, value, &raw mut size)
        };
        done(got).map(|()| fields[DROPPED])
    }

    const fn length<T>() -> libc::socklen_t {
        size_of::<T>() as libc::socklen_t
    }

    fn done(result: c_int) -> io::Result<()> {
        match result {
            0 => Ok(()),
            _ => Err(io::Error::last_os_error()),
        }
    }
}

/// Other systems have no such interfaces.
#[cfg(not(target_os = "linux"))]
mod system {
    use rustix::fd::OwnedFd;
    use std::io;

    pub(super) fn socket(_index: u32) -> io::Result<OwnedFd> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub(super) fn dropped(_socket: &OwnedFd) -> io::Result<u32> {
        Err(io::ErrorKind::Unsupported.into())
    }
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

/// Passes on what a frame of the kernel reports.
pub fn decode(bytes: &[u8; LENGTH], heard: &mut impl FnMut(Report)) {
    let id = u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    let number = id & Id::MAX_EXTENDED;
    let len = usize::from(bytes[4]).min(MAX_DATA);
    if id & ERROR != 0 {
        return decode_error(number, Some(bytes[DATA + 1]), heard);
    }
    let id_of = match id & EXTENDED != 0 {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let frame = id_of.and_then(|id_of| match id & REMOTE != 0 {
        true => Frame::remote(id_of, len).ok(),
        false => Frame::new(id_of, &bytes[DATA..DATA + len]).ok(),
    });
    frame
        .into_iter()
        .for_each(|frame| heard(Report::Heard(CanEvent::Frame(frame))));
}

/// Passes on what the bits of an error frame's class report, and `data[1]` where it is known.
pub fn decode_error(bits: u32, message: Option<u8>, heard: &mut impl FnMut(Report)) {
    const ORDINARY: u32 =
        class::LOST_ARBITRATION | class::CONTROLLER | class::RESTARTED | class::COUNTERS;
    let from_controller = bits & class::CONTROLLER != 0;
    let says = |mask| from_controller && message.is_some_and(|bits| bits & mask != 0);
    if says(controller::OVERFLOW) {
        heard(Report::Lost);
    }
    let error = match bits {
        _ if bits & class::BUS_OFF != 0 => Some(CanError::BusOff),
        _ if bits & class::NO_ACKNOWLEDGE != 0 => Some(CanError::NoAcknowledge),
        _ if bits & !ORDINARY != 0 || says(controller::LIMITS) => Some(CanError::ErrorFrame),
        _ => None,
    };
    match error {
        Some(error) => heard(Report::Heard(CanEvent::Error(error))),
        None if from_controller && message.is_none() => heard(Report::MayBeLost),
        None => heard(Report::Message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reports(bytes: &[u8; LENGTH]) -> Vec<Report> {
        let mut all = Vec::new();
        decode(bytes, &mut |report| all.push(report));
        all
    }

    #[test]
    fn frames_of_the_kernel_survive() {
        for text in [
            "201#3D4000",
            "1FFFFFFF#R8",
            "181#",
            "00000181#0011223344556677",
        ] {
            let frame: Frame = text.parse().expect("a frame");
            let heard = Report::Heard(CanEvent::Frame(frame));
            assert_eq!(reports(&encode(&frame)), [heard]);
        }
    }

    /// `linux/can/error.h`: what is ordinary, what is lost, and what is an error on the bus.
    #[test]
    fn an_error_frame_is_what_its_bits_say() {
        let error = |error| Report::Heard(CanEvent::Error(error));
        let [wrong, off] = [CanError::ErrorFrame, CanError::BusOff].map(error);
        for (bits, message, expected) in [
            (0x002, 0x00, &[Report::Message][..]),
            (0x004, 0x40, &[Report::Message]),
            (0x004, 0x00, &[Report::Message]),
            (0x100, 0x00, &[Report::Message]),
            (0x206, 0x40, &[Report::Message]),
            (0x004, 0x01, &[Report::Lost, Report::Message]),
            (0x004, 0x02, &[Report::Lost, Report::Message]),
            (0x004, 0x05, &[Report::Lost, wrong]),
            (0x004, 0x20, &[wrong]),
            (0x008, 0x01, &[wrong]),
            (0x010, 0x00, &[wrong]),
            (0x024, 0x20, &[error(CanError::NoAcknowledge)]),
            (0x0EC, 0x00, &[off]),
        ] {
            let mut bytes = [0; LENGTH];
            bytes[..4].copy_from_slice(&(ERROR | bits).to_ne_bytes());
            bytes[DATA + 1] = message;
            assert_eq!(reports(&bytes), expected, "{bits:03X} {message:02X}");
        }
        // Where the data is not known, as with socketcand.
        let mut all = Vec::new();
        for bits in [0x002, 0x004, 0x104, 0x00C] {
            decode_error(bits, None, &mut |report| all.push(report));
        }
        let doubt = Report::MayBeLost;
        assert_eq!(all, [Report::Message, doubt, doubt, wrong]);
    }
}
