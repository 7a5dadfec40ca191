//! The protocol of socketcand, the daemon that gives a CAN interface of Linux to the network (`doc/protocol.md` of linux-can/socketcand).
//!
//! Messages are enclosed in `<` and `>`, one after the other in a stream:
//!
//! ```text
//! server  < hi >
//! client  < open can0 >            server  < ok >
//! client  < rawmode >              server  < ok >
//! client  < send 201 3 3d 40 0 >   server  < frame 181 23.424242 40810100 >
//! client  < echo >                 server  < echo >
//! ```
//!
//! In raw mode every frame of the bus is reported. Remote frames (`rtr`) came late to the protocol: they are read, and neither sent nor served.
//! The modes for broadcast manager, ISO-TP and statistics are not here.

use super::{BadMessage, hexadecimal};
use harness_proto::can::{Frame, Id, MAX_DATA};
use std::fmt::Write as _;

/// The longest message, both brackets included.
pub(crate) const MAX_MESSAGE: usize = 256;

pub use harness_socketcan::{class, flag};

/// A time: seconds and microseconds, since 1970 with the daemon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stamp {
    pub seconds: u64,
    /// Microseconds, 0 to 999999.
    pub micros: u32,
}

/// A message of a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SocketcandRequest {
    /// `open`: the bus with this name.
    Open(String),
    /// `rawmode`: report every frame.
    RawMode,
    /// `bcmmode`: report no frames.
    BcmMode,
    /// `echo`.
    Echo,
    /// `send`: a data frame.
    Send(Frame),
}

impl SocketcandRequest {
    /// Reads a message, its brackets included.
    ///
    /// # Errors
    /// [`BadMessage`], with what was expected.
    pub(crate) fn parse(message: &[u8]) -> Result<Self, BadMessage> {
        let bad = |expected| BadMessage::new(message, expected);
        let words = words(message);
        match words.as_slice() {
            [b"open", name] if name.len() <= 16 => {
                Ok(Self::Open(name.escape_ascii().to_string()))
            }
            [b"open", ..] => Err(bad("a bus with a name of at most 16 characters expected: < open can0 >")),
            [b"rawmode"] => Ok(Self::RawMode),
            [b"bcmmode"] => Ok(Self::BcmMode),
            [b"echo"] => Ok(Self::Echo),
            [b"send", rest @ ..] => sent(rest).map(Self::Send).ok_or_else(|| {
                bad("three or eight hexadecimal digits, a length from 0 to 8 and as many bytes expected: < send 201 3 3d 40 0 >")
            }),
            _ => Err(bad("< open can0 >, < rawmode >, < bcmmode >, < echo > or < send 201 3 3d 40 0 > expected")),
        }
    }

    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        let text = match self {
            Self::Open(name) => format!("< open {name} >"),
            Self::RawMode => "< rawmode >".to_owned(),
            Self::BcmMode => "< bcmmode >".to_owned(),
            Self::Echo => "< echo >".to_owned(),
            Self::Send(frame) => {
                let mut text = format!("< send {} {} ", frame.id(), frame.dlc());
                for byte in frame.data() {
                    // Writing to a String cannot fail.
                    let _infallible = write!(text, "{byte:x} ");
                }
                text.push('>');
                text
            }
        };
        out.extend(text.bytes());
    }
}

/// A message of the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SocketcandAnswer {
    /// `hi`, at the beginning.
    Hi,
    /// `ok`.
    Ok,
    /// `echo`.
    Echo,
    /// `frame`, and `rtr` of newer servers: a frame of the bus.
    Frame(Frame, Stamp),
    /// `error` with a class and a time: an error frame of the interface.
    ErrorFrame(u32, Stamp),
    /// `error` with a text: a request was refused.
    Error(String),
}

impl SocketcandAnswer {
    /// Reads a message, its brackets included.
    ///
    /// # Errors
    /// [`BadMessage`], with what was expected.
    pub(crate) fn parse(message: &[u8]) -> Result<Self, BadMessage> {
        let bad = |expected| BadMessage::new(message, expected);
        let words = words(message);
        match words.as_slice() {
            [b"hi"] => Ok(Self::Hi),
            [b"ok"] => Ok(Self::Ok),
            [b"echo"] => Ok(Self::Echo),
            [b"frame", id, time, data @ ..] => {
                let frame = identifier(id).zip(stamp(time)).and_then(|(id, stamp)| {
                    Some(Self::Frame(Frame::new(id, &bytes(data)?).ok()?, stamp))
                });
                frame.ok_or_else(|| bad("< frame 181 23.424242 40810100 > expected: identifier, time and data in hexadecimal digits"))
            }
            [b"rtr", id, time, [len @ b'0'..=b'8']] => {
                let frame = identifier(id).zip(stamp(time)).and_then(|(id, stamp)| {
                    let frame = Frame::remote(id, usize::from(len - b'0')).ok()?;
                    Some(Self::Frame(frame, stamp))
                });
                frame.ok_or_else(|| {
                    bad("< rtr 181 23.424242 4 > expected: identifier, time and length")
                })
            }
            [b"error", class, time] if stamp(time).is_some() && hexadecimal(class).is_some() => {
                let class = hexadecimal(class).unwrap_or_default();
                Ok(Self::ErrorFrame(class, stamp(time).unwrap_or_default()))
            }
            [b"error", text @ ..] => {
                let text: Vec<_> = text
                    .iter()
                    .map(|word| word.escape_ascii().to_string())
                    .collect();
                Ok(Self::Error(text.join(" ")))
            }
            _ => Err(bad(
                "< hi >, < ok >, < echo >, < frame ... > or < error ... > of socketcand expected",
            )),
        }
    }

    /// Writes the message. A remote frame is written as an empty message would be: not at all.
    pub(crate) fn write(&self, out: &mut Vec<u8>) {
        let text = match self {
            Self::Hi => "< hi >".to_owned(),
            Self::Ok => "< ok >".to_owned(),
            Self::Echo => "< echo >".to_owned(),
            Self::Frame(frame, _) if frame.is_remote() => return,
            Self::Frame(frame, stamp) => {
                let mut text = format!(
                    "< frame {} {}.{:06} ",
                    frame.id(),
                    stamp.seconds,
                    stamp.micros
                );
                for byte in frame.data() {
                    let _infallible = write!(text, "{byte:02X}");
                }
                text.push_str(" >");
                text
            }
            Self::ErrorFrame(class, stamp) => {
                format!(
                    "< error {class:03X} {}.{:06} >",
                    stamp.seconds, stamp.micros
                )
            }
            Self::Error(text) => format!("< error {} >", text.replace(['<', '>'], "'")),
        };
        out.extend(text.bytes());
    }
}

/// The words between the brackets.
fn words(message: &[u8]) -> Vec<&[u8]> {
    let inner = message.strip_prefix(b"<").unwrap_or(message);
    let inner = inner.strip_suffix(b">").unwrap_or(inner);
    let words = inner.split(|byte| byte.is_ascii_whitespace());
    words.filter(|word| !word.is_empty()).collect()
}

/// An identifier: with eight digits one of 29 bits, with fewer one of 11.
fn identifier(digits: &[u8]) -> Option<Id> {
    let number = hexadecimal(digits)?;
    match digits.len() {
        8 => Id::extended(number),
        1..=3 => Id::base(u16::try_from(number).ok()?),
        _ => None,
    }
}

/// What follows `send`.
fn sent(words: &[&[u8]]) -> Option<Frame> {
    let [id, len, data @ ..] = words else {
        return None;
    };
    let id = identifier(id)?;
    let [len @ b'0'..=b'8'] = len else {
        return None;
    };
    if data.len() != usize::from(len - b'0') {
        return None;
    }
    let byte = |word: &&[u8]| u8::try_from(hexadecimal(word)?).ok();
    let data: Option<Vec<u8>> = data.iter().map(byte).collect();
    Frame::new(id, &data?).ok()
}

/// Data bytes as pairs of digits, in one word or several.
fn bytes(words: &[&[u8]]) -> Option<Vec<u8>> {
    let digits = words.concat();
    if digits.len() % 2 != 0 || digits.len() > 2 * MAX_DATA {
        return None;
    }
    let byte = |pair| u8::try_from(hexadecimal(pair)?).ok();
    digits.chunks_exact(2).map(byte).collect()
}

/// Seconds with at most six places.
fn stamp(word: &[u8]) -> Option<Stamp> {
    let text = std::str::from_utf8(word).ok()?;
    let (seconds, places) = text.split_once('.')?;
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(seconds) || !digits(places) || places.len() > 6 {
        return None;
    }
    Some(Stamp {
        seconds: seconds.parse().ok()?,
        micros: format!("{places:0<6}").parse().ok()?,
    })
}

/// Cuts a stream into messages. Text between messages is dropped if it is blank, and is an error if not.
#[derive(Clone, Debug, Default)]
pub(crate) struct Messages {
    begun: Vec<u8>,
    /// Characters of the message that were not kept.
    more: usize,
}

impl Messages {
    /// Takes a character; gives the message that it ends, its brackets included.
    ///
    /// # Errors
    /// The message is longer than [`MAX_MESSAGE`], or other text precedes it; it is dropped.
    pub(crate) fn push(&mut self, character: u8) -> Option<Result<Vec<u8>, BadMessage>> {
        if self.begun.is_empty() && character.is_ascii_whitespace() {
            return None;
        }
        if self.begun.len() < MAX_MESSAGE {
            self.begun.push(character);
        } else {
            self.more = self.more.saturating_add(1);
        }
        if character != b'>' {
            return None;
        }
        let message = std::mem::take(&mut self.begun);
        let more = std::mem::take(&mut self.more);
        let bad = |expected| Some(Err(BadMessage::new(&message, expected)));
        if more > 0 {
            return bad(
                "a message of at most 256 characters expected: is this a stream of socketcand?",
            );
        }
        if !message.starts_with(b"<") {
            return bad("< expected at the start of a message");
        }
        Some(Ok(message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn a_frame(text: &str) -> Frame {
        text.parse().expect("a frame")
    }

    const TIME: Stamp = Stamp {
        seconds: 23,
        micros: 424_242,
    };

    /// The examples of the protocol's page, and messages of python-can.
    #[test]
    fn requests_are_read_and_written() {
        for (text, request) in [
            ("< open can0 >", SocketcandRequest::Open("can0".to_owned())),
            ("< rawmode >", SocketcandRequest::RawMode),
            ("< bcmmode >", SocketcandRequest::BcmMode),
            ("< echo >", SocketcandRequest::Echo),
            ("< send 123 0 >", SocketcandRequest::Send(a_frame("123#"))),
            (
                "< send 1AAAAAAA 2 1 f1 >",
                SocketcandRequest::Send(a_frame("1AAAAAAA#01F1")),
            ),
        ] {
            assert_eq!(
                SocketcandRequest::parse(text.as_bytes()),
                Ok(request.clone()),
                "{text}"
            );
            let mut out = Vec::new();
            request.write(&mut out);
            assert_eq!(String::from_utf8(out).expect("text"), text);
        }
        for text in ["< send 123 0  >", "<send 123 0>", "< send 123 0\t>"] {
            let request = SocketcandRequest::parse(text.as_bytes());
            assert_eq!(
                request,
                Ok(SocketcandRequest::Send(a_frame("123#"))),
                "{text}"
            );
        }
    }

    #[test]
    fn what_is_no_request_says_what_was_expected() {
        for (text, words) in [
            ("< send 201 3 >", "as many bytes"),
            ("< send 201 3 1 2 >", "as many bytes"),
            ("< send 201 1 100 >", "as many bytes"),
            ("< send 201 9 1 2 3 4 5 6 7 8 9 >", "as many bytes"),
            ("< send 801 0 >", "three or eight"),
            ("< send 0201 0 >", "three or eight"),
            ("< open >", "< open can0 >"),
            ("< add 1 0 123 1 11 >", "< rawmode >"),
            ("<>", "< rawmode >"),
        ] {
            let error = SocketcandRequest::parse(text.as_bytes())
                .expect_err(text)
                .to_string();
            assert!(error.contains(text) && error.contains(words), "{error}");
        }
    }

    #[test]
    fn answers_are_read_and_written() {
        for (text, answer) in [
            ("< hi >", SocketcandAnswer::Hi),
            ("< ok >", SocketcandAnswer::Ok),
            ("< echo >", SocketcandAnswer::Echo),
            (
                "< frame 123 23.424242 1A220344 >",
                SocketcandAnswer::Frame(a_frame("123#1A220344"), TIME),
            ),
            (
                "< frame 123 23.424242  >",
                SocketcandAnswer::Frame(a_frame("123#"), TIME),
            ),
            (
                "< error 040 23.424242 >",
                SocketcandAnswer::ErrorFrame(class::BUS_OFF, TIME),
            ),
            (
                "< error unknown command >",
                SocketcandAnswer::Error("unknown command".to_owned()),
            ),
        ] {
            assert_eq!(
                SocketcandAnswer::parse(text.as_bytes()),
                Ok(answer.clone()),
                "{text}"
            );
            let mut out = Vec::new();
            answer.write(&mut out);
            assert_eq!(String::from_utf8(out).expect("text"), text);
        }
        // The broadcast manager's form, and a server that writes fewer places.
        let spaced = SocketcandAnswer::parse(b"< frame 123 23.5 1A 22 >");
        let half = Stamp {
            seconds: 23,
            micros: 500_000,
        };
        assert_eq!(
            spaced,
            Ok(SocketcandAnswer::Frame(a_frame("123#1A22"), half))
        );
        let remote = SocketcandAnswer::parse(b"< rtr 123 23.424242 4 >");
        assert_eq!(remote, Ok(SocketcandAnswer::Frame(a_frame("123#R4"), TIME)));
        for text in [
            "< rtr 123 23.4 9 >",
            "< frame 123 23.4 1A2 >",
            "< frame 1234 1.0 1A >",
            "< frame 123 1A >",
            "< bye >",
        ] {
            let error = SocketcandAnswer::parse(text.as_bytes())
                .expect_err(text)
                .to_string();
            assert!(
                error.contains(text) && error.contains("expected"),
                "{error}"
            );
        }
        let mut nested = Vec::new();
        SocketcandAnswer::Error("received < a >".to_owned()).write(&mut nested);
        assert_eq!(nested, b"< error received ' a ' >");
    }

    /// Parts of messages, several in one read, and what is none.
    #[test]
    fn streams_are_cut_into_messages() {
        let mut messages = Messages::default();
        let mut push =
            |text: &[u8]| -> Vec<_> { text.iter().flat_map(|byte| messages.push(*byte)).collect() };
        assert!(push(b"< o").is_empty());
        let two = push(b"k >\n< hi >< e");
        assert_eq!(two, [Ok(b"< ok >".to_vec()), Ok(b"< hi >".to_vec())]);
        assert_eq!(push(b"cho >"), [Ok(b"< echo >".to_vec())]);
        let error = push(b"GET / HTTP/1.1 >").remove(0).expect_err("no message");
        assert!(
            error
                .to_string()
                .contains("\"GET / HTTP/1.1 >\"; < expected")
        );
        assert!(push(&[b'<'; 100_000]).is_empty());
        let error = push(b">").remove(0).expect_err("too long").to_string();
        assert!(error.contains("at most 256 characters"), "{error}");
        assert_eq!(push(b"< ok >"), [Ok(b"< ok >".to_vec())]);
    }

    proptest! {
        #[test]
        fn no_message_panics(message in prop::collection::vec(any::<u8>(), 0..80)) {
            let _any = (SocketcandRequest::parse(&message), SocketcandAnswer::parse(&message));
            let mut messages = Messages::default();
            for character in message {
                let _any = messages.push(character);
            }
        }

        #[test]
        fn frames_survive(number in 0..=Id::MAX_EXTENDED, data in prop::collection::vec(any::<u8>(), 0..=8), micros in 0..1_000_000u32) {
            let id = Id::extended(number).expect("small");
            let frame = Frame::new(id, &data).expect("short");
            let stamp = Stamp { seconds: 1_700_000_000, micros };
            let mut out = Vec::new();
            SocketcandRequest::Send(frame).write(&mut out);
            prop_assert_eq!(SocketcandRequest::parse(&out), Ok(SocketcandRequest::Send(frame)));
            out.clear();
            SocketcandAnswer::Frame(frame, stamp).write(&mut out);
            prop_assert!(out.len() <= MAX_MESSAGE);
            prop_assert_eq!(SocketcandAnswer::parse(&out), Ok(SocketcandAnswer::Frame(frame, stamp)));
        }
    }
}
