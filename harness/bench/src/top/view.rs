//! The page: a pure function of the view's state and of the size of the terminal.

use super::keys::{HELP, Press};
use super::reading::{HeadLine, TopForm, TopRow};
use super::state::{KeyTarget, Top};
use crate::counted::counted;
use harness_proto::time::Span;
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::{Modifier, Style};
use ratatui_core::terminal::Frame;
use std::fmt::Write as _;

/// What columns that give way leave of the last one.
const LAST_WIDTH: usize = 16;
/// Lines of events at most, and how many lines a terminal has for each.
const EVENTS: usize = 4;
const LINES_EACH: usize = 5;
/// Rows of drives that the head makes room for.
const LEAST_ROWS: usize = 4;

/// The keys in the last line, and a shorter text for narrow terminals.
const KEYS: &str = "  q quit  x stop  / filter  s sort  p pause  ? help";
const FEW_KEYS: &str = "  q quit  ? help";

/// The appearance of a line.
#[derive(Clone, Copy)]
enum Face {
    Plain,
    Bold,
    Reverse,
    Error,
}

impl Face {
    const fn of(is_error: bool) -> Self {
        match is_error {
            true => Self::Error,
            false => Self::Plain,
        }
    }

    /// No colours but red: they are the terminal's own, and what is red says in words why.
    fn style(self, colour: bool) -> Style {
        match self {
            Self::Plain => Style::new(),
            Self::Bold => Style::new().add_modifier(Modifier::BOLD),
            Self::Reverse => Style::new().add_modifier(Modifier::REVERSED),
            Self::Error if colour => Style::new().red(),
            Self::Error => Style::new().add_modifier(Modifier::BOLD),
        }
    }
}

/// Draws the page into a terminal's frame.
pub fn draw(top: &mut Top, colour: bool, frame: &mut Frame<'_>) {
    let area = frame.area();
    render(top, colour, area, frame.buffer_mut());
}

/// Draws the page into a buffer.
pub fn render(top: &mut Top, colour: bool, area: Rect, buffer: &mut Buffer) {
    let height = usize::from(area.height);
    let head = head(top);
    let width = usize::from(area.width);
    let foot_room = foot(top, width, height).len();
    // What does not fit into a low terminal is left out from the head first: its first line and its last ones stay.
    let rows = top.rows().len().min(LEAST_ROWS);
    let head_room = head.len().min(height.saturating_sub(foot_room + 1 + rows));
    let left_out = head.len() - head_room;
    let room = height.saturating_sub(head_room + foot_room + 1);
    top.resize(room);
    let head = head.into_iter().enumerate();
    let stays = head.filter(|(line, _)| *line == 0 && head_room > 0 || *line > left_out);
    let mut lines: Vec<(String, Face)> = stays.map(|(_, line)| line).collect();
    if matches!(top.entry, KeyTarget::Help) {
        lines.extend(help());
        lines.truncate(height.saturating_sub(1));
    } else {
        lines.extend(body(top, width, room));
        let below = height.saturating_sub(foot_room);
        lines.truncate(below);
        lines.resize(below, (String::new(), Face::Plain));
        lines.extend(foot(top, width, height));
    }
    for (y, (text, look)) in (area.y..area.bottom()).zip(&lines) {
        let style = look.style(colour);
        buffer.set_stringn(area.x, y, cut(text.clone(), width), width, style);
        if matches!(look, Face::Reverse) {
            buffer.set_style(Rect::new(area.x, y, area.width, 1), style);
        }
    }
}

/// The page as plain text, `width` columns wide and as high as needed.
#[must_use]
pub fn page(top: &mut Top, width: u16) -> String {
    let foot = foot(top, width.into(), usize::MAX);
    let height = head(top).len() + foot.len() + 1 + top.rows().len();
    let area = Rect::new(0, 0, width, u16::try_from(height).unwrap_or(u16::MAX));
    let mut buffer = Buffer::empty(area);
    render(top, false, area, &mut buffer);
    // The last line names keys.
    let page = text(&buffer);
    let end = page.trim_end_matches('\n').rfind('\n');
    page[..end.map_or(0, |end| end + 1)].to_owned()
}

/// The text of a buffer, without blanks at the ends of its lines.
#[must_use]
pub fn text(buffer: &Buffer) -> String {
    let area = buffer.area;
    let mut text = String::new();
    for y in area.y..area.bottom() {
        let line: String = (area.x..area.right())
            .filter_map(|x| buffer.cell((x, y)))
            .map(|cell| cell.symbol())
            .collect();
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

fn clock(at: Span) -> String {
    let seconds = at.as_nanos() / 1_000_000_000;
    let (hours, minutes) = (seconds / 3_600, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

fn head(top: &Top) -> Vec<(String, Face)> {
    let reading = &top.reading;
    let mut first = format!(
        "drivebench top  rig {}  {}",
        top.heading.rig,
        clock(reading.at)
    );
    if top.is_paused() {
        first.push_str("  paused");
    }
    let mut lines = vec![(first, Face::Bold)];
    for part in 0..top.heading.parts.len().max(reading.parts.len()) {
        let what = top.heading.parts.get(part);
        lines.extend(what.map(|what| (what.clone(), Face::Plain)));
        let read = reading.parts.get(part).into_iter().flatten();
        lines.extend(read.map(|HeadLine { text, is_error }| (text.clone(), Face::of(*is_error))));
    }
    lines.push((counts(top), Face::Plain));
    lines
}

/// How many drives are in which state.
fn counts(top: &Top) -> String {
    let count = top.reading.drives.len();
    let some = top.states().filter(|(_, count)| *count > 0);
    let words: Vec<_> = some.map(|(state, n)| format!("{n} {state}")).collect();
    let drives = counted(count, top.heading.form.drive);
    format!("{drives}: {}", words.join(", "))
}

fn body(top: &Top, width: usize, room: usize) -> Vec<(String, Face)> {
    let rows = top.rows();
    let form = top.heading.form;
    // The last column takes what is left.
    let but_the_last = form.columns.len().saturating_sub(1);
    let widths: Vec<usize> = form.columns[..but_the_last]
        .iter()
        .enumerate()
        .map(|(place, column)| {
            let of_rows = rows.iter().map(|row| cell(row, place).chars().count());
            of_rows.max().unwrap_or(0).max(column.width)
        })
        .collect();
    let shown = shown_columns(form, &widths, width);
    let line = |cells: &[&str]| {
        let padded = shown.iter().map(|place| {
            let (cell, width) = (cells[*place], widths.get(*place).copied().unwrap_or(0));
            match form.columns[*place].has_words {
                true => format!("{cell:width$}"),
                false => format!("{cell:>width$}"),
            }
        });
        padded.collect::<Vec<_>>().join("  ")
    };
    let mut heading = line(&form.heads());
    let length = heading.chars().count();
    heading.extend(std::iter::repeat_n(' ', width.saturating_sub(length)));
    let mut lines = vec![(heading, Face::Reverse)];
    let shown = rows.iter().skip(top.first).take(room);
    lines.extend(shown.map(|row| {
        let cells: Vec<_> = (0..form.columns.len())
            .map(|place| cell(row, place))
            .collect();
        let text = line(&cells);
        (cut(text, width), Face::of(row.in_error))
    }));
    if rows.is_empty() {
        let drive = form.drive;
        let why = match (top.reading.drives.is_empty(), top.only_errors, &top.filter) {
            (true, ..) => format!("no {drive} has been read yet"),
            (false, true, filter) if filter.is_empty() => format!("no {drive} is in error"),
            (false, true, filter) => format!("no {drive} in error has `{filter}` in its row"),
            (false, false, filter) => format!("no {drive} has `{filter}` in its row"),
        };
        lines.push((why, Face::Plain));
    }
    lines
}

/// What a row has in a column.
fn cell(row: &TopRow, column: usize) -> &str {
    row.cells.get(column).map_or("", String::as_str)
}

/// The columns that a terminal has room for: all that leave enough for the last one.
fn shown_columns(form: &TopForm, widths: &[usize], width: usize) -> Vec<usize> {
    let mut shown: Vec<usize> = (0..form.columns.len()).collect();
    for gone in form.give_way {
        let before = shown.iter().filter_map(|column| widths.get(*column));
        if before.map(|column| column + 2).sum::<usize>() + LAST_WIDTH > width {
            shown.retain(|column| column != gone);
        }
    }
    shown
}

/// What does not fit ends with three dots.
fn cut(text: String, width: usize) -> String {
    if text.chars().count() <= width {
        return text;
    }
    let kept: String = text.chars().take(width.saturating_sub(3)).collect();
    kept + "..."
}

fn foot(top: &Top, width: usize, height: usize) -> Vec<(String, Face)> {
    let mut all: Vec<_> = top.events().collect();
    let room = EVENTS.min(height / LINES_EACH);
    // The latest first.
    all.sort_by_key(|event| std::cmp::Reverse(event.last));
    let mut lines: Vec<(String, Face)> = all
        .iter()
        .take(room)
        .map(|event| {
            let times = match event.count {
                1 => String::new(),
                n => format!(" {n} times, last"),
            };
            let text = format!("{}{times} at {}", event.what, clock(event.last));
            // How often comes first where not all of it can be read.
            let text = match event.count {
                2.. if text.chars().count() > width => {
                    format!("{} times: {}", event.count, event.what)
                }
                _ => text,
            };
            (text, Face::of(event.is_error))
        })
        .collect();
    let hidden = all.iter().skip(room).map(|event| event.count).sum::<u64>() + top.reading.others;
    if hidden > 0 {
        lines.push((format!("and {hidden} other messages"), Face::Error));
    }
    lines.push((status_line(top, width), Face::Reverse));
    lines
}

fn status_line(top: &Top, width: usize) -> String {
    if matches!(top.entry, KeyTarget::Filter) {
        return format!("filter: {}_  Enter keeps it, Esc takes it away", top.filter);
    }
    if matches!(top.entry, KeyTarget::Stop) {
        let drive = top.heading.form.drive;
        let enter = match top.stop_order() {
            Some(Press::Stop(Some(_))) => format!("Enter stops this {drive}"),
            Some(_) => format!("Enter stops all {drive}s"),
            None => format!("no {drive} has this name"),
        };
        return format!("stop {drive}: {}_  {enter}, Esc goes back", top.to_stop);
    }
    let rows = top.rows().len();
    let last = (top.first + top.page).min(rows);
    let first = (top.first + 1).min(rows);
    let mut text = format!("{first}-{last} of {rows}, by {}", top.sort.name());
    if top.only_errors {
        text.push_str(", errors only");
    }
    if !top.filter.is_empty() {
        let _infallible = write!(text, ", with `{}`", top.filter);
    }
    let keys = match text.len() + KEYS.len() <= width {
        true => KEYS,
        false => FEW_KEYS,
    };
    text + keys
}

fn help() -> Vec<(String, Face)> {
    let mut lines = vec![(String::new(), Face::Plain)];
    for (keys, what) in HELP {
        lines.push((format!("  {keys:20}  {what}"), Face::Plain));
    }
    lines
}
