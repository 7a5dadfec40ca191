//! Where a capture begins: one that begins in mid-conversation is judged from where the ring was first silent.

use crate::capture::Capture;
use harness_proto::novobus::sync::{MAX_NET_LENGTH, SyncByte};
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte, Trace};

/// Whether bytes travelled in a ring when the capture began: a link carried one earlier than the master's first byte can have come there,
/// since each drive passes a byte on when it has received it (ND21 8.2).
pub(super) fn is_midway(capture: &Capture) -> bool {
    let octet = capture.rate.byte_time();
    // Each byte had left the ring.
    if capture
        .listened
        .is_some_and(|own| own.before > flight(capture))
    {
        return false;
    }
    capture.traces.iter().any(|ring| {
        let Some(sent) = ring.channels.iter().find(|link| link.from.is_none()) else {
            return false;
        };
        let Some(first) = sent.octets().first() else {
            return false;
        };
        ring.channels.iter().any(|link| {
            let passed = link
                .from
                .map_or(0, |drive| ring.stations.saturating_sub(drive));
            // A clock that is 10 % wrong is no reason.
            let earliest = first.at + Span::from_units(octet.units() * u64::from(passed) * 9 / 10);
            link.octets().first().is_some_and(|own| own.at < earliest)
        })
    })
}

/// The most bytes of a telegram: sync byte, address and net bytes (ND21 9.2).
const MOST_OF_A_TELEGRAM: u64 = 2 + MAX_NET_LENGTH as u64;

/// Whether no more was sent before a time than the end of a telegram takes to leave its ring.
pub(super) fn is_one_telegram(capture: &Capture, start: Instant) -> bool {
    let links = capture.traces.iter().flat_map(|ring| &ring.channels);
    let ends = links.flat_map(|link| link.octets().iter().map(|own| own.at));
    let front: Vec<Instant> = ends.filter(|at| *at <= start).collect();
    let most = Span::from_units(capture.rate.byte_time().units() * MOST_OF_A_TELEGRAM * 3 / 2);
    match (front.iter().min(), front.iter().max()) {
        (Some(first), Some(last)) => last.since(*first) <= flight(capture) + most,
        _ => true,
    }
}

/// In this time every byte has left its ring.
fn flight(capture: &Capture) -> Span {
    let most = capture.traces.iter().map(|ring| ring.stations).max();
    let most = u64::from(most.unwrap_or(0));
    Span::from_units(capture.rate.byte_time().units() * (most + 2) * 3 / 2)
}

/// When the master's first bytes after silences began, in each of which every byte has left its ring, as far as something came back later.
/// One that is no sync byte (ND21 9.2) goes on with a telegram.
pub(super) fn after_silences(capture: &Capture) -> Vec<Instant> {
    let octet = capture.rate.byte_time();
    let silence = flight(capture);
    let links = capture.traces.iter().flat_map(|ring| &ring.channels);
    let begins = |own: &LineByte| {
        let sent = own.received.filter(|_| own.error.is_none());
        sent.is_some_and(|byte| SyncByte::decode(byte).is_ok())
    };
    let mut ends: Vec<(Instant, bool)> = links
        .flat_map(|link| {
            let ends = link.octets().iter();
            ends.map(move |own| (own.at, link.from.is_none() && begins(own)))
        })
        .collect();
    ends.sort_unstable();
    let last = |own: &Trace| {
        let last = own.channels.iter().find(|link| link.to.is_none());
        last.and_then(|link| link.octets().last()).map(|own| own.at)
    };
    let heard = capture.traces.iter().filter_map(last).min();
    let begins = ends.windows(2).filter_map(|two| match *two {
        [(before, _), (at, true)] if at.since(before) > silence => Some(at),
        _ => None,
    });
    let answered = begins.filter(|at| heard.is_some_and(|heard| *at < heard));
    answered.map(|at| at - octet).collect()
}

/// The same from a time on.
pub(super) fn from(capture: &Capture, start: Instant) -> Capture {
    let rest = |link: &Channel| {
        Channel::of_octets(link.from, link.to, later(link.octets(), start).to_vec())
    };
    let rest = |ring: &Trace| Trace {
        channels: ring.channels.iter().map(rest).collect(),
        ..ring.clone()
    };
    Capture {
        traces: capture.traces.iter().map(rest).collect(),
        ..capture.clone()
    }
}

fn later(octets: &[LineByte], start: Instant) -> &[LineByte] {
    octets
        .iter()
        .position(|own| own.at > start)
        .map_or(&[], |first| &octets[first..])
}
