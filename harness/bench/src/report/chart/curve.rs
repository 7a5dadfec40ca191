//! A recorded value, and what of it is drawn: pieces between gaps, and of a long one the least and the most of each step.

use super::{Along, HEX, number};
use crate::counted::counted;
use std::fmt::Write as _;

/// Steps along a curve at most; each shows the least and the most of its samples.
const STEPS: usize = 600;
/// Usual distances of samples from which on there is a gap between two.
const GAP: f64 = 2.5;
/// Part of the usual distance by which another one may differ where samples are called equidistant.
const EQUAL: f64 = 0.01;

/// The position of each sample on the axis, and its value; `None` where it has none.
pub type Points = Vec<(f64, Option<f64>)>;

/// Values against time.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// The unit of its values; empty for plain numbers.
    pub unit: String,
    /// A value holds up to the next one: changes were noted, not samples.
    pub held: bool,
    /// Which dashes it has: curves of one recording have the same.
    pub dash: usize,
    pub points: Points,
}

impl Curve {
    /// The samples that have a value.
    pub fn known(&self) -> impl DoubleEndedIterator<Item = (f64, f64)> + '_ {
        let points = self.points.iter();
        points.filter_map(|(at, value)| Some((*at, (*value)?)))
    }

    /// The usual distance of two samples: the median.
    pub fn usual(&self) -> Option<f64> {
        let two = self.points.windows(2);
        let mut distances: Vec<_> = two.map(|two| two[1].0 - two[0].0).collect();
        distances.sort_by(f64::total_cmp);
        distances.get(distances.len() / 2).copied()
    }

    /// Whether its values are words of bits.
    pub fn is_word(&self) -> bool {
        self.unit == HEX
    }

    /// Whether there are samples between which nothing is known.
    pub fn has_gaps(&self) -> bool {
        self.pieces().len() > 1
    }

    /// How far apart two samples may be that a line joins.
    pub fn reach(&self) -> f64 {
        self.usual().unwrap_or(0.0) * GAP
    }

    /// Samples that a line joins, piece by piece.
    fn pieces(&self) -> Vec<Vec<(f64, f64)>> {
        let reach = match self.held {
            true => f64::INFINITY,
            false => self.reach(),
        };
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        let mut last: Option<f64> = None;
        for (at, value) in &self.points {
            let Some(value) = value else {
                last = None;
                continue;
            };
            match (last, pieces.last_mut()) {
                (Some(last), Some(piece)) if at - last <= reach => piece.push((*at, *value)),
                _ => pieces.push(vec![(*at, *value)]),
            }
            last = Some(*at);
        }
        pieces
    }

    /// The pieces as they are drawn: of each step along the least and the most.
    pub fn drawn(&self) -> Vec<Vec<(f64, f64)>> {
        let pieces = self.pieces();
        let all: usize = pieces.iter().map(Vec::len).sum();
        if all <= 2 * STEPS {
            return pieces;
        }
        let every = all.div_ceil(STEPS);
        match pieces.len() <= STEPS {
            true => pieces.iter().map(|piece| reduced(piece, every)).collect(),
            // Gaps without end: points alone.
            false => reduced(&pieces.concat(), every)
                .into_iter()
                .map(|point| vec![point])
                .collect(),
        }
    }

    /// How many samples there are, how far apart, and how many gaps.
    pub fn words(&self, along: Along) -> String {
        let unit = match self.unit.is_empty() {
            true => String::new(),
            false => format!(" [{}]", self.unit),
        };
        let what = if self.held { "change" } else { "sample" };
        let count = self.known().count();
        let mut words = format!("{}{unit}: {}", self.name, counted(count, what));
        if let (Along::Time, false, Some(usual)) = (along, self.held, self.usual()) {
            let two = self.points.windows(2);
            let equal =
                |two: &[(f64, Option<f64>)]| (two[1].0 - two[0].0 - usual).abs() <= EQUAL * usual;
            let about = if two.clone().all(equal) { "" } else { "about " };
            // Writing to a String cannot fail.
            let _infallible = write!(words, ", {about}every {} ms", number(usual, "ms"));
        }
        let gaps = self.pieces().len().saturating_sub(1);
        if gaps > 0 {
            let _infallible = write!(words, ", {}", counted(gaps, "gap"));
        }
        if count > 2 * STEPS {
            words.push_str("; drawn by the least and the most of each step");
        }
        words
    }
}

/// The least and the most of each `every` points.
fn reduced(points: &[(f64, f64)], every: usize) -> Vec<(f64, f64)> {
    let chunks = points.chunks(every.max(1));
    let both = chunks.flat_map(|chunk| {
        let order = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let mut ends: Vec<_> = [
            chunk.iter().min_by(order).copied(),
            chunk.iter().max_by(order).copied(),
        ]
        .into_iter()
        .flatten()
        .collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends.dedup();
        ends
    });
    both.collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::report::chart::paths;

    pub(in super::super) fn curve(points: &[(f64, Option<f64>)]) -> Curve {
        Curve {
            name: "a".to_owned(),
            unit: "rpm".to_owned(),
            points: points.to_vec(),
            ..Curve::default()
        }
    }

    /// A value that is missing and a sample that is late leave the line open; a lone sample is a point.
    #[test]
    fn gaps_stay_open() {
        let v = Some(1.0);
        let gapped = curve(&[
            (0.0, v),
            (1.0, v),
            (2.0, None),
            (3.0, v),
            (4.0, v),
            (9.0, v),
        ]);
        let pieces = gapped.pieces();
        assert_eq!(
            pieces.iter().map(Vec::len).collect::<Vec<_>>(),
            [2, 2, 1],
            "{pieces:?}"
        );
        assert_eq!(
            gapped.words(Along::Time),
            "a [rpm]: 5 samples, about every 1 ms, 2 gaps"
        );
        let (line, dots) = paths(&gapped, &|x| x, &|y| y);
        assert_eq!(line, "M0.0 1.0L1.0 1.0M3.0 1.0L4.0 1.0M9.0 1.0");
        assert_eq!(dots.matches('M').count(), 5);
        // Where changes were noted, a value holds.
        let held = Curve {
            held: true,
            ..curve(&[(0.0, v), (1.0, Some(2.0)), (90.0, v)])
        };
        assert_eq!(held.pieces().len(), 1);
        assert!(paths(&held, &|x| x, &|y| y).0.contains("H90.0V1.0"));
    }

    /// A long recording keeps its peaks and is bounded; gaps without end are points.
    #[test]
    fn a_long_curve_keeps_its_peaks() {
        let mut points: Vec<_> = (0..100_000).map(|at| (f64::from(at), Some(0.0))).collect();
        points[54_321].1 = Some(7.0);
        let long = curve(&points);
        let drawn = long.drawn().concat();
        assert!(drawn.len() <= 2 * STEPS);
        assert!(drawn.contains(&(54_321.0, 7.0)));
        let every_other = points.iter_mut().step_by(2);
        every_other.for_each(|(_, value)| *value = None);
        assert!(curve(&points).drawn().len() <= 2 * STEPS);
    }
}
