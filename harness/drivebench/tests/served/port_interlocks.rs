//! Interlocks on rigs with a port: one that trips while a motor turns ends the work, with the drives in their safe state.

use crate::program::{ended, said};
use crate::{drives_on_can, inverters_on_line};
use std::path::Path;

/// Adds to a rig's file.
fn add(rig: &Path, more: &str) {
    let text = std::fs::read_to_string(rig).expect("a rig");
    std::fs::write(rig, text + more).expect("room");
}

const SPEED: &str = "[[interlock]]\ndrive = 1\nregister = \"SPEED_ACTUAL\"\nmin = \"-20%\"\nmax = \"20%\"\nevery = \"50ms\"\n\
                     message = \"the belt comes off\"\n";

const TRIPPED: &str = "interlock on SPEED_ACTUAL of drive 1 (the belt comes off): ";

/// A scenario with a speed command in it.
fn faster(command: &str) -> String {
    format!(
        "title faster\nsource unitek ex 3\nbus unitek\ndrive 1\n\n> 201 31 {command}\nwait 2s\n> 201 3D 31 00\n\
         < 181 31 {command} xx\n"
    )
}

/// The same with a cycle of the register that the interlock is on.
const SENT_BY_ITSELF: &str = "title cycle\nsource unitek ex 8\nbus unitek\ndrive 1\n\n> 201 3D 30 64\n> 201 31 00 40\nfor k in 1..20\n\
                              < 181 30 xx xx xx\nend\n> 201 3D 30 FF\n";

#[test]
fn a_drive_on_can_that_turns_too_fast_is_stopped() {
    let desk = drives_on_can::Desk::new("slcan", "allow_motion = true\n");
    add(&desk.path("desk.toml"), SPEED);
    let run = |text: &str, more: &str| {
        std::fs::write(desk.path("faster.scn"), text).expect("room");
        desk.run(&format!("run faster.scn --allow-motion{more}"))
    };
    ended(&run(&faster("CD 0C"), " --evidence slow"), 0, "1 passed");
    let verify = desk.command("verify slow").output().expect("the program");
    ended(&verify, 0, "0 things wrong");
    let fast = run(&faster("00 40"), " --evidence kept --junit kept.xml");
    ended(&fast, 6, TRIPPED);
    ended(&fast, 6, "at least -20% and at most 20% is required");
    ended(&fast, 6, drives_on_can::SAFE);
    desk.shows("read 1 SPEED_CMD MODE", "0000");
    // The record has the trip, and shows the same verdict again.
    let verify = desk.command("verify kept").output().expect("the program");
    ended(&verify, 0, "0 things wrong");
    let junit = std::fs::read_to_string(desk.path("kept.xml")).expect("a report");
    assert!(junit.contains("the belt comes off"), "{junit}");
}

/// A drive that sends the register by itself is not asked for it: its own frames are compared. Commands are watched as well.
#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn a_drive_on_can_that_turns_too_fast_by_itself_is_stopped() {
    let desk = drives_on_can::Desk::new("slcan", "allow_motion = true\n");
    add(&desk.path("desk.toml"), SPEED);
    std::fs::write(desk.path("cycle.scn"), SENT_BY_ITSELF).expect("room");
    let cycle = desk.run("run cycle.scn --allow-motion");
    ended(&cycle, 6, TRIPPED);
    ended(&cycle, 6, drives_on_can::SAFE);
    let position = desk.run("position 1 --by 3000turns --move");
    ended(&position, 6, TRIPPED);
    ended(&position, 6, drives_on_can::SAFE);
}

/// What is not as it must be lets nothing begin; what cannot be read is an error of the bench.
#[test]
fn a_drive_on_can_that_is_not_ready_is_not_used() {
    let enable =
        "[[interlock]]\ndrive = 2\nregister = \"LOGIC_READ_BI\"\nbit = \"{}\"\nlevel = \"{}\"\n";
    let desk = drives_on_can::Desk::of(
        "slcan",
        "allow_motion = true\n",
        "drive 1\ndrive 2\ndrive 2 input run low\n",
    );
    let rig = desk.path("desk.toml");
    add(
        &rig,
        &enable.replacen("{}", "FRG", 1).replacen("{}", "high", 1),
    );
    for line in [
        "read 1 MODE",
        "go 1 --move --hold",
        "run --filter unitek-ex-3",
    ] {
        let output = desk.run(line);
        ended(
            &output,
            6,
            "interlock on LOGIC_READ_BI of drive 2: FRG is 0",
        );
        ended(&output, 6, drives_on_can::SAFE);
    }
    let fuzz = desk.run("fuzz run --wire-time 2s --allow-motion --out run");
    ended(&fuzz, 6, "FRG is 0");
    let check = desk.command("rig check desk.toml").output();
    let check = check.expect("the program");
    ended(&check, 6, "FRG is 0");
    ended(&check, 6, drives_on_can::SAFE);
}

/// What cannot be read is an error of the bench; a drive that does not answer cannot be seen in its safe state either.
#[test]
fn an_interlock_that_cannot_be_read_is_an_error_of_the_bench() {
    let desk = drives_on_can::Desk::of("slcan", "allow_motion = true\n", "drive 1\n");
    let rig = desk.path("desk.toml");
    let text = std::fs::read_to_string(&rig).expect("a rig");
    let text = text.replace("\"2s\"", "\"200ms\"");
    let text = text.replace("node = 2", "node = 5") + "[health]\nbefore = false\n";
    std::fs::write(&rig, text + &SPEED.replace("drive = 1", "drive = 5")).expect("room");
    let output = desk.run("read 1 MODE");
    ended(&output, 7, "interlock on SPEED_ACTUAL of drive 5");
    ended(&output, 7, "cannot be read: the drive does not answer");
    let setup = "slave 8 ppo 4\nslave 8 parameter 1621 = 2\n";
    let desk = inverters_on_line::Desk::of("tcp", "", setup);
    add(
        &desk.path("desk.toml"),
        "[[interlock]]\ndrive = 8\nparameter = \"1202\"\nmax = \"9s\"\n",
    );
    let output = desk.run("info 8 --rig desk.toml");
    ended(
        &output,
        3,
        "interlock on 1202 Accel. time of drive 8 cannot be read: ",
    );
    ended(&output, 3, "no parameter channel");
}

const NEVER: &str = "[[interlock]]\ndrive = 8\nparameter = \"HIW\"\nmin = \"90%\"\nmax = \"95%\"\n";

const FREQUENCY: &str = "[[interlock]]\ndrive = 8\nparameter = \"HIW\"\nmax = \"30%\"\nmessage = \"the belt comes off\"\n";

#[test]
fn an_inverter_that_turns_too_fast_is_stopped() {
    is_stopped("tcp");
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn an_inverter_on_a_pty_that_turns_too_fast_is_stopped() {
    is_stopped("pty");
}

fn is_stopped(way: &str) {
    let desk = inverters_on_line::Desk::new(way, "");
    add(&desk.path("desk.toml"), FREQUENCY);
    let exchange = |setpoint: &str| {
        desk.run(&format!(
            "exchange 8 STW=047E then STW=047F HSW={setpoint} --for 6s --move --rig desk.toml"
        ))
    };
    ended(&exchange("20%"), 0, "HIW 0CCD");
    let fast = exchange("60%");
    let words = "interlock on HIW of drive 8 (the belt comes off): ";
    ended(&fast, 6, words);
    ended(&fast, 6, "was read, at most 30% is required");
    ended(&fast, 6, inverters_on_line::SAFE);
    // The same in the middle of a scenario.
    let scenario = "title faster\nsource nordac 3.2.3\nbus nordac\nslave 8\nslave 8 parameter 1621 = 2\n\nstart 8 ppo 1\non 8\n\
                    for k in 1..40\nexchange 8 STW=047F HSW=60%\nwait 100ms\nend\n";
    std::fs::write(desk.path("faster.scn"), scenario).expect("room");
    let run = desk.run("run faster.scn --allow-motion --rig desk.toml --evidence kept");
    ended(&run, 6, words);
    ended(&run, 6, inverters_on_line::SAFE);
    ended(&desk.run("verify kept"), 0, "0 things wrong");
    // No value is as low as this; what only looks at the bench ends it in its safe state, too.
    add(&desk.path("desk.toml"), NEVER);
    let check = desk.run("rig check desk.toml");
    ended(&check, 6, "interlock on HIW of drive 8");
    ended(&check, 6, inverters_on_line::SAFE);
}

/// Parameters are read over the parameter channel, the status word in every exchange.
#[test]
fn a_parameter_of_an_inverter_is_watched() {
    let desk = inverters_on_line::Desk::new("tcp", "");
    let rig = desk.path("desk.toml");
    let plain = std::fs::read_to_string(&rig).expect("a rig");
    let word = "[[interlock]]\ndrive = 8\nparameter = \"Control word\"\nmax = \"1150\"\nevery = \"50ms\"\n";
    add(&rig, word);
    ended(&desk.run("read 8 1202 --rig desk.toml"), 0, "5.00 s");
    let on = desk.run("on 8 --setpoint 20% --for 6s --move --rig desk.toml");
    ended(
        &on,
        6,
        "interlock on 967 Control word of drive 8: 1151 was read",
    );
    ended(&on, 6, inverters_on_line::SAFE);
    let local =
        "[[interlock]]\ndrive = 8\nparameter = \"ZSW\"\nbit = \"warning\"\nlevel = \"high\"\n";
    std::fs::write(&rig, plain + local).expect("room");
    let read = desk.run("read 8 1202 --rig desk.toml");
    ended(&read, 6, "interlock on ZSW of drive 8: warning is 0");
    assert!(
        said(&read).contains(inverters_on_line::SAFE),
        "{}",
        said(&read)
    );
}

/// The longest run that the rig's file allows ends like an interlock that trips: a scenario in the middle of a wait, and words that are held.
#[test]
fn the_longest_run_is_over() {
    let over = "`max_run` of the rig's file is over";
    let limit = "max_run = \"1s\"\n";
    let desk = drives_on_can::Desk::new("slcan", "allow_motion = true\n");
    add(&desk.path("desk.toml"), limit);
    let wait = "title long\nsource unitek ex 3\nbus unitek\ndrive 1\n\n> 201 31 CD 0C\nwait 600s\n";
    std::fs::write(desk.path("long.scn"), wait).expect("room");
    let run = desk.run("run long.scn --allow-motion");
    ended(&run, 6, over);
    ended(&run, 6, drives_on_can::SAFE);
    let desk = inverters_on_line::Desk::new("tcp", "");
    add(&desk.path("desk.toml"), limit);
    let held = "exchange 8 STW=047E then STW=047F HSW=20% --hold --move --rig desk.toml";
    let held = desk.run(held);
    ended(&held, 6, over);
    ended(&held, 6, inverters_on_line::SAFE);
}
