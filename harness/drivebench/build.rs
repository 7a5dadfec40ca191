//! Systems on which nothing can work are refused.

use std::path::Path;

fn main() {
    if let Some(sentence) = refusal(&std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default()) {
        println!("cargo::error={sentence}");
        return;
    }
    let tree = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("the package lies in the checkout");
    // For the tests alone: they read what the tree keeps.
    println!("cargo::rustc-env=TREE={}", tree.display());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../../corpora/fuzz");
}

/// Why drivebench is not built for an operating system.
pub(crate) fn refusal(system: &str) -> Option<String> {
    (system != "linux").then(|| {
        format!(
            "drivebench runs on Linux only, and this build is for `{system}`; build it on Linux, in a virtual machine or in a container"
        )
    })
}
