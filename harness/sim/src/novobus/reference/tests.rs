//! The reference model against the printed tables.

use super::*;

// The columns of the printed tables, one a line: master, drives 99 to 95 (drive 98 as drive 97
// reads it), drive 0. The print of 9.7 ends with row 18; its five telegrams go on to row 30.
const LINKS: [usize; 7] = [0, 1, 2, 3, 4, 5, 100];
const TABLE_9_7: &str = "\
    88 FB C0 13 FE D1 88 FC C0 13 FE D1 88 FD C0 13 FE D1 88 FE C0 13 FE D1 88 FF C0 13 FE D1
    88 FC C0 13 FE D1 88 FD C0 13 FE D1 88 FE C0 13 FE D1 88 FF C0 13 FE D1 88 00 C0 13 88 A5
    88 FD C0 13 FE D1 88 FE C0 12 FE D1 88 FF C0 13 FE D1 88 00 C0 13 88 A5 88 01 C0 13 88 A5
    88 FE C0 13 FE D1 88 FF C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
    88 FF C0 13 FE D1 88 00 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 01 01 01
    88 00 C0 13 88 A5 88 01 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 02
    88 5F C0 13 88 A5 88 60 C0 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 61";
const TABLE_9_8: &str = "\
    88 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FC C0 13 FE D1
    88 01 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FD C0 13 FE D1
    88 02 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 FF 44 72 4C 41 88 FE C0 13 FE D1
    00 00 00 00 00 00 00 00 00 01 01 01 01 01 01 01 01 01 FF 44 72 4C 41 88 FF C0 13 FE D1
    01 01 01 01 01 01 01 01 01 02 02 02 02 02 02 02 02 02 FF 44 72 4C 41 88 00 C0 13 88 A5
    02 02 02 02 02 02 02 02 02 03 03 03 03 03 03 03 03 03 FF 44 72 4C 41 88 01 C0 13 88 A5
    61 61 61 61 61 61 61 61 61 62 62 62 62 62 62 62 62 62 FF 44 72 4C 41 88 60 C0 13 88 A5";

fn bytes(text: &str) -> Vec<u8> {
    let byte = |word| u8::from_str_radix(word, 16).unwrap();
    text.split_whitespace().map(byte).collect()
}

/// What these links carry, the first line being what the master sends.
fn check(ring: &mut [Drive], faults: &[(usize, usize, Fault)], links: &[usize], table: &str) {
    let columns: Vec<_> = table.lines().map(bytes).collect();
    let cells = run(ring, &columns[0], faults);
    for (link, column) in links.iter().zip(columns) {
        let read: Vec<u8> = cells[*link].iter().map(|cell| cell.byte).collect();
        assert_eq!(read, column, "link {link}");
    }
}

/// ND21 9.7 and 9.8: the second table goes on where the first one ends.
#[test]
fn byte_tables() {
    let mut drive = Drive::new();
    drive.poke(0xFE13, 0x88);
    let mut ring = vec![drive; 100];
    let fault = (2, 10, Fault::Flip(1, false, false));
    check(&mut ring, &[fault], &LINKS, TABLE_9_7);
    assert_eq!(ring.iter().position(Drive::in_error), Some(2));
    check(&mut ring, &[], &LINKS, TABLE_9_8);
    assert_eq!(ring.iter().position(Drive::in_error), None);
}

/// ND21 9.2, 9.4: no short address after power-up, then drive 0, the next, the same; PAUSE.
#[test]
fn short_telegrams_and_process_data() {
    let mut ring = [Drive::new(), Drive::new()];
    let table = "A2 55 85 FE 12 34 E5 56 78 81 A5 9A BC 80
        A2 55 85 FF 12 34 E5 00 00 A5 56 78 80
        A2 55 85 00 00 00 E5 00 00 A5 56 78 80";
    ring[0].poke(0xFF32, 8);
    ring[0].poke(0xFF34, 8);
    check(&mut ring, &[], &[0, 1, 2], table);
    assert_eq!([ring[0].peek(0xFF08), ring[0].peek(0xFF09)], [0x9A, 0xBC]);
}

/// ND21 8.3: what one byte, 05, turns into.
#[test]
fn line_faults() {
    let check = |fault, expected: &[(u8, bool)]| {
        let mut read = Vec::new();
        transmit(5, (0, 1), &[(0, 1, fault)], &mut read);
        let read: Vec<_> = read.iter().map(|cell| (cell.byte, cell.error)).collect();
        assert_eq!(read, expected, "{fault:?}");
    };
    check(Fault::Flip(3, false, false), &[(6, false)]);
    check(Fault::Flip(1, true, false), &[(4, false)]);
    check(Fault::Flip(3, true, false), &[(6, true)]);
    check(Fault::Flip(3, false, true), &[(6, true)]);
    check(Fault::Replace(6), &[(6, false)]);
    check(Fault::Drop, &[]);
    check(Fault::Duplicate, &[(5, false), (5, false)]);
    check(Fault::Insert(6), &[(6, false), (5, false)]);
    check(Fault::Break, &[(0, true)]);
}

/// Cells from `at` on before and after an exchange; then bytes of which the last is refused, so
/// that no zeros are heard but those of the address byte and of the last byte.
fn command(at: u16, before: &str, after: &str, exchange: &str, refused: &str, code: u8) {
    let mut ring = [Drive::new()];
    for (cell, byte) in (at..).zip(bytes(before)) {
        ring[0].poke(cell, byte);
    }
    check(&mut ring, &[], &[0, 1], exchange);
    let mut cells = (at..).zip(bytes(after));
    assert!(cells.all(|(cell, byte)| ring[0].peek(cell) == byte));
    let heard = run(&mut ring, &bytes(refused), &[]).remove(1);
    assert_eq!(heard.iter().filter(|cell| cell.byte == 0).count(), 2);
    assert_eq!([ring[0].peek(0xFD82), ring[0].peek(0xFD83)], [5, code]);
}

macro_rules! commands {
    ($($name:ident $($case:literal)*;)*) => {
        $(#[test] fn $name() { command($($case),*); })*
    };
}
commands! {
    read_byte 0x2FBF "12" "" "88 FF C0 BF 2F AE\n88 00 C0 BF 12 6F" "86 FF C0 C0 2F" 6;
    read_word 0xFF7E "12 34" "" "8A FF C1 7E FF 3F 7D\n8A 00 C1 7E 34 12 7B" "86 FF C1 7F FF" 6;
    read_long 0xFF7C "01 02 03 04" "" "8C FF C7 7C FF 31 32 A5\n8C 00 C7 7C 01 02 03 04" "88 FF C7 7C FF 30" 6;
    write_byte 0xFD80 "11" "5A" "8A FF 82 5A 80 FD 59\n8A 00 82 5A 80 FD A7" "88 FF 82 5A 80 FF" 6;
    write_word 0xFF7E "" "12 34" "8C FF 63 34 12 7E FF 26\n8C 00 63 34 12 7E FF DA" "8A FF 63 34 12 7F FF" 6;
    and 0xFF7F "5A" "0A" "88 FF A4 0F 7F 32\n88 00 A4 0F 7F CE" "86 FF A4 0F 80" 6;
    or 0xFF00 "24" "7F" "88 FF A5 5B 00 01\n88 00 A5 5B 00 01" "88 FF A5 0F 7F 32" 7;
    write_io_1_2 0xFFB7 "28" "88" "8C FF C8 01 C9 C8 02 CA\n8C 00 C8 01 37 C8 02 36" "84 FF C8 04" 6;
    write_io_0_3 0xFFB7 "88" "28" "8C FF C8 00 C8 C8 03 CB\n8C 00 C8 00 38 C8 03 35" "82 FF C8 90" 4;
    reset_h8 0xFD80 "11 22" "00 00" "86 FF DD 21 FE A2 55\n86 00 DD 21 02 A2 55" "82 FF 83" 5;
}
