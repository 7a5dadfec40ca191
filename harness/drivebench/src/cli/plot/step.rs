//! Figures of a step response: final value, overshoot, settling time.

use crate::report::chart::Curve;

/// Samples from which on a curve has figures.
const LEAST: usize = 10;
/// The part of the recording's time at its end that gives the final value.
const END: f64 = 0.1;
/// The part of what lies between the smallest and the largest sample from which on there is a step.
const STEP: f64 = 0.1;
/// How near to a value a sample is that counts as there, as a part of the step.
const NEAR: f64 = 0.05;

/// When a curve has settled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Settled {
    /// The time of the step in milliseconds.
    After(f64),
    /// A sample of the recording's last tenth, or the last one in front of it, is still too far from the final value.
    Never,
}

/// What tells the steps of two recordings apart; the columns of `plot` say how each figure is defined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StepFigures {
    /// The final value.
    pub(super) last: f64,
    /// Up to there from the first sample; `None` where there is no step.
    pub(super) step: Option<f64>,
    /// In percent of the step.
    pub(super) overshoot: Option<f64>,
    /// `None` as well where the samples have gaps: what happened there is not known.
    pub(super) settled: Option<Settled>,
}

impl StepFigures {
    /// The figures of a curve; `None` where it has too few samples, is a word of bits, or was noted at changes.
    pub(super) fn of(curve: &Curve) -> Option<Self> {
        let all: Vec<_> = curve.known().collect();
        if all.len() < LEAST || curve.held || curve.is_word() {
            return None;
        }
        let (begin, first) = *all.first()?;
        let (end, _) = *all.last()?;
        let late = |at: f64| at >= end - END * (end - begin);
        let ends: Vec<_> = all.iter().filter(|point| late(point.0)).collect();
        #[expect(clippy::cast_precision_loss, reason = "a number of samples")]
        let last = ends.iter().map(|point| point.1).sum::<f64>() / ends.len() as f64;
        let values = || all.iter().map(|point| point.1);
        let range = values().fold(first, f64::max) - values().fold(first, f64::min);
        let step = last - first;
        if range == 0.0 || step.abs() < STEP * range {
            return Some(Self {
                last,
                step: None,
                overshoot: None,
                settled: None,
            });
        }
        let beyond = values().map(|value| (value - last) / step);
        let beyond = beyond.fold(0.0, f64::max);
        Some(Self {
            last,
            step: Some(step),
            overshoot: Some(beyond * 100.0),
            settled: match curve.has_gaps() {
                true => None,
                false => settled(&all, first, last, late),
            },
        })
    }
}

fn settled(
    all: &[(f64, f64)],
    first: f64,
    last: f64,
    late: impl Fn(f64) -> bool,
) -> Option<Settled> {
    let near = |value: f64, other: f64| (other - value).abs() <= NEAR * (last - first).abs();
    let leaves = all.iter().position(|point| !near(first, point.1))?;
    let far = all.iter().rposition(|point| !near(last, point.1))?;
    // The first sample is near itself and far from the final value.
    let from = all.get(leaves.checked_sub(1)?)?.0;
    match all.get(far + 1) {
        Some((to, _)) if !late(*to) => Some(Settled::After(to - from)),
        _ => Some(Settled::Never),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sample each millisecond.
    fn curve(values: impl IntoIterator<Item = f64>) -> Curve {
        let points = values.into_iter().enumerate();
        Curve {
            points: points
                .map(|(at, value)| (f64::from(u16::try_from(at).expect("few")), Some(value)))
                .collect(),
            ..Curve::default()
        }
    }

    fn constant(value: f64, times: usize) -> std::iter::RepeatN<f64> {
        std::iter::repeat_n(value, times)
    }

    #[test]
    fn a_step_has_figures() {
        // Up to 100 with 20 beyond, back through 90, and there from the sample at 13 ms on.
        let values = constant(0.0, 10).chain([50.0, 120.0, 90.0]);
        let figures = StepFigures::of(&curve(values.chain(constant(100.0, 37))));
        let expected = StepFigures {
            last: 100.0,
            step: Some(100.0),
            overshoot: Some(20.0),
            settled: Some(Settled::After(4.0)),
        };
        assert_eq!(figures, Some(expected));
        // Downwards.
        let values = constant(0.0, 10).chain([-50.0, -120.0, -90.0]);
        let figures = StepFigures::of(&curve(values.chain(constant(-100.0, 37)))).expect("figures");
        assert_eq!(figures.step, Some(-100.0));
        assert_eq!(figures.overshoot, Some(20.0));
        assert_eq!(figures.settled, Some(Settled::After(4.0)));
    }

    /// What is not a step, has not ended or was not seen has no figure.
    #[test]
    fn no_figure_is_invented() {
        let ramp = StepFigures::of(&curve((0..100).map(f64::from))).expect("figures");
        assert_eq!(ramp.settled, Some(Settled::Never));
        let flat = StepFigures::of(&curve(constant(7.0, 50))).expect("figures");
        assert_eq!((flat.last, flat.step, flat.settled), (7.0, None, None));
        let pulse = constant(0.0, 20).chain(constant(100.0, 20));
        let pulse = StepFigures::of(&curve(pulse.chain(constant(0.0, 20)))).expect("figures");
        assert_eq!((pulse.step, pulse.overshoot), (None, None));
        let mut gap = curve(constant(0.0, 20).chain(constant(100.0, 30)));
        gap.points[21].1 = None;
        let figures = StepFigures::of(&gap).expect("figures");
        assert_eq!((figures.step, figures.settled), (Some(100.0), None));
        assert_eq!(StepFigures::of(&curve(constant(0.0, 3))), None);
        let word = Curve {
            unit: "hex".to_owned(),
            ..curve((0..100).map(f64::from))
        };
        assert_eq!(StepFigures::of(&word), None);
    }
}
