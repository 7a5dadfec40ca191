//! Acts that only together show what a drive does: chance alone seldom puts them in a row.

use super::act::{FrameAct, FrameActKind};
use super::generate::FrameSpice;
use harness_bench::explore::Dice;
use harness_proto::unitek::words::MODE_EVENT;
use harness_proto::unitek::{Data, Request};

/// Microseconds after an act within an idiom: enough for a reply.
const SHORT: u64 = 1_200;

/// Writes `raw` with 16 bits.
const fn short(register: u8, raw: u16) -> Request {
    Request::Write {
        register,
        data: Data::Short(raw),
    }
}

/// Writes `raw` with 32 bits.
const fn long(register: u8, raw: u32) -> Request {
    Request::Write {
        register,
        data: Data::Long(raw),
    }
}

const fn read(register: u8) -> Request {
    Request::Read { register }
}

/// An idiom of a spice with a drive, as requests and the milliseconds after each; none for most spices.
fn requests(spice: FrameSpice, dice: &mut Dice) -> Vec<(Request, u64)> {
    let level = dice.below(2) as u16;
    let (one, other) = (dice.word(), dice.word());
    match spice {
        // Stored, changed, brought back (ex 7).
        FrameSpice::Eeprom => vec![
            (short(0x34, one), 0),
            (short(0x84, level), 1),
            (short(0x34, other), 0),
            (short(0x83, dice.below(2) as u16), 1),
            (read(0x34), 0),
        ],
        // 16 bits to a signed register of 32, whose upper half is known (App 1).
        FrameSpice::Write => vec![
            (long(0xD3, 0x1122_3344), 0),
            (short(0xD3, one | 0x8000), 0),
            (read(0xD3), 0),
        ],
        // A negative value with all replies wide (App 3); a time-out that is cleared (D0); another 100 % (C8).
        FrameSpice::Settings => match dice.below(3) {
            0 => vec![
                (short(0x3E, one | 0x8000), 0),
                (short(0xDC, 0x0130), 0),
                (read(0x3E), 0),
                (short(0xDC, 0x0030), 0),
            ],
            1 => vec![
                (short(0xD0, 5), 12),
                (short(0xD0, 0), 0),
                (read(0x8F), 0),
                (short(0x8E, 0x4D44), 0),
                (read(0x8F), 0),
            ],
            _ => vec![(short(0xC8, one), 0), (read(0xCE), 0)],
        },
        // Longer than homing lasts by default (ex 12).
        FrameSpice::Homing => vec![
            (short(0x51, 0), 0),
            (short(0x78, 1), 520),
            (read(0x40), 0),
            (read(0x6E), 0),
        ],
        // Every bit of STATUS is sent (ex 10).
        FrameSpice::Mode => vec![(short(0x52, 0xFFFF), 0), (short(0x51, MODE_EVENT), 0)],
        _ => Vec::new(),
    }
}

/// The acts of an idiom for the drive that receives on `rx`; none where the spice has no idiom.
pub(super) fn idiom(spice: FrameSpice, rx: u16, dice: &mut Dice) -> Vec<FrameAct> {
    let all = requests(spice, dice).into_iter();
    let act = |(request, millis): (Request, u64)| {
        let frame = request.encode(rx).ok()?;
        Some(FrameAct::new(
            FrameActKind::Send(frame),
            SHORT + 1_000 * millis,
        ))
    };
    all.filter_map(act).collect()
}
