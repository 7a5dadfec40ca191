//! Gaps of a log: silences of all stations that are longer than the bus's own pauses explain. The clock may have been set forward there, the log
//! may have been paused, or the logger has lost frames; so what is due in such a silence accuses no drive.

use crate::counted::counted;
use harness_proto::time::{Instant, Span};

/// A silence is longer than the bus's own pauses explain if it lasts longer than this number of them.
const TIMES: u64 = 4;

/// Pauses of the bus come again: silences of which there are no more than these, and one more for each 100 pieces, are none.
const FEW: usize = 3;

/// The least gap of a log, and that of a log with too few pieces to show how long the bus's own pauses are.
const LEAST: [Span; 2] = [Span::from_millis(100), Span::from_millis(1_000)];

/// Pieces that show how long the bus's own pauses are.
const ENOUGH: usize = 20;

/// Gaps that are named at most.
const MOST_NAMED: usize = 3;

/// A silence of all stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The first piece after it, counted from 0.
    pub piece: usize,
    pub silence: Span,
}

/// The gaps between pieces in order, each given by its begin and its end.
pub fn gaps(pieces: impl IntoIterator<Item = (Instant, Instant)>) -> Vec<Gap> {
    let mut before = None;
    let pieces = pieces.into_iter();
    let silences = pieces.map(|(begin, end)| {
        let last = before.replace(end);
        last.map_or(Span::ZERO, |last| begin.since(last))
    });
    let silences: Vec<Span> = silences.collect();
    let mut longest = silences.clone();
    longest.sort_unstable_by(|a, b| b.cmp(a));
    let ordinary = longest.get(FEW + longest.len() / 100);
    let least = LEAST[usize::from(longest.len() < ENOUGH)];
    let most = least.max(ordinary.copied().unwrap_or(Span::ZERO) * TIMES);
    let all = silences.into_iter().enumerate();
    let gaps = all.filter(|(_, silence)| *silence > most);
    gaps.map(|(piece, silence)| Gap { piece, silence })
        .collect()
}

/// The note about gaps, if there are any; `noun` names a piece.
pub fn note(gaps: &[Gap], noun: &str) -> Option<String> {
    let named = gaps.iter().take(MOST_NAMED);
    let named = named.map(|gap| format!("of {} at {noun} {}", gap.silence, gap.piece + 1));
    let named: Vec<_> = named.collect();
    let more = gaps.len().saturating_sub(MOST_NAMED);
    let more = match more {
        0 => String::new(),
        more => format!(", and at {}", counted(more, "other place")),
    };
    (!gaps.is_empty()).then(|| {
        format!(
            "the log has a gap {}{more}: the clock may have been set, the log paused, or parts lost; nothing is judged across it",
            named.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pieces that follow a gap, where silences last these milliseconds.
    fn places(silences: impl IntoIterator<Item = u64>) -> Vec<usize> {
        let mut at = Instant::START;
        let pieces = std::iter::once(0).chain(silences).map(|silence| {
            let begin = at + Span::from_millis(silence);
            at = begin;
            (begin, at)
        });
        gaps(pieces).iter().map(|gap| gap.piece).collect()
    }

    #[test]
    fn a_silence_is_a_gap_unless_the_bus_has_more_like_it() {
        let cycle = |count| std::iter::repeat_n(10, count);
        assert_eq!(places(cycle(20).chain([110]).chain(cycle(20))), [21]);
        // Cycles that are missed are shorter, and pauses of a host come again.
        assert_eq!(places(cycle(20).chain([40]).chain(cycle(20))).len(), 0);
        let pauses = |count| std::iter::repeat_n([10, 2_000], count).flatten();
        assert_eq!(places(cycle(20).chain(pauses(3))).len(), 3);
        assert_eq!(places(cycle(20).chain(pauses(4))).len(), 0);
        // Parts that stand one after another.
        let parts = (0..10).flat_map(|_| cycle(200).chain([60_000]));
        assert_eq!(places(parts).len(), 10);
    }

    #[test]
    fn a_few_pieces_do_not_show_the_pauses_of_their_bus() {
        assert_eq!(places([1, 900, 1]).len(), 0);
        assert_eq!(places([1, 1_001, 1]), [2]);
    }

    #[test]
    fn a_note_names_the_first_gaps() {
        assert_eq!(note(&[], "frame"), None);
        let gap = |piece| Gap {
            piece,
            silence: Span::from_millis(3_000),
        };
        let text = note(&[0, 5, 6, 7, 9].map(gap), "frame").expect("a note");
        let begin = "the log has a gap of 3000.000 ms at frame 1, of 3000.000 ms at frame 6, of 3000.000 ms at frame 7";
        assert!(text.starts_with(begin), "{text}");
        assert!(text.contains(", and at 2 other places: "), "{text}");
    }
}
