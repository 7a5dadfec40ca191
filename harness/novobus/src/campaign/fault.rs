//! One fault of a case: where it is and what it does, with the name by which people call it.

use crate::language::syntax::LinkFaultKind;
use harness_bench::file::values::{LinkName, Time};
use harness_bench::link::{LinkFault, link_name};
use harness_bench::scenario::times;
use harness_proto::time::Span;
use harness_sim::fault::Flips;
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// A bit of a byte on the line (ND21 8.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum LineBit {
    Start,
    /// Data bit 0 to 7.
    Data(u8),
    Parity,
    Stop,
}

impl LineBit {
    /// All 11, in the order in which they are sent.
    #[must_use]
    pub(crate) fn all() -> Vec<Self> {
        let data = (0..8).map(Self::Data);
        let mut all = vec![Self::Start];
        all.extend(data);
        all.extend([Self::Parity, Self::Stop]);
        all
    }
}

/// What a fault does to its byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FaultEffect {
    /// A bit is inverted.
    Bit(LineBit),
    /// The byte does not arrive.
    Drop,
    /// It arrives twice.
    Duplicate,
    /// The receiver was too slow for it.
    Overrun,
    /// A byte that was not sent arrives before it.
    Insert(u8),
    /// This and the following bytes do not arrive; the number counts all of them.
    Gap(u16),
    /// It arrives later.
    Delay(Time),
    /// The line is held at 0.
    Break(Time),
}

/// One fault: what, on which link, at which byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct InjectedFault {
    /// The link, counted from the master's outgoing one.
    pub link: usize,
    /// The byte that its transmitter sends, counted from 1.
    pub byte: u64,
    /// What happens to it.
    pub what: FaultEffect,
}

/// The link that ends at a drive, counted from the master's outgoing one.
#[must_use]
pub(crate) fn link_index(drives: u8, drive: u8) -> Option<usize> {
    Some(usize::from(drives.checked_sub(drive)?.checked_sub(1)?))
}

/// The place of a link in a ring, if the ring has it.
#[must_use]
pub(crate) fn link_place(drives: u8, link: LinkName) -> Option<usize> {
    if !link.is_in(drives) {
        return None;
    }
    match link.to {
        Some(drive) => link_index(drives, drive),
        None => Some(usize::from(drives)),
    }
}

/// The most byte times that one gap may last.
pub(crate) const MAX_GAP: u16 = 1000;

/// The longest delay or break.
pub(crate) const LONGEST: Duration = Duration::from_secs(1);

fn time(text: &str) -> Result<Time, ()> {
    let time: Time = text.parse().map_err(|_| ())?;
    if time.0 > LONGEST { Err(()) } else { Ok(time) }
}

impl FaultEffect {
    /// The same as faults of a link, each with its distance in bytes.
    #[must_use]
    pub(crate) fn on_link(self) -> Vec<(u64, LinkFault)> {
        let flip = |flips| LinkFault::Flip(flips);
        let none = Flips::default();
        let fault = match self {
            Self::Bit(LineBit::Start) => flip(Flips {
                start: true,
                ..none
            }),
            Self::Bit(LineBit::Data(bit)) => flip(Flips {
                data: 1 << bit,
                ..none
            }),
            Self::Bit(LineBit::Parity) => flip(Flips {
                parity: true,
                ..none
            }),
            Self::Bit(LineBit::Stop) => flip(Flips { stop: true, ..none }),
            Self::Drop => LinkFault::Drop,
            Self::Duplicate => LinkFault::Duplicate,
            Self::Overrun => LinkFault::Overrun,
            Self::Insert(byte) => LinkFault::Insert(byte),
            Self::Delay(time) => LinkFault::Delay(time.span()),
            Self::Break(time) => LinkFault::Break(time.span()),
            Self::Gap(bytes) => {
                return vec![(0, LinkFault::Cut), (u64::from(bytes), LinkFault::Join)];
            }
        };
        vec![(0, fault)]
    }

    /// For how many byte times the line is disturbed.
    #[must_use]
    pub(crate) fn lasts(self, byte_time: Span) -> u64 {
        match self {
            Self::Gap(bytes) => u64::from(bytes),
            Self::Delay(time) | Self::Break(time) => {
                time.span().units() / byte_time.units().max(1) + 1
            }
            _ => 1,
        }
    }

    /// The same as a scenario has it, with the distance in bytes of each line.
    #[must_use]
    pub(crate) fn lines(self) -> Vec<(u64, LinkFaultKind)> {
        let micros = |time: Time| {
            let micros = time.0.as_micros();
            times::Duration::micros(u64::try_from(micros).unwrap_or(u64::MAX))
        };
        match self {
            Self::Delay(time) => vec![(0, LinkFaultKind::Delay(micros(time)))],
            Self::Break(time) => vec![(0, LinkFaultKind::Break(micros(time)))],
            _ => {
                let faults = self.on_link().into_iter();
                faults.map(|(at, fault)| (at, fault.into())).collect()
            }
        }
    }
}

impl fmt::Display for LineBit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str("b"),
            Self::Data(bit) => write!(f, "{bit}"),
            Self::Parity => f.write_str("p"),
            Self::Stop => f.write_str("s"),
        }
    }
}

impl fmt::Display for FaultEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bit(bit) => bit.fmt(f),
            Self::Drop => f.write_str("drop"),
            Self::Duplicate => f.write_str("duplicate"),
            Self::Overrun => f.write_str("overrun"),
            Self::Insert(byte) => write!(f, "insert-{byte:02X}"),
            Self::Gap(bytes) => write!(f, "gap-{bytes}"),
            Self::Delay(time) => write!(f, "delay-{time}"),
            Self::Break(time) => write!(f, "break-{time}"),
        }
    }
}

impl FromStr for FaultEffect {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        if let Some((kind, value)) = text.split_once('-') {
            return match kind {
                "insert" if value.len() == 2 && !value.starts_with('+') => {
                    u8::from_str_radix(value, 16)
                        .map(Self::Insert)
                        .map_err(|_| ())
                }
                "gap" => match value.parse() {
                    Ok(bytes @ 1..=MAX_GAP) => Ok(Self::Gap(bytes)),
                    _ => Err(()),
                },
                "delay" => time(value).map(Self::Delay),
                "break" => time(value).map(Self::Break),
                _ => Err(()),
            };
        }
        match text {
            "b" => Ok(Self::Bit(LineBit::Start)),
            "p" => Ok(Self::Bit(LineBit::Parity)),
            "s" => Ok(Self::Bit(LineBit::Stop)),
            "drop" => Ok(Self::Drop),
            "duplicate" => Ok(Self::Duplicate),
            "overrun" => Ok(Self::Overrun),
            bit => match bit.parse() {
                Ok(bit @ 0..=7) => Ok(Self::Bit(LineBit::Data(bit))),
                _ => Err(()),
            },
        }
    }
}

/// The faults of one case: one, or two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CaseFaults {
    pub first: InjectedFault,
    /// The second, where there are two.
    pub second: Option<InjectedFault>,
}

impl CaseFaults {
    /// The faults, in order.
    pub(crate) fn faults(&self) -> impl Iterator<Item = &InjectedFault> {
        std::iter::once(&self.first).chain(&self.second)
    }

    /// The links that are damaged.
    #[must_use]
    pub(crate) fn links(&self) -> Vec<usize> {
        self.faults().map(|fault| fault.link).collect()
    }

    /// Its name: `98->97:10:0`, and `98->97:10:0+98->97:11:p` for two faults.
    #[must_use]
    pub(crate) fn name(&self, drives: u8) -> String {
        let faults = self.faults().map(|fault| {
            let link = link_name(0, drives, fault.link);
            format!("{link}:{}:{}", fault.byte, fault.what)
        });
        faults.collect::<Vec<_>>().join("+")
    }

    /// The case of a name.
    ///
    /// # Errors
    /// What is wrong with the name, in a sentence.
    pub(crate) fn from_name(name: &str, drives: u8) -> Result<Self, String> {
        let one = |text: &str| -> Option<InjectedFault> {
            let mut parts = text.splitn(3, ':');
            let link = link_place(drives, parts.next()?.parse::<LinkName>().ok()?)?;
            let byte = parts.next()?.parse().ok().filter(|byte| *byte > 0)?;
            let what = parts.next()?.parse().ok()?;
            Some(InjectedFault { link, byte, what })
        };
        let wrong = |text: &str| {
            format!(
                "`{text}` is no fault in a ring of {drives}: LINK:BYTE:WHAT is expected, such as `{}:10:0`; WHAT is a bit (b, 0 to 7, \
                 p, s) or drop, duplicate, overrun, insert-80, gap-40, delay-3ms, break-5ms",
                link_name(0, drives, 0)
            )
        };
        let mut faults = name
            .split('+')
            .map(|text| one(text).ok_or_else(|| wrong(text)));
        let first = faults.next().ok_or_else(|| wrong(name))??;
        let second = faults.next().transpose()?;
        if faults.next().is_some() {
            return Err(format!("`{name}` has more than two faults"));
        }
        Ok(Self { first, second })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_gives_the_case_and_the_case_its_name() {
        for name in [
            "98->97:10:0",
            "master->99:1:b",
            "0->master:30:s+98->97:11:p",
            "4->3:2:insert-80",
            "4->3:2:gap-40",
            "4->3:2:delay-3ms",
            "4->3:2:break-500us",
            "4->3:2:drop",
        ] {
            let case = CaseFaults::from_name(name, 100).expect("a case");
            assert_eq!(case.name(100), name);
        }
        for name in [
            "",
            "98->97",
            "98->96:1:0",
            "98->97:0:0",
            "98->97:1:8",
            "1->0:1:p+",
            "1->0:1:insert-+1",
            "1->0:1:gap-1001",
            "1->0:1:gap-0",
            "1->0:1:delay-2s",
        ] {
            assert!(CaseFaults::from_name(name, 100).is_err(), "{name}");
        }
    }
}
