//! Scenarios of NORDAC inverters as a stranger plays them: commands, traces, reports, evidence.

use crate::typed::run;
use std::path::Path;

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
    let (code, _, complaint) = run(&["trace", "nordac-3.3-start-up", "--format", "svg"]);
    assert!(
        code == 2 && complaint.contains("use table, json, csv"),
        "{complaint}"
    );
}

/// Link type 250: an interface a station, a packet a telegram, with its line error in the header and in a comment.
#[test]
fn traces_for_wireshark() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("nordac.pcapng");
    let name = path.to_str().expect("a name");
    let trace = [
        "trace",
        "nordac-en-1-parity-3",
        "--format",
        "pcapng",
        "-o",
        name,
    ];
    assert_eq!(run(&trace).0, 0);
    let bytes = std::fs::read(&path).expect("a capture");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("a word"));
    let (mut at, mut blocks) = (0, Vec::new());
    while at < bytes.len() {
        let length = word(at + 4) as usize;
        assert_eq!(
            word(at + length - 4) as usize,
            length,
            "both lengths of a block"
        );
        blocks.push((word(at), bytes[at..at + length].to_vec()));
        at += length;
    }
    let kinds: Vec<_> = blocks.iter().map(|(kind, _)| *kind).collect();
    assert_eq!(kinds, [0x0A0D_0D0A, 1, 1, 6, 6, 6]);
    let has =
        |block: usize, text: &[u8]| blocks[block].1.windows(text.len()).any(|own| own == text);
    assert!(has(1, b"master") && has(2, b"slave 8"));
    // Behind 28 bytes of the block and 8 of time: the event, and behind three zeros the octets.
    let event = |block: usize| blocks[block].1[36];
    assert_eq!([event(3), event(4), event(5)], [0x08, 0x03, 0x04]);
    assert!(has(3, b"byte 3 parity") && has(4, &[0x10, 8, 2, 0x49, 0x53, 0x16]));
}

/// Two runs are compared telegram by telegram.
#[test]
fn runs_are_compared() {
    let same = "nordac-en-2-services-wait-prm";
    assert_eq!(run(&["diff", same, same]).0, 0);
    let (code, text, _) = run(&["diff", same, "nordac-en-2-services-wait-cfg"]);
    assert!(
        code == 1 && text.contains("first difference: telegram 1 of"),
        "{text}"
    );
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
