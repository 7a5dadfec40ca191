//! Qualifications that are spread over machines: the merged parts say what one machine says, and never more than they have shown.

use crate::program::{Desk, ended, said};
use std::fs;
use std::path::Path;
use std::process::Output;

/// A rig with simulated drives of a bus; `setup` are lines for one of them.
struct Bench {
    desk: Desk,
    scenarios: &'static [&'static str],
}

impl Bench {
    /// Two ND21, and two scenarios: the second one alone reads the last word of the RAM.
    fn ring(setup: &str) -> Self {
        let setup = format!("drives = 2\ntransport = \"sim\"\n[sim]\nsetup = [{setup}]\n");
        Self {
            desk: Desk::new(&setup),
            scenarios: &["9.2-bad-sync-bytes", "10.1-ends-of-pages"],
        }
    }

    fn port(bus: &str, drive: &str, setup: &str, scenarios: &'static [&'static str]) -> Self {
        let desk = Desk::of_file(&format!(
            "schema = 2\n[rig]\nid = \"desk\"\n[port.1]\nbus = \"{bus}\"\ndrives = [{{ {drive} }}]\n[sim]\nbus = \"{bus}\"\nsetup = [{setup}]\n"
        ));
        Self { desk, scenarios }
    }

    /// A UNITEK drive.
    fn frames(setup: &str) -> Self {
        let scenarios = &["unitek-ex-2-lock", "unitek-5.2-another-interval"];
        Self::port("unitek", "node = 1", setup, scenarios)
    }

    /// A NORDAC inverter.
    fn octets(setup: &str) -> Self {
        let scenarios = &["nordac-en-1-sap-missing", "nordac-en-1-sdn"];
        Self::port("nordac", "address = 8, ppo = 1", setup, scenarios)
    }

    fn qualify(&self, folder: &str, more: &[&str]) -> Output {
        let fixed = ["qualify", "--rig", "desk.toml", "--evidence", folder];
        self.desk.run(&[&fixed, more, self.scenarios].concat())
    }

    /// Qualifies in one piece and in two parts.
    fn qualify_all(&self) -> Output {
        for number in ["1", "2"] {
            self.qualify(number, &["--partition", &format!("slice:{number}/2")]);
        }
        self.qualify("whole", &[])
    }

    fn merge(&self, folders: &[&str], output: &str) -> Output {
        self.desk
            .run(&[&["merge"], folders, &["--output", output]].concat())
    }

    fn text(&self, folder: &str, file: &str) -> String {
        fs::read_to_string(self.desk.path(folder).join(file)).expect("a file")
    }

    /// What `deviations.txt` says, without how much each part has received: each has read its drives at first.
    fn deviations(&self, folder: &str) -> String {
        let text = self.text(folder, "deviations.txt");
        let lines = text
            .lines()
            .map(|line| match line.split_once(" inconclusive; ") {
                Some((before, behind)) => match behind.split_once(" received; ") {
                    Some((_, behind)) => format!("{before}; {behind}\n"),
                    None => format!("{line}\n"),
                },
                None => format!("{line}\n"),
            });
        lines.collect()
    }

    /// What `profile.toml` says, without its date.
    fn profile(&self, folder: &str) -> String {
        let text = self.text(folder, "profile.toml");
        let lines = text.lines().filter(|line| !line.starts_with("date = "));
        lines.map(|line| format!("{line}\n")).collect()
    }

    /// Compares the merged parts with one machine.
    #[track_caller]
    fn equals_one_machine(&self, code: i32, words: &str) {
        let whole = self.qualify_all();
        ended(&whole, code, words);
        let merged = self.merge(&["2", "1"], "merged");
        ended(&merged, code, words);
        assert_eq!(self.deviations("merged"), self.deviations("whole"));
        assert_eq!(self.profile("merged"), self.profile("whole"));
        // What a wrong drive does in a scenario depends on what was played before it, of which a part plays less.
        let report = |folder| {
            let text = self.text(folder, "report.txt");
            let lines = text
                .lines()
                .filter(|line| code == 0 || !line.starts_with(' '));
            lines.map(|line| format!("{line}\n")).collect::<String>()
        };
        assert_eq!(report("merged"), report("whole"));
        ended(&self.desk.run(&["verify", "merged"]), 0, "0 things wrong");
    }

    /// A part that was killed behind its first scenario.
    fn kill(&self, folder: &str) {
        let path = self.desk.path(folder);
        let record = self.text(folder, "run.jsonl");
        let mut kept = String::new();
        for line in record.lines() {
            kept.push_str(line);
            kept.push('\n');
            if line.contains("{\"kind\":\"case\"") {
                break;
            }
        }
        assert!(kept.len() < record.len(), "a record that goes on");
        fs::write(path.join("run.jsonl"), kept).expect("room");
        for file in fs::read_dir(&path).expect("a folder") {
            let name = file.expect("an entry").file_name();
            let name = name.to_str().expect("a name");
            if ["SHA256SUMS", "junit.xml", "report.txt", "report.html"].contains(&name)
                || ["deviations.txt", "profile.toml"].contains(&name)
            {
                fs::remove_file(path.join(name)).expect("a file");
            }
        }
    }

    /// A part that is missing or was killed leaves it open whether the drives are right.
    #[track_caller]
    fn is_open_without_a_part(&self) {
        let missing = self.merge(&["1"], "half");
        ended(&missing, 5, "part slice:2/2 is missing: 1 scenario not run");
        self.kill("2");
        let killed = self.merge(&["1", "2"], "killed");
        ended(&killed, 5, "incomplete   part slice:2/2");
        for folder in ["half", "killed"] {
            let text = self.text(folder, "deviations.txt");
            assert!(text.starts_with("deviations: not known"), "{text}");
            let verified = self.desk.run(&["verify", folder]);
            ended(&verified, 5, "0 things wrong; incomplete");
        }
    }
}

#[test]
fn parts_of_right_drives_equal_one_machine() {
    right(
        &Bench::frames(""),
        "deviations: none; everything received is",
    );
}

#[test]
#[ignore = "takes two minutes; .ci/nightly runs it"]
fn more_parts_of_right_drives_equal_one_machine() {
    right(&Bench::ring(""), "deviations: none; every byte is");
    right(
        &Bench::octets(""),
        "deviations: none; everything received is",
    );
}

fn right(bench: &Bench, words: &str) {
    bench.equals_one_machine(0, words);
    bench.is_open_without_a_part();
}

/// The deviation of a drive on frames shows in the second part alone, which the first part does not know.
#[test]
#[ignore = "takes three minutes; .ci/nightly runs it"]
fn parts_name_the_deviation_of_one_machine() {
    let wrong = Bench::frames("\"drive 1 deviates interval-one-more\"");
    wrong.equals_one_machine(1, "deviation: drive 1: interval-one-more (UNITEK 5.2)");
    let first = wrong.text("1", "deviations.txt");
    assert!(first.starts_with("deviations: none;"), "{first}");
    let wrong = Bench::octets("\"slave 8 deviates any-ident\"");
    wrong.equals_one_machine(1, "deviation: slave 8: any-ident (NORDAC EN 2)");
}

/// ND21 10.1: the deviation shows in the second part alone, which the first part does not know.
#[test]
#[ignore = "takes a minute; .ci/nightly runs it"]
fn a_deviation_that_one_part_shows_is_named() {
    let bench = Bench::ring("\"drive 1 deviates last-word-refused\"");
    bench.equals_one_machine(1, "deviation: drive 1: last-word-refused (ND21 10.1)");
    let first = bench.text("1", "deviations.txt");
    assert!(first.starts_with("deviations: none;"), "{first}");
    let missing = bench.merge(&["1"], "half");
    ended(&missing, 5, "part slice:2/2 is missing");
    let half = bench.text("half", "deviations.txt");
    assert!(half.starts_with("deviations: not known"), "{half}");
    // What is wrong stays wrong without the other part, and the files of the merged folder follow from the parts.
    ended(
        &bench.merge(&["2"], "wrong"),
        1,
        "part slice:1/2 is missing",
    );
    let path = bench.desk.path("merged/deviations.txt");
    fs::write(path, "deviations: none\n").expect("room");
    let verified = bench.desk.run(&["verify", "merged"]);
    ended(&verified, 1, "deviations.txt, line 1");
}

/// ND21 9.7: the scenarios pass, and the deviation that the conversations show fails the drives all the same.
#[test]
fn a_deviation_fails_merged_parts_whose_scenarios_pass() {
    let ring =
        "drives = 2\ntransport = \"sim\"\n[sim]\nsetup = [\"drive 1 deviates counts-7-zeros\"]\n";
    let bench = Bench {
        desk: Desk::limited(ring, ""),
        scenarios: &["9.2-synco", "9.8-sequence-with-gaps"],
    };
    for part in ["1", "2"] {
        bench.qualify(part, &["--partition", &format!("slice:{part}/2")]);
    }
    let merged = bench.merge(&["1", "2"], "merged");
    ended(&merged, 1, "2 passed, 0 failed");
    ended(&merged, 1, "deviation: drive 1: counts-7-zeros");
}

/// Parts are of one qualification of one rig: the same file, the same scenarios, all of them qualified.
#[test]
fn parts_of_others_are_refused() {
    let bench = Bench::frames("");
    bench.qualify("1", &["--partition", "slice:1/2"]);
    let run = ["run", "--rig", "desk.toml", "--partition", "slice:2/2"];
    let run = [&run[..], &["--evidence", "run"], bench.scenarios].concat();
    bench.desk.run(&run);
    let refused = |folders: &[&str], words: &str| {
        ended(&bench.merge(folders, "out"), 2, words);
        assert!(!bench.desk.path("out/merge.json").exists());
    };
    refused(
        &["1", "run"],
        "the purpose is qualify in the first and run in the second",
    );
    refused(&["1", "1"], "are both slice:1/2");
    let file = bench.desk.path("desk.toml");
    append(&file, "# another text\n");
    bench.qualify("other", &["--partition", "slice:2/2"]);
    refused(&["1", "other"], "the sum of the rig's file is ");
}

fn append(path: &Path, more: &str) {
    let text = fs::read_to_string(path).expect("a file");
    fs::write(path, text + more).expect("room");
}

/// ND21 9.7: questions to the ring and exchanged roles, which each part asks about what it has met itself, are judged together.
#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn trials_of_parts_are_judged_together() {
    let ring = "drives = 2\ntransport = \"sim\"\n[sim]\nsetup = [\"drive 1 deviates read-long-reversed\"]\n";
    let bench = Bench {
        desk: Desk::new(ring),
        scenarios: &["10.1-fixed-bytes", "10.1-read-long-ends", "10.1-read-long"],
    };
    let whole = bench.qualify_all();
    ended(&whole, 1, "deviation: drive 1: read-long-reversed");
    let merged = bench.merge(&["1", "2"], "merged");
    assert_eq!(merged.status.code(), Some(1), "{}", said(&merged));
    assert_eq!(bench.deviations("merged"), bench.deviations("whole"));
    assert_eq!(bench.profile("merged"), bench.profile("whole"));
    ended(&bench.desk.run(&["verify", "merged"]), 0, "0 things wrong");
}
