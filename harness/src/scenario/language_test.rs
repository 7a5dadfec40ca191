//! Another bus: frames with an identifier, stations with registers. It shows what a bus has to give, and that the core does the rest.

use super::expression::Scope;
use super::language::{Language, Opening, Settle};
use super::parse::{parse, words::equals};
use super::pattern::{self, Expected, MAX_CELLS, Pattern};
use super::plan::{Plan, PlannedStep, Unroll, plan};
use super::problem::{Problem, Span, Spanned};
use super::run::outcome::Stop;
use super::run::player::{Runner, run};
use super::scanner::Scanner;
use super::source::Source;
use super::syntax::Scenario;
use super::verdict::Verdict;
use super::write::write;
use crate::buses::Bus;
use crate::link::{Capability, Link, Octets as _};
use harness_proto::time::{self, Instant};

#[derive(Clone, Copy, Debug)]
struct Frames;

/// `201 3D 40 00`
#[derive(Clone, Debug)]
struct Message {
    id: u16,
    data: Pattern,
}

#[derive(Clone, Debug)]
enum Own {
    /// `read 1 SPEED_ACTUAL = 81 01`: a request, and its answer.
    Read(u16, Pattern),
    /// `? quiet`: no frame has come that no line asked for.
    Quiet,
}

/// A frame of one byte of identifier and two of data.
type Frame = [u8; 3];
type Wanted = [Expected; 3];

const REGISTERS: [(&str, u8); 2] = [("SPEED_ACTUAL", 0x80), ("STATUS", 0x90)];

fn number(scanner: &mut Scanner<'_>, digits: usize, what: &str) -> Result<u16, Problem> {
    let before = scanner.clone();
    let word = scanner.take_while(|c| c.is_ascii_hexdigit());
    let known = word.filter(|word| word.value.len() == digits);
    let known = known.and_then(|word| u16::from_str_radix(word.value, 16).ok());
    known.ok_or_else(|| {
        *scanner = before;
        scanner.unexpected(what)
    })
}

fn read(scanner: &mut Scanner<'_>) -> Result<Own, Problem> {
    number(scanner, 1, "a station")?;
    let before = scanner.clone();
    let name = scanner.word().map_or("", |word| word.value);
    let Some((_, register)) = REGISTERS.iter().find(|(own, _)| *own == name) else {
        *scanner = before;
        let names = REGISTERS.map(|(name, _)| name);
        return Err(scanner.unexpected("a register").did_you_mean(name, &names));
    };
    equals(scanner)?;
    Ok(Own::Read((*register).into(), pattern::pattern(scanner)?))
}

struct Planner(Vec<u8>);

impl Settle<Frames> for Planner {
    fn unroll<'s>(&self, scenario: &'s Scenario<Frames>) -> Unroll<'s, Frames> {
        Unroll::new(&scenario.steps, Scope::default())
    }

    fn enter(&mut self, _: Scope) {}

    fn byte_time(&self) -> time::Span {
        time::Span::from_micros(20)
    }

    fn room(&self) -> usize {
        100
    }

    fn send(&self, port: usize, message: &Message) -> Result<Vec<Frame>, Problem> {
        let wanted = self.receive(port, message)?;
        let known = |byte| match byte {
            Expected::Byte(byte) => byte,
            _ => 0,
        };
        Ok(wanted.into_iter().map(|frame| frame.map(known)).collect())
    }

    fn receive(&self, _: usize, message: &Message) -> Result<Vec<Wanted>, Problem> {
        let id = Expected::Byte(message.id.to_be_bytes()[1]);
        match message.data.expand(Scope::default(), MAX_CELLS)?[..] {
            [a, b] => Ok(vec![[id, a, b]]),
            _ => Err(Problem::new(
                message.data.span,
                "no frame has so many bytes",
                "two bytes expected here",
            )),
        }
    }

    fn act(&mut self, own: &Own, _: Span, needs: &mut Vec<Capability>) -> Result<Own, Problem> {
        needs.extend(matches!(own, Own::Quiet).then_some(Capability::Tap));
        Ok(own.clone())
    }

    fn pieces(_: &Own) -> (usize, usize) {
        (1, 1)
    }

    fn needs(&self, _: &Scenario<Frames>) -> Vec<Capability> {
        Vec::new()
    }

    fn finish(self) -> Vec<u8> {
        self.0
    }
}

impl Language for Frames {
    const BUS: Bus = Bus::NAMES[1].1;
    const STRICT: bool = true;
    const SOURCE: &'static str = "frames 5.4";
    const EXAMPLE: &'static str = "`> 201 3D 40 00`: the master asks for a status";

    type Header = Vec<u8>;
    type Message = Message;
    type Step = Own;
    type Setup = Vec<u8>;
    type Sent = Frame;
    type Wanted = Wanted;
    type Act = Own;
    type Received = Frame;
    /// Bytes of a frame that has not come whole.
    type State = Vec<u8>;
    type Planner = Planner;

    fn header_words() -> Vec<&'static str> {
        vec!["drive"]
    }

    fn step_words() -> (Vec<&'static str>, &'static [&'static str]) {
        (vec!["read"], &[])
    }

    fn header(
        word: &Spanned<&str>,
        scanner: &mut Scanner<'_>,
        header: &mut Vec<u8>,
        _: bool,
    ) -> Option<Result<(), Problem>> {
        (word.value == "drive").then(|| {
            let [_, station] = number(scanner, 1, "a station")?.to_be_bytes();
            header.push(station);
            scanner.expect_end()
        })
    }

    fn incomplete(_: &Vec<u8>) -> Option<Problem> {
        None
    }

    fn message(scanner: &mut Scanner<'_>) -> Result<Message, Problem> {
        let id = number(scanner, 3, "an identifier of three hexadecimal digits")?;
        let data = pattern::pattern(scanner)?;
        Ok(Message { id, data })
    }

    fn step(opening: Opening<'_>, scanner: &mut Scanner<'_>) -> Option<Result<Own, Problem>> {
        match opening {
            Opening::Check if scanner.eat_word("quiet") => Some(Ok(Own::Quiet)),
            Opening::Word(word) if word.value == "read" => Some(read(scanner)),
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

    fn resume(setup: &Vec<u8>) -> Planner {
        Planner(setup.clone())
    }

    fn simulate(_: &Plan<Self>) -> Box<dyn Link> {
        let text = source("ring 1\n> 80\n");
        let ring: Scenario = parse(&text).expect("a ring");
        let ring = super::plan::plan(&ring, &text, None).expect("a ring");
        Box::new(super::simulate::simulated(&ring))
    }

    fn size(plan: &Plan<Self>) -> String {
        plan.setup.len().to_string()
    }

    fn ports(_: &Plan<Self>) -> usize {
        1
    }

    fn state(_: &Plan<Self>, _: &dyn Link) -> Vec<u8> {
        Vec::new()
    }

    fn begin(_: &mut Runner<'_, Self>) -> Result<(), Stop> {
        Ok(())
    }

    fn act(runner: &mut Runner<'_, Self>, act: &Own, step: &PlannedStep<Self>) -> Result<(), Stop> {
        match act {
            Own::Quiet => {
                runner.settle();
                runner.nothing_unasked(step.span)
            }
            Own::Read(id, data) => {
                let message = Message {
                    id: *id,
                    data: data.clone(),
                };
                let planner = Planner(Vec::new());
                let unsettled = |problem: Problem| Stop::failed(step.span, problem.message);
                let request = planner.send(0, &message).map_err(unsettled)?;
                let wanted = planner.receive(0, &message).map_err(unsettled)?;
                runner.transmit(0, &request);
                runner.expect(step.span, 0, &wanted, None)
            }
        }
    }

    fn transmit(link: &mut dyn Link, port: usize, frames: &[Frame]) -> Instant {
        link.send_octets(port, &frames.concat())
    }

    fn fetch(state: &mut Vec<u8>, link: &mut dyn Link, port: usize) -> Option<(Instant, Frame)> {
        loop {
            let (at, byte) = link.receive_octet(port)?;
            state.push(byte.byte);
            if let [a, b, c] = state[..] {
                state.clear();
                return Some((at, [a, b, c]));
            }
        }
    }

    fn matches(wanted: &Wanted, frame: Frame) -> bool {
        let mut pairs = wanted.iter().zip(frame);
        pairs.all(|(own, byte)| matches!(own, Expected::Any) || *own == Expected::Byte(byte))
    }

    fn describe([id, a, b]: &Wanted) -> String {
        format!("{id}#{a}{b}")
    }

    fn show([id, a, b]: Frame) -> String {
        format!("{id:02X}#{a:02X}{b:02X}")
    }

    fn write_header(header: &Vec<u8>) -> (Vec<(&'static str, String)>, Vec<String>) {
        let drives = header.iter().map(|station| format!("drive {station:X}"));
        (Vec::new(), drives.collect())
    }

    fn write_message(message: &Message) -> String {
        format!("{:03X} {}", message.id, message.data)
    }

    fn write_step(step: &Own) -> String {
        match step {
            Own::Quiet => "? quiet".to_owned(),
            Own::Read(register, data) => {
                let own = REGISTERS
                    .iter()
                    .find(|(_, own)| u16::from(*own) == *register);
                format!("read 1 {} = {data}", own.map_or("", |(name, _)| name))
            }
        }
    }
}

fn source(text: &str) -> Source {
    Source {
        name: "frames.scn".to_owned(),
        text: text.into(),
    }
}

/// The verdict, on something that gives back what it gets; and what was wrong.
fn played(text: &str) -> (Verdict, String) {
    let source = source(text);
    let scenario: Scenario<Frames> = parse(&source).expect("a scenario");
    let plan = plan(&scenario, &source, None).expect("a plan");
    let outcome = run(&plan, &mut *Frames::simulate(&plan));
    let message = outcome.finding.map_or(String::new(), |own| own.message);
    (outcome.verdict, message)
}

/// A header of the bus.
fn header() -> String {
    let name = Frames::BUS.name();
    format!("title   Frames\nsource  frames 5.4\nbus     {name}\ndrive 1\n\n")
}

#[test]
fn another_bus_is_read_settled_written_and_played() {
    let steps =
        "> 080 80 80\n+0.1ms..20ms < 080 80 xx\nfor k in 1..3\nread 1 SPEED_ACTUAL = 80 80\nend\n";
    let text = format!("{}{steps}wait 5ms\n", header());
    let scenario: Scenario<Frames> = parse(&source(&text)).expect("a scenario");
    assert_eq!(write(&scenario), text);
    assert_eq!(played(&text), (Verdict::Passed, String::new()));
}

#[test]
fn what_is_not_as_a_line_says_fails_in_the_words_of_the_bus() {
    let wrong = format!("{}> 080 80 80\n< 080 80 81\n", header());
    let message = "the master received 80#8080 where 80#8081 is expected";
    assert_eq!(played(&wrong), (Verdict::Failed, message.to_owned()));
    // Frames that no line asks for are a failure on this bus, also without `strict`.
    let (verdict, message) = played(&format!("{}> 080 80 80\n", header()));
    assert_eq!(verdict, Verdict::Failed);
    assert!(message.starts_with("80#8080 was received"), "{message}");
}

#[test]
fn its_mistakes_have_their_places() {
    let mistake = |steps: &str| {
        let source = source(&format!("{}{steps}\n", header()));
        let found = parse::<Frames>(&source).expect_err("a mistake");
        let first = found.all()[0].clone();
        let place = source.text[first.span.start..first.span.end].to_owned();
        (place, first.help.unwrap_or_default())
    };
    assert_eq!(mistake("> 20 3D 40").0, "20");
    let near = |word: &str| format!("did you mean `{word}`?");
    let found = mistake("read 1 SPEED_ACTUEL = 80 80");
    assert_eq!(found, ("SPEED_ACTUEL".to_owned(), near("SPEED_ACTUAL")));
    assert_eq!(
        mistake("raed 1 STATUS = 80"),
        ("raed".to_owned(), near("read"))
    );
}
