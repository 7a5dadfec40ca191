//! `drivebench top`: all drives live.
//!
//! Two threads, so that a terminal that is slow or held does not keep the ring waiting: a drive with monitoring reports a time-out
//! after 10 ms without a byte (ND21 9.9). This one reads drives and lets the bus work, the other draws and takes keys.

use super::args::TopArguments;
use super::rig::{self, OpenBench, RigName, Use};
use super::top_page::{HeardLinks, RingPage, TRAFFIC};
use crate::buses::novobus::driver::{Axis, Error, State, Width};
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::top_page::TopPage;
use crate::counted::counted;
use crate::link::Trouble;
use crate::signals::interrupt_flag;
use crate::top::screen::{ScreenInput, leave};
use crate::top::{DriveReading, Heading, Press, RingReading, Screen, Snapshot, Top, view};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, SpeedRange};
use harness_proto::novobus::master::{Counters, Event};
use harness_proto::time::{Instant, Span};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant as Moment};

/// Drives that are asked side by side: what is shown comes piece by piece, and the end does not wait for a long ring.
const SIDE_BY_SIDE: usize = 8;
/// Rates are those of so much time.
const WINDOW: Span = Span::from_millis(2_000);
/// Maximum number of marks within it.
const MARKS: usize = 256;
/// The longest step of the bus at a time, and how long a key may wait.
const STEP: Span = Span::from_millis(50);
const KEYS: Duration = Duration::from_millis(50);
/// The page of `--once`, in characters.
const WIDTH: u16 = 120;

/// What is read of a drive, in the order of the words in [`reading`].
///
/// Whole turns stand on both sides of the angle: between two commands the counter may have gone on.
const CELLS: [(u16, Width); 9] = [
    (ram::STATUS, Width::Byte),
    (ram::FLAGS, Width::Word),
    (ram::ERRORCODE, Width::Word),
    (ram::NIST, Width::Word),
    (ram::UMDRIST, Width::Word),
    (ram::LAGEIST, Width::Word),
    (ram::UMDRIST, Width::Word),
    (ram::MSOLL, Width::Word),
    (ram::SW_VERSION2, Width::Byte),
];

/// Shows drives until a key ends it.
pub(crate) fn top(arguments: &TopArguments, output: &mut Output) -> Result<Exit, Failure> {
    if arguments.every == Span::ZERO {
        return Err(Failure::refused("--every must be longer than nothing"));
    }
    let terminal = output.full_screen && std::io::stdin().is_terminal();
    if !arguments.once && arguments.web.is_none() && !terminal {
        return Err(Failure::refused(
            "`top` needs a terminal that can move its cursor (TERM is not `dumb`); for a pipe or a file use `top --once`, `watch` or `info --format json`",
        ));
    }
    let name = match &arguments.rig.rig {
        Some(RigName::Named(name)) => name.clone(),
        Some(RigName::Simulated(sizes)) => {
            let sizes: Vec<_> = sizes.iter().map(u8::to_string).collect();
            format!("sim:{}", sizes.join(","))
        }
        None => "sim:3".to_owned(),
    };
    rig::on(&arguments.rig, Use::look("top"), output, |bench, output| {
        let heading = heading(&name, bench);
        let mut reader = Reader::new(bench);
        let title = format!("{}: {}", heading.rig, heading.rings.join("; "));
        let heard = HeardLinks::of(bench);
        let heard = heard.ok_or_else(|| Failure::refused("the rig has been given back"))?;
        let picture = heard.picture();
        match TopPage::open(arguments, title, (&view::COLUMNS, &TRAFFIC), picture)? {
            Some(page) => {
                let page = RingPage::new(page, heading, heard);
                on_page(&mut reader, page, arguments.every, output)
            }
            None if arguments.once => once(&mut reader, heading, output),
            None => live(&mut reader, heading, arguments.every, output),
        }
    })
}

/// The heading of the page.
fn heading(name: &str, bench: &OpenBench) -> Heading {
    let mut sizes = Vec::new();
    for axis in bench.bus.axes() {
        match sizes.get_mut(axis.ring()) {
            Some(size) => *size += 1,
            None => sizes.push(1),
        }
    }
    let places = bench.with_rig(|session| {
        let rings = session.rig().rings();
        let place = |ring: &crate::rig::file::Ring| match &ring.endpoint.port {
            Some(port) => format!(
                "{} {port}, {} 8O1",
                ring.endpoint.transport.name(),
                ring.endpoint.line.baud()
            ),
            None => format!(
                "{}, {} 8O1",
                ring.endpoint.transport.name(),
                ring.endpoint.line.baud()
            ),
        };
        (
            session.rig().id().to_owned(),
            rings.map(|(_, ring)| place(ring)).collect(),
        )
    });
    let (rig, places): (String, Vec<String>) =
        places.unwrap_or_else(|| (name.to_owned(), vec!["simulated".to_owned(); sizes.len()]));
    let rings = sizes.iter().zip(places);
    Heading {
        rig,
        rings: rings
            .map(|(size, place)| format!("{}, {place}", counted(*size, "drive")))
            .collect(),
    }
}

/// One page as plain text.
fn once(reader: &mut Reader<'_>, heading: Heading, output: &mut Output) -> Result<Exit, Failure> {
    while !reader.read_some()? {}
    let mut top = Top::new(heading);
    top.take(reader.reading());
    output.result(&view::page(&mut top, WIDTH))?;
    Ok(Exit::Passed)
}

/// Why the view ends.
enum Leave {
    Quit,
    Interrupt,
    Broken(std::io::Error),
}

/// Shows the page until its end. The terminal is restored before any message is printed.
fn live(
    reader: &mut Reader<'_>,
    heading: Heading,
    every: Span,
    output: &Output,
) -> Result<Exit, Failure> {
    let flag = interrupt_flag();
    let screen = Screen::enter(output.colours())?;
    let (news, readings) = sync_channel(1);
    let (why, asked) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let desk = std::thread::spawn(move || {
        let end = desk(screen, Top::new(heading), &readings, &stopped);
        // The receiver is gone if the bus has ended by itself.
        let _ended = why.send(end);
    });
    let mut show = |reading| {
        // A view that still draws the last page gets a later reading.
        let _not_now = news.try_send(reading);
    };
    let mut wait = |time| match asked.recv_timeout(time) {
        Ok(Leave::Quit) => Some(Ok(Exit::Passed)),
        Ok(Leave::Interrupt) => Some(Err(interrupted())),
        Ok(Leave::Broken(error)) => Some(Err(Failure::Output(error))),
        Err(RecvTimeoutError::Timeout) => None,
        // The view panicked; `wait_for` passes the panic on.
        Err(RecvTimeoutError::Disconnected) => Some(Ok(Exit::RigError)),
    };
    let end = pump(reader, every, &flag, (&|| true, &mut show, &mut wait));
    stop.store(true, Ordering::Relaxed);
    drop(news);
    wait_for(desk);
    end
}

/// Waits until the terminal has been given back; not for ever where it takes nothing more, as the drives wait for their safe
/// state.
fn wait_for(desk: JoinHandle<()>) {
    if ended(&desk) {
        if let Err(panic) = desk.join() {
            std::panic::resume_unwind(panic);
        }
    } else {
        ended(&std::thread::spawn(leave));
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
) -> Leave {
    let mut stale = true;
    loop {
        loop {
            match readings.try_recv() {
                Ok(reading) => {
                    top.take(reading);
                    stale = true;
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Leave::Quit,
            }
        }
        if stop.load(Ordering::Relaxed) {
            return Leave::Quit;
        }
        if stale && let Err(error) = screen.draw(&mut top) {
            return Leave::Broken(error);
        }
        stale = match screen.input(KEYS) {
            Ok(ScreenInput::Key(key)) => match top.press(key) {
                Press::Stay => true,
                Press::Quit => return Leave::Quit,
                Press::Interrupt => return Leave::Interrupt,
            },
            Ok(ScreenInput::Redraw) => true,
            Ok(ScreenInput::Nothing) => false,
            Err(error) => return Leave::Broken(error),
        };
    }
}

/// Shows the page of a browser until a signal ends it. Drives are read while a page is open.
fn on_page(
    reader: &mut Reader<'_>,
    page: RingPage,
    every: Span,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let flag = interrupt_flag();
    output.result(&page.page.line())?;
    let bench = reader.bench;
    let page = RefCell::new(page);
    let wanted = || page.borrow_mut().is_wanted(bench);
    let mut show = |reading| page.borrow_mut().show(bench, reading);
    let mut wait = |time| {
        std::thread::sleep(time);
        None
    };
    pump(reader, every, &flag, (&wanted, &mut show, &mut wait))
}

fn interrupted() -> Failure {
    Failure::from(Error::Link(Trouble::Interrupted))
}

/// A view: whether it wants readings, what takes them, and what waits and may end it.
type View<'v> = (
    &'v dyn Fn() -> bool,
    &'v mut dyn FnMut(Snapshot),
    &'v mut dyn FnMut(Duration) -> Option<Result<Exit, Failure>>,
);

/// Reads the drives repeatedly and runs the bus until the view is closed.
fn pump(
    reader: &mut Reader<'_>,
    every: Span,
    interrupt: &AtomicBool,
    (wanted, show, wait): View<'_>,
) -> Result<Exit, Failure> {
    let begun = Moment::now();
    let mut next = reader.start;
    loop {
        let wanted = wanted();
        if wanted && reader.bench.bus.now() >= next && reader.read_some()? {
            // A ring that is slower than the given period is read as often as possible.
            next = (next + every).max(reader.bench.bus.now());
        }
        if let Some(halt) = reader.bench.bus.halted() {
            return Err(halt.into());
        }
        if wanted {
            show(reader.reading());
        }
        if interrupt.load(Ordering::Relaxed) {
            return Err(interrupted());
        }
        let next = if wanted { next } else { Instant::NEVER };
        if let Some(end) = wait(reader.idle(begun, next)) {
            return end;
        }
    }
}

/// What has been read, and what comes next.
struct Reader<'b> {
    bench: &'b OpenBench,
    start: Instant,
    axes: Vec<Axis>,
    /// The first drive of the next piece.
    next: usize,
    reading: Snapshot,
    /// What the masters had done, oldest first.
    marks: VecDeque<(Instant, Vec<Counters>)>,
}

impl<'b> Reader<'b> {
    fn new(bench: &'b OpenBench) -> Self {
        let start = bench.bus.now();
        Self {
            bench,
            start,
            axes: bench.bus.axes(),
            next: 0,
            reading: Snapshot::default(),
            marks: VecDeque::from([(start, bench.bus.counters())]),
        }
    }

    /// Reads some drives and returns whether they were the last ones.
    fn read_some(&mut self) -> Result<bool, Failure> {
        let some: Vec<Axis> = self
            .axes
            .iter()
            .skip(self.next)
            .take(SIDE_BY_SIDE)
            .copied()
            .collect();
        let cells = some
            .iter()
            .flat_map(|axis| CELLS.map(|(address, width)| (*axis, address, width)));
        let words = self.bench.bus.read_many(cells)?;
        for (axis, words) in some.iter().zip(words.chunks_exact(CELLS.len())) {
            if let Some(drive) = reading(self.bench, *axis, words) {
                self.reading.drive(drive);
            }
        }
        self.next += some.len();
        let last = self.next >= self.axes.len();
        if last {
            self.next = 0;
        }
        Ok(last)
    }

    /// All that is known now.
    fn reading(&mut self) -> Snapshot {
        let bus = &self.bench.bus;
        let now = bus.now();
        self.reading.at = now.since(self.start);
        for (ring, event) in bus.take_events() {
            if let Event::Disturbed { fault, .. } = event {
                self.reading.disturbed(ring, fault.to_string());
            }
        }
        let counters = bus.counters();
        let oldest = |marks: &VecDeque<(Instant, _)>| marks.get(1).map(|(at, _)| *at);
        while oldest(&self.marks).is_some_and(|at| now.since(at) >= WINDOW)
            || self.marks.len() >= MARKS
        {
            self.marks.pop_front();
        }
        if let Some((at, before)) = self.marks.front() {
            let span = now.since(*at);
            let rings = before.iter().zip(&counters);
            self.reading.rings = rings
                .map(|(before, now)| RingReading::between(before, now, span))
                .collect();
        }
        self.marks.push_back((now, counters));
        let unplaced = self.bench.with_rig(|session| {
            let ports = session.ports();
            ports.map_or(0, |ports| ports.take_unplaced())
        });
        self.reading.unplaced += unplaced.unwrap_or(0);
        self.reading.clone()
    }

    /// Runs the bus until the next drives are due, and returns how long to wait in real time: virtual time must not run ahead of the
    /// viewer's.
    fn idle(&self, begun: Moment, next: Instant) -> Duration {
        let bus = &self.bench.bus;
        let now = bus.now();
        let real = Span::from_nanos(u64::try_from(begun.elapsed().as_nanos()).unwrap_or(u64::MAX));
        let ahead = now
            .since(self.start)
            .as_nanos()
            .saturating_sub(real.as_nanos());
        let ports = self.bench.with_rig(|session| session.ports().is_some());
        if ports != Some(true) && ahead > 0 {
            return Duration::from_nanos(ahead).min(KEYS);
        }
        if next > now {
            bus.run(next.since(now).min(STEP));
        }
        Duration::ZERO
    }
}

fn reading(bench: &OpenBench, axis: Axis, words: &[u16]) -> Option<DriveReading> {
    let &[
        status,
        flags,
        error,
        speed,
        before,
        angle,
        behind,
        torque,
        range,
    ] = words
    else {
        return None;
    };
    let low = |word: u16| word.to_be_bytes()[1];
    let [flags, flags2] = flags.to_be_bytes();
    let units = bench.units_with(axis, SpeedRange::from_sw_version2(low(range)));
    let [before, behind] = [before, behind].map(u16::cast_signed);
    let upwards = behind.wrapping_sub(before) > 0;
    let turns = match upwards == (angle < 0x8000) {
        true => behind,
        false => before,
    };
    Some(DriveReading {
        axis,
        state: State {
            status: low(status),
            flags,
            flags2,
            error,
        },
        speed: value("nist", speed, units),
        position: Some(f64::from(turns) + f64::from(angle) / 65_536.0),
        torque: value("msoll", torque, units),
    })
}

/// The value of a word cell in the manual's unit (14.5).
fn value(cell: &str, word: u16, units: DriveUnits) -> Option<f64> {
    use harness_proto::nd21::units::Value;
    let cell = harness_proto::nd21::cells::cell(cell)?;
    match cell.value(&word.to_be_bytes(), units)?.ok()? {
        Value::Exact(number) => Some(number.to_f64()),
        Value::Approximate(number) => Some(number),
        Value::Off | Value::Date(_) => None,
    }
}
