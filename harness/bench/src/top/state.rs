//! The known state of a bench, and the user's view of it.

use super::reading::{Heading, Snapshot, TopEvent, TopRow};
use harness_proto::time::Span;

/// The order of drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sort {
    /// By their places on the bench.
    #[default]
    Drive,
    /// The most serious state first.
    State,
    /// The fastest first.
    Speed,
    /// By their error codes, those without one last.
    Error,
}

impl Sort {
    /// The name on the page.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::State => "state",
            Self::Speed => "speed",
            Self::Error => "error",
        }
    }

    /// The order after this one.
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
pub enum KeyTarget {
    #[default]
    None,
    /// The text to filter by.
    Filter,
    /// The name of a drive that is to be stopped.
    Stop,
    Help,
}

/// The state of the view.
#[derive(Clone, Debug, PartialEq)]
pub struct Top {
    pub heading: Heading,
    pub reading: Snapshot,
    /// The latest reading while the page is paused.
    paused: Option<Snapshot>,
    /// Events up to this time are not shown.
    forgotten: Option<Span>,
    pub filter: String,
    pub to_stop: String,
    pub only_errors: bool,
    pub sort: Sort,
    pub entry: KeyTarget,
    /// The first row in sight.
    pub first: usize,
    /// How many rows the page has room for.
    pub page: usize,
}

impl Top {
    /// A view of a bench before the first reading.
    #[must_use]
    pub fn new(heading: Heading) -> Self {
        Self {
            heading,
            reading: Snapshot::default(),
            paused: None,
            forgotten: None,
            filter: String::new(),
            to_stop: String::new(),
            only_errors: false,
            sort: Sort::default(),
            entry: KeyTarget::default(),
            first: 0,
            page: 0,
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

    pub fn pause(&mut self) {
        match self.is_paused() {
            true => self.resume(),
            false => self.paused = Some(self.reading.clone()),
        }
    }

    pub fn resume(&mut self) {
        if let Some(later) = self.paused.take() {
            self.reading = later;
        }
        self.keep_in_sight();
    }

    pub(crate) const fn forget_events(&mut self) {
        self.forgotten = Some(self.reading.at);
    }

    /// What happened since it was last told to forget.
    pub fn events(&self) -> impl Iterator<Item = &TopEvent> {
        let forgotten = self.forgotten;
        let all = self.reading.events.iter();
        all.filter(move |event| forgotten.is_none_or(|until| event.last > until))
    }

    pub(crate) fn keep_in_sight(&mut self) {
        let rows = self.rows().len();
        self.first = self.first.min(rows.saturating_sub(self.page.max(1)));
    }

    /// The drives that are wanted, in the order that is wanted.
    #[must_use]
    pub fn rows(&self) -> Vec<&TopRow> {
        let wanted = self.filter.to_lowercase();
        let drives = self.reading.drives.values();
        let mut rows: Vec<_> = drives
            .filter(|row| !self.only_errors || row.in_error)
            .filter(|row| row.cells.join(" ").to_lowercase().contains(&wanted))
            .collect();
        // A stable order: drives that are alike stand by their places.
        match self.sort {
            Sort::Drive => {}
            Sort::State => rows.sort_by_key(|row| row.state),
            Sort::Speed => rows.sort_by(|a, b| {
                let speed = |row: &TopRow| row.speed.map_or(-1.0, f64::abs);
                speed(b).total_cmp(&speed(a))
            }),
            Sort::Error => rows.sort_by_key(|row| row.error.unwrap_or(u32::MAX)),
        }
        rows
    }

    /// How many drives are in each state, the least serious state first.
    pub(crate) fn states(&self) -> impl Iterator<Item = (&'static str, usize)> {
        let states = self.heading.form.states.iter().enumerate().rev();
        states.map(|(state, name)| {
            let drives = self.reading.drives.values();
            (*name, drives.filter(|row| row.state == state).count())
        })
    }
}
