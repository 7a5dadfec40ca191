//! Scenarios of UNITEK drives as a stranger plays them: commands, traces, reports, evidence.

use crate::typed::run;
use std::path::Path;

/// The form that the language's core fixes: times in microseconds, an identifier, `#`, data.
#[test]
fn traces_for_tools() {
    let (code, log, _) = run(&[
        "trace",
        "unitek-ex-10-1-limit-switch",
        "--format",
        "candump",
    ]);
    assert_eq!(code, 0);
    let first: Vec<_> = log.lines().take(3).collect();
    assert_eq!(
        first,
        [
            "(0.000148) can0 201#520C00",
            "(0.000300) can0 201#511000",
            "(0.001200) can0 181#408531000000",
        ]
    );
    let (_, json, _) = run(&["trace", "unitek-ex-10-1-limit-switch", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(
        (&json["schema"], &json["bus"]),
        (&2.into(), &"unitek".into())
    );
    assert_eq!(
        json["frames"][0],
        serde_json::json!({"t_ns": 148_000, "id": 513, "data": [82, 12, 0], "from": "master", "fault": null})
    );
    assert_eq!(json["frames"][2]["from"], 1);
    let (_, json, _) = run(&["trace", "unitek-fault-lost", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(json["frames"][0]["fault"], "lost");
}

/// What is no form of a bus is refused, and says which forms are.
#[test]
fn forms_of_another_bus_are_refused() {
    let (code, _, complaint) = run(&["trace", "unitek-ex-8-status", "--format", "svg"]);
    assert!(code == 2 && complaint.contains("candump"), "{complaint}");
    let (code, _, complaint) = run(&["trace", "9.2-synco", "--format", "candump"]);
    assert!(code == 2 && complaint.contains("CAN"), "{complaint}");
}

/// A line that is not met is shown with the frames in front of it.
#[test]
fn a_failure_shows_the_last_frames() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("unitek-wrong.scn");
    let text = "title a\nbus unitek\ndrive 1\n> 201#3D1B00\n< 181 1B D9 01 xx\n";
    std::fs::write(&path, text).expect("a file");
    let (code, _, shown) = run(&["run", "unitek-wrong.scn"]);
    assert_eq!(code, 1);
    for part in [
        "unitek-wrong.scn:5:1: the master received 181 1B D8 01 00 where 181 1B D9 01 xx is expected",
        "read 1B FW-VERSION",
        "1B FW-VERSION = 01D8",
    ] {
        assert!(shown.contains(part), "{shown}");
    }
}

/// A folder of evidence of simulated segments is confirmed, and one whose record was changed is not.
#[test]
fn evidence_is_confirmed() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("unitek-evidence");
    let _absent = std::fs::remove_dir_all(&folder);
    let name = folder.to_str().expect("a plain path");
    let played = [
        "run",
        "unitek-ex-8-status",
        "unitek-fault-late",
        "9.2-synco",
        "--rig",
        "sim:1",
    ];
    let (code, shown, _) = run(&[&played[..], &["--evidence", name]].concat());
    assert_eq!((code, shown.matches("passed ").count()), (0, 3), "{shown}");
    let (code, shown, _) = run(&["verify", name]);
    assert_eq!(code, 0, "{shown}");
    assert!(shown.contains("passed       unitek-fault-late"), "{shown}");
    let record = folder.join("run.jsonl");
    let text = std::fs::read_to_string(&record).expect("a record");
    assert!(text.contains("181#40810100"), "{text}");
    std::fs::write(&record, text.replace("181#40810100", "181#40810000")).expect("room");
    let (code, shown, _) = run(&["verify", name]);
    assert_eq!(code, 1, "{shown}");
}

/// Pages and JUnit files have the frames and the verdict.
#[test]
fn reports() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let name = |name: &str| folder.join(name).display().to_string();
    let (html, junit) = (name("unitek.html"), name("unitek.xml"));
    let (code, _, _) = run(&[
        "run",
        "unitek-ex-8-status",
        "--html",
        &html,
        "--junit",
        &junit,
    ]);
    assert_eq!(code, 0);
    let read = |path: &str| std::fs::read_to_string(path).expect("a file");
    assert!(read(&html).contains("40 STATUS = 0181  Ena P-N N-I"));
    assert!(read(&junit).contains("classname=\"unitek.ex\""));
}

/// Both manuals stand side by side; a filter leaves one.
#[test]
fn the_catalogue() {
    let (code, all, _) = run(&["manual"]);
    assert!(code == 0 && all.contains("36 of 36 pinned"), "{all}");
    let (_, own, _) = run(&["manual", "--filter", "unitek"]);
    assert!(
        !own.contains("nd21") && own.contains("unitek App 8"),
        "{own}"
    );
    let (code, _, complaint) = run(&["manual", "--filter", "no such thing"]);
    assert!(
        code == 4 && complaint.contains("drivebench manual"),
        "{complaint}"
    );
}

/// The wrong drives and drivers that a scenario can ask for.
#[test]
fn deviations() {
    let (code, all, _) = run(&["deviations", "--bus", "unitek"]);
    assert_eq!((code, all.lines().count()), (0, 64 + 1 + 20), "{all}");
    let (_, some, _) = run(&["deviations", "--bus", "unitek", "no-lock"]);
    assert!(
        some.starts_with("no-lock ") && some.lines().count() == 1,
        "{some}"
    );
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("unitek-no-lock.scn");
    let text = "title a\nbus unitek\ndrive 1 deviates no-lock\nlock 1\n? drive 1 register E3 = 0\n";
    std::fs::write(&path, text).expect("a file");
    let (code, _, shown) = run(&["run", "unitek-no-lock.scn"]);
    assert!(
        code == 1 && shown.contains("register E3 (O_GO) reads 0001"),
        "{shown}"
    );
}
