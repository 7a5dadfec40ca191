//! Damaged, cut and hostile captures: a capture, or a reason with its place; never a panic.

use super::{DAMAGED, built_in, pcapng, run, written};
use harness::capture::{CaptureError, read};
use harness::shown::FileForm;

fn small() -> [Vec<u8>; 2] {
    let text = "title small\nring 2, 1\n> 88 FE C0 13 FE D1\n2> 80*3\n! 1->0 byte 3: flip 1\n";
    let capture = run(text);
    [pcapng(&capture), written(&capture, FileForm::Json, "")]
}

/// Cut off anywhere it is whole up to there, or says where it ends.
#[test]
fn cut_off_anywhere() {
    let [capture, text] = small();
    for length in 0..capture.len() {
        match read(&capture[..length], None) {
            Ok(whole) => assert!(whole.bytes() < 40),
            Err(CaptureError::At { offset, .. }) => {
                // Where the next number is expected.
                assert!(offset <= length + 8, "{offset} of {length}")
            }
            Err(other) => assert!(!other.to_string().is_empty()),
        }
    }
    for length in 0..text.len() - 1 {
        let error = read(&text[..length], None).expect_err("half a text");
        if let CaptureError::At { offset, .. } = error {
            assert!(offset <= length, "{offset} of {length}");
        }
    }
}

/// Random damage, the same each time: `DRIVEBENCH_SEED` chooses another.
#[test]
fn flipped_bits() {
    let seed = std::env::var("DRIVEBENCH_SEED").ok();
    let seed: u64 = seed.and_then(|seed| seed.parse().ok()).unwrap_or(250);
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut random = |most: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % most as u64).expect("small")
    };
    let damaged = run(DAMAGED);
    let [small, text] = small();
    let files = [
        small,
        text,
        pcapng(&damaged),
        written(&damaged, FileForm::Json, ""),
    ];
    for case in 0..3_000 {
        let mut file = files[case % files.len()].clone();
        for _ in 0..=random(4) {
            let place = random(file.len());
            file[place] = match random(3) {
                0 => file[place] ^ 1 << random(8),
                1 => 0xFF,
                _ => u8::try_from(random(256)).expect("a byte"),
            };
        }
        let result = std::panic::catch_unwind(|| harness::fuzz::capture(&file));
        assert!(
            result.is_ok(),
            "case {case}; repeat with: DRIVEBENCH_SEED={seed} cargo test --test text flipped_bits"
        );
    }
}

/// Kept inputs of the fuzz body.
#[test]
fn kept_inputs() {
    let folder = super::root().join("corpora/captures");
    let mut played = 0;
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("readable").path();
        harness::fuzz::capture(&std::fs::read(&path).expect("readable"));
        played += 1;
    }
    assert!(played > 1);
    for capture in [built_in("9.8-two-check-sequences"), run(DAMAGED)] {
        harness::fuzz::capture(&pcapng(&capture));
        harness::fuzz::capture(&written(&capture, FileForm::Json, ""));
    }
}

fn refusal(bytes: &[u8]) -> String {
    read(bytes, None).expect_err("no capture").to_string()
}

#[test]
fn refusals_name_the_place_and_the_remedy() {
    let [capture, _] = small();
    let foreign = refusal(b"title a scenario\n");
    assert!(
        foreign.contains("it looks like text that begins with \"title a scenario\". These formats are read: pcapng (Wireshark)"),
        "{foreign}"
    );
    assert!(refusal(b"").contains("it is empty"));
    let cut = refusal(&capture[..capture.len() - 2]);
    assert!(
        cut.contains("the file ends in the middle of a block"),
        "{cut}"
    );
    let json = |text: &str| refusal(text.as_bytes());
    assert!(json("{\"schema\":1,\n \"ring\":x}").starts_with("at byte 21 of the file"));
    let ring = |ring: &str, links: &str| {
        json(&format!(
            "{{\"schema\":1,\"ring\":{ring},\"links\":[{links}]}}"
        ))
    };
    assert!(ring("251", "").contains("1 to 250"));
    assert!(json("{\"schema\":2,\"ring\":1,\"links\":[]}").contains("schema 2 is not known"));
    let link = |from: &str, to: &str, bytes: &str| {
        format!("{{\"from\":\"{from}\",\"to\":\"{to}\",\"bytes\":[{bytes}]}}")
    };
    assert!(ring("3", &link("2", "0", "")).contains("no link of a ring has these ends"));
    assert!(ring("1", &link("2", "1", "")).contains("a link of drive 2 is none of it"));
    let twice = "{\"t_ns\":9,\"sent\":1,\"received\":1,\"error\":null},{\"t_ns\":8,\"sent\":1,\"received\":1,\"error\":null}";
    let back = ring("3", &link("2", "1", twice));
    assert_eq!(
        back,
        "link 2->1, byte 2: it comes before the byte in front of it"
    );
    let late = format!(
        "{{\"t_ns\":{},\"sent\":1,\"received\":1,\"error\":null}}",
        u64::MAX
    );
    assert!(ring("3", &link("2", "1", &late)).contains("too late for any clock"));
}
