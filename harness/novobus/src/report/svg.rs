//! The picture of one ring or two as a file that stands alone (SVG 1.1).
//!
//! A tooltip gives the meaning of a byte, its rule and section. There are no scripts; colours follow the reader's light or dark scheme. A long
//! run is cut, and the picture says so.

use super::picture::{LEFT, MAX_AREAS, RingPicture};
use harness_bench::html::{Attribute, Html};
use harness_bench::shown::RowPlacing;
use harness_proto::line::Rate;
use harness_sim::record::Trace;
use std::ops::Range;

/// What is drawn, and how.
#[derive(Clone, Debug)]
pub(crate) struct SvgOptions<'o> {
    /// The heading; any text.
    pub title: &'o str,
    pub scale: RowPlacing,
    /// The rate of the line.
    pub rate: Rate,
    /// The rows, counted from 0; all where `None`.
    pub rows: Option<Range<usize>>,
}

/// How high the heading is.
const HEAD: usize = 40;
/// How high a line of the legend is.
const LINE: usize = 20;

/// Plain rules without variables, which some viewers do not know.
const STYLE: &str = "\
.nb{font:11px ui-monospace,monospace}.page{fill:#fff}text{fill:#1b1f24}.h{font-size:15px;font-weight:600}\
.m{text-anchor:middle}text.e{text-anchor:end}text.e,.cut{fill:#5d6670}.titles{fill:none;pointer-events:all}\
path.a{fill:#e6e9ed}path.b{fill:#b9d7f5}path.c{fill:#7fd09a}path.d{fill:#f28b82}path.e{fill:#f7c873}path.f{fill:#c9a7f0}path.g{fill:#d0d4d9}\
path.x{fill:none;stroke:#b00020;stroke-width:2}path.y{fill:#b00020}\
@media(prefers-color-scheme:dark){.page{fill:#14171a}text{fill:#e6e9ec}text.e,.cut{fill:#98a2ad}\
path.a{fill:#262b31}path.b{fill:#27527c}path.c{fill:#1f6f43}path.d{fill:#9c2f2a}path.e{fill:#8a621a}path.f{fill:#5d3f8f}path.g{fill:#474e57}\
path.x{stroke:#ff8a80}path.y{fill:#ff8a80}}";

/// One or two rings of a run, each a picture of its own, one below the other.
#[must_use]
pub(crate) fn svg(traces: &[Trace], options: &SvgOptions<'_>) -> String {
    let most = MAX_AREAS / traces.len().max(1);
    let pictures = traces.iter().enumerate().map(|(ring, trace)| {
        let rows = options.rows.clone();
        RingPicture::new(ring, trace, options.scale, options.rate, rows, most)
    });
    let pictures: Vec<_> = pictures.collect();
    let mut legend: Vec<_> = pictures.iter().flat_map(RingPicture::legend).collect();
    legend.sort_unstable();
    legend.dedup();

    let heights = pictures.iter().map(|picture| picture.size().1 + LINE);
    let rings: usize = heights.sum();
    let widths = pictures.iter().map(|picture| picture.size().0);
    let width = widths.max().unwrap_or(0).max(640);
    let height = HEAD + rings + LINE * legend.len() + 8;

    let view = format!("0 0 {width} {height}");
    let attributes: [Attribute<'_>; 7] = [
        ("xmlns", &"http://www.w3.org/2000/svg"),
        ("class", &"nb"),
        ("role", &"img"),
        ("viewBox", &view),
        ("width", &width),
        ("height", &height),
        ("aria-labelledby", &"ring-title ring-desc"),
    ];
    let mut html = Html::new();
    html.element("svg", &attributes, |html| {
        html.line("title", &[("id", &"ring-title")], options.title);
        let described: Vec<_> = pictures.iter().map(RingPicture::description).collect();
        html.line("desc", &[("id", &"ring-desc")], described.join(" "));
        html.raw_text("style", STYLE);
        let whole: [Attribute<'_>; 3] =
            [("class", &"page"), ("width", &"100%"), ("height", &"100%")];
        html.shape("rect", &whole);
        words(html, "h", (12, 24), options.title);
        let mut y = HEAD;
        for picture in &pictures {
            let height = picture.size().1;
            let shift = format!("translate(0 {y})");
            html.element("g", &[("transform", &shift)], |html| {
                picture.draw(html);
                picture.titles(html);
                if picture.cut {
                    let text = "The run goes on: only its beginning is drawn.";
                    words(html, "cut", (LEFT, height + 8), text);
                }
            });
            y += height + LINE;
        }
        for (class, meaning) in &legend {
            key(html, *class, y);
            words(html, "k", (32, y + 10), meaning);
            y += LINE;
        }
    });
    html.into_text()
}

fn words(html: &mut Html, class: &str, (x, y): (usize, usize), text: &str) {
    html.line("text", &[("class", &class), ("x", &x), ("y", &y)], text);
}

/// The colour or the mark of a legend's line.
fn key(html: &mut Html, class: char, y: usize) {
    let path = match class {
        'y' => format!("M14 {}l5 4l-5 4z", y + 2),
        _ => format!("M12 {y}h12v12h-12z"),
    };
    html.shape("path", &[("class", &class), ("d", &path)]);
}
