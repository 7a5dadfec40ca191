//! An interface of Linux's SocketCAN as a way to the bus, by the crate `harness-socketcan`.

use super::adapter::Event;
use super::open::{AdapterError, AdapterSettings, Listening};
use super::transport::FrameTransport;
use crate::port::LastWords;
use crate::trouble::Trouble;
use harness_proto::can::{BitRate, Frame};
use harness_proto::time::Instant;
use harness_socketcan::{self as socketcan, State};
use rustix::event::{PollFd, PollFlags};
use rustix::fd::{AsFd, BorrowedFd};
use rustix::io::Errno;
use std::collections::VecDeque;
use std::io;
use std::time::{self, Duration};

/// Frames that wait for the kernel at most.
const MOST_WAITING: usize = 1_000;

/// How long to wait for a missing interface, and how often to look for it.
const BACK_WITHIN: Duration = Duration::from_secs(2);
const AGAIN: Duration = Duration::from_millis(50);

/// An open interface, with the frames that its queue has no room for.
#[derive(Debug)]
pub(super) struct Kernel {
    interface: socketcan::Interface,
    settings: AdapterSettings,
    name: String,
    index: u32,
    /// Whether the kernel restarts it after bus-off.
    restarts: bool,
    queue: VecDeque<[u8; socketcan::LENGTH]>,
}

impl Kernel {
    /// Opens an interface that is up and has the settings of its bus.
    pub(super) fn open(
        name: &str,
        settings: &AdapterSettings,
    ) -> Result<(Self, Listening), AdapterError> {
        let failed = |error: io::Error| AdapterError::Interface(lost(name, &error));
        let state = State::of(name).map_err(failed)?;
        let listening = fits(name, &state, settings).map_err(AdapterError::Interface)?;
        let transport = Self {
            interface: socketcan::Interface::open(state.index).map_err(failed)?,
            settings: settings.clone(),
            name: name.to_owned(),
            index: state.index,
            restarts: state.restarts,
            queue: VecDeque::new(),
        };
        Ok((transport, listening))
    }

    fn lost(&self, error: &io::Error) -> Trouble {
        let name = &self.name;
        // One that is removed goes down first.
        Trouble::Lost(match State::of(name) {
            Ok(state) if state.index == self.index => lost(name, error),
            _ => format!("{name} is gone: its adapter was pulled out, or its driver removed"),
        })
    }

    fn flush(&mut self) -> Result<(), Trouble> {
        while let Some(frame) = self.queue.front() {
            match self.interface.send(frame) {
                Ok(true) => drop(self.queue.pop_front()),
                Ok(false) => return Ok(()),
                Err(error) => return Err(self.lost(&error)),
            }
        }
        Ok(())
    }
}

/// Why nothing more is carried, and what to do.
fn lost(name: &str, error: &io::Error) -> String {
    match Errno::from_io_error(error) {
        Some(Errno::NETDOWN) => format!("{name} is down: `ip link set {name} up` brings it up"),
        Some(Errno::NODEV) => {
            format!("there is no CAN interface {name}; `drivebench rig scan` lists them")
        }
        _ => format!("{name}: the interface is lost: {error}"),
    }
}

/// Whether an interface can be used with these settings, and what is known of its acknowledges; if not, why, and what to do.
fn fits(name: &str, state: &State, settings: &AdapterSettings) -> Result<Listening, String> {
    let rate = settings.rate;
    let bits = rate.bits_per_second();
    let set =
        |what: &str| format!("`ip link set {name} down && ip link set {name} up type can {what}`");
    if !state.is_can {
        return Err(format!(
            "{name} is no CAN interface; `drivebench rig scan` lists them"
        ));
    }
    if !state.up && state.has_controller && state.rate.is_none() {
        return Err(format!(
            "{name} is down and has no bit rate: `ip link set {name} up type can bitrate {bits}` brings it up"
        ));
    }
    if !state.up {
        return Err(lost(name, &Errno::NETDOWN.into()));
    }
    if let Some(actual) = state.rate.filter(|actual| *actual != bits) {
        let actual = BitRate::from_bits_per_second(actual)
            .map_or_else(|| format!("{actual} bit/s"), |rate| rate.to_string());
        return Err(format!(
            "{name} runs at {actual}, and {rate} is expected: {}, or give its rate",
            set(&format!("bitrate {bits}"))
        ));
    }
    if state.bus_off && !state.restarts {
        return Err(format!(
            "{name} is bus-off, and sends and receives nothing: check bit rate, cable and termination, then `ip link set {name} type can restart`"
        ));
    }
    match (settings.listen_only, state.listen_only) {
        (true, true) => Ok(Listening::Only("LISTEN-ONLY")),
        (false, true) => Err(format!(
            "{name} is in listen-only mode and sends nothing: {}, or `listen_only = true` in the rig's file",
            set("listen-only off")
        )),
        (true, false) if !settings.may_acknowledge => {
            let only = match state.has_controller {
                true => format!("{}; ", set("listen-only on")),
                false => String::new(),
            };
            Err(format!(
                "{name} is not in listen-only mode: {only}with `listen_only = false` in a rig's file, or `capture --may-acknowledge`, it acknowledges \
                 frames"
            ))
        }
        (_, false) => Ok(Listening::MayAcknowledge),
    }
}

impl FrameTransport for Kernel {
    fn name(&self) -> &str {
        &self.name
    }

    fn fd(&self) -> BorrowedFd<'_> {
        self.interface.as_fd()
    }

    fn poll_fd(&self) -> PollFd<'_> {
        let mut flags = PollFlags::IN;
        flags.set(PollFlags::OUT, !self.queue.is_empty());
        PollFd::new(&self.interface, flags)
    }

    fn waits(&self) -> bool {
        !self.queue.is_empty()
    }

    fn carries(&self, _frame: &Frame) -> bool {
        true
    }

    fn is_ready(&self) -> bool {
        self.queue.is_empty()
    }

    fn send(&mut self, _now: Instant, frame: &Frame) -> Result<(), Trouble> {
        if self.queue.len() >= MOST_WAITING {
            let name = &self.name;
            return Err(Trouble::Lost(format!(
                "{name}: the interface takes no frames"
            )));
        }
        self.queue.push_back(socketcan::encode(frame));
        self.flush()
    }

    fn attend(&mut self, _now: Instant) -> Result<(), Trouble> {
        self.flush()
    }

    fn due(&self) -> Option<Instant> {
        None
    }

    fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble> {
        let end = self
            .interface
            .receive(|report| events.push(Event::of(report, now)));
        end.map_err(|error| self.lost(&error))
    }

    fn last_words(&self) -> io::Result<LastWords> {
        let fd = self.interface.as_fd().try_clone_to_owned()?;
        // The kernel takes one frame at a time.
        Ok(LastWords::plain(fd, self.name.clone(), |pieces| {
            let coded = pieces.as_out().frames().iter().map(socketcan::encode);
            coded.map(|bytes| bytes.to_vec()).collect()
        }))
    }

    fn restarts(&self) -> bool {
        self.restarts
    }

    /// Opens the interface again when it is back, with the settings of its bus.
    fn revive(&mut self) -> bool {
        let end = time::Instant::now() + BACK_WITHIN;
        loop {
            let (name, settings) = (self.name.clone(), self.settings.clone());
            if let Ok((transport, _)) = Self::open(&name, &settings) {
                *self = transport;
                return true;
            }
            if time::Instant::now() >= end {
                return false;
            }
            std::thread::sleep(AGAIN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::frames::{AdapterPlace, FrameLink};
    use crate::link::{Line as _, PortLink as _};
    use crate::medium::HeardPiece;
    use harness_proto::can::{CanError, CanEvent};
    use std::net::{TcpListener, TcpStream};
    use std::sync::Arc;

    fn sends() -> AdapterSettings {
        AdapterSettings {
            place: AdapterPlace::Kernel {
                interface: "can3".to_owned(),
            },
            rate: BitRate::K500,
            listen_only: false,
            may_acknowledge: false,
        }
    }

    /// What differs from the settings is named with the command that changes it, and the interface at hand.
    #[test]
    fn an_interface_fits_or_is_named_with_its_remedy() {
        let sends = sends();
        let listens = AdapterSettings {
            listen_only: true,
            ..sends.clone()
        };
        let permitted = AdapterSettings {
            may_acknowledge: true,
            ..listens.clone()
        };
        let good = State {
            is_can: true,
            up: true,
            has_controller: true,
            rate: Some(500_000),
            ..State::default()
        };
        let silent = State {
            listen_only: true,
            ..good.clone()
        };
        let of_nothing = State {
            has_controller: false,
            rate: None,
            ..good.clone()
        };
        let off = |restarts| State {
            bus_off: true,
            restarts,
            ..good.clone()
        };
        let may = Ok(Listening::MayAcknowledge);
        for (state, settings, expected) in [
            (good.clone(), &sends, may),
            (of_nothing.clone(), &sends, may),
            (silent.clone(), &listens, Ok(Listening::Only("LISTEN-ONLY"))),
            (good.clone(), &permitted, may),
            (
                of_nothing,
                &listens,
                Err("can3 is not in listen-only mode: with"),
            ),
            (
                good.clone(),
                &listens,
                Err("can3 up type can listen-only on`; with"),
            ),
            (silent, &sends, Err("listen-only mode and sends nothing")),
            (State::default(), &sends, Err("can3 is no CAN interface")),
            (
                State {
                    up: false,
                    ..good.clone()
                },
                &sends,
                Err("`ip link set can3 up` brings"),
            ),
            (
                State {
                    up: false,
                    rate: None,
                    ..good.clone()
                },
                &sends,
                Err("`ip link set can3 up type can bitrate 500000` brings"),
            ),
            (
                State {
                    rate: Some(250_000),
                    ..good.clone()
                },
                &sends,
                Err("can3 runs at 250 kbit/s, and 500 kbit/s is expected"),
            ),
            (
                off(false),
                &sends,
                Err("`ip link set can3 type can restart`"),
            ),
            (off(true), &sends, may),
        ] {
            match (fits("can3", &state, settings), expected) {
                (Ok(listening), expected) => assert_eq!(Ok(listening), expected, "{state:?}"),
                (Err(why), Err(words)) => assert!(why.contains(words), "{why}"),
                (Err(why), Ok(_)) => panic!("{why}"),
            }
        }
    }

    fn heard() -> CanEvent {
        CanEvent::Frame("181#AA".parse().expect("a frame"))
    }

    /// An interface that goes bus-off, still delivers what was queued before, and is back when it is next looked for.
    #[derive(Debug)]
    struct Short {
        restarts: bool,
        end: TcpStream,
        back: bool,
    }

    impl FrameTransport for Short {
        fn name(&self) -> &str {
            "can0"
        }
        fn fd(&self) -> BorrowedFd<'_> {
            self.end.as_fd()
        }
        fn poll_fd(&self) -> PollFd<'_> {
            PollFd::new(&self.end, PollFlags::IN)
        }
        fn waits(&self) -> bool {
            false
        }
        fn carries(&self, _: &Frame) -> bool {
            true
        }
        fn is_ready(&self) -> bool {
            true
        }
        fn send(&mut self, _: Instant, _: &Frame) -> Result<(), Trouble> {
            Ok(())
        }
        fn attend(&mut self, _: Instant) -> Result<(), Trouble> {
            Ok(())
        }
        fn due(&self) -> Option<Instant> {
            None
        }
        fn receive(&mut self, now: Instant, events: &mut Vec<Event>) -> Result<(), Trouble> {
            if self.back {
                return Ok(());
            }
            let off = CanEvent::Error(CanError::BusOff);
            events.extend([
                Event::Late(7),
                Event::Heard(now, off),
                Event::Heard(now, heard()),
            ]);
            Err(Trouble::Lost("can0 is down".to_owned()))
        }
        fn last_words(&self) -> io::Result<LastWords> {
            let end = self.end.try_clone()?.into();
            Ok(LastWords::plain(end, String::new(), |_| Vec::new()))
        }
        fn restarts(&self) -> bool {
            self.restarts
        }
        fn revive(&mut self) -> bool {
            self.back = true;
            true
        }
    }

    #[test]
    fn an_interface_that_was_down_for_a_while_is_taken_up_again() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        for (restarts, words, unplaced) in [(true, "can0 is down", 8), (false, "bus-off", 7)] {
            let end = TcpStream::connect(address).expect("a socket");
            let back = false;
            let short = Box::new(Short {
                restarts,
                end,
                back,
            });
            let settings = sends();
            let mut link = FrameLink::over(short, &settings, Vec::new(), Arc::default());
            assert!(!link.wait(link.now()));
            let lost = link.trouble().expect("trouble").to_string();
            assert!(lost.contains(words), "{lost}");
            let last = std::iter::from_fn(|| link.receive(0)).last();
            assert_eq!(
                last.map(|(_, heard)| heard),
                Some(HeardPiece::Frame(heard()))
            );
            assert_eq!(link.take_unplaced(), unplaced);
            link.resume();
            let now = link.now();
            assert!(link.trouble().is_none() && link.wait(now));
        }
    }
}
