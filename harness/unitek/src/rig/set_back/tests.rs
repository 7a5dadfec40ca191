//! Drives are as they were found, whatever a scenario or a probe has done, and however it ended.

use super::super::player::Player;
use crate::BUSES;
use crate::simulate::Bench;
use harness_bench::link::{FrameFault, Line as _, Link as _, LinkEvent, Moment, PlacedFault, Sink};
use harness_bench::rig::playing::RigRun as _;
use harness_bench::rig::playing::run::{PortPlayer as _, PortRun};
use harness_bench::rig::port_file::CONFIRMATION;
use harness_bench::rig::{Attempt, Keeper, UseOptions, parse};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::Span;
use harness_proto::unitek::words::ERROR_TIME_OUT;
use harness_proto::unitek::{Access, REGISTERS};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Registers that commands change, and those of a position, which a motor that has turned does not get back.
const NOT_COMPARED: [u8; 6] = [0x31, 0x51, 0x6E, 0x90, 0x7A, 0x80];

const ALL: &str = "allow_motion = true\nallow_eeprom = true\nallow_bus_settings = true\n";

/// A qualification of two simulated drives, of which some are set up by header lines.
fn bench(limits: &str, setup: &[&str], qualifies: bool) -> (PortRun<Player>, Arc<AtomicBool>) {
    let limits = format!("{limits}store_bus_settings = \"{CONFIRMATION}\"\n");
    bench_within(&limits, setup, qualifies)
}

fn bench_within(
    limits: &str,
    setup: &[&str],
    qualifies: bool,
) -> (PortRun<Player>, Arc<AtomicBool>) {
    let text = format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"unitek\"\ndrives = [{{ node = 1 }}, {{ node = 2 }}]\n\
         [sim]\nbus = \"unitek\"\nsetup = {setup:?}\n[limits]\n{limits}"
    );
    let rig = parse(&source("desk.toml", &text), &BUSES).expect("a rig's file");
    let interrupt = Arc::new(AtomicBool::new(false));
    let options = UseOptions {
        allow_motion: true,
        ill_as_well: qualifies,
        interrupt: Arc::clone(&interrupt),
        ..UseOptions::default()
    };
    let run = PortRun::open(&rig, &options).expect("simulated drives");
    (run, interrupt)
}

fn source(name: &str, text: &str) -> Source {
    Source::new(name, text)
}

fn play(run: &mut PortRun<Player>, text: &str) -> Verdict {
    let source = source("own", &format!("title own\nbus unitek\ndrive 1\n{text}"));
    run.play(&source, None).expect("a rig").outcome.verdict
}

fn simulated(run: &PortRun<Player>) -> &Bench {
    let beside = run.session().guarded().inner().beside();
    beside
        .and_then(|bench| bench.downcast_ref())
        .expect("simulated drives")
}

/// What the registers of both drives hold that can be written, and the errors of both.
fn state(run: &PortRun<Player>) -> Vec<(u8, u8, u32)> {
    let bench = simulated(run);
    let written = REGISTERS
        .iter()
        .filter(|register| matches!(register.access, Access::RW | Access::SP));
    let compared = written.filter(|register| !NOT_COMPARED.contains(&register.number));
    let all = compared.map(|register| register.number).chain([0x8F]);
    let of_both = all.flat_map(|register| [1, 2].map(|node| (node, register)));
    let read = |(node, register)| {
        let drive = bench.drive(node).expect("a drive");
        (node, register, drive.register(register))
    };
    of_both.map(read).collect()
}

/// A conversation that moves both drives, and leaves all that it writes.
const LEAVES: &str = "
> 201 68 7E 02
> 27E D4 44 33 22 11
> 27E 35 E8 03 64 00
> 27E 69 01 01
> 27E DC 30 01
> 202 88 7D 02 00 00
> 202 68 7C 02
> 27C D0 05 00
wait 50ms
> 27C 73 25 41
";

/// Both drives are left as they were found, whichever frame is lost, and also those on the way back.
#[test]
fn what_a_scenario_leaves_is_set_back_whichever_frame_is_lost() {
    let limits = format!("{ALL}bit_rate_way_back = \"by hand\"\n");
    let (mut run, _) = bench(&limits, &[], false);
    assert_eq!(play(&mut run, "read 1 1B = 01D8"), Verdict::Passed);
    let before = state(&run);
    let first = simulated(&run).frames();
    assert_eq!(play(&mut run, LEAVES), Verdict::Passed);
    assert_eq!(state(&run), before);
    let frames = simulated(&run).frames() - first;
    for lost in (1..frames).step_by(7) {
        let fault = PlacedFault::Frame(FrameFault::Lost);
        let number = simulated(&run).frames() + lost;
        run.session_mut()
            .link()
            .inject(0, fault, Moment::Byte(number));
        let _any = play(&mut run, LEAVES);
        assert_eq!(state(&run), before, "frame {lost}");
        assert_eq!(run.over(), None, "frame {lost}");
        // A fault that was not used is not left for the next conversation.
        let rest = number.saturating_sub(simulated(&run).frames());
        for _ in 0..rest {
            assert_eq!(play(&mut run, "read 1 1B"), Verdict::Passed);
        }
    }
}

/// The time-out that a scenario has caused is cleared (8F bit 3), and the next scenarios are played. Without permission to do so, the
/// command is said.
#[test]
fn a_time_out_of_the_bus_does_not_stay() {
    let ends_in_time_out = "
> 201 D0 14 00
wait 50ms
> 201 3D 8F 00
< 181 8F 08 00 xx";
    let (mut run, _) = bench(ALL, &[], false);
    assert_eq!(play(&mut run, ends_in_time_out), Verdict::Passed);
    assert_eq!(run.notes(), Vec::<String>::new());
    assert_eq!(
        play(&mut run, "read 1 8F = 0000\nread 1 D0 = 0000"),
        Verdict::Passed
    );
    let (mut run, _) = bench("allow_bus_settings = true\n", &[], false);
    assert_eq!(play(&mut run, ends_in_time_out), Verdict::Passed);
    let notes = run.notes().join("\n");
    let words = "drive 1: BUS-TIMEOUT was not there before: 201#8E444D is not sent";
    assert!(notes.starts_with(words), "{notes}");
    assert!(
        notes.contains("`drivebench delete-error 1 --move --rig desk.toml`"),
        "{notes}"
    );
    let errors = simulated(&run).drive(1).expect("a drive").register(0x8F);
    assert_eq!(errors, ERROR_TIME_OUT);
}

/// UNITEK 3.1, ex 7: 84 would store a new identifier, and stores none once it was set back.
#[test]
fn parameters_are_stored_behind_identifiers_that_were_set_back() {
    let (mut run, _) = bench_within(ALL, &[], false);
    let moves = "> 201 51 04 00\n> 201 69 90 01\n> 201 3D 1B 00\n< 190 1B xx xx xx\n";
    let stores = "> 201 51 04 00\n> 201 84 01 00\nread 1 51 = 0004\n";
    assert_eq!(
        play(&mut run, &format!("{moves}> 201 84 01 00\n")),
        Verdict::Skipped
    );
    assert_eq!(play(&mut run, moves), Verdict::Passed);
    assert_eq!(play(&mut run, stores), Verdict::Passed);
}

/// An error that was there before is not cleared: it is no trace of the run.
#[test]
fn an_error_that_was_there_before_stays() {
    let (mut run, _) = bench(ALL, &["drive 1 force errors = 2"], false);
    let before = state(&run);
    assert_eq!(play(&mut run, "read 1 8F = 0002"), Verdict::Passed);
    assert_eq!(state(&run), before);
    assert_eq!(run.notes(), Vec::<String>::new());
}

/// The note about the EEPROM names the drive and the level, and no other drive (ex 7).
#[test]
fn what_was_stored_is_said_of_the_drive_that_stored_it() {
    let (mut run, _) = bench(ALL, &[], false);
    let stores = "
> 201 68 10 02
> 210 D4 44 33 22 11
> 210 84 01 00
wait 1ms
> 210 83 01 00";
    assert_eq!(play(&mut run, stores), Verdict::Passed);
    let notes = run.notes();
    assert_eq!(
        notes,
        [
            "drive 1: level 1 of its EEPROM keeps what the scenario stored; its registers are set back, and `drivebench write 1 0x84=0x0001 \
          --rig desk.toml` stores them there"
        ]
    );
}

/// What a probe has changed is set back where it is interrupted.
#[test]
fn an_interrupted_probe_is_undone() {
    let (run, _) = bench(ALL, &[], true);
    let before = state(&run);
    let text = "title own\nbus unitek\ndrive 1\nread 1 1B";
    let (mut run, interrupt) = bench(ALL, &[], true);
    let mut keeper = Interrupts(interrupt, usize::MAX);
    let played = run.play(&source("own", text), Some(&mut keeper));
    assert_eq!(played.expect("a rig").outcome.verdict, Verdict::Passed);
    let events = usize::MAX - keeper.1;
    let mut changed = 0;
    for after in (1..events).step_by(events / 60) {
        let (mut run, interrupt) = bench(ALL, &[], true);
        let mut keeper = Interrupts(Arc::clone(&interrupt), after);
        let played = run.play(&source("own", text), Some(&mut keeper));
        assert_eq!(played.expect("a rig").outcome.verdict, Verdict::Aborted);
        interrupt.store(false, Ordering::Relaxed);
        changed += usize::from(state(&run) != before);
        assert!(run.clear_up().is_ok(), "event {after} of {events}");
        assert_eq!(state(&run), before, "event {after} of {events}");
    }
    assert_ne!(changed, 0, "no interrupt came while a register was changed");
}

/// A program that ends in the middle of a scenario or of a probe, by a panic or without a word: what it has changed by then was foretold with the
/// way back, and the last words lock both drives where they are (UNITEK 3.1, 4.5). Behind a panic they stand in their safe state, at the
/// identifiers of the rig's file.
#[test]
fn what_does_not_end_has_foretold_what_it_changes() {
    let limits = format!("{ALL}bit_rate_way_back = \"by hand\"\n");
    let moves = format!("drive 2\n{LEAVES}");
    for (qualifies, text, least) in [(false, &moves[..], 8), (true, "read 1 1B", 0)] {
        let (mut run, _) = bench(&limits, &[], qualifies);
        let before = state(&run);
        let source = source("own", &format!("title own\nbus unitek\ndrive 1\n{text}"));
        let mut all = Panics(usize::MAX);
        let played = run.play(&source, Some(&mut all));
        assert_eq!(played.expect("a rig").outcome.verdict, Verdict::Passed);
        assert_eq!(run.session().left().all(), [] as [String; 0]);
        let events = usize::MAX - all.0;
        let points = (events - 12..=events).chain((1..events).step_by(events / 60));
        let (mut moved, mut changed) = (0, 0);
        for after in points {
            let panics = after % 2 == 0;
            let (mut run, _) = bench(&limits, &[], qualifies);
            let mut keeper = Panics(after);
            let play = || run.play(&source, Some(&mut keeper)).is_ok();
            assert!(catch_unwind(AssertUnwindSafe(play)).is_err());
            pass(&mut run);
            let said = run.session().left().all().join("\n");
            for ((node, register, reads), (.., held)) in state(&run).into_iter().zip(&before) {
                let way = match register {
                    0x8F => format!("`drivebench delete-error {node} "),
                    _ => format!(" 0x{register:02X}=0x"),
                };
                let start = format!("drive {node}");
                let mut lines = said.lines().filter(|line| line.starts_with(&start));
                let foretold = reads == *held || lines.any(|line| line.contains(&way));
                assert!(foretold, "{node} {register:02X} {said}");
                let elsewhere = register == 0x68 && reads != *held;
                let place = format!(" or {reads:03X}");
                assert!(!elsewhere || said.contains(&place), "{place}: {said}");
                moved += usize::from(elsewhere);
                changed += usize::from(reads != *held);
            }
            if panics {
                let said = run.session_mut().abandon_as_at_port().join("\n");
                let safe = said.starts_with("safe state: every drive is locked");
                assert!(safe, "{said}");
            } else {
                for pieces in run.session().last_words()(0) {
                    run.session_mut().link().send(0, pieces.as_out());
                }
                pass(&mut run);
            }
            for node in [1, 2] {
                let drive = simulated(&run).drive(node).expect("a drive");
                assert_eq!(drive.register(0x51), 4, "{after} of {events}: {said}");
                let back = drive.register(0x68) == 0x200 + u32::from(node);
                assert!(!panics || back, "{after} of {events}");
            }
        }
        assert!(moved >= least && changed > 0, "{moved} {changed}");
    }
}

/// What was sent arrives.
fn pass(run: &mut PortRun<Player>) {
    let link = run.session_mut().link();
    link.reset_after_denial();
    let end = link.now() + Span::from_millis(20);
    while link.now() < end && link.wait(end) {}
}

/// Panics after some events.
struct Panics(usize);

impl Sink for Panics {
    fn take(&mut self, _: &LinkEvent) {
        self.0 -= 1;
        assert_ne!(self.0, 0, "as the test wants it");
    }
}

impl Keeper for Panics {
    fn begins(&mut self, _: usize) {}

    fn ends(&mut self, _: usize, _: &Attempt) {}
}

/// Interrupts a run after some events.
struct Interrupts(Arc<AtomicBool>, usize);

impl Sink for Interrupts {
    fn take(&mut self, _: &LinkEvent) {
        self.1 = self.1.saturating_sub(1);
        if self.1 == 0 {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

impl Keeper for Interrupts {
    fn begins(&mut self, _: usize) {}

    fn ends(&mut self, _: usize, _: &Attempt) {}
}

/// The conversations that change identifiers are played with both drives, which are judged right and left where they were (UNITEK 3.1, ex 1).
#[test]
fn two_drives_are_qualified_one_after_the_other() {
    for property in ["immediate", "restart"] {
        let setup = format!("drive 1 property id-change = {property}");
        let (mut run, _) = bench(ALL, &[&setup], true);
        let before = state(&run);
        let moving = Player::conversations(run.session().rig()).into_iter();
        for source in moving.filter(|source| source.name.contains("write-identifier")) {
            let played = run.play(&source, None).expect("a rig");
            assert_ne!(played.outcome.verdict, Verdict::Skipped, "{}", source.name);
            assert_eq!(run.over(), None, "{}", source.name);
            assert_eq!(state(&run), before, "{}", source.name);
        }
        assert_eq!(run.notes(), Vec::<String>::new());
    }
}

/// A drive whose time-out nothing clears is not passed: the probe that has provoked it accuses the drive.
#[test]
fn a_time_out_that_nothing_clears_accuses_the_drive() {
    let (mut run, _) = bench(ALL, &["drive 1 deviates errors-stay"], true);
    let source = source("own", "title own\nbus unitek\ndrive 1\nread 1 1B");
    let played = run.play(&source, None).expect("a rig");
    assert_eq!(played.outcome.verdict, Verdict::Inconclusive);
    let remarks = played.outcome.remarks.join("\n");
    assert!(
        remarks.contains("drive 1: its BUS-TIMEOUT stays"),
        "{remarks}"
    );
    let notes = run.notes().join("\n");
    let words = "drive 1: BUS-TIMEOUT was not there before: 8E does not clear it; `drivebench write 1 MODE=0x0004 MODE=0x0000 --move";
    assert!(notes.contains(words), "{notes}");
}

/// A drive that uses a new bit rate at once is lost: the report says where it may be, and what its registers held.
#[test]
fn a_drive_that_is_lost_is_reported_with_what_it_held() {
    let limits = format!("{ALL}bit_rate_way_back = \"a second adapter\"\n");
    let (mut run, _) = bench(
        &limits,
        &["drive 1 property rate-change = immediate"],
        false,
    );
    let text = "
> 201 D4 44 33 22 11
> 201 73 5C 40";
    assert_eq!(play(&mut run, text), Verdict::Passed);
    let over = run.over().unwrap_or_default();
    assert!(over.contains("it may be at 250 kbit/s"), "{over}");
    let end = Box::new(run).close(true);
    let words = "drive 1: registers may be left changed; `drivebench write 1 ";
    let remark = end.remarks.iter().find(|remark| remark.starts_with(words));
    let remark = remark.unwrap_or_else(|| panic!("{:?}", end.remarks));
    assert!(remark.contains("0x73=0x4025 "), "{remark}");
    assert!(
        remark.contains("0xD4=0x00000000 --move --rig desk.toml` sets them back"),
        "{remark}"
    );
}
