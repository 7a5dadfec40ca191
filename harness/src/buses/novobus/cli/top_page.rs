//! What the page of `top --web` shows of rings.

use super::rig::OpenBench;
use crate::buses::novobus::serve::recorder::{Recorder, Rows, links, picture};
use crate::cli::top_page::TopPage;
use crate::top::{Disturbance, Heading, Snapshot, Top, TopRow};
use crate::web::{LiveNews, LivePicture};

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
    heard: HeardLinks,
}

/// What is heard of the links of a bench, as a picture that grows: all of simulated rings, and those with a port.
pub(super) struct HeardLinks {
    sizes: Vec<u8>,
    /// The links that are heard, by their place among all.
    columns: Vec<usize>,
    recorder: Recorder,
}

impl HeardLinks {
    /// The links of a bench that are heard; `None` where it has been given back.
    pub(super) fn of(bench: &OpenBench) -> Option<Self> {
        bench.with_link(|link| {
            let sizes: Vec<u8> = (0..bench.rings()).map(|ring| link.drives(ring)).collect();
            let all = sizes.iter().enumerate();
            let all = all.flat_map(|(ring, drives)| {
                (0..=usize::from(*drives)).map(move |place| (ring, place))
            });
            let heard = all
                .enumerate()
                .filter(|(_, own)| link.listens(own.0, own.1));
            Self {
                columns: heard.map(|(column, _)| column).collect(),
                recorder: Recorder::new(&sizes, link.medium(0).octet_time()),
                sizes,
            }
        })
    }

    /// The picture without a row.
    pub(super) fn picture(&self) -> LivePicture {
        let links = links(&self.sizes);
        let names = self.columns.iter().filter_map(|own| links.get(*own));
        picture(names.cloned().collect())
    }

    /// What was heard since the last call; nothing where the page was just opened.
    fn rows(&mut self, bench: &OpenBench, just_opened: bool) -> Rows {
        let now = bench.with_link(|link| {
            let rings = if just_opened { 0 } else { self.sizes.len() };
            for ring in 0..rings {
                let trace = link.trace(ring);
                self.recorder.remark(ring, &trace.remarks);
                for (place, own) in trace.channels.iter().enumerate() {
                    self.recorder.carry(ring, place, own.octets());
                }
            }
            link.record(true);
            if just_opened {
                self.recorder.count_from(link);
            }
            link.now()
        });
        let mut rows = now.map_or_else(Rows::default, |now| self.recorder.rows(now));
        for cell in rows.rows.iter_mut().flat_map(|row| &mut row.cells) {
            let column = self.columns.iter().position(|own| *own == cell.0);
            cell.0 = column.unwrap_or(0);
        }
        rows
    }
}

impl RingPage {
    /// The page of rings.
    pub(super) fn new(page: TopPage, heading: Heading, heard: HeardLinks) -> Self {
        Self {
            page,
            top: Top::new(heading),
            told: Vec::new(),
            heard,
        }
    }

    /// Whether a page is open: drives are read, and what links carry is recorded, only then.
    pub(super) fn is_wanted(&mut self, bench: &OpenBench) -> bool {
        let wanted = self.page.is_wanted();
        if !wanted {
            bench.with_link(|link| link.record(false));
        }
        wanted
    }

    /// Shows what was read.
    pub(super) fn show(&mut self, bench: &OpenBench, reading: Snapshot) {
        if !self.page.is_due() {
            return;
        }
        let mut notes = self.notes(&reading);
        let just_opened = self.page.just_opened();
        let heard = self.heard.rows(bench, just_opened);
        notes.extend(heard.notes);
        self.top.take(reading);
        let rows = self.top.rows().into_iter();
        self.page.show(LiveNews {
            stations: rows.map(|TopRow { cells, .. }| cells.to_vec()).collect(),
            traffic: self.traffic(),
            rows: heard.rows,
            left_out: heard.left_out,
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
