//! The built-in scenarios, probes and rigs are embedded: a new file makes the library be built again. Systems on which nothing can work are
//! refused.

fn main() {
    if let Some(sentence) = refusal(&std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default()) {
        println!("cargo::error={sentence}");
        return;
    }
    println!("cargo:rerun-if-changed=corpora/scenarios");
    println!("cargo:rerun-if-changed=corpora/fuzz");
    println!("cargo:rerun-if-changed=corpora/probes");
    println!("cargo:rerun-if-changed=corpora/qualify");
    println!("cargo:rerun-if-changed=corpora/campaigns");
    println!("cargo:rerun-if-changed=rigs");
}

/// Why drivebench is not built for an operating system.
pub(crate) fn refusal(system: &str) -> Option<String> {
    (system != "linux").then(|| {
        format!(
            "drivebench runs on Linux only, and this build is for `{system}`; build it on Linux, in a virtual machine or in a container"
        )
    })
}
