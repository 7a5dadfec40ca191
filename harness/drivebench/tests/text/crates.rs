//! The crates: which may depend on which, and what a bus exports.

use super::tidy::{files, read, root};

/// The folders of each bus in the lower crates; the first is also its crate.
pub(super) const BUS_FOLDERS: [&[&str]; 4] = [
    &["novobus", "nd21"],
    &["unitek"],
    &["nordac", "profibus"],
    &["toy"],
];

/// What each crate of the workspace may depend on, of this workspace: the engine knows no bus, and no bus another.
#[test]
fn crates_depend_one_way() {
    let below: [(&str, &[&str]); 5] = [
        ("proto", &[]),
        ("sim", &["proto"]),
        ("uart", &[]),
        ("socketcan", &["proto"]),
        ("bench", &["proto", "sim", "socketcan", "uart"]),
    ];
    let buses = BUS_FOLDERS.map(|bus| (bus[0], ["bench", "proto", "sim"].as_slice()));
    for (name, allowed) in below.into_iter().chain(buses) {
        let text = read(&root().join(format!("harness/{name}/Cargo.toml")));
        let lines = text
            .lines()
            .filter_map(|line| line.strip_prefix("harness-"));
        let used = lines.filter_map(|line| line.split(['.', ' ']).next());
        for other in used {
            assert!(allowed.contains(&other), "{name} depends on {other}");
        }
    }
}

/// A bus takes nothing from the folders of another one.
#[test]
fn no_bus_imports_another() {
    for bus in BUS_FOLDERS {
        for place in ["proto/src/*", "sim/src/*", "*/src"] {
            let folders = bus
                .iter()
                .map(|name| format!("harness/{}", place.replace('*', name)));
            let folders = folders.filter(|folder| root().join(folder).is_dir());
            for source in folders.flat_map(|folder| files(&folder, "rs")) {
                for (number, line) in read(&source).lines().enumerate() {
                    let code = line.split("//").next().unwrap_or_default();
                    let others = BUS_FOLDERS.iter().filter(|other| **other != bus);
                    let imported = others.copied().flatten().find(|other| {
                        let mut paths = ["buses", "harness_proto", "harness_sim", "crate"].iter();
                        paths.any(|path| code.contains(&format!("{path}::{other}")))
                    });
                    assert_eq!(imported, None, "{}:{}", source.display(), number + 1);
                }
            }
        }
    }
}

/// A bus's crate exports `BUS`, and nothing else.
#[test]
fn a_bus_exports_itself() {
    for name in BUS_FOLDERS.map(|bus| bus[0]) {
        let text = read(&root().join(format!("harness/{name}/src/lib.rs")));
        let exported: Vec<_> = text
            .lines()
            .filter(|line| line.starts_with("pub "))
            .collect();
        assert_eq!(exported, ["pub static BUS: Bus = Bus {"], "{name}");
    }
}

/// The crates that embed folders of this tree, each with these.
pub(crate) fn embedding() -> Vec<(&'static str, Vec<String>)> {
    let crates = BUS_FOLDERS.map(|bus| bus[0]).into_iter();
    let folders = crates.chain(["bench", "drivebench"]).map(|name| {
        let sources = files(&format!("harness/{name}/src"), "rs");
        let texts: Vec<_> = sources.iter().map(|source| read(source)).collect();
        let named = texts
            .iter()
            .flat_map(|text| text.split("include_dir!(\"$").skip(1));
        let folders = named.map(|rest| {
            let path = rest
                .strip_prefix("CARGO_MANIFEST_DIR/../../")
                .expect("the tree");
            path.split('"').next().expect("a path").to_owned()
        });
        (name, folders.collect::<Vec<_>>())
    });
    folders.filter(|(_, folders)| !folders.is_empty()).collect()
}

/// A new file in a folder that a crate embeds makes the crate be built again.
#[test]
fn embedded_folders_are_watched() {
    let crates = embedding();
    assert_eq!(crates.len(), 5, "{crates:?}");
    for (name, folders) in crates {
        let script = read(&root().join(format!("harness/{name}/build.rs")));
        for folder in folders {
            let watched = script.lines().any(|line| {
                let path = line.split_once("rerun-if-changed=../../");
                let path = path.and_then(|(_, rest)| rest.split('"').next());
                path.is_some_and(|path| std::path::Path::new(&folder).starts_with(path))
            });
            assert!(watched, "harness/{name}/build.rs does not watch {folder}");
        }
    }
}
