//! Compares two traces telegram by telegram.

use super::table::station;
use super::words::Reader;
use crate::value::hex;
use harness_bench::capture::runs::{HeardTelegram, said};
use harness_bench::counted::counted;
use harness_proto::time::Span;
use harness_sim::record::Trace;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TraceDifference {
    /// How many telegrams each side has.
    counts: [usize; 2],
    /// The first place, counted from 1, at which the telegrams differ, and what stands there on each side.
    first: Option<(usize, [String; 2])>,
    /// The largest difference between times of equal telegrams.
    late: Span,
    tolerance: Span,
}

/// Compares the telegrams of two runs in their order. Their times may differ by `tolerance`.
#[must_use]
pub(crate) fn difference(left: &[Trace], right: &[Trace], tolerance: Span) -> TraceDifference {
    let sides = [left, right].map(|traces| traces.iter().flat_map(said).collect::<Vec<_>>());
    let [left, right] = &sides;
    let same = |one: &HeardTelegram, other: &HeardTelegram| {
        (one.from, &one.octets, one.error) == (other.from, &other.octets, other.error)
    };
    let pairs = || left.iter().zip(right);
    let equal = pairs().take_while(|(one, other)| same(one, other)).count();
    let late = pairs().take(equal).map(|(one, other)| {
        let (early, late) = (one.at.min(other.at), one.at.max(other.at));
        late.since(early)
    });
    let differs = equal < left.len().max(right.len());
    TraceDifference {
        counts: [left.len(), right.len()],
        first: differs.then(|| (equal + 1, [words(left, equal), words(right, equal)])),
        late: late.max().unwrap_or(Span::ZERO),
        tolerance,
    }
}

/// The telegram at a place, as a row of the table.
fn words(all: &[HeardTelegram], place: usize) -> String {
    let mut reader = Reader::default();
    let mut read = all.iter().map(|telegram| (telegram, reader.read(telegram)));
    let Some((telegram, words)) = read.nth(place) else {
        return "no more telegrams".to_owned();
    };

    format!(
        "{} at {}: {} {} [{}]",
        station(telegram.from),
        telegram.at,
        words.service,
        words.meaning,
        hex(&telegram.octets)
    )
}

impl TraceDifference {
    /// Whether the telegrams are the same, and their times within the tolerance.
    #[must_use]
    pub(crate) fn is_none(&self) -> bool {
        self.first.is_none() && self.late <= self.tolerance
    }

    /// The comparison in words.
    #[must_use]
    pub(crate) fn show(&self, names: [&str; 2]) -> String {
        let [left, right] = self.counts;
        let mut text = match &self.first {
            None => format!("the same: {}\n", counted(left, "telegram")),
            Some((place, [one, other])) => format!(
                "first difference: telegram {place} of {left} and {right}\n  {}: {one}\n  {}: {other}\n",
                names[0], names[1]
            ),
        };
        text.push_str(&format!(
            "times of equal telegrams differ by up to {}\n",
            self.late
        ));
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::time::Instant;
    use harness_sim::record::{Channel, LineByte};

    fn trace(start: u64, octets: &[u8]) -> Trace {
        let at = |place: usize| Instant::START + Span::from_micros(start + 22 * place as u64);
        let octets = octets.iter().enumerate();
        let octets = octets
            .map(|(place, octet)| LineByte::seen(at(place), Some(*octet), Some(*octet), None));
        Trace {
            channels: vec![Channel::of_octets(None, None, octets.collect())],
            ..Trace::empty(1)
        }
    }

    #[test]
    fn bytes_and_times_are_compared() {
        let status = [0x10, 8, 2, 0x49, 0x53, 0x16];
        let other = [0x10, 9, 2, 0x49, 0x54, 0x16];
        let compare = |right: Trace, micros| {
            let tolerance = Span::from_micros(micros);
            difference(&[trace(0, &status)], &[right], tolerance)
        };
        assert!(compare(trace(5, &status), 5).is_none());
        assert!(!compare(trace(5, &status), 4).is_none());
        let found = compare(trace(0, &other), 0);
        assert!(!found.is_none());
        let shown = found.show(["a", "b"]);
        assert!(
            shown.contains("first difference: telegram 1 of 1 and 1"),
            "{shown}"
        );
        let shown = compare(Trace::empty(1), 0).show(["a", "b"]);
        assert!(shown.contains("b: no more telegrams"), "{shown}");
    }
}
