//! `top --web`: the page of a bench in use. It only looks on.

use super::failure::Failure;
use crate::buses::commands::TopArguments;
use crate::web::{LiveNews, LivePage, LivePicture, LiveScene, MAX_ROWS};
use std::time::{Duration, Instant};

/// Why it takes no orders.
const READ_ONLY: &str = "This page only looks on: `top` reads drives, and a page injects faults on simulated benches only. `drivebench sim --web` \
                         serves one.";

/// How often a page gets news at most.
const EVERY: Duration = Duration::from_millis(250);

/// The page of a bench in use.
pub(crate) struct TopPage {
    page: LivePage,
    opened: Instant,
    /// When the last news went out.
    last: Option<Instant>,
}

impl TopPage {
    /// Serves the page that `--web` asks for, if it does. Its tables have these heads.
    ///
    /// # Errors
    /// [`Failure`]: the address is not free, or other machines could reach it.
    pub(crate) fn open(
        arguments: &TopArguments,
        title: String,
        (stations, traffic): (&[&'static str], &[&'static str]),
        picture: LivePicture,
    ) -> Result<Option<Self>, Failure> {
        let Some(place) = &arguments.web else {
            return Ok(None);
        };
        let scene = LiveScene {
            title,
            stations: stations.to_vec(),
            traffic: traffic.to_vec(),
            picture: Some(picture),
            read_only: Some(READ_ONLY.to_owned()),
            ..LiveScene::default()
        };
        let page = LivePage::open(place, arguments.allow_remote, &scene);
        Ok(Some(Self {
            page: page.map_err(|error| Failure::refused(error.to_string()))?,
            opened: Instant::now(),
            last: None,
        }))
    }

    /// The line of standard output that says where it is.
    pub(crate) fn line(&self) -> String {
        format!("page at {}\n", self.page.url())
    }

    /// Whether a page is open: drives are read only then.
    pub(crate) fn is_wanted(&mut self) -> bool {
        let wanted = self.page.feed().is_wanted();
        if !wanted && self.last.take().is_some() {
            self.page.feed().clear();
        }
        wanted
    }

    /// Whether nothing has been shown since a page was opened.
    pub(crate) const fn just_opened(&self) -> bool {
        self.last.is_none()
    }

    /// Whether news are due.
    pub(crate) fn is_due(&self) -> bool {
        self.last.is_none_or(|last| last.elapsed() >= EVERY)
    }

    /// Shows what was read, and the newest rows of the picture.
    pub(crate) fn show(&mut self, mut news: LiveNews) {
        self.last = Some(Instant::now());
        let hidden = news.rows.len().saturating_sub(MAX_ROWS);
        news.rows.drain(..hidden);
        news.left_out += hidden as u64;
        let at = format!("{:.1} s", self.opened.elapsed().as_secs_f64());
        let text = serde_json::to_string(&LiveNews { at, ..news });
        self.page.feed().publish(text.unwrap_or_default());
    }
}
