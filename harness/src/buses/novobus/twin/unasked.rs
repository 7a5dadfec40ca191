//! Bytes that drives send unasked in real time (ND21 9.9).
//!
//! The number of zeros before another byte, and which drive sends the first zero, depend on the clocks of the drives, which no model
//! knows. From the first unasked byte to the next byte of the master, only properties that hold for every order are checked.

use super::comparison::Symptom;
use super::follow::TwinBytes;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::time::{Instant, Span};

/// A byte and when it came.
type Heard = (Instant, Received);

/// Where a race of clocks begins: at the first byte that was sent unasked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Race {
    /// Its place among the bytes received.
    pub(crate) first: usize,
    /// Whether it is unasked both in the ring and in the model: then its value and its time are compared.
    pub(crate) in_both: bool,
    /// A byte from there on that no order of the clocks explains, and how it differs.
    pub(crate) fault: Option<(usize, Symptom)>,
}

/// When the bytes of the master's that are answered were sent, in order, and the other bytes.
pub(crate) struct Sent<'a> {
    /// When each byte that is answered began.
    pub(crate) answered: &'a [Instant],
    /// When every byte began.
    pub(crate) all: &'a [Instant],
}

impl Sent<'_> {
    /// The first byte received from `from` on that came before the byte of the master's that it would answer.
    fn first(&self, received: &[Heard], from: Instant) -> Option<usize> {
        let unasked = |(index, (at, _)): (usize, &Heard)| {
            let early = self.answered.get(index).is_none_or(|start| at < start);
            early && *at >= from
        };
        received.iter().enumerate().position(unasked)
    }

    /// The first byte that was sent unasked, by the ring or by its model, and what is wrong from there to the next byte of the master's.
    /// `None` where the model sends none: no drive may then (ND21 9.9).
    pub(crate) fn judge(
        &self,
        size: RingSize,
        (answer, received): (&TwinBytes, &[Heard]),
        tolerance: Span,
    ) -> Option<Race> {
        let expected = &answer.bytes[..];
        let model = answer.unasked;
        let (due, _) = expected[model?];
        let ring = self.first(received, due - tolerance);
        let first = match (model, ring) {
            (Some(model), Some(ring)) => model.min(ring),
            (one, other) => one.or(other)?,
        };
        let in_both = model == ring;
        let here = match (expected.get(first), received.get(first)) {
            (Some(_), None) => Some(Symptom::Missing),
            (None, Some(_)) => Some(Symptom::Surplus),
            // A byte of the master's came first in one of them. Close together, that is chance.
            (Some((due, _)), Some((at, _))) if !in_both && apart(*due, *at) > tolerance => {
                match model == Some(first) {
                    true => Some(Symptom::Missing),
                    false => Some(Symptom::Surplus),
                }
            }
            _ => None,
        };
        let foreign = || {
            let (from, _) = received.get(first).filter(|_| ring == Some(first))?;
            let until = self
                .all
                .get(self.all.partition_point(|start| start <= from));
            let foreign = |(at, byte): &Heard| {
                let before = until.is_none_or(|until| at < until);
                before && (byte.error.is_some() || byte.byte >= size.drives())
            };
            let offset = received[first..].iter().position(foreign)?;
            Some((first + offset, Symptom::Value))
        };
        Some(Race {
            first,
            in_both,
            fault: here.map(|what| (first, what)).or_else(foreign),
        })
    }
}

fn apart(one: Instant, other: Instant) -> Span {
    one.since(other).max(other.since(one))
}
