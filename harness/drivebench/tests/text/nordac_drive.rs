//! Commands on simulated NORDAC inverters as people use them.

use crate::typed::run;
use std::path::Path;

/// A command on `sim:nordac` that succeeds; what it prints.
#[track_caller]
fn done(arguments: &[&str]) -> String {
    let (code, shown, complaint) = run(&[arguments, &["--rig", "sim:nordac"]].concat());
    assert_eq!(code, 0, "{arguments:?}: {shown}{complaint}");
    shown
}

/// A command on `sim:nordac` that fails; its exit code and what it complains of.
#[track_caller]
fn fails(arguments: &[&str]) -> (i32, String) {
    let (code, shown, complaint) = run(&[arguments, &["--rig", "sim:nordac"]].concat());
    assert_ne!(code, 0, "{arguments:?}: {shown}");
    (code, complaint)
}

fn file(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).expect("a file");
    path.to_str().expect("a plain path").to_owned()
}

#[test]
fn start_shows_what_a_slave_is() {
    assert_eq!(
        done(&["start", "8"]),
        "slave 8: PPO1 (12 octets), diagnosis 00 0C 00 02 75 31, master 2, ZSW 0B70 (start-disable, actual value = setpoint, control by the bus requested, clockwise), HIW 0000 (0.0 %)\n"
    );
    let setup = file("nordac-start.scn", "slave 8 ppo 4\n");
    let shown = done(&["start", "all", "--setup", &setup]);
    assert!(shown.starts_with("slave 8: PPO4 (12 octets)"), "{shown}");
    let (code, complaint) = fails(&["start", "9"]);
    assert!(
        code == 2 && complaint.contains("the rig has no slave 9: 8 expected"),
        "{complaint}"
    );
}

/// 3.2, 3.3: words in order, in percent and in Hz; the reply shows what they led to. Motion needs permission.
#[test]
fn exchange_and_its_permission() {
    let steps = ["exchange", "8", "STW=047E", "then", "STW=047F"];
    let shown = done(&[&steps[..], &["HSW=35Hz", "--for", "3s", "--move"]].concat());
    let lines: Vec<_> = shown.lines().collect();
    assert!(
        lines[0].starts_with("slave 8: STW 047E HSW 0000 -> ZSW 0B31 (ready to start"),
        "{shown}"
    );
    assert!(
        lines[1].starts_with("slave 8: STW 047F HSW 2000 -> ZSW 0F37 (operation enabled"),
        "{shown}"
    );
    assert!(lines[1].ends_with("HIW 2000 (50.0 %)"), "{shown}");
    let (code, complaint) = fails(&steps);
    assert!(
        code == 2 && complaint.contains("add --move to allow it"),
        "{complaint}"
    );
    // An ON that stands from the beginning does nothing (3.3, rule 2).
    let shown = done(&["exchange", "8", "STW=047F", "--move"]);
    assert!(shown.contains("ZSW 0B70 (start-disable"), "{shown}");
    let (code, complaint) = fails(&["exchange", "8", "STW=47F"]);
    assert!(
        code == 2 && complaint.contains("four hexadecimal digits"),
        "{complaint}"
    );
    let (code, complaint) = fails(&["exchange", "8", "STW=047E", "HSW=200Hz", "--move"]);
    assert!(
        code == 2 && complaint.contains("the maximum frequency (1205) is 70.0 Hz"),
        "{complaint}"
    );
}

/// The JSON of `start` and `exchange`: words as numbers, and what they mean.
#[test]
fn words_for_tools() {
    let json = |arguments: &[&str]| -> serde_json::Value {
        serde_json::from_str(&done(arguments)).expect("JSON")
    };
    let started = json(&["start", "8", "--format", "json"]);
    assert_eq!(started["slaves"][0]["ppo"], 1);
    assert_eq!(started["slaves"][0]["diagnosis"], "00 0C 00 02 75 31");
    assert_eq!(started["slaves"][0]["reply"]["zsw"], 0x0B70);
    let steps = ["exchange", "8", "STW=047E", "then", "STW=047F", "HSW=2000"];
    let more = ["--for", "3s", "--move", "--format", "json"];
    let exchanged = json(&[&steps[..], &more].concat());
    let [first, last] = [0, 1].map(|place| &exchanged["exchanges"][place]);
    assert_eq!(
        (&first["stw"], &first["reply"]["zsw"]),
        (&0x047E.into(), &0x0B31.into())
    );
    assert_eq!(
        (&last["hsw"], &last["reply"]["hiw"]),
        (&0x2000.into(), &0x2000.into())
    );
    assert_eq!(last["reply"]["actual"], "50.0 %");
    let (code, complaint) = fails(&[&steps[..], &["--hold", "--for", "1s", "--move"]].concat());
    assert!(code == 2 && complaint.contains("--hold"), "{complaint}");
}

/// 3.3: on by 047E and 047F, for a time, and off on the ramp.
#[test]
fn on_and_the_ways_to_stop() {
    let shown = done(&["on", "8", "--setpoint=-25%", "--for", "3s", "--move"]);
    let lines: Vec<_> = shown.lines().collect();
    assert_eq!(lines.len(), 3, "{shown}");
    assert!(
        lines[0].starts_with("slave 8: STW 047E, 047F -> ZSW 1237 (operation enabled"),
        "{shown}"
    );
    assert!(
        lines[1].ends_with("anticlockwise), HIW F000 (-25.0 %)"),
        "{shown}"
    );
    assert!(
        lines[2].starts_with("slave 8: STW 047E -> ZSW 0B31 (ready to start"),
        "{shown}"
    );
    let (code, complaint) = fails(&["on", "8"]);
    assert!(
        code == 2
            && complaint.contains("on: slave 8: motors may turn; nothing was done, add --move"),
        "{complaint}"
    );
    for (command, word, state) in [
        ("off", "047E", "ready to start"),
        ("stop", "047E", "ready to start"),
        ("quick-stop", "047B", "start-disable, OFF3 active"),
        ("block", "047D", "start-disable, OFF2 active"),
    ] {
        let shown = done(&[command, "8"]);
        assert!(shown.contains(&format!("STW {word} -> ")), "{shown}");
        assert!(shown.contains(&format!("({state}")), "{shown}");
    }
    // A word that stops and is not obeyed: only a motor that is not blocked is no safe state.
    let wrong = file(
        "nordac-on.scn",
        "slave 8 parameter 1621 = 2\nslave 8 deviates always-enabled-shown\n",
    );
    for (command, expected) in [("off", 1), ("quick-stop", 1), ("block", 7)] {
        let (code, complaint) = fails(&[command, "8", "--setup", &wrong]);
        assert_eq!(code, expected, "{complaint}");
        assert!(complaint.contains("use the emergency stop"), "{complaint}");
    }
    let shown = done(&["acknowledge", "8"]);
    assert!(
        shown.starts_with("slave 8: it had no fault; STW 047D"),
        "{shown}"
    );
}

/// 5.5: a slave under local control is not switched on, and the remedy is named.
#[test]
fn a_slave_under_local_control() {
    let setup = file("nordac-local.scn", "slave 8 parameter 1621 = 0\n");
    let (code, complaint) = fails(&["on", "8", "--move", "--setup", &setup]);
    assert!(
        code == 1 && complaint.contains("`drivebench write 8 Interface = 2`"),
        "{complaint}"
    );
}

/// 5, 3.4: names, numbers, sets, sub-indices, units, process words.
#[test]
fn read_in_every_form() {
    let shown = done(&[
        "read",
        "8",
        "Accel. time",
        "1205.3",
        "1806.9",
        "ZSW",
        "Interface",
    ]);
    let lines: Vec<Vec<_>> = shown
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    assert_eq!(
        lines[0],
        ["slave", "PNU", "name", "raw", "value", "section"]
    );
    assert_eq!(
        lines[1],
        ["8", "1202", "Accel.", "time", "100", "5.00", "s", "5.1"]
    );
    assert_eq!(
        lines[2][..6],
        ["8", "1205.3", "Maximum", "frequ.", "700", "70.0"]
    );
    assert_eq!(lines[3][..3], ["8", "1806.9", "Fault"]);
    assert_eq!(lines[4][..3], ["8", "ZSW", "0B70"]);
    assert_eq!(lines[5][..4], ["8", "1621", "Interface", "2"]);
    let json = done(&["read", "8", "1205.3", "HIW", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(
        json["cells"][0],
        serde_json::json!({"slave": 8, "parameter": "1205.3", "name": "Maximum frequ.", "raw": 700, "value": "70.0 Hz", "unit": "Hz", "section": "5.1"})
    );
    assert_eq!(
        json["cells"][1],
        serde_json::json!({"slave": 8, "word": "HIW", "raw": 0, "value": "0.0 %"})
    );
    let (code, complaint) = fails(&["read", "8", "Acel. time"]);
    assert!(
        code == 2 && complaint.contains("did you mean `Accel. time`?"),
        "{complaint}"
    );
    let (code, complaint) = fails(&["read", "8", "1716"]);
    assert!(
        code == 1
            && complaint.contains(
                "error 0: illegal parameter number; this parameter needs the PosiCon option"
            ),
        "{complaint}"
    );
}

/// Every parameter of every set; those of the PosiCon option where it is there, double words with PPO2 only.
#[test]
fn read_all() {
    let rows = |setup: &str| {
        let setup = file(&format!("nordac-all-{}.scn", setup.len()), setup);
        let shown = done(&["read", "8", "all", "--setup", &setup]);
        (shown.lines().count() - 1, shown)
    };
    let (plain, shown) = rows("slave 8 ppo 1\n");
    assert!(!shown.contains(" 5.6\n"), "{shown}");
    let (with, shown) = rows("slave 8 ppo 2\nslave 8 posicon\n");
    assert!(shown.contains("1717.63.4  Pos. increm."), "{shown}");
    // 5.6: 12 of four sets, 19 of one, 1731 of two sub-indices, and 1716 and 1717 of 64 elements in four sets.
    let more = harness_proto::nordac::PARAMETERS
        .iter()
        .filter(|own| own.needs_posicon())
        .map(|own| usize::from(own.count) * usize::from(own.sets()))
        .sum::<usize>();
    assert_eq!(with, plain + more);
}

/// 3.4: written, answered, and refused in the manual's words.
#[test]
fn write_in_every_form() {
    for assignment in [
        &["Accel. time = 5s"][..],
        &["Accel. time", "=", "5s"],
        &["1202=100"],
        &["accel. time=", "5.00", "s"],
    ] {
        let shown = done(&[&["write", "8"][..], assignment].concat());
        assert_eq!(shown, "slave 8: 1202 Accel. time = 5.00 s\n");
    }
    let shown = done(&["write", "8", "1205.3", "=", "50.0Hz", "1203=3s"]);
    assert_eq!(
        shown,
        "slave 8: 1205.3 Maximum frequ. = 50.0 Hz\nslave 8: 1203 Decel. time = 3.00 s\n"
    );
    let (code, complaint) = fails(&["write", "8", "1202=1601s"]);
    assert!(code == 1 && complaint.contains("refuses to change parameter 1202 (Accel. time): error 2: limit exceeded; the limits are 0.05 s and 1600.00 s"), "{complaint}");
    for (wrong, part) in [
        ("1202=5.01s", "in steps of 0.05 s"),
        ("1202=5Hz", "is counted in s"),
        ("1800=1", "parameter 1800 (New error) is read only"),
        ("1205.7=5Hz", "parameter 1205 has sets 1 to 4"),
    ] {
        let (code, complaint) = fails(&["write", "8", wrong]);
        assert!(code == 2 && complaint.contains(part), "{complaint}");
    }
    // 2.6: the module restarts, and is found with its new PPO type and at its new address.
    let shown = done(&["write", "8", "PPO type = 1", "Bus address = 9", "1205=60Hz"]);
    assert_eq!(
        shown,
        "slave 8: 1622 PPO type = 1; its module restarted, it is back at address 8 with PPO2\n\
         slave 8: 1624 Bus address = 9; its module restarted, it is back at address 9 with PPO2\n\
         slave 9: 1205 Maximum frequ. = 60.0 Hz\n"
    );
}

/// A file of parameters: saved, compared, and written back in an order that keeps the limits.
#[test]
fn params() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("nordac-params.toml");
    let name = path.to_str().expect("a plain path");
    let _absent = std::fs::remove_file(&path);
    done(&["params", "save", "8", name]);
    let text = std::fs::read_to_string(&path).expect("a file");
    assert!(
        text.contains("\"1205.3\"    =    700 # Maximum frequ.         70.0 Hz\n"),
        "{text}"
    );
    assert!(!text.contains("\"1602\""), "{text}");
    assert_eq!(done(&["params", "diff", "8", name]), "");
    // 1204 must not be above 1205: the file's minimum is written behind its maximum.
    let other = text
        .replace("\"1204.1\"    =      0", "\"1204.1\"    = 800")
        .replace("\"1205.1\"    =    700", "\"1205.1\"    = 900")
        .replace("\"1624\"      =      8", "\"1624\"      = 9");
    let other = file("nordac-other.toml", &other);
    let (code, shown, _) = run(&["params", "diff", "8", &other, "--rig", "sim:nordac"]);
    assert_eq!(
        (code, &*shown),
        (
            1,
            "1204.1    Minimum frequ.         file 80.0 Hz  slave 0.0 Hz\n\
             1205.1    Maximum frequ.         file 90.0 Hz  slave 70.0 Hz\n\
             1624      Bus address            file 9  slave 8\n"
        )
    );
    let (code, _, complaint) = run(&["params", "load", "8", &other, "--rig", "sim:nordac"]);
    assert!(
        code == 0 && complaint.contains("nothing was written; --yes writes it"),
        "{complaint}"
    );
    let (code, _, complaint) = run(&[
        "params",
        "load",
        "8",
        &other,
        "--yes",
        "--rig",
        "sim:nordac",
    ]);
    assert!(
        code == 1 && complaint.contains("2 parameters written"),
        "{complaint}"
    );
    assert!(
        complaint.contains("1 of them say how the inverter is reached"),
        "{complaint}"
    );
}

#[test]
fn info_top_watch_and_cells() {
    let shown = done(&["info", "8"]);
    for part in [
        "PPO type",
        "PPO1",
        "start-disable",
        "none: nothing stops the motor if the master fails",
        "1813 Frequency",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    let json = done(&["info", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(
        (&json["drives"][0]["slave"], &json["drives"][0]["maximum"]),
        (&8.into(), &"70.0 Hz".into())
    );
    let shown = done(&["top", "--once"]);
    assert!(
        shown.starts_with("slave  PPO   fault  frequency") && shown.lines().count() == 2,
        "{shown}"
    );
    let shown = done(&[
        "watch", "8", "HIW", "1813", "--every", "100ms", "--for", "300ms", "--format", "csv",
    ]);
    let lines: Vec<_> = shown.lines().collect();
    assert_eq!(lines[0], "time_ms,8 HIW [%],8 1813 Frequency [Hz]");
    assert!(lines.len() >= 4 && lines[1].ends_with(",0,0.0"), "{shown}");
    let (code, shown, _) = run(&["cells", "--bus", "nordac", "maximum frequ."]);
    assert_eq!(
        (code, &*shown),
        (
            0,
            "1205 4B5 PO   Maximum frequ.                     5.1   the minimum frequency (1204) to 999.0 Hz, factory setting 70.0 Hz; sets 1205.1 to 1205.4\n"
        )
    );
}

/// Commands of another bus are refused, and say which there are.
#[test]
fn commands_of_other_buses() {
    for (command, words) in [
        ("reset", "on NORDAC inverters there are start, exchange, on"),
        ("go", "use `on` with --for or --hold; `go` is for a session"),
    ] {
        let (code, complaint) = fails(&[command, "8", "--move"]);
        assert!(code == 2 && complaint.contains(words), "{complaint}");
    }
    for rig in ["sim:1", "sim:unitek:1"] {
        let (code, _, complaint) = run(&["start", "0", "--rig", rig]);
        assert_eq!(code, 2, "{rig}: {complaint}");
    }
}

/// Completions offer what the drives of the rig hold that is named in front of the cursor.
#[test]
fn completions_know_the_bus_of_the_rig() {
    let offered = |words: &[&str]| {
        let (code, shown, _) = run(&[&["complete", "--"], words].concat());
        assert_eq!(code, 0);
        shown.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    for (words, offer) in [
        (&["read", "--rig", "sim:nordac", "8", "120"][..], "1205"),
        (&["watch", "8", "--rig=sim:nordac:2", "Z"], "ZSW"),
        (&["write", "--rig", "sim:nordac", "8", "120"], "1205="),
        (
            &["read", "--rig", "sim:unitek", "1", "SPEED_A"],
            "SPEED_ACTUAL",
        ),
        (&["read", "--rig", "sim:3", "1", "nis"], "nist"),
    ] {
        let found = offered(words);
        assert!(found.iter().any(|own| own == offer), "{words:?}: {found:?}");
    }
    let none = offered(&["read", "--rig", "sim:nordac", "8", "nis"]);
    assert!(none.is_empty(), "{none:?}");
}
