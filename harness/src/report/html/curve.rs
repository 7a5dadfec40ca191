//! A curve of values against time.

use crate::html::Html;
use std::fmt::Write as _;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 150.0;
const LEFT: f64 = 110.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 28.0;

/// Steps of a curve along the time at most; each shows the least and the most of its samples.
const STEPS: usize = 600;

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
    }

    fn shapes(
        &self,
        html: &mut Html,
        known: &[(f64, f64)],
        (from, to): (f64, f64),
        (least, most): (f64, f64),
    ) {
        let span = if to > from { to - from } else { 1.0 };
        let height = if most > least { most - least } else { 1.0 };
        let x = |at: f64| LEFT + (at - from) / span * (WIDTH - LEFT - RIGHT);
        let y = |value: f64| TOP + (most - value) / height * (HEIGHT - TOP - BOTTOM);
        let bottom = HEIGHT - BOTTOM;
        let right = WIDTH - RIGHT;
        html.shape(
            "path",
            &[
                ("class", &"axis"),
                ("d", &format!("M{LEFT} {TOP}V{bottom}H{right}")),
            ],
        );
        if least < 0.0 && most > 0.0 {
            html.shape(
                "path",
                &[
                    ("class", &"zero"),
                    ("d", &format!("M{LEFT} {:.1}H{right}", y(0.0))),
                ],
            );
        }
        html.shape(
            "path",
            &[("class", &"line"), ("d", &path(known, self.steps, &x, &y))],
        );
        let mut text = |class: &str, x: f64, y: f64, text: String| {
            let (x, y) = (format!("{x:.0}"), format!("{y:.0}"));
            html.line("text", &[("class", &class), ("x", &x), ("y", &y)], text);
        };
        text("e", LEFT - 6.0, TOP + 6.0, (self.upwards)(most));
        if most > least {
            text("e", LEFT - 6.0, bottom, (self.upwards)(least));
        }
        text("s", LEFT, HEIGHT - 10.0, (self.along)(from));
        text("e", right, HEIGHT - 10.0, (self.along)(to));
    }
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
    for chunk in known.chunks(known.len().div_ceil(STEPS).max(1)) {
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
        for (at, value) in ends.into_iter().take(two) {
            point(at, value, last);
            last = Some(value);
        }
    }
    out
}
