//! `capture --judge`: the drives that are judged of a bus that is listened to.

use crate::capture::{Listener, SlcanAdapter};
use crate::program::Desk;
use rustix::process::Signal;

/// The drive that is named is judged and no other one; one that sends nothing has not passed.
#[test]
fn a_live_capture_judges_the_drives_that_are_named() {
    for (named, code, words) in [
        ("1", 0, "1 of 1 reply compared"),
        ("2", 5, "drive 2: no frame of it was compared"),
        ("1,2", 5, "drive 2: no frame of it was compared"),
    ] {
        let desk = Desk::new("drives = 1\ntransport = \"sim\"\n");
        let mut adapter = SlcanAdapter::new("none");
        let tap = format!("can0=slcan:{}", adapter.address());
        let command = desk.command(&["capture", "--judge", named, "--tap", &tap]);
        let opened = std::thread::spawn(move || {
            adapter.answer();
            adapter
        });
        let mut listener = Listener::start(command);
        let mut adapter = opened.join().expect("a client");
        adapter.says("t20133DE200\rt1814E2010000\r");
        listener.hears("can0 drive 1   181       E2 01 00 00");
        listener.signal(Signal::TERM);
        let _told = adapter.end();
        let (ended, said) = listener.end();
        assert_eq!(ended, Some(code), "{named}: {said}");
        assert!(said.contains(words), "{named}: {said}");
        let left_out = "drive 1 is not judged: `--judge` does not name it";
        assert_eq!(said.contains(left_out), named == "2", "{said}");
    }
}
