//! The page: a pure function of the view's state and of the size of the terminal.

use super::keys::HELP;
use crate::counted::counted;
use crate::top::{KeyTarget, RingReading, Top, TopRow};
use harness_proto::time::Span;
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::{Modifier, Style};
use ratatui_core::terminal::Frame;
use std::fmt::Write as _;

/// Headings of the columns; the units are those of the drive's cells (ND21 14.5).
pub(crate) const COLUMNS: [&str; 7] = [
    "drive",
    "state",
    "shows",
    "speed rpm",
    "pos. turns",
    "Aeff",
    "error, status",
];
/// The least widths of the columns, but for the last, which takes what is left.
const WIDTHS: [usize; 6] = [5, 5, 5, 9, 10, 6];
/// Columns that give way in a narrow terminal, in this order, and how much of the last column they leave.
const GIVE_WAY: [usize; 4] = [5, 4, 3, 2];
const LAST_WIDTH: usize = 16;
/// The column in which what is left begins with words and not with numbers.
const WORDS: [usize; 2] = [1, 6];
/// Lines of disturbances at most, and how many lines a terminal has for each.
const DISTURBANCES: usize = 4;
const LINES_EACH: usize = 5;
/// Rows of drives that the head makes room for.
const LEAST_ROWS: usize = 4;

/// The keys in the last line, and what stands there where they have no room.
const KEYS: &str = "  q quit  / filter  e errors  s sort  p pause  ? help";
const FEW_KEYS: &str = "  q quit  ? help";

/// What a line looks like.
#[derive(Clone, Copy)]
enum Look {
    Plain,
    Bold,
    Reverse,
    Error,
}

impl Look {
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
    let mut lines: Vec<(String, Look)> = stays.map(|(_, line)| line).collect();
    if matches!(top.entry, KeyTarget::Help) {
        lines.extend(help());
        lines.truncate(height.saturating_sub(1));
    } else {
        lines.extend(body(top, width, room));
        let below = height.saturating_sub(foot_room);
        lines.truncate(below);
        lines.resize(below, (String::new(), Look::Plain));
        lines.extend(foot(top, width, height));
    }
    for (y, (text, look)) in (area.y..area.bottom()).zip(&lines) {
        let style = look.style(colour);
        buffer.set_stringn(area.x, y, cut(text.clone(), width), width, style);
        if matches!(look, Look::Reverse) {
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

/// What stands in a buffer, without blanks at the end of its lines.
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

fn head(top: &Top) -> Vec<(String, Look)> {
    let reading = &top.reading;
    let mut first = format!(
        "drivebench top  rig {}  {}",
        top.heading.rig,
        clock(reading.at)
    );
    if top.is_paused() {
        first.push_str("  paused");
    }
    let mut lines = vec![(first, Look::Bold)];
    for (number, what) in (1..).zip(&top.heading.rings) {
        lines.push((format!("ring {number}: {what}"), Look::Plain));
        if let Some(ring) = reading.rings.get(number - 1) {
            lines.push((traffic(ring), Look::Plain));
            lines.push(errors(ring));
        }
    }
    if reading.unplaced > 0 {
        let unplaced = reading.unplaced;
        let text = format!("  {unplaced} line errors told of without their bytes");
        lines.push((text, Look::Error));
    }
    lines.push((counts(top), Look::Plain));
    lines
}

fn traffic(ring: &RingReading) -> String {
    format!(
        "  {} bytes/s, {} telegrams/s, {} commands/s; the line is {}.{} % busy",
        ring.bytes,
        ring.telegrams,
        ring.jobs,
        ring.share / 10,
        ring.share % 10
    )
}

fn errors(ring: &RingReading) -> (String, Look) {
    let own = &ring.counters;
    let text = format!(
        "  line errors {}, disturbed {}, corrected {}, commands repeated {}",
        own.line_errors, own.disturbed, own.corrected, own.repeated
    );
    let sound = own.line_errors == 0 && own.disturbed == 0;
    (text, if sound { Look::Plain } else { Look::Error })
}

/// How many drives are in which mode.
fn counts(top: &Top) -> String {
    let count = top.reading.drives.len();
    let mut text = format!("{}:", counted(count, "drive"));
    let modes = top.modes();
    let some = modes.iter().filter(|(_, count)| *count > 0);
    let words: Vec<_> = some.map(|(mode, n)| format!("{n} {mode}")).collect();
    let _infallible = write!(text, " {}", words.join(", "));
    text
}

fn body(top: &Top, width: usize, room: usize) -> Vec<(String, Look)> {
    let rows = top.rows();
    let widths: Vec<usize> = WIDTHS
        .iter()
        .enumerate()
        .map(|(column, least)| {
            let of_rows = rows.iter().map(|row| row.cells[column].chars().count());
            of_rows.max().unwrap_or(0).max(*least)
        })
        .collect();
    let shown = shown_columns(&widths, width);
    let line = |cells: [&str; 7]| {
        let padded = shown.iter().map(|column| {
            let (cell, width) = (cells[*column], widths.get(*column).copied().unwrap_or(0));
            match WORDS.contains(column) {
                true => format!("{cell:width$}"),
                false => format!("{cell:>width$}"),
            }
        });
        padded.collect::<Vec<_>>().join("  ")
    };
    let mut heading = line(COLUMNS);
    let length = heading.chars().count();
    heading.extend(std::iter::repeat_n(' ', width.saturating_sub(length)));
    let mut lines = vec![(heading, Look::Reverse)];
    let shown = rows.iter().skip(top.first).take(room);
    lines.extend(shown.map(|row| {
        let text = line(std::array::from_fn(|column| row.cells[column].as_str()));
        (cut(text, width), look(row))
    }));
    if rows.is_empty() {
        let why = match (top.reading.drives.is_empty(), top.only_errors, &top.filter) {
            (true, ..) => "no drive has been read yet".to_owned(),
            (false, true, filter) if filter.is_empty() => "no drive is in error".to_owned(),
            (false, true, filter) => format!("no drive in error has `{filter}` in its row"),
            (false, false, filter) => format!("no drive has `{filter}` in its row"),
        };
        lines.push((why, Look::Plain));
    }
    lines
}

/// The columns that a terminal has room for: all that leave enough for the error.
fn shown_columns(widths: &[usize], width: usize) -> Vec<usize> {
    let mut shown: Vec<usize> = (0..COLUMNS.len()).collect();
    for gone in GIVE_WAY {
        let before = shown.iter().filter_map(|column| widths.get(*column));
        if before.map(|own| own + 2).sum::<usize>() + LAST_WIDTH > width {
            shown.retain(|column| *column != gone);
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

fn look(row: &TopRow) -> Look {
    if row.in_error {
        Look::Error
    } else {
        Look::Plain
    }
}

fn foot(top: &Top, width: usize, height: usize) -> Vec<(String, Look)> {
    let several = top.heading.rings.len() > 1;
    let mut all: Vec<_> = top.disturbances().collect();
    let room = DISTURBANCES.min(height / LINES_EACH);
    // The latest first.
    all.sort_by_key(|one| std::cmp::Reverse(one.last));
    let mut lines: Vec<(String, Look)> = all
        .iter()
        .take(room)
        .map(|one| {
            let ring = match several {
                true => format!("ring {}: ", one.ring + 1),
                false => String::new(),
            };
            let times = match one.count {
                1 => String::new(),
                n => format!(" {n} times, last"),
            };
            let text = format!("{ring}{}{times} at {}", one.what, clock(one.last));
            // How often comes first where not all of it can be read.
            let text = match text.chars().count() <= width {
                true => text,
                false => format!("{ring}{} times: {}", one.count, one.what),
            };
            (text, Look::Error)
        })
        .collect();
    let hidden = all.iter().skip(room).map(|one| one.count).sum::<u64>() + top.reading.others;
    if hidden > 0 {
        lines.push((format!("and {hidden} other disturbances"), Look::Error));
    }
    lines.push((status_line(top, width), Look::Reverse));
    lines
}

fn status_line(top: &Top, width: usize) -> String {
    if matches!(top.entry, KeyTarget::Filter) {
        return format!("filter: {}_  Enter keeps it, Esc takes it away", top.filter);
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

fn help() -> Vec<(String, Look)> {
    let mut lines = vec![(String::new(), Look::Plain)];
    for (keys, what) in HELP {
        lines.push((format!("  {keys:20}  {what}"), Look::Plain));
    }
    lines
}
