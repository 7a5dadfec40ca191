//! The bodies of the fuzz targets: each takes any bytes and panics where a rule of the manual is broken.
//!
//! Inputs are bytes as they go over the wire, so that a corpus can be read, and played on hardware; what else
//! a case needs stands in front of them and is described at each target. `corpora/fuzz/<target>/` holds inputs
//! that are kept; plain `cargo test` plays all of them.

mod bus_end;
mod drive;
mod guard;
mod hostile;
pub mod jobs;
mod links;
mod repair;

pub use bus_end::{bus_end, bus_end_watched};
pub use drive::drive;
pub use guard::guard;
pub use hostile::master;
pub use jobs::jobs;
pub use links::links;
pub use repair::repair;

use crate::device::Device as _;
use crate::fault::{Flips, LinkFault};
use crate::plain::PlainDrive;
use crate::reference;
use crate::ring::Ring;
use crate::transitions::{Reached, Watched};
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::telegram::Telegram;
use harness_proto::time::{Instant, Span};

/// A target: its name, which is that of its folder in `corpora/fuzz`, and its body.
pub type Target = (&'static str, fn(&[u8]));

/// A target that feeds drives raw bytes, and tells which transitions they went through.
pub type Watching = (&'static str, fn(&[u8]) -> Reached);

/// The targets that feed drives raw bytes.
pub const WATCHING: [Watching; 3] = [
    ("bus_end", bus_end_watched),
    ("detector", detector_watched),
    ("ring", ring_watched),
];

/// Every target whose body is here.
pub const TARGETS: [Target; 9] = [
    ("bus_end", bus_end),
    ("codec", codec),
    ("detector", detector),
    ("links", links),
    ("ring", ring),
    ("drive", drive),
    ("master", master),
    ("jobs", jobs),
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
    let _transitions = detector_watched(data);
}

/// The same, with the transitions that the drive went through.
///
/// # Panics
/// As [`detector`], or a transition is called unreachable.
#[must_use]
pub fn detector_watched(data: &[u8]) -> Reached {
    let mut ours = Watched::default();
    let Some((&damaged, wire)) = data.split_first() else {
        return Reached::default();
    };
    let mut theirs = reference::Drive::new();
    let mut now = Instant::START;
    for (index, &byte) in wire.iter().take(LONGEST).enumerate() {
        now += Span::from_micros(287);
        let bad = index + 1 == usize::from(damaged);
        let received = if bad {
            Received::bad(byte, LineError::Parity)
        } else {
            Received::good(byte)
        };
        let step = ours.receive(now, received);
        let expected = theirs.receive(reference::Cell { byte, error: bad });
        assert_eq!(step.byte, expected, "byte {} of {wire:02X?}", index + 1);
        assert_eq!(ours.in_error(), theirs.in_error(), "byte {}", index + 1);
        // Time-outs are no part of the reference model: a case that switches them on ends here.
        if ours.drive().memory().peek(0xFF57) & 4 != 0 {
            ours.reached().assert_possible();
            return ours.reached().clone();
        }
    }
    same_memory(ours.drive(), &theirs);
    ours.reached().assert_possible();
    ours.reached().clone()
}

/// A ring of three against the reference model. The first byte of the input is the link that is damaged (0
/// to 3) and how (its high half), the second the number of the damaged byte, 0 for none.
///
/// # Panics
/// A byte on any link is otherwise than in the reference model, or a drive's memory or error mode.
pub fn ring(data: &[u8]) {
    let _transitions = ring_watched(data);
}

/// The same, with the transitions that the three drives went through.
///
/// # Panics
/// As [`ring`], or a transition is called unreachable.
#[must_use]
pub fn ring_watched(data: &[u8]) -> Reached {
    let mut reached = Reached::default();
    let [what, place, wire @ ..] = data else {
        return reached;
    };
    let Ok(size) = RingSize::new(3) else {
        return reached;
    };
    if wire.is_empty() {
        return reached;
    }
    let wire = &wire[..wire.len().min(256)];
    let mut ours = Ring::new(size, Rate::Baud38400, |_| Watched::default());
    let mut theirs: Vec<_> = (0..3).map(|_| reference::Drive::new()).collect();
    let (link, fault, other) = ring_fault(*what);
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
    let drives = || (0..3).rev().filter_map(|k| ours.drive(k));
    drives().for_each(|drive| reached.join(drive.reached()));
    reached.assert_possible();
    if drives().any(|drive| drive.drive().memory().peek(0xFF57) & 4 != 0) {
        return reached;
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
    for (ours, theirs) in drives().zip(&theirs) {
        assert_eq!(ours.in_error(), theirs.in_error(), "sent {wire:02X?}");
        same_memory(ours.drive(), theirs);
    }
    reached
}

/// The memories are the same but for the error code, of which the reference model knows one only. Cells that are 00 in both
/// are most of them, and are not looked up.
fn same_memory(ours: &PlainDrive, theirs: &reference::Drive) {
    let compared = |address: u16| address >= 0xFD80 && ![0xFD82, 0xFD83].contains(&address);
    for (address, theirs) in theirs.cells().filter(|(address, _)| compared(*address)) {
        assert_eq!(ours.memory().peek(address), theirs, "cell {address:04X}");
    }
    for address in 0xFD80..=0xFFFF {
        let ours = ours.memory().peek(address);
        if ours != 0 && compared(address) {
            assert_eq!(ours, theirs.peek(address), "cell {address:04X}");
        }
    }
}

/// The damaged link of [`ring`], and what happens on it, in the words of both models.
fn ring_fault(what: u8) -> (usize, LinkFault, reference::Fault) {
    let link = usize::from(what & 3);
    match what >> 4 {
        kind @ 0..8 => {
            let data = 1 << kind;
            let flips = Flips {
                data,
                ..Flips::default()
            };
            let other = reference::Fault::Flip(data, false, false);
            (link, LinkFault::Flip(flips), other)
        }
        8 => (link, LinkFault::Drop, reference::Fault::Drop),
        9 => (link, LinkFault::Duplicate, reference::Fault::Duplicate),
        kind => {
            let other = reference::Fault::Insert(kind);
            (link, LinkFault::Insert(kind), other)
        }
    }
}
