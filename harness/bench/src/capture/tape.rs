//! What a run carried, in order of time, so that it is recorded again as if it were heard.

use super::recorder::{Carries, Piece, RecordedPlace};
use super::runs::{bits_per_second, telegrams};
use super::senders::TelegramCutter;
use crate::medium::Medium;
use crate::report::pcapng::name;
use crate::report::pcapng_frames::rate_of;
use crate::traffic::in_time;
use harness_proto::can::BitRate;
use harness_proto::line::Rate;
use harness_proto::time::Instant;
use harness_sim::record::{Channel, LineFrame, Trace};

/// The name of the place at which a bus is heard whose stations share one line.
const LINE: &str = "bus";

/// What a run carried.
#[derive(Clone, Debug)]
pub struct Tape {
    /// Where it was heard: each link of a ring, or the line that all stations share.
    pub places: Vec<RecordedPlace>,
    /// When each piece ended, counted from the start of the run, the number of its place, and the piece. In order of time.
    pub pieces: Vec<(Instant, usize, Piece)>,
}

impl Tape {
    /// What these traces carried; `rate` is that of the rings, where they are of rings.
    pub fn of(traces: &[Trace], rate: Rate) -> Self {
        match Carries::of(traces) {
            Carries::Frames => Self::of_frames(traces),
            Carries::Line => Self::of_telegrams(traces),
            Carries::Link => Self::of_links(traces, rate),
        }
    }

    /// What was recorded at ports up to `now`, in real time. The times of octets on a shared line show when a port was read, so its telegrams
    /// end where their own octets say so; what has not ended is left out.
    pub fn of_ports(traces: &[Trace], medium: Medium, now: Instant) -> Self {
        let bits = medium.bits_per_second();
        let mut tape = match Carries::of(traces) {
            Carries::Line => {
                Self::of_line(Carries::Line, bits, cut(traces, medium, now).into_iter())
            }
            _ => Self::of(traces, Rate::from_bits_per_second(bits).unwrap_or_default()),
        };
        // Where nothing was carried, nothing shows the rate.
        for place in &mut tape.places {
            place.bits_per_second = bits;
        }
        tape
    }

    fn of_frames(traces: &[Trace]) -> Self {
        let channels = traces.iter().flat_map(|trace| &trace.channels);
        let frames: Vec<&LineFrame> = channels.flat_map(Channel::frames).collect();
        let rate: Option<BitRate> = frames.iter().find_map(|frame| rate_of(frame));
        let pieces = frames
            .into_iter()
            .map(|frame| (frame.at, 0, Piece::Frame(*frame)));
        let bits = rate.unwrap_or(BitRate::K500).bits_per_second();
        Self::of_line(Carries::Frames, bits, pieces)
    }

    fn of_telegrams(traces: &[Trace]) -> Self {
        let pieces = telegrams(traces).into_iter().filter_map(|(from, octets)| {
            let at = octets.last()?.at;
            Some((at, 0, Piece::Telegram(from, octets)))
        });
        Self::of_line(Carries::Line, bits_per_second(traces), pieces)
    }

    fn of_line(
        carries: Carries,
        bits_per_second: u32,
        pieces: impl Iterator<Item = (Instant, usize, Piece)>,
    ) -> Self {
        let mut pieces: Vec<_> = pieces.collect();
        // Equal times stay in their order.
        pieces.sort_by_key(|(at, ..)| *at);
        let place = RecordedPlace {
            name: LINE.to_owned(),
            carries,
            bits_per_second,
        };
        Self {
            places: vec![place],
            pieces,
        }
    }

    fn of_links(traces: &[Trace], rate: Rate) -> Self {
        let numbered = traces.iter().enumerate();
        let links =
            numbered.flat_map(|(ring, trace)| trace.channels.iter().map(move |link| (ring, link)));
        let place = |(ring, link)| RecordedPlace {
            name: name(ring, link),
            carries: Carries::Link,
            bits_per_second: rate.bits_per_second(),
        };
        let places = links.clone().map(place).collect();
        let links: Vec<Channel> = links.map(|(_, link)| link.clone()).collect();
        let pieces = in_time(&links).map(|(place, index)| {
            let byte = links[place].octets()[index];
            (byte.at, place, Piece::Octet(byte))
        });
        Self {
            places,
            pieces: pieces.collect(),
        }
    }
}

/// The octets of a shared line, cut into telegrams.
fn cut(traces: &[Trace], medium: Medium, now: Instant) -> Vec<(Instant, usize, Piece)> {
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let mut octets: Vec<_> = channels.flat_map(Channel::octets).collect();
    octets.sort_by_key(|octet| octet.at);
    let mut cutter = TelegramCutter::new(medium.octet_time());
    let mut ended = Vec::new();
    for octet in octets {
        let at = octet.at.since_start().as_nanos();
        ended.extend(cutter.cut(at));
        if let Some(received) = octet.arrival() {
            cutter.push(at, received);
        }
    }
    ended.extend(cutter.cut(now.since_start().as_nanos()));
    let pieces = ended.into_iter().filter_map(|(from, octets)| {
        let at = octets.last()?.at;
        Some((at, 0, Piece::Telegram(from, octets)))
    });
    pieces.collect()
}
