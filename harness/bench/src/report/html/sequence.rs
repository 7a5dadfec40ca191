//! A sequence diagram of a shared line: time goes down, a line for the master and one for each drive, an arrow a frame or telegram.

use crate::counted::counted;
use crate::html::Html;
use harness_proto::time::Instant;

/// Arrows drawn at most.
const DRAWN: usize = 300;
const COLUMN: usize = 110;
const ROW: usize = 22;
const TOP: usize = 34;

#[derive(Clone, Debug)]
pub struct Arrow {
    /// When it arrived.
    pub at: Instant,
    /// The drive that sent it; `None` for the master.
    pub from: Option<u8>,
    /// The drive that the master sends it to; `None` for all, or where that is not known.
    pub to: Option<u8>,
    /// Whether it arrived undamaged.
    pub good: bool,
    pub words: String,
}

/// The words of a bus, and the room that it needs.
#[derive(Clone, Copy, Debug)]
pub struct SequenceWords {
    /// What a drive is called: `drive`, `slave`.
    pub drive: &'static str,
    /// What the arrows are: `frames`, `telegrams`.
    pub carried: &'static str,
    /// Room for what they mean, in units of the picture.
    pub room: usize,
}

/// Writes the picture; false where there is nothing to draw. Only arrows that are drawn are taken.
pub fn sequence(
    html: &mut Html,
    id: &str,
    title: &str,
    drives: &[u8],
    arrows: impl ExactSizeIterator<Item = Arrow>,
    words: SequenceWords,
) -> bool {
    let all = arrows.len();
    if all == 0 {
        return false;
    }
    let drawn = all.min(DRAWN);
    let width = (drives.len() + 2) * COLUMN + words.room;
    let height = TOP + (drawn + 1) * ROW;
    let description = format!(
        "{drawn} arrows between the master and {}, one below the other. The table of {} says the same.",
        counted(drives.len() as u64, words.drive),
        words.carried,
    );
    html.scroll(title, |html| {
        html.picture(
            &format!("{id}-s"),
            (width, height),
            &title,
            &description,
            |html| {
                lifelines(html, drives, words.drive, height);
                for (row, arrow) in arrows.take(drawn).enumerate() {
                    draw(html, &arrow, TOP + (row + 1) * ROW, drives);
                }
            },
        );
    });
    if drawn < all {
        html.line(
            "p",
            &[("class", &"note")],
            format_args!("{} more are not drawn.", all - drawn),
        );
    }
    true
}

/// The horizontal position of the line of a drive; the line of the master precedes them.
fn place(drives: &[u8], drive: Option<u8>) -> usize {
    let place = drive.and_then(|drive| drives.iter().position(|known| *known == drive));
    COLUMN * place.map_or(1, |place| place + 2)
}

fn lifelines(html: &mut Html, drives: &[u8], name: &str, height: usize) {
    let all = std::iter::once(None).chain(drives.iter().copied().map(Some));
    for drive in all {
        let x = place(drives, drive);
        html.line(
            "text",
            &[("class", &"m"), ("x", &x), ("y", &(TOP - 12))],
            drive.map_or("master".to_owned(), |drive| format!("{name} {drive}")),
        );
        let line = format!("M{x} {}V{height}", TOP - 4);
        html.shape("path", &[("class", &"zero"), ("d", &line)]);
    }
}

fn draw(html: &mut Html, arrow: &Arrow, y: usize, drives: &[u8]) {
    let last = COLUMN * (drives.len() + 1);
    let start = place(drives, arrow.from);
    let end = match (arrow.from, arrow.to) {
        (Some(_), _) => COLUMN,
        (None, Some(drive)) if drives.contains(&drive) => place(drives, Some(drive)),
        (None, _) => last,
    };
    let back = if end < start { 7 } else { -7 };
    let (class, head) = match arrow.good {
        true => ("arrow", format!("M{end} {y}l{back} -4v8z")),
        false => ("x", String::new()),
    };
    let line = format!("M{start} {y}H{end}{head}");
    html.shape("path", &[("class", &class), ("d", &line)]);
    let text = |html: &mut Html, class: &str, x: usize, text: &str| {
        html.line(
            "text",
            &[("class", &class), ("x", &x), ("y", &(y + 4))],
            text,
        );
    };
    text(html, "e", COLUMN - 14, &arrow.at.to_string());
    text(html, "s", last + 14, &arrow.words);
}
