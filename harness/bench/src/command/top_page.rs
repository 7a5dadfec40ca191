//! `top --web`: the page of a bench in use. It only looks on.

use super::failure::Failure;
use super::top::{TopOrder, TopReader, TopScene, TopView};
use crate::top::{Heading, Snapshot, Top, TopEvent};
use crate::web::{LiveNews, LivePage, LiveScene, MAX_ROWS};
use std::time::{Duration, Instant};

/// Why it takes no orders.
const READ_ONLY: &str = "This page only looks on: `top` reads drives, and a page injects faults on simulated benches only. `drivebench sim --web` \
                         serves one.";

/// How often a page gets news at most.
const EVERY: Duration = Duration::from_millis(250);

/// The page of a bench in use.
pub(crate) struct TopPage {
    page: LivePage,
    top: Top,
    opened: Instant,
    /// When the last news went out.
    last: Option<Instant>,
    /// The events that it has told, with how often each had happened then.
    told: Vec<TopEvent>,
}

impl TopPage {
    /// Serves a page at a place, for other machines too if that is permitted.
    ///
    /// # Errors
    /// [`Failure`]: the address is not free, or other machines could reach it.
    pub(crate) fn open(
        place: &str,
        allow_remote: bool,
        heading: Heading,
        scene: TopScene,
    ) -> Result<Self, Failure> {
        let scene = LiveScene {
            title: scene.title,
            stations: heading.form.heads(),
            traffic: scene.traffic.to_vec(),
            picture: Some(scene.picture),
            read_only: Some(READ_ONLY.to_owned()),
            ..LiveScene::default()
        };
        let page = LivePage::open(place, allow_remote, &scene);
        Ok(Self {
            page: page.map_err(|error| Failure::refused(error.to_string()))?,
            top: Top::new(heading),
            opened: Instant::now(),
            last: None,
            told: Vec::new(),
        })
    }

    /// The line of standard output that says where it is.
    pub(crate) fn line(&self) -> String {
        format!("page at {}\n", self.page.url())
    }

    /// The events that are new, or have happened again.
    fn notes(&mut self, reading: &Snapshot) -> Vec<String> {
        let events = reading.events.iter();
        let news = events.filter(|event| !self.told.contains(event));
        let note = |event: &TopEvent| {
            let times = if event.count == 1 { "time" } else { "times" };
            format!("{}, {} {times} so far", event.what, event.count)
        };
        let notes = news.map(note).collect();
        self.told.clone_from(&reading.events);
        notes
    }
}

impl TopView for TopPage {
    /// Drives are read, and what the bus carries is recorded, only while a page is open.
    fn is_wanted(&mut self, reader: &mut dyn TopReader) -> bool {
        let wanted = self.page.feed().is_wanted();
        if !wanted {
            reader.record(false);
            if self.last.take().is_some() {
                self.page.feed().clear();
            }
        }
        wanted
    }

    fn show(&mut self, reader: &mut dyn TopReader, reading: &Snapshot) {
        if self.last.is_some_and(|last| last.elapsed() < EVERY) {
            return;
        }
        if self.last.is_none() {
            // What was recorded is from before the page was opened.
            reader.record(true);
        }
        self.last = Some(Instant::now());
        let mut news = reader.heard();
        let mut notes = self.notes(reading);
        notes.append(&mut news.notes);
        self.top.take(reading.clone());
        let hidden = news.rows.len().saturating_sub(MAX_ROWS);
        news.rows.drain(..hidden);
        let rows = self.top.rows().into_iter();
        let news = LiveNews {
            at: format!("{:.1} s", self.opened.elapsed().as_secs_f64()),
            stations: rows.map(|row| row.cells.clone()).collect(),
            left_out: news.left_out + hidden as u64,
            notes,
            ..news
        };
        let text = serde_json::to_string(&news);
        self.page.feed().publish(text.unwrap_or_default());
    }

    fn wait(&mut self, time: Duration) -> Option<TopOrder> {
        std::thread::sleep(time);
        None
    }
}
