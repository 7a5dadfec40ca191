//! What no compiler keeps: import directions, citations that resolve, a snapshot for each scenario and no
//! orphan, no over-long file.

use super::crates::BUS_FOLDERS;
use harness::buses::BUSES;
use harness::library::Entry;
use harness::manual::NOT_YET;
use harness::scenario::source::Source;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Lines of a file that ask whether it holds two things.
const MAX_LINES: usize = 650;

/// Chapters of the ND21 manual whose tables and examples all have to be pinned by a scenario.
const PINNED: [&str; 5] = ["8.", "9.", "10.", "13.", "14."];

/// Tables of these chapters that show in no byte: the connection diagram of plug X3, and `HwVersion` before
/// July 1993, which the model, a newer drive, has not got.
const NOT_IN_BYTES: [&str; 2] = ["nd21 13.1.5.1", "nd21 14.3.3 old"];

pub(super) fn root() -> &'static Path {
    Path::new(env!("TREE"))
}

pub(super) fn files(folder: &str, ending: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == ending) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

pub(super) fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn scenarios() -> Vec<(PathBuf, Entry)> {
    let all: Vec<_> = files("corpora/scenarios", "scn")
        .into_iter()
        .map(|path| {
            let source = Source::read(&path).expect("a text");
            let entry = Entry::new(source, None)
                .unwrap_or_else(|p| panic!("{}: {:#?}", path.display(), p.all()));
            (path, entry)
        })
        .collect();
    assert!(!all.is_empty(), "corpora/scenarios is empty");
    all
}

#[test]
fn imports_go_one_way() {
    let forbidden = [
        (
            "harness/proto/src",
            ["harness_sim", "harness::", "std::time"].as_slice(),
        ),
        ("harness/sim/src", &["harness::", "std::time"]),
        // The ring knows no drive, and the reference model shares nothing.
        ("harness/sim/src/novobus/ring.rs", &["plain", "bus_end"]),
        (
            "harness/sim/src/novobus/link.rs",
            &["plain", "bus_end", "device"],
        ),
        (
            "harness/sim/src/novobus/reference.rs",
            &["harness_proto", "crate::"],
        ),
        // A CAN bus knows no device, and the reference of a drive shares nothing with it but the table of registers.
        ("harness/proto/src/can.rs", &["unitek", "novobus"]),
        ("harness/sim/src/segment.rs", &["unitek", "novobus"]),
        (
            "harness/sim/src/octet_segment.rs",
            &["nordac", "profibus", "unitek", "novobus"],
        ),
        // The bus knows no device on it.
        (
            "harness/proto/src/profibus",
            &["nordac", "unitek", "novobus"],
        ),
        (
            "harness/sim/src/unitek/reference.rs",
            &["drive", "plant", "cycles", "outbox", "frame::", "crate::"],
        ),
        // The reference of an inverter shares nothing with it but the list of parameters.
        (
            "harness/sim/src/nordac/reference/inverter.rs",
            &["crate::", "super::", "pkw", "words", "ratio", "properties"],
        ),
        // The master and the drive share the codec and nothing else.
        (
            "harness/proto/src/novobus/master",
            &["bus_end", "error_mode", "parameter_channel", "Memory"],
        ),
        // A scenario sees a link; only `simulate` makes simulated ones.
        (
            "harness/bench/src/scenario/run",
            &["harness_sim", "SimulatedLink"],
        ),
        (
            "harness/novobus/src/language/run",
            &[
                "harness_sim::novobus::ring",
                "harness_sim::novobus::bench",
                "SimulatedLink",
            ],
        ),
        ("harness/bench/src/report", &["crate::link"]),
        (
            "harness/drivebench/src/library",
            &["crate::link", "crate::cli"],
        ),
        ("harness/novobus/src/report", &["crate::link", "crate::cli"]),
    ];
    for (place, words) in forbidden {
        let path = root().join(place);
        let sources = if path.is_dir() {
            files(place, "rs")
        } else {
            vec![path]
        };
        assert!(!sources.is_empty());
        for source in sources.iter().filter(|s| !s.ends_with("tests.rs")) {
            for (number, line) in read(source).lines().enumerate() {
                let code = line.split("//").next().unwrap_or_default();
                let found = words.iter().find(|word| code.contains(**word));
                assert_eq!(found, None, "{}:{}", source.display(), number + 1);
            }
        }
    }
}

/// The rooms of the engine: each imports from those in front of it only. The compiler keeps the buses out of it.
const ENGINE: [&str; 33] = [
    "counted",
    "bus_name",
    "regular",
    "partition",
    "signals",
    "trouble",
    "medium",
    "listen",
    "html",
    "traffic",
    "frames",
    "port",
    "link",
    "scenario",
    "manual",
    "file",
    "report",
    "guard",
    "rig",
    "capture",
    "shown",
    "evidence",
    "qualify",
    "explore",
    "campaign",
    "fuzz",
    "web",
    "serve",
    "top",
    "command",
    "embed",
    "bus",
    "lib",
];

/// The rooms of the program, which all stand behind those of the engine.
const PROGRAM: [&str; 9] = [
    "buses", "library", "evidence", "fuzz", "command", "embed", "lib", "cli", "main",
];

#[test]
fn rooms_import_from_rooms_in_front_of_them() {
    let place = |rooms: &[&str], name: &str| rooms.iter().position(|room| *room == name);
    for (top, rooms, below) in [
        ("harness/bench/src", &ENGINE[..], &[][..]),
        ("harness/drivebench/src", &PROGRAM, &ENGINE),
    ] {
        let base = root().join(top);
        // Its file is one of harness-proto.
        let mut seen = BTreeSet::from(["counted".to_owned()]);
        for source in files(top, "rs") {
            let inner = source.strip_prefix(&base).expect("inside");
            let inner = inner.display().to_string();
            let room = inner.split(['/', '.']).next().expect("a name").to_owned();
            let at = place(rooms, &room);
            let at = at.unwrap_or_else(|| panic!("{room} is not in the list of rooms"));
            let text = read(&source);
            let lines = text.lines().enumerate().filter(|_| room != "lib");
            for (number, line) in lines {
                let code = line.split("//").next().unwrap_or_default();
                for (_, path) in code
                    .match_indices("crate::")
                    .map(|(at, _)| code.split_at(at + 7))
                {
                    let name: String = path
                        .chars()
                        .take_while(|c| c.is_alphanumeric() || *c == '_')
                        .collect();
                    let in_front = match place(rooms, &name) {
                        Some(other) => other <= at,
                        None => place(below, &name).is_some(),
                    };
                    assert!(
                        in_front,
                        "{inner}:{}: {room} imports from {name}, which is not in front of it",
                        number + 1
                    );
                }
            }
            seen.insert(room);
        }
        let missing: Vec<_> = rooms.iter().filter(|room| !seen.contains(**room)).collect();
        assert!(missing.is_empty(), "no such room: {missing:?}");
    }
}

/// The page "A fourth bus" names traits that there are.
#[test]
fn the_page_on_a_fourth_bus_holds() {
    let page = read(&root().join("CONTRIBUTING.md"));
    let start = page.find("## A fourth bus").expect("the page");
    let page = page[start..].split("\n## ").next().expect("its end");
    let sources = [
        "harness/drivebench/src",
        "harness/bench/src",
        "harness/sim/src",
    ];
    let sources = sources.into_iter().flat_map(|top| files(top, "rs"));
    let sources: String = sources.map(|path| read(&path)).collect();
    let rows = page.lines().filter(|line| line.starts_with("| ")).skip(1);
    let cells = rows.filter_map(|row| row.split('|').nth(2));
    let names: Vec<_> = cells
        .flat_map(|cell| cell.split('`').skip(1).step_by(2))
        .collect();
    assert!(names.len() > 10, "{names:?}");
    for name in names {
        let declared = [" ", ":", "<"].map(|end| format!("trait {name}{end}"));
        assert!(
            declared.iter().any(|words| sources.contains(words)),
            "there is no trait {name}"
        );
    }
}

/// Names that stand for more than one public type: twice among the rooms or in one bus, or in a room and in a bus. Two buses may use one name.
/// The number may only fall.
const NAMES_TWICE: usize = 9;

#[test]
fn a_name_is_one_type() {
    let mut declared: BTreeMap<String, BTreeMap<&str, BTreeSet<PathBuf>>> = BTreeMap::new();
    let tests = ["tests.rs", "_test.rs", "reference.rs"];
    let folders = [
        "drivebench/src",
        "bench/src",
        "unitek/src",
        "nordac/src",
        "proto/src",
        "sim/src",
    ];
    let folders = folders.map(|folder| format!("harness/{folder}"));
    for path in folders.map(|folder| files(&folder, "rs")).concat() {
        let place = path.display().to_string();
        if tests.iter().any(|ending| place.ends_with(ending)) {
            continue;
        }
        let of = |folder: &&str| place.contains(&format!("/{folder}/"));
        let bus = BUS_FOLDERS.iter().find(|folders| folders.iter().any(of));
        let bus = bus.map_or("rooms", |folders| folders[0]);
        for line in read(&path).lines() {
            let words = line
                .strip_prefix("pub ")
                .or_else(|| line.strip_prefix("pub(crate) "));
            let Some((kind, rest)) = words.and_then(|words| words.split_once(' ')) else {
                continue;
            };
            if ["struct", "enum", "trait"].contains(&kind) {
                let end = rest
                    .find(|c: char| !c.is_alphanumeric())
                    .unwrap_or(rest.len());
                let buses = declared.entry(rest[..end].to_owned()).or_default();
                buses.entry(bus).or_default().insert(path.clone());
            }
        }
    }
    declared.retain(|_, places| {
        let twice = places.values().any(|files| files.len() > 1);
        twice || places.len() > 1 && places.contains_key("rooms")
    });
    assert!(
        declared.len() <= NAMES_TWICE,
        "{} names are those of several types, the limit is {NAMES_TWICE}: {declared:#?}",
        declared.len()
    );
}

#[test]
fn every_scenario_has_a_snapshot_and_no_snapshot_is_an_orphan() {
    let name = |path: &Path, base: &str| {
        let inner = path.strip_prefix(root().join(base)).expect("inside");
        inner.with_extension("").display().to_string()
    };
    let inputs: BTreeSet<_> = files("corpora/scenarios", "scn")
        .iter()
        .map(|p| name(p, "corpora"))
        .collect();
    let outputs = |folder: &str| -> BTreeSet<String> {
        let outputs = files(folder, "snap");
        outputs.iter().map(|p| name(p, "snapshots")).collect()
    };
    assert_eq!(inputs, outputs("snapshots/scenarios"));
    // Only the small campaigns have a snapshot; two more show the messages for files with mistakes, and pairs.
    for output in outputs("snapshots/campaigns")
        .iter()
        .filter(|name| !["campaigns/mistakes", "campaigns/pairs"].contains(&name.as_str()))
    {
        let campaign = root().join("corpora").join(format!("{output}.toml"));
        assert!(campaign.exists(), "{output}");
    }
    // The names of all others stand in what compares them.
    let mut tests = files("harness", "rs");
    tests.push(root().join("scripts/freeze"));
    let tests: String = tests.iter().map(|path| read(path)).collect();
    let endings = ["snap", "txt", "json", "svg"];
    for path in endings.map(|ending| files("snapshots", ending)).concat() {
        let named_file = name(&path, "snapshots");
        let named = ["scenarios/", "campaigns/"];
        let file = path
            .file_name()
            .and_then(|file| file.to_str())
            .expect("a name");
        let literal =
            ["\"", "/"].map(|before| format!("{before}{}\"", file.trim_end_matches(".snap")));
        let compared = named.iter().any(|folder| named_file.starts_with(folder))
            || literal.iter().any(|literal| tests.contains(literal));
        assert!(compared, "no test compares snapshots/{file}");
    }
    assert_eq!(
        files("snapshots", "new"),
        Vec::<PathBuf>::new(),
        "tables to be reviewed"
    );
}

#[test]
fn citations_resolve() {
    let manuals = BUSES.map(|bus| bus.manual);
    let tables: BTreeMap<_, _> = manuals
        .iter()
        .flat_map(|manual| manual.tables().expect("the catalogue"))
        .map(|t| (t.id.clone(), t))
        .collect();
    let mut pinned = BTreeSet::new();
    for (path, entry) in scenarios() {
        assert!(
            !entry.scenario.sources.is_empty(),
            "{}: no `source` line",
            path.display()
        );
        for source in &entry.scenario.sources {
            let place = path.display();
            assert!(
                tables.contains_key(&source.text),
                "{place}: the catalogue has no `{}`",
                source.text
            );
            pinned.insert(source.text.clone());
        }
    }
    for manual in manuals {
        let errata = manual.errata().expect("the ledger");
        let ids: BTreeSet<_> = errata.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids.len(), errata.len(), "an id stands twice in the ledger");
        for erratum in &errata {
            assert_eq!(erratum.document, manual.document, "{}", erratum.id);
            let shown = erratum.shown_by == NOT_YET || pinned.contains(&erratum.shown_by);
            assert!(
                shown,
                "{}: no scenario pins `{}`",
                erratum.id, erratum.shown_by
            );
        }
    }
    // Chapters 8 to 10 of the ND21 are the bus, 13 is the positioning controller, 14 is what the cells mean: every table and example of
    // them is pinned, but for what no byte can show. Of other manuals every one is.
    let pinning = tables.values().filter(|table| {
        let of_chapter = PINNED.iter().any(|c| table.section.starts_with(c));
        of_chapter || !table.id.starts_with("nd21 ")
    });
    for table in pinning.filter(|t| !NOT_IN_BYTES.contains(&t.id.as_str())) {
        assert!(
            pinned.contains(&table.id),
            "no scenario pins `{}` ({})",
            table.id,
            table.title
        );
    }
}

#[test]
fn every_property_is_exercised_and_described() {
    let page = read(&root().join("harness/bench/src/scenario/LANGUAGE.md"));
    let texts: String = files("corpora/scenarios", "scn")
        .iter()
        .map(|path| read(path))
        .collect();
    let bus = &harness_proto::novobus::properties::PROPERTIES;
    let drive = &harness_sim::nd21::PROPERTIES;
    let names = bus
        .iter()
        .map(|p| p.name)
        .chain(drive.iter().map(|p| p.name));
    for name in names {
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
        let set = format!("property {name} =");
        assert!(texts.contains(&set), "no scenario sets {name}");
    }
    let page = read(&root().join("harness/unitek/src/LANGUAGE.md"));
    for property in harness_proto::unitek::properties::PROPERTIES {
        let name = property.name;
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
        let values = match property.accepts {
            harness_proto::unitek::properties::Accepts::Words(words) => words,
            _ => &[""],
        };
        for value in values {
            let set = format!("property {name} = {value}");
            assert!(texts.contains(&set), "no scenario has the line: {set}");
        }
    }
    let page = read(&root().join("harness/nordac/src/LANGUAGE.md"));
    for property in harness_proto::nordac::properties::PROPERTIES {
        let name = property.name;
        assert!(page.contains(&format!("| `{name}` |")), "{name}");
        let values: &[&str] = match property.accepts {
            harness_proto::nordac::properties::Choices::Words(words) => words,
            harness_proto::nordac::properties::Choices::Count { .. } => &[""],
        };
        for value in values {
            let set = format!("property {name} = {value}");
            assert!(texts.contains(&set), "no scenario has the line: {set}");
        }
    }
}

#[test]
fn files_are_not_over_long_and_have_a_doc() {
    for (page, most) in [("README.md", 100), ("ARCHITECTURE.md", 130)] {
        assert!(read(&root().join(page)).lines().count() <= most, "{page}");
    }
    for path in files("harness", "rs") {
        let text = read(&path);
        assert!(text.lines().count() <= MAX_LINES, "{}", path.display());
        assert!(
            text.starts_with("//!"),
            "{}: says nothing of itself",
            path.display()
        );
        assert!(
            !text.contains(&["#[", "allow("].concat()),
            "{}: use expect with a reason",
            path.display()
        );
    }
}

#[test]
fn scenarios_are_readable() {
    for path in files("corpora/scenarios", "scn") {
        for (number, line) in read(&path).lines().enumerate() {
            assert!(
                line.chars().count() <= 120,
                "{}:{}",
                path.display(),
                number + 1
            );
            assert!(
                !line.contains('\t') && line == line.trim_end(),
                "{}:{}",
                path.display(),
                number + 1
            );
        }
    }
}

/// The pictures of the README and of the page on concepts, with the rows that they show.
const PICTURES: [(&str, &[&str]); 4] = [
    ("ring", &[]),
    ("telegram", &["--rows", "1..6"]),
    ("error-mode", &["--rows", "7..24"]),
    ("check-sequence", &["--rows", "25..40"]),
];

/// They are what the program draws from the scenario of that page.
#[test]
fn the_pictures_are_drawn_by_the_program() {
    let page = read(&root().join("harness/docs/concepts.md"));
    let start = page.find("title   A bit is damaged").expect("the scenario");
    let text = page[start..].split("```").next().expect("its end");
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = folder.path().join("parity.scn");
    std::fs::write(&scenario, text).expect("room");
    for (name, rows) in PICTURES {
        let drawn = std::process::Command::new(env!("CARGO_BIN_EXE_drivebench"))
            .args(["trace", "--format", "svg"])
            .args(rows)
            .arg(&scenario)
            .output()
            .expect("the program");
        let kept = read(&root().join(format!("harness/docs/{name}.svg")));
        let rows = rows.join(" ");
        let again =
            format!("drivebench trace parity.scn {rows} --format svg -o harness/docs/{name}.svg");
        assert!(drawn.stdout == kept.as_bytes(), "draw it again: {again}");
    }
}

/// Words that give an aphorism away: a sentence with one of them is rewritten (CONTRIBUTING.md). Each stands with how often it is left in
/// pages and documentation comments; the numbers may only fall.
const TELL_TALE: [(&str, usize); 12] = [
    ("whoever", 0),
    ("somebody", 0),
    ("nobody", 0),
    ("otherwise", 0),
    ("comes home", 0),
    ("come home", 0),
    ("is told", 0),
    ("are told", 0),
    ("so many", 0),
    ("gravest", 0),
    ("anew", 0),
    ("is spared", 0),
];

#[test]
fn prose_is_plain() {
    let excused = ["harness/drivebench/tests/text/tidy.rs"].map(|path| root().join(path));
    let sources = ["harness", "fuzz/src", "fuzz/fuzz_targets"]
        .iter()
        .flat_map(|top| files(top, "rs"));
    let pages = ["harness", "corpora", "rigs", "snapshots"]
        .iter()
        .flat_map(|top| files(top, "md"));
    let top = std::fs::read_dir(root())
        .expect("the checkout")
        .filter_map(|entry| {
            let path = entry.expect("an entry").path();
            path.extension().is_some_and(|e| e == "md").then_some(path)
        });
    let mut found: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for path in sources
        .chain(pages)
        .chain(top)
        .filter(|path| !excused.contains(path))
    {
        let code = path.extension().is_some_and(|e| e == "rs");
        for (number, line) in read(&path).lines().enumerate() {
            let doc = line.trim_start();
            if code && !doc.starts_with("///") && !doc.starts_with("//!") {
                continue;
            }
            let words: String = line
                .to_lowercase()
                .chars()
                .map(|c| if c.is_alphanumeric() { c } else { ' ' })
                .collect();
            let words = format!(
                " {} ",
                words.split_whitespace().collect::<Vec<_>>().join(" ")
            );
            for (word, _) in TELL_TALE {
                if words.contains(&format!(" {word} ")) {
                    let place = format!("{}:{}", path.display(), number + 1);
                    found.entry(word).or_default().push(place);
                }
            }
        }
    }
    for (word, left) in TELL_TALE {
        let places = found.remove(word).unwrap_or_default();
        assert!(
            places.len() == left,
            "`{word}` stands in {} lines, the limit is {left}; rewrite the sentence, or lower the limit: {places:#?}",
            places.len()
        );
    }
}
