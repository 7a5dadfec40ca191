//! The ring against the reference model, byte for byte, on random rings, memories, telegrams and faults
//! (ND21 9.1-9.9, 10): two models of one manual that share no code.

use super::common::{Random, exchange, repeat, ring, seed};
use harness_proto::line::LineError;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::novobus::mark::Mark as _;
use harness_sim::novobus::reference;

const CASES: u64 = 3_000;

#[test]
fn ring_and_reference_agree_byte_for_byte() {
    let (mut damaged, mut left_out) = (0, 0);
    for case in 0..CASES {
        let mut random = Random(seed().wrapping_mul(CASES).wrapping_add(case));
        match compare(&mut random, case) {
            Some(error) => damaged += usize::from(error),
            None => left_out += 1,
        }
    }
    assert!(
        left_out < CASES / 50,
        "{left_out} of {CASES} cases were left out"
    );
    // A test whose rings are never disturbed, or always, would show little.
    assert!(
        (500..2_900).contains(&damaged),
        "{damaged} of {CASES} cases ended in an error"
    );
}

/// One case: whether any drive went into the error mode; `None` for a case that cannot be compared.
fn compare(random: &mut Random, case: u64) -> Option<bool> {
    let most = if random.below(20) == 0 { 250 } else { 6 };
    let drives = 1 + random.below(most) as u8;
    let mut ours = ring(drives);
    // In ring order: the first is drive N-1.
    let mut theirs: Vec<_> = (0..drives).map(|_| reference::Drive::new()).collect();
    for k in 0..drives {
        for _ in 0..random.below(20) {
            let address = cell(random);
            let byte = random.below(256) as u8;
            let drive = ours.drive_mut(k).expect("a drive of the ring");
            assert!(drive.memory_mut().poke(address, byte));
            theirs[usize::from(drives - 1 - k)].poke(address, byte);
        }
        // Time-outs are no part of the reference model.
        let drive = ours.drive_mut(k).expect("a drive of the ring");
        assert!(drive.memory_mut().poke(0xFF57, 0));
        theirs[usize::from(drives - 1 - k)].poke(0xFF57, 0);
    }
    let mut stream = Vec::new();
    for _ in 0..1 + random.below(12) {
        stream.extend(telegram(random, drives));
    }
    if random.below(2) == 0 {
        stream.extend(CHECK_SEQUENCE);
        for _ in 0..1 + random.below(6) {
            stream.extend(telegram(random, drives));
        }
    }
    let mut faults = Vec::new();
    for _ in 0..random.below(4) {
        let link = random.below(u64::from(drives) + 1) as usize;
        let byte = 1 + random.below(stream.len() as u64);
        let (fault, theirs) = fault(random);
        // No rule says what other faults do to a byte that is held at 0.
        if faults
            .iter()
            .any(|(l, b, _)| (*l, *b as u64) == (link, byte))
        {
            continue;
        }
        ours.arm_link(link, byte, fault);
        faults.push((link, usize::try_from(byte).expect("a small number"), theirs));
    }
    exchange(&mut ours, &stream);
    let monitors = |k| {
        ours.drive(k)
            .is_some_and(|d| d.memory().peek(0xFF57) & 4 != 0)
    };
    if (0..drives).any(monitors) {
        // The telegrams have switched monitoring on.
        return None;
    }
    let expected = reference::run(&mut theirs, &stream, &faults);
    let trace = ours.trace();
    for (i, (link, expected)) in trace.channels.iter().zip(&expected).enumerate() {
        let received: Vec<_> = link
            .octets()
            .iter()
            .filter_map(|byte| byte.arrival())
            .map(|byte| (byte.byte, byte.error.is_some()))
            .collect();
        let expected: Vec<_> = expected
            .iter()
            .map(|cell| (cell.byte, cell.error))
            .collect();
        assert!(
            received == expected,
            "case {case}: ring of {drives}, link {i} differs at byte {:?}\nsent {stream:02X?}\nfaults {faults:?}\n{}",
            received
                .iter()
                .zip(&expected)
                .position(|(a, b)| a != b)
                .map(|p| p + 1),
            repeat("ring_and_reference")
        );
    }
    for k in 0..drives {
        let (drive, other) = (ours.drive(k), &theirs[usize::from(drives - 1 - k)]);
        let drive = drive.expect("a drive of the ring");
        assert_eq!(
            drive.bus_end().in_error(),
            other.in_error(),
            "case {case}, drive {k}"
        );
        for address in (0xFD80..=0xFFFF).filter(|a| ![0xFD82, 0xFD83].contains(a)) {
            assert_eq!(
                drive.memory().peek(address),
                other.peek(address),
                "case {case}, drive {k}, cell {address:04X}; {}",
                repeat("ring_and_reference")
            );
        }
    }
    Some(trace.remarks.iter().any(|mark| mark.cause().is_some()))
}

pub(crate) fn fault(random: &mut Random) -> (LinkFault, reference::Fault) {
    let byte = random.below(256) as u8;
    match random.below(8) {
        0 => (LinkFault::Replace(byte), reference::Fault::Replace(byte)),
        1 => (LinkFault::Drop, reference::Fault::Drop),
        2 => (LinkFault::Duplicate, reference::Fault::Duplicate),
        3 => (LinkFault::Insert(byte), reference::Fault::Insert(byte)),
        4 => {
            // Shorter than a byte: nothing but the byte itself is lost.
            (
                LinkFault::Break(Span::from_micros(200)),
                reference::Fault::Break,
            )
        }
        _ => {
            let data = if random.below(2) == 0 {
                1 << random.below(8)
            } else {
                byte
            };
            let (parity, stop) = (random.below(8) == 0, random.below(8) == 0);
            (
                LinkFault::Flip(Flips {
                    data,
                    parity,
                    stop,
                    start: false,
                }),
                reference::Fault::Flip(data, parity, stop),
            )
        }
    }
}

/// Cells that matter, and any others.
fn cell(random: &mut Random) -> u16 {
    const KNOWN: [u16; 6] = [0xFF32, 0xFF34, 0xFE13, 0xFE14, 0xFF08, 0xFF18];
    match random.below(3) {
        0 => KNOWN[random.below(KNOWN.len() as u64) as usize],
        1 => 0x2F00 + random.below(0xE0) as u16,
        // Not the cells of the error code: the reference model knows one code for every bad byte.
        _ => 0xFD84 + random.below(0x10000 - 0xFD84) as u16,
    }
}

/// A telegram, mostly a legal one.
pub(crate) fn telegram(random: &mut Random, drives: u8) -> Vec<u8> {
    if random.below(12) == 0 {
        return (0..1 + random.below(6))
            .map(|_| random.below(256) as u8)
            .collect();
    }
    if random.below(10) == 0 {
        return vec![[0x80, 0x81][random.below(2) as usize]];
    }
    let mut parameters = Vec::new();
    let process_data = random.below(3) == 0;
    let room = if process_data { 5 } else { 7 };
    while random.below(3) > 0 || parameters.is_empty() {
        parameters.extend(command(random));
    }
    let mut bytes = Vec::new();
    let address = (random.below(u64::from(drives)) as u8).wrapping_sub(drives);
    for (i, part) in parameters.chunks(room).enumerate() {
        let addressing = if i == 0 { random.below(4) } else { 2 };
        let length = part.len() as u8 + if process_data { 2 } else { 0 };
        let sync = 0x80 | length << 1 | u8::from(process_data);
        match addressing {
            0 | 1 => bytes.extend([sync, address]),
            2 => bytes.push(sync | 0x20),
            _ => bytes.push(sync | 0x60),
        }
        if process_data {
            bytes.extend([random.below(256) as u8, random.below(256) as u8]);
        }
        bytes.extend(part);
    }
    bytes
}

/// A command with its checking byte, now and then a wrong one.
fn command(random: &mut Random) -> Vec<u8> {
    let [high, low] = cell(random).to_be_bytes();
    let data = random.below(256) as u8;
    let mut bytes = match random.below(9) {
        0 => vec![0xC0, low, high],
        1 => vec![0xC1, low, high, b'?'],
        2 => vec![0xC7, low, high, b'1', b'2'],
        3 => vec![0x82, data, low, high],
        4 => vec![0x63, data, !data, low, high],
        5 => vec![0xA4, data, low & 0x7F],
        6 => vec![0xA5, data, low & 0x7F],
        7 => vec![0xC8, data & 3],
        _ if random.below(4) == 0 => vec![0xDD, b'!'],
        _ => vec![0xC0, 0x13, 0xFE],
    };
    bytes.push(Checksum::over(&bytes).plus());
    if random.below(25) == 0 {
        let place = random.below(bytes.len() as u64) as usize;
        bytes[place] = data;
    }
    bytes
}

/// Two runs of one seed are identical, to the last nanosecond.
#[test]
fn two_runs_are_identical() {
    let run = || {
        let mut random = Random(seed());
        let mut ring = ring(5);
        let mut stream = Vec::new();
        for _ in 0..50 {
            stream.extend(telegram(&mut random, 5));
        }
        for _ in 0..10 {
            ring.arm_link(
                random.below(6) as usize,
                1 + random.below(200),
                fault(&mut random).0,
            );
        }
        exchange(&mut ring, &stream);
        ring.trace()
    };
    assert_eq!(run(), run());
}

/// A receiver names what it noticed: a stop bit of 0 is worse than wrong parity.
#[test]
fn line_errors_have_names() {
    let mut ring = ring(1);
    ring.arm_link(
        1,
        2,
        LinkFault::Flip(Flips {
            data: 1,
            ..Flips::default()
        }),
    );
    ring.arm_link(
        1,
        3,
        LinkFault::Flip(Flips {
            data: 1,
            stop: true,
            ..Flips::default()
        }),
    );
    ring.arm_link(1, 4, LinkFault::Break(Span::from_micros(300)));
    ring.arm_link(1, 6, LinkFault::Overrun);
    let heard = exchange(&mut ring, &[0x80; 7]);
    let errors: Vec<_> = heard.iter().map(|byte| byte.error).collect();
    // The break lasts longer than a byte: the fifth byte is lost in it.
    let expected = [
        None,
        Some(LineError::Parity),
        Some(LineError::Framing),
        Some(LineError::Break),
        Some(LineError::Overrun),
        None,
    ];
    assert_eq!(errors, expected);
}
