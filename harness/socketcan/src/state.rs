//! The state of an interface, as the kernel tells it by rtnetlink (`linux/if_link.h`, `linux/can/netlink.h`). Needs no privilege.

use rustix::fd::AsFd as _;
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType};
use std::io;

const GET_LINK: u16 = 18;
const NEW_LINK: u16 = 16;
const REQUEST: u16 = 1;
/// The length of a message's header, and of `struct ifinfomsg` behind it.
const HEADER: usize = 16;
const INFO: usize = 16;

/// Numbers of attributes, from the outermost in.
const LINK_INFO: u16 = 18;
const INFO_DATA: u16 = 2;
const BIT_TIMING: u16 = 1;
const STATE: u16 = 4;
const MODE: u16 = 5;
const RESTART: u16 = 6;

/// `ARPHRD_CAN`, `IFF_UP`, `CAN_STATE_BUS_OFF`, `CAN_CTRLMODE_LISTENONLY`.
const CAN: u16 = 280;
const UP: u32 = 1;
const BUS_OFF: u32 = 3;
const LISTEN_ONLY: u32 = 2;

/// What the kernel says of an interface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// Its number.
    pub index: u32,
    /// Whether it is one of CAN.
    pub is_can: bool,
    /// Whether it is up.
    pub up: bool,
    /// Whether it has a controller with settings; a virtual one (vcan) has none.
    pub has_controller: bool,
    /// Bits a second, where they were set by `ip link`.
    pub rate: Option<u32>,
    /// Whether the controller sends nothing, not even acknowledges.
    pub listen_only: bool,
    /// Whether the controller takes no part in the bus any more.
    pub bus_off: bool,
    /// Whether the kernel restarts it by itself behind bus-off (`restart-ms`).
    pub restarts: bool,
}

impl State {
    /// Asks the kernel.
    ///
    /// # Errors
    /// The operating system's; there is no such interface.
    pub fn of(name: &str) -> io::Result<Self> {
        ask(name)
    }

    /// Reads the kernel's answer.
    #[must_use]
    pub fn parse(message: &[u8]) -> Option<Self> {
        let end = usize::try_from(number(message, 0)?)
            .ok()?
            .min(message.len());
        let info = message.get(HEADER..HEADER + INFO)?;
        if short(message, 4)? != NEW_LINK {
            return None;
        }
        let mut state = Self {
            is_can: short(info, 2)? == CAN,
            index: number(info, 4)?,
            up: number(info, 8)? & UP != 0,
            ..Self::default()
        };
        let link = attribute(message.get(HEADER + INFO..end)?, LINK_INFO);
        let data = link.and_then(|link| attribute(link, INFO_DATA));
        if let Some(data) = data.filter(|_| state.is_can) {
            let value = |kind, at| attribute(data, kind).and_then(|data| number(data, at));
            state.has_controller = value(STATE, 0).is_some();
            state.rate = value(BIT_TIMING, 0).filter(|bits| *bits > 0);
            state.bus_off = value(STATE, 0) == Some(BUS_OFF);
            // The modes that can be set stand in front of those that are.
            state.listen_only = value(MODE, 4).is_some_and(|modes| modes & LISTEN_ONLY != 0);
            state.restarts = value(RESTART, 0).is_some_and(|millis| millis > 0);
        }
        Some(state)
    }
}

#[cfg(target_os = "linux")]
fn ask(name: &str) -> io::Result<State> {
    let flags = SocketFlags::CLOEXEC;
    let socket = rustix::net::socket_with(AddressFamily::NETLINK, SocketType::RAW, flags, None)?;
    let index = rustix::net::netdevice::name_to_index(socket.as_fd(), name)?;
    let mut request = [0; HEADER + INFO];
    request[..4].copy_from_slice(&((HEADER + INFO) as u32).to_ne_bytes());
    request[4..6].copy_from_slice(&GET_LINK.to_ne_bytes());
    request[6..8].copy_from_slice(&REQUEST.to_ne_bytes());
    request[HEADER + 4..HEADER + 8].copy_from_slice(&index.to_ne_bytes());
    rustix::net::send(&socket, &request, SendFlags::empty())?;
    let mut answer = vec![0; 32 << 10];
    let (read, _) = rustix::net::recv(&socket, &mut answer[..], RecvFlags::empty())?;
    // Between two calls the interface may have gone.
    State::parse(&answer[..read]).ok_or_else(|| io::Error::from_raw_os_error(libc::ENODEV))
}

#[cfg(not(target_os = "linux"))]
fn ask(_name: &str) -> io::Result<State> {
    Err(io::ErrorKind::Unsupported.into())
}

/// The first attribute of a kind: length and kind in 16 bits each, the value, and a gap to the next multiple of four.
fn attribute(mut bytes: &[u8], kind: u16) -> Option<&[u8]> {
    const OF_KIND: u16 = 0x3FFF;
    loop {
        let length = usize::from(short(bytes, 0)?);
        let value = bytes.get(4..length)?;
        if short(bytes, 2)? & OF_KIND == kind {
            return Some(value);
        }
        bytes = bytes.get(length.next_multiple_of(4)..)?;
    }
}

fn short(bytes: &[u8], at: usize) -> Option<u16> {
    let two = bytes.get(at..at + 2)?;
    Some(u16::from_ne_bytes(two.try_into().ok()?))
}

fn number(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at + 4)?;
    Some(u32::from_ne_bytes(four.try_into().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(kind: u16, value: &[u8]) -> Vec<u8> {
        let length = 4 + value.len();
        let mut attribute = [length as u16, kind].map(u16::to_ne_bytes).concat();
        attribute.extend(value);
        attribute.resize(length.next_multiple_of(4), 0);
        attribute
    }

    fn answer(flags: u32, of: u16, data: &[u8]) -> Vec<u8> {
        let name = with(3, b"can0\0");
        let kind = with(1, b"can\0");
        let link = [kind, with(INFO_DATA, data)].concat();
        let info = [with(LINK_INFO | 0x8000, &link)].concat();
        let mut message = [
            0,
            u32::from(NEW_LINK),
            0,
            0,
            u32::from(of) << 16,
            7,
            flags,
            0,
        ]
        .map(u32::to_ne_bytes)
        .concat();
        message.extend([name, info].concat());
        let length = message.len() as u32;
        message[..4].copy_from_slice(&length.to_ne_bytes());
        message
    }

    fn words(all: &[u32]) -> Vec<u8> {
        all.iter().flat_map(|word| word.to_ne_bytes()).collect()
    }

    #[test]
    fn the_answer_of_the_kernel_is_read() {
        let data = [
            with(BIT_TIMING, &words(&[500_000, 875, 0, 0, 0, 0, 0, 0])),
            with(STATE, &words(&[BUS_OFF])),
            with(MODE, &words(&[0xFF, LISTEN_ONLY])),
            with(RESTART, &words(&[100])),
        ]
        .concat();
        let whole = answer(0x1_0043, CAN, &data);
        let expected = State {
            index: 7,
            is_can: true,
            up: true,
            has_controller: true,
            rate: Some(500_000),
            listen_only: true,
            bus_off: true,
            restarts: true,
        };
        assert_eq!(State::parse(&whole), Some(expected));
        // Modes that could be set, and are not.
        let data = with(MODE, &words(&[0xFF, 0]));
        let state = State::parse(&answer(0, CAN, &data)).expect("an answer");
        assert!(!state.listen_only && !state.up && !state.has_controller && state.rate.is_none());
        // `lo`, and an error of the kernel.
        assert!(State::parse(&answer(UP, 772, &[])).is_some_and(|state| !state.is_can));
        assert_eq!(State::parse(&words(&[36, 2, 0, 0, 19])), None);
        for cut in 0..whole.len() {
            let _no_panic = State::parse(&whole[..cut]);
        }
    }

    #[test]
    fn an_interface_of_this_machine_is_asked_for() {
        assert!(State::of("can-none0").is_err());
        if let Ok(lo) = State::of("lo") {
            assert!(!lo.is_can && !lo.has_controller);
        }
    }
}
