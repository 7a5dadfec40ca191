//! The built-in scenarios, probes and rigs are embedded: a new file makes the library be built again.

fn main() {
    println!("cargo:rerun-if-changed=corpora/scenarios");
    println!("cargo:rerun-if-changed=corpora/fuzz");
    println!("cargo:rerun-if-changed=corpora/probes");
    println!("cargo:rerun-if-changed=corpora/qualify");
    println!("cargo:rerun-if-changed=corpora/campaigns");
    println!("cargo:rerun-if-changed=rigs");
}
