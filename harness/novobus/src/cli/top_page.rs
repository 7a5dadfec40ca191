//! What the page of `top --web` shows of what rings carry.

use super::rig::OpenBench;
use crate::serve::recorder::{Recorder, Rows, links, picture};
use harness_bench::web::LivePicture;

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
            let sizes = bench.sizes();
            let all = sizes.iter().enumerate();
            let all = all.flat_map(|(ring, drives)| {
                (0..=usize::from(*drives)).map(move |place| (ring, place))
            });
            let heard = all
                .enumerate()
                .filter(|(_, link_of)| link.listens(link_of.0, link_of.1));
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
        let names = self.columns.iter().filter_map(|column| links.get(*column));
        picture(names.cloned().collect())
    }

    /// Records what links carry from now on, or nothing.
    pub(super) fn record(&mut self, bench: &OpenBench, on: bool) {
        bench.with_link(|link| {
            link.record(on);
            if on {
                self.recorder.count_from(link);
            }
        });
    }

    /// What was heard since the last call.
    pub(super) fn rows(&mut self, bench: &OpenBench) -> Rows {
        let now = bench.with_link(|link| {
            for ring in 0..self.sizes.len() {
                let trace = link.trace(ring);
                self.recorder.remark(ring, &trace.remarks);
                for (place, own) in trace.channels.iter().enumerate() {
                    self.recorder.carry(ring, place, own.octets());
                }
            }
            link.record(true);
            link.now()
        });
        let mut rows = now.map_or_else(Rows::default, |now| self.recorder.rows(now));
        for cell in rows.rows.iter_mut().flat_map(|row| &mut row.cells) {
            let column = self.columns.iter().position(|place| *place == cell.0);
            cell.0 = column.unwrap_or(0);
        }
        rows
    }
}
