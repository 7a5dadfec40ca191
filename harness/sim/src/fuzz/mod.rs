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
mod ring;

pub use bus_end::{bus_end, bus_end_watched};
pub use drive::drive;
pub use guard::guard;
pub use hostile::master;
pub use jobs::jobs;
pub use links::links;
pub use repair::repair;
pub use ring::{ThreeDrives, ring, ring_watched};

use crate::device::Device as _;
use crate::plain::PlainDrive;
use crate::reference;
use crate::transitions::{Notes, Reached, Watched};
use harness_proto::line::{LineError, Received};
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
    let _transitions: Reached = detector_watched(data);
}

/// The same, with the transitions that the drive went through.
///
/// # Panics
/// As [`detector`], or a transition is called unreachable.
#[must_use]
pub fn detector_watched<N: Notes>(data: &[u8]) -> N {
    let mut ours = Watched::<N>::default();
    let Some((&damaged, wire)) = data.split_first() else {
        return N::default();
    };
    let mut theirs = reference::Drive::new();
    let mut now = Instant::START;
    let wire = &wire[..wire.len().min(LONGEST)];
    for (number, &byte) in (1_usize..).zip(wire) {
        now += Span::from_micros(287);
        let bad = number == usize::from(damaged);
        let received = if bad {
            Received::bad(byte, LineError::Parity)
        } else {
            Received::good(byte)
        };
        let step = ours.receive(now, received);
        let expected = theirs.receive(reference::Cell { byte, error: bad });
        if step.byte != expected {
            differ(number, wire, step.byte, expected);
        }
        if ours.in_error() != theirs.in_error() {
            differ(number, wire, ours.in_error(), theirs.in_error());
        }
        // Time-outs are no part of the reference model: a case that switches them on ends here.
        if ours.drive().memory().peek(0xFF57) & 4 != 0 {
            ours.reached().assert_possible();
            return ours.into_reached();
        }
    }
    same_memory(ours.drive(), &theirs);
    ours.reached().assert_possible();
    ours.into_reached()
}

/// The two models do or are not the same at a byte. Apart from the loop, which would else keep all of this where a message can be made of it.
#[cold]
#[inline(never)]
fn differ<T: std::fmt::Debug>(number: usize, wire: &[u8], ours: T, theirs: T) {
    panic!("byte {number} of {wire:02X?}: {ours:02X?}, the reference model {theirs:02X?}");
}

/// The memories are the same but for the error code (FD82, FD83), of which the reference model knows one only.
fn same_memory(ours: &PlainDrive, theirs: &reference::Drive) {
    let ours = ours.memory().ram_and_registers();
    let theirs = theirs.ram_and_registers();
    if ours[..2] == theirs[..2] && ours[4..] == theirs[4..] {
        return;
    }
    for (address, (ours, theirs)) in (0xFD80_u16..).zip(ours.iter().zip(theirs)) {
        if ![0xFD82, 0xFD83].contains(&address) {
            assert_eq!(ours, theirs, "cell {address:04X}");
        }
    }
}
