//! `top --web`: the page of a bench in use. It only looks on.

use crate::cli::failure::Failure;
use crate::top::view::COLUMNS;
use crate::top::{Disturbance, Heading, Snapshot, Top, TopRow};
use crate::web::{LiveNews, LivePage, LiveScene};
use harness_proto::time::Span;

/// Why it takes no orders.
const READ_ONLY: &str = "This page only looks on: `top` reads drives, and a page injects faults on simulated benches only. `drivebench sim --web` \
                         serves one.";

/// How often a page gets news at most.
const EVERY: Span = Span::from_millis(250);

/// The page, and what it has shown.
pub(super) struct TopPage {
    page: LivePage,
    top: Top,
    /// When the last news went out.
    last: Option<Span>,
    /// How often each disturbance had been when it was told.
    told: Vec<Disturbance>,
}

impl TopPage {
    /// Serves the page.
    ///
    /// # Errors
    /// [`Failure`]: the address is not free, or other machines could reach it.
    pub(super) fn open(place: &str, allow_remote: bool, heading: Heading) -> Result<Self, Failure> {
        let scene = LiveScene {
            title: format!("{}: {}", heading.rig, heading.rings.join("; ")),
            stations: COLUMNS.to_vec(),
            traffic: vec![
                "ring",
                "bytes/s",
                "telegrams/s",
                "commands/s",
                "not SYNCO %",
                "bytes",
                "commands",
            ],
            read_only: Some(READ_ONLY.to_owned()),
            ..LiveScene::default()
        };
        let page = LivePage::open(place, allow_remote, &scene);
        Ok(Self {
            page: page.map_err(|error| Failure::refused(error.to_string()))?,
            top: Top::new(heading),
            last: None,
            told: Vec::new(),
        })
    }

    /// Where it is, with its token.
    pub(super) fn url(&self) -> String {
        self.page.url()
    }

    /// Whether a page is open.
    pub(super) fn is_wanted(&mut self) -> bool {
        let wanted = self.page.feed().is_wanted();
        if !wanted && self.last.take().is_some() {
            self.page.feed().clear();
        }
        wanted
    }

    /// Shows what was read.
    pub(super) fn show(&mut self, reading: Snapshot) {
        let at = reading.at;
        if self.last.is_some_and(|last| at < last + EVERY) {
            return;
        }
        self.last = Some(at);
        let notes = self.notes(&reading);
        self.top.take(reading);
        let rows = self.top.rows();
        let news = LiveNews {
            at: format!("{} s", at.as_nanos() / 1_000_000_000),
            stations: rows
                .into_iter()
                .map(|TopRow { cells, .. }| cells.to_vec())
                .collect(),
            traffic: self.traffic(),
            notes,
            ..LiveNews::default()
        };
        let text = serde_json::to_string(&news).unwrap_or_default();
        self.page.feed().publish(text);
    }

    fn traffic(&self) -> Vec<Vec<String>> {
        let rings = self.top.reading.rings.iter().zip(1..);
        rings
            .map(|(ring, number)| {
                let share = format!("{}.{}", ring.share / 10, ring.share % 10);
                vec![
                    format!("ring {number}"),
                    ring.bytes.to_string(),
                    ring.telegrams.to_string(),
                    ring.jobs.to_string(),
                    share,
                    ring.counters.sent.to_string(),
                    ring.counters.done.to_string(),
                ]
            })
            .collect()
    }

    /// The disturbances that are new, or have come again.
    fn notes(&mut self, reading: &Snapshot) -> Vec<String> {
        let known = |own: &&Disturbance| !self.told.contains(own);
        let news: Vec<_> = reading.disturbances.iter().filter(known).collect();
        let notes = news.iter().map(|own| {
            format!(
                "ring {}: {}, {} times so far",
                own.ring + 1,
                own.what,
                own.count
            )
        });
        let notes = notes.collect();
        self.told.clone_from(&reading.disturbances);
        notes
    }
}
