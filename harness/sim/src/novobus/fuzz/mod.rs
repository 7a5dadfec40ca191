//! The bodies of the fuzz targets: each takes any bytes and panics where a rule of the manual is broken.
//!
//! Inputs are bytes as they go over the wire, so that a corpus can be read, and played on hardware. Other data that
//! a case needs precede them; each target describes its own. `corpora/fuzz/<target>/` holds the kept
//! inputs; plain `cargo test` plays all of them.

mod bus_end;
mod codec;
mod detector;
mod drive;
mod drive_words;
mod features;
mod guard;
mod guard_words;
mod hostile;
pub mod jobs;
mod links;
mod repair;
mod ring;
mod words;

pub use bus_end::{bus_end, bus_end_watched};
pub use codec::codec_stream;
pub use detector::{Detector, detector, detector_watched};
pub use drive::drive;
pub use features::{NOTING, of_cell};
pub use guard::guard;
pub use hostile::master;
pub use jobs::jobs;
pub use links::links;
pub use repair::repair;
pub use ring::{ThreeDrives, ring, ring_watched};

use crate::fuzz::FuzzTarget;
use crate::novobus::plain::PlainDrive;
use crate::novobus::reference;
use crate::novobus::transitions::Reached;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::telegram::Telegram;

/// A target that feeds drives raw bytes, and tells which transitions they went through.
pub type Watching = (&'static str, fn(&[u8]) -> Reached);

/// The targets that feed drives raw bytes.
pub const WATCHING: [Watching; 3] = [
    ("bus_end", bus_end_watched),
    ("detector", detector_watched),
    ("ring", ring_watched),
];

/// Every target whose body is here.
pub const TARGETS: [FuzzTarget; 9] = [
    ("bus_end", bus_end),
    ("codec", codec_stream),
    ("detector", detector),
    ("links", links),
    ("ring", ring),
    ("drive", drive),
    ("master", master),
    ("jobs", jobs),
    ("guard", guard),
];

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
        // A value decoded from a beginning of the input stays the same with any bytes behind it.
        if let Decoded::Value { value, used } = Command::decode(&data[..length]) {
            let whole = Command::decode(data);
            assert_eq!(whole, Decoded::Value { value, used });
        }
    }
}

/// The memories are the same but for the error code (FD82, FD83), of which the reference model knows one only.
fn same_memory(ours: &PlainDrive, theirs: &reference::Drive) {
    let ours = ours.memory().ram_and_registers();
    let theirs = theirs.ram_and_registers();
    // Not with a comparison of slices: libFuzzer traces these, and the contents of equal memories are useless to it.
    let differing =
        |from: &[u8], to: &[u8]| from.iter().zip(to).fold(0, |all, (a, b)| all | (a ^ b));
    if differing(&ours[..2], &theirs[..2]) | differing(&ours[4..], &theirs[4..]) == 0 {
        return;
    }
    for (address, (ours, theirs)) in (0xFD80_u16..).zip(ours.iter().zip(theirs)) {
        if ![0xFD82, 0xFD83].contains(&address) {
            assert_eq!(ours, theirs, "cell {address:04X}");
        }
    }
}
