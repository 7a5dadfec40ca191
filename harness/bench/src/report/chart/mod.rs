//! Values against time: the one writer of curves, for a page and for a picture of its own (SVG 1.1).
//!
//! Each unit has a panel with an axis of its own; the panels lie one below the other over the same times. A sample is a point. Neighbouring
//! samples are joined by a straight line, and a gap stays open. In a page the picture has the width of the window and its text keeps its
//! size, and the script shows the samples at a cursor.

pub mod axis;
pub mod curve;

pub use axis::{Along, HEX, number, number_of};
pub use curve::{Curve, Points};

use crate::counted::counted;
use crate::html::{Attribute, Html};
use crate::report::html::page;
use axis::{bounds, label, step, ticks};
use serde::Serialize;
use std::fmt::Write as _;

/// Curves of a chart at most.
pub const MAX_CURVES: usize = 16;

/// Samples up to which each of a curve has a mark.
const MARKED: usize = 300;
/// Maximum number of ticks of an axis; a narrow window omits every second one of the horizontal axis.
const ALONG: usize = 10;
const UPWARDS: usize = 5;

/// The area of a panel and what is around it, in pixels. Pages stretch the width.
const WIDTH: f64 = 1_000.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 20.0;
const HEAD: f64 = 22.0;
const FOOT: f64 = 26.0;
/// A line of the legend of a picture of its own.
const LINE: f64 = 18.0;

/// How curves look, in a page and in a picture of its own.
const STYLE: &str = include_str!("style.css");

/// What the script shows.
#[derive(Serialize)]
struct ChartData<'c> {
    from: f64,
    to: f64,
    unit: &'static str,
    per: f64,
    decimals: usize,
    panels: Vec<[f64; 4]>,
    curves: Vec<CurveData<'c>>,
}

#[derive(Serialize)]
struct CurveData<'c> {
    name: &'c str,
    unit: &'c str,
    panel: usize,
    held: bool,
    reach: f64,
    at: Vec<f64>,
    words: Vec<String>,
}

/// Curves over the same times.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chart<'c> {
    /// The prefix of the ids of its parts, unique in a page: letters, digits and `-`.
    pub id: &'c str,
    pub title: &'c str,
    /// From when its times count, and what else must be known to read it; may be empty.
    pub note: &'c str,
    pub along: Along,
    /// Where it begins and ends; as its curves do where `None`.
    pub ends: Option<(f64, f64)>,
    /// What is drawn: [`MAX_CURVES`] of it at most.
    pub curves: &'c [Curve],
}

/// A unit, its curves by their numbers, and the lowest and the highest value of its axis.
struct Panel<'c> {
    unit: &'c str,
    curves: Vec<usize>,
    low: f64,
    high: f64,
    top: f64,
}

impl Chart<'_> {
    fn shown(&self) -> &[Curve] {
        &self.curves[..self.curves.len().min(MAX_CURVES)]
    }

    fn ends(&self) -> (f64, f64) {
        let found = self.ends.unwrap_or_else(|| {
            let all = self.shown().iter().flat_map(|curve| &curve.points);
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (at, _)| {
                (a.min(*at), b.max(*at))
            })
        });
        match found.0 < found.1 {
            true => found,
            false if found.0.is_finite() => (found.0, found.0 + 1.0),
            false => (0.0, 1.0),
        }
    }

    fn panels(&self, top: f64) -> Vec<Panel<'_>> {
        let mut panels: Vec<Panel<'_>> = Vec::new();
        for (number, curve) in self.shown().iter().enumerate() {
            match panels.iter_mut().find(|panel| panel.unit == curve.unit) {
                Some(panel) => panel.curves.push(number),
                None => panels.push(Panel {
                    unit: &curve.unit,
                    curves: vec![number],
                    low: 0.0,
                    high: 1.0,
                    top: 0.0,
                }),
            }
        }
        for (number, panel) in panels.iter_mut().enumerate() {
            panel.top = top + HEAD + number as f64 * (HEAD + HEIGHT + 6.0);
            let values = panel
                .curves
                .iter()
                .flat_map(|index| self.curves[*index].known());
            let range = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (_, value)| {
                (a.min(value), b.max(value))
            });
            if range.0 <= range.1 {
                (panel.low, panel.high) = bounds(range, UPWARDS, panel.unit);
            }
        }
        panels
    }

    /// Draws it into a page, with its legend and what the script shows.
    pub fn draw(&self, html: &mut Html) {
        let label = format!(
            "{}: arrow keys move a cursor from sample to sample",
            self.title
        );
        let attributes: [Attribute<'_>; 4] = [
            ("class", &"plot"),
            ("tabindex", &"0"),
            ("role", &"group"),
            ("aria-label", &label),
        ];
        html.element("div", &attributes, |html| {
            let panels = self.panels(0.0);
            self.svg(html, &panels, false);
            if !self.note.is_empty() {
                html.line("p", &[("class", &"note")], self.note);
            }
            html.element("ul", &[("class", &"legend")], |html| {
                for (number, curve) in self.shown().iter().enumerate() {
                    html.element("li", &[], |html| {
                        let square: [Attribute<'_>; 4] = [
                            ("class", &"key"),
                            ("width", &"28"),
                            ("height", &"10"),
                            ("aria-hidden", &"true"),
                        ];
                        html.element("svg", &square, |html| key(html, number, curve, 5.0));
                        html.text(curve.words(self.along));
                    });
                }
            });
            if self.curves.len() > MAX_CURVES {
                let more = self.curves.len() - MAX_CURVES;
                let words = format!("{} more not drawn.", counted(more, "curve"));
                html.line("p", &[("class", &"note")], words);
            }
            html.data(&self.data(&panels));
        });
    }

    /// A page with the chart and the contents below it.
    pub fn page(&self, below: &Html) -> String {
        let mut front = Html::new();
        self.draw(&mut front);
        front.part(below);
        page(self.title, &front, &[])
    }

    /// A picture of its own.
    pub fn picture(&self) -> String {
        let lines = [self.curves.len() > MAX_CURVES, !self.note.is_empty()];
        let count = self.shown().len() + lines.into_iter().filter(|line| *line).count();
        let panels = self.panels(30.0 + count as f64 * LINE);
        let mut html = Html::new();
        self.svg(&mut html, &panels, true);
        html.into_text()
    }

    /// The picture: in a page as wide as the page, which has room for the values on its left; `whole`: with all that a file of its own needs.
    fn svg(&self, html: &mut Html, panels: &[Panel<'_>], whole: bool) {
        let bottom = panels.last().map_or(0.0, |panel| panel.top + HEIGHT);
        let height = bottom + FOOT;
        let (title, described) = (format!("{}-t", self.id), format!("{}-d", self.id));
        let named = format!("{title} {described}");
        let width = LEFT + WIDTH + RIGHT;
        let view = format!("0 0 {width} {height}");
        let mut attributes: Vec<Attribute<'_>> = vec![
            ("class", &"chart"),
            ("role", &"img"),
            ("aria-labelledby", &named),
            ("height", &height),
        ];
        if whole {
            attributes.push(("xmlns", &"http://www.w3.org/2000/svg"));
            attributes.push(("width", &width));
            attributes.push(("viewBox", &view));
        }
        let drawn = |html: &mut Html| {
            for panel in panels {
                self.panel(html, panel);
            }
            self.times(html, bottom);
        };
        html.element("svg", &attributes, |html| {
            html.line("title", &[("id", &title)], self.title);
            html.line("desc", &[("id", &described)], self.described());
            if whole {
                self.heading(html);
                let area: [Attribute<'_>; 2] = [("x", &LEFT), ("width", &WIDTH)];
                html.element("svg", &area, drawn);
            } else {
                drawn(html);
            }
        });
    }

    /// What a picture of its own has beside its panels: style, title and legend.
    fn heading(&self, html: &mut Html) {
        html.raw_text("style", STYLE);
        html.shape(
            "rect",
            &[("class", &"page"), ("width", &"100%"), ("height", &"100%")],
        );
        html.line(
            "text",
            &[("class", &"h"), ("x", &"12"), ("y", &"20")],
            self.title,
        );
        let mut y = 38.0;
        if !self.note.is_empty() {
            html.line("text", &[("x", &"12"), ("y", &y)], self.note);
            y += LINE;
        }
        for (number, curve) in self.shown().iter().enumerate() {
            let at = format!("translate(12 {})", y - 9.0);
            html.element("g", &[("transform", &at)], |html| {
                key(html, number, curve, 5.0);
            });
            html.line("text", &[("x", &"48"), ("y", &y)], curve.words(self.along));
            y += LINE;
        }
        if self.curves.len() > MAX_CURVES {
            let more = self.curves.len() - MAX_CURVES;
            let words = format!("{} more not drawn", counted(more, "curve"));
            html.line("text", &[("x", &"48"), ("y", &y)], words);
        }
    }

    fn described(&self) -> String {
        let ends = self.ends();
        let (unit, per) = self.along.unit(ends);
        let mut words = format!(
            "From {} to {} {unit}.",
            number(ends.0 / per, unit),
            number(ends.1 / per, unit)
        );
        for curve in self.shown() {
            let value = |value: f64| format!("{} {}", number(value, &curve.unit), curve.unit);
            let least = curve.known().map(|(_, value)| value).min_by(f64::total_cmp);
            let most = curve.known().map(|(_, value)| value).max_by(f64::total_cmp);
            let (first, last) = (curve.known().next(), curve.known().next_back());
            let (Some(least), Some(most), Some(first), Some(last)) = (least, most, first, last)
            else {
                let _infallible = write!(words, " {}: no value.", curve.name);
                continue;
            };
            let _infallible = write!(
                words,
                " {}, between {} and {}, first {}, last {}.",
                curve.words(self.along),
                value(least).trim_end(),
                value(most).trim_end(),
                value(first.1).trim_end(),
                value(last.1).trim_end()
            );
        }
        words
    }

    fn panel(&self, html: &mut Html, panel: &Panel<'_>) {
        let mut text = |class: &str, x: f64, y: f64, text: &str| {
            html.line("text", &[("class", &class), ("x", &x), ("y", &y)], text);
        };
        let unit = if panel.unit.is_empty() {
            "number"
        } else {
            panel.unit
        };
        text("", 0.0, panel.top - 7.0, unit);
        let values = ticks(panel.low, panel.high, UPWARDS, panel.unit);
        let y = |value: f64| (panel.high - value) / (panel.high - panel.low) * HEIGHT;
        let apart = step(&values);
        for value in &values {
            let words = label(*value, apart, panel.unit);
            text("e", -8.0, tenth(panel.top + y(*value) + 4.0), &words);
        }
        let (from, to) = self.ends();
        let x = |at: f64| (at - from) / (to - from) * WIDTH;
        let mut grid = String::new();
        // Writing to a String cannot fail.
        for at in ticks(from, to, ALONG, "") {
            let _infallible = write!(grid, "M{:.1} 0V{HEIGHT}", x(at));
        }
        for value in &values {
            let _infallible = write!(grid, "M0 {:.1}H{WIDTH}", y(*value));
        }
        let view = format!("0 0 {WIDTH} {HEIGHT}");
        let attributes: [Attribute<'_>; 7] = [
            ("class", &"area"),
            ("y", &panel.top),
            ("width", &"100%"),
            ("height", &HEIGHT),
            ("viewBox", &view),
            ("preserveAspectRatio", &"none"),
            ("aria-hidden", &"true"),
        ];
        html.element("svg", &attributes, |html| {
            let axis = format!("M0 0V{HEIGHT}H{WIDTH}");
            html.shape("path", &[("class", &"grid"), ("d", &grid)]);
            html.shape("path", &[("class", &"axis"), ("d", &axis)]);
            for number in &panel.curves {
                let curve = &self.curves[*number];
                let (line, dots) = paths(curve, &x, &y);
                let class = classes(*number, curve);
                html.shape("path", &[("class", &class), ("d", &line)]);
                if !dots.is_empty() {
                    let class = format!("o q{}", number % 8);
                    html.shape("path", &[("class", &class), ("d", &dots)]);
                }
            }
        });
    }

    /// The times below the last panel. A narrow window omits every second one.
    fn times(&self, html: &mut Html, bottom: f64) {
        let ends = self.ends();
        let (unit, per) = self.along.unit(ends);
        let all = ticks(ends.0, ends.1, ALONG, "");
        let apart = step(&all) / per;
        let below: [Attribute<'_>; 2] = [("y", &bottom), ("aria-hidden", &"true")];
        html.element("svg", &below, |html| {
            let count = all.len();
            let part = |at: f64| (at - ends.0) / (ends.1 - ends.0) * 100.0;
            // The last one ends at the edge, over the place of the one in front of it.
            let at_edge = all.last().is_some_and(|at| part(*at) > 97.0);
            for (number, at) in all.into_iter().enumerate() {
                let part = part(at);
                let x = format!("{part:.2}%");
                let last = number + 1 == count;
                let mut words = label(at / per, apart, unit);
                if number == 0 || last {
                    let _infallible = write!(words, " {unit}");
                }
                let place = if part > 97.0 { "e" } else { "m" };
                // Of the last two, or three, the last one stays.
                let front = count - 1 - number;
                let odd = number % 2 == 1 || front == 1 || front == 2 && at_edge;
                let class = match odd && !last && number > 0 {
                    true => format!("{place} w"),
                    false => place.to_owned(),
                };
                html.line("text", &[("class", &class), ("x", &x), ("y", &"18")], words);
            }
        });
    }

    fn data(&self, panels: &[Panel<'_>]) -> ChartData<'_> {
        let (from, to) = self.ends();
        let (unit, per) = self.along.unit((from, to));
        let mut curves: Vec<_> = Vec::new();
        for (place, panel) in panels.iter().enumerate() {
            for index in &panel.curves {
                let curve = &self.curves[*index];
                let points = curve.drawn().concat();
                let every = (curve.known().count() as f64 / points.len().max(1) as f64).ceil();
                let rounded = |at: f64| (at * 1e6).round() / 1e6;
                curves.push(CurveData {
                    name: &curve.name,
                    unit: &curve.unit,
                    panel: place,
                    held: curve.held,
                    // Of several samples two are shown.
                    reach: curve.reach() * every.max(1.0),
                    at: points.iter().map(|(at, _)| rounded(*at)).collect(),
                    words: points
                        .iter()
                        .map(|(_, value)| number(*value, &curve.unit))
                        .collect(),
                });
            }
        }
        ChartData {
            from,
            to,
            unit,
            per,
            decimals: if self.along == Along::Time { 3 } else { 0 },
            panels: panels
                .iter()
                .map(|panel| [panel.top, HEIGHT, panel.low, panel.high])
                .collect(),
            curves,
        }
    }
}

fn tenth(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// The classes of a curve: a colour, and dashes, which tell it from others without colours.
fn classes(number: usize, curve: &Curve) -> String {
    format!("q q{} p{}", number % 8, (curve.dash + number / 8) % 4)
}

/// How a curve looks, for the legend.
fn key(html: &mut Html, number: usize, curve: &Curve, y: f64) {
    let line = format!("M0 {y}H28");
    html.shape("path", &[("class", &classes(number, curve)), ("d", &line)]);
    let dot = format!("M14 {y}h0");
    html.shape(
        "path",
        &[("class", &format!("o q{}", number % 8)), ("d", &dot)],
    );
}

/// The lines and the points of a curve. A sample without neighbours is always a point.
fn paths(curve: &Curve, x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) -> (String, String) {
    let (mut line, mut dots) = (String::new(), String::new());
    let pieces = curve.drawn();
    let marked = pieces.iter().map(Vec::len).sum::<usize>() <= MARKED;
    for piece in &pieces {
        let mut last: Option<f64> = None;
        for (at, value) in piece {
            let (x, y) = (x(*at), y(*value));
            // Writing to a String cannot fail.
            let _infallible = match last {
                None => write!(line, "M{x:.1} {y:.1}"),
                Some(_) if curve.held => write!(line, "H{x:.1}V{y:.1}"),
                Some(_) => write!(line, "L{x:.1} {y:.1}"),
            };
            if marked || piece.len() == 1 {
                let _infallible = write!(dots, "M{x:.1} {y:.1}h0");
            }
            last = Some(y);
        }
    }
    (line, dots)
}

#[cfg(test)]
mod tests {
    use super::curve::tests::curve;
    use super::*;

    /// Each unit has a panel, and hostile names are text.
    #[test]
    fn a_panel_a_unit() {
        let a = curve(&[(0.0, Some(1.0)), (1.0, Some(2.0))]);
        let b = Curve {
            unit: "A".to_owned(),
            name: "<b>".to_owned(),
            ..a.clone()
        };
        let curves = [a.clone(), b, a];
        let chart = Chart {
            id: "c",
            title: "t",
            curves: &curves,
            ..Chart::default()
        };
        assert_eq!(chart.panels(0.0).len(), 2);
        let text = chart.picture();
        assert!(text.contains("&lt;b&gt;") && !text.contains("<b>"));
        assert_eq!(text.matches("class=\"axis\"").count(), 2);
        // Nothing, and a lone sample.
        for points in [&[][..], &[(0.0, None)], &[(5.0, Some(3.0))]] {
            let curves = [curve(points)];
            let empty = Chart {
                curves: &curves,
                ..chart
            };
            assert!(!empty.picture().contains("NaN"), "{points:?}");
        }
    }
}
