//! Numbers with their nouns.

use std::fmt::Display;

/// A number with its noun, which stands in the singular behind 1: `1 scenario`, `0 scenarios`.
pub(crate) fn counted<N: Display + PartialEq + From<u8>>(number: N, noun: &str) -> String {
    let s = if number == N::from(1) { "" } else { "s" };
    format!("{number} {noun}{s}")
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_is_singular() {
        assert_eq!(counted(0_u8, "drive"), "0 drives");
        assert_eq!(counted(1_usize, "scenario"), "1 scenario");
        assert_eq!(counted(2_u64, "byte"), "2 bytes");
    }
}
