//! The words of the scenario language that belong to the NOVOBUS: drives, jobs, checks of cells, calls of the driver.

pub(crate) mod argument;
pub(crate) mod parse;
pub(crate) mod plan;
pub(crate) mod read;
pub(crate) mod run;
pub(crate) mod scale;
pub(crate) mod syntax;
pub(crate) mod write;

use self::plan::{PlannedBench, Planner, RingAct, planner};
use self::run::bytes;

use self::run::Runner;
use self::run::state::{self, RunState};
use self::syntax::{Header, RingStep};
use crate::language::plan::PlannedStep;
use crate::simulate;
use harness_bench::bus_name::BusName;
use harness_bench::link::{Link, LinkFault, Octets as _};
use harness_bench::scenario::language::{Language, Opening};
use harness_bench::scenario::pattern::{self, Expected, Pattern};
use harness_bench::scenario::plan::Plan;
use harness_bench::scenario::problem::{Problem, Spanned};
use harness_bench::scenario::run::outcome::{ByteDifference, Mismatch, Stop};
use harness_bench::scenario::run::record::CellRecord;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::settled::PlannedRings;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::line::Received;
use harness_proto::time::Instant;

/// The language of scenarios with the words of this bus.
#[derive(Clone, Copy, Debug)]
pub struct Novobus;

impl Language for Novobus {
    const BUS: BusName = BusName::Novobus;
    const STRICT: bool = false;
    const SOURCE: &'static str = "nd21 9.7";
    const EXAMPLE: &'static str = "`> 80`: the master sends SYNCO";
    const HEADER_EXAMPLE: &'static str = "`drive 1 input GPIN3 high`";

    type Header = Header;
    type Message = Pattern;
    type Step = RingStep;
    type Setup = PlannedBench;
    type Sent = u8;
    type Wanted = Expected;
    type Act = RingAct;
    type Received = Received;
    type State = RunState;
    type Planner = Planner;

    fn header_words() -> Vec<&'static str> {
        parse::header::WORDS.to_vec()
    }

    fn step_words() -> (Vec<&'static str>, &'static [&'static str]) {
        (parse::job::names(), &parse::step::WORDS)
    }

    fn header(
        word: &Spanned<&str>,
        scanner: &mut Scanner<'_>,
        header: &mut Header,
        begun: bool,
    ) -> Option<Result<(), Problem>> {
        parse::header::line(word, scanner, header, begun)
    }

    fn incomplete(header: &Header) -> Option<Problem> {
        parse::header::incomplete(header)
    }

    fn message(scanner: &mut Scanner<'_>) -> Result<Pattern, Problem> {
        pattern::pattern(scanner)
    }

    fn step(opening: Opening<'_>, scanner: &mut Scanner<'_>) -> Option<Result<RingStep, Problem>> {
        parse::step::step(opening, scanner)
    }

    fn settle(
        scenario: &Scenario<Self>,
        size: Option<u8>,
        found: &mut Vec<Problem>,
    ) -> Result<Planner, Problem> {
        planner::settle(scenario, size, found)
    }

    fn resume(bench: &PlannedBench) -> Planner {
        planner::resume(bench)
    }

    fn simulate(plan: &Plan<Self>) -> Box<dyn Link> {
        Box::new(simulate::simulated(plan))
    }

    fn fault_links(plan: &Plan<Self>) -> Vec<(usize, usize, LinkFault)> {
        plan::fault_links(plan).collect()
    }

    fn heard_links(plan: &Plan<Self>) -> Vec<(usize, usize)> {
        plan::heard_links(plan).collect()
    }

    fn link_name(plan: &Plan<Self>, ring: usize, link: usize) -> String {
        plan.link_name(ring, link)
    }

    fn rings(header: &Self::Header) -> Vec<String> {
        header.rings.iter().map(|ring| ring.sizes()).collect()
    }

    fn size(plan: &Plan<Self>) -> String {
        let drives = plan.rings.iter().map(|ring| ring.drives().to_string());
        drives.collect::<Vec<_>>().join("+")
    }

    fn ports(plan: &Plan<Self>) -> usize {
        plan.rings.len()
    }

    fn state(plan: &Plan<Self>, link: &dyn Link) -> RunState {
        RunState::new(plan, link)
    }

    fn begin(runner: &mut Runner<'_>) -> Result<(), Stop> {
        state::begin(runner)
    }

    fn act(runner: &mut Runner<'_>, act: &RingAct, step: &PlannedStep) -> Result<(), Stop> {
        state::act_of_ring(runner, act, step)
    }

    fn by_hand(state: &mut RunState, ring: usize) {
        state.by_hand(ring);
    }

    fn transmit(link: &mut dyn Link, ring: usize, bytes: &[u8]) -> Instant {
        link.send_octets(ring, bytes)
    }

    fn sent(state: &mut RunState, ring: usize, bytes: &[u8], times: (Instant, Instant)) {
        state.sent(ring, bytes, times);
    }

    fn fetch(_: &mut RunState, link: &mut dyn Link, ring: usize) -> Option<(Instant, Received)> {
        link.receive_octet(ring)
    }

    fn received(state: &mut RunState, ring: usize, all: &[(Instant, Received)]) {
        state.received(ring, all);
    }

    fn resolve(wanted: &Expected, before: &[(Instant, Received)]) -> Expected {
        bytes::resolve(*wanted, before)
    }

    fn matches(wanted: &Expected, received: Received) -> bool {
        bytes::matches(*wanted, received)
    }

    fn describe(wanted: &Expected) -> String {
        wanted.to_string()
    }

    fn show(received: Received) -> String {
        received.to_string()
    }

    fn difference(
        ring: usize,
        place: (usize, usize),
        wanted: &[Expected],
        received: &[(Instant, Received)],
    ) -> Option<ByteDifference> {
        Some(state::difference(ring, place, wanted, received))
    }

    fn planned_rings(plan: &Plan<Self>) -> Option<PlannedRings> {
        Some(PlannedRings {
            drives: plan.rings.iter().map(|ring| ring.drives()).collect(),
            sizes: plan.sizes.clone(),
            rate: plan.rate,
        })
    }

    fn fits(header: &Header, drives: u8) -> bool {
        let range = header.rings.first();
        range.is_some_and(|range| range.contains(drives))
    }

    fn next_look(state: &RunState) -> Instant {
        state.recorder.next()
    }

    fn look(runner: &mut Runner<'_>) {
        run::record::note(runner);
    }

    fn too_much(state: &RunState) -> Option<String> {
        state.recorder.too_much()
    }

    fn in_error(runner: &Runner<'_>) -> String {
        state::in_error(runner)
    }

    fn lacks_answers(runner: &Runner<'_>) -> bool {
        state::lacks_answers(runner)
    }

    fn complete(runner: &Runner<'_>, finding: &mut Mismatch) {
        state::complete(runner, finding);
    }

    fn records(state: RunState) -> Vec<CellRecord> {
        state.recorder.records
    }

    fn write_header(header: &Header) -> (Vec<(&'static str, String)>, Vec<String>) {
        (write::header(header), write::devices(header))
    }

    fn write_message(message: &Pattern) -> String {
        message.to_string()
    }

    fn write_step(step: &RingStep) -> String {
        write::step(step)
    }
}
