//! Commands on simulated NORDAC rigs with limits: what a rig's file does not permit is not sent, and the remedy is named.

use crate::program::Desk;

/// A rig with one simulated slave.
fn desk(setup: &str, limits: &str) -> Desk {
    Desk::of_file(&format!(
        "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"nordac\"\ndrives = [{{ address = 8 }}]\n\
         [sim]\nbus = \"nordac\"\nsetup = [{setup}]\n[limits]\n{limits}"
    ))
}

#[track_caller]
fn refused(desk: &Desk, arguments: &[&str], remedy: &str) {
    let output = desk.run(&[arguments, &["--rig", "desk.toml"]].concat());
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(complaint.contains(remedy), "{arguments:?}: {complaint}");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {complaint}");
}

#[track_caller]
fn done(desk: &Desk, arguments: &[&str]) {
    let output = desk.run(&[arguments, &["--rig", "desk.toml"]].concat());
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {complaint}");
}

/// Nothing is permitted: slaves are started and read, and stopped.
#[test]
fn nothing_is_permitted() {
    let desk = desk("", "");
    for arguments in [
        &["start", "8"][..],
        &["read", "8", "1205"],
        &["info"],
        &["off", "8"],
        &["quick-stop", "8"],
        &["block", "8"],
        &["exchange", "8", "STW=047E"],
    ] {
        done(&desk, arguments);
    }
    let motion = "needs `allow_motion` in the rig's [limits] and --allow-motion";
    refused(&desk, &["on", "8", "--move"], motion);
    refused(
        &desk,
        &["exchange", "8", "STW=047E", "HSW=1%", "--move"],
        motion,
    );
    refused(&desk, &["acknowledge", "8", "--move"], motion);
    let eeprom = "needs `allow_eeprom` in the rig's [limits]";
    refused(&desk, &["write", "8", "1600=1"], eeprom);
}

/// 12: motion needs something that stops the motor if the bench fails, and is limited.
#[test]
fn motion_is_supervised_and_limited() {
    let limits = "allow_motion = true\nallow_eeprom = true\n";
    let open = desk("", limits);
    let on = ["on", "8", "--move", "--for", "1s", "--setpoint"];
    let time_out = "set its bus time-out (1625) above 0";
    refused(&open, &[&on[..], &["10%"]].concat(), time_out);
    refused(&open, &["exchange", "8", "STW=047F", "--move"], time_out);
    let data = "needs `allow_motor_data` in the rig's [limits]";
    refused(&open, &["write", "8", "1202=1s"], data);
    let settings = "needs `allow_bus_settings` in the rig's [limits]";
    refused(&open, &["write", "8", "1600=1", "1622=1"], settings);
    let supervised = "\"slave 8 parameter 1625 = 1s\", \"slave 8 parameter 1621 = 2\"";
    let half = desk(supervised, &format!("{limits}max_setpoint = \"50%\"\n"));
    done(&half, &[&on[..], &["50%"]].concat());
    refused(&half, &[&on[..], &["51%"]].concat(), "HSW is at most 2000");
    let hertz = desk(supervised, &format!("{limits}max_frequency = \"35Hz\"\n"));
    done(&hertz, &[&on[..], &["35Hz"]].concat());
    refused(
        &hertz,
        &[&on[..], &["36Hz"]].concat(),
        "HSW is at most 2000",
    );
}
