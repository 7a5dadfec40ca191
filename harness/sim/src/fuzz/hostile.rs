//! The master on a ring that answers as it likes.

use super::LONGEST;
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Event, Job, Master, Options};
use harness_proto::time::Instant;

/// The first byte is the size of the ring; of the others each is one byte time: FE and FF are silence, FD a
/// byte with wrong parity, FC a job, FB the byte that was sent a ring's length ago, anything else comes as it
/// is.
///
/// # Panics
/// A job ends twice or not at all, or the master holds more than it may.
pub fn master(data: &[u8]) {
    let Some((&drives, data)) = data.split_first() else {
        return;
    };
    let Ok(size) = RingSize::new(u64::from(drives % 8) + 1) else {
        return;
    };
    let rate = Rate::Baud38400;
    let mut master = Master::new(size, rate, Options::default());
    let mut sent = Vec::new();
    let mut open = Vec::new();
    let mut now = Instant::START;
    let steps = data.iter().take(LONGEST).copied();
    // Silence behind the input lets everything come to its end.
    for byte in steps.chain(std::iter::repeat_n(0xFF, 40_000)) {
        match byte {
            0xFC => {
                let command = Command::WriteByte {
                    address: 0xFE13,
                    data: 1,
                };
                open.extend(master.submit(Job::new(0, command)));
            }
            0xFB => {
                let back = sent.len().checked_sub(usize::from(size.drives()) + 1);
                if let Some(byte) = back.and_then(|place| sent.get(place)) {
                    master.handle_byte(now, Received::good(*byte));
                }
            }
            0xFD => master.handle_byte(now, Received::bad(0xFD, LineError::Parity)),
            0xFE | 0xFF => {}
            byte => master.handle_byte(now, Received::good(byte)),
        }
        if master.poll_timeout().is_some_and(|due| due <= now) {
            master.handle_timeout(now);
        }
        while let Some(event) = master.poll_event() {
            if let Event::Ended { id, .. } = event {
                let place = open.iter().position(|open| *open == id);
                assert!(place.is_some(), "a job ended that was not open");
                open.retain(|open| *open != id);
            }
        }
        sent.extend(master.poll_transmit(now));
        assert!(
            master.under_way() <= 1_024,
            "{} under way",
            master.under_way()
        );
        now += rate.byte_time();
        if open.is_empty() && byte == 0xFF && master.jobs() == 0 {
            break;
        }
    }
    assert!(open.is_empty(), "{} jobs never ended", open.len());
}
