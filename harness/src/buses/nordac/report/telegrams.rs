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

/// The telegrams of a trace. An octet belongs to the one before it of its sender where no other station has sent between them, and where
/// the line was idle for less than one octet or the telegram is not complete.
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
            let idle = at.since(last.at) >= octet * 2;
            last.from == from && !(idle && last.telegram().is_some())
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
