//! Scenarios one after another on slaves that are not switched off between them, as behind a port: no right slave is accused for what an earlier
//! one has left, and all is put back.

use super::super::RigSlave;
use super::super::player::{Player, RigScenario};
use super::super::talk::Talk;
use crate::gate::guarded;
use crate::safe_state::{last_words, safe_state};
use crate::simulate::{Bench, Setup, SlaveSetup};
use crate::stream::telegrams;
use harness_bench::guard::{Guarded, Standstill};
use harness_bench::link::{
    Capability, DriveFault, Line as _, Link as _, LinkEvent, Moment, Octets as _, PlacedFault,
    Recording, Sink,
};
use harness_bench::medium::Pieces;
use harness_bench::scenario::files;
use harness_bench::scenario::run::Outcome;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::nordac::guard::{GuardedSlave, Limits};
use harness_proto::nordac::parameter::Flag;
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, PARAMETERS, Parameter, PpoType};
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

const PATIENCE: Span = Span::from_millis(5);
const RATE: BusRate = BusRate::K500;

/// What no port can do.
const NOT_ON_PORT: [Capability; 3] = [Capability::Tap, Capability::Simulator, Capability::Power];

/// Slaves that go on living, and a player of scenarios on them.
struct Desk {
    line: Guarded<Bench>,
    slaves: Vec<RigSlave>,
    player: Player,
}

impl Desk {
    /// A slave at address 8 that is controlled as 1621 says, and others as delivered.
    fn new(interface: i64, others: &[u8], limits: Limits) -> Self {
        let mut first = SlaveSetup::new(8);
        let control = Parameter::of(1621).expect("a parameter");
        first
            .parameters
            .push((control, Index::default(), interface));
        let others = others.iter().map(|address| SlaveSetup::new(*address));
        let setup = Setup::new(RATE, std::iter::once(first).chain(others).collect());
        let slaves: Vec<_> = setup
            .slaves
            .iter()
            .map(|setup| RigSlave {
                address: setup.address,
                ppo: Some(PpoType::One),
            })
            .collect();
        let gated: Vec<GuardedSlave> = slaves.iter().copied().map(Into::into).collect();
        let can = Bench::CAPABILITIES.iter();
        let can = can.copied().filter(|can| !NOT_ON_PORT.contains(can));
        let can = can.collect();
        Self {
            line: guarded(Bench::new(&setup), limits, &gated, false),
            player: Player::of(slaves.clone(), RATE, PATIENCE, limits, can, false),
            slaves,
        }
    }

    /// Plays a scenario, takes the slaves to their safe state and puts them back. Returns what is left to say.
    fn play(&mut self, source: &Source) -> (Outcome, Vec<String>) {
        let scenario = Arc::new(RigScenario::read(source).expect("a scenario"));
        if let Some(skip) = self.player.not_begun(&scenario) {
            return (Outcome::skipped(skip), Vec::new());
        }
        self.line.reset_after_denial();
        let (outcome, _) = self.player.attempt(&scenario, &mut self.line);
        self.line.reset_after_denial();
        let safe = safe_state(
            &mut self.line,
            &self.slaves,
            PATIENCE,
            &Standstill::default(),
        );
        assert!(safe.confirmed, "{}: {safe}", source.name);
        let notes = self.player.put_back(&mut self.line, "desk.toml");
        (outcome, notes)
    }

    fn text(&mut self, text: &str) -> (Outcome, Vec<String>) {
        self.play(&source(text))
    }

    /// Where the slave is, and what its parameters hold.
    fn held(&self) -> (u8, Vec<(u16, u8, Option<i64>)>) {
        let inverter = self.line.inner().drive(8).expect("a drive").inverter();
        let all = PARAMETERS.iter().filter(|row| !row.has(Flag::ReadOnly));
        let all = all.flat_map(|parameter| {
            (0..4).map(move |set| {
                let index = Index { element: 0, set };
                (parameter.number, set, inverter.parameter(parameter, index))
            })
        });
        (inverter.settings().address, all.collect())
    }
}

fn source(text: &str) -> Source {
    Source::new("t.scn", format!("title T\nbus nordac\n{text}"))
}

fn verdict(played: &(Outcome, Vec<String>)) -> Verdict {
    assert_eq!(played.1, [] as [String; 0]);
    played.0.verdict
}

const BUS_CONTROL: &str = "slave 8\nslave 8 parameter 1621 = 2\nstart 8\non 8\n";
const LOCAL: &str =
    "slave 8\nslave 8 parameter 1621 = 4\nstart 8\nexchange 8 STW=047E -> ZSW=0970\n";
const DELIVERED: &str = "slave 8\nstart 8\nread 8 967 = 0006\n";

/// A slave that leaves the exchange while it is put back is taken into it again, whenever that happens.
#[test]
fn a_slave_that_leaves_meanwhile_is_put_back() {
    for after in (0..24).step_by(3) {
        let mut desk = Desk::new(0, &[], Limits::unlimited());
        let before = desk.held();
        let scenario = Arc::new(RigScenario::read(&source(LOCAL)).expect("a scenario"));
        let (outcome, _) = desk.player.attempt(&scenario, &mut desk.line);
        assert_eq!(outcome.verdict, Verdict::Passed);
        let at = desk.line.now() + Span::from_millis(after);
        for (at, fault) in [
            (at, DriveFault::Off),
            (at + Span::from_millis(2), DriveFault::On),
        ] {
            let fault = PlacedFault::Drive(8, fault);
            desk.line.inject(0, fault, Moment::At(at));
        }
        let notes = desk.player.put_back(&mut desk.line, "desk.toml");
        assert_eq!(notes, [] as [String; 0], "after {after} ms");
        assert_eq!(desk.held(), before, "after {after} ms");
    }
}

/// NORDAC 2.5.1, 3.2.1: an inverter that its terminals control goes on holding the word that came last while the bus controlled it. It is not
/// accused for that, and shows neither OFF2 nor OFF3 to the scenarios after it.
#[test]
fn a_word_of_an_earlier_scenario_accuses_no_slave() {
    let mut desk = Desk::new(0, &[], Limits::unlimited());
    let before = desk.held();
    assert_eq!(verdict(&desk.text(DELIVERED)), Verdict::Passed);
    assert_eq!(verdict(&desk.text(BUS_CONTROL)), Verdict::Passed);
    assert_eq!(verdict(&desk.text(LOCAL)), Verdict::Passed);
    let skipped = desk.text(DELIVERED);
    assert_eq!(verdict(&skipped), Verdict::Skipped);
    let why = format!("{:?}", skipped.0);
    assert!(why.contains("control word 0477 is in force (967)"), "{why}");
    assert_eq!(desk.held(), before);
}

/// NORDAC 2.5.1, 4.1.3: a slave is followed to another address, also to that of the factory settings, and put back.
#[test]
fn addresses_and_factory_settings_are_put_back() {
    let mut desk = Desk::new(2, &[9], Limits::unlimited());
    let before = desk.held();
    for steps in [
        "exchange 8 PKW=265800000000000A\nwait 5ms\n",
        "exchange 8 PKW=23CA000000000000\nwait 5ms\n",
        "exchange 8 PKW=2642000000000001\nwait 5ms\n",
        "exchange 8 PKW=2656000000000001\nwait 5ms\n",
        "write 8 1202 = 3s\nwrite 8 1205.3 = 40.0Hz\nwrite 8 1621 = 5\n",
    ] {
        let played = desk.text(&format!(
            "slave 8\nslave 8 parameter 1621 = 2\nstart 8\n{steps}"
        ));
        assert_ne!(played.0.verdict, Verdict::Skipped, "{steps} {:?}", played.0);
        assert_eq!(played.1, [] as [String; 0], "{steps}");
        assert_eq!(desk.held(), before, "{steps}");
    }
}

/// What could not be put back over the bus is not begun.
#[test]
fn what_cannot_be_put_back_is_not_begun() {
    for (others, steps, why) in [
        (vec![], "exchange 8 PKW=2656000000000002\n", "PPO type 3"),
        (
            vec![10],
            "exchange 8 PKW=265800000000000A\n",
            "another station of the rig",
        ),
        (
            vec![],
            "exchange 8 PKW=2658000000000002\n",
            "another station of the rig",
        ),
    ] {
        let mut desk = Desk::new(2, &others, Limits::unlimited());
        let played = desk.text(&format!(
            "slave 8\nslave 8 parameter 1621 = 2\nstart 8\n{steps}"
        ));
        assert_eq!(verdict(&played), Verdict::Skipped, "{steps}");
        let said = format!("{:?}", played.0);
        assert!(said.contains(why), "{said}");
    }
}

/// What is denied is printed with the command that does it.
#[test]
fn what_is_not_put_back_is_told_with_its_command() {
    let limits = Limits {
        most_writes: Some(1),
        ..Limits::unlimited()
    };
    let mut desk = Desk::new(2, &[], limits);
    let text = "slave 8\nslave 8 parameter 1621 = 2\nstart 8\nwrite 8 1600 = 3\n";
    let (outcome, notes) = desk.text(text);
    assert_eq!(outcome.verdict, Verdict::Passed);
    let [note] = &notes[..] else {
        panic!("{notes:?}")
    };
    let command = "`drivebench write 8 \"1600=0\" --rig desk.toml`";
    assert!(note.contains(command), "{note}");
}

/// A program that ends in the middle of a scenario: the way back of what it has changed by then was foretold, and the last words switch the output
/// off at the address and with the PPO type that the slave has then (NORDAC 2.6, 4.1.3).
#[test]
fn what_does_not_end_has_foretold_what_it_changes() {
    for (task, (address, ppo), says) in [
        (
            "265800000000000A",
            (10, PpoType::One),
            "slave 8 may be at address 10 (1624): with `address = 10`",
        ),
        (
            "2656000000000001",
            (8, PpoType::Two),
            "`drivebench write 8 \"1622=0\" ",
        ),
    ] {
        let text = format!(
            "title T\nbus nordac\nslave 8\nslave 8 parameter 1621 = 2\nstart 8\nexchange 8 PKW={task}\nwait 5ms\n"
        );
        let scenario = RigScenario::read(&Source::new("t.scn", text));
        let scenario = Arc::new(scenario.expect("a scenario"));
        let broken_off = |after| {
            let mut desk = Desk::new(2, &[], Limits::unlimited());
            let mut sink = Panics(after);
            let mut recording = Recording::new(&mut desk.line, &mut sink);
            let player = &mut desk.player;
            let play = AssertUnwindSafe(|| player.attempt(&scenario, &mut recording));
            let played = catch_unwind(play);
            let whole = played.is_ok();
            (desk, whole, sink.0)
        };
        let (_, whole, left) = broken_off(usize::MAX);
        assert!(whole);
        let (mut desk, whole, _) = broken_off(usize::MAX - left);
        assert!(!whole);
        let said = desk.player.left.all().join("\n");
        assert!(said.contains(says), "{said}");
        let on = |line: &Bench| {
            let drive = line.drive(8).expect("a drive");
            drive.inverter().state().output_on()
        };
        let last = Pieces::Octets(last_words(&desk.slaves).concat());
        let pieces = [Some(last), desk.player.left.stops()].into_iter().flatten();
        // Past the gate, as a watchdog sends them.
        let line = desk.line.inner_mut();
        let pass = |line: &mut Bench, span| {
            let end = line.now() + span;
            while line.now() < end && line.wait(end) {}
        };
        // The module restarts, and the rest of the scenario turns the motor.
        pass(line, PATIENCE * 4);
        let mut talk = Talk::new(Box::new(&mut *line), PATIENCE);
        talk.start(address, ppo, None).expect("starts");
        for word in [stw::READY, stw::START] {
            let words = [word, 0x2000, 0, 0, 0, 0];
            let image = Image {
                words,
                ..Image::default()
            };
            talk.exchange(address, ppo, &image).expect("answers");
        }
        drop(talk);
        assert!(on(line), "{task}");
        for telegram in pieces.flat_map(|pieces| telegrams(&pieces)) {
            line.send_octets(0, &telegram);
            pass(line, PATIENCE);
        }
        assert!(!on(line), "{task}");
    }
}

/// Panics after some events.
struct Panics(usize);

impl Sink for Panics {
    fn take(&mut self, _: &LinkEvent) {
        self.0 -= 1;
        assert_ne!(self.0, 0, "as the test wants it");
    }
}

/// NORDAC 5.7: earlier faults stay in the fault memory, and a scenario that would show them is not met.
#[test]
fn earlier_faults_accuse_no_slave() {
    let mut desk = Desk::new(2, &[], Limits::unlimited());
    let counts = "slave 8\nslave 8 parameter 1621 = 2\nstart 8\nread 8 1806.9 = 0\n";
    let faults = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 parameter 1625 = 1s\nstart 8\nexchange 8 STW=047E\nwait 1100ms\nread 8 1800 = 10\n";
    assert_eq!(verdict(&desk.text(counts)), Verdict::Passed);
    assert_eq!(verdict(&desk.text(faults)), Verdict::Passed);
    assert_eq!(verdict(&desk.text(faults)), Verdict::Passed);
    let skipped = desk.text(counts);
    assert_eq!(verdict(&skipped), Verdict::Skipped);
    let why = format!("{:?}", skipped.0);
    assert!(why.contains("fault 10 was its last one (947)"), "{why}");
}

/// NORDAC 2.5.1, 5.7: where the computer stood still between two scenarios, the time-out comes while the slave is made ready for the second one,
/// which its fault memory shows then.
#[test]
fn a_time_out_that_comes_meanwhile_accuses_no_slave() {
    let armed = "slave 8\nslave 8 parameter 1621 = 2\nstart 8\nexchange 8 STW=047E\n";
    let counts = "slave 8\nslave 8 parameter 1621 = 2\nslave 8 parameter 1625 = 1s\nstart 8\nexchange 8 STW=047E\nwait 1100ms\n\
                  read 8 1806.9 = 1\n";
    for (paused, expected) in [(0, Verdict::Passed), (2_000, Verdict::Skipped)] {
        let mut desk = Desk::new(0, &[], Limits::unlimited());
        assert_eq!(verdict(&desk.text(armed)), Verdict::Passed);
        let until = desk.line.now() + Span::from_millis(paused);
        desk.line.wait(until);
        let played = desk.text(counts);
        assert_eq!(verdict(&played), expected, "{paused} ms: {:?}", played.0);
    }
}

/// All scenarios of this bus, one after another on inverters that are not switched off.
#[test]
#[ignore = "takes some minutes; .ci/nightly runs it"]
fn all_scenarios_accuse_no_slave_and_leave_nothing() {
    for interface in [0, 2] {
        let mut desk = Desk::new(interface, &[], Limits::unlimited());
        let before = desk.held();
        let mut passed = 0;
        for name in files::names() {
            if !name.contains("nordac") {
                continue;
            }
            let sources = files::sources(&[name.clone().into()]).expect("built in");
            for source in sources {
                let (outcome, notes) = desk.play(&source);
                let failed = outcome.verdict == Verdict::Failed;
                assert!(!failed, "{interface} {name}: {outcome:?}");
                assert_eq!(notes, [] as [String; 0], "{interface} {name}");
                assert_eq!(desk.held(), before, "{interface} {name}");
                passed += usize::from(outcome.verdict == Verdict::Passed);
            }
        }
        assert!(passed > 100, "{passed}");
    }
}
