//! Files of recorded values: `watch --csv`, `watch --html`, `scope --csv`, and `plot`, which reads them.

use super::*;

fn done_in(folder: &Path, line: &str) -> String {
    let arguments: Vec<_> = line.split_whitespace().collect();
    let (code, stdout, stderr) = drivebench_in(folder, &arguments);
    assert_eq!(code, 0, "{line}\n{stderr}");
    stdout
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Every bus: the file of `--csv` is what `--format csv` shows, and what is drawn has a curve for each column.
#[test]
fn watch_writes_its_values() {
    let folder = folder("watch-files");
    for (bench, cells, names) in [
        ("sim:2", "nist Status", ["0 nist [rpm]", "1 Status [hex]"]),
        (
            "sim:unitek",
            "30 40",
            ["1 SPEED_ACTUAL [%]", "1 STATUS [hex]"],
        ),
        ("sim:nordac", "HIW ZSW", ["8 HIW [%]", "8 ZSW [hex]"]),
    ] {
        let watch = format!("watch --rig {bench} all {cells} --every 20ms --for 100ms");
        let csv = done_in(&folder, &format!("{watch} --format csv"));
        let text = done_in(
            &folder,
            &format!("{watch} --csv w.csv --html w.html --svg w.svg"),
        );
        assert_eq!(read(&folder, "w.csv"), csv, "{bench}");
        assert_eq!(text.lines().count() + 1, csv.lines().count(), "{bench}");
        for name in names {
            assert!(
                csv.lines().next().expect("a heading").contains(name),
                "{csv}"
            );
            for drawn in ["w.html", "w.svg"] {
                let words = format!("{name}: {} sample", csv.lines().count() - 1);
                assert!(
                    read(&folder, drawn).contains(&words),
                    "{bench} {drawn} {words}"
                );
            }
        }
        // It is read back with all its curves.
        let plot = done_in(&folder, "plot w.csv");
        let columns = csv.lines().next().expect("a heading").split(',').count();
        assert_eq!(plot.lines().count(), columns, "{plot}");
    }
}

/// A file that cannot be written is refused before the first reading.
#[test]
fn files_are_refused_first() {
    for option in ["--csv", "--html", "--svg"] {
        let line = format!("watch 0 nist {option} no/such/folder/w");
        refused(&line, 2, &["no such folder"]);
    }
    // A bench that cannot be opened leaves the last recording as it is.
    let folder = folder("watch-kept");
    std::fs::write(folder.join("w.csv"), "the last one").expect("a file");
    let line = "watch 0 nist --rig none.toml --csv w.csv --html w.csv";
    let arguments: Vec<_> = line.split_whitespace().collect();
    assert_eq!(drivebench_in(&folder, &arguments).0, 2);
    assert_eq!(read(&folder, "w.csv"), "the last one");
    let many = "watch 0 nist --every 1ms --for 200s --svg w.svg";
    refused(many, 2, &["draw at most 100000 readings", "--csv"]);
}

/// Two steps of the same drive: what tells them apart is printed, and both are drawn.
#[test]
fn plot_compares_two_recordings() {
    let folder = folder("plot-two");
    for (name, speed) in [("slow", 500), ("fast", 1500)] {
        let line = format!(
            "scope 0 nist --trigger nist --level 100rpm --time-base 864us --delay -5ms --then nsoll={speed}rpm --move --csv {name}.csv"
        );
        done_in(&folder, &line);
    }
    let plot = done_in(
        &folder,
        "plot slow.csv fast.csv --align trigger --output both.html",
    );
    let rows: Vec<_> = plot.lines().collect();
    assert!(
        rows[0].starts_with("curve") && rows[0].ends_with("settling"),
        "{plot}"
    );
    assert!(rows[1].starts_with("slow: nist  0 rpm  "), "{plot}");
    assert!(rows[2].starts_with("fast: nist  0 rpm  "), "{plot}");
    let page = read(&folder, "both.html");
    for part in [
        "slow: nist [rpm]: 256 samples, every 0.864 ms",
        "fast: nist [rpm]: 256 samples, every 0.864 ms",
        "Time 0 is the trigger of each recording.",
        "class=\"q q0 p0\"",
        "class=\"q q1 p1\"",
        "the mean of the samples in the last tenth",
    ] {
        assert!(page.contains(part), "{part}\n{plot}");
    }
    done_in(&folder, "plot slow.csv fast.csv -o both.svg");
    let picture = read(&folder, "both.svg");
    assert!(
        picture.starts_with("<svg ") && picture.contains("xmlns=\"http://www.w3.org/2000/svg\"")
    );
    assert!(picture.contains("Time 0 is the first sample of each recording."));
    let only = done_in(&folder, "plot slow.csv --only nist");
    assert_eq!(only.lines().count(), 2, "{only}");
    // What a scenario recorded.
    let scenario = "13.1.1-interrupted";
    done_in(
        &folder,
        &format!("trace {scenario} --format json --output r.json"),
    );
    let plot = done_in(&folder, "plot r.json");
    assert!(
        plot.contains("\nr: 1 nist") && plot.contains("\nr: 1 Flags2"),
        "{plot}"
    );
}

#[test]
fn plot_refuses_what_is_no_recording() {
    let folder = folder("plot-wrong");
    let file = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("a file");
    file("w.csv", "time_ms,0 nist [rpm]\n0,1\n1,2\n");
    file("wrong.csv", "time_ms,0 nist [rpm]\n0,1\n1,2x\n");
    done_in(&folder, "trace 9.2-synco --format csv --output bytes.csv");
    for (line, parts) in [
        (
            "plot wrong.csv",
            [
                "wrong.csv: line 3, column 2 (`0 nist [rpm]`): \"2x\" is no value",
                "",
            ],
        ),
        (
            "plot w.csv bytes.csv",
            ["bytes.csv: it lists what a line carried", "scope --csv"],
        ),
        ("plot none.csv", ["failed to read none.csv", ""]),
        ("plot .", ["failed to read .", "not a regular file"]),
        ("plot w.csv --output w.png", ["must end in .html", ".svg"]),
        ("plot w.csv --output no/w.svg", ["no such folder", ""]),
        (
            "plot w.csv --align trigger",
            [
                "w.csv: --align trigger is for recordings of `scope`",
                "--align first",
            ],
        ),
        (
            "plot w.csv --only nsoll",
            ["no curve has nsoll in its name", ""],
        ),
    ] {
        let arguments: Vec<_> = line.split_whitespace().collect();
        let (code, stdout, stderr) = drivebench_in(&folder, &arguments);
        assert_eq!((code, &*stdout), (2, ""), "{line}\n{stderr}");
        for part in parts {
            assert!(stderr.contains(part), "{line}\n{part}\n{stderr}");
        }
    }
}
