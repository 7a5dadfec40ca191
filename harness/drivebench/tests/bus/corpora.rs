//! The kept inputs of the fuzz targets, played with plain `cargo test`: none may break a rule.

use harness::fuzz::coverage::Coverage;
use harness::fuzz::distil::superfluous;
use harness::fuzz::input::input;
use harness::fuzz::{BENCH_TARGETS, noting, targets};
use harness_sim::novobus::transitions::{State, tour};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

fn folder() -> PathBuf {
    Path::new(env!("TREE")).join("corpora/fuzz")
}

#[test]
fn every_kept_input_keeps_the_rules() {
    for (name, target) in targets() {
        let folder = folder().join(name);
        let mut played = 0;
        for entry in std::fs::read_dir(&folder).expect("a folder for each target") {
            let path = entry.expect("readable").path();
            let content = std::fs::read(&path).expect("readable");
            let input = input(&path.display().to_string(), &content)
                .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            // A panic names the rule; the file is named here.
            let result = std::panic::catch_unwind(|| target(&input));
            assert!(result.is_ok(), "{}", path.display());
            played += 1;
        }
        assert!(played > 0, "{} is empty", folder.display());
    }
}

/// A short random walk through every target: `DRIVEBENCH_SEED` chooses another.
#[test]
fn random_inputs_keep_the_rules() {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400_u64);
    for (name, target) in targets() {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = |most: u64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state % most
        };
        let cases = if name == "master" { 60 } else { 400 };
        for case in 0..cases {
            let length = random(120);
            let likely = [
                0x00, 0x80, 0x81, 0xFF, 0xC0, 0x82, 0xFB, 0xFC, 0x44, 0x72, 0x4C, 0x41, 0x8A, 0xFD,
                0xFE, 0x13,
            ];
            let input: Vec<u8> = (0..length)
                .map(|_| match random(3) {
                    0 => random(256) as u8,
                    1 => likely[random(likely.len() as u64) as usize],
                    _ => random(9) as u8,
                })
                .collect();
            let result = std::panic::catch_unwind(|| target(&input));
            assert!(
                result.is_ok(),
                "{name}, case {case}: {input:02X?}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test --test bus random_inputs"
            );
        }
    }
}

/// Compares with a file that is kept; `UPDATE_SNAPSHOTS=1` writes it.
fn kept(path: &Path, text: &str) {
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(path, text).expect("written");
    }
    let before = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        before == text,
        "{} differs; UPDATE_SNAPSHOTS=1 writes it",
        path.display()
    );
}

/// What a script prints, by lines; it ends well.
fn script(name: &str, arguments: &[&str]) -> Vec<String> {
    let path = Path::new(env!("TREE")).join("scripts").join(name);
    let output = Command::new(path).args(arguments).output();
    let output = output.expect("the script starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name} {arguments:?}: {said}");
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(str::to_owned).collect()
}

/// The scripts take the targets from fuzz/Cargo.toml, which lists the same targets as are played here.
#[test]
fn the_scripts_know_every_target() {
    let known: BTreeSet<_> = targets().map(|(name, _)| name.to_owned()).collect();
    let listed = script("fuzz-targets", &[]);
    assert_eq!(listed.iter().cloned().collect::<BTreeSet<_>>(), known);
    // The feature that a target needs is its bus: no other bus is built with it.
    let buses = [
        ("novobus", &harness_sim::novobus::fuzz::TARGETS[..]),
        ("unitek", &harness_sim::unitek::fuzz::TARGETS),
        ("nordac", &harness_sim::nordac::fuzz::TARGETS),
        ("texts", &BENCH_TARGETS),
    ];
    let needed = buses.into_iter().flat_map(|(feature, targets)| {
        let names = targets.iter().map(|(name, _)| name);
        names.map(move |name| format!("{name} {feature}"))
    });
    let listed = script("fuzz-targets", &["--features"]).into_iter();
    assert_eq!(listed.collect::<BTreeSet<_>>(), needed.collect());
    let with_dictionary = script("fuzz-targets", &["--dictionary"]);
    let wanted = ["bus_end", "codec", "detector", "guard", "ring"].map(str::to_owned);
    assert_eq!(
        with_dictionary.into_iter().collect::<BTreeSet<_>>(),
        BTreeSet::from(wanted)
    );
}

/// The script writes for libFuzzer the same inputs that are played here.
#[test]
fn the_script_converts_as_the_tests_do() {
    converts(&["links", "scenario"]);
}

#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn the_script_converts_every_input() {
    let all: Vec<_> = targets().map(|(name, _)| name).collect();
    converts(&all);
}

fn converts(targets: &[&str]) {
    let to = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz-seeds");
    for target in targets {
        let to = to.join(target);
        let _none_before = std::fs::remove_dir_all(&to);
        script("fuzz-seeds", &[target, &to.display().to_string()]);
        let mut written = std::fs::read_dir(&to).expect("a folder").count();
        for entry in std::fs::read_dir(folder().join(target)).expect("a folder") {
            let path = entry.expect("readable").path();
            let name = path.file_name().expect("a name").to_string_lossy();
            let content = std::fs::read(&path).expect("readable");
            let wanted = input(&name, &content).expect("an input");
            let seed = to.join(name.strip_suffix(".hex").unwrap_or(&name));
            let found = std::fs::read(&seed).expect("written");
            assert_eq!(found, wanted, "{}", path.display());
            written -= 1;
        }
        assert_eq!(written, 0, "{target}: more seeds than inputs");
    }
}

#[test]
fn every_folder_belongs_to_a_target() {
    let known: BTreeSet<_> = targets().map(|(name, _)| name.to_owned()).collect();
    for entry in std::fs::read_dir(folder()).expect("a folder") {
        let entry = entry.expect("readable");
        let name = entry.file_name().to_string_lossy().into_owned();
        assert!(!entry.path().is_dir() || known.contains(&name), "{name}");
    }
}

/// The gate: every transition that can be reached is reached by the committed inputs.
#[test]
fn the_corpus_reaches_every_reachable_transition() {
    let coverage = Coverage::of_folder(&folder()).expect("a corpus");
    assert!(coverage.missing().is_empty(), "{}", coverage.sums());
    let snapshot = Path::new(env!("TREE")).join("snapshots/fuzz/transitions.txt");
    kept(&snapshot, &coverage.page());
}

/// Every state of a UNITEK and of a NORDAC drive, and everything that can happen in it, is in the kept inputs.
#[test]
fn the_corpus_reaches_every_cell_of_the_drives() {
    let coverage = Coverage::of_folder(&folder()).expect("a corpus");
    for target in ["unitek-drive", "nordac-slave"] {
        let mut sums = coverage.targets.iter();
        let sum = sums.find(|sum| sum.target == target);
        let sum = sum.expect("the target has inputs");
        assert_eq!(Some(sum.reached), sum.of, "{sum:?}");
    }
}

/// The inputs of a target with the names of their files.
fn inputs(target: &str) -> Vec<(String, Vec<u8>)> {
    let files = std::fs::read_dir(folder().join(target)).expect("a folder");
    let read = |entry: std::io::Result<std::fs::DirEntry>| {
        let path = entry.expect("readable").path();
        let name = path.file_name().expect("a name").to_string_lossy();
        let content = std::fs::read(&path).expect("readable");
        let input = input(&name, &content).expect("an input");
        (name.into_owned(), input)
    };
    let mut inputs: Vec<_> = files.map(read).collect();
    inputs.sort();
    inputs
}

/// Every target says what its inputs reach.
#[test]
fn every_target_is_summed_up() {
    let noted: BTreeSet<_> = noting().map(|target| target.name).collect();
    let known: BTreeSet<_> = targets().map(|(name, _)| name).collect();
    assert_eq!(noted, known);
    let coverage = Coverage::of_folder(&folder()).expect("a corpus");
    let summed: BTreeSet<_> = coverage.targets.iter().map(|sum| sum.target).collect();
    assert_eq!(summed, known);
    for sum in &coverage.targets {
        assert!(sum.reached > 0, "{sum:?}");
        assert!(sum.of.is_none_or(|of| sum.reached <= of), "{sum:?}");
    }
}

/// The corpus stays minimal: each distilled file reaches something that the others do not.
#[test]
fn no_distilled_input_is_superfluous() {
    for target in noting() {
        let idle = superfluous(target.body, &inputs(target.name));
        assert!(
            idle.is_empty(),
            "corpora/fuzz/{}: the others reach all that these do; remove one and look again: {idle:#?}",
            target.name
        );
    }
}

/// The folders are small enough to be read, and to be played with every `cargo test`.
#[test]
fn the_folders_are_small() {
    for target in noting() {
        let inputs = inputs(target.name);
        let bytes: usize = inputs.iter().map(|(_, input)| input.len()).sum();
        let (files, name) = (inputs.len(), target.name);
        assert!(
            files <= 128 && bytes <= 60_000,
            "{name}: {files} files, {bytes} bytes"
        );
    }
}

/// The inputs of `bus_end` that are named after a state are the tour.
#[test]
fn the_tour_is_kept() {
    for state in State::ALL {
        let (name, text) = tour::file(*state);
        kept(&folder().join("bus_end").join(name + ".hex"), &text);
    }
}
