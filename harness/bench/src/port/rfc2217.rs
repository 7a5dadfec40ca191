//! A serial port behind a socket: Telnet (RFC 854, 856) with the COM port options of RFC 2217.
//!
//! Rate and format are asked for and checked. So is the notification of line errors, to which some servers (ser2net among them) say nothing. The
//! protocol tells that there was a line error, not at which byte: what such a link cannot show makes a verdict inconclusive.

use harness_proto::line::{Format, Parity};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

const IAC: u8 = 255;
const DONT: u8 = 254;
const DO: u8 = 253;
const WONT: u8 = 252;
const WILL: u8 = 251;
const SB: u8 = 250;
const SE: u8 = 240;

const BINARY: u8 = 0;
const SUPPRESS_GO_AHEAD: u8 = 3;
const COM_PORT: u8 = 44;

/// What the server answers is the command with 100 added.
const ANSWER: u8 = 100;
const NOTIFY_LINE_STATE: u8 = 6 + ANSWER;

/// Overrun, parity error, framing error, break.
const LINE_ERRORS: u8 = 0b1_1110;

/// The longest answer that is read; the rest of a longer one is dropped.
const MOST_ANSWER: usize = 64;

/// How long the server may take to answer everything.
const PATIENCE: Duration = Duration::from_secs(3);

/// And how long to say whether it tells of line errors.
const FOR_LINE_STATE: Duration = Duration::from_millis(500);

/// Whether a connection begins as one of telnet does: with a command about one of the options that servers of serial ports name first. Lines
/// of characters, and the telegrams of the buses here, do not begin so.
pub(super) fn is_telnet(first: [u8; 3]) -> bool {
    /// Binary, echo, suppress go-ahead, status, timing mark, terminal type and speed, window size, flow control, line mode, environment, COM port.
    const OPTIONS: [u8; 13] = [
        BINARY,
        1,
        SUPPRESS_GO_AHEAD,
        5,
        6,
        24,
        31,
        32,
        33,
        34,
        36,
        39,
        COM_PORT,
    ];
    let [iac, command, option] = first;
    iac == IAC && (WILL..=DONT).contains(&command) && OPTIONS.contains(&option)
}

/// Why a server cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum NegotiationError {
    /// It does not answer as RFC 2217 says, or not at all.
    #[error("the other end does not speak RFC 2217 (no answer to {0} within 3 s)")]
    Silent(&'static str),
    /// It refuses the request.
    #[error("the other end refuses the COM port options of RFC 2217")]
    Refused,
    /// It has set another value than was asked for.
    #[error("{what}: asked for {asked}, the other end set {got}")]
    Otherwise {
        /// Which setting.
        what: &'static str,
        /// What was asked for, as the protocol codes it.
        asked: u32,
        /// The value that it reports as set.
        got: u32,
    },
    /// The connection failed.
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
}

/// The settings in the order of the requests: name, command, value, number of bytes of the value.
fn settings(format: Format) -> [(&'static str, u8, u32, usize); 5] {
    let (parity, code) = match format.parity {
        Parity::None => ("no parity", 1),
        Parity::Odd => ("odd parity", 2),
        Parity::Even => ("even parity", 3),
    };
    [
        ("the rate", 1, format.bits_per_second, 4),
        ("8 data bits", 2, 8, 1),
        (parity, 3, code, 1),
        ("stop bits", 4, format.stop_bits.into(), 1),
        ("no flow control", 5, 1, 1),
    ]
}

/// One end of the connection, bytes in and bytes out.
#[derive(Debug, Default)]
pub(super) struct Telnet {
    state: TelnetState,
    replies: Vec<u8>,
    answers: VecDeque<Vec<u8>>,
    errors: u64,
    agreed: bool,
    refused: bool,
}

#[derive(Debug, Default)]
enum TelnetState {
    #[default]
    Data,
    Command,
    Option(u8),
    Sub(Vec<u8>),
    SubCommand(Vec<u8>),
}

impl Telnet {
    /// What the connection begins with.
    fn begin() -> Vec<u8> {
        let mut bytes = vec![IAC, WILL, COM_PORT];
        for option in [BINARY, SUPPRESS_GO_AHEAD] {
            bytes.extend([IAC, WILL, option, IAC, DO, option]);
        }
        bytes
    }

    /// A byte of data as it is written: an FF is doubled.
    pub(super) fn escape(byte: u8) -> ([u8; 2], usize) {
        ([byte, byte], if byte == IAC { 2 } else { 1 })
    }

    /// What has to be sent because of what was received.
    pub(super) fn take_replies(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.replies)
    }

    /// How many line errors the server has reported since the last call.
    pub(super) fn take_errors(&mut self) -> u64 {
        std::mem::take(&mut self.errors)
    }

    /// Takes a byte of the stream; a byte of data comes out.
    pub(super) fn push(&mut self, byte: u8) -> Option<u8> {
        let mut data = None;
        self.state = match (std::mem::take(&mut self.state), byte) {
            (TelnetState::Data, IAC) => TelnetState::Command,
            (TelnetState::Data, byte) => {
                data = Some(byte);
                TelnetState::Data
            }
            (TelnetState::Command, IAC) => {
                data = Some(IAC);
                TelnetState::Data
            }
            (TelnetState::Command, SB) => TelnetState::Sub(Vec::new()),
            (TelnetState::Command, verb @ (DO | DONT | WILL | WONT)) => TelnetState::Option(verb),
            (TelnetState::Command, _) => TelnetState::Data,
            (TelnetState::Option(verb), option) => {
                self.option(verb, option);
                TelnetState::Data
            }
            (TelnetState::Sub(sub), IAC) => TelnetState::SubCommand(sub),
            (TelnetState::Sub(sub), byte) => TelnetState::Sub(with(sub, byte)),
            (TelnetState::SubCommand(sub), IAC) => TelnetState::Sub(with(sub, IAC)),
            (TelnetState::SubCommand(sub), SE) => {
                self.answer(sub);
                TelnetState::Data
            }
            (TelnetState::SubCommand(_), _) => TelnetState::Data,
        };
        data
    }

    fn option(&mut self, verb: u8, option: u8) {
        match (verb, option) {
            (DO | WILL, COM_PORT) => self.agreed = true,
            (DONT | WONT, COM_PORT) => self.refused = true,
            // Asked for at the beginning: nothing more to say.
            (_, BINARY | SUPPRESS_GO_AHEAD) => {}
            (DO, option) => self.replies.extend([IAC, WONT, option]),
            (WILL, option) => self.replies.extend([IAC, DONT, option]),
            _ => {}
        }
    }

    fn answer(&mut self, sub: Vec<u8>) {
        match sub[..] {
            [COM_PORT, NOTIFY_LINE_STATE, state] => {
                self.errors += u64::from(state & LINE_ERRORS != 0);
            }
            [COM_PORT, ..] if self.answers.len() < MOST_ANSWER => self.answers.push_back(sub),
            _ => {}
        }
    }

    /// The answer to a setting, if it was received.
    fn answer_to(&mut self, command: u8) -> Option<u32> {
        while let Some(answer) = self.answers.pop_front() {
            if answer.get(1) == Some(&(command + ANSWER)) {
                let value = answer[2..].iter().take(4);
                return Some(value.fold(0, |value, byte| value << 8 | u32::from(*byte)));
            }
        }
        None
    }
}

fn with(mut sub: Vec<u8>, byte: u8) -> Vec<u8> {
    if sub.len() < MOST_ANSWER {
        sub.push(byte);
    }
    sub
}

/// A setting as it is asked for.
fn ask(command: u8, value: u32, size: usize) -> Vec<u8> {
    let mut bytes = vec![IAC, SB, COM_PORT, command];
    for byte in &value.to_be_bytes()[4 - size..] {
        bytes.push(*byte);
        if *byte == IAC {
            bytes.push(IAC);
        }
    }
    bytes.extend([IAC, SE]);
    bytes
}

/// Requests the rate, the format and notification of line errors, and checks every answer.
pub(super) fn negotiate(stream: &TcpStream, format: Format) -> Result<Telnet, NegotiationError> {
    let mut telnet = Telnet::default();
    let end = Instant::now() + PATIENCE;
    let mut stream = stream;
    stream.write_all(&Telnet::begin())?;
    converse(&mut telnet, stream, end, "the COM port option", |telnet| {
        (telnet.agreed || telnet.refused).then_some(())
    })?;
    if telnet.refused {
        return Err(NegotiationError::Refused);
    }
    for (what, command, asked, size) in settings(format) {
        stream.write_all(&ask(command, asked, size))?;
        let got = converse(&mut telnet, stream, end, what, |telnet| {
            telnet.answer_to(command)
        })?;
        if got != asked {
            return Err(NegotiationError::Otherwise { what, asked, got });
        }
    }
    notify(&mut telnet, stream)?;
    Ok(telnet)
}

/// Requests notification of line errors. A server that does not answer may send them all the same; one that answers with another
/// mask does not.
fn notify(telnet: &mut Telnet, mut stream: &TcpStream) -> Result<(), NegotiationError> {
    const COMMAND: u8 = 10;
    let (what, asked) = ("notification of line errors", u32::from(LINE_ERRORS));
    stream.write_all(&ask(COMMAND, asked, 1))?;
    let end = Instant::now() + FOR_LINE_STATE;
    let got = converse(telnet, stream, end, what, |telnet| {
        telnet.answer_to(COMMAND)
    });
    match got {
        Ok(got) if got != asked => Err(NegotiationError::Otherwise { what, asked, got }),
        Ok(_) | Err(NegotiationError::Silent(_)) => Ok(()),
        Err(error) => Err(error),
    }
}

/// Reads until something is received.
fn converse<T>(
    telnet: &mut Telnet,
    mut stream: &TcpStream,
    end: Instant,
    what: &'static str,
    mut come: impl FnMut(&mut Telnet) -> Option<T>,
) -> Result<T, NegotiationError> {
    loop {
        if let Some(value) = come(telnet) {
            return Ok(value);
        }
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(NegotiationError::Silent(what));
        }
        let timeout = Timespec {
            tv_sec: 0,
            tv_nsec: i64::from(left.min(Duration::from_millis(100)).subsec_nanos()),
        };
        let mut fds = [PollFd::new(&stream, PollFlags::IN)];
        match poll(&mut fds, Some(&timeout)) {
            Ok(0) | Err(rustix::io::Errno::INTR) => continue,
            Ok(_) => {}
            Err(error) => return Err(NegotiationError::Io(error.into())),
        }
        let mut buffer = [0; 256];
        match stream.read(&mut buffer) {
            Ok(0) => return Err(NegotiationError::Silent(what)),
            Ok(length) => {
                for byte in &buffer[..length] {
                    // What the line says while the settings are not made means nothing.
                    let _not_yet = telnet.push(*byte);
                }
                stream.write_all(&telnet.take_replies())?;
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(telnet: &mut Telnet, bytes: &[u8]) -> Vec<u8> {
        bytes.iter().filter_map(|byte| telnet.push(*byte)).collect()
    }

    /// RFC 854: a doubled FF is data; RFC 2217: line states are reported beside the data.
    #[test]
    fn data_and_line_states() {
        let mut telnet = Telnet::default();
        let stream = [
            1,
            IAC,
            IAC,
            IAC,
            SB,
            COM_PORT,
            NOTIFY_LINE_STATE,
            4,
            IAC,
            SE,
            2,
        ];
        assert_eq!(read(&mut telnet, &stream), [1, IAC, 2]);
        assert_eq!((telnet.take_errors(), telnet.take_errors()), (1, 0));
    }

    /// RFC 854: IAC, one of WILL, WONT, DO and DONT, and an option.
    #[test]
    fn telnet_is_known_by_its_first_bytes() {
        for first in [[IAC, DO, COM_PORT], [IAC, WILL, 1], [IAC, DONT, 3]] {
            assert!(is_telnet(first), "{first:?}");
        }
        for first in [[IAC, IAC, 0], [IAC, 0, 3], [IAC, WILL, 200], [0xDC, 2, 2]] {
            assert!(!is_telnet(first), "{first:?}");
        }
    }

    /// A connection that should carry bytes alone is not one of telnet, and the remedy is named.
    #[test]
    fn a_server_of_telnet_is_not_read_as_bytes() {
        use crate::port::{PortAddress, PortSettings, open};
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address").to_string();
        let settings = PortSettings {
            address: PortAddress::Tcp(address),
            format: harness_proto::line::Rate::Baud38400.into(),
            marks: false,
            low_latency: false,
        };
        let mut wire = open(&settings).expect("a connection");
        let (mut client, _) = listener.accept().expect("a client");
        client.write_all(&[IAC, DO, COM_PORT]).expect("room");
        let why = loop {
            let mut fds = [wire.poll_fd()];
            poll(&mut fds, None).expect("a wait");
            if let Err(trouble) = wire.receive(&mut Vec::new()) {
                break trouble.to_string();
            }
        };
        assert!(
            why.contains("speaks telnet or RFC 2217") && why.contains("rfc2217"),
            "{why}"
        );
    }

    #[test]
    fn foreign_options_are_refused() {
        let mut telnet = Telnet::default();
        assert!(read(&mut telnet, &[IAC, DO, 24, IAC, WILL, 1]).is_empty());
        assert_eq!(telnet.take_replies(), [IAC, WONT, 24, IAC, DONT, 1]);
    }

    /// A server of the test's own; `parity` is what it says that it has set.
    fn server(parity: u8) -> (TcpStream, std::thread::JoinHandle<()>) {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        let thread = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("a client");
            let mut telnet = Telnet::default();
            let mut buffer = [0; 256];
            stream.write_all(&[IAC, DO, COM_PORT]).expect("room");
            while let Ok(length @ 1..) = stream.read(&mut buffer) {
                read(&mut telnet, &buffer[..length]);
                while let Some(mut answer) = telnet.answers.pop_front() {
                    answer[1] += ANSWER;
                    if answer[1] == 3 + ANSWER {
                        answer[2] = parity;
                    }
                    let sub = [&[IAC, SB][..], &answer, &[IAC, SE]].concat();
                    stream.write_all(&sub).expect("room");
                }
            }
        });
        let stream = TcpStream::connect(address).expect("a server");
        stream.set_nonblocking(true).expect("a socket");
        (stream, thread)
    }

    #[test]
    fn settings_are_checked() {
        let (stream, thread) = server(2);
        assert!(negotiate(&stream, harness_proto::line::Rate::Baud38400.into()).is_ok());
        drop(stream);
        thread.join().expect("an end");
        let (stream, thread) = server(1);
        let error = negotiate(&stream, harness_proto::line::Rate::Baud38400.into()).map(|_| ());
        let error = error.expect_err("another parity").to_string();
        assert_eq!(error, "odd parity: asked for 2, the other end set 1");
        drop(stream);
        thread.join().expect("an end");
    }
}
