//! The input of the fuzz targets that is kept of a finding on a ring, beside its scenario.

use crate::explore::{Act, ActKind, Case, Harm};

/// The folder of inputs.
pub(super) const INPUTS: &str = "corpora/fuzz/ring";

/// Maximum number of bytes of an input of the fuzz target `ring`.
const MOST_INPUT: usize = 256;

/// The input of the fuzz target `ring`: what is damaged and where, then the bytes of the wire.
pub(super) fn input(case: &Case, title: &str) -> String {
    let bytes = case.bytes();
    let (head, note) = match damage(case) {
        Some(head) => (head, ""),
        None => (
            [0, 0],
            "; without its faults and its silence, which the target has not",
        ),
    };
    let hex = |bytes: &[u8]| {
        let words: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        words.join(" ")
    };
    let mut text = format!(
        "# {title}; a ring of {}{note}\n{}\n",
        case.drives,
        hex(&head)
    );
    for line in bytes[..bytes.len().min(MOST_INPUT)].chunks(32) {
        text.push_str(&hex(line));
        text.push('\n');
    }
    text
}

/// The two bytes in front of an input: link and kind, and which byte; `None` where the target has no such case.
fn damage(case: &Case) -> Option<[u8; 2]> {
    let beyond = |act: &Act| matches!(act.what, ActKind::Wait(_) | ActKind::Power { .. });
    if case.acts.iter().any(beyond) {
        return None;
    }
    match case.faults().as_slice() {
        [] => Some([0, 0]),
        [(link @ 0..=3, byte, harm)] => {
            let kind = match harm {
                Harm::Flip {
                    data,
                    parity: false,
                    stop: false,
                } if data.count_ones() == 1 => u8::try_from(data.trailing_zeros()).ok()?,
                Harm::Drop => 8,
                Harm::Duplicate => 9,
                _ => return None,
            };
            Some([kind << 4 | link, u8::try_from(*byte).ok()?])
        }
        _ => None,
    }
}
