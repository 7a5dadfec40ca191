//! Evidence of a ring that another process serves, in real time.

use crate::edits::{check, kept};
use crate::program::{Desk, ended, said};
use crate::ring::Served;

/// The driver's part depends on the time of every look at the port, so the record must hold these.
#[test]
fn untouched_evidence_of_the_driver_verifies() {
    let served = Served::start("nd21", &[3], "tcp", true, &[]);
    let desk = Desk::new(&served.lines(0));
    let played = desk.run(&[
        "run",
        "--rig",
        "desk.toml",
        "--allow-motion",
        "12.2-driver-read-write",
        "11.6-driver-jobs",
        "12.5-driver-eeprom",
        "9.2-synco",
        "9.7-parity-error",
        "--evidence",
        "kept",
    ]);
    assert!(
        matches!(played.status.code(), Some(0 | 5)),
        "{}",
        said(&played)
    );
    ended(&desk.run(&["verify", "kept"]), 0, "0 things wrong");
}

/// Edits of what was seen at a port.
#[test]
fn of_a_served_ring() {
    let served = Served::start("nd21", &[2], "tcp", true, &[]);
    check(&kept(Desk::new(&served.lines(0)), "run", true));
}
