//! Simulated UNITEK drives that clients share, in real time.

use super::language::Unitek;
use super::language::now::{ONLY, now};
use super::simulate::{Bench, DriveSetup, Setup};
use harness_bench::counted::counted;
use harness_bench::scenario::parse::header::{Part, read};
use harness_bench::scenario::plan::{Plan, plan as settle};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_bench::serve::frames::{FramePlace, MOST_CLIENTS, SharedBus, serve_frames};
use harness_bench::serve::{
    ControlAnswer, ServeEnd, ServeError, ServeHost, ServeOptions, step_at_once,
};
use harness_bench::web::LiveView;
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_proto::unitek::Register;
use harness_sim::segment;
use harness_sim::unitek::Member;

/// The registers that `state` shows without others: MODE, STATUS, errors, ready, speed, position.
const STATE: [u8; 6] = [0x51, 0x40, 0x8F, 0xE2, 0x30, 0x6D];

/// Serves drives until its options end it.
///
/// # Errors
/// A place cannot be opened, or the system fails.
pub(crate) fn serve(
    plan: Plan<Unitek>,
    options: &ServeOptions<FramePlace>,
    host: &mut dyn ServeHost,
) -> Result<ServeEnd, ServeError> {
    serve_frames(SharedDrives::new(plan), options, host)
}

/// The bench of a header, and nodes 1 to `drives` on it. By default that is node 1, if the header has no drive.
///
/// # Errors
/// The header has mistakes. Steps after it are ignored.
pub(crate) fn bench(drives: Option<u8>, header: Option<&Source>) -> Result<Plan<Unitek>, Problems> {
    let empty = Source::new("setup", "");
    let header = header.unwrap_or(&empty);
    let mut scenario: Scenario<Unitek> = read(header, Part::Header)?;
    scenario.steps.clear();
    let mut plan = settle(&scenario, header, None)?;
    let setup = &mut plan.setup;
    let least = u8::from(setup.drives.is_empty());
    for node in 1..=drives.unwrap_or(least) {
        if !setup.drives.iter().any(|drive| drive.node == node) {
            setup.drives.push(DriveSetup::new(node));
        }
    }
    Ok(plan)
}

/// A simulated bench that clients share.
#[derive(Debug)]
pub(crate) struct SharedDrives {
    pub(super) bench: Bench,
    plan: Plan<Unitek>,
}

impl SharedDrives {
    /// A bench with places for clients. Its own host neither sends nor acknowledges.
    pub(crate) fn new(plan: Plan<Unitek>) -> Self {
        let setup: &Setup = &plan.setup;
        let mut bench = Bench::with_guests(setup, MOST_CLIENTS);
        bench.segment.keep_no_record();
        if let Some(host) = bench.host() {
            *host = segment::Host::listener();
        }
        Self { bench, plan }
    }

    /// The place of a client: after the bench's host and the drives.
    fn guest(&self, client: usize) -> usize {
        1 + self.bench.nodes.len() + client
    }

    /// What registers of a drive hold, in hexadecimal digits.
    fn state(&self, mut words: std::str::SplitWhitespace<'_>) -> Result<String, String> {
        let node = words.next().and_then(|word| word.parse().ok());
        let drive = node.and_then(|node| self.bench.drive(node)).ok_or(
            "`state` and a drive of the bus expected: `state 1`, `state 1 SPEED_ACTUAL 6E`",
        )?;
        let named = words.map(|word| Register::named(word).map_err(|error| error.to_string()));
        let named: Vec<_> = named.collect::<Result<_, _>>()?;
        let usual = || STATE.map(Register::of).to_vec();
        let registers = if named.is_empty() { usual() } else { named };
        let shown = registers.iter().map(|register| {
            let digits = register.width.bits() as usize / 4;
            let raw = drive.register(register.number);
            format!("{}={raw:0digits$X}", register.name)
        });
        Ok(shown.collect::<Vec<_>>().join(" "))
    }
}

impl SharedBus for SharedDrives {
    fn rate(&self) -> BitRate {
        self.bench.segment.rate()
    }

    fn about(&self) -> String {
        let drives = counted(self.bench.nodes.len() as u64, "drive");
        format!("{drives}, {}", self.rate())
    }

    fn now(&self) -> Instant {
        self.bench.clock.now
    }

    fn advance(&mut self, to: Instant) {
        while let Some(at) = self.bench.clock.next_fault()
            && at <= to
        {
            self.bench.run_to(at);
        }
        self.bench.run_to(to);
        if let Some(host) = self.bench.host() {
            host.forget();
        }
    }

    fn next_event(&self) -> Option<Instant> {
        let scheduled = self.bench.clock.next_fault();
        let event = self.bench.segment.next_due();
        event.into_iter().chain(scheduled).min()
    }

    fn host(&mut self, client: usize) -> Option<&mut segment::Host> {
        let place = self.guest(client);
        self.bench.segment.station_mut(place).host_mut()
    }

    fn put(&mut self, client: usize, host: segment::Host) {
        let place = self.guest(client);
        *self.bench.segment.station_mut(place) = Member::Host(host);
        self.bench.segment.restart(place);
    }

    /// A fault (`! frame 3: lost`), something that happens to a drive from outside the bus (`drive 1 input limit1 high`), or a check of a
    /// register (`? drive 1 register 6E = 0`). `state 1` asks what a drive shows, `state 1 SPEED_ACTUAL 6E` for these registers.
    fn control(&mut self, line: &str) -> Option<ControlAnswer> {
        let said = line.trim();
        if said.is_empty() || said.starts_with('#') {
            return None;
        }
        let source = match Source::from_bytes("control".to_owned(), line.trim_end().into()) {
            Ok(source) => source,
            Err(error) => return Some(ControlAnswer::Error(error.to_string())),
        };
        let mut words = said.split_whitespace();
        if words.next() == Some("state") {
            return Some(
                self.state(words)
                    .map_or_else(ControlAnswer::Error, ControlAnswer::State),
            );
        }
        let bench = &mut self.bench;
        let act = |act: &_, span| now(bench, act, span);
        Some(step_at_once(&source, &self.plan, ONLY, act))
    }

    fn live(&mut self) -> &mut dyn LiveView {
        self
    }
}
