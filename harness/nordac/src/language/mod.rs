//! The words of the scenario language that belong to NORDAC inverters on PROFIBUS DP: slaves, telegrams, parameters, jobs.

mod jobs;
pub(crate) mod now;
mod parse;
pub(crate) mod plan;
mod play;
pub(crate) mod syntax;
mod write;

pub(crate) use jobs::KnownSlaves;

use self::plan::{PlannedAct, Planner, SentTelegram, WantedOctet};
use self::syntax::{Header, Message, TelegramStep};
use crate::simulate;
use harness_bench::bus_name::BusName;
use harness_bench::link::Link;
use harness_bench::scenario::language::{Language, Opening};
use harness_bench::scenario::plan::{Plan, PlannedStep};
use harness_bench::scenario::problem::{Problem, Spanned};
use harness_bench::scenario::run::outcome::{Mismatch, Stop};
use harness_bench::scenario::run::player::Runner;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};

/// The language of scenarios with the words of this bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Nordac;

impl Language for Nordac {
    const BUS: BusName = BusName::Nordac;
    const STRICT: bool = true;
    /// A reply that a fault holds back may be 10 s late.
    const ROUND: Span = Span::from_millis(11_000);
    const SOURCE: &'static str = "nordac 3.2.1";
    const EXAMPLE: &'static str = "`> 10 08 02 49 53 16`: the master asks slave 8 for its status";
    const HEADER_EXAMPLE: &'static str = "`slave 8 ppo 2`";

    type Header = Header;
    type Message = Message;
    type Step = TelegramStep;
    type Setup = simulate::Setup;
    type Sent = SentTelegram;
    type Wanted = WantedOctet;
    type Act = PlannedAct;
    type Received = Received;
    type State = KnownSlaves;
    type Planner = Planner;

    fn header_words() -> Vec<&'static str> {
        parse::HEADER.to_vec()
    }

    fn step_words() -> (Vec<&'static str>, &'static [&'static str]) {
        (parse::NAMES.to_vec(), &parse::STEPS)
    }

    fn header(
        word: &Spanned<&str>,
        scanner: &mut Scanner<'_>,
        header: &mut Header,
        begun: bool,
    ) -> Option<Result<(), Problem>> {
        parse::header(word, scanner, header, begun)
    }

    fn incomplete(header: &Header) -> Option<Problem> {
        parse::incomplete(header)
    }

    fn message(scanner: &mut Scanner<'_>) -> Result<Message, Problem> {
        parse::message(scanner)
    }

    fn step(
        opening: Opening<'_>,
        scanner: &mut Scanner<'_>,
    ) -> Option<Result<TelegramStep, Problem>> {
        parse::step(opening, scanner)
    }

    fn settle(
        scenario: &Scenario<Self>,
        size: Option<u8>,
        found: &mut Vec<Problem>,
    ) -> Result<Planner, Problem> {
        plan::settle(scenario, size, found)
    }

    fn resume(bench: &simulate::Setup) -> Planner {
        plan::resume(bench)
    }

    fn simulate(plan: &Plan<Self>) -> Box<dyn Link> {
        Box::new(simulate::Bench::new(&plan.setup))
    }

    fn size(plan: &Plan<Self>) -> String {
        plan.setup.slaves.len().to_string()
    }

    fn ports(_: &Plan<Self>) -> usize {
        1
    }

    fn state(_: &Plan<Self>, _: &dyn Link) -> KnownSlaves {
        KnownSlaves::default()
    }

    fn begin(runner: &mut Runner<'_, Self>) -> Result<(), Stop> {
        play::begin(runner);
        Ok(())
    }

    fn act(
        runner: &mut Runner<'_, Self>,
        act: &PlannedAct,
        step: &PlannedStep<Self>,
    ) -> Result<(), Stop> {
        play::act(runner, act, step)
    }

    fn transmit(link: &mut dyn Link, port: usize, telegrams: &[SentTelegram]) -> Instant {
        play::transmit(link, port, telegrams)
    }

    fn fetch(_: &mut KnownSlaves, link: &mut dyn Link, port: usize) -> Option<(Instant, Received)> {
        let (at, heard) = link.receive(port)?;
        Some((at, heard.octet()?))
    }

    fn matches(wanted: &WantedOctet, octet: Received) -> bool {
        play::matches(wanted, octet)
    }

    fn describe(wanted: &WantedOctet) -> String {
        play::describe(wanted)
    }

    fn show(octet: Received) -> String {
        play::show(octet)
    }

    fn complete(runner: &Runner<'_, Self>, finding: &mut Mismatch) {
        play::complete(runner, finding);
    }

    fn write_header(header: &Header) -> (Vec<(&'static str, String)>, Vec<String>) {
        write::header(header)
    }

    fn write_message(message: &Message) -> String {
        write::message(message)
    }

    fn write_step(step: &TelegramStep) -> String {
        write::step(step)
    }
}

#[cfg(test)]
mod tests;
