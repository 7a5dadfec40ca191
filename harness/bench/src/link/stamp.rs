//! Arrival times of bytes that were read together.

use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};

/// Bytes that were read together, each with the time at which it came: the last one now, each before it a byte time
/// sooner, and none before the one that was read last.
pub fn stamped(
    bytes: Vec<Received>,
    now: Instant,
    byte_time: Span,
    last: &mut Instant,
) -> impl Iterator<Item = (Instant, Received)> {
    let behind = (0..bytes.len() as u64).rev();
    let stamp = move |(byte, behind)| {
        let at = now - byte_time * behind;
        *last = at.max(*last);
        (*last, byte)
    };
    bytes.into_iter().zip(behind).map(stamp)
}
