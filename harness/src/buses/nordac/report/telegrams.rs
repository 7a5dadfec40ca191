//! From the octets of a line to telegrams: who sent what, and when it ended.

use harness_proto::decode::Decoded;
use harness_proto::line::LineError;
use harness_proto::profibus::Telegram;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{LineByte, Trace};

/// What a station sent without a pause.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// The slave that sent it; `None` for the master.
    pub from: Option<u8>,
    /// When its last stop bit had passed.
    pub at: Instant,
    /// Its octets as they arrived.
    pub octets: Vec<u8>,
    /// The first line error in it: the place of its octet, counted from 1.
    pub error: Option<(usize, LineError)>,
}

impl Said {
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
pub(super) fn octets(trace: &Trace) -> Vec<(Option<u8>, LineByte)> {
    let channels = trace.channels.iter();
    let all = channels.flat_map(|own| own.octets().iter().map(|octet| (own.from, *octet)));
    let mut all: Vec<_> = all.collect();
    all.sort_by_key(|(_, octet)| octet.at);
    all
}

/// The telegrams of a trace. An octet belongs to the one before it of its sender where no other station has sent between them, unless the line
/// was idle: for one octet behind a complete telegram, and for T_SYN, three octets, behind any other.
#[must_use]
pub fn said(trace: &Trace) -> Vec<Said> {
    let octets = octets(trace);
    let own = |one: &[(Option<u8>, LineByte)]| {
        (one[0].0 == one[1].0).then(|| one[1].1.at.since(one[0].1.at))
    };
    // Octets of one telegram follow each other without a gap, so the shortest distance is the time of an octet.
    let octet = octets
        .windows(2)
        .filter_map(own)
        .min()
        .unwrap_or(Span::ZERO);
    let mut all: Vec<Said> = Vec::new();
    for (from, octet_on_line) in octets {
        let Some(byte) = octet_on_line.received else {
            continue;
        };
        let at = octet_on_line.at;
        let goes_on = all.last().is_some_and(|last| {
            let since = at.since(last.at);
            let ended = since >= octet * 4 || since >= octet * 2 && last.telegram().is_some();
            last.from == from && !ended
        });
        if !goes_on {
            all.push(Said {
                from,
                at,
                octets: Vec::new(),
                error: None,
            });
        }
        if let Some(last) = all.last_mut() {
            last.octets.push(byte);
            last.at = at;
            let place = last.octets.len();
            last.error = last
                .error
                .or(octet_on_line.error.map(|error| (place, error)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_sim::record::Channel;

    /// Octets of one station, each with its distance from the one before it in octet times.
    fn channel(from: Option<u8>, start: u64, octets: &[(u64, u8)]) -> Channel {
        let mut at = Instant::START + Span::from_micros(start);
        let octets = octets.iter().map(|&(distance, byte)| {
            at = at + Span::from_micros(22) * distance;
            LineByte::seen(at, Some(byte), Some(byte), None)
        });
        Channel::of_octets(from, None, octets.collect())
    }

    fn telegrams(octets: &[(u64, u8)]) -> Vec<Vec<u8>> {
        let trace = Trace {
            channels: vec![channel(None, 0, octets)],
            ..Trace::empty(1)
        };
        said(&trace).into_iter().map(|own| own.octets).collect()
    }

    /// A gap of two octets does not end a telegram that is not complete; 33 idle bits do, and 11 behind a complete one.
    #[test]
    fn idle_time_ends_a_telegram() {
        let status = [0x10, 8, 2, 0x49, 0x53, 0x16];
        let whole: Vec<_> = status.iter().map(|own| (1, *own)).collect();
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
            .map(|own| (own.from, own.octets))
            .collect();
        let expected = [
            (None, vec![0x10, 8]),
            (Some(8), vec![0xE5]),
            (None, vec![2]),
        ];
        assert_eq!(found, expected);
    }
}
