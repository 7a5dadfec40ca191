//! The built-in scenarios are embedded: a new file makes the library be built again.

fn main() {
    println!("cargo:rerun-if-changed=corpora/scenarios");
}
