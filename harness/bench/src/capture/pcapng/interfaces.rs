//! What an interface of a capture carries: by its link type, its name, and what the user says of it.

use super::parts::InterfaceGroup;
use super::{CaptureError, LINE, PcapngReader};
use crate::capture::frames::Sender;
use crate::capture::{ChannelTarget, NamedLink, ends};
use crate::report::pcapng::LINK_TYPE;
use crate::report::pcapng_frames;
use crate::report::pcapng_telegrams::{octet_time, station};
use harness_proto::can::BitRate;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use std::borrow::Cow;

/// The link types that are read, as messages name them.
pub(in crate::capture) const LINK_TYPES: &str =
    "250 (RTAC serial), 147 to 162 (octets alone), 227 (CAN), 113 or 276 (CAN, captured at `any`)";
/// Link types without a meaning of their own: serial capture tools use them for octets alone.
const USER: std::ops::RangeInclusive<u16> = 147..=162;
/// Linux cooked captures, as tcpdump writes them at the interface `any`, of both versions.
const COOKED: [u16; 2] = [113, 276];

/// How the packets of a link type hold what they carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packets {
    /// Octets after a header with an event.
    Serial,
    Octets,
    Frames,
    /// A frame after a header of Linux, which names its protocol, as do packets of any other network.
    Cooked,
    /// The same, of the second version: the header has the number of the interface too.
    Cooked2,
}

impl Packets {
    pub(super) fn of(link_type: u16) -> Option<Self> {
        match link_type {
            LINK_TYPE => Some(Self::Serial),
            pcapng_frames::LINK_TYPE => Some(Self::Frames),
            other if other == COOKED[0] => Some(Self::Cooked),
            other if other == COOKED[1] => Some(Self::Cooked2),
            other if USER.contains(&other) => Some(Self::Octets),
            _ => None,
        }
    }

    const fn are_octets(self) -> bool {
        matches!(self, Self::Serial | Self::Octets)
    }
}

pub(super) struct Interface {
    pub(super) carries: Role,
    pub(super) packets: Packets,
    /// The number of its part.
    pub(super) part: usize,
    pub(super) resolution: u8,
    pub(super) offset: i64,
    /// The time of an octet at its rate.
    pub(super) octet: Option<Span>,
    /// Its section, its name, and the times of its first and its last packet.
    pub(super) section: usize,
    pub(super) name: String,
    pub(super) heard: Option<(u64, u64)>,
}

/// What the data of an interface are.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// A link of a ring: the ring, and the ends of the link.
    Link(usize, Option<u8>, Option<u8>),
    /// What a station sends on a line that all stations share; `None` is the master.
    Station(Option<u8>),
    /// What all stations send on a line that they share.
    Line,
    /// Frames of a bus.
    Frames(Sender),
}

impl Role {
    fn named(name: &str) -> Option<Self> {
        let link = ends(name).map(|(ring, from, to)| Self::Link(ring, from, to));
        let alone = || station(name).map(Self::Station);
        let line = || name.starts_with(LINE).then_some(Self::Line);
        link.or_else(alone).or_else(line)
    }

    const fn given(target: ChannelTarget) -> Option<Self> {
        match target {
            ChannelTarget::Link(ring, from, to) => Some(Self::Link(ring, from, to)),
            ChannelTarget::Station(station) => Some(Self::Station(station)),
            ChannelTarget::Bus => Some(Self::Line),
            ChannelTarget::Ring => None,
        }
    }
}

impl PcapngReader<'_> {
    /// Adds an interface that is described at `start`; its name comes with the place of that.
    pub(in crate::capture) fn describe(
        &mut self,
        start: usize,
        link_type: u16,
        name: Option<(usize, Cow<'_, str>)>,
        resolution: u8,
        offset: i64,
        speed: Option<u64>,
    ) -> Result<(), CaptureError> {
        let (place, name) = name.map_or((start, None), |(place, name)| (place, Some(name)));
        let name = name.as_deref().map(|name| name.trim_end_matches('\0'));
        let Some(packets) = Packets::of(link_type) else {
            self.interfaces.push(None);
            return Ok(());
        };
        let (carries, part) = if packets.are_octets() {
            let Some((carries, text)) = self.octets_of(packets, name, place)? else {
                self.interfaces.push(None);
                return Ok(());
            };
            let known = speed.and_then(|speed| u32::try_from(speed).ok());
            self.speed = self.speed.or(known.and_then(Rate::from_bits_per_second));
            let part = match carries {
                Role::Link(..) => InterfaceGroup::Ring,
                Role::Station(_) | Role::Frames(_) => InterfaceGroup::Stations,
                Role::Line => InterfaceGroup::Line(text),
            };
            (carries, part)
        } else {
            let name = name.unwrap_or_default();
            let bits = speed.and_then(|speed| u32::try_from(speed).ok());
            let rate = bits.and_then(BitRate::from_bits_per_second);
            self.bit_rate = self.bit_rate.or(rate);
            let sender = Sender::named(name);
            let part = match sender {
                Sender::Known(_) => InterfaceGroup::Senders,
                Sender::ByIdentifier => InterfaceGroup::Frames(name.to_owned()),
            };
            (Role::Frames(sender), part)
        };
        let part = self.part(part);
        self.interfaces.push(Some(Interface {
            carries,
            packets,
            part,
            resolution,
            offset,
            octet: speed.and_then(octet_time),
            section: self.section,
            name: name.unwrap_or_default().to_owned(),
            heard: None,
        }));
        Ok(())
    }

    /// Whether any interface is read.
    pub(in crate::capture) fn reads_any(&self) -> bool {
        self.interfaces.iter().any(Option::is_some)
    }

    /// What an interface of octets carries, and the name of its line; `None` where the user chooses others.
    fn octets_of(
        &mut self,
        packets: Packets,
        name: Option<&str>,
        place: usize,
    ) -> Result<Option<(Role, String)>, CaptureError> {
        let number = self.interfaces.len() - self.section;
        let shown = name.map_or_else(|| number.to_string(), str::to_owned);
        let links = self.links;
        let of = |link: &NamedLink| Some((Role::given(link.target)?, shown.clone()));
        let chosen = links
            .iter()
            .find(|link| link.channel.as_ref() == Some(&shown))
            .and_then(of);
        let named = name.and_then(Role::named);
        if let Some(found) = chosen.or(named.map(|carries| (carries, shown.clone()))) {
            return Ok(Some(found));
        }
        let mut unnamed = links.iter().filter(|link| link.channel.is_none());
        let given = |link: &NamedLink| Some((Role::given(link.target)?, link.link.clone()));
        if let Some((carries, link)) = unnamed.find_map(given) {
            if self.taken.replace(number).is_some() {
                return self.wrong(
                    place,
                    format!(
                        "`--link {}` is taken for two interfaces, which are not named as links: name each, as in `--link \"{}={shown}\"`",
                        link, link
                    ),
                );
            }
            return Ok(Some((carries, link)));
        }
        if !links.is_empty() {
            return Ok(None);
        }
        let what = match (name, packets) {
            (Some(name), _) => {
                let name: String = name.chars().take(40).collect();
                format!("the interface {name:?} is neither a link of a ring nor a station")
            }
            (None, Packets::Octets) => {
                "link types 147 to 162 do not say what they carry".to_owned()
            }
            (None, _) => "this interface has no name".to_owned(),
        };
        self.wrong(
            place,
            format!(
                "{what}: say what it carries, as in `--link bus` for a line that stations share, `--link master`, `--link \"slave 8\"`, or `--link \
                 \"98->97\"` for a link of a ring; of several interfaces, `--link \"bus={shown}\"` is this one"
            ),
        )
    }

    /// Two interfaces of one name that carry something at the same time are two records of one link, or two links.
    pub(super) fn no_twins(&self) -> Result<(), CaptureError> {
        let known = self.interfaces.iter().flatten();
        let mut last: Vec<(&Interface, (u64, u64))> = Vec::new();
        for (interface, heard) in known.filter_map(|known| Some((known, known.heard?))) {
            let twin = |(other, times): &&(&Interface, (u64, u64))| {
                let same = other.section == interface.section
                    && other.part == interface.part
                    && other.carries == interface.carries;
                same && times.0 <= heard.1 && heard.0 <= times.1
            };
            if last.iter().any(|other| twin(&other)) {
                return Err(CaptureError::Link {
                    place: "the capture".to_owned(),
                    what: format!(
                        "two interfaces are named {:?} and carry something at the same time: save one of them, as in `editcap` or Wireshark",
                        interface.name
                    ),
                });
            }
            last.push((interface, heard));
        }
        Ok(())
    }
}
