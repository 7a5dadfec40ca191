//! Octets as a text of hexadecimal digits, for files.

use serde::{Deserialize, Deserializer, Serializer, de};

pub(super) fn serialize<S: Serializer>(octets: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&written(octets))
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<u8>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let octet = |word: &str| match word.len() {
        2 => u8::from_str_radix(word, 16).ok(),
        _ => None,
    };
    let octets: Option<Vec<u8>> = text.split_whitespace().map(octet).collect();
    octets.ok_or_else(|| {
        de::Error::custom(format!(
            "`{text}` is no telegram: octets of two hexadecimal digits are expected"
        ))
    })
}

/// The octets as a scenario writes them.
pub(super) fn written(octets: &[u8]) -> String {
    let digits: Vec<_> = octets.iter().map(|octet| format!("{octet:02X}")).collect();
    digits.join(" ")
}
