//! The kept inputs of the fuzz targets, played with plain `cargo test`: none may break a rule.

use harness_sim::fuzz::TARGETS;
use std::path::Path;

/// Bytes as a file holds them: hexadecimal digits, `#` begins a comment.
fn bytes(text: &str) -> Vec<u8> {
    let digits: String = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default())
        .flat_map(|line| line.chars().filter(char::is_ascii_hexdigit))
        .collect();
    (0..digits.len() / 2)
        .map(|i| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).expect("digits"))
        .collect()
}

#[test]
fn every_kept_input_keeps_the_rules() {
    for (name, target) in TARGETS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("corpora/fuzz")
            .join(name);
        let mut played = 0;
        for entry in std::fs::read_dir(&folder).expect("a folder for each target") {
            let path = entry.expect("readable").path();
            let input = std::fs::read(&path).expect("readable");
            let input = match path.extension().and_then(|extension| extension.to_str()) {
                Some("hex") => bytes(&String::from_utf8(input).expect("text")),
                _ => input,
            };
            // A panic names the rule; the file is named here.
            let result = std::panic::catch_unwind(|| target(&input));
            assert!(result.is_ok(), "{}", path.display());
            played += 1;
        }
        assert!(played > 0, "{} is empty", folder.display());
    }
}

/// A short random walk through every target: `DRIVEBENCH_SEED` chooses another.
#[test]
fn random_inputs_keep_the_rules() {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400_u64);
    for (name, target) in TARGETS {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = |most: u64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state % most
        };
        let cases = if name == "master" { 60 } else { 400 };
        for case in 0..cases {
            let length = random(120);
            let likely = [
                0x00, 0x80, 0x81, 0xFF, 0xC0, 0x82, 0xFB, 0xFC, 0x44, 0x72, 0x4C, 0x41, 0x8A, 0xFD,
                0xFE, 0x13,
            ];
            let input: Vec<u8> = (0..length)
                .map(|_| match random(3) {
                    0 => random(256) as u8,
                    1 => likely[random(likely.len() as u64) as usize],
                    _ => random(9) as u8,
                })
                .collect();
            let result = std::panic::catch_unwind(|| target(&input));
            assert!(
                result.is_ok(),
                "{name}, case {case}: {input:02X?}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test --test corpora random_inputs"
            );
        }
    }
}
