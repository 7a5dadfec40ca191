//! The known state of a bench, and the user's view of it.

use crate::buses::novobus::driver::{Axis, State};
use harness_proto::nd21::bits::set_in;
use harness_proto::nd21::errors::display_digits;
use harness_proto::nd21::ram;
use harness_proto::novobus::master::Counters;
use harness_proto::time::Span;

/// Maximum number of kinds of disturbances listed; further kinds are only counted.
const MOST_KINDS: usize = 64;

/// The heading of the page, which does not change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Heading {
    /// The bench's name.
    pub rig: String,
    /// Of each ring what it is: `3 drives at /dev/ttyUSB0, 38400 8O1`.
    pub rings: Vec<String>,
}

/// What a drive showed last.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveReading {
    /// Which.
    pub axis: Axis,
    /// Its mode and error (ND21 11.8, 14.4).
    pub state: State,
    /// `nist` in rpm (14.5.3.1).
    pub speed: Option<f64>,
    /// `umdrist` and `lageist` in turns (14.5.5).
    pub position: Option<f64>,
    /// `msoll` in Aeff (14.5.2).
    pub torque: Option<f64>,
}

/// What a ring carried since the reading began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RingReading {
    /// What its master has done.
    pub counters: Counters,
    /// Bytes a second.
    pub bytes: u64,
    /// Telegrams a second.
    pub telegrams: u64,
    /// Commands a second.
    pub jobs: u64,
    /// How much of what was sent was not SYNCO, in parts of a thousand.
    pub share: u64,
}

/// A disturbance of a ring, reported by its master.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Disturbance {
    /// The ring, counted from 0.
    pub ring: usize,
    /// What, with the link where it was located (9.7).
    pub what: String,
    /// How often.
    pub count: u64,
    /// When last.
    pub last: Span,
}

/// Everything that was read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// How long the view has been on.
    pub at: Span,
    /// The rings, in order.
    pub rings: Vec<RingReading>,
    /// The drives, in order; one that was not read yet is missing.
    pub drives: Vec<DriveReading>,
    /// What was disturbed, in the order of its first time.
    pub disturbances: Vec<Disturbance>,
    /// Disturbances of kinds for which there was no more room.
    pub others: u64,
    /// Line errors that the transport reported without their bytes.
    pub unplaced: u64,
}

impl RingReading {
    /// The figures between two moments.
    #[must_use]
    pub fn between(before: &Counters, now: &Counters, span: Span) -> Self {
        let nanos = u128::from(span.as_nanos().max(1));
        let rate = |before: u64, now: u64| {
            let count = u128::from(now.saturating_sub(before));
            u64::try_from((count * 1_000_000_000 + nanos / 2) / nanos).unwrap_or(u64::MAX)
        };
        let sent = now.sent.saturating_sub(before.sent);
        let idle = now.idle.saturating_sub(before.idle);
        Self {
            counters: *now,
            bytes: rate(before.sent, now.sent),
            telegrams: rate(before.telegrams, now.telegrams),
            jobs: rate(before.done, now.done),
            share: sent.saturating_sub(idle).saturating_mul(1_000) / sent.max(1),
        }
    }
}

impl Snapshot {
    /// Notes a disturbance.
    pub fn disturbed(&mut self, ring: usize, what: String) {
        let last = self.at;
        let known = self.disturbances.iter_mut();
        if let Some(known) = known
            .into_iter()
            .find(|known| known.ring == ring && known.what == what)
        {
            known.count += 1;
            known.last = last;
        } else if self.disturbances.len() < MOST_KINDS {
            self.disturbances.push(Disturbance {
                ring,
                what,
                count: 1,
                last,
            });
        } else {
            self.others += 1;
        }
    }

    /// Puts a drive's reading in the place of the one before.
    pub fn drive(&mut self, drive: DriveReading) {
        match self.drives.binary_search_by_key(&drive.axis, |d| d.axis) {
            Ok(place) => self.drives[place] = drive,
            Err(place) => self.drives.insert(place, drive),
        }
    }
}

/// In which order drives stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sort {
    /// By their numbers.
    #[default]
    Drive,
    /// Error, reset, block, stop, go.
    State,
    /// The fastest first.
    Speed,
    /// By their error codes, those without one last.
    Error,
}

impl Sort {
    /// The name on the page.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::State => "state",
            Self::Speed => "speed",
            Self::Error => "error",
        }
    }

    /// The order behind this one.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::Drive => Self::State,
            Self::State => Self::Speed,
            Self::Speed => Self::Error,
            Self::Error => Self::Drive,
        }
    }
}

/// What keys go to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum KeyTarget {
    /// The commands.
    #[default]
    None,
    /// The text to filter by.
    Filter,
    /// The help is shown.
    Help,
}

/// The words of a row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopRow {
    /// The drive.
    pub axis: Axis,
    /// Whether it is in error or shows a code.
    pub in_error: bool,
    /// Drive, state, display, speed, position, torque, error and status, as they stand in the columns.
    pub cells: [String; 7],
}

/// The state of the view.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Top {
    pub(crate) heading: Heading,
    pub(crate) reading: Snapshot,
    /// The reading shown while the page is paused.
    paused: Option<Snapshot>,
    /// Disturbances up to this time are not shown.
    forgotten: Option<Span>,
    pub(crate) filter: String,
    pub(crate) only_errors: bool,
    pub(crate) sort: Sort,
    pub(crate) entry: KeyTarget,
    /// The first row in sight.
    pub(crate) first: usize,
    /// How many rows the page has room for.
    pub(crate) page: usize,
}

impl Top {
    /// A view of a bench before the first reading.
    #[must_use]
    pub fn new(heading: Heading) -> Self {
        Self {
            heading,
            ..Self::default()
        }
    }

    /// Takes what was read.
    pub fn take(&mut self, reading: Snapshot) {
        match &mut self.paused {
            Some(later) => *later = reading,
            None => self.reading = reading,
        }
        self.keep_in_sight();
    }

    /// Whether the page is paused.
    #[must_use]
    pub const fn is_paused(&self) -> bool {
        self.paused.is_some()
    }

    /// The page is so high that it has room for this many drives.
    pub fn resize(&mut self, page: usize) {
        self.page = page;
        self.keep_in_sight();
    }

    pub(crate) fn pause(&mut self) {
        match self.paused.take() {
            Some(later) => self.reading = later,
            None => self.paused = Some(self.reading.clone()),
        }
        self.keep_in_sight();
    }

    pub(crate) fn forget_disturbances(&mut self) {
        self.forgotten = Some(self.reading.at);
    }

    /// What was disturbed since it was last told to forget.
    pub(crate) fn disturbances(&self) -> impl Iterator<Item = &Disturbance> {
        let forgotten = self.forgotten;
        let all = self.reading.disturbances.iter();
        all.filter(move |one| forgotten.is_none_or(|until| one.last > until))
    }

    pub(crate) fn keep_in_sight(&mut self) {
        let rows = self.shown().len();
        self.first = self.first.min(rows.saturating_sub(self.page.max(1)));
    }

    /// The drives that are wanted, in the order that is wanted.
    #[must_use]
    pub fn rows(&self) -> Vec<TopRow> {
        self.shown().into_iter().map(|(_, row)| row).collect()
    }

    fn shown(&self) -> Vec<(&DriveReading, TopRow)> {
        let wanted = self.filter.to_lowercase();
        let drives = self.reading.drives.iter();
        let mut rows: Vec<_> = drives
            .map(|drive| (drive, row(drive)))
            .filter(|(_, row)| !self.only_errors || row.in_error)
            .filter(|(_, row)| row.cells.join(" ").to_lowercase().contains(&wanted))
            .collect();
        // A stable order: drives that are alike stand by their numbers.
        match self.sort {
            Sort::Drive => {}
            Sort::State => rows.sort_by_key(|(drive, _)| gravity(drive.state.mode())),
            Sort::Speed => rows.sort_by(|(a, _), (b, _)| {
                let speed = |drive: &DriveReading| drive.speed.map_or(-1.0, f64::abs);
                speed(b).total_cmp(&speed(a))
            }),
            Sort::Error => rows.sort_by_key(|(drive, _)| match drive.state.error {
                0 => u16::MAX,
                code => code,
            }),
        }
        rows
    }

    /// How many drives are in each mode: go, stop, block, error, reset.
    pub(crate) fn modes(&self) -> [(&'static str, usize); 5] {
        ["go", "stop", "block", "error", "reset"].map(|mode| {
            let drives = self.reading.drives.iter();
            (mode, drives.filter(|d| d.state.mode() == mode).count())
        })
    }
}

fn gravity(mode: &str) -> u8 {
    match mode {
        "error" => 0,
        "reset" => 1,
        "block" => 2,
        "stop" => 3,
        _ => 4,
    }
}

fn row(drive: &DriveReading) -> TopRow {
    let state = &drive.state;
    let mode = state.mode();
    // The display shows the code in the error mode only (11.8).
    let digits = display_digits(state.error).filter(|_| mode == "error");
    let digit = |digit: u8| char::from_digit(digit.into(), 16).unwrap_or('-');
    let display = digits.map_or_else(
        || "-".to_owned(),
        |digits| digits.map(digit).iter().collect(),
    );
    let error = state.error_in_words();
    let bits = set_in(ram::STATUS, state.status)
        .chain(set_in(ram::FLAGS, state.flags))
        .chain(set_in(ram::FLAGS2, state.flags2));
    let sentence = |error: &String| error.trim_end_matches('.').to_owned();
    let mut words: Vec<String> = error.iter().map(sentence).collect();
    for name in bits.filter(|name| *name != mode && !EVERYDAY.contains(name)) {
        if !words.iter().any(|word| word == name) {
            words.push(name.to_owned());
        }
    }
    if words.is_empty() {
        words.push("-".to_owned());
    }
    TopRow {
        axis: drive.axis,
        in_error: mode == "error" || error.is_some(),
        cells: [
            drive.axis.to_string(),
            mode.to_owned(),
            display,
            number(drive.speed, 1),
            number(drive.position, 3),
            number(drive.torque, 2),
            words.join("; "),
        ],
    }
}

/// Formats a number with this number of decimals; zero has no sign.
fn number(value: Option<f64>, decimals: usize) -> String {
    let Some(value) = value else {
        return "-".to_owned();
    };
    let text = format!("{value:.decimals$}");
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    match text.strip_prefix('-').filter(|_| is_zero) {
        Some(zero) => zero.to_owned(),
        None => text,
    }
}

/// Bits of a drive that is as it should be.
const EVERYDAY: [&str; 2] = ["NOVOBUS OK", "resolver switch"];
