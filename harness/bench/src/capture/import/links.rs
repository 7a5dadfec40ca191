//! From the channels of a file to the links of a bus: which channel is which link, and how its levels are decoded.

use super::super::telegrams::{DAY, LATEST, assemble};
use super::super::{Assembly, CaptureError, ends, line_byte};
use super::levels::Levels;
use super::numbers::SignedTime;
use super::uart::{OctetRead, UartFormat, decode, find};
use super::{ImportedCapture, ReadSettings};
use crate::capture::line_formats;
use crate::capture::senders::LineRead;
use crate::counted::counted;
use crate::report::pcapng_telegrams::{PacketOctet, station};
use harness_proto::line::{Format, Rate};
use harness_proto::time::Span;
use std::str::FromStr;

/// What a channel is the record of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChannelTarget {
    /// A link of a ring: the ring, counted from 0, and the ends of the link; `None` is the master.
    Link(usize, Option<u8>, Option<u8>),
    /// What one station sends on a line that all share; `None` is the master.
    Station(Option<u8>),
    /// A line that all stations share.
    Bus,
    /// All links of a ring.
    Ring,
}

impl ChannelTarget {
    /// By the name of a link or a station: `98->97`, `2:0->master`, `master`, `slave 8`.
    fn named(name: &str) -> Option<Self> {
        match name {
            "bus" => return Some(Self::Bus),
            "ring" => return Some(Self::Ring),
            _ => {}
        }
        let link = ends(name).map(|(ring, from, to)| Self::Link(ring, from, to));
        link.or_else(|| station(name).map(Self::Station))
    }

    /// By the name of a channel; names of links as our VCD has them too: `98_to_97_line`.
    fn of_channel(name: &str) -> Option<Self> {
        let plain = || {
            let name = name.strip_suffix("_line")?;
            Self::named(&name.replace("_to_", "->").replace("ring2_", "2:"))
        };
        let named = Self::named(name).or_else(plain);
        named.filter(|target| *target != Self::Ring)
    }
}

/// Which channel of a file is which link: `98->97=Channel 0`, or `98->97` for the only channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedLink {
    /// The link as it was given.
    pub link: String,
    /// The same, read.
    pub target: ChannelTarget,
    /// The name of the channel; `None` for the only one.
    pub channel: Option<String>,
}

impl FromStr for NamedLink {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (link, channel) = match text.split_once('=') {
            Some((link, channel)) => (link, Some(channel.to_owned())),
            None => (text, None),
        };
        let target = ChannelTarget::named(link).ok_or_else(|| {
            format!(
                "`{link}` is neither a link nor a station; `98->97=CHANNEL`, `master->99=CHANNEL` or `0->master=CHANNEL` is expected for a ring; \
                 `bus=CHANNEL`, `master=CHANNEL` or `slave 8=CHANNEL` for a line that stations share"
            )
        })?;
        Ok(Self {
            link: link.to_owned(),
            target,
            channel,
        })
    }
}

/// What a channel of a file recorded.
#[derive(Clone, Debug)]
pub(super) enum Signal {
    /// The level of a line.
    Levels(Levels),
    /// Octets that the other program has decoded.
    Octets(Vec<OctetRead>),
    /// Neither, such as the voltage of an analogue channel: why.
    Other(CaptureError),
}

/// A channel of a file.
#[derive(Clone, Debug)]
pub(super) struct ChannelRead {
    /// Its name, and others that it may be called by.
    pub(super) names: Vec<String>,
    pub(super) signal: Signal,
}

/// A channel whose link or station is known.
struct LinkChannel {
    target: ChannelTarget,
    channel: ChannelRead,
}

fn wrong(what: String) -> CaptureError {
    CaptureError::Link {
        place: "the channels".to_owned(),
        what,
    }
}

fn listed(channels: &[ChannelRead]) -> String {
    const SHOWN: usize = 12;
    let names = channels.iter().filter_map(|channel| channel.names.first());
    let mut shown: Vec<String> = names.take(SHOWN).map(|name| format!("`{name}`")).collect();
    if channels.len() > SHOWN {
        shown.push(format!("{} more", channels.len() - SHOWN));
    }
    shown.join(", ")
}

/// The place of the channel of a name.
fn only_one(name: &String, channels: &[ChannelRead]) -> Result<Option<usize>, CaptureError> {
    let named = channels.iter().enumerate();
    let mut named = named.filter(|(_, channel)| channel.names.contains(name));
    let first = named.next().map(|(place, _)| place);
    let Some((_, second)) = named.next() else {
        return Ok(first);
    };
    let remedy = match second.names.last() {
        Some(longer) if longer != name => format!("say which, with its scope, as in `{longer}`"),
        _ => "name them differently in the program that wrote the file, or export one alone"
            .to_owned(),
    };
    Err(wrong(format!("two channels are named `{name}`: {remedy}")))
}

/// The channels that are links, by what the user says and by their names. Adds notes about the others.
fn choose(
    mut channels: Vec<ChannelRead>,
    settings: &ReadSettings,
    notes: &mut Vec<String>,
) -> Result<Vec<LinkChannel>, CaptureError> {
    let mut targets: Vec<Option<ChannelTarget>> = vec![None; channels.len()];
    for link in &settings.links {
        if link.target == ChannelTarget::Ring {
            return Err(wrong(
                "`--link ring` chooses a part of a pcapng file; `--link 98->97=CHANNEL` expected for a channel".to_owned(),
            ));
        }
        let place = match &link.channel {
            Some(name) => only_one(name, &channels)?,
            None if channels.len() == 1 => Some(0),
            None => {
                let names = listed(&channels);
                return Err(wrong(format!(
                    "`--link {}` does not say which channel of {names} it is: `--link {}=CHANNEL` expected",
                    link.link, link.link
                )));
            }
        };
        let Some(place) = place else {
            let name = link.channel.as_deref().unwrap_or_default();
            let names = listed(&channels);
            return Err(wrong(format!(
                "no channel is named `{name}`; the file has {names}"
            )));
        };
        targets[place] = Some(link.target);
    }
    if settings.links.is_empty() {
        for (channel, target) in channels.iter().zip(&mut targets) {
            *target = channel
                .names
                .iter()
                .find_map(|name| ChannelTarget::of_channel(name));
        }
    }
    if targets.iter().all(Option::is_none) {
        let name = channels.first().and_then(|channel| channel.names.first());
        let name = name.map_or("CHANNEL", String::as_str);
        return Err(wrong(format!(
            "none of {} is named as a link; say which link a channel is, as in `--link \"98->97={name}\"`, or as in `--link \
             \"master={name}\"` for a line that stations share",
            listed(&channels)
        )));
    }
    let mut chosen: Vec<LinkChannel> = Vec::new();
    let mut left = Vec::new();
    for (channel, target) in channels.drain(..).zip(targets) {
        match target {
            Some(target) if chosen.iter().any(|known| known.target == target) => {
                let names = channel.names.first().cloned().unwrap_or_default();
                return Err(wrong(format!(
                    "`{names}` is the second channel of the same link; one expected"
                )));
            }
            Some(target) => match channel.signal {
                Signal::Other(why) => return Err(why),
                _ => chosen.push(LinkChannel { target, channel }),
            },
            None => left.push(channel),
        }
    }
    if !left.is_empty() {
        notes.push(format!(
            "{} not read: no link is named for {}",
            counted(left.len(), "channel"),
            listed(&left)
        ));
    }
    Ok(chosen)
}

/// Why nothing passes where octets of a shared line were not read.
pub(in crate::capture) fn unread_octets(read: &LineRead) -> Option<String> {
    let about = "not passed: a reply may be among the octets that could not be read as telegrams";
    (read.unread > 0).then(|| about.to_owned())
}

/// The format of the lines, as given or as found.
fn format(
    chosen: &[LinkChannel],
    settings: &ReadSettings,
    shared: bool,
    notes: &mut Vec<String>,
) -> Result<UartFormat, CaptureError> {
    if let Some(uart) = settings.uart {
        return Ok(uart);
    }
    let formats = match settings.rate.filter(|_| !shared) {
        Some(rate) => vec![Format::from(rate)],
        None => line_formats(shared),
    };
    let lines: Vec<&Levels> = chosen
        .iter()
        .filter_map(|line| match &line.channel.signal {
            Signal::Levels(levels) => Some(levels),
            Signal::Octets(_) | Signal::Other(_) => None,
        })
        .collect();
    if !lines.is_empty() {
        let (uart, told) = find(&lines, &formats).map_err(wrong)?;
        notes.push(told);
        return Ok(uart);
    }
    // The slowest rate at which no octet begins before the one in front of it has ended; a tenth for clocks that differ.
    let starts = chosen.iter().filter_map(|line| match &line.channel.signal {
        Signal::Octets(octets) => Some(octets.windows(2)),
        Signal::Levels(_) | Signal::Other(_) => None,
    });
    let gaps = starts.flatten().map(|two| two[1].start - two[0].start);
    let closest = gaps.filter(|gap| *gap > 0).min().unwrap_or(SignedTime::MAX);
    let fits = |format: &&Format| format.octet_time().units() / 10 * 9 <= closest.cast_unsigned();
    let mut fitting: Vec<&Format> = formats.iter().filter(fits).collect();
    fitting.sort_by_key(|format| format.bits_per_second);
    // A line with pauses everywhere says little: the bus's usual rate then.
    let usual = fitting.iter().find(|format| ***format == formats[0]);
    let near = |format: &&&Format| format.octet_time().units() / 10 * 11 >= closest.cast_unsigned();
    let found = fitting.iter().find(near).or(usual).or(fitting.first());
    let format = found.map_or(formats[0], |format| **format);
    Ok(UartFormat {
        format,
        inverted: false,
    })
}

/// Says where a line was sampled too seldom for its rate.
fn too_few_samples(chosen: &[LinkChannel], uart: UartFormat) -> Option<String> {
    const LEAST: i64 = 4;
    let bit = 3_000_000_000 / i64::from(uart.format.bits_per_second).max(1);
    let samples = chosen.iter().filter_map(|line| match &line.channel.signal {
        Signal::Levels(levels) => levels.sample,
        Signal::Octets(_) | Signal::Other(_) => None,
    });
    let sample = samples
        .max()
        .filter(|sample| sample.saturating_mul(LEAST) > bit)?;
    let tenths = bit * 10 / sample.max(1);
    Some(format!(
        "the line was sampled {}.{} times a bit, and octets may be read wrong: sample at least {LEAST} times a bit, {} samples a second",
        tenths / 10,
        tenths % 10,
        i64::from(uart.format.bits_per_second) * LEAST
    ))
}

/// The capture of the channels of a file.
///
/// # Errors
/// No channel is a link, they are of two kinds of buses, or their levels are no octets.
pub(super) fn settle(
    channels: Vec<ChannelRead>,
    settings: &ReadSettings,
    mut notes: Vec<String>,
) -> Result<ImportedCapture, CaptureError> {
    let chosen = choose(channels, settings, &mut notes)?;
    let of_ring = |line: &LinkChannel| matches!(line.target, ChannelTarget::Link(..));
    let (links, all) = (
        chosen.iter().filter(|line| of_ring(line)).count(),
        chosen.len(),
    );
    let bus = chosen.iter().any(|line| line.target == ChannelTarget::Bus);
    if (links != 0 && links != all) || (bus && all > 1) {
        return Err(wrong(
            "links of a ring, stations of a shared line, or one `bus` are expected, and not several of these: import them one after the other"
                .to_owned(),
        ));
    }
    let shared = links == 0;
    let uart = format(&chosen, settings, shared, &mut notes)?;
    let octet = uart.format.octet_time();
    notes.extend(too_few_samples(&chosen, uart));
    let lines: Vec<(ChannelTarget, Vec<OctetRead>)> = chosen
        .into_iter()
        .map(|line| {
            let octets = match line.channel.signal {
                Signal::Levels(levels) => decode(&levels, uart, usize::MAX),
                Signal::Octets(octets) => octets,
                Signal::Other(_) => Vec::new(),
            };
            (line.target, octets)
        })
        .collect();
    let starts = lines.iter().flat_map(|(_, octets)| octets);
    let first = starts.map(|octet| octet.start).min().unwrap_or(0);
    let base = match first {
        0.. if Span::from_units(first.cast_unsigned()).as_nanos() <= DAY => 0,
        _ => first,
    };
    let nanos = |start: SignedTime| {
        let since = u64::try_from(start.checked_sub(base)?).ok()?;
        let nanos = (Span::from_units(since) + octet).as_nanos();
        (nanos <= LATEST).then_some(nanos)
    };
    let late = || wrong("times are more than a year apart".to_owned());
    if shared {
        let mut all = Vec::new();
        let mut stations = Vec::new();
        let mut unread = None;
        for (target, octets) in lines {
            let read = |octet: OctetRead| {
                Ok(PacketOctet {
                    nanos: nanos(octet.start).ok_or_else(late)?,
                    sent: Some(octet.byte),
                    received: Some(octet.byte),
                    error: octet.error,
                })
            };
            let octets: Vec<PacketOctet> = octets
                .into_iter()
                .map(read)
                .collect::<Result<_, CaptureError>>()?;
            match target {
                ChannelTarget::Station(station) => {
                    stations.push(station);
                    all.extend(octets.into_iter().map(|octet| (station, octet)));
                }
                ChannelTarget::Bus | ChannelTarget::Ring | ChannelTarget::Link(..) => {
                    let read = LineRead::of(&octets, octet, false);
                    unread = unread_octets(&read);
                    notes.extend(read.notes);
                    all.extend(read.octets);
                }
            }
        }
        let capture = assemble(stations.into_iter(), all, octet);
        return Ok(ImportedCapture {
            notes,
            unread,
            ..capture.into()
        });
    }
    let mut assembly = Assembly::default();
    for (target, octets) in lines {
        let ChannelTarget::Link(ring, from, to) = target else {
            continue;
        };
        let link = assembly.link(ring, from, to);
        for octet in octets {
            let (at, byte) = (nanos(octet.start).ok_or_else(late)?, Some(octet.byte));
            link.bytes.push(line_byte(at, byte, byte, octet.error));
        }
    }
    let rate = Rate::from_bits_per_second(uart.format.bits_per_second);
    let capture = assembly.finish([None, None], [Vec::new(), Vec::new()], rate)?;
    Ok(ImportedCapture {
        notes,
        ..capture.into()
    })
}
