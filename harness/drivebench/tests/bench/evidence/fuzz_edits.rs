//! Edited folders of `fuzz run` on simulated drives, whose sums were made to fit again.

use crate::edits::fit;
use crate::program::{Desk, ended, findings, said};
use serde_json::Value;
use std::fs;
use std::path::PathBuf;

/// The folder of a run with a few findings.
struct Run {
    desk: Desk,
}

impl Run {
    fn new() -> Self {
        let desk = Desk::new("drives = 2\ntransport = \"sim\"\n");
        let planted = [
            "--deviates",
            "1=writes-ignored",
            "--deviates",
            "0=and-is-or",
        ];
        let fixed = ["fuzz", "run", "--rig", "sim:2", "--findings", "3"];
        let run = [&fixed[..], &planted, &["--out", "kept"]].concat();
        ended(&desk.run(&run), 1, "3 found");
        let own = Self { desk };
        own.is_right();
        own
    }

    fn folder(&self) -> PathBuf {
        self.desk.path("kept")
    }

    fn record(&self) -> Vec<String> {
        let text = fs::read_to_string(self.folder().join("run.jsonl")).expect("a record");
        text.lines().map(str::to_owned).collect()
    }

    fn is_right(&self) {
        let output = self.desk.run(&["verify", "kept"]);
        ended(&output, 0, "3 findings judged again, 0 things wrong");
    }

    #[track_caller]
    fn refused(&self, code: i32, words: &str) {
        fit(&self.folder());
        ended(&self.desk.run(&["verify", "kept"]), code, words);
    }

    /// Writes another record, which is refused with these words.
    #[track_caller]
    fn edited(&self, lines: &[String], words: &str) {
        let path = self.folder().join("run.jsonl");
        let before = fs::read(&path).expect("a record");
        let text = lines.join("\n") + "\n";
        assert_ne!(text.as_bytes(), before, "{words}");
        fs::write(&path, text).expect("room");
        self.refused(1, words);
        fs::write(&path, before).expect("room");
    }
}

/// The places of the lines of a kind.
fn places(lines: &[String], kind: &str) -> Vec<usize> {
    let kind = format!("{{\"kind\":\"{kind}\"");
    let all = lines.iter().enumerate();
    all.filter(|(_, line)| line.starts_with(&kind))
        .map(|(place, _)| place)
        .collect()
}

#[test]
fn lines_of_a_fuzz_run() {
    let run = Run::new();
    let lines = run.record();
    let found = places(&lines, "finding");
    let edit = |place: usize, from: &str, to: &str, words: &str| {
        let mut edited = lines.clone();
        edited[place] = edited[place].replacen(from, to, 1);
        run.edited(&edited, words);
    };
    let first = found[0];
    let outside = "is not the name of its files";
    edit(first, "\"file\":\"", "\"file\":\"../kept/", outside);
    edit(first, "\"file\":\"", "\"file\":\"x", outside);
    edit(
        first,
        "\"confirmed\":true",
        "\"confirmed\":false",
        "is not the finding of the record",
    );
    edit(
        0,
        "\"drives\":2",
        "\"drives\":3",
        "for other drives than the run has",
    );
    edit(
        0,
        "\"confirm\":2",
        "\"confirm\":1",
        "seen again 1 of 1 times",
    );
    let round = places(&lines, "swarm")[0];
    let spice = lines[round]
        .split('"')
        .nth_back(1)
        .expect("a name")
        .to_owned();
    edit(0, &format!("\"{spice}\""), "\"other\"", "the run has no `");
    edit(
        round,
        "\"round\":0",
        "\"round\":1",
        "is not the one that follows",
    );
    let last = lines.len() - 1;
    let cases: Value = serde_json::from_str(&lines[last]).expect("JSON");
    let cases = format!("\"cases\":{}", cases["cases"]);
    edit(
        last,
        &cases,
        "\"cases\":999999",
        "999999 cases, which do not fit",
    );
    let mut swapped = lines.clone();
    swapped.swap(found[0], found[1]);
    run.edited(&swapped, "is not behind the one before it");
    let mut doubled = lines.clone();
    doubled.insert(first, lines[first].clone());
    run.edited(&doubled, "is not behind the one before it");
    let mut deleted = lines.clone();
    deleted.remove(first);
    run.edited(&deleted, ".json is not a file of the run");
    run.refused(0, "0 things wrong");
}

#[test]
fn files_of_a_fuzz_run() {
    let run = Run::new();
    let all = findings(&run.folder());
    let (other, one) = (&all[0], &all[1]);
    let text = fs::read_to_string(one).expect("a finding");
    let finding: Value = serde_json::from_str(&text).expect("JSON");
    for (path, value) in [
        ("/difference/drive", Value::from(1)),
        ("/difference/about", "another sentence".into()),
        ("/difference/section", "9.9".into()),
        ("/seen_again", 1.into()),
        ("/of", 3.into()),
        ("/confirmed", false.into()),
        ("/number", 7.into()),
    ] {
        let mut changed = finding.clone();
        *changed.pointer_mut(path).expect("a field") = value;
        assert_ne!(changed, finding, "{path}");
        fs::write(one, changed.to_string()).expect("room");
        run.refused(1, "differs      case ");
    }
    // Those of two findings exchanged.
    fs::write(one, fs::read(other).expect("a finding")).expect("room");
    run.refused(1, "differs      case ");
    fs::remove_file(one).expect("a file");
    run.refused(1, "differs      case ");
    fs::write(one, &text).expect("room");
    for name in ["more.txt", "finding-00001.json", "finding-000000-large.scn"] {
        let more = run.folder().join(name);
        fs::write(&more, "{}\n").expect("room");
        run.refused(1, &format!("{name} is not a file of the run"));
        fs::remove_file(more).expect("a file");
    }
    // A file that does not fit the sums, what `shrink` makes behind them, and a run that was killed, which has none.
    fs::write(one, text.clone() + "\n").expect("room");
    ended(&run.desk.run(&["verify", "kept"]), 1, "was changed");
    fs::write(one, &text).expect("room");
    fit(&run.folder());
    let small = one.with_extension("").to_string_lossy().into_owned() + "-small.scn";
    fs::write(&small, "title x\n").expect("room");
    ended(&run.desk.run(&["verify", "kept"]), 0, "`shrink` made it");
    fs::remove_file(small).expect("a file");
    let sums = run.folder().join("SHA256SUMS");
    fs::remove_file(&sums).expect("a file");
    ended(&run.desk.run(&["verify", "kept"]), 5, "the run did not end");
    // It may leave such a file.
    let more = run.folder().join("finding-99999999.json");
    fs::write(&more, &text).expect("room");
    run.refused(5, "the record ends before its case");
    fs::remove_file(more).expect("a file");
    run.refused(0, "0 things wrong");
    let said = said(&run.desk.run(&["verify", "kept"]));
    let words = "unconfirmed  that nothing more was found or kept: a finding that is removed";
    assert!(said.contains(words), "{said}");
}
