//! From the octets of a line to telegrams: who sent what, and when it ended.

use harness_proto::decode::Decoded;
use harness_proto::line::LineError;
use harness_proto::profibus::rate::{OCTET_BITS, SYN_BITS};
use harness_proto::profibus::{BusRate, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{LineByte, Trace};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// What a station sent without a pause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeardTelegram {
    /// The slave that sent it; `None` for the master.
    pub from: Option<u8>,
    /// When its last stop bit had passed.
    pub at: Instant,
    /// Its octets as they arrived.
    pub octets: Vec<u8>,
    /// The first line error in it: the place of its octet, counted from 1.
    pub error: Option<(usize, LineError)>,
}

impl HeardTelegram {
    /// The telegram that a receiver reads; `None` where there is a line error or no telegram.
    #[must_use]
    pub fn telegram(&self) -> Option<Telegram> {
        match Telegram::decode(&self.octets) {
            Decoded::Value { value, used } if used == self.octets.len() && self.error.is_none() => {
                Some(value)
            }
            _ => None,
        }
    }
}

/// The octets of all stations with their senders, in order of time.
pub fn octets(trace: &Trace) -> Vec<(Option<u8>, LineByte)> {
    let channels = trace.channels.iter();
    let all =
        channels.flat_map(|channel| channel.octets().iter().map(|octet| (channel.from, *octet)));
    let mut all: Vec<_> = all.collect();
    all.sort_by_key(|(_, octet)| octet.at);
    all
}

/// What a station sent without a pause: the octets that arrived, and those that did not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TelegramRun {
    /// The slave that sent them; `None` for the master.
    pub from: Option<u8>,
    /// One or more octets.
    pub octets: Vec<LineByte>,
}

impl TelegramRun {
    /// When the stop bit of its last octet had passed.
    pub fn at(&self) -> Instant {
        self.octets.last().map_or(Instant::START, |octet| octet.at)
    }

    /// When the stop bit of its first octet had passed.
    pub fn begin(&self) -> Instant {
        self.octets.first().map_or(Instant::START, |octet| octet.at)
    }

    /// What the other stations read; `None` where nothing arrived.
    pub fn said(&self) -> Option<HeardTelegram> {
        let arrived = self
            .octets
            .iter()
            .filter_map(|octet| octet.received.map(|byte| (byte, octet)));
        let arrived: Vec<_> = arrived.collect();
        let (_, last) = arrived.last()?;
        let mut errors = arrived.iter().zip(1..);
        Some(HeardTelegram {
            from: self.from,
            at: last.at,
            octets: arrived.iter().map(|(byte, _)| *byte).collect(),
            error: errors.find_map(|((_, octet), place)| octet.error.map(|error| (place, error))),
        })
    }
}

/// The time between the ends of two octets that follow each other without a gap: that of the rate at which most octets of one station
/// follow each other, since a port may give octets nearer to each other than they came; else their shortest distance. `None` where no two
/// octets follow each other.
pub fn octet_time<'t>(octets: impl Iterator<Item = (Option<u8>, &'t LineByte)>) -> Option<Span> {
    let mut last: Option<(Option<u8>, Instant)> = None;
    // Octets are many, and their distances few.
    let mut distances: BTreeMap<Span, usize> = BTreeMap::new();
    for (from, octet) in octets {
        if let Some((_, at)) = last
            .replace((from, octet.at))
            .filter(|before| before.0 == from)
        {
            *distances.entry(octet.at.since(at)).or_default() += 1;
        }
    }
    let at_rate = |rate: BusRate| {
        let octet = rate.octet_time().as_nanos();
        let near = distances
            .iter()
            .filter(|(distance, _)| distance.as_nanos().abs_diff(octet) <= octet / 50);
        let (nearest, _) = near.clone().next()?;
        let count: usize = near.map(|(_, count)| count).sum();
        Some((count, Reverse(*nearest)))
    };
    let most = BusRate::ALL.into_iter().filter_map(at_rate).max();
    most.map(|(_, Reverse(octet))| octet)
        .or_else(|| distances.keys().next().copied())
}

/// Idle octets after which a telegram begins in any case: 33 bits (T_SYN).
const SYN_OCTETS: u64 = SYN_BITS.div_ceil(OCTET_BITS);
/// What times of captures, which are cut off to nanoseconds, may fall short of.
const CUT: Span = Span::from_nanos(SYN_OCTETS + 1);

/// The octets of a trace, cut into runs. An octet begins a run where another station has sent before it, where the line was idle for 33 bits,
/// and where it was idle for at least one octet after a complete telegram.
pub fn runs(trace: &Trace) -> Vec<TelegramRun> {
    let octets = octets(trace);
    let octet_time =
        octet_time(octets.iter().map(|(from, octet)| (*from, octet))).unwrap_or(Span::ZERO);
    let mut all: Vec<TelegramRun> = Vec::new();
    for (from, octet) in octets {
        let complete = |run: &TelegramRun| run.said().is_some_and(|said| said.telegram().is_some());
        let parted = |last: &TelegramRun| {
            let distance = octet.at.since(last.at());
            distance + CUT >= octet_time * (SYN_OCTETS + 1) && distance > CUT
                || distance >= octet_time * 2 && complete(last)
        };
        match all.last_mut() {
            Some(last) if last.from == from && !parted(last) => last.octets.push(octet),
            _ => all.push(TelegramRun {
                from,
                octets: vec![octet],
            }),
        }
    }
    all
}

/// The telegrams of a trace: its runs of octets of which something arrived.
#[must_use]
pub fn said(trace: &Trace) -> Vec<HeardTelegram> {
    runs(trace).iter().filter_map(TelegramRun::said).collect()
}

/// The rate at which an octet takes as long as the shortest of a trace, give or take a hundredth.
#[must_use]
pub fn rate(trace: &Trace) -> Option<BusRate> {
    let octets = octets(trace);
    let shortest = octet_time(octets.iter().map(|(from, octet)| (*from, octet)))?.units();
    let fits = |rate: &BusRate| {
        let octet: Span = rate.octet_time();
        shortest.abs_diff(octet.units()) * 100 <= octet.units()
    };
    BusRate::ALL.into_iter().find(fits)
}

/// The bit rate of octets on a shared line, by their times; the usual one where they do not show it.
pub fn bits_per_second(traces: &[Trace]) -> u32 {
    let rate = traces.iter().find_map(rate);
    rate.unwrap_or_default().bits_per_second()
}

/// The telegrams of a shared line of octets, each with the slave that sent it; `None` is a master.
pub fn telegrams(traces: &[Trace]) -> Vec<(Option<u8>, Vec<LineByte>)> {
    let all = traces.iter().flat_map(runs);
    all.map(|run| (run.from, run.octets)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::record::Channel;

    /// Octets of one station, each with its distance from the one before it in octet times.
    fn channel(from: Option<u8>, start: u64, octets: &[(u64, u8)]) -> Channel {
        let mut at = Instant::START + Span::from_micros(start);
        let octets = octets.iter().map(|&(distance, byte)| {
            at += Span::from_micros(22) * distance;
            LineByte::seen(at, Some(byte), Some(byte), None)
        });
        Channel::of_octets(from, None, octets.collect())
    }

    fn telegrams(octets: &[(u64, u8)]) -> Vec<Vec<u8>> {
        let trace = Trace {
            channels: vec![channel(None, 0, octets)],
            ..Trace::empty(1)
        };
        said(&trace).into_iter().map(|heard| heard.octets).collect()
    }

    /// A gap of two octets does not end a telegram that is not complete; 33 idle bits do, and 11 after a complete one.
    #[test]
    fn idle_time_ends_a_telegram() {
        let status = [0x10, 8, 2, 0x49, 0x53, 0x16];
        let whole: Vec<_> = status.iter().map(|byte| (1, *byte)).collect();
        let mut gap = whole.clone();
        gap[4].0 = 3;
        assert_eq!(telegrams(&gap), [status.to_vec()]);
        gap[4].0 = 4;
        assert_eq!(telegrams(&gap), [&status[..4], &status[4..]]);
        let mut twice = [&whole[..], &whole].concat();
        twice[6].0 = 2;
        assert_eq!(telegrams(&twice), [status, status]);
        twice[6].0 = 1;
        assert_eq!(telegrams(&twice).len(), 1);
    }

    /// Octets of another station end a telegram, whatever the time.
    #[test]
    fn telegrams_of_two_stations() {
        let trace = Trace {
            channels: vec![
                channel(None, 0, &[(1, 0x10), (1, 8), (3, 2)]),
                channel(Some(8), 0, &[(3, 0xE5)]),
            ],
            ..Trace::empty(1)
        };
        let found: Vec<_> = said(&trace)
            .into_iter()
            .map(|heard| (heard.from, heard.octets))
            .collect();
        let expected = [
            (None, vec![0x10, 8]),
            (Some(8), vec![0xE5]),
            (None, vec![2]),
        ];
        assert_eq!(found, expected);
    }

    /// A port gives octets nearer to each other than they came: the telegrams stay whole.
    #[test]
    fn octets_that_a_port_gives_at_once() {
        let status = [0x10, 0x08, 0x02, 0x49, 0x53, 0x16];
        let sent: Vec<_> = status.map(|byte| (1, byte)).into();
        let near = |us: u64, byte: u8| {
            let at = Instant::START + Span::from_micros(400 + us);
            LineByte::seen(at, Some(byte), Some(byte), None)
        };
        let reply = [0x10, 0x02, 0x08, 0x00, 0x0A, 0x16];
        let given = [0, 22, 44, 44, 66, 88].into_iter().zip(reply);
        let given = given.map(|(us, byte)| near(us, byte)).collect();
        let trace = Trace {
            channels: vec![
                channel(None, 0, &sent),
                Channel::of_octets(Some(8), None, given),
            ],
            ..Trace::empty(1)
        };
        let all: Vec<_> = said(&trace).into_iter().map(|heard| heard.octets).collect();
        assert_eq!(all, [status.to_vec(), reply.to_vec()]);
    }
}
