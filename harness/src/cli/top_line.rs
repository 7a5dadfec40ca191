//! `top` on drives that share a line: a table in a terminal, or a page with the table, the traffic and the picture of the line.

use super::exit::Exit;
use super::failure::Failure;
use super::output::Output;
use super::shell::{HeldDrives, HeldRecord};
use super::top_page::TopPage;
use crate::buses::commands::{TopArguments, columns};
use crate::capture::{Piece, Tape};
use crate::link::{Line, Link};
use crate::rig::port_session::PortSession;
use crate::web::{LiveNews, LivePicture, LiveRow};
use harness_proto::line::Rate;
use harness_proto::time::{Instant, Span};
use std::collections::VecDeque;
use std::time::{Duration, Instant as Moment};

/// The longest part of virtual time that passes at once, and how long a signal may wait.
const PART: Span = Span::from_millis(50);

/// Rates are those of so much time.
const WINDOW: Duration = Duration::from_secs(2);

/// Reads the rows of a table.
pub(crate) type TableReader<'v, D, const N: usize> =
    dyn FnMut(&mut PortSession<D>) -> Result<Vec<[String; N]>, Failure> + 'v;

/// What `top` shows of a bus: a table with `N` columns, and what its stations send.
pub(crate) struct LineTop<'v, D: HeldDrives, const N: usize> {
    /// The title of the page.
    pub(crate) title: String,
    /// The heads of the table.
    pub(crate) heading: [&'static str; N],
    /// What is counted of each station, and its rate: `frames`, `frames/s`.
    pub(crate) carried: [&'static str; 2],
    /// The picture without a row; its columns are the stations.
    pub(crate) picture: LivePicture,
    /// Reads the rows of the table.
    pub(crate) read: &'v mut TableReader<'v, D, N>,
    /// The rows of the picture for what was heard.
    pub(crate) rows: &'v mut dyn FnMut(Vec<Piece>) -> Vec<LiveRow>,
}

/// Whether drives can be shown like this: in a terminal, on one page, or in a browser, with time between two readings.
///
/// # Errors
/// They cannot.
pub(crate) fn check(arguments: &TopArguments, output: &Output) -> Result<(), Failure> {
    if arguments.every == Span::ZERO {
        return Err(Failure::refused("--every must be longer than nothing"));
    }
    match arguments.once || arguments.web.is_some() || output.full_screen {
        true => Ok(()),
        false => Err(Failure::refused(
            "top needs a terminal; --once prints one page without one",
        )),
    }
}

impl<D: HeldDrives, const N: usize> LineTop<'_, D, N> {
    /// Shows drives: with `--once` one page, and without it again and again until the program is interrupted.
    ///
    /// # Errors
    /// [`Failure`]: the drives do not answer, or there is no page.
    pub(crate) fn show(
        self,
        session: &mut PortSession<D>,
        arguments: &TopArguments,
        output: &mut Output,
    ) -> Result<Exit, Failure> {
        let mut traffic = LineTraffic::of(&self.picture.columns);
        let [carried, rate] = self.carried;
        let heads = (&self.heading[..], &["from", carried, rate, "damaged"][..]);
        let mut page = TopPage::open(arguments, self.title, heads, self.picture)?;
        if let Some(page) = &page {
            output.result(&page.line())?;
        }
        let pace = Pace::of(session);
        loop {
            let is_wanted = page.as_mut().is_none_or(TopPage::is_wanted);
            if !is_wanted || page.is_none() {
                session.link().record(false);
            }
            match &mut page {
                _ if !is_wanted => {}
                Some(page) => {
                    if page.just_opened() {
                        // What was recorded is from before the page was opened.
                        session.link().record(true);
                        traffic = LineTraffic::of(&traffic.names);
                    }
                    let stations = (self.read)(session)?;
                    let rows = (self.rows)(heard(session));
                    page.show(LiveNews {
                        stations: stations.iter().map(|row| row.to_vec()).collect(),
                        traffic: traffic.take(&rows, Moment::now()),
                        rows,
                        ..LiveNews::default()
                    });
                }
                None => {
                    let page = columns(&self.heading, &(self.read)(session)?);
                    let page = output.fitted(&page);
                    if arguments.once {
                        output.result(&page)?;
                        return Ok(Exit::Passed);
                    }
                    // Clears the screen, and begins in its upper left corner.
                    output.result(&format!("\x1b[2J\x1b[H{page}"))?;
                }
            }
            pace.pass(session, arguments.every)?;
        }
    }
}

/// What the line has carried since the last call.
fn heard<D: HeldDrives>(session: &mut PortSession<D>) -> Vec<Piece> {
    let record = HeldRecord::of(session.guarded(), 1);
    session.link().record(true);
    let tape = match session.rig().is_simulated() {
        true => Tape::of(&record.traces, Rate::default()),
        false => Tape::of_ports(&record.traces, record.medium, record.now),
    };
    tape.pieces.into_iter().map(|(.., piece)| piece).collect()
}

/// Keeps virtual time from running ahead of the viewer's: when it began, and the line's time then. `None` at a port.
struct Pace(Option<(Moment, Instant)>);

impl Pace {
    fn of<D: HeldDrives>(session: &PortSession<D>) -> Self {
        let simulated = session.rig().is_simulated();
        Self(simulated.then(|| (Moment::now(), session.guarded().now())))
    }

    /// Lets time pass.
    fn pass<D: HeldDrives>(&self, session: &mut PortSession<D>, time: Span) -> Result<(), Failure> {
        let Some((begun, start)) = self.0 else {
            return D::pass(session, time);
        };
        let end = session.guarded().now() + time;
        while session.guarded().now() < end {
            let left = end.since(session.guarded().now());
            D::pass(session, left.min(PART))?;
            let passed = session.guarded().now().since(start);
            let ahead = Duration::from_nanos(passed.as_nanos()).saturating_sub(begun.elapsed());
            std::thread::sleep(ahead);
        }
        Ok(())
    }
}

/// What each station has sent since a page was opened.
struct LineTraffic {
    names: Vec<String>,
    /// Frames or telegrams, and how many of them no receiver has, or not as they were sent.
    counts: Vec<[u64; 2]>,
    /// What was counted at times within the window, oldest first.
    marks: VecDeque<(Moment, Vec<[u64; 2]>)>,
}

impl LineTraffic {
    fn of(stations: &[String]) -> Self {
        Self {
            names: stations.to_vec(),
            counts: vec![[0; 2]; stations.len()],
            marks: VecDeque::new(),
        }
    }

    /// Counts rows of the picture; returns those of the table.
    fn take(&mut self, rows: &[LiveRow], now: Moment) -> Vec<Vec<String>> {
        if self.marks.is_empty() {
            self.marks.push_back((now, self.counts.clone()));
        }
        for row in rows {
            if let Some(count) = row.sender().and_then(|own| self.counts.get_mut(own)) {
                let rows = row.fold.max(1);
                count[0] += rows;
                count[1] += if row.is_damaged() { rows } else { 0 };
            }
        }
        while self.marks.len() > 1 && now - self.marks[1].0 >= WINDOW {
            self.marks.pop_front();
        }
        let (at, before) = &self.marks[0];
        let seconds = (now - *at).as_secs_f64();
        let stations = self.names.iter().zip(&self.counts).zip(before);
        let row = |((name, count), before): ((&String, &[u64; 2]), &[u64; 2])| {
            let rate = (count[0] - before[0]) as f64 / seconds;
            vec![
                name.clone(),
                count[0].to_string(),
                format!("{:.1}", if seconds > 0.0 { rate } else { 0.0 }),
                count[1].to_string(),
            ]
        };
        let table = stations.map(row).collect();
        self.marks.push_back((now, self.counts.clone()));
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn traffic_is_counted_by_its_sender() {
        let arrow = |ends, arrived| LiveRow::arrow(3, ends, arrived, String::new(), String::new());
        let mut traffic = LineTraffic::of(&["bench", "1", "2"].map(str::to_owned));
        let begun = Moment::now();
        let rows = [
            arrow((0, Some(1)), true),
            arrow((1, Some(0)), true),
            arrow((0, None), true),
            arrow((0, Some(2)), false),
            LiveRow {
                fold: 6,
                ..arrow((2, Some(0)), true)
            },
        ];
        assert_eq!(traffic.take(&[], begun)[0], ["bench", "0", "0.0", "0"]);
        let table = traffic.take(&rows, begun + WINDOW);
        let expected = [
            ["bench", "3", "1.5", "1"],
            ["1", "1", "0.5", "0"],
            ["2", "6", "3.0", "0"],
        ];
        assert_eq!(table, expected);
        // A rate is that of the last two seconds.
        let table = traffic.take(&rows[..1], begun + 2 * WINDOW);
        assert_eq!(table[0], ["bench", "4", "0.5", "1"]);
        assert_eq!(table[1], ["1", "1", "0.0", "0"]);
    }
}
