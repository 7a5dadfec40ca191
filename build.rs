//! The built-in scenarios and rigs are embedded: a new file makes the library be built again.

fn main() {
    println!("cargo:rerun-if-changed=corpora/scenarios");
    println!("cargo:rerun-if-changed=rigs");
}
