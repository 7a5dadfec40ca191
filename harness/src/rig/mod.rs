//! Benches: what stands in `rigs/*.toml`, who holds one, and what may be done with it.
