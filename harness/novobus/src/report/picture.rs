//! The picture of a ring: links across, headed by their senders, bytes down, a colour for what each sender was doing (ND21 9.7, 9.8).
//!
//! Both forms draw it: the page of HTML with a script beside it (`diagram.rs`), and the file that stands alone (`svg.rs`). With
//! [`RowPlacing::Index`] row n is the n-th byte of each link, as in the manual's tables. With [`RowPlacing::Time`] a byte is placed at its
//! time, which shows how it goes round. Equal neighbours are one area, and all areas of a colour are one path.

use super::cells::{Area, Columns, areas};
use super::walk::SenderState;
use harness_bench::counted::counted;
use harness_bench::html::{Attribute, Html};
use harness_bench::report::pcapng::name;
use harness_bench::shown::RowPlacing;
use harness_proto::line::Rate;
use harness_proto::time::Span;
use harness_sim::record::Trace;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

/// Maximum number of rows of a picture; only the beginning of a longer run is drawn.
pub(crate) const MAX_ROWS: usize = 4_000;
/// Maximum number of areas of a picture: with the text of each, it stays well below 2 MB.
pub(crate) const MAX_AREAS: usize = 6_500;

/// Where the columns begin.
pub(crate) const LEFT: usize = 64;
/// Where the rows begin.
pub(crate) const TOP: usize = 28;
/// How high a row is.
pub(crate) const ROW: usize = 14;
/// How wide all columns are together, if they are not narrower than [`NARROW`].
const WIDE: usize = 1_336;
const NARROW: usize = 5;
/// Bytes are written into columns as wide as this.
const LETTERS: usize = 22;
/// The tallest picture by time; a longer run has lower bytes.
const TALLEST: f64 = 30_000.0;
/// How many faults the description names.
const FAULTS: usize = 12;

/// What is drawn of one ring, and where.
pub(crate) struct RingPicture<'t> {
    ring: usize,
    trace: &'t Trace,
    /// Rows or bytes are not drawn.
    pub(crate) cut: bool,
    /// In order of rows.
    pub(crate) areas: Vec<Area>,
    /// How wide a column is.
    pub(crate) column: usize,
    /// The first row and the one behind the last, counted from 0.
    pub(crate) rows: Range<usize>,
    /// Times instead of rows.
    times: Option<Times>,
    /// The link and the row of the byte that differs from what was expected.
    pub(crate) differs: Option<[usize; 2]>,
}

/// How times become places, in thirds of a nanosecond.
#[derive(Clone, Copy)]
struct Times {
    /// The time of the upper edge.
    from: u64,
    until: u64,
    /// How long a unit of the picture is.
    unit: f64,
    byte: u64,
}

impl Times {
    #[expect(
        clippy::cast_precision_loss,
        reason = "places in a picture: good to far less than a unit"
    )]
    fn of(areas: &[Area], byte: u64) -> Self {
        let starts = areas.iter().map(|area| area.from.saturating_sub(byte));
        let from = starts.min().unwrap_or(0);
        let until = areas.iter().map(|area| area.to).max().unwrap_or(0);
        let span = until.saturating_sub(from) as f64;
        Self {
            from,
            until,
            unit: (byte as f64 / 8.0).max(span / TALLEST),
            byte,
        }
    }

    /// How far below the upper edge a time is.
    #[expect(
        clippy::cast_precision_loss,
        reason = "places in a picture: good to far less than a unit"
    )]
    fn below(&self, at: u64) -> f64 {
        at.saturating_sub(self.from) as f64 / self.unit
    }
}

impl<'t> RingPicture<'t> {
    /// The wanted rows of a ring's trace, all where `None`, as at most `most` areas.
    pub(crate) fn new(
        ring: usize,
        trace: &'t Trace,
        placing: RowPlacing,
        rate: Rate,
        rows: Option<Range<usize>>,
        most: usize,
    ) -> Self {
        let columns = Columns::read(trace, rows);
        let mut areas = areas(&columns, placing);
        let cut = columns.cut || areas.len() > most;
        areas.truncate(most);
        let first = areas.iter().map(|area| area.rows.start).min().unwrap_or(0);
        let end = areas.iter().map(|area| area.rows.end).max().unwrap_or(0);
        let byte = rate.byte_time().units();
        Self {
            ring,
            trace,
            cut,
            column: (WIDE / trace.channels.len().max(1)).clamp(NARROW, 48),
            rows: first..end,
            times: (placing == RowPlacing::Time).then(|| Times::of(&areas, byte)),
            differs: None,
            areas,
        }
    }

    /// Marks the byte that differs from what was expected, where it is drawn.
    pub(crate) fn mark(&mut self, link: usize, row: usize) {
        self.differs = self.rows.contains(&row).then_some([link, row]);
    }

    /// Width and height.
    pub(crate) fn size(&self) -> (usize, usize) {
        let width = LEFT + self.column * self.trace.channels.len() + 16;
        (width.max(240), TOP + self.height() + 8)
    }

    /// How high all rows are together.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place in a picture, from 0 to TALLEST"
    )]
    fn height(&self) -> usize {
        match &self.times {
            None => ROW * self.rows.len(),
            Some(times) => times.below(times.until).ceil() as usize,
        }
    }

    /// Heads, rows or times, the areas in their colours, and the bytes where there is room for them.
    pub(crate) fn draw(&self, html: &mut Html) {
        self.heads(html);
        html.element("g", &[("class", &"by-index")], |html| {
            match &self.times {
                None => self.numbers(html),
                Some(times) => self.scale(html, times),
            }
            self.shapes(html);
            if self.column >= LETTERS && self.times.is_none() {
                self.letters(html);
            }
        });
    }

    /// What each area is, for a viewer that shows titles: links, bytes, time, meaning and section.
    pub(crate) fn titles(&self, html: &mut Html) {
        html.element("g", &[("class", &"titles")], |html| {
            for area in &self.areas {
                let (x, y, width, height) = self.place(area);
                let attributes: [Attribute<'_>; 4] =
                    [("x", &x), ("y", &y), ("width", &width), ("height", &height)];
                html.element("rect", &attributes, |html| {
                    html.line("title", &[], self.words(area));
                });
            }
        });
    }

    fn words(&self, area: &Area) -> String {
        let link = |place: usize| name(self.ring, &self.trace.channels[place]);
        let mut words = link(area.links.start);
        // Writing to a String cannot fail.
        let _infallible = match area.links.len() {
            1 => Ok(()),
            _ => write!(words, " to {}", link(area.links.end - 1)),
        };
        let _infallible = match area.rows.len() {
            1 => write!(words, ", byte {}", area.rows.start + 1),
            _ => write!(
                words,
                ", bytes {} to {}",
                area.rows.start + 1,
                area.rows.end
            ),
        };
        let _infallible = write!(
            words,
            ", {}: {}; {} (ND21 {})",
            Span::from_units(area.from),
            area.status,
            area.words,
            area.section
        );
        if !area.remark.is_empty() {
            let _infallible = write!(words, "; the drive: {}", area.remark);
        }
        words
    }

    /// Where an area stands, to a tenth of a unit: x, y, width, height.
    #[expect(
        clippy::cast_precision_loss,
        reason = "places in a picture: good to far less than a unit"
    )]
    fn place(&self, area: &Area) -> (usize, f64, usize, f64) {
        let x = LEFT + self.column * area.links.start;
        let width = self.column * area.links.len();
        let Some(times) = &self.times else {
            let y = TOP + ROW * (area.rows.start - self.rows.start);
            return (x, y as f64, width, (ROW * area.rows.len()) as f64);
        };
        let tenths = |value: f64| (value * 10.0).round() / 10.0;
        let y = TOP as f64 + times.below(area.from.saturating_sub(times.byte));
        let until = TOP as f64 + times.below(area.to);
        (x, tenths(y), width, tenths((until - y).max(1.4)))
    }

    /// The senders above their columns; where there is not room for all, those at faults and at the byte that differs first.
    fn heads(&self, html: &mut Html) {
        let all = 0..self.trace.channels.len();
        let faults = self.areas.iter().filter(|area| area.fault);
        let matters = faults.map(|area| area.links.start);
        let matters = self.differs.map(|at| at[0]).into_iter().chain(matters);
        // A fault on a link is of its sender or of the receiver, whose column is the next one.
        let matters = matters.flat_map(|place| [place, place + 1]);
        let ends = [0, all.end.saturating_sub(1)];
        // Neighbours that matter stand in two lines.
        let mut placed: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
        let mut place_one = |place: usize, lines: &[usize]| {
            let x = LEFT + self.column * place + self.column / 2;
            let room = |column: usize| if column == 0 { 22 } else { 10 };
            let free = |y: &usize| {
                let apart = |(other, taken): (&usize, &(usize, usize))| {
                    taken.1 != *y || taken.0.abs_diff(x) >= room(*other) + room(place)
                };
                placed.iter().all(apart)
            };
            let line = lines.iter().find(|y| free(y)).copied();
            if let Some(y) = line.filter(|_| all.contains(&place) && !placed.contains_key(&place)) {
                placed.insert(place, (x, y));
            }
        };
        for place in matters.chain(ends) {
            place_one(place, &[TOP - 9, TOP - 19]);
        }
        for place in all.clone() {
            place_one(place, &[TOP - 9]);
        }
        for (place, (x, y)) in placed {
            let attributes: [Attribute<'_>; 3] = [("class", &"m"), ("x", &x), ("y", &y)];
            match self.trace.channels[place].from {
                Some(drive) => html.line("text", &attributes, drive),
                None => html.line("text", &attributes, "master"),
            }
        }
    }

    /// The rows at the left edge.
    fn numbers(&self, html: &mut Html) {
        let step = if self.rows.len() > 1_000 { 10 } else { 5 };
        for row in self.rows.clone().step_by(step) {
            let y = TOP + ROW * (row - self.rows.start) + 11;
            edge(html, y, row + 1);
        }
    }

    /// The times at the left edge, in milliseconds.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "some hundred labels of a picture"
    )]
    fn scale(&self, html: &mut Html, times: &Times) {
        edge(html, 12, "ms");
        let height = self.height();
        let step = 40 * height.div_ceil(4_000).max(1);
        for y in (0..=height).step_by(step) {
            let at = Span::from_units(times.from + (y as f64 * times.unit) as u64);
            edge(html, TOP + y + 4, format_args!("{:.2}", at.as_millis_f64()));
        }
    }

    /// One path a colour, and one for the marks of faults.
    fn shapes(&self, html: &mut Html) {
        let mut paths: BTreeMap<char, String> = BTreeMap::new();
        for area in &self.areas {
            let (x, y, width, height) = self.place(area);
            let (width, height) = (width - 1, height - 1.0);
            let mut draw = |class: char| {
                let path = paths.entry(class).or_default();
                // Writing to a String cannot fail.
                let _infallible = write!(path, "M{x} {y}h{width}v{height}h-{width}z");
            };
            draw(class(area.state));
            if area.fault {
                // Behind all letters of the states.
                draw('x');
                let path = paths.entry('y').or_default();
                let top = y + f64::from(u8::try_from(ROW / 2 - 4).unwrap_or(0));
                let _infallible = write!(path, "M{} {top}l5 4l-5 4z", LEFT - 6);
            }
        }
        for (class, path) in &paths {
            html.shape("path", &[("class", class), ("d", path)]);
        }
        if let Some([link, row]) = self.differs {
            let x = LEFT + self.column * link;
            let y = TOP + ROW * (row - self.rows.start);
            let wide = self.column;
            let around = format!("M{} {}h{wide}v{ROW}h-{wide}z", x - 1, y - 1);
            html.shape("path", &[("class", &"w"), ("d", &around)]);
        }
    }

    /// A text a row, in which each letter has its place: much shorter than a text a byte.
    fn letters(&self, html: &mut Html) {
        let mut rows: BTreeMap<usize, (String, String)> = BTreeMap::new();
        for area in &self.areas {
            let row = area.rows.start - self.rows.start;
            let (places, letters) = rows.entry(TOP + ROW * row + 11).or_default();
            let middle = LEFT + self.column * area.links.start + self.column * area.links.len() / 2;
            // Writing to a String cannot fail.
            let _infallible = write!(places, "{} {} ", middle - 3, middle + 3);
            letters.push_str(&area.letters);
        }
        html.element("g", &[("class", &"m")], |html| {
            for (y, (places, letters)) in &rows {
                html.line("text", &[("y", y), ("x", &places.trim_end())], letters);
            }
        });
    }

    /// The classes that occur, each with its meaning.
    pub(crate) fn legend(&self) -> impl Iterator<Item = (char, &'static str)> + '_ {
        let occurs = |state: &SenderState| self.areas.iter().any(|area| area.state == *state);
        let states = SenderState::ALL.into_iter().filter(occurs);
        let faults = self.areas.iter().any(|area| area.fault);
        let fault = [
            (
                'x',
                "fault: damaged on the line, or the drive that detected it",
            ),
            ('y', "a row with a fault"),
        ];
        let differs = ('w', "the first byte that differs from what was expected");
        states
            .map(|state| (class(state), state.name()))
            .chain(fault.into_iter().filter(move |_| faults))
            .chain(self.differs.map(|_| differs))
    }

    /// What the picture shows, in words: of every fault the place.
    pub(crate) fn description(&self) -> String {
        let lengths = self.trace.channels.iter().map(|link| link.octets().len());
        let bytes = lengths.max().unwrap_or(0);
        let down = match self.times {
            None => "row n the n-th byte of each link",
            Some(_) => "each at its time",
        };
        let mut text = format!(
            "The links of a ring of {} across, headed by their senders; downwards {}, {down}.",
            counted(self.trace.stations, "drive"),
            counted(bytes, "byte")
        );
        let faults = self.areas.iter().filter(|area| area.fault);
        for area in faults.clone().take(FAULTS) {
            let words = if area.remark.is_empty() {
                &area.status
            } else {
                &area.remark
            };
            let link = name(self.ring, &self.trace.channels[area.links.start]);
            // Writing to a String cannot fail.
            let _infallible = write!(
                text,
                " Fault: {link} byte {}: {words}.",
                area.rows.start + 1
            );
        }
        let more = faults.count().saturating_sub(FAULTS);
        if more > 0 {
            let _infallible = write!(text, " And {more} more.");
        }
        if self.cut {
            text.push_str(" Only the beginning is drawn.");
        }
        text
    }
}

/// The class of a state's colour.
pub(crate) const fn class(state: SenderState) -> char {
    match state {
        SenderState::Idle => 'a',
        SenderState::Forwarding => 'b',
        SenderState::Addressed => 'c',
        SenderState::Zero => 'd',
        SenderState::Counting => 'e',
        SenderState::Sequence => 'f',
        SenderState::Other => 'g',
    }
}

/// A text at the left edge.
fn edge(html: &mut Html, y: usize, text: impl std::fmt::Display) {
    html.line(
        "text",
        &[("class", &"e"), ("x", &(LEFT - 8)), ("y", &y)],
        text,
    );
}
