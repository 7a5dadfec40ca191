//! `drivebench top`: all drives live, on every bus.
//!
//! Two threads, so that a terminal that is slow or held does not keep the bus waiting: a drive may stop when it hears nothing for some
//! milliseconds. This one reads drives and lets the bus work, the other draws and takes keys.

use super::exit::Exit;
use super::failure::{Failure, exit_of_trouble};
use super::output::Output;
use super::top_page::TopPage;
use crate::command::drive::TopArguments;
use crate::counted::counted;
use crate::signals::{interrupt, interrupt_flag};
use crate::top::screen::{ScreenInput, leave};
use crate::top::{Heading, Press, Screen, Snapshot, Top};
use crate::trouble::Trouble;
use crate::web::{LiveNews, LivePicture};
use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, VecDeque};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, Sender, SyncSender, TryRecvError, channel, sync_channel,
};
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Moment};

/// Rates are those of so much time.
pub const WINDOW: Span = Span::from_millis(2_000);
/// Maximum number of marks within it.
const MARKS: usize = 256;
/// The longest step of the bus at a time, and how long a key may wait.
const STEP: Span = Span::from_millis(50);
const KEYS: Duration = Duration::from_millis(50);
/// Maximum number of stopped drives that are named.
const MOST_NAMED: usize = 4;
/// As long as a bus needs to notice that it was interrupted.
const NOTICE: Span = Span::from_millis(1);

/// What the view asks of a bench.
pub trait TopReader {
    /// How many drives it has.
    fn drives(&self) -> usize;

    /// Whether its time is virtual, so that it must not run ahead of the viewer's.
    fn is_simulated(&self) -> bool;

    /// The time of its bus.
    fn now(&self) -> Instant;

    /// Lets the bus work for a time.
    ///
    /// # Errors
    /// [`Failure`]: it can work no more.
    fn run(&mut self, time: Span) -> Result<(), Failure>;

    /// Reads drives from this place on, at least one; returns how many were read.
    ///
    /// # Errors
    /// [`Failure`]: the drives cannot be read.
    fn read(&mut self, first: usize, into: &mut Snapshot) -> Result<usize, Failure>;

    /// Stops a drive without waiting until it stands; returns what was done.
    ///
    /// # Errors
    /// [`Failure`]: the drive did not take it, or the bench does not permit it.
    fn stop(&mut self, drive: usize) -> Result<String, Failure>;

    /// Drives in a sentence: `drives 1, 2`.
    fn named(&self, drives: &[usize]) -> String;

    /// Looks at what the bus has carried and what happened there since the last call.
    fn look(&mut self, into: &mut Snapshot);

    /// Records what the bus carries from now on, for a page, or records nothing.
    fn record(&mut self, on: bool);

    /// The traffic for a page, and what was recorded since the last call.
    fn heard(&mut self) -> LiveNews;
}

/// What a page shows of a bench beside the table of its drives.
pub struct TopScene {
    pub title: String,
    /// The heads of the table of traffic.
    pub traffic: &'static [&'static str],
    /// The picture without a row.
    pub picture: LivePicture,
}

/// Whether drives can be shown like this: in a terminal, on one page, or in a browser, with time between two readings.
///
/// # Errors
/// They cannot.
pub fn check(arguments: &TopArguments, output: &Output) -> Result<(), Failure> {
    if arguments.every == Span::ZERO {
        return Err(Failure::refused("--every must be longer than nothing"));
    }
    let terminal = output.full_screen && std::io::stdin().is_terminal();
    match arguments.once || arguments.web.is_some() || terminal {
        true => Ok(()),
        false => Err(Failure::refused(
            "`top` needs a terminal that can move its cursor (TERM is not `dumb`); for a pipe or a file use `top --once`, `watch` or `info --format json`",
        )),
    }
}

/// Reads every drive once.
///
/// # Errors
/// See [`TopReader::read`].
pub fn once(reader: &mut dyn TopReader) -> Result<Snapshot, Failure> {
    let mut work = Work::new(reader);
    while !work.read_some()? {}
    work.look();
    Ok(work.reading)
}

/// Shows drives in the terminal, or on the page of a browser, until the view is closed.
///
/// # Errors
/// [`Failure`]: the drives cannot be read, the program was interrupted, or there is no page.
pub fn live(
    reader: &mut dyn TopReader,
    heading: Heading,
    scene: TopScene,
    arguments: &TopArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let flag = interrupt_flag();
    let mut work = Work::new(reader);
    if let Some(place) = &arguments.web {
        let mut page = TopPage::open(place, arguments.allow_remote, heading, scene)?;
        output.result(&page.line())?;
        return work.pump(arguments.every, &flag, &mut page);
    }
    let mut desk = Desk::open(Screen::enter(output.colours())?, heading);
    let end = work.pump(arguments.every, &flag, &mut desk);
    desk.close();
    end
}

/// What a user asks for.
pub(crate) enum TopOrder {
    /// The end.
    Quit,
    /// The end, as by a signal.
    Interrupt,
    /// That a drive is stopped, or all of them.
    Stop(Option<usize>),
    /// The end, as the terminal is broken.
    Broken(std::io::Error),
}

/// Where drives are shown.
pub(crate) trait TopView {
    /// Whether it wants readings now.
    fn is_wanted(&mut self, reader: &mut dyn TopReader) -> bool;

    /// Shows what was read.
    fn show(&mut self, reader: &mut dyn TopReader, reading: &Snapshot);

    /// Waits for so long, or until the user asks for something.
    fn wait(&mut self, time: Duration) -> Option<TopOrder>;
}

/// What has been read, and what comes next.
struct Work<'r> {
    reader: &'r mut dyn TopReader,
    start: Instant,
    begun: Moment,
    /// The first drive of the next piece.
    next: usize,
    reading: Snapshot,
}

impl<'r> Work<'r> {
    fn new(reader: &'r mut dyn TopReader) -> Self {
        Self {
            start: reader.now(),
            begun: Moment::now(),
            reader,
            next: 0,
            reading: Snapshot::default(),
        }
    }

    /// Reads some drives and returns whether they were the last ones.
    fn read_some(&mut self) -> Result<bool, Failure> {
        self.reading.at = self.reader.now().since(self.start);
        let read = self.reader.read(self.next, &mut self.reading)?;
        self.next += read;
        let last = read == 0 || self.next >= self.reader.drives();
        if last {
            self.next = 0;
        }
        Ok(last)
    }

    fn look(&mut self) {
        self.reading.at = self.reader.now().since(self.start);
        self.reader.look(&mut self.reading);
    }

    /// Stops a drive, or all of them. One that fails does not keep the others from it.
    fn stop(&mut self, wanted: Option<usize>) -> Result<(), Failure> {
        let drives = match wanted {
            Some(drive) => drive..drive + 1,
            None => 0..self.reader.drives(),
        };
        let mut done: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for drive in drives {
            match self.reader.stop(drive) {
                Ok(what) => done.entry(what).or_default().push(drive),
                Err(
                    Failure::Said(Exit::Usage, why) | Failure::Bus(Exit::Usage | Exit::Failed, why),
                ) => self.reading.disturbed(why),
                Err(other) => return Err(other),
            }
        }
        self.reading.at = self.reader.now().since(self.start);
        for (what, drives) in done {
            let shown = self.reader.named(&drives[..drives.len().min(MOST_NAMED)]);
            let others = match drives.len().saturating_sub(MOST_NAMED) {
                0 => String::new(),
                others => format!(" and {}", counted(others, "other")),
            };
            self.reading.done(format!("{shown}{others}: {what}"));
        }
        Ok(())
    }

    /// Reads the drives repeatedly and runs the bus until the view is closed.
    fn pump(
        &mut self,
        every: Span,
        interrupted: &AtomicBool,
        view: &mut dyn TopView,
    ) -> Result<Exit, Failure> {
        let mut next = self.start;
        loop {
            let wanted = view.is_wanted(self.reader);
            if wanted && self.reader.now() >= next && self.read_some()? {
                // A bus that is slower than the given period is read as often as possible.
                next = (next + every).max(self.reader.now());
            }
            if wanted {
                self.look();
                view.show(self.reader, &self.reading);
            }
            if interrupted.load(Ordering::Relaxed) {
                // The bus notices it too, and its drives are taken to their safe state.
                self.reader.run(NOTICE)?;
                let trouble = Trouble::Interrupted;
                return Err(Failure::Bus(exit_of_trouble(&trouble), trouble.to_string()));
            }
            let idle = match wanted {
                true => self.idle(next)?,
                false if self.reader.is_simulated() => self.stand_still(),
                false => self.idle(Instant::NEVER)?,
            };
            match view.wait(idle) {
                None => {}
                Some(TopOrder::Quit) => return Ok(Exit::Passed),
                Some(TopOrder::Interrupt) => interrupt()?,
                Some(TopOrder::Stop(wanted)) => {
                    self.stop(wanted)?;
                    // What came of it is read at once.
                    next = self.reader.now();
                }
                Some(TopOrder::Broken(error)) => {
                    // Nobody sees the drives any more: the end is that of a signal.
                    interrupt()?;
                    let _noticed = self.reader.run(NOTICE);
                    return Err(Failure::Output(error));
                }
            }
        }
    }

    /// Virtual time does not pass while no page is open. Returns how long to wait in real time.
    fn stand_still(&mut self) -> Duration {
        let passed = Duration::from_nanos(self.reader.now().since(self.start).as_nanos());
        let now = Moment::now();
        self.begun = now.checked_sub(passed).unwrap_or(now);
        KEYS
    }

    /// Runs the bus until the next drives are due, and returns how long to wait in real time: virtual time must not run ahead of the
    /// viewer's.
    fn idle(&mut self, next: Instant) -> Result<Duration, Failure> {
        let now = self.reader.now();
        let passed = Duration::from_nanos(now.since(self.start).as_nanos());
        let ahead = passed.saturating_sub(self.begun.elapsed());
        if self.reader.is_simulated() && ahead > Duration::ZERO {
            return Ok(ahead.min(KEYS));
        }
        if next > now {
            self.reader.run(next.since(now).min(STEP))?;
        }
        Ok(Duration::ZERO)
    }
}

/// What was counted at times within the window of rates, oldest first.
pub struct RateWindow<T>(VecDeque<(Instant, T)>);

impl<T> RateWindow<T> {
    /// Begins with what was counted before.
    pub fn new(at: Instant, counted: T) -> Self {
        Self(VecDeque::from([(at, counted)]))
    }

    /// Takes what is counted now; returns what was counted at the beginning of the window, and how long ago that is.
    pub fn take(&mut self, at: Instant, counted: T) -> (&T, Span) {
        let second = |marks: &VecDeque<(Instant, T)>| marks.get(1).map(|(at, _)| *at);
        while second(&self.0).is_some_and(|second| at.since(second) >= WINDOW)
            || self.0.len() >= MARKS
        {
            self.0.pop_front();
        }
        self.0.push_back((at, counted));
        let (first, before) = &self.0[0];
        (before, at.since(*first))
    }
}

/// The terminal, in a thread of its own. It is given back when that thread ends.
struct Desk {
    thread: JoinHandle<()>,
    news: SyncSender<Snapshot>,
    asked: Receiver<TopOrder>,
    stop: Arc<AtomicBool>,
}

impl Desk {
    fn open(screen: Screen, heading: Heading) -> Self {
        let (news, readings) = sync_channel(1);
        let (why, asked) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::spawn(move || {
            let end = desk(screen, Top::new(heading), &readings, &stopped, &why);
            // The receiver is gone if the bus has ended by itself.
            let _ended = why.send(end);
        });
        Self {
            thread,
            news,
            asked,
            stop,
        }
    }

    /// Waits until the terminal has been given back; not for ever where it takes nothing more, as the drives wait for their safe state.
    fn close(self) {
        self.stop.store(true, Ordering::Relaxed);
        drop(self.news);
        if ended(&self.thread) {
            if let Err(panic) = self.thread.join() {
                std::panic::resume_unwind(panic);
            }
        } else {
            ended(&std::thread::spawn(leave));
        }
    }
}

impl TopView for Desk {
    fn is_wanted(&mut self, _reader: &mut dyn TopReader) -> bool {
        true
    }

    fn show(&mut self, _reader: &mut dyn TopReader, reading: &Snapshot) {
        // A view that still draws the last page gets a later reading.
        let _not_now = self.news.try_send(reading.clone());
    }

    fn wait(&mut self, time: Duration) -> Option<TopOrder> {
        match self.asked.recv_timeout(time) {
            Ok(asked) => Some(asked),
            Err(RecvTimeoutError::Timeout) => None,
            // The view panicked; `close` passes the panic on.
            Err(RecvTimeoutError::Disconnected) => Some(TopOrder::Quit),
        }
    }
}

/// Whether a thread ends in time.
fn ended(thread: &JoinHandle<()>) -> bool {
    let end = Moment::now() + Duration::from_secs(2);
    while !thread.is_finished() && Moment::now() < end {
        std::thread::sleep(Duration::from_millis(2));
    }
    thread.is_finished()
}

/// Draws readings and handles keys until the view is closed.
fn desk(
    mut screen: Screen,
    mut top: Top,
    readings: &Receiver<Snapshot>,
    stop: &AtomicBool,
    orders: &Sender<TopOrder>,
) -> TopOrder {
    let mut stale = true;
    loop {
        loop {
            match readings.try_recv() {
                Ok(reading) => {
                    top.take(reading);
                    stale = true;
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return TopOrder::Quit,
            }
        }
        if stop.load(Ordering::Relaxed) {
            return TopOrder::Quit;
        }
        if stale && let Err(error) = screen.draw(&mut top) {
            return TopOrder::Broken(error);
        }
        stale = match screen.input(KEYS) {
            Ok(ScreenInput::Key(key)) => match top.press(key) {
                Press::Stay => true,
                Press::Quit => return TopOrder::Quit,
                Press::Interrupt => return TopOrder::Interrupt,
                Press::Stop(wanted) => {
                    // The receiver is gone if the bus has ended by itself.
                    let _ended = orders.send(TopOrder::Stop(wanted));
                    true
                }
            },
            Ok(ScreenInput::Redraw) => true,
            Ok(ScreenInput::Nothing) => false,
            Err(error) => return TopOrder::Broken(error),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::top::TopRow;

    /// Six drives of which the second one refuses to stop, and the third one breaks the link where it `breaks`.
    struct Bench {
        now: Instant,
        breaks: bool,
        stopped: Vec<usize>,
        /// How often drives were read.
        read: usize,
    }

    impl TopReader for Bench {
        fn drives(&self) -> usize {
            6
        }

        fn is_simulated(&self) -> bool {
            false
        }

        fn now(&self) -> Instant {
            self.now
        }

        fn run(&mut self, time: Span) -> Result<(), Failure> {
            self.now += time;
            Ok(())
        }

        fn read(&mut self, first: usize, into: &mut Snapshot) -> Result<usize, Failure> {
            let row = TopRow {
                state: usize::from(self.stopped.contains(&first)),
                in_error: false,
                speed: None,
                error: None,
                cells: vec![first.to_string()],
            };
            into.drives.insert(first, row);
            self.read += 1;
            Ok(1)
        }

        fn stop(&mut self, drive: usize) -> Result<String, Failure> {
            match drive {
                1 => return Err(Failure::refused("drive 1 may not be stopped")),
                2 if self.breaks => {
                    return Err(Failure::Bus(Exit::RigError, "the port is gone".to_owned()));
                }
                _ => self.stopped.push(drive),
            }
            Ok("stopped".to_owned())
        }

        fn named(&self, drives: &[usize]) -> String {
            format!("{drives:?}")
        }

        fn look(&mut self, _into: &mut Snapshot) {}

        fn record(&mut self, _on: bool) {}

        fn heard(&mut self) -> LiveNews {
            LiveNews::default()
        }
    }

    /// A view whose user orders this, one after the other, each when all drives have been shown.
    struct Orders(Vec<TopOrder>, Snapshot);

    impl TopView for Orders {
        fn is_wanted(&mut self, _reader: &mut dyn TopReader) -> bool {
            true
        }

        fn show(&mut self, _reader: &mut dyn TopReader, reading: &Snapshot) {
            self.1 = reading.clone();
        }

        fn wait(&mut self, _time: Duration) -> Option<TopOrder> {
            match self.1.drives.len() {
                6 if !self.0.is_empty() => Some(self.0.remove(0)),
                _ => None,
            }
        }
    }

    fn pumped(bench: &mut Bench, orders: Vec<TopOrder>) -> (Result<Exit, Failure>, Snapshot) {
        let mut view = Orders(orders, Snapshot::default());
        let every = Span::from_millis(1_000);
        let end = Work::new(bench).pump(every, &AtomicBool::new(false), &mut view);
        (end, view.1)
    }

    fn bench(breaks: bool) -> Bench {
        Bench {
            now: Instant::START,
            breaks,
            stopped: Vec::new(),
            read: 0,
        }
    }

    /// A refusal is shown, and keeps no other drive from its stop; what came of it is read at once.
    #[test]
    fn all_drives_are_stopped_but_one_that_refuses() {
        let mut bench = bench(false);
        let orders = vec![
            TopOrder::Stop(None),
            TopOrder::Stop(Some(2)),
            TopOrder::Stop(Some(1)),
            TopOrder::Quit,
        ];
        let (end, shown) = pumped(&mut bench, orders);
        assert!(matches!(end, Ok(Exit::Passed)), "{end:?}");
        assert_eq!(bench.stopped, [0, 2, 3, 4, 5, 2]);
        let events: Vec<_> = shown
            .events
            .iter()
            .map(|event| (event.what.as_str(), event.is_error, event.count))
            .collect();
        let expected = [
            ("drive 1 may not be stopped", true, 2),
            ("[0, 2, 3, 4] and 1 other: stopped", false, 1),
            ("[2]: stopped", false, 1),
        ];
        assert_eq!(events, expected);
        // Six drives at first; a second has not passed since.
        assert!(bench.read > 6 && bench.now < Instant::START + Span::from_millis(1_000));
    }

    #[test]
    fn a_lost_link_ends_the_view() {
        let (end, _) = pumped(&mut bench(true), vec![TopOrder::Stop(None)]);
        assert!(
            matches!(end, Err(Failure::Bus(Exit::RigError, _))),
            "{end:?}"
        );
    }
}
