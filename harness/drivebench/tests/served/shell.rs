//! `drivebench shell` as people use it: at a terminal.

use crate::program::Desk;
use crate::ring::Served;
use crate::session::at;
use crate::top::terminal::in_session;
use crate::top::tty::Tty;
use rustix::process::{Pid, Signal, kill_process};
use std::path::Path;

fn shell(arguments: &[&str]) -> Tty {
    let program = Path::new(env!("CARGO_BIN_EXE_drivebench"));
    Tty::start(in_session(program, &[&["shell"], arguments].concat()))
}

/// The shell in a terminal, at a rig that another process serves.
fn at_desk(desk: &Desk) -> Tty {
    let program = Path::new(env!("CARGO_BIN_EXE_drivebench"));
    let mut command = in_session(program, &["shell", "--rig", "desk.toml", "--move"]);
    command
        .current_dir(desk.path(""))
        .env("DRIVEBENCH_STATE", desk.path("state"));
    Tty::start(command)
}

/// Waits for words, which stand behind those that were seen before.
#[track_caller]
fn says(tty: &Tty, words: &str) {
    tty.see(words, |seen| seen.first.contains(words));
}

/// Waits for the prompt: before it, Ctrl-D is no end.
#[track_caller]
fn asks(tty: &Tty) {
    tty.see("a prompt", |seen| seen.first.trim_end().ends_with('>'));
}

fn signal(tty: &Tty, signal: Signal) {
    kill_process(Pid::from_child(&tty.child), signal).expect("a process");
}

#[test]
fn people_type_complete_and_stop() {
    let mut tty = shell(&["--rig", "sim:3", "--move"]);
    says(&tty, "sim:3> ");
    tty.keys("read 0 nsollr\t\r");
    says(&tty, "nsollrampe");
    tty.keys("raed 0 nist\r");
    says(&tty, "did you mean `read`?");
    // The prompt shows who moves, and Ctrl-C stops it and stays.
    tty.keys("write 0 nsoll=100rpm\r");
    says(&tty, "nsoll: 0000 (0 rpm)");
    tty.keys("wait 500ms\r");
    says(&tty, "sim:3 (0: 99.9 rpm)> ");
    tty.keys("\x03");
    says(&tty, "drive 0 is in stop");
    // What was typed three lines ago comes back by a key.
    tty.keys("\x1b[A\x1b[A\x1b[A\r");
    tty.see("the mistake again", |seen| {
        seen.first.matches("did you mean `read`?").count() == 2
    });
    // Lines that come at once, as from a clipboard, are obeyed one behind the other.
    tty.keys("fault 2->1: flip 0\rread 1 nist\r");
    says(&tty, "the link from drive 2 to drive 1 is damaged");
    asks(&tty);
    tty.keys("\x04");
    assert_eq!(tty.ended().code(), Some(0));
    tty.has_its_modes();
}

/// Ctrl-C ends a command that lasts, and not the shell.
#[test]
fn ctrl_c_ends_a_command() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    let desk = at(&served);
    let mut tty = at_desk(&desk);
    says(&tty, "desk.toml> ");
    tty.keys("watch 0 nist --every 100ms\r");
    says(&tty, "nist 0 rpm");
    signal(&tty, Signal::INT);
    says(&tty, "drive 0 is in stop");
    tty.keys("exit\r");
    says(&tty, "safe state");
    assert_eq!(tty.ended().code(), Some(0));
    tty.has_its_modes();
}

#[test]
fn signals_end_in_the_safe_state() {
    for how in [Signal::TERM, Signal::HUP] {
        let served = Served::start("nd21", &[2], "tcp", true, &[]);
        let desk = at(&served);
        let mut tty = at_desk(&desk);
        says(&tty, "desk.toml> ");
        tty.keys("go all\r");
        // Behind a standstill of the computer the bench recovers the ring, and its drives are in error (ND21 9.8).
        says(&tty, "drive 1 is in ");
        signal(&tty, how);
        assert_eq!(tty.ended().code(), Some(130));
        says(&tty, "safe state");
        tty.has_its_modes();
    }
}
