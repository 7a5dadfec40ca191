//! The bodies of the fuzz targets: each takes any bytes and panics where a rule of the manual is broken.
//!
//! Inputs are bytes as they go over the wire, so that a corpus can be read, and played on hardware; what else
//! a case needs stands in front of them and is described at each target. `corpora/fuzz/<target>/` holds inputs
//! that are kept; plain `cargo test` plays all of them.

mod drive;
mod guard;
mod hostile;

pub use drive::drive;
pub use guard::guard;
pub use hostile::master;

use crate::fault::{Flips, LinkFault};
use crate::plain::PlainDrive;
use crate::reference;
use crate::ring::Ring;
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::BusEnd;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::properties::Properties;
use harness_proto::novobus::telegram::Telegram;
use harness_proto::time::{Instant, Span};

/// A target: its name, which is that of its folder in `corpora/fuzz`, and its body.
pub type Target = (&'static str, fn(&[u8]));

/// Every target.
pub const TARGETS: [Target; 6] = [
    ("codec", codec),
    ("detector", detector),
    ("ring", ring),
    ("drive", drive),
    ("master", master),
    ("guard", guard),
];

/// The longest input that is looked at; what lies behind is left out.
const LONGEST: usize = 4_096;

/// The codec: every byte string is a value, a beginning or a mistake, and a value is made of the bytes that it
/// took.
///
/// # Panics
/// A value is encoded as other bytes.
pub fn codec(data: &[u8]) {
    if let Decoded::Value { value, used } = Command::decode(data) {
        assert_eq!(value.encode()[..], data[..used], "{value:?}");
    }
    if let Decoded::Value { value, used } = Telegram::decode(data) {
        let again = Telegram::decode(&value.encode()).value();
        assert_eq!(again, Some(value), "{used} bytes");
    }
    for length in 0..data.len().min(16) {
        // What is a value of its beginning stays one, whatever follows.
        if let Decoded::Value { value, used } = Command::decode(&data[..length]) {
            let whole = Command::decode(data);
            assert_eq!(whole, Decoded::Value { value, used });
        }
    }
}

/// One drive's end of the bus against the reference model, byte by byte (ND21 9.1-9.8). The first byte of
/// the input is the number of the byte that arrives with wrong parity, 0 for none; the rest goes over the
/// wire.
///
/// # Panics
/// The two models answer otherwise, or disagree on the error mode or the memory.
pub fn detector(data: &[u8]) {
    let Some((&damaged, wire)) = data.split_first() else {
        return;
    };
    let mut ours = PlainDrive::default();
    let mut theirs = reference::Drive::new();
    let mut bus_end = BusEnd::new(Properties::default());
    let mut now = Instant::START;
    for (index, &byte) in wire.iter().take(LONGEST).enumerate() {
        now += Span::from_micros(287);
        let bad = index + 1 == usize::from(damaged);
        let received = if bad {
            Received::bad(byte, LineError::Parity)
        } else {
            Received::good(byte)
        };
        let step = bus_end.receive(now, received, ours.memory_mut());
        let expected = theirs.receive(reference::Cell { byte, error: bad });
        assert_eq!(step.byte, expected, "byte {} of {wire:02X?}", index + 1);
        assert_eq!(bus_end.in_error(), theirs.in_error(), "byte {}", index + 1);
        // Time-outs are no part of the reference model: a case that switches them on ends here.
        if ours.memory().peek(0xFF57) & 4 != 0 {
            return;
        }
    }
    same_memory(&ours, &theirs);
}

/// A ring of three against the reference model. The first byte of the input is the link that is damaged (0
/// to 3) and how (its high half), the second the number of the damaged byte, 0 for none.
///
/// # Panics
/// A byte on any link is otherwise than in the reference model, or a drive's memory or error mode.
pub fn ring(data: &[u8]) {
    let [what, place, wire @ ..] = data else {
        return;
    };
    if wire.is_empty() {
        return;
    }
    let wire = &wire[..wire.len().min(256)];
    let Ok(size) = RingSize::new(3) else { return };
    let mut ours = Ring::new(size, Rate::Baud38400, |_| PlainDrive::default());
    let mut theirs: Vec<_> = (0..3).map(|_| reference::Drive::new()).collect();
    let link = usize::from(what & 3);
    let (fault, other) = match what >> 4 {
        kind @ 0..8 => {
            let data = 1 << kind;
            let flips = Flips {
                data,
                ..Flips::default()
            };
            (
                LinkFault::Flip(flips),
                reference::Fault::Flip(data, false, false),
            )
        }
        8 => (LinkFault::Drop, reference::Fault::Drop),
        9 => (LinkFault::Duplicate, reference::Fault::Duplicate),
        kind => (LinkFault::Insert(kind), reference::Fault::Insert(kind)),
    };
    let mut faults = Vec::new();
    if *place > 0 && usize::from(*place) <= wire.len() {
        ours.arm_link(link, u64::from(*place), fault);
        faults.push((link, usize::from(*place), other));
    }
    ours.send(Instant::START, wire);
    while ours.busy() {
        let Some(next) = ours.next_event() else { break };
        ours.run_until(next);
    }
    let monitors = |k: u8| {
        let drive = ours.drive(k);
        drive.is_some_and(|drive| drive.memory().peek(0xFF57) & 4 != 0)
    };
    if (0..3).any(monitors) {
        return;
    }
    let expected = reference::run(&mut theirs, wire, &faults);
    for (index, (link, expected)) in ours.trace().links.iter().zip(&expected).enumerate() {
        let received: Vec<_> = link
            .bytes
            .iter()
            .filter_map(|byte| byte.arrival())
            .map(|byte| (byte.byte, byte.error.is_some()))
            .collect();
        let expected: Vec<_> = expected
            .iter()
            .map(|cell| (cell.byte, cell.error))
            .collect();
        assert_eq!(received, expected, "link {index}, sent {wire:02X?}");
    }
    for (k, theirs) in (0..3).rev().zip(&theirs) {
        if let Some(ours) = ours.drive(k) {
            assert_eq!(ours.bus_end().in_error(), theirs.in_error(), "drive {k}");
            same_memory(ours, theirs);
        }
    }
}

/// The memories are the same but for the error code, of which the reference model knows one only.
fn same_memory(ours: &PlainDrive, theirs: &reference::Drive) {
    for address in (0xFD80..=0xFFFF).filter(|address| ![0xFD82, 0xFD83].contains(address)) {
        let (ours, theirs) = (ours.memory().peek(address), theirs.peek(address));
        assert_eq!(ours, theirs, "cell {address:04X}");
    }
}
