//! Scenarios of NORDAC inverters as a stranger plays them: commands, traces, reports, evidence.

use std::path::Path;
use std::process::{Command, Stdio};

/// The exit code, standard output and standard error.
fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_drivebench"))
        .args(arguments)
        .current_dir(env!("CARGO_TARGET_TMPDIR"))
        .stdin(Stdio::null())
        .output()
        .expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    let code = output.status.code().expect("it ended by itself");
    (code, text(output.stdout), text(output.stderr))
}

fn json(arguments: &[&str]) -> serde_json::Value {
    let (code, text, complaint) = run(arguments);
    assert_eq!(code, 0, "{complaint}");
    serde_json::from_str(&text).expect("JSON")
}

/// The form that the language's core fixes. At 500 kbit/s a request ends 33 idle bits and 11 bits an octet after the start.
#[test]
fn traces_for_tools() {
    let trace = json(&["trace", "nordac-en-1-whole-telegrams", "--format", "json"]);
    let head = (&trace["schema"], &trace["bus"]);
    assert_eq!(head, (&2.into(), &"nordac".into()));
    let first = serde_json::json!({"t_ns": 88_000, "from": "master", "sent": 16, "received": 16, "error": null});
    assert_eq!(trace["bytes"][0], first);
    let telegrams = trace["telegrams"].as_array().expect("telegrams");
    let [request, reply, ..] = &telegrams[..] else {
        panic!("{telegrams:?}");
    };
    let end = (33 + 6 * 11) * 2_000;
    assert_eq!(
        *request,
        serde_json::json!({"t_ns": end, "from": "master", "bytes": [16, 8, 2, 73, 83, 22]})
    );
    let reply_end = end + (11 + 6 * 11) * 2_000;
    assert_eq!(
        *reply,
        serde_json::json!({"t_ns": reply_end, "from": 8, "bytes": [16, 2, 8, 0, 10, 22]})
    );
    assert_eq!(telegrams.len(), 8);
    let trace = json(&["trace", "nordac-en-1-parity-3", "--format", "json"]);
    let errors = trace["bytes"].as_array().expect("bytes").iter();
    let errors: Vec<_> = errors.take(4).map(|own| own["error"].clone()).collect();
    let null = serde_json::Value::Null;
    assert_eq!(errors, [null.clone(), null.clone(), "parity".into(), null]);
}

/// A row a telegram, with a line error where there was one.
#[test]
fn traces_for_spreadsheets() {
    let (code, text, _) = run(&["trace", "nordac-en-1-parity-3", "--format", "csv"]);
    assert_eq!(code, 0);
    let rows: Vec<_> = text.lines().collect();
    assert_eq!(rows[0], "t_ns,from,to,bytes,error,service,meaning");
    assert!(
        rows[1].contains(",100802495316,parity 3,\"damaged\""),
        "{text}"
    );
    assert!(
        rows[2].contains(",master,8,100802495316,,\"FDL status\""),
        "{text}"
    );
}

/// What is no form of a bus is refused, and says which forms are.
#[test]
fn forms_of_another_bus_are_refused() {
    for form in ["svg", "vcd", "candump"] {
        let (code, _, complaint) = run(&["trace", "nordac-3.3-start-up", "--format", form]);
        assert!(
            code == 2 && complaint.contains("use table, json or csv"),
            "{complaint}"
        );
    }
}

/// A line that is not met is shown with the whole telegram and those in front of it.
#[test]
fn a_failure_shows_the_last_telegrams() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("nordac-wrong.scn");
    let text = "title a\nbus nordac\nslave 8\n> 10 08 02 49 53 16\n< 10 02 08 03 0D 16\n";
    std::fs::write(&path, text).expect("a file");
    let (code, _, shown) = run(&["run", "nordac-wrong.scn"]);
    assert_eq!(code, 1);
    for part in [
        "nordac-wrong.scn:5:1: the master received 00 where 03 is expected",
        "the last telegram received is 10 02 08 00 0A 16",
        "slave 8   2         FDL status     OK  [10 02 08 00 0A 16]",
    ] {
        assert!(shown.contains(part), "{part}\n{shown}");
    }
}

/// A record of simulated slaves verifies, and reports can be made.
#[test]
fn a_run_with_reports() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let html = folder.join("nordac.html");
    let html = html.to_str().expect("a name");
    let (code, shown, _) = run(&["run", "nordac-3.3-start-up", "nordac-jobs", "--html", html]);
    assert!(code == 0 && shown.contains("2 passed"), "{shown}");
    let page = std::fs::read_to_string(html).expect("a page");
    assert!(page.contains("What was said") && page.contains("slave 8"));
}

/// The catalogue of the manual by the document's name.
#[test]
fn the_manual_of_this_bus() {
    let (code, own, _) = run(&["manual", "--filter", "nordac"]);
    assert_eq!(code, 0);
    for part in ["nordac 3.2.1 bits", "pzd-invalid", "E43"] {
        assert!(own.contains(part), "{part}\n{own}");
    }
    assert!(
        !own.contains("nd21") && !own.contains("unitek App"),
        "{own}"
    );
}
