//! One part of work that is spread over machines: `slice:3/16` or `hash:3/16`.
//!
//! The rule is that of nextest. A slice takes every n-th item of the whole list, so parts are even, but a new item moves others. A hash takes
//! items by their names: an item stays in its part whatever else is in the list, and parts are uneven. Filters come first.

use sha2::{Digest, Sha256};
use std::fmt;
use std::str::FromStr;

/// The largest number of parts.
pub(crate) const MOST_PARTS: u32 = 10_000;

/// How items are dealt out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spread {
    /// Round robin over the list.
    Slice,
    /// By the SHA-256 sum of the name.
    Hash,
}

impl Spread {
    /// The word on the command line and in records.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Slice => "slice",
            Self::Hash => "hash",
        }
    }
}

/// A part: number `number` of `of`, with 1 <= `number` <= `of` <= `MOST_PARTS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Partition {
    /// How items are dealt out.
    pub spread: Spread,
    /// Which part, counted from 1.
    pub number: u32,
    /// How many parts there are.
    pub of: u32,
}

impl Partition {
    /// Whether the item at this place of the whole list, with this name, belongs to the part.
    #[must_use]
    pub fn has(&self, place: usize, name: &str) -> bool {
        self.owner(place, name) == self.number
    }

    /// The number of the part that the item at this place of the whole list, with this name, belongs to.
    #[must_use]
    pub fn owner(&self, place: usize, name: &str) -> u32 {
        let dealt = match self.spread {
            Spread::Slice => place as u64,
            Spread::Hash => first_word(name),
        };
        // A remainder of a u32 fits into one.
        u32::try_from(dealt % u64::from(self.of)).unwrap_or(0) + 1
    }

    /// The part's share of this number of items that have no names; the first parts have one more where they do not divide evenly.
    #[must_use]
    pub fn share(&self, items: u64) -> u64 {
        let (of, before) = (u64::from(self.of), u64::from(self.number - 1));
        items / of + u64::from(items % of > before)
    }

    /// The seed of the part: the first 8 bytes, the highest first, of the SHA-256 sum of the text `SEED:NUMBER/OF`.
    #[must_use]
    pub fn seed(&self, seed: u64) -> u64 {
        first_word(&format!("{seed}:{}/{}", self.number, self.of))
    }
}

/// The first 8 bytes of the SHA-256 sum of a text.
fn first_word(text: &str) -> u64 {
    let sum = Sha256::digest(text.as_bytes());
    let first = sum.iter().take(8);
    first.fold(0, |word, byte| word << 8 | u64::from(*byte))
}

impl fmt::Display for Partition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}/{}", self.spread.name(), self.number, self.of)
    }
}

impl FromStr for Partition {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "slice:M/N or hash:M/N is expected, part M of N, such as slice:3/16, with 1 <= M <= N <= {MOST_PARTS}"
            )
        };
        let (spread, numbers) = text.split_once(':').ok_or_else(wrong)?;
        let all = [Spread::Slice, Spread::Hash];
        let spread = all.into_iter().find(|known| known.name() == spread);
        let (number, of) = numbers.split_once('/').ok_or_else(wrong)?;
        let digits = |text: &str| {
            let plain = text.bytes().all(|byte| byte.is_ascii_digit());
            text.parse().ok().filter(|_| plain)
        };
        let (number, of): (u32, u32) = digits(number).zip(digits(of)).ok_or_else(wrong)?;
        match (spread, (1..=of).contains(&number) && of <= MOST_PARTS) {
            (Some(spread), true) => Ok(Self { spread, number, of }),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(text: &str) -> Partition {
        text.parse().expect("a partition")
    }

    #[test]
    fn parts_are_numbered_from_1() {
        for wrong in [
            "",
            "slice",
            "slice:",
            "slice:0/3",
            "slice:4/3",
            "slice:1/0",
            "hash:x",
            "hash:1",
            "count:1/2",
            "slice:1/2/3",
            "slice:+1/2",
            "slice: 1/2",
            "slice:1/10001",
            "slice:4294967297/4294967298",
            "slice:-1/3",
            "SLICE:1/2",
        ] {
            let error = wrong.parse::<Partition>().expect_err(wrong);
            assert!(
                error.contains("slice:M/N or hash:M/N is expected"),
                "{error}"
            );
        }
        for right in ["slice:1/1", "hash:3/16", "slice:10000/10000"] {
            assert_eq!(part(right).to_string(), right);
        }
    }

    #[test]
    fn every_item_is_in_one_part() {
        let names: Vec<_> = (0..50).map(|n| format!("item-{n}")).collect();
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        for spread in ["slice", "hash"] {
            for of in [1, 2, 3, 7, 60] {
                for (place, name) in names.iter().enumerate() {
                    let parts = (1..=of).map(|m| part(&format!("{spread}:{m}/{of}")));
                    let owners = parts.filter(|part| part.has(place, name));
                    assert_eq!(owners.count(), 1, "{spread} {of} {name}");
                }
            }
        }
        let slice = part("slice:2/3");
        let places = (0..8).filter(|place| slice.has(*place, names[*place]));
        assert_eq!(places.collect::<Vec<_>>(), [1, 4, 7]);
        // A name stays in its part wherever it stands.
        let hash = part("hash:1/3");
        assert!((0..9).all(|place| hash.has(place, "a") == hash.has(0, "a")));
    }

    #[test]
    fn shares_and_seeds_of_parts() {
        let shares = (1..=4).map(|m| part(&format!("slice:{m}/4")).share(10));
        assert_eq!(shares.collect::<Vec<_>>(), [3, 3, 2, 2]);
        assert_eq!(part("slice:3/3").share(2), 0);
        // printf 1:3/16 | sha256sum
        assert_eq!(part("slice:3/16").seed(1), part("hash:3/16").seed(1));
        assert_ne!(part("slice:3/16").seed(1), part("slice:4/16").seed(1));
        assert_eq!(part("slice:3/16").seed(1), 0x2080_e1dc_8f9d_fad4);
    }
}
