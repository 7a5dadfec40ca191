//! The places of a capture: a link of a ring, a line that stations share, or a CAN adapter; and the port that listens there.

use crate::capture::{Carries, RecordedPlace, ends, line_formats};
use crate::link::frames::AdapterPlace;
use crate::medium::ErrorMarks;
use crate::port::PortAddress;
use crate::rig::Rig;
use crate::rig::file::Transport;
use harness_proto::can::BitRate;
use harness_proto::line::{Format, Rate};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// What the names of lines that stations share begin with.
const LINE: &str = "bus";

/// A name, and the port that listens there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TapAt {
    /// A link such as `98->97`, or the name of a bus.
    pub(super) name: String,
    pub(super) port: TapPort,
}

/// A port that listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TapPort {
    /// At a link of a ring; its rate is that of `--line`.
    Link(PathBuf),
    /// At a line that stations share.
    Line(PathBuf, Format),
    /// At a CAN bus.
    Frames(AdapterPlace, BitRate),
}

impl fmt::Display for TapPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link(path) | Self::Line(path, _) => write!(f, "{}", path.display()),
            Self::Frames(place, _) => write!(f, "{place}"),
        }
    }
}

impl TapAt {
    /// Whether its port has modem lines.
    pub(super) const fn is_serial(&self) -> bool {
        !matches!(
            self.port,
            TapPort::Frames(
                AdapterPlace::Kernel { .. } | AdapterPlace::Socketcand { .. },
                _
            )
        )
    }

    /// The interface of the capture; `rate` is that of rings.
    pub(super) fn place(&self, rate: Rate) -> RecordedPlace {
        let (carries, bits_per_second) = match &self.port {
            TapPort::Link(_) => (Carries::Link, rate.bits_per_second()),
            TapPort::Line(_, format) => (Carries::Line, format.bits_per_second),
            TapPort::Frames(_, rate) => (Carries::Frames, rate.bits_per_second()),
        };
        RecordedPlace {
            name: self.name.clone(),
            carries,
            bits_per_second,
        }
    }
}

impl FromStr for TapAt {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "`{text}` is no tap; a link of a ring and a port are expected, as in 98->97=/dev/ttyUSB1; a serial line that stations share, as \
                 in bus=/dev/ttyUSB2@500; or a CAN adapter, as in can0=slcan:/dev/ttyACM0@250, the rate in kbit/s"
            )
        };
        let (name, port) = text.split_once('=').ok_or_else(wrong)?;
        if port.is_empty() {
            return Err(wrong());
        }
        if ends(name).is_some() {
            let port = TapPort::Link(port.into());
            return Ok(Self {
                name: name.to_owned(),
                port,
            });
        }
        let good = |letter: char| letter.is_ascii_alphanumeric() || "-_".contains(letter);
        // Interfaces of captures with the name of a station carry what it sends alone.
        if name.is_empty() || name == "master" || !name.chars().all(good) {
            return Err(wrong());
        }
        let (port, bits) = rate(port)?;
        let port = match port.parse::<AdapterPlace>() {
            Ok(place) => {
                let rate = BitRate::from_bits_per_second(bits)
                    .ok_or_else(|| format!("`{text}`: CAN has rates from 10 to 1000 kbit/s"))?;
                TapPort::Frames(place, rate)
            }
            Err(_) if name.starts_with(LINE) && !port.contains(':') => {
                TapPort::Line(port.into(), line_format(bits)?)
            }
            Err(_) => return Err(wrong()),
        };
        Ok(Self {
            name: name.to_owned(),
            port,
        })
    }
}

/// A port, and the rate behind `@` in bits a second; 500 kbit/s without one.
fn rate(port: &str) -> Result<(&str, u32), String> {
    let Some((port, rate)) = port.rsplit_once('@') else {
        return Ok((port, 500_000));
    };
    let number: Option<f64> = rate.parse().ok();
    let number = number.filter(|rate| (1.0..=1_500.0).contains(rate));
    let number =
        number.ok_or_else(|| format!("`{rate}` is no rate; kbit/s are expected, as in @500"))?;
    Ok((port, (number * 1_000.0).round() as u32))
}

/// The format of a line that stations share, by its rate.
fn line_format(bits: u32) -> Result<Format, String> {
    let formats = line_formats(true);
    let format = formats.iter().find(|format| format.bits_per_second == bits);
    format.copied().ok_or_else(|| {
        let rates = formats.iter().map(|format| format.bits_per_second);
        let mut rates: Vec<_> = rates.collect();
        rates.sort_unstable();
        let rates: Vec<_> = rates
            .iter()
            .map(|rate| (f64::from(*rate) / 1_000.0).to_string())
            .collect();
        let bits = f64::from(bits) / 1_000.0;
        format!(
            "a serial line that stations share does not run at {bits} kbit/s; it has {} kbit/s",
            rates.join(", ")
        )
    })
}

/// The taps of a rig, the rate of its rings, and whether they carry in-band marks.
///
/// # Errors
/// A tap has no port that can be listened to, in a sentence.
pub(crate) fn taps_of(rig: &Rig) -> Result<(Vec<TapAt>, Rate, bool), String> {
    let file = &rig.file;
    if let Some(port) = rig.port() {
        let bits = port.rate.bits_per_second();
        let port_at = match (port.can_adapter(), port.line()) {
            (Some(place), _) => {
                let rate = BitRate::from_bits_per_second(bits);
                TapPort::Frames(place, rate.unwrap_or(BitRate::K500))
            }
            (None, Some(PortAddress::Serial(path) | PortAddress::Pty(path))) => {
                TapPort::Line(path, line_format(bits)?)
            }
            (None, _) => {
                return Err("its port is neither a CAN adapter nor a serial port, at which nothing can be sent by opening it".to_owned());
            }
        };
        let tap = TapAt {
            name: LINE.to_owned(),
            port: port_at,
        };
        return Ok((vec![tap], Rate::default(), port.marks == ErrorMarks::InBand));
    }
    let mut taps = Vec::new();
    for tap in &file.tap {
        let ring = if tap.ring == 1 { "" } else { "2:" };
        let name = format!("{ring}{}", tap.link);
        let listens = matches!(tap.endpoint.transport, Transport::Serial | Transport::Pty);
        let port = tap.endpoint.port.as_ref().filter(|_| listens);
        let port = port.ok_or_else(|| {
            format!("the tap at {name} has no `port` of the transport serial or pty, at which nothing can be sent by opening it")
        })?;
        taps.push(TapAt {
            name,
            port: TapPort::Link(port.into()),
        });
    }
    let Some(first) = file.tap.first() else {
        return Err(
            "the rig has no [[tap]]; give the taps, as in `--tap '98->97=/dev/ttyUSB1'`".to_owned(),
        );
    };
    let marks = first.endpoint.marks == ErrorMarks::InBand;
    let rate = Rate::from_bits_per_second(first.endpoint.line.baud());
    Ok((taps, rate.unwrap_or_default(), marks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn taps_are_read() {
        for (text, shown, bits) in [
            ("98->97=/dev/ttyUSB1", "/dev/ttyUSB1", 38_400),
            ("2:0->master=/dev/a=b", "/dev/a=b", 38_400),
            ("bus=/dev/ttyUSB2", "/dev/ttyUSB2", 500_000),
            ("bus-2=/dev/ttyUSB2@93.75", "/dev/ttyUSB2", 93_750),
            ("can0=slcan:/dev/ttyACM0@250", "slcan:/dev/ttyACM0", 250_000),
            ("a=slcan:localhost:4100", "slcan:localhost:4100", 500_000),
            (
                "a=socketcand:h:29536/can1",
                "socketcand:h:29536/can1",
                500_000,
            ),
            ("a=socketcan:can1", "socketcan:can1", 500_000),
        ] {
            let tap: TapAt = text.parse().expect(text);
            assert_eq!(tap.port.to_string(), shown);
            assert_eq!(tap.place(Rate::Baud38400).bits_per_second, bits, "{text}");
        }
        for (text, why) in [
            ("9->3=/dev/none", "is no tap"),
            ("98->97=", "is no tap"),
            ("plc=/dev/ttyUSB0", "is no tap"),
            (
                "bus=/dev/ttyUSB0@38.4",
                "9.6, 19.2, 93.75, 187.5, 500, 1500 kbit/s",
            ),
            ("bus=/dev/ttyUSB0@fast", "`fast` is no rate"),
            ("can0=slcan:/dev/ttyACM0@1500", "10 to 1000 kbit/s"),
        ] {
            let error = text.parse::<TapAt>().expect_err(text);
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
