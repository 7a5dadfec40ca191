//! SLCAN: CAN frames as lines of characters over a serial line, as in the manuals of LAWICEL's CAN232 and CANUSB adapters.
//!
//! The host sends `SlcanCommand`s, each ended by CR. The adapter answers each with CR (done) or BEL (refused), most reads with a line of
//! their own, and sends the frames of the bus as [`Report`]s between the answers.
//!
//! | command | meaning |
//! |---|---|
//! | `tiiildd..`, `Tiiiiiiiildd..` | a data frame, 11 or 29 bits: identifier, length 0 to 8, two digits a byte |
//! | `riiil`, `Riiiiiiiil` | a remote frame |
//! | `S0` .. `S8` | bit rate, while closed: 10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s |
//! | `sxxyy` | bit timing, while closed: BTR0 and BTR1 of an SJA1000 at 16 MHz |
//! | `O`, `L`, `C` | open, open listen-only, close |
//! | `V`, `N`, `F` | version, serial number, status flags |
//! | `M0`, `M1` | CANable: acknowledge frames, or be silent; taken while closed, and kept while it has power |
//! | `Z0`, `Z1` | time stamps off or on: milliseconds 0 to 59999, four digits after each frame |

use super::{BadMessage, digit, hexadecimal};
use harness_proto::can::{BitRate, Frame, Id};

/// The longest line: a frame with 29 bits, 8 bytes and a time stamp has 30 characters.
pub(crate) const MAX_LINE: usize = 64;

/// Milliseconds of a time stamp before it starts again.
pub(crate) const STAMP_PERIOD: u16 = 60_000;

/// Ends a line; as an answer: done.
pub(crate) const CR: u8 = b'\r';

/// Answer: refused.
pub(crate) const BEL: u8 = 0x07;

/// Bits of the status that `F` reads and clears.
pub mod flags {
    /// The receive queue is full.
    pub(crate) const RECEIVE_FULL: u8 = 0x01;
    /// The transmit queue is full.
    pub(crate) const TRANSMIT_FULL: u8 = 0x02;
    /// The controller warns of errors.
    pub const WARNING: u8 = 0x04;
    /// The controller lost frames.
    pub(crate) const OVERRUN: u8 = 0x08;
    /// The controller is error passive.
    pub const PASSIVE: u8 = 0x20;
    /// There was an error on the bus; with an adapter that stopped sending, bus-off.
    pub const BUS_ERROR: u8 = 0x80;
}

/// The rates of `S0` to `S8`, in kbit/s.
const RATES: [u32; 9] = [10, 20, 50, 100, 125, 250, 500, 800, 1000];

/// The rate of an `S` command; `None` above 8.
#[must_use]
pub fn rate_of(code: u8) -> Option<BitRate> {
    BitRate::from_bits_per_second(RATES.get(usize::from(code))? * 1000)
}

/// The bit timing registers of an SJA1000 with a crystal of 16 MHz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// BTR0: jump width in bits 7 and 6, prescaler in bits 5 to 0.
    pub btr0: u8,
    /// BTR1: sampling in bit 7, second segment in bits 6 to 4, first segment in bits 3 to 0.
    pub btr1: u8,
}

impl BitTiming {
    /// Quanta a second with a prescaler of 1.
    const CLOCK: u32 = 8_000_000;

    /// The rate; `None` if it is above 1 Mbit/s or no whole number of bits a second.
    #[must_use]
    pub fn rate(self) -> Option<BitRate> {
        let prescaler = u32::from(self.btr0 & 0x3F) + 1;
        let quanta = 3 + u32::from(self.btr1 & 0xF) + u32::from(self.btr1 >> 4 & 7);
        let divisor = prescaler * quanta;
        (Self::CLOCK % divisor == 0)
            .then(|| BitRate::from_bits_per_second(Self::CLOCK / divisor))?
    }

    /// The timing of a rate with the sample point next to 80 %; `None` if an adapter with this clock cannot have the rate.
    #[must_use]
    pub fn of(rate: BitRate) -> Option<Self> {
        let quotient = Self::CLOCK / rate.bits_per_second();
        if Self::CLOCK % rate.bits_per_second() != 0 {
            return None;
        }
        let fits = |quanta: &u32| quotient.is_multiple_of(*quanta) && quotient / quanta <= 64;
        let quanta = (8..=25).rev().find(fits)?;
        // Sync (1) and first segment (1 to 16), then the second one (1 to 8).
        let second = (quanta / 5).max(quanta.saturating_sub(17)).clamp(1, 8);
        let first = quanta - 1 - second;
        Some(Self {
            btr0: u8::try_from(quotient / quanta - 1).ok()?,
            btr1: u8::try_from((second - 1) << 4 | (first - 1)).ok()?,
        })
    }
}

/// A command of a host to an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SlcanCommand {
    /// Nothing: an empty line, with which hosts clear what was begun.
    Nothing,
    /// `t`, `T`, `r`, `R`: send a frame.
    Send(Frame),
    /// `S`: a rate by its code, 0 to 8.
    Rate(u8),
    /// `s`: a rate by bit timing registers.
    Timing(BitTiming),
    /// `O`.
    Open,
    /// `L`: open listen-only; not even acknowledges are sent.
    Listen,
    /// `M0`, `M1`: acknowledge frames or be silent when open, in the firmware of CANable; LAWICEL's adapters refuse it.
    Silent(bool),
    /// `C`.
    Close,
    /// `V`.
    Version,
    /// `N`.
    SerialNumber,
    /// `F`.
    Flags,
    /// `Z0`, `Z1`.
    TimeStamps(bool),
    /// `X1`, `M00000000`, `mFFFFFFFF`: report every frame by itself, as adapters do anyway.
    ReportAll,
}

impl SlcanCommand {
    /// Reads a line without its end.
    ///
    /// # Errors
    /// [`BadMessage`], with what was expected.
    pub(crate) fn parse(line: &[u8]) -> Result<Self, BadMessage> {
        const EXPECTED: &str = "a command of SLCAN expected: t, T, r, R, S0 to S8, s, O, L, C, V, N, F, Z0 or Z1, ended by CR";
        let bad = |expected| BadMessage::new(line, expected);
        Ok(match line {
            [] => Self::Nothing,
            [b't' | b'T' | b'r' | b'R', ..] => {
                let (frame, rest) = frame(line).map_err(bad)?;
                match rest {
                    [] => Self::Send(frame),
                    _ => return Err(bad("no more characters expected behind the frame")),
                }
            }
            [b'S', code @ b'0'..=b'8'] => Self::Rate(code - b'0'),
            [b'S', ..] => return Err(bad("S0 to S8 expected; s and BTR0, BTR1 for another rate")),
            [b's', digits @ ..] => {
                let value = (digits.len() == 4).then(|| hexadecimal(digits)).flatten();
                let value = value.ok_or_else(|| {
                    bad("s and four hexadecimal digits expected: BTR0, BTR1 of an SJA1000 at 16 MHz")
                })?;
                let [btr0, btr1] = (value as u16).to_be_bytes();
                Self::Timing(BitTiming { btr0, btr1 })
            }
            b"O" => Self::Open,
            b"L" => Self::Listen,
            b"M0" => Self::Silent(false),
            b"M1" => Self::Silent(true),
            b"C" => Self::Close,
            b"V" => Self::Version,
            b"N" => Self::SerialNumber,
            b"F" => Self::Flags,
            b"Z0" => Self::TimeStamps(false),
            b"Z1" => Self::TimeStamps(true),
            b"X1" | b"M00000000" | b"mFFFFFFFF" | b"mffffffff" => Self::ReportAll,
            _ => return Err(bad(EXPECTED)),
        })
    }

    /// Writes the command with its end.
    pub(crate) fn write(self, out: &mut Vec<u8>) {
        match self {
            Self::Nothing => {}
            Self::Send(frame) => write_frame(&frame, out),
            Self::Rate(code) => out.extend([b'S', b'0' + code.min(8)]),
            Self::Timing(timing) => {
                out.push(b's');
                write_hex(timing.btr0.into(), 2, out);
                write_hex(timing.btr1.into(), 2, out);
            }
            Self::Open => out.push(b'O'),
            Self::Listen => out.push(b'L'),
            Self::Silent(on) => out.extend([b'M', b'0' + u8::from(on)]),
            Self::Close => out.push(b'C'),
            Self::Version => out.push(b'V'),
            Self::SerialNumber => out.push(b'N'),
            Self::Flags => out.push(b'F'),
            Self::TimeStamps(on) => out.extend([b'Z', b'0' + u8::from(on)]),
            Self::ReportAll => out.extend(b"X1"),
        }
        out.push(CR);
    }
}

/// An answer or a report of an adapter to its host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Report {
    /// CR: the command was done.
    Done,
    /// `z`, `Z`: the frame was taken to be sent, with 11 or 29 bits.
    Taken {
        /// Whether it has 29 bits.
        extended: bool,
    },
    /// BEL: the command was refused.
    Refused,
    /// A frame of the bus, and its time stamp in ms where stamps are on.
    Frame(Frame, Option<u16>),
    /// `V`: the version, as written.
    Version(String),
    /// `N`: the serial number, as written.
    SerialNumber(String),
    /// `F`: status flags.
    Flags(u8),
    /// Another line, which some adapters have: it is for none of the commands here.
    Other(String),
}

impl Report {
    /// Reads a line and its end, CR or BEL. Text before a BEL is dropped.
    ///
    /// # Errors
    /// [`BadMessage`]: a frame that is not one.
    pub fn parse(line: &[u8], end: u8) -> Result<Self, BadMessage> {
        if end == BEL {
            return Ok(Self::Refused);
        }
        let text = |text: &[u8]| text.escape_ascii().to_string();
        Ok(match line {
            [] => Self::Done,
            b"z" => Self::Taken { extended: false },
            b"Z" => Self::Taken { extended: true },
            // Some adapters end the answer to a frame and a frame of the bus with one CR.
            [b'z' | b'Z', rest @ ..] => return Self::parse(rest, end),
            [b't' | b'T' | b'r' | b'R', ..] => {
                let bad = |expected| BadMessage::new(line, expected);
                let (frame, rest) = frame(line).map_err(bad)?;
                let stamp = match rest {
                    [] => None,
                    [_, _, _, _] => hexadecimal(rest),
                    _ => None,
                };
                match stamp {
                    None if !rest.is_empty() => {
                        return Err(bad(
                            "four hexadecimal digits of a time stamp, or nothing, expected behind the frame",
                        ));
                    }
                    stamp => Self::Frame(frame, stamp.map(|stamp| stamp as u16 % STAMP_PERIOD)),
                }
            }
            [b'V', version @ ..] => Self::Version(text(version)),
            [b'N', number @ ..] => Self::SerialNumber(text(number)),
            [b'F', bits @ ..] if bits.len() == 2 => match hexadecimal(bits) {
                Some(bits) => Self::Flags(bits as u8),
                None => Self::Other(text(line)),
            },
            _ => Self::Other(text(line)),
        })
    }

    /// Writes the report with its end.
    pub fn write(&self, out: &mut Vec<u8>) {
        match self {
            Self::Done => {}
            Self::Taken { extended } => out.push(if *extended { b'Z' } else { b'z' }),
            Self::Refused => {
                out.push(BEL);
                return;
            }
            Self::Frame(frame, stamp) => {
                write_frame(frame, out);
                if let Some(stamp) = stamp {
                    write_hex((*stamp).into(), 4, out);
                }
            }
            Self::Version(version) => {
                out.push(b'V');
                out.extend(version.bytes());
            }
            Self::SerialNumber(number) => {
                out.push(b'N');
                out.extend(number.bytes());
            }
            Self::Flags(bits) => {
                out.push(b'F');
                write_hex((*bits).into(), 2, out);
            }
            Self::Other(line) => out.extend(line.bytes()),
        }
        out.push(CR);
    }
}

/// Reads a frame at the start of a line, which begins with its letter; gives what follows it.
fn frame(line: &[u8]) -> Result<(Frame, &[u8]), &'static str> {
    const BASE: &str = "the letter, an identifier of three hexadecimal digits up to 7FF and a length from 0 to 8 expected";
    const EXTENDED: &str = "the letter, an identifier of eight hexadecimal digits up to 1FFFFFFF and a length from 0 to 8 expected";
    const DATA: &str =
        "two hexadecimal digits expected for each of the data bytes that the length states";
    let (&letter, rest) = line.split_first().ok_or(BASE)?;
    let extended = letter.is_ascii_uppercase();
    let (digits, header) = if extended { (8, EXTENDED) } else { (3, BASE) };
    let (id, rest) = rest.split_at_checked(digits).ok_or(header)?;
    let (&len, rest) = rest.split_first().ok_or(header)?;
    let number = hexadecimal(id).ok_or(header)?;
    let id = match extended {
        true => Id::extended(number),
        false => u16::try_from(number).ok().and_then(Id::base),
    };
    let id = id.ok_or(header)?;
    let len = match len {
        b'0'..=b'8' => usize::from(len - b'0'),
        _ => return Err(header),
    };
    if letter.eq_ignore_ascii_case(&b'r') {
        return Ok((Frame::remote(id, len).map_err(|_| header)?, rest));
    }
    let (digits, rest) = rest.split_at_checked(2 * len).ok_or(DATA)?;
    let mut data = [0; harness_proto::can::MAX_DATA];
    for (byte, pair) in data.iter_mut().zip(digits.chunks_exact(2)) {
        let value = pair
            .iter()
            .try_fold(0, |value, &character| Some(value << 4 | digit(character)?));
        *byte = value.ok_or(DATA)? as u8;
    }
    let frame = Frame::new(id, &data[..len]).map_err(|_| header)?;
    Ok((frame, rest))
}

fn write_frame(frame: &Frame, out: &mut Vec<u8>) {
    let letter = if frame.is_remote() { b'r' } else { b't' };
    let (letter, digits) = match frame.id().is_extended() {
        true => (letter.to_ascii_uppercase(), 8),
        false => (letter, 3),
    };
    out.push(letter);
    write_hex(frame.id().number(), digits, out);
    write_hex(frame.dlc() as u32, 1, out);
    for &byte in frame.data() {
        write_hex(byte.into(), 2, out);
    }
}

/// The lowest digits of a number.
fn write_hex(number: u32, digits: u32, out: &mut Vec<u8>) {
    let places = (0..digits).rev();
    out.extend(places.map(|place| b"0123456789ABCDEF"[(number >> (4 * place) & 0xF) as usize]));
}

/// Cuts a stream into lines at CR and BEL. LF is dropped: some hosts send CR LF.
#[derive(Clone, Debug, Default)]
pub struct SlcanLines {
    begun: Vec<u8>,
    /// Characters of the line, those that were not kept included.
    length: usize,
}

impl SlcanLines {
    /// Takes a character; gives the line that it ends, and the end.
    ///
    /// # Errors
    /// The line is longer than `MAX_LINE`; it is dropped.
    pub fn push(&mut self, character: u8) -> Option<Result<(Vec<u8>, u8), BadMessage>> {
        match character {
            CR | BEL => {
                let length = std::mem::take(&mut self.length);
                let line = std::mem::take(&mut self.begun);
                Some(match length > MAX_LINE {
                    true => Err(BadMessage::new(
                        &line,
                        "a line of at most 64 characters expected, ended by CR: is this a stream of SLCAN?",
                    )),
                    false => Ok((line, character)),
                })
            }
            b'\n' => None,
            character => {
                self.length = self.length.saturating_add(1);
                if self.begun.len() < MAX_LINE {
                    self.begun.push(character);
                }
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(command: SlcanCommand) -> String {
        let mut out = Vec::new();
        command.write(&mut out);
        String::from_utf8(out).expect("characters")
    }

    fn a_frame(text: &str) -> Frame {
        text.parse().expect("a frame")
    }

    /// The forms of the adapters' manuals.
    #[test]
    fn commands_are_read_and_written() {
        for (line, command) in [
            ("", SlcanCommand::Nothing),
            ("t2013510400", SlcanCommand::Send(a_frame("201#510400"))),
            ("t2010", SlcanCommand::Send(a_frame("201#"))),
            (
                "T0000020123D40",
                SlcanCommand::Send(a_frame("00000201#3D40")),
            ),
            ("r2013", SlcanCommand::Send(a_frame("201#R3"))),
            ("R1FFFFFFF8", SlcanCommand::Send(a_frame("1FFFFFFF#R8"))),
            ("S6", SlcanCommand::Rate(6)),
            (
                "s001C",
                SlcanCommand::Timing(BitTiming {
                    btr0: 0,
                    btr1: 0x1C,
                }),
            ),
            ("O", SlcanCommand::Open),
            ("L", SlcanCommand::Listen),
            ("C", SlcanCommand::Close),
            ("V", SlcanCommand::Version),
            ("N", SlcanCommand::SerialNumber),
            ("F", SlcanCommand::Flags),
            ("Z1", SlcanCommand::TimeStamps(true)),
            ("M1", SlcanCommand::Silent(true)),
            ("X1", SlcanCommand::ReportAll),
        ] {
            assert_eq!(SlcanCommand::parse(line.as_bytes()), Ok(command), "{line}");
            assert_eq!(written(command), format!("{line}\r"));
        }
        let small = SlcanCommand::parse(b"t20121aFf");
        assert_eq!(small, Ok(SlcanCommand::Send(a_frame("201#1AFF"))));
    }

    #[test]
    fn what_is_no_command_says_what_was_expected() {
        for (line, words) in [
            ("t20", "three hexadecimal digits up to 7FF"),
            ("t8000", "three hexadecimal digits up to 7FF"),
            ("t2019112233445566778899", "a length from 0 to 8"),
            ("t201351", "two hexadecimal digits expected for each"),
            ("t2013510G00", "two hexadecimal digits expected for each"),
            ("t20135104000", "no more characters"),
            ("T0000020111", "two hexadecimal digits"),
            ("T200000000", "1FFFFFFF"),
            ("r2019", "a length"),
            ("S9", "S0 to S8"),
            ("s00", "four hexadecimal digits"),
            ("hello", "t, T, r, R"),
        ] {
            let error = SlcanCommand::parse(line.as_bytes())
                .expect_err(line)
                .to_string();
            assert!(error.contains(&format!("\"{line}\"")), "{error}");
            assert!(error.contains(words), "{line}: {error}");
        }
    }

    #[test]
    fn reports_are_read_and_written() {
        for (line, end, report) in [
            ("", CR, Report::Done),
            ("", BEL, Report::Refused),
            ("z", CR, Report::Taken { extended: false }),
            ("Z", CR, Report::Taken { extended: true }),
            (
                "t181440810100",
                CR,
                Report::Frame(a_frame("181#40810100"), None),
            ),
            (
                "t1811AAEA5F",
                CR,
                Report::Frame(a_frame("181#AA"), Some(59_999)),
            ),
            ("V1013", CR, Report::Version("1013".to_owned())),
            ("NA123", CR, Report::SerialNumber("A123".to_owned())),
            ("FA4", CR, Report::Flags(0xA4)),
            ("hello", CR, Report::Other("hello".to_owned())),
        ] {
            assert_eq!(Report::parse(line.as_bytes(), end), Ok(report.clone()));
            let mut out = Vec::new();
            report.write(&mut out);
            assert_eq!(out, [line.as_bytes(), &[end]].concat());
        }
        let glued = Report::parse(b"zt1811AA", CR);
        assert_eq!(glued, Ok(Report::Frame(a_frame("181#AA"), None)));
        let error = Report::parse(b"t1811AA12", CR).expect_err("half a stamp");
        assert!(error.to_string().contains("four hexadecimal digits"));
    }

    /// UNITEK's rates, but 625 kbit/s, for which 8 MHz is no multiple.
    #[test]
    fn rates_by_code_and_by_timing() {
        assert_eq!(rate_of(6), Some(BitRate::K500));
        assert_eq!(rate_of(9), None);
        for rate in [BitRate::M1, BitRate::K500, BitRate::K250, BitRate::K100] {
            let timing = BitTiming::of(rate).expect("reachable");
            assert_eq!(timing.rate(), Some(rate), "{timing:?}");
        }
        for bits in 1..=1_000_000 {
            let rate = BitRate::from_bits_per_second(bits);
            if let Some((rate, timing)) = rate.and_then(|rate| Some((rate, BitTiming::of(rate)?))) {
                assert_eq!(timing.rate(), Some(rate));
            }
        }
        assert_eq!(BitTiming::of(BitRate::K625), None);
        // LAWICEL's value for 500 kbit/s.
        assert_eq!(
            BitTiming {
                btr0: 0,
                btr1: 0x1C
            }
            .rate(),
            Some(BitRate::K500)
        );
    }

    #[test]
    fn lines_are_bounded() {
        let mut lines = SlcanLines::default();
        let mut push =
            |text: &[u8]| -> Vec<_> { text.iter().filter_map(|byte| lines.push(*byte)).collect() };
        assert_eq!(push(b"C\r\nO"), [Ok((b"C".to_vec(), CR))]);
        assert_eq!(push(b"\x07"), [Ok((b"O".to_vec(), BEL))]);
        let long = push(&[b'x'; 100_000]);
        assert!(long.is_empty());
        let error = push(b"\r").remove(0).expect_err("too long").to_string();
        assert!(error.contains("at most 64 characters"), "{error}");
        assert_eq!(push(b"V\r"), [Ok((b"V".to_vec(), CR))]);
    }

    fn any_frame() -> impl Strategy<Value = Frame> {
        let id = prop_oneof![
            (0..=Id::MAX_BASE).prop_map(|number| Id::base(number).expect("small")),
            (0..=Id::MAX_EXTENDED).prop_map(|number| Id::extended(number).expect("small")),
        ];
        let data = prop::collection::vec(any::<u8>(), 0..=8);
        (id, data, any::<bool>()).prop_map(|(id, data, remote)| match remote {
            true => Frame::remote(id, data.len()).expect("short"),
            false => Frame::new(id, &data).expect("short"),
        })
    }

    proptest! {
        #[test]
        fn frames_survive(frame in any_frame(), stamp in prop::option::of(0..STAMP_PERIOD)) {
            let command = written(SlcanCommand::Send(frame));
            prop_assert_eq!(SlcanCommand::parse(command.trim_end().as_bytes()), Ok(SlcanCommand::Send(frame)));
            let mut out = Vec::new();
            let report = Report::Frame(frame, stamp);
            report.write(&mut out);
            prop_assert!(out.len() <= MAX_LINE);
            prop_assert_eq!(Report::parse(&out[..out.len() - 1], CR), Ok(report));
        }

        #[test]
        fn no_line_panics(line in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Ok(command) = SlcanCommand::parse(&line) {
                let again = written(command);
                prop_assert_eq!(SlcanCommand::parse(again.trim_end().as_bytes()), Ok(command));
            }
            let _any = Report::parse(&line, CR);
        }
    }
}
