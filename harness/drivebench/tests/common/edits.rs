//! Edits of evidence whose sums were made to fit again: each field of each kind of line changed, removed or doubled, each line deleted or
//! doubled, a line of each kind moved, each other file changed. Verify refuses them all but those that nothing in a folder can confirm, which stand here.

use crate::program::{Desk, ended, said};
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Fields that can hold another value without a contradiction, of rings with ports: kind of line and field.
const UNCONFIRMED: [(&str, &str); 4] = [
    // What the link knew of bytes on their way, where nothing depended on it.
    ("look", "busy"),
    // How late the computer had been.
    ("look", "lead"),
    // How long after the end of a conversation the next one began.
    ("begin", "t"),
    // Words of the system about a port.
    ("trouble", "text"),
];

/// A folder of evidence, and how its lines are changed one at a time.
pub(crate) struct Kept {
    desk: Desk,
    ports: bool,
}

impl Kept {
    fn folder(&self) -> PathBuf {
        self.desk.path("kept")
    }

    /// Its record.
    pub(crate) fn text(&self) -> String {
        fs::read_to_string(self.folder().join("run.jsonl")).expect("a record")
    }

    pub(crate) fn lines(&self) -> Vec<Value> {
        let text = self.text();
        let lines = text.lines().map(serde_json::from_str);
        lines.map(|line| line.expect("JSON")).collect()
    }

    /// What verify says of the folder with another record.
    pub(crate) fn verified(&self, lines: &[Value]) -> Output {
        let before = self.text();
        let known = before.lines().map(|text| {
            let line: Value = serde_json::from_str(text).expect("JSON");
            (line.to_string(), text)
        });
        let known: BTreeMap<_, _> = known.collect();
        let text = lines.iter().map(|line| match known.get(&line.to_string()) {
            Some(text) => format!("{text}\n"),
            None => format!("{}\n", written(line, like(line, &before))),
        });
        let text: String = text.collect();
        self.verified_text(&text)
    }

    /// The same with this text as its record.
    pub(crate) fn verified_text(&self, text: &str) -> Output {
        let before = fs::read(self.folder().join("run.jsonl")).expect("a record");
        fs::write(self.folder().join("run.jsonl"), text).expect("room");
        fit(&self.folder());
        let verified = self.verify();
        fs::write(self.folder().join("run.jsonl"), before).expect("room");
        fit(&self.folder());
        verified
    }

    /// Whether verify refuses the folder with another record.
    pub(crate) fn refused(&self, lines: &[Value]) -> bool {
        is_refusal(&self.verified(lines))
    }

    fn verify(&self) -> Output {
        self.desk.run(&["verify", "kept"])
    }

    fn is_refused(&self) -> bool {
        is_refusal(&self.verify())
    }
}

/// The line of a record whose fields are most like these.
fn like<'r>(line: &Value, record: &'r str) -> &'r str {
    let kind = format!("{{\"kind\":{},", line["kind"]);
    let fields = || line.as_object().into_iter().flatten();
    let alike = |text: &&str| {
        let has = |key: &String| text.contains(&format!("\"{key}\":"));
        fields().filter(|(key, _)| has(key)).count()
    };
    let same_kind = record.lines().filter(|text| text.starts_with(&kind));
    same_kind.max_by_key(alike).unwrap_or_default()
}

/// A value with its fields in the order in which this line has them: the program writes them in no other one.
fn written(value: &Value, line: &str) -> String {
    match value {
        Value::Object(fields) => {
            let mut fields: Vec<_> = fields.iter().collect();
            fields.sort_by_key(|(key, _)| line.find(&format!("\"{key}\":")));
            let fields = fields.into_iter();
            let fields = fields.map(|(key, value)| format!("\"{key}\":{}", written(value, line)));
            format!("{{{}}}", fields.collect::<Vec<_>>().join(","))
        }
        Value::Array(all) => {
            let all = all.iter().map(|value| written(value, line));
            format!("[{}]", all.collect::<Vec<_>>().join(","))
        }
        other => other.to_string(),
    }
}

fn is_refusal(verified: &Output) -> bool {
    let code = verified.status.code();
    assert!(matches!(code, Some(0 | 1 | 2 | 5)), "{}", said(verified));
    code != Some(0)
}

/// Makes the sums fit again.
pub(crate) fn fit(folder: &Path) {
    let output = Command::new("sh")
        .args(["-c", "find . -type f ! -name 'SHA256SUMS*' | sed 's,^./,,' | LC_ALL=C sort | xargs -d '\\n' sha256sum > SHA256SUMS"])
        .current_dir(folder)
        .output()
        .expect("a shell");
    assert!(output.status.success(), "{output:?}");
}

pub(crate) const PASSES: &str =
    "title Read\nsource nd21 10.1\nring 2\nread-byte 1 FE13 = 00\nwrite-byte 0 FE13 = 22\n";
const FAILS: &str = "title Wrong\nsource nd21 9.1\nring 2\n> 80*3\n< 80 80 42\n";
const FAULT: &str =
    "title Fault\nsource nd21 9.7\nring 2\n! master->1 byte 3: flip 0\n> 80*9\nrecover\n";
const SKIPPED: &str = "title Three\nsource nd21 9.1\nring 3\n> 80\n";

/// A folder of evidence made by `command`.
pub(crate) fn kept(desk: Desk, command: &str, ports: bool) -> Kept {
    for (name, text) in [
        ("passes", PASSES),
        ("fails", FAILS),
        ("fault", FAULT),
        ("skipped", SKIPPED),
    ] {
        fs::write(desk.path(&format!("{name}.scn")), text).expect("room");
    }
    let more = ["passes.scn", "fails.scn", "fault.scn", "skipped.scn"];
    let scenarios = match command {
        "qualify" => &more[..1],
        _ => &more[..],
    };
    let fixed = [command, "--rig", "desk.toml", "--allow-motion"];
    let arguments = [&fixed[..], scenarios, &["--evidence", "kept"]].concat();
    let played = desk.run(&arguments);
    assert!(
        matches!(played.status.code(), Some(0 | 1 | 5)),
        "{}",
        said(&played)
    );
    of(desk, ports)
}

/// The folder `kept` of a desk.
pub(crate) fn of(desk: Desk, ports: bool) -> Kept {
    let kept = Kept { desk, ports };
    ended(&kept.desk.run(&["verify", "kept"]), 0, "0 things wrong");
    fit(&kept.folder());
    ended(&kept.desk.run(&["verify", "kept"]), 0, "0 things wrong");
    kept
}

/// Another value of the same form.
fn other(value: &Value) -> Value {
    match value {
        Value::Bool(yes) => Value::Bool(!yes),
        Value::Number(number) => Value::from(number.as_u64().unwrap_or(0) + 30_000_000),
        Value::String(text) => match text.as_str() {
            "passed" => "failed".into(),
            "failed" | "inconclusive" | "skipped" => "passed".into(),
            text if text.len() % 2 == 0 && u64::from_str_radix(text, 16).is_ok() => {
                let last = if text.ends_with('5') { "6" } else { "5" };
                format!("{}{last}", &text[..text.len() - 1]).into()
            }
            text => format!("{text}x").into(),
        },
        Value::Array(all) => match all.as_slice() {
            [] => Value::Array(vec!["more".into()]),
            [first, rest @ ..] => {
                let mut all = vec![other(first)];
                all.extend(rest.iter().cloned());
                Value::Array(all)
            }
        },
        Value::Object(_) | Value::Null => Value::Null,
    }
}

/// The first line of each kind with each of its fields, and the first line of each kind alone.
fn fields(lines: &[Value]) -> Vec<(usize, String, String)> {
    let mut seen = BTreeSet::new();
    let mut all = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let object: &Map<String, Value> = line.as_object().expect("an object");
        let kind = line["kind"].as_str().expect("a kind");
        for field in object.keys().filter(|field| *field != "kind") {
            if seen.insert((kind.to_owned(), field.clone())) {
                all.push((at, kind.to_owned(), field.clone()));
            }
        }
    }
    all
}

pub(crate) fn check(kept: &Kept) {
    check_each(kept, 1);
}

/// The same with each `nth` edit only, where an edit takes long.
pub(crate) fn check_each(kept: &Kept, nth: usize) {
    let lines = kept.lines();
    let mut accepted = String::new();
    for (at, kind, field) in fields(&lines).into_iter().step_by(nth) {
        if kept.ports && UNCONFIRMED.contains(&(kind.as_str(), field.as_str())) {
            continue;
        }
        let mut changed = lines.clone();
        changed[at][&field] = other(&lines[at][&field]);
        let mut removed = lines.clone();
        removed[at]
            .as_object_mut()
            .expect("an object")
            .remove(&field);
        for (how, edited) in [("changed", changed), ("removed", removed)] {
            // Without `unplaced` there are none.
            let same = how == "removed" && field == "unplaced" && lines[at][&field] == 0;
            if !same && !kept.refused(&edited) {
                let _infallible = writeln!(accepted, "{kind}.{field} {how} in line {}", at + 1);
            }
        }
    }
    // A line of each kind, where it first and where it last stands.
    let mut kinds = BTreeSet::new();
    let forward = lines.iter().enumerate();
    let mut places: Vec<usize> = Vec::new();
    for (at, line) in forward.clone().chain(forward.rev()) {
        let kind = line["kind"].as_str().expect("a kind").to_owned();
        if kinds.insert((kind, at > lines.len() / 2)) {
            places.push(at);
        }
    }
    for at in places.into_iter().step_by(nth) {
        let mut deleted = lines.clone();
        let line = deleted.remove(at);
        let mut doubled = lines.clone();
        doubled.insert(at, line.clone());
        for (how, edited) in [("deleted", deleted.clone()), ("doubled", doubled)] {
            if !kept.refused(&edited) {
                let _infallible = writeln!(accepted, "line {} {how}: {line}", at + 1);
            }
        }
        let count = lines.len();
        for to in [1, count / 4, count / 2, count - 2] {
            let mut moved = deleted.clone();
            moved.insert(to, line.clone());
            let same = match kept.ports {
                // Bytes with the same value may come at each other's times: nothing confirms the clock of the computer.
                true => timeless(&moved) == timeless(&lines),
                false => moved == lines,
            };
            if !same && !kept.refused(&moved) {
                let _infallible = writeln!(accepted, "line {} moved to {}: {line}", at + 1, to + 1);
            }
        }
    }
    files(kept, nth, &mut accepted);
    assert!(accepted.is_empty(), "verify accepts:\n{accepted}");
}

/// The lines of a record without the times of received bytes.
fn timeless(lines: &[Value]) -> Vec<Value> {
    let mut lines = lines.to_vec();
    for line in &mut lines {
        if line["kind"] == "received" {
            line["t"] = Value::Null;
        }
    }
    lines
}

/// Each file of the folder but the record, with a byte more, and one that does not belong there.
fn files(kept: &Kept, nth: usize, accepted: &mut String) {
    let folder = kept.folder();
    let mut all: Vec<PathBuf> = Vec::new();
    for part in ["", "scenarios", "captures"] {
        let entries = fs::read_dir(folder.join(part)).expect("a folder");
        let mut paths: Vec<_> = entries
            .map(|entry| entry.expect("an entry").path())
            .collect();
        paths.sort();
        // A qualification leaves many of the same kind.
        all.extend(paths.into_iter().take(if part.is_empty() { 20 } else { 4 }));
    }
    for path in all.into_iter().filter(|path| path.is_file()).step_by(nth) {
        let name = path
            .strip_prefix(&folder)
            .expect("inside")
            .display()
            .to_string();
        let excused = ["SHA256SUMS", "run.jsonl"];
        if excused.contains(&name.as_str()) {
            continue;
        }
        let before = fs::read(&path).expect("a file");
        let text = String::from_utf8(before.clone()).expect("a text");
        let doubled = text.replacen("passed", "failed", 1) + "\n";
        fs::write(&path, doubled).expect("room");
        fit(&folder);
        if !kept.is_refused() {
            let _infallible = writeln!(accepted, "{name} changed");
        }
        fs::remove_file(&path).expect("a file");
        fit(&folder);
        if !kept.is_refused() {
            let _infallible = writeln!(accepted, "{name} deleted");
        }
        fs::write(&path, before).expect("room");
    }
    fs::write(folder.join("captures/more.json"), "{}\n").expect("room");
    fit(&folder);
    if !kept.is_refused() {
        accepted.push_str("captures/more.json added\n");
    }
    fs::remove_file(folder.join("captures/more.json")).expect("a file");
    fit(&folder);
}
