//! What was damaged on a link, in the words of the scenario language.

use crate::report::pcapng::name;
use harness_proto::line::{LineError, Rate};
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::record::LineByte;
use harness_sim::record::LinkTrace;

/// A run of lost bytes longer than this is a cut cable.
const CUT: usize = 8;

/// The faults of a link, a line each. Bytes do not always show what a cable did: a break is assumed to last as long as bytes were
/// lost behind it, and many lost bytes are taken for a cut. A delay is not seen.
pub(crate) fn faults(ring: usize, link: &LinkTrace, rate: Rate) -> Vec<String> {
    let name = name(ring, link);
    let bytes = &link.bytes;
    let mut lines = Vec::new();
    let mut number = 0_u64;
    let mut place = 0;
    while let Some(byte) = bytes.get(place) {
        number += u64::from(byte.sent.is_some());
        let lost = bytes[place + 1..]
            .iter()
            .take_while(|next| next.received.is_none() && next.sent.is_some())
            .count();
        let own = |fault: LinkFault| format!("! {name} byte {number}: {}", words(fault));
        match (byte.sent, byte.received) {
            (None, Some(_)) if byte.error == Some(LineError::Break) => {
                let start = byte.at - rate.byte_time();
                let span = break_span(byte, bytes.get(place + lost), rate);
                let at = start.since_start().as_nanos();
                lines.push(format!("! {name} @{at}ns: break {}ns", span.as_nanos()));
                number += lost as u64;
                place += lost;
            }
            (None, Some(received)) => {
                let before = place.checked_sub(1).and_then(|place| bytes.get(place));
                lines.push(if doubled(before, byte, rate) {
                    own(LinkFault::Duplicate)
                } else {
                    format!("! {name} byte {}: insert {received:02X}", number + 1)
                });
            }
            (Some(_), Some(_)) if byte.error == Some(LineError::Break) => {
                let span = break_span(byte, bytes.get(place + lost), rate);
                lines.push(own(LinkFault::Break(span)));
                number += lost as u64;
                place += lost;
            }
            (Some(_), None) => {
                if lost + 1 >= CUT {
                    lines.push(own(LinkFault::Cut));
                    number += lost as u64;
                    place += lost;
                    if place + 1 < bytes.len() {
                        lines.push(format!("! {name} byte {}: join", number + 1));
                    }
                } else {
                    lines.push(own(LinkFault::Drop));
                }
            }
            (Some(sent), Some(received)) => {
                lines.extend(damage(sent, received, byte.error).map(own));
            }
            (None, None) => {}
        }
        place += 1;
    }
    lines
}

/// Whether a byte that was not sent repeats the byte before it.
fn doubled(before: Option<&LineByte>, byte: &LineByte, rate: Rate) -> bool {
    before.is_some_and(|before| {
        before.received == byte.received
            && before.sent.is_some()
            && byte.at.since(before.at).units() <= rate.byte_time().units() + 3
    })
}

/// How one byte became another.
fn damage(sent: u8, received: u8, error: Option<LineError>) -> Option<LinkFault> {
    let data = sent ^ received;
    let odd = data.count_ones() % 2 == 1;
    Some(match error {
        None if data == 0 => return None,
        None => LinkFault::Replace(received),
        Some(LineError::Parity) => LinkFault::Flip(Flips {
            data,
            parity: !odd,
            stop: false,
            start: false,
        }),
        Some(LineError::Framing) => LinkFault::Flip(Flips {
            data,
            parity: false,
            stop: true,
            start: false,
        }),
        Some(LineError::Overrun) => LinkFault::Overrun,
        Some(LineError::Break) => return None,
    })
}

/// How long a break lasted: until the last byte that was lost had begun, or a moment where none was.
fn break_span(byte: &LineByte, last: Option<&LineByte>, rate: Rate) -> Span {
    let start = byte.at - rate.byte_time();
    let until = last
        .filter(|last| last.at > byte.at)
        .map_or(byte.at, |last| last.at);
    let half = rate.bit_time() * 5;
    until.since(start).saturating_sub(half)
}

/// As a scenario writes it: times in nanoseconds, not in rounded milliseconds.
fn words(fault: LinkFault) -> String {
    match fault {
        LinkFault::Break(span) => format!("break {}ns", span.as_nanos()),
        other => other.to_string(),
    }
}
