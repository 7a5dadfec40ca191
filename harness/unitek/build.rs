//! A new file in a folder that is embedded makes the crate be built again.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../../corpora/campaigns/unitek");
    println!("cargo::rerun-if-changed=../../corpora/qualify/unitek");
}
