//! Compares expected bytes with received ones.

use harness_bench::scenario::pattern::Expected;
use harness_proto::line::Received;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::time::Instant;

/// Whether a received byte is what is expected.
pub(crate) fn matches(expected: Expected, received: Received) -> bool {
    match expected {
        Expected::Byte(byte) => received.is(byte),
        Expected::Any => received.error.is_none(),
        // Resolved before it is compared.
        Expected::MinusChecksum(_) => false,
    }
}

/// A checking byte as the byte that it must be, by what was received before it.
pub(crate) fn resolve(expected: Expected, before: &[(Instant, Received)]) -> Expected {
    match expected {
        Expected::MinusChecksum(over) => {
            let from = before.len().saturating_sub(usize::from(over));
            let sum = before[from..]
                .iter()
                .fold(Checksum::EMPTY, |sum, (_, byte)| sum.with(byte.byte));
            Expected::Byte(sum.minus())
        }
        known => known,
    }
}
