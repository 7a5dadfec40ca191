//! Numbers with their nouns.

use alloc::format;
use alloc::string::String;
use core::fmt::Display;

/// A number with its noun, which stands in the singular behind 1: `1 scenario`, `0 scenarios`.
pub fn counted<N: Display + PartialEq + From<u8>>(number: N, noun: &str) -> String {
    match noun.strip_suffix("ply") {
        _ if number == N::from(1) => format!("{number} {noun}"),
        Some(stem) => format!("{number} {stem}plies"),
        None => format!("{number} {noun}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_is_singular() {
        assert_eq!(counted(0_u8, "drive"), "0 drives");
        assert_eq!(counted(1_usize, "scenario"), "1 scenario");
        assert_eq!(counted(1_usize, "reply"), "1 reply");
        assert_eq!(counted(2_usize, "reply"), "2 replies");
        assert_eq!(counted(2_u64, "byte"), "2 bytes");
    }
}
