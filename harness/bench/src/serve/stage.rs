//! The live page beside a served bus: orders in, news out.

use crate::listen::ListenError;
use crate::web::{LiveNews, LivePage, LiveView};
use harness_proto::time::{Instant, Span};
use rustix::event::PollFd;

/// How often a page that is open gets news.
const EVERY: Span = Span::from_millis(100);

/// A page, and what it has shown.
pub(super) struct Stage {
    page: LivePage,
    recording: bool,
    /// When the next news are due, by the clock.
    next: Instant,
    /// The last news: tables that have not changed are not sent again.
    last: LiveNews,
    /// How many readers have had the whole tables.
    served: u64,
}

impl Stage {
    /// Serves the page of a bus.
    ///
    /// # Errors
    /// [`ListenError`].
    pub(super) fn open(
        place: &str,
        allow_remote: bool,
        bus: &mut dyn LiveView,
    ) -> Result<Self, ListenError> {
        Ok(Self {
            page: LivePage::open(place, allow_remote, &bus.scene())?,
            recording: false,
            next: Instant::START,
            last: LiveNews::default(),
            served: 0,
        })
    }

    /// Where it is, for a line of standard output.
    pub(super) fn line(&self) -> String {
        format!("page at {}", self.page.url())
    }

    /// What to wait for.
    pub(super) fn poll(&self) -> PollFd<'_> {
        self.page.poll()
    }

    /// When [`Self::work`] is to be called again if nothing comes before. While no page is open, that is never.
    pub(super) const fn deadline(&self) -> Instant {
        match self.recording {
            true => self.next,
            false => Instant::NEVER,
        }
    }

    /// Does the orders of pages, and gives them news that are due by the clock's time `now`.
    pub(super) fn work(&mut self, bus: &mut dyn LiveView, now: Instant) {
        for asked in self.page.orders() {
            let answer = bus.order(asked.order);
            asked.answer(answer);
        }
        let wanted = self.page.feed().is_wanted();
        if wanted != self.recording {
            self.recording = wanted;
            self.next = now;
            bus.watch(wanted);
            if !wanted {
                self.page.feed().clear();
            }
        }
        if !self.recording || now < self.next {
            return;
        }
        self.next = now + EVERY;
        let mut news = bus.news();
        let came = self.page.feed().came();
        let whole = news.clone();
        if came == self.served {
            if news.stations == self.last.stations {
                news.stations.clear();
            }
            if news.traffic == self.last.traffic {
                news.traffic.clear();
            }
        }
        let idle = came == self.served
            && news.master == self.last.master
            && news.stations.is_empty()
            && news.traffic.is_empty()
            && news.rows.is_empty()
            && news.left_out == 0
            && news.notes.is_empty();
        self.served = came;
        self.last = LiveNews {
            rows: Vec::new(),
            ..whole
        };
        if !idle {
            let text = serde_json::to_string(&news).unwrap_or_default();
            self.page.feed().publish(text);
        }
    }
}
