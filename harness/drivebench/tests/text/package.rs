//! What is shipped: the container file, the Debian package, and what a build says on other systems.

#[expect(
    dead_code,
    clippy::print_stdout,
    reason = "a build script prints, and Cargo calls its `main`"
)]
#[path = "../../build.rs"]
mod build_script;

use std::path::Path;

fn root() -> &'static Path {
    Path::new(env!("TREE"))
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[test]
fn other_systems_are_refused_in_one_sentence() {
    assert_eq!(build_script::refusal("linux"), None);
    for system in ["windows", "macos", "freebsd"] {
        let sentence = build_script::refusal(system).expect("a refusal");
        assert!(sentence.starts_with("drivebench runs on Linux only"));
        assert!(sentence.contains(system) && !sentence.contains('\n'));
    }
}

/// What the container file copies is there, and holds every file that Cargo and the program's sources name.
#[test]
fn the_container_gets_all_sources() {
    let file = read("harness/package/Containerfile");
    let lines = file.lines().filter_map(|line| line.strip_prefix("COPY "));
    let copied: Vec<&str> = lines
        .filter(|line| !line.starts_with("--from"))
        .flat_map(|line| {
            let mut words: Vec<_> = line.split_whitespace().collect();
            words.pop();
            words
        })
        .collect();
    assert!(copied.contains(&"Cargo.lock"), "{copied:?}");
    for path in &copied {
        assert!(root().join(path).exists(), "{path}");
    }
    let manifest = read("Cargo.toml");
    let named = manifest.lines().filter_map(|line| {
        let path = line.split_once("path = \"")?.1;
        path.split('"').next()
    });
    let embedding = super::crates::embedding();
    let embedded = embedding.iter().flat_map(|(_, folders)| folders);
    for path in named.chain(embedded.map(String::as_str)) {
        let top = path.split('/').next().expect("a word");
        assert!(copied.contains(&top), "{path} is not copied");
    }
}

/// The rule for adapters is an example: nothing puts it where udev reads it.
#[test]
fn the_udev_rule_is_an_example() {
    let rule = "60-drivebench.rules";
    assert!(read(&format!("harness/package/{rule}")).contains("ID_MM_DEVICE_IGNORE"));
    let script = read("scripts/deb");
    assert!(script.contains(rule) && !script.contains("rules.d"));
}
