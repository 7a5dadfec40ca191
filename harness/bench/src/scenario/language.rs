//! What a bus adds to the language of scenarios.
//!
//! The core owns every symbol (`>`, `<`, `!`, `?`, `+`, `@`), the lines `title`, `source`, `bus`, `needs`, `strict`, `deadline`, `wait`,
//! `for` and `end`, all times and units, and the place of every mistake. A bus adds what follows a symbol, header lines and
//! steps that begin with a word. It implements [`Language`] for a type without content, and one line in `buses/mod.rs` makes it known.

use super::expression::Scope;
use super::plan::{Plan, PlannedStep, Unroll};
use super::problem::{Problem, Spanned, TextSpan};
use super::run::outcome::{ByteDifference, Mismatch, Stop};
use super::run::player::{MAX_ROUND, Runner};
use super::run::record::CellRecord;
use super::scanner::Scanner;
use super::settled::PlannedRings;
use super::syntax::Scenario;
use crate::bus_name::BusName;
use crate::link::{Capability, Link, LinkFault};
use harness_proto::time::{Instant, Span};
use std::fmt::Debug;

/// How a step that belongs to a bus begins.
#[derive(Clone, Copy, Debug)]
pub enum Opening<'w> {
    /// `!`: a fault.
    Fault,
    /// `?`: a check.
    Check,
    /// A word, such as `read-byte`, `record` or `until`.
    Word(&'w Spanned<&'w str>),
}

/// The words of a bus: how they are read, settled and written.
pub trait Language: Copy + Debug + Send + Sync + 'static {
    const BUS: BusName;
    /// Its name in a `bus` line.
    const NAME: &'static str = Self::BUS.name();
    /// Whether a message that no line asks for is a failure also without a `strict` line.
    const STRICT: bool;
    /// The longest time for which what was sent may be under way. On a bus that other stations fill it may never leave.
    const ROUND: Span = MAX_ROUND;
    /// A document and a section as a `source` line has them, for messages.
    const SOURCE: &'static str;
    /// A step and what it does, for messages.
    const EXAMPLE: &'static str;
    /// A line of a header about a drive, for messages.
    const HEADER_EXAMPLE: &'static str;

    /// The header lines of the bus, as written.
    type Header: Clone + Debug + Default;
    /// What follows `>` and `<`, as written: bytes, or a frame.
    type Message: Clone + Debug;
    /// Any other step of the bus, as written.
    type Step: Clone + Debug;
    /// The header, settled for one size.
    type Setup: Clone + Debug + Send + Sync;
    /// A piece of what the master sends: a byte, or a frame.
    type Sent: Clone + Debug + Send + Sync;
    /// A piece of what the master must receive.
    type Wanted: Clone + Debug + Send + Sync;
    /// A step of the bus, settled.
    type Act: Clone + Debug + Send + Sync;
    /// A piece of what the master receives: a byte with its line status, or a frame.
    type Received: Copy + Debug;
    /// What the bus keeps while a scenario is played.
    type State;
    /// What settles the steps of a scenario one after another.
    type Planner: Settle<Self>;

    /// Where the comment of a line begins.
    fn comment(line: &str) -> Option<usize> {
        line.find('#')
    }

    /// Words with which header lines begin, for suggestions.
    fn header_words() -> Vec<&'static str>;

    /// Words with which steps begin: jobs first, then the others.
    fn step_words() -> (Vec<&'static str>, &'static [&'static str]);

    /// Reads a line that begins with `word` as a header line; `None` if it is a step. `begun` says whether a step precedes it.
    fn header(
        word: &Spanned<&str>,
        scanner: &mut Scanner<'_>,
        header: &mut Self::Header,
        begun: bool,
    ) -> Option<Result<(), Problem>>;

    /// The first thing that a header lacks.
    fn incomplete(header: &Self::Header) -> Option<Problem>;

    /// Reads what follows `>` or `<`.
    ///
    /// # Errors
    /// It is no message of the bus.
    fn message(scanner: &mut Scanner<'_>) -> Result<Self::Message, Problem>;

    /// Reads what follows the opening of a step; `None` if the bus has no such word.
    fn step(opening: Opening<'_>, scanner: &mut Scanner<'_>)
    -> Option<Result<Self::Step, Problem>>;

    /// Settles the header, for a bench of `size` where that is given. Mistakes that leave the rest readable are added to `found`.
    ///
    /// # Errors
    /// The scenario cannot be played on a bench of this size.
    fn settle(
        scenario: &Scenario<Self>,
        size: Option<u8>,
        found: &mut Vec<Problem>,
    ) -> Result<Self::Planner, Problem>;

    /// A planner for one more step on a bench that is already planned.
    fn resume(setup: &Self::Setup) -> Self::Planner;

    /// A simulated bench, its devices set up as the plan says.
    fn simulate(plan: &Plan<Self>) -> Box<dyn Link>;

    /// The links on which faults are put, by port and place.
    fn fault_links(plan: &Plan<Self>) -> Vec<(usize, usize, LinkFault)> {
        let _none = plan;
        Vec::new()
    }

    /// The links whose traffic must be seen, by port and place.
    fn heard_links(plan: &Plan<Self>) -> Vec<(usize, usize)> {
        let _none = plan;
        Vec::new()
    }

    /// A link as a scenario writes it.
    fn link_name(plan: &Plan<Self>, port: usize, link: usize) -> String {
        let _one = plan;
        format!("{}:{link}", port + 1)
    }

    /// The numbers of drives for which a header is written, such as `1..250`, a ring each.
    fn rings(header: &Self::Header) -> Vec<String> {
        let _no_rings = header;
        Vec::new()
    }

    /// How many drives the bench has; `3+1` where it has two buses.
    fn size(plan: &Plan<Self>) -> String;

    /// How many ports the master has.
    fn ports(plan: &Plan<Self>) -> usize;

    /// What is kept from the first step on.
    fn state(plan: &Plan<Self>, link: &dyn Link) -> Self::State;

    /// Does what comes before the first step: what the header lets happen, and faults that wait for their moment.
    ///
    /// # Errors
    /// Why the scenario cannot begin.
    fn begin(runner: &mut Runner<'_, Self>) -> Result<(), Stop>;

    /// Plays a step of the bus.
    ///
    /// # Errors
    /// What was not as the step says.
    fn act(
        runner: &mut Runner<'_, Self>,
        act: &Self::Act,
        step: &PlannedStep<Self>,
    ) -> Result<(), Stop>;

    /// A `>` line is about to send, and no job of the bus.
    fn by_hand(state: &mut Self::State, port: usize) {
        let _nothing_to_note = (state, port);
    }

    /// Sends pieces over a link. Returns when the last one will have left.
    fn transmit(link: &mut dyn Link, port: usize, pieces: &[Self::Sent]) -> Instant;

    /// Notes what was sent, from a time to a time.
    fn sent(
        state: &mut Self::State,
        port: usize,
        pieces: &[Self::Sent],
        times: (Instant, Instant),
    ) {
        let _nothing_to_note = (state, port, pieces, times);
    }

    /// Takes the next piece that was received and not fetched yet.
    fn fetch(
        state: &mut Self::State,
        link: &mut dyn Link,
        port: usize,
    ) -> Option<(Instant, Self::Received)>;

    /// Notes the last piece of what a port has received.
    fn received(state: &mut Self::State, port: usize, all: &[(Instant, Self::Received)]) {
        let _nothing_to_note = (state, port, all);
    }

    /// The piece to expect, given those received before it for the same line.
    fn resolve(wanted: &Self::Wanted, before: &[(Instant, Self::Received)]) -> Self::Wanted {
        let _known = before;
        wanted.clone()
    }

    /// Whether a piece is what is wanted.
    fn matches(wanted: &Self::Wanted, received: Self::Received) -> bool;

    /// A wanted piece as messages show it.
    fn describe(wanted: &Self::Wanted) -> String;

    /// A received piece as messages show it.
    fn show(received: Self::Received) -> String;

    /// What differs, for reports that show it piece by piece: on a port, after `place.0` pieces of earlier lines, at place `place.1`
    /// of this line.
    fn difference(
        port: usize,
        place: (usize, usize),
        wanted: &[Self::Wanted],
        received: &[(Instant, Self::Received)],
    ) -> Option<ByteDifference> {
        let _not_shown = (port, place, wanted, received);
        None
    }

    /// When the bus next needs a look.
    fn next_look(state: &Self::State) -> Instant {
        let _never = state;
        Instant::NEVER
    }

    /// Looks at what is due.
    fn look(runner: &mut Runner<'_, Self>) {
        let _nothing = runner;
    }

    /// Why the run has grown too long, if it has.
    fn too_much(state: &Self::State) -> Option<String> {
        let _room = state;
        None
    }

    /// The devices in an error, in words; empty if none is or if it cannot be seen.
    fn in_error(runner: &Runner<'_, Self>) -> String {
        let _unseen = runner;
        String::new()
    }

    /// Whether fewer pieces have come than the bus gives back for those that were sent.
    fn lacks_answers(runner: &Runner<'_, Self>) -> bool {
        let _unknown = runner;
        false
    }

    /// Adds to a finding what has been received meanwhile.
    fn complete(runner: &Runner<'_, Self>, finding: &mut Mismatch) {
        let _whole = (runner, finding);
    }

    /// What was recorded.
    fn records(state: Self::State) -> Vec<CellRecord> {
        let _none = state;
        Vec::new()
    }

    /// The rings of its bench; `None` where stations share one line.
    fn planned_rings(plan: &Plan<Self>) -> Option<PlannedRings> {
        let _shared = plan;
        None
    }

    /// Whether it is for several sizes of rings, and this is one of them.
    fn fits(header: &Self::Header, drives: u8) -> bool {
        let _of_one_size = (header, drives);
        false
    }

    /// Writes the header lines: each with its word, and after them those about devices.
    fn write_header(header: &Self::Header) -> (Vec<(&'static str, String)>, Vec<String>);

    /// Writes a message as it follows `>` or `<`.
    fn write_message(message: &Self::Message) -> String;

    /// Writes any other step, with its symbol or its word.
    fn write_step(step: &Self::Step) -> String;
}

/// Settles the steps of a scenario one after another.
pub trait Settle<L: Language>: Sized {
    /// The steps in the order in which they are played.
    fn unroll<'s>(&self, scenario: &'s Scenario<L>) -> Unroll<'s, L>;

    /// The counters of the loops around the next step.
    fn enter(&mut self, scope: Scope);

    /// How long a byte takes, for times in bytes.
    fn byte_time(&self) -> Span;

    /// The most pieces that the steps together may send: what all links carry is kept in memory.
    fn room(&self) -> usize;

    /// Settles what the master sends on a port, counted from 0.
    ///
    /// # Errors
    /// It cannot be sent.
    fn send(&self, port: usize, message: &L::Message) -> Result<Vec<L::Sent>, Problem>;

    /// Settles what the master must receive on a port, counted from 0.
    ///
    /// # Errors
    /// It can never come.
    fn receive(&self, port: usize, message: &L::Message) -> Result<Vec<L::Wanted>, Problem>;

    /// Settles another step and adds what it needs of a rig to `needs`.
    ///
    /// # Errors
    /// It cannot be done on this bench.
    fn act(
        &mut self,
        step: &L::Step,
        span: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<L::Act, Problem>;

    /// How many pieces a settled step sends and expects.
    fn pieces(act: &L::Act) -> (usize, usize);

    /// Whether a settled step can fail because of what the drives do.
    fn judges(act: &L::Act) -> bool;

    /// What the settled header needs of a rig.
    fn needs(&self, scenario: &Scenario<L>) -> Vec<Capability>;

    /// The settled header.
    fn finish(self) -> L::Setup;
}
