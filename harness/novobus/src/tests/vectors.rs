//! The codec against the vectors typed from print (corpora/vectors), byte by byte.

use crate::tests::ROOT;
use harness_proto::novobus::address::{RingSize, passed_on};
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::{Command, Field, LAYOUTS, Layout, Reply};
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{PAUSE, SYNCO};
use harness_proto::novobus::telegram::{Address, Telegram};
use std::collections::BTreeMap;
use std::path::Path;

/// A printed byte; `None` where the print has a name in place of a number.
type Byte = Option<u8>;

fn vectors() -> BTreeMap<String, Vec<Byte>> {
    let path = Path::new(ROOT).join("corpora/vectors/novobus.txt");
    let text = std::fs::read_to_string(path).expect("the vectors");
    let mut vectors = BTreeMap::new();
    let mut name = None;
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix('[') {
            let (title, source) = rest
                .split_once("] source: nd21 ")
                .expect("[name] source: nd21 section");
            assert!(!source.is_empty());
            assert_eq!(
                vectors.insert(title.to_owned(), Vec::new()),
                None,
                "{title} stands twice"
            );
            name = Some(title.to_owned());
        } else if line.is_empty() {
            name = None;
        } else if !line.starts_with('#') {
            let (byte, meaning) = line.split_once("  # ").expect("byte  # meaning");
            assert!(!meaning.is_empty());
            let byte = match byte {
                "xx" => None,
                digits => Some(u8::from_str_radix(digits, 16).expect("two digits")),
            };
            let vector = name.as_ref().and_then(|name| vectors.get_mut(name));
            vector.expect("a byte in a vector").push(byte);
        }
    }
    vectors
}

/// A vector that is all numbers.
fn bytes(vectors: &BTreeMap<String, Vec<Byte>>, name: &str) -> Vec<u8> {
    let vector = vectors
        .get(name)
        .unwrap_or_else(|| panic!("no vector {name}"));
    vector.iter().map(|byte| byte.expect("a number")).collect()
}

#[test]
fn single_bytes_and_the_check_sequence() {
    let all = vectors();
    assert_eq!(bytes(&all, "synco"), [SYNCO]);
    assert_eq!(bytes(&all, "pause"), [PAUSE]);
    assert_eq!(bytes(&all, "check-sequence"), CHECK_SEQUENCE);
}

/// ND21 9.3: FD goes out, each axis adds 1.
#[test]
fn the_address_of_axis_2_of_5() {
    let all = vectors();
    let ring = RingSize::new(5).expect("a ring");
    let mut address = ring.address_byte(2).expect("a drive");
    for printed in bytes(&all, "address-2-of-5") {
        assert_eq!(address, printed);
        address = passed_on(address);
    }
}

/// ND21 9.7: the telegram of the 100-axis example and what stands behind each drive.
#[test]
fn the_telegram_to_drive_95_of_100() {
    let all = vectors();
    let ring = RingSize::new(100).expect("a ring");
    let command = Command::ReadByte { address: 0xFE13 };
    let at = |address, parameters: &[u8]| {
        Telegram::new(Address::Byte(address), None, parameters)
            .expect("a legal telegram")
            .encode()
    };
    let mut address = ring.address_byte(95).expect("a drive");
    assert_eq!(
        bytes(&all, "read-byte-95-of-100-sent"),
        at(address, &command.encode())
    );
    let answer = command.answer(&[0x88], ReadLongAnswer::default());
    for behind in [99, 98, 97, 96, 95, 0] {
        address = 95u8.wrapping_sub(behind);
        let parameters = if behind <= 95 {
            &answer
        } else {
            &command.encode()
        };
        // What drive 0 sends is what the master receives.
        let name = match behind {
            0 => "read-byte-95-of-100-received".to_owned(),
            _ => format!("read-byte-95-of-100-behind-{behind}"),
        };
        assert_eq!(bytes(&all, &name), at(address, parameters), "{name}");
    }
}

/// ND21 10.1-10.5: command and answer of every row, byte by byte; a name in the print stands where the
/// layout has a variable byte, a number where it has a fixed one.
#[test]
fn the_commands_of_chapter_10() {
    let all = vectors();
    let names = |layout: &Layout| {
        let mut name = String::new();
        for c in layout.printed_name.replace("WriteIO", "WriteIo").chars() {
            if c.is_uppercase() && !name.is_empty() {
                name.push('-');
            }
            name.extend(c.to_lowercase());
        }
        name
    };
    for layout in &LAYOUTS[..9] {
        let name = names(layout);
        let mut command = vec![Some(layout.code)];
        let mut answer = vec![Some(layout.code)];
        for (field, reply) in layout.command.iter().zip(layout.answer) {
            let fixed = match field {
                Field::Fixed(byte) => Some(*byte),
                _ => None,
            };
            command.push(fixed);
            answer.push(fixed.filter(|_| *reply == Reply::Echo));
        }
        let printed = |kind: &str| {
            let name = format!("{name}-{kind}");
            all.get(&name)
                .unwrap_or_else(|| panic!("no vector {name}: {:?}", all.keys()))
                .clone()
        };
        assert_eq!(printed("command"), command, "{name}");
        assert_eq!(printed("answer"), answer, "{name}");
    }
}
