//! Attacks on the guard: telegrams of denied and allowed commands, whole and cut, shifted, mixed with recoveries, zeros,
//! check sequences, short addresses, line errors and silence. `harness_sim::novobus::fuzz::guard` judges.

use proptest::collection::vec;
use proptest::prelude::*;

const RECOVERY: [u8; 22] = [
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0x44, 0x72, 0x4C, 0x41,
];

/// A command with its checking byte (ND21 9.6).
fn closed(mut command: Vec<u8>) -> Vec<u8> {
    let sum = command
        .iter()
        .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    command.push(sum.max(1));
    command
}

fn command() -> impl Strategy<Value = Vec<u8>> {
    let low = prop_oneof![
        Just(0x00_u8),
        Just(0x08),
        Just(0x09),
        Just(0x32),
        Just(0x36),
        Just(0x43),
        Just(0x57),
        Just(0x8A),
        Just(0x88),
        Just(0x38),
        Just(0x7C),
        Just(0xFF),
        any::<u8>(),
    ];
    let high = prop_oneof![6 => Just(0xFF_u8), 3 => Just(0xFD), 1 => any::<u8>()];
    let data = prop_oneof![
        Just(0x00_u8),
        Just(0x01),
        Just(0x80),
        Just(0x81),
        Just(0x82),
        Just(0x84),
        Just(0x10),
        Just(0xFF),
        any::<u8>(),
    ];
    (0..13_u8, low, high, data.clone(), data).prop_map(|(kind, low, high, a, b)| {
        closed(match kind {
            0 => vec![0xC0, low, high],
            1 => vec![0xC1, low, high, b'?'],
            2 => vec![0xC7, low, high, b'1', b'2'],
            3 | 4 => vec![0x82, a, low, high],
            5 | 6 => vec![0x63, a, b, low, high],
            7 => vec![0xA4, a, low & 0x7F],
            8 | 9 => vec![0xA5, a, low & 0x7F],
            10 => vec![0xC8, a & 3],
            // The EEPROM controller: write a byte, ProgParam (14.10.5).
            11 => vec![0x82, if a & 1 == 0 { 0x82 } else { 0x84 }, 0x8A, 0xFD],
            _ => vec![0xDD, b'!'],
        })
    })
}

/// Commands cut over telegrams: each piece after a sync byte of one kind or another.
fn telegrams() -> impl Strategy<Value = Vec<u8>> {
    let pieces = vec(
        (1..8_usize, 0..8_u8, 0xF8..=0xFF_u8, any::<[u8; 2]>()),
        1..7,
    );
    (command(), pieces).prop_map(|(command, pieces)| {
        let mut bytes = Vec::new();
        let mut rest = &command[..];
        for (most, kind, address, process) in pieces {
            let with_process = kind == 7;
            let most = if with_process { most.min(5) } else { most };
            let (net, behind) = rest.split_at(most.min(rest.len()));
            let length = net.len() as u8 + 2 * u8::from(with_process);
            let short = match kind {
                0 | 1 => 0x20,
                2 => 0x60,
                _ => 0,
            };
            bytes.push(0x80 | short | length << 1 | u8::from(with_process));
            if short == 0 {
                // Most often the same drive.
                bytes.push(if kind < 6 { 0xFF } else { address });
            }
            if with_process {
                bytes.extend(process);
            }
            bytes.extend(net);
            rest = behind;
            if rest.is_empty() {
                break;
            }
        }
        bytes
    })
}

fn piece() -> impl Strategy<Value = Vec<u8>> {
    let shifted = |bytes: Vec<u8>, by: u8| bytes.iter().map(|byte| byte.wrapping_sub(by)).collect();
    prop_oneof![
        8 => telegrams(),
        3 => Just(RECOVERY.to_vec()),
        2 => (0..20_usize).prop_map(|zeros| vec![0; zeros]),
        2 => (telegrams(), 1..4_u8).prop_map(move |(bytes, by)| shifted(bytes, by)),
        2 => (1..4_u8).prop_map(move |by| shifted(RECOVERY[17..].to_vec(), by)),
        1 => Just(RECOVERY[17..].to_vec()),
        1 => vec(prop_oneof![Just(0x80_u8), Just(0x81), Just(0x41), Just(0xFF), any::<u8>()], 1..8),
        1 => (telegrams(), any::<prop::sample::Index>()).prop_map(|(mut bytes, at)| {
            bytes.truncate(at.index(bytes.len() + 1));
            bytes
        }),
        1 => (telegrams(), any::<prop::sample::Index>(), any::<u8>()).prop_map(|(mut bytes, at, by)| {
            let at = at.index(bytes.len());
            bytes[at] ^= by;
            bytes
        }),
    ]
}

fn case() -> impl Strategy<Value = Vec<u8>> {
    let head = (
        any::<u8>(),
        prop_oneof![2 => Just(0_u8), 1 => 1..120_u8],
        prop_oneof![2 => Just(0_u8), 1 => 1..120_u8],
        any::<u8>(),
    );
    let start = vec(piece(), 0..3).prop_map(|pieces| {
        let mut bytes = pieces.concat();
        bytes.truncate(40);
        bytes
    });
    (head, start, any::<bool>(), vec(piece(), 1..12)).prop_map(|(head, start, recovered, wire)| {
        let (what, damaged, silent, whose) = head;
        let mut case = vec![what, damaged, silent, whose, start.len() as u8];
        case.extend(start);
        if recovered {
            case.extend(RECOVERY);
        }
        case.extend(wire.concat());
        case
    })
}

/// Process data that another program has left half-sent end with whatever comes next (ND21 9.4), and are not held against the guard; those
/// that it saw announced are.
#[test]
fn process_data_left_by_others_end_with_the_next_byte() {
    let mut case = vec![0, 0, 0, 0, 3, 0x85, 0xFF, 0xCA];
    case.extend(RECOVERY);
    case.extend([0x85, 0xFF, 0xCA]);
    harness_sim::novobus::fuzz::guard(&case);
}

/// ND21 9.9: the time of the first drive is up in the middle of a command to the second, and it keeps a recovery to itself. The second one
/// takes another command for the rest of the first.
#[test]
fn a_drive_that_passes_nothing_on() {
    let silent = RECOVERY.len() as u8 + 7;
    for (wait_ms, filled) in [(7, 3), (10, 14)] {
        let mut case = vec![0x20, 0, silent, wait_ms << 4 | 8, 0];
        case.extend(RECOVERY);
        // WriteByte 3E to FF01; its checking byte, C0, begins a read.
        case.extend([0x88, 0xFE, 0x82, 0x3E, 0x01, 0xFF]);
        case.extend(RECOVERY);
        case.extend(vec![0x80; filled]);
        case.extend([0x88, 0xFE, 0xC0]);
        harness_sim::novobus::fuzz::guard(&case);
    }
}

/// ND21 9.9: the first drive keeps the rest of a check sequence to itself. The second one, which has heard its begin, makes one of a telegram to
/// no drive, and takes what follows in it for telegrams.
#[test]
fn a_check_sequence_that_does_not_reach_everyone() {
    let silent = RECOVERY.len() as u8 - 2;
    let mut case = vec![0x20, 0, silent, 10 << 4 | 8, 0];
    case.extend(RECOVERY);
    case.extend(vec![0x80; 30]);
    // Kept up to its address byte; then the rest of the check sequence, and the begin of a telegram with WriteByte.
    case.extend([0x8C, 0x00, 0x72, 0x4C, 0x41, 0x8E, 0xFF, 0x82]);
    // 88 to FF01: the first drive makes 01 of the address byte.
    case.extend([0x88, 0x00, 0xFF, 0x0A]);
    harness_sim::novobus::fuzz::guard(&case);
}

/// ND21 9.9: a drive that no command had reached in part keeps a recovery to itself, is ready, and still keeps the begin of a telegram to no
/// drive.
#[test]
fn a_drive_that_is_ready_and_keeps_bytes() {
    let silent = RECOVERY.len() as u8 + 1;
    let mut case = vec![0x20, 0, silent, 10 << 4 | 8, 0];
    case.extend([RECOVERY, RECOVERY].concat());
    case.extend(vec![0x80; 11]);
    case.extend([0x8E, 0x00, 0x8A, 0xFF, 0x82, 0x3E, 0x01, 0xFF, 0xC0]);
    harness_sim::novobus::fuzz::guard(&case);
}

/// ND21 9.7, 9.9: zeros that a drive has kept show it that the drive in front of it is in the error mode, so it makes 01 of the next ones.
#[test]
fn zeros_that_were_kept() {
    let silent = RECOVERY.len() as u8 + 5;
    let mut case = vec![0x20, 0, silent, 10 << 4 | 8, 0];
    case.extend(RECOVERY);
    case.extend([0x88, 0xFE, 0xA5, 0x5B, 0x38, 0x38]);
    case.extend(vec![0; 40]);
    harness_sim::novobus::fuzz::guard(&case);
    let mut case = vec![0x20, 0, silent, 10 << 4 | 8, 0];
    case.extend(RECOVERY);
    case.extend([0x8A, 0xFE, 0x82, 0x7F, 0x88, 0xFD, 0x86]);
    case.extend(vec![0; 31]);
    case.extend([0x00, 0xFF, 0x00]);
    harness_sim::novobus::fuzz::guard(&case);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// No input makes the guard let pass what the limits deny.
    #[test]
    fn no_sequence_smuggles_a_command_through(case in case()) {
        harness_sim::novobus::fuzz::guard(&case);
    }

    /// Nor do bytes without any order.
    #[test]
    fn nor_do_random_bytes(case in vec(any::<u8>(), 5..200)) {
        harness_sim::novobus::fuzz::guard(&case);
    }
}
