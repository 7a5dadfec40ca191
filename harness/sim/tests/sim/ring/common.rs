//! What the tests of the ring share.

use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::novobus::telegram::{Address, Telegram};
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

/// A ring of plain drives at 38400 bit/s.
pub(crate) fn ring(drives: u8) -> Ring<PlainDrive> {
    let size = RingSize::new(u64::from(drives)).expect("1 to 250");
    Ring::new(size, Rate::Baud38400, |_| PlainDrive::default())
}

/// Sends bytes, lets them come round, and returns what the master received for them.
pub(crate) fn exchange(ring: &mut Ring<PlainDrive>, bytes: &[u8]) -> Vec<Received> {
    let now = ring.now();
    ring.send(now, bytes);
    while ring.busy() {
        let next = ring.next_event().expect("something is under way");
        ring.run_until(next);
    }
    std::iter::from_fn(|| ring.receive())
        .filter_map(|byte| byte.arrival())
        .collect()
}

/// Whether no drive is in the error mode.
pub(crate) fn healthy(ring: &Ring<PlainDrive>) -> bool {
    (0..ring.size().drives()).all(|k| ring.drive(k).is_some_and(|drive| !drive.in_error()))
}

/// A stream with all seven legal forms of a telegram, SYNCO, a command cut over two telegrams and two
/// commands in one.
pub(crate) fn mixed_stream(size: RingSize) -> Vec<u8> {
    let read = Command::ReadByte { address: 0xFE13 }.encode();
    let write = Command::WriteWord {
        address: 0xFF08,
        data: 0x1234,
    }
    .encode();
    let reset_output = Command::decode(&[0xC8, 0x02, 0xCA])
        .value()
        .expect("WriteIO, clear GPO2")
        .encode();
    let mut bytes = vec![SYNCO];
    let mut push = |address, process_data, parameters: &[u8]| {
        let telegram = Telegram::new(address, process_data, parameters).expect("a legal telegram");
        bytes.extend(telegram.encode());
    };
    let last = Address::Byte(size.address_byte(size.first()).expect("a drive"));
    let first = Address::Byte(size.address_byte(0).expect("a drive"));
    push(first, None, &read);
    push(Address::NextDrive, None, &write);
    push(last, Some(0x55AA), &[]);
    push(Address::SameDrive, Some(0x0102), &reset_output);
    push(Address::SameDrive, None, &read[..2]);
    push(Address::SameDrive, Some(0x0304), &read[2..]);
    push(first, Some(0x0506), &reset_output);
    push(
        Address::SameDrive,
        None,
        &[reset_output.clone(), reset_output.clone()].concat(),
    );
    push(Address::NextDrive, Some(0), &[]);
    push(Address::NextDrive, None, &[]);
    bytes.push(SYNCO);
    bytes
}

/// The address that the ring spells out, with the zeros in front of it: what the master received last,
/// for as long as it looked.
pub(crate) fn spelled_out(received: &[Received]) -> Option<(u8, usize)> {
    let last = received.last()?;
    let tail = received.iter().rev().take_while(|b| *b == last).count();
    if tail < 8 || last.error.is_some() {
        return None;
    }
    let before = &received[..received.len() - tail];
    let zeros = before.iter().rev().take_while(|b| b.is(0)).count();
    Some((last.byte, zeros))
}

/// The seed of every random test: `DRIVEBENCH_SEED`, or always the same.
pub(crate) fn seed() -> u64 {
    std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(38_400)
}

/// The command that repeats a random failure.
pub(crate) fn repeat(test: &str) -> String {
    format!(
        "repeat with: DRIVEBENCH_SEED={} cargo test -p harness-sim-tests --test sim {test}",
        seed()
    )
}

/// A small generator of numbers (splitmix64): the same seed gives the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number below `limit`; `limit` is small, so that the bias does not matter.
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % limit.max(1)
    }
}
