//! Records that are damaged: an exit code that says so and a place, never a panic.

use super::Bench;
use harness::evidence::{RecordError, fuzz, read};
use std::path::PathBuf;

/// A bench, the folder of a run on it, and its record.
fn run() -> (Bench, PathBuf, String) {
    let bench = Bench::new("");
    let (_, folder) = bench.play_all("run");
    let text = std::fs::read_to_string(folder.join("run.jsonl")).expect("a record");
    (bench, folder, text)
}

fn error(record: &[u8]) -> RecordError {
    read(record, |_, _, _| {}).expect_err("damaged")
}

/// Line, column and byte of the first mistake.
#[track_caller]
fn at(record: &[u8], line: usize, column: usize, offset: usize, words: &str) {
    let error = error(record);
    assert_eq!(
        (error.line, error.column, error.offset),
        (line, column, offset),
        "{error}"
    );
    assert!(error.to_string().contains(words), "{error}");
}

#[test]
fn every_mistake_has_its_place() {
    let (_bench, _, text) = run();
    let first = text.find('\n').expect("lines") + 1;
    at(b"", 1, 1, 0, "empty");
    at(b"\n", 1, 1, 0, "EOF");
    at(b"weather\n", 1, 1, 0, "expected");
    at(
        &text.as_bytes()[first..],
        1,
        1,
        0,
        "the record of a run expected here, of schema 2",
    );
    let other = text.replacen("\"schema\":2", "\"schema\":9", 1);
    at(other.as_bytes(), 1, 1, 0, "a record of schema 9");
    let rings = text.replacen("\"rings\":[2]", "\"rings\":[251]", 1);
    assert!(error(rings.as_bytes()).line == 1);
    // No UTF-8, in the second line.
    let mut bytes = text.clone().into_bytes();
    bytes[first + 9] = 0xFF;
    at(&bytes, 2, 10, first + 9, "not UTF-8: FF");
    // Behind the first line.
    let head = &text[..first];
    for (line, words) in [
        ("{\"kind\":\"begin\",\"t\":0}", "no scenario has begun"),
        (head.trim_end(), "has begun already"),
        (
            "{\"kind\":\"scenario\",\"name\":\"a\",\"sha256\":\"\",\"attempt\":0}",
            "counted from 1",
        ),
        (
            "{\"kind\":\"end\",\"verdicts\":[\"great\"]}",
            "is not a verdict",
        ),
    ] {
        at(format!("{head}{line}\n").as_bytes(), 2, 1, first, words);
    }
    let begun =
        format!("{head}{{\"kind\":\"scenario\",\"name\":\"a\",\"sha256\":\"\",\"attempt\":1}}\n");
    for (line, words) in [
        (
            "{\"kind\":\"sent\",\"ring\":2,\"t\":0,\"bytes\":\"80\"}",
            "no ring 2",
        ),
        (
            "{\"kind\":\"sent\",\"ring\":0,\"t\":0,\"bytes\":\"80\"}",
            "cannot be",
        ),
        (
            "{\"kind\":\"sent\",\"ring\":1,\"t\":0,\"bytes\":\"+8\"}",
            "cannot be",
        ),
        (
            "{\"kind\":\"begin\",\"t\":18446744073709551615}",
            "longer than a day",
        ),
        (
            "{\"kind\":\"fault\",\"ring\":1,\"t\":0,\"link\":3,\"what\":[\"drop\",0]}",
            "no link 3",
        ),
        (
            "{\"kind\":\"fault\",\"ring\":1,\"t\":0,\"link\":0,\"what\":[\"delay\",18446744073709551615]}",
            "longer than a day",
        ),
        (
            "{\"kind\":\"verdict\",\"verdict\":\"great\",\"remarks\":[],\"took\":0}",
            "is not a verdict",
        ),
    ] {
        at(
            format!("{begun}{line}\n").as_bytes(),
            3,
            1,
            begun.len(),
            words,
        );
    }
    let lost = "{\"kind\":\"trouble\",\"cause\":\"lost\",\"text\":\"gone\"}\n";
    let twice = format!("{begun}{lost}{lost}");
    let second = begun.len() + lost.len();
    at(twice.as_bytes(), 4, 1, second, "in trouble already");
    let crlf = text.replacen('\n', "\r\n", 1);
    at(crlf.as_bytes(), 1, first, first - 1, "CR");
    let huge = format!("{begun}{{\"kind\":\"begin\",\"t\":99999999999999999999999}}\n");
    assert_eq!(error(huge.as_bytes()).line, 3);
    let deep = format!("{begun}{}\n", "[".repeat(100_000));
    assert_eq!(error(deep.as_bytes()).line, 3);
    let whole = format!("{text}{{\"kind\":\"begin\",\"t\":0}}\n");
    assert!(error(whole.as_bytes()).message.contains("behind the end"));
}

/// Cut anywhere a record is one up to there, or says where it is none.
#[test]
fn cut_anywhere() {
    let (_bench, _, text) = run();
    for length in 0..text.len().min(6_000) {
        let mut lines = 0;
        match read(&text.as_bytes()[..length], |_, _, _| lines += 1) {
            Ok(whole) => {
                assert!(lines > 0 && whole == text[..length].ends_with('\n'))
            }
            Err(error) => assert!(error.line == 1 && error.offset <= length, "{error}"),
        }
    }
}

/// Random damage, the same each time: flipped bits, other bytes, lines doubled, left out and exchanged, digits put in. `DRIVEBENCH_SEED`
/// chooses another.
#[test]
fn random_damage() {
    let seed = std::env::var("DRIVEBENCH_SEED").ok();
    let seed: u64 = seed.and_then(|seed| seed.parse().ok()).unwrap_or(1_996);
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = |most: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % most as u64).expect("small")
    };
    let kept = std::path::Path::new(env!("TREE")).join("corpora/fuzz/record/read.jsonl");
    let text = std::fs::read(kept).expect("a record");
    for case in 0..600 {
        let mut lines: Vec<Vec<u8>> = text
            .split_inclusive(|b| *b == b'\n')
            .map(<[u8]>::to_vec)
            .collect();
        for _ in 0..=random(3) {
            let line = random(lines.len());
            match random(6) {
                0 => lines.insert(line, lines[random(lines.len())].clone()),
                1 if lines.len() > 1 => drop(lines.remove(line)),
                2 => {
                    let other = random(lines.len());
                    lines.swap(line, other);
                }
                3 => {
                    let place = random(lines[line].len());
                    let digits = b"9999999999999999999999";
                    let count = 1 + random(digits.len());
                    lines[line].splice(place..place, digits[..count].iter().copied());
                }
                4 => {
                    let place = random(lines[line].len());
                    lines[line][place] ^= 1 << random(8);
                }
                _ => {
                    let place = random(lines[line].len());
                    lines[line][place] = u8::try_from(random(256)).expect("a byte");
                }
            }
        }
        let damaged = lines.concat();
        let result = std::panic::catch_unwind(|| fuzz::record(&damaged));
        assert!(
            result.is_ok(),
            "case {case}: {}\nrepeat with: DRIVEBENCH_SEED={seed} cargo test --test text random_damage",
            String::from_utf8_lossy(&damaged)
        );
    }
}
