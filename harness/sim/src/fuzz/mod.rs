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
use crate::link::LineByte;
use crate::plain::PlainDrive;
use crate::reference;
use crate::ring::Ring;
use crate::transitions::{Notes, Reached, Watched};
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
        let in_error = [ours.in_error(), theirs.in_error()];
        if step.byte != expected || in_error[0] != in_error[1] {
            differ(number, wire, [step.byte, expected], in_error);
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

/// What the two models of [`detector_watched`] say otherwise. Apart from the loop, which would else keep all of this where a message can be
/// made of it.
#[cold]
fn differ(number: usize, wire: &[u8], sent: [Option<u8>; 2], in_error: [bool; 2]) {
    assert_eq!(sent[0], sent[1], "byte {number} of {wire:02X?}");
    assert_eq!(in_error[0], in_error[1], "byte {number} of {wire:02X?}");
}

/// A ring of three against the reference model. The first byte of the input is the link that is damaged (0
/// to 3) and how (its high half), the second the number of the damaged byte, 0 for none.
///
/// # Panics
/// A byte on any link is otherwise than in the reference model, or a drive's memory or error mode.
pub fn ring(data: &[u8]) {
    let _transitions: Reached = ring_watched(data);
}

/// The same, with the transitions that the three drives went through.
///
/// # Panics
/// As [`ring`], or a transition is called unreachable.
#[must_use]
pub fn ring_watched<N: Notes>(data: &[u8]) -> N {
    let mut reached = N::default();
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
    let mut ours = Ring::new(size, Rate::Baud38400, |_| Watched::<N>::default());
    // Marks are of no use here.
    ours.stop_recording();
    (0..4).for_each(|link| ours.record_link(link));
    // A byte is inserted or doubled at most.
    ours.reserve(wire.len() + 1);
    let mut theirs = [(); 3].map(|()| reference::Drive::new());
    let (link, fault, other) = ring_fault(*what);
    let fault_of_theirs = [(link, usize::from(*place), other)];
    let mut faults = &fault_of_theirs[..0];
    if *place > 0 && usize::from(*place) <= wire.len() {
        ours.arm_link(link, u64::from(*place), fault);
        faults = &fault_of_theirs;
    }
    ours.send(Instant::START, wire);
    // The way round the ring takes a byte time a link.
    let conversation = ours.byte_time() * (wire.len() as u64 + 8);
    ours.run_until(Instant::START + conversation);
    let drives = || (0..3).rev().filter_map(|k| ours.drive(k));
    drives().for_each(|drive| reached.join(drive.reached()));
    reached.assert_possible();
    // Time-outs are no part of the reference model, be they switched off again since by a reset.
    if drives().any(|drive| drive.timed_out() || drive.drive().memory().peek(0xFF57) & 4 != 0) {
        return reached;
    }
    assert!(!ours.busy(), "a byte is still under way, sent {wire:02X?}");
    let expected = reference::run(&mut theirs, wire, faults);
    assert_eq!(expected.len(), 4, "a link behind the master and each drive");
    for (index, expected) in expected.iter().enumerate() {
        let arrived = ours.carried_by(index).iter().filter_map(LineByte::arrival);
        let received = arrived.map(|byte| reference::Cell {
            byte: byte.byte,
            error: byte.error.is_some(),
        });
        if !received.clone().eq(expected.iter().copied()) {
            let received: Vec<_> = received.collect();
            assert_eq!(received, *expected, "link {index}, sent {wire:02X?}");
        }
    }
    for (ours, theirs) in drives().zip(&theirs) {
        assert_eq!(ours.in_error(), theirs.in_error(), "sent {wire:02X?}");
        same_memory(ours.drive(), theirs);
    }
    reached
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
