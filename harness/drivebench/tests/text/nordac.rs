//! Scenarios of NORDAC inverters as a stranger plays them: commands, traces, reports, evidence.

use crate::typed::run;
use std::path::Path;

/// Link type 250: an interface a station, a packet a telegram, with its line error in the header and in a comment.
#[test]
fn traces_for_wireshark() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("nordac.pcapng");
    let name = path.to_str().expect("a name");
    let trace = [
        "trace",
        "nordac-en-1-parity-3",
        "--format",
        "pcapng",
        "-o",
        name,
    ];
    assert_eq!(run(&trace).0, 0);
    let bytes = std::fs::read(&path).expect("a capture");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("a word"));
    let (mut at, mut blocks) = (0, Vec::new());
    while at < bytes.len() {
        let length = word(at + 4) as usize;
        assert_eq!(
            word(at + length - 4) as usize,
            length,
            "both lengths of a block"
        );
        blocks.push((word(at), bytes[at..at + length].to_vec()));
        at += length;
    }
    let kinds: Vec<_> = blocks.iter().map(|(kind, _)| *kind).collect();
    assert_eq!(kinds, [0x0A0D_0D0A, 1, 1, 6, 6, 6]);
    let has =
        |block: usize, text: &[u8]| blocks[block].1.windows(text.len()).any(|part| part == text);
    assert!(has(1, b"master") && has(2, b"slave 8"));
    // Behind 28 bytes of the block and 8 of time: the event, and behind three zeros the octets.
    let event = |block: usize| blocks[block].1[36];
    assert_eq!([event(3), event(4), event(5)], [0x08, 0x03, 0x04]);
    assert!(has(3, b"byte 3 parity") && has(4, &[0x10, 8, 2, 0x49, 0x53, 0x16]));
}
