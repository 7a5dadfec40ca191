//! The words of the bus: header lines, messages and steps, as read, settled, played and written.

use crate::bench::Bench;
use crate::valve::Telegram;
use harness_bench::bus_name::BusName;
use harness_bench::link::{Capability, Link};
use harness_bench::medium::Out;
use harness_bench::scenario::expression::Scope;
use harness_bench::scenario::language::{Language, Opening, Settle};
use harness_bench::scenario::parse::words::{equals, required};
use harness_bench::scenario::pattern::{self, Expected, Pattern};
use harness_bench::scenario::plan::{Plan, PlannedStep, Unroll};
use harness_bench::scenario::problem::{Problem, Spanned, TextSpan};
use harness_bench::scenario::run::outcome::Stop;
use harness_bench::scenario::run::player::Runner;
use harness_bench::scenario::scanner::Scanner;
use harness_bench::scenario::syntax::Scenario;
use harness_proto::can::{BitRate, CanEvent, Frame};
use harness_proto::time::{Instant, Span};

/// The bus.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Valves;

/// `101 01 32`: an identifier and bytes.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    id: u16,
    data: Pattern,
}

/// A step of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValveStep {
    /// `open 1 = 50`: moves a valve, and waits for its answer.
    Open(u8, u8),
    /// `? valve 1 at 50`: looks at it beside the bus.
    At(u8, u8),
}

/// An identifier and bytes.
#[derive(Clone, Debug)]
pub(crate) struct ExpectedFrame(u16, Vec<Expected>);

/// A decimal number of at most `most`.
fn number(scanner: &mut Scanner<'_>, most: u8, what: &str) -> Result<u8, Problem> {
    let before = scanner.clone();
    let digits = scanner.take_while(|c| c.is_ascii_digit());
    let number = digits.and_then(|digits| digits.value.parse().ok());
    number.filter(|number| *number <= most).ok_or_else(|| {
        *scanner = before;
        scanner.unexpected(what)
    })
}

fn valve(scanner: &mut Scanner<'_>) -> Result<u8, Problem> {
    number(scanner, 127, "the number of a valve, 0 to 127,")
}

fn percent(scanner: &mut Scanner<'_>) -> Result<u8, Problem> {
    number(scanner, 100, "0 to 100 percent")
}

fn frame(id: u16, data: &[u8], span: TextSpan) -> Result<Frame, Problem> {
    let wrong = |error| Problem::new(span, format!("{error}"), "at most 8 bytes expected here");
    Frame::base(id, data).map_err(wrong)
}

/// Settles steps; it has the valves of the header.
pub(crate) struct Planner(Vec<(u8, bool)>);

impl Settle<Valves> for Planner {
    fn unroll<'s>(&self, scenario: &'s Scenario<Valves>) -> Unroll<'s, Valves> {
        Unroll::new(&scenario.steps, Scope::default())
    }

    fn enter(&mut self, _: Scope) {}

    fn byte_time(&self) -> Span {
        BitRate::K500.time_of(8)
    }

    fn room(&self) -> usize {
        10_000
    }

    fn send(&self, _: usize, message: &Message) -> Result<Vec<Frame>, Problem> {
        let data = message.data.expand_known(Scope::default(), 8)?;
        Ok(vec![frame(message.id, &data, message.data.span)?])
    }

    fn receive(&self, _: usize, message: &Message) -> Result<Vec<ExpectedFrame>, Problem> {
        let data = message.data.expand(Scope::default(), 8)?;
        Ok(vec![ExpectedFrame(message.id, data)])
    }

    fn act(
        &mut self,
        step: &ValveStep,
        span: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<ValveStep, Problem> {
        let (ValveStep::Open(valve, _) | ValveStep::At(valve, _)) = *step;
        if !self.0.iter().any(|(known, _)| *known == valve) {
            let message = format!("the bench has no valve {valve}");
            return Err(Problem::new(
                span,
                message,
                "a valve of the header expected",
            ));
        }
        needs.extend(matches!(step, ValveStep::At(..)).then_some(Capability::Simulator));
        Ok(*step)
    }

    fn pieces(step: &ValveStep) -> (usize, usize) {
        match step {
            ValveStep::Open(..) => (1, 1),
            ValveStep::At(..) => (0, 0),
        }
    }

    fn judges(_: &ValveStep) -> bool {
        true
    }

    fn needs(&self, _: &Scenario<Valves>) -> Vec<Capability> {
        Vec::new()
    }

    fn finish(self) -> Vec<(u8, bool)> {
        self.0
    }
}

impl Language for Valves {
    // A bus of the product has its own line in `buses/mod.rs`.
    const BUS: BusName = BusName::DEFAULT;
    const NAME: &'static str = "valves";
    const STRICT: bool = true;
    const SOURCE: &'static str = "valves 2.1";
    const EXAMPLE: &'static str = "`> 101 00`: the bench asks valve 1";
    const HEADER_EXAMPLE: &'static str = "`valve 1 sticks`";

    type Header = Vec<(u8, bool)>;
    type Message = Message;
    type Step = ValveStep;
    type Setup = Vec<(u8, bool)>;
    type Sent = Frame;
    type Wanted = ExpectedFrame;
    type Act = ValveStep;
    type Received = Frame;
    type State = ();
    type Planner = Planner;

    fn header_words() -> Vec<&'static str> {
        vec!["valve"]
    }

    fn step_words() -> (Vec<&'static str>, &'static [&'static str]) {
        (vec!["open"], &[])
    }

    fn header(
        word: &Spanned<&str>,
        scanner: &mut Scanner<'_>,
        header: &mut Vec<(u8, bool)>,
        _: bool,
    ) -> Option<Result<(), Problem>> {
        (word.value == "valve").then(|| {
            header.push((valve(scanner)?, scanner.eat_word("sticks")));
            scanner.expect_end()
        })
    }

    fn incomplete(header: &Vec<(u8, bool)>) -> Option<Problem> {
        let none = || {
            Problem::new(
                TextSpan::default(),
                "the scenario has no valve",
                "`valve 1`",
            )
        };
        header.is_empty().then(none)
    }

    fn message(scanner: &mut Scanner<'_>) -> Result<Message, Problem> {
        let before = scanner.clone();
        let digits = scanner.take_while(|c| c.is_ascii_hexdigit());
        let digits = digits.filter(|digits| digits.value.len() == 3);
        let id = digits.and_then(|digits| u16::from_str_radix(digits.value, 16).ok());
        let Some(id) = id else {
            *scanner = before;
            return Err(scanner.unexpected("an identifier of three hexadecimal digits"));
        };
        let data = pattern::pattern(scanner)?;
        Ok(Message { id, data })
    }

    fn step(opening: Opening<'_>, scanner: &mut Scanner<'_>) -> Option<Result<ValveStep, Problem>> {
        let look = |scanner: &mut Scanner<'_>| {
            let valve = valve(scanner)?;
            required(scanner, &["at"])?;
            Ok(ValveStep::At(valve, percent(scanner)?))
        };
        let open = |scanner: &mut Scanner<'_>| {
            let valve = valve(scanner)?;
            equals(scanner)?;
            Ok(ValveStep::Open(valve, percent(scanner)?))
        };
        match opening {
            Opening::Check if scanner.eat_word("valve") => Some(look(scanner)),
            Opening::Word(word) if word.value == "open" => Some(open(scanner)),
            _ => None,
        }
    }

    fn settle(
        scenario: &Scenario<Self>,
        _: Option<u8>,
        _: &mut Vec<Problem>,
    ) -> Result<Planner, Problem> {
        Ok(Planner(scenario.header.clone()))
    }

    fn resume(setup: &Vec<(u8, bool)>) -> Planner {
        Planner(setup.clone())
    }

    fn simulate(plan: &Plan<Self>) -> Box<dyn Link> {
        Box::new(Bench::new(&plan.setup))
    }

    fn size(plan: &Plan<Self>) -> String {
        plan.setup.len().to_string()
    }

    fn ports(_: &Plan<Self>) -> usize {
        1
    }

    fn state(_: &Plan<Self>, _: &dyn Link) {}

    fn begin(_: &mut Runner<'_, Self>) -> Result<(), Stop> {
        Ok(())
    }

    fn act(
        runner: &mut Runner<'_, Self>,
        action: &ValveStep,
        step: &PlannedStep<Self>,
    ) -> Result<(), Stop> {
        match *action {
            ValveStep::Open(valve, place) => {
                let (id, data) = Telegram::Move(valve, place).encode();
                let request = Frame::base(id, &data);
                let request =
                    request.map_err(|error| Stop::failed(step.span, error.to_string()))?;
                let (id, data) = Telegram::At(valve, place).encode();
                let answer = ExpectedFrame(id, data.into_iter().map(Expected::Byte).collect());
                runner.transmit(0, &[request]);
                runner.expect(step.span, 0, &[answer], None)
            }
            ValveStep::At(valve, place) => {
                runner.settle();
                let bench = runner
                    .link
                    .beside()
                    .and_then(|bench| bench.downcast_ref::<Bench>());
                match bench.and_then(|bench| bench.place(valve)) {
                    Some(found) if found == place => Ok(()),
                    Some(found) => {
                        let message = format!("valve {valve} is at {found} %, expected {place} %");
                        Err(Stop::failed(step.span, message))
                    }
                    None => Err(Stop::failed(
                        step.span,
                        "the valve cannot be seen".to_owned(),
                    )),
                }
            }
        }
    }

    fn transmit(link: &mut dyn Link, port: usize, frames: &[Frame]) -> Instant {
        link.send(port, Out::Frames(frames))
    }

    fn fetch(_: &mut (), link: &mut dyn Link, port: usize) -> Option<(Instant, Frame)> {
        loop {
            let (at, heard) = link.receive(port)?;
            if let CanEvent::Frame(frame) = heard.frame()? {
                return Some((at, frame));
            }
        }
    }

    fn matches(ExpectedFrame(id, data): &ExpectedFrame, frame: Frame) -> bool {
        let mut pairs = data.iter().zip(frame.data());
        frame.id().number() == u32::from(*id)
            && frame.data().len() == data.len()
            && pairs.all(|(known, byte)| [Expected::Any, Expected::Byte(*byte)].contains(known))
    }

    fn describe(ExpectedFrame(id, data): &ExpectedFrame) -> String {
        let bytes = data.iter().map(|byte| format!(" {byte}"));
        format!("{id:03X}{}", bytes.collect::<String>())
    }

    fn show(frame: Frame) -> String {
        frame.to_string()
    }

    fn write_header(header: &Vec<(u8, bool)>) -> (Vec<(&'static str, String)>, Vec<String>) {
        let line = |&(valve, sticks): &(u8, bool)| match sticks {
            true => format!("valve {valve} sticks"),
            false => format!("valve {valve}"),
        };
        (Vec::new(), header.iter().map(line).collect())
    }

    fn write_message(message: &Message) -> String {
        format!("{:03X} {}", message.id, message.data)
    }

    fn write_step(step: &ValveStep) -> String {
        match step {
            ValveStep::Open(valve, place) => format!("open {valve} = {place}"),
            ValveStep::At(valve, place) => format!("? valve {valve} at {place}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_bench::scenario::parse::parse;
    use harness_bench::scenario::run::AtMismatch;
    use harness_bench::scenario::settled::{BenchSize, settle};
    use harness_bench::scenario::source::Source;
    use harness_bench::scenario::verdict::Verdict;
    use harness_bench::scenario::write::write;

    /// The writer is the inverse of the parser, also for what the core gives: times, patterns, loops.
    #[test]
    fn what_is_written_is_read_again() {
        let text = "title   A valve opens\nsource  valves 2.1\nbus     valves\nvalve 1\nvalve 2 sticks\n\n\
                    > 101 01 32\n+0.1ms..20ms < 201 01 xx\nfor k in 1..3\nopen 1 = 7\nend\n? valve 2 at 0\n";
        let source = Source {
            name: "valves.scn".to_owned(),
            text: text.into(),
        };
        let scenario: Scenario<Valves> = parse(&source).expect("a scenario");
        assert_eq!(write(&scenario), text);
        let (_, plan) = settle::<Valves>(&source, BenchSize::Own).expect("a scenario");
        let outcome = plan.play(&mut *plan.simulate(), AtMismatch::Stop);
        assert_eq!(outcome.verdict, Verdict::Passed);
    }
}
