//! What the page of `top --web` shows of rings.

use crate::cli::top_page::TopPage;
use crate::top::{Disturbance, Heading, Snapshot, Top, TopRow};
use crate::web::LiveNews;

/// Heads of the table of traffic.
pub(super) const TRAFFIC: [&str; 7] = [
    "ring",
    "bytes/s",
    "telegrams/s",
    "commands/s",
    "not SYNCO %",
    "bytes",
    "commands",
];

/// The page of rings, and what it has shown.
pub(super) struct RingPage {
    pub(super) page: TopPage,
    top: Top,
    /// The disturbances that it has told, with how often each had been then.
    told: Vec<Disturbance>,
}

impl RingPage {
    /// The page of rings.
    pub(super) fn new(page: TopPage, heading: Heading) -> Self {
        Self {
            page,
            top: Top::new(heading),
            told: Vec::new(),
        }
    }

    /// Shows what was read.
    pub(super) fn show(&mut self, reading: Snapshot) {
        if !self.page.is_due() {
            return;
        }
        let notes = self.notes(&reading);
        self.top.take(reading);
        let rows = self.top.rows().into_iter();
        self.page.show(LiveNews {
            stations: rows.map(|TopRow { cells, .. }| cells.to_vec()).collect(),
            traffic: self.traffic(),
            notes,
            ..LiveNews::default()
        });
    }

    fn traffic(&self) -> Vec<Vec<String>> {
        let rings = self.top.reading.rings.iter().zip(1..);
        let row = |(ring, number): (&crate::top::RingReading, usize)| {
            vec![
                format!("ring {number}"),
                ring.bytes.to_string(),
                ring.telegrams.to_string(),
                ring.jobs.to_string(),
                format!("{}.{}", ring.share / 10, ring.share % 10),
                ring.counters.sent.to_string(),
                ring.counters.done.to_string(),
            ]
        };
        rings.map(row).collect()
    }

    /// The disturbances that are new, or have come again.
    fn notes(&mut self, reading: &Snapshot) -> Vec<String> {
        let known = |own: &&Disturbance| !self.told.contains(own);
        let news = reading.disturbances.iter().filter(known);
        let note = |own: &Disturbance| {
            let times = if own.count == 1 { "time" } else { "times" };
            format!(
                "ring {}: {}, {} {times} so far",
                own.ring + 1,
                own.what,
                own.count
            )
        };
        let notes = news.map(note).collect();
        self.told.clone_from(&reading.disturbances);
        notes
    }
}
