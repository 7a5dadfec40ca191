//! Simulated drives that cannot be brought to their safe state: exit code 7 on every bus, as behind a port.

use crate::program::{Desk, ended};

/// A bench of one port or ring, with a deviation.
fn desk(port: &str, bus: &str, setup: &str) -> Desk {
    Desk::of_file(&format!(
        "schema = 2\n[rig]\nid = \"desk\"\n{port}\n[sim]\n{bus}setup = [{setup}]\n[limits]\nallow_motion = true\n"
    ))
}

#[test]
fn simulated_drives_that_disobey_end_with_exit_code_7() {
    let ring = "[ring.1]\ndrives = 2\ntransport = \"sim\"";
    let can = "[port.1]\nbus = \"unitek\"\ndrives = [{ node = 1 }]";
    let line = "[port.1]\nbus = \"nordac\"\ndrives = [{ address = 8, ppo = 1 }]";
    let on = "\"slave 8 deviates always-enabled-shown\"";
    for (port, bus, setup, scenario) in [
        (
            ring,
            "",
            "\"drive 1 deviates flags-block-missing\"",
            "10.3-and",
        ),
        (
            can,
            "bus = \"unitek\"\n",
            "\"drive 1 deviates no-lock\"",
            "unitek-4.5-lengths",
        ),
        (line, "bus = \"nordac\"\n", on, "nordac-3.2.1-bit-1"),
        // Its scenario passes.
        (
            line,
            "bus = \"nordac\"\n",
            "\"slave 8 deviates refuses-by-sc\"",
            "nordac-en-1-end",
        ),
    ] {
        let desk = desk(port, bus, setup);
        let run = ["run", "--rig", "desk.toml", "--allow-motion", "--filter"];
        let output = desk.run(&[&run[..], &[scenario, "--evidence", "kept"]].concat());
        ended(
            &output,
            7,
            "the safe state is NOT confirmed; use the emergency stop",
        );
        let verified = desk.run(&["verify", "kept"]);
        ended(
            &verified,
            verified.status.code().unwrap_or(1),
            "0 things wrong",
        );
    }
}

/// A deviation that does not concern the safe state is a failure, and drives that follow the manual are safe.
#[test]
fn simulated_drives_that_obey_are_safe() {
    let ring = "[ring.1]\ndrives = 2\ntransport = \"sim\"";
    for (setup, code) in [("", 0), ("\"drive 1 deviates stop-ignored\"", 1)] {
        let desk = desk(ring, "", setup);
        let run = ["run", "--rig", "desk.toml", "--allow-motion", "--filter"];
        ended(
            &desk.run(&[&run[..], &["10.3-and"]].concat()),
            code,
            "10.3-and",
        );
    }
}
