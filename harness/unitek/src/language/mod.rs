//! The words of the scenario language that belong to UNITEK drives on CAN: drives, frames, registers, jobs.

pub(crate) mod now;
mod parse;
pub(crate) mod plan;
mod play;
pub(crate) mod syntax;
mod write;

pub(crate) use play::PlayState;
pub(crate) use play::written;
pub(crate) use write::identifier;

use self::plan::{Act, Planner, WantedFrame};
use self::syntax::{FrameStep, Header, Message};
use crate::simulate;
use harness_bench::bus_name::BusName;
use harness_bench::link::Link;
use harness_bench::medium::Out;
use harness_bench::scenario::language::{Language, Opening};
use harness_bench::scenario::plan::{Plan, PlannedStep};
use harness_bench::scenario::problem::{Problem, Spanned};
use harness_bench::scenario::run::outcome::{Mismatch, Stop};
use harness_bench::scenario::run::player::Runner;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};

/// The language of scenarios with the words of this bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Unitek;

impl Language for Unitek {
    const BUS: BusName = BusName::Unitek;
    const STRICT: bool = true;
    /// Replies may be 10 s late (`reply-delay`).
    const ROUND: Span = Span::from_millis(11_000);
    const SOURCE: &'static str = "unitek 5.4 ex 8";
    const EXAMPLE: &'static str = "`> 201 3D 40 00`: the master asks drive 1 for STATUS";
    const HEADER_EXAMPLE: &'static str = "`drive 1 input run low`";

    type Header = Header;
    type Message = Message;
    type Step = FrameStep;
    type Setup = simulate::Setup;
    type Sent = Frame;
    type Wanted = WantedFrame;
    type Act = Act;
    type Received = Frame;
    type State = PlayState;
    type Planner = Planner;

    fn comment(line: &str) -> Option<usize> {
        parse::comment(line)
    }

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

    fn step(opening: Opening<'_>, scanner: &mut Scanner<'_>) -> Option<Result<FrameStep, Problem>> {
        parse::step(opening, scanner)
    }

    fn settle(
        scenario: &Scenario<Self>,
        size: Option<u8>,
        found: &mut Vec<Problem>,
    ) -> Result<Planner, Problem> {
        plan::settle(scenario, size, found)
    }

    fn resume(setup: &simulate::Setup) -> Planner {
        plan::resume(setup)
    }

    fn simulate(plan: &Plan<Self>) -> Box<dyn Link> {
        Box::new(simulate::Bench::new(&plan.setup))
    }

    fn size(plan: &Plan<Self>) -> String {
        plan.setup.drives.len().to_string()
    }

    fn ports(_: &Plan<Self>) -> usize {
        1
    }

    fn state(plan: &Plan<Self>, _: &dyn Link) -> PlayState {
        PlayState::new(plan)
    }

    fn begin(runner: &mut Runner<'_, Self>) -> Result<(), Stop> {
        play::begin(runner);
        Ok(())
    }

    fn act(runner: &mut Runner<'_, Self>, act: &Act, step: &PlannedStep<Self>) -> Result<(), Stop> {
        play::act(runner, act, step)
    }

    fn transmit(link: &mut dyn Link, port: usize, frames: &[Frame]) -> Instant {
        link.send(port, Out::Frames(frames))
    }

    fn fetch(state: &mut PlayState, link: &mut dyn Link, port: usize) -> Option<(Instant, Frame)> {
        state.fetch(link, port)
    }

    fn matches(wanted: &WantedFrame, frame: Frame) -> bool {
        play::matches(wanted, &frame)
    }

    fn describe(wanted: &WantedFrame) -> String {
        play::describe(wanted)
    }

    fn show(frame: Frame) -> String {
        written(&frame)
    }

    fn complete(runner: &Runner<'_, Self>, finding: &mut Mismatch) {
        play::complete(&runner.own, finding);
    }

    fn write_header(header: &Header) -> (Vec<(&'static str, String)>, Vec<String>) {
        write::header(header)
    }

    fn write_message(message: &Message) -> String {
        write::message(message)
    }

    fn write_step(step: &FrameStep) -> String {
        write::step(step)
    }
}

#[cfg(test)]
mod tests;
