//! A curve of values against time: axes with round numbers, a mark at each sample, and what the script shows at the pointer.

use crate::html::Html;
use serde::Serialize;
use std::fmt::Write as _;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 110.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 28.0;

/// Steps of a curve along the time at most; each shows the least and the most of its samples.
const STEPS: usize = 600;

/// Samples up to which each has a mark.
const MARKED: usize = 150;

/// Round numbers on an axis at most.
const ALONG: usize = 8;
const UPWARDS: usize = 4;

/// A time from which on axes show seconds, in milliseconds.
const SECONDS: f64 = 10_000.0;

/// What the script shows: where each point is, and its words.
#[derive(Serialize)]
struct Points {
    points: Vec<(f64, f64, String)>,
}

/// Round numbers between two others, at most one more than `most`: multiples of 1, 2 or 5 times a power of 10.
fn ticks(from: f64, to: f64, most: usize) -> Vec<f64> {
    let raw = (to - from) / most.max(1) as f64;
    if !raw.is_finite() || raw <= 0.0 {
        return vec![from];
    }
    let power = 10_f64.powf(raw.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|own| own * power);
    let step = steps.into_iter().find(|own| *own >= raw * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = (from / step - 1e-9).ceil();
    let all = (0..=most + 1).map(|number| (first + number as f64) * step);
    all.take_while(|own| *own <= to + step * 1e-9).collect()
}

/// A time on an axis whose numbers are this far apart, in milliseconds.
fn time(at: f64, step: f64, longest: f64) -> String {
    let (at, step, unit) = match longest >= SECONDS {
        true => (at / 1_000.0, step / 1_000.0, "s"),
        false => (at, step, "ms"),
    };
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{at:.decimals$} {unit}")
}

/// A curve, and how its axes are labelled.
pub(crate) struct Curve<'c> {
    /// In front of the names of its parts.
    pub(crate) id: &'c str,
    pub(crate) title: &'c str,
    /// A point along and one upwards, in words.
    pub(crate) along: &'c dyn Fn(f64) -> String,
    pub(crate) upwards: &'c dyn Fn(f64) -> String,
    /// A value holds up to the next one.
    pub(crate) steps: bool,
}

impl Curve<'_> {
    /// Draws it through these points, which are there, between these ends.
    pub(crate) fn draw(&self, html: &mut Html, known: &[(f64, f64)], (from, to): (f64, f64)) {
        let values = known.iter().map(|(_, value)| *value);
        let (least, most) = values.fold(
            (f64::INFINITY, f64::NEG_INFINITY),
            |(least, most), value| (least.min(value), most.max(value)),
        );
        let view = format!("0 0 {WIDTH} {HEIGHT}");
        let (title, described) = (format!("{}-t", self.id), format!("{}-d", self.id));
        let named = format!("{title} {described}");
        let attributes: [(&str, &dyn std::fmt::Display); 4] = [
            ("class", &"nb curve"),
            ("role", &"img"),
            ("aria-labelledby", &named),
            ("viewBox", &view),
        ];
        let upwards = self.upwards;
        let (first, last) = (known.first(), known.last());
        let end = |point: Option<&(f64, f64)>| {
            point.map_or_else(String::new, |(_, value)| upwards(*value))
        };
        html.element("div", &[("class", &"plot")], |html| {
            html.element("svg", &attributes, |html| {
                html.line("title", &[("id", &title)], self.title);
                html.line(
                    "desc",
                    &[("id", &described)],
                    format_args!(
                        "From {} to {}, {} points, between {} and {}; first {}, last {}.",
                        (self.along)(from),
                        (self.along)(to),
                        known.len(),
                        upwards(least),
                        upwards(most),
                        end(first),
                        end(last),
                    ),
                );
                self.shapes(html, known, (from, to), (least, most));
            });
            let (x, y) = scale((from, to), bounds(least, most));
            let tenth = |own: f64| (own * 10.0).round() / 10.0;
            let words = |at: f64, value: f64| format!("{}: {}", (self.along)(at), upwards(value));
            let points = reduced(known);
            let points =
                points.map(|(at, value)| (tenth(x(at)), tenth(y(value)), words(at, value)));
            html.data(&Points {
                points: points.collect(),
            });
        });
    }

    fn shapes(
        &self,
        html: &mut Html,
        known: &[(f64, f64)],
        (from, to): (f64, f64),
        (least, most): (f64, f64),
    ) {
        let (low, high) = bounds(least, most);
        let (x, y) = scale((from, to), (low, high));
        let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
        let mut grid = String::new();
        let times = ticks(from, to, ALONG);
        let values = ticks(low, high, UPWARDS);
        // Writing to a String cannot fail.
        for at in &times {
            let _infallible = write!(grid, "M{:.1} {TOP}V{:.1}", x(*at), bottom + 4.0);
        }
        for value in &values {
            let _infallible = write!(grid, "M{:.1} {:.1}H{right}", LEFT - 4.0, y(*value));
        }
        let line = path(known, self.steps, &x, &y);
        let axis = format!("M{LEFT} {TOP}V{bottom}H{right}");
        for (class, d) in [("zero", &grid), ("axis", &axis), ("line", &line)] {
            html.shape("path", &[("class", &class), ("d", d)]);
        }
        if known.len() <= MARKED {
            let dot = |(at, value): &(f64, f64)| {
                format!("M{:.1} {:.1}h3v3h-3z", x(*at) - 1.5, y(*value) - 1.5)
            };
            let dots: String = known.iter().map(dot).collect();
            html.shape("path", &[("class", &"dots"), ("d", &dots)]);
        }
        let mut text = |class: &str, x: f64, y: f64, text: String| {
            let (x, y) = (format!("{x:.0}"), format!("{y:.0}"));
            html.line("text", &[("class", &class), ("x", &x), ("y", &y)], text);
        };
        for value in &values {
            text("e", LEFT - 8.0, y(*value) + 4.0, (self.upwards)(*value));
        }
        let step = times.windows(2).next().map_or(1.0, |two| two[1] - two[0]);
        for at in &times {
            let class = if x(*at) > right - 20.0 { "e" } else { "m" };
            text(class, x(*at), HEIGHT - 8.0, time(*at, step, to - from));
        }
    }
}

/// The lowest and the highest value of the axis upwards: round numbers around those of the curve.
fn bounds(least: f64, most: f64) -> (f64, f64) {
    if most <= least {
        return (least, least + 1.0);
    }
    let all = ticks(least, most, UPWARDS);
    let step = all
        .windows(2)
        .next()
        .map_or(most - least, |two| two[1] - two[0]);
    let (low, high) = (
        (least / step + 1e-9).floor() * step,
        (most / step - 1e-9).ceil() * step,
    );
    (low, high)
}

/// Where a time and a value stand in the picture.
fn scale(
    (from, to): (f64, f64),
    (low, high): (f64, f64),
) -> (impl Fn(f64) -> f64, impl Fn(f64) -> f64) {
    let span = if to > from { to - from } else { 1.0 };
    let height = if high > low { high - low } else { 1.0 };
    (
        move |at: f64| LEFT + (at - from) / span * (WIDTH - LEFT - RIGHT),
        move |value: f64| TOP + (high - value) / height * (HEIGHT - TOP - BOTTOM),
    )
}

/// The points that are drawn: of each step along the time the least and the most.
fn reduced(known: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> + '_ {
    let chunks = known.chunks(known.len().div_ceil(STEPS).max(1));
    chunks.flat_map(|chunk| {
        let mut ends = [chunk[0], chunk[0]];
        for one in chunk {
            if one.1 < ends[0].1 {
                ends[0] = *one;
            }
            if one.1 > ends[1].1 {
                ends[1] = *one;
            }
        }
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        let two = if chunk.len() > 1 { 2 } else { 1 };
        ends.into_iter().take(two)
    })
}

/// The curve; where changes were noted a cell holds its value up to the next one.
fn path(
    known: &[(f64, f64)],
    steps: bool,
    x: &impl Fn(f64) -> f64,
    y: &impl Fn(f64) -> f64,
) -> String {
    let mut out = String::new();
    let mut point = |at: f64, value: f64, last: Option<f64>| {
        // Writing to a String cannot fail.
        let _infallible = match last {
            None => write!(out, "M{:.1} {:.1}", x(at), y(value)),
            Some(last) if steps => write!(
                out,
                "L{:.1} {:.1}L{:.1} {:.1}",
                x(at),
                y(last),
                x(at),
                y(value)
            ),
            Some(_) => write!(out, "L{:.1} {:.1}", x(at), y(value)),
        };
    };
    let mut last = None;
    for (at, value) in reduced(known) {
        point(at, value, last);
        last = Some(value);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_numbers() {
        assert_eq!(ticks(0.0, 100.0, 8), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        let near = ticks(0.13, 0.31, 4)
            .into_iter()
            .map(|own| format!("{own:.3}"));
        assert_eq!(
            near.collect::<Vec<_>>().join(" "),
            "0.150 0.200 0.250 0.300"
        );
        assert_eq!(ticks(-7.0, 7.0, 4), [-5.0, 0.0, 5.0]);
        assert_eq!(ticks(3.0, 3.0, 4), [3.0]);
        assert_eq!(bounds(-7.0, 7.0), (-10.0, 10.0));
        assert_eq!(bounds(0.0, 1_000.0), (0.0, 1_000.0));
        assert_eq!(bounds(5.0, 5.0), (5.0, 6.0));
        assert_eq!(time(12_000.0, 2_000.0, 20_000.0), "12 s");
        assert_eq!(time(2.5, 0.5, 4.0), "2.5 ms");
        assert!(ticks(f64::NAN, 1.0, 4).len() == 1);
    }
}
