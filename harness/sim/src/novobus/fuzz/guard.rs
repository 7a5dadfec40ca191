//! An attack on the guard: no input makes it let a command pass that the limits deny, as judged by drives of the reference
//! model, which shares no code with it.

use super::guard_words::{self as words, RingByte};
use crate::fuzz::LONGEST;
use crate::fuzz::Notebook;
use crate::novobus::reference::{Cell, Drive};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::{Guard, Limits};
use harness_proto::time::{Instant, Span};

/// Five bytes, a start, and the wire. Byte 1: bits 0 to 3 allow motion, EEPROM, reset, outputs, bit 4 sets a greatest speed of 1000 rpm, bits 5 and 6
/// are the number of drives less 1, bit 7: a port sends what should be damaged as a good byte. Byte 2: the number of the byte that is sent
/// damaged, 0 for none. Byte 3: the number of the byte before which there is silence, 0 for none; byte 4: the drive whose time
/// is up by it (bits 0 to 2), and how many zeros it sends unasked (high half), or, with bit 3, for how many milliseconds longer it passes
/// nothing on, as the manual leaves that open. Byte 5: how many bytes the start has: what the first drive heard before, the second
/// one without the first byte of it, and so on, so that no two drives are at the same place. A
/// ring of one keeps a half command from its start; the others have forgotten it.
///
/// After a denial the guard is reset, and the next bytes are tried.
///
/// # Panics
/// A drive executes what the limits deny.
pub fn guard(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the guard took the bytes for and made of them is noted.
///
/// # Panics
/// As [`guard`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let &[what, damaged, silent, whose, start, ref rest @ ..] = data else {
        return;
    };
    let limits = Limits {
        motion: what & 1 != 0,
        eeprom: what & 2 != 0,
        reset: what & 4 != 0,
        outputs: what & 8 != 0,
        max_speed: (what & 16 != 0).then_some(1_000),
        ..Limits::default()
    };
    let drives = usize::from(what >> 5 & 3) + 1;
    let Ok(size) = RingSize::new(drives as u64) else {
        return;
    };
    let (start, wire) = rest.split_at(usize::from(start).min(rest.len()));
    let place = |index| Place {
        drive: started(start, index, drives == 1),
        silent_until: Instant::START,
    };
    let mut ring: Vec<_> = (0..drives).map(place).collect();
    let mut guard = Guard::new(size, limits);
    if silent > 0 {
        guard.expect_time_outs();
    }
    for place in 0..drives as u8 {
        if let Ok(address) = size.address_byte(place) {
            guard.learn_data_in(address, NSOLL);
        }
    }
    let mut passed = Vec::new();
    let mut now = Instant::START;
    for (index, &byte) in wire.iter().take(LONGEST).enumerate() {
        now += Span::from_micros(287);
        if index + 1 == usize::from(silent) {
            now += TIME_OUT;
            silence(&mut ring, usize::from(whose & 7), whose, now);
        }
        let bad = index + 1 == usize::from(damaged);
        let heard = RingByte {
            stage: guard.stage(),
            byte,
            bad,
        };
        let admitted = guard.admit(now, byte, bad);
        words::note(notes, &heard, admitted, &guard);
        if admitted.is_err() {
            guard.reset_after_denial();
            continue;
        }
        passed.push(byte);
        send(
            &mut ring,
            now,
            Cell {
                byte,
                error: bad && what < 0x80,
            },
        );
        for (place, Place { drive, .. }) in ring.iter_mut().enumerate() {
            if drive.in_error() {
                words::note_error_mode(notes, &heard);
            }
            for command in drive.take_executed() {
                words::note_executed(notes, &command);
                let why = denied(&command, &limits);
                assert!(
                    why.is_none(),
                    "{why:?}: {command:02X?} reached the drive at place {place} with {limits:?}; passed: {passed:02X?}"
                );
            }
        }
    }
}

/// How long silence lasts, from the last byte on: a time-out (9.9).
const TIME_OUT: Span = Span::from_millis(10);

/// A drive in the ring.
struct Place {
    drive: Drive,
    /// Until when it passes nothing on.
    silent_until: Instant,
}

/// What `DataIn` holds: `nsoll` (14.10.3).
const NSOLL: u8 = 0x08;

/// A drive that has heard something. Process data that it awaits have come: whatever byte is sent next would end them
/// (ND21 9.4), be it the first zero of the recovery, so no guard can keep them back.
fn started(start: &[u8], index: usize, keep_half: bool) -> Drive {
    let mut drive = Drive::new();
    // 14.10.3: nominal speed in, actual speed out.
    drive.poke(0xFF32, NSOLL);
    drive.poke(0xFF34, 0x0C);
    for &byte in start.iter().skip(index) {
        drive.receive(Cell { byte, error: false });
    }
    drive.take_executed();
    drive.poke(0xFF32, NSOLL);
    drive.forget_process_data();
    if !keep_half {
        drive.forget_half();
    }
    drive
}

/// Sends a byte to the first of these drives, and what it makes of it to those behind.
fn send(ring: &mut [Place], now: Instant, mut cell: Cell) {
    for Place {
        drive,
        silent_until,
    } in ring
    {
        match drive.receive(cell) {
            Some(byte) if now >= *silent_until => cell = Cell { byte, error: false },
            _ => return,
        }
    }
}

/// The time of a drive is up (ND21 9.9). It sends zeros unasked, or it waits.
fn silence(ring: &mut [Place], whose: usize, what: u8, now: Instant) {
    let Some((place, behind)) = ring.get_mut(whose..).and_then(<[_]>::split_first_mut) else {
        return;
    };
    place.drive.time_out();
    if what & 8 != 0 {
        place.silent_until = now + Span::from_millis(u64::from(what >> 4));
        return;
    }
    for _ in 0..what >> 4 {
        let (byte, error) = (0, false);
        send(behind, now, Cell { byte, error });
    }
}

/// Why the limits deny a command; typed from the manual once more.
fn denied(command: &[u8], limits: &Limits) -> Option<&'static str> {
    let everything = limits.allow_everything();
    let unless = |allowed: bool, why| (!allowed && !everything).then_some(why);
    match *command {
        [0xC0 | 0xC1 | 0xC7, ..] => None,
        [0xC8, _] => unless(limits.outputs, "output"),
        [0xDD, _] => unless(limits.reset, "reset"),
        // To `nsoll`, where they are written from the begin on.
        [0, high, low] => unless(limits.motion, "motion").or_else(|| fast(high, low, limits)),
        // 14.10: block, stop, both; nominal speed 0.
        [0xA5, mask, 0x00] if mask & 0x7E == 0 => None,
        [0x82, 0x81, 0x00, 0xFF] | [0x63, 0, 0, 0x08, 0xFF] => None,
        // 14.10.2.
        [0xA5, 0x04, 0x57] => unless(limits.monitoring, "monitoring"),
        [0xA5, 0x00, 0x57] | [0xA4, 0xFF, 0x00] => None,
        [0x82, data, low, high] => {
            cell(low, high, data, true, limits).or_else(|| half_of_a_speed(&[[high, low]], limits))
        }
        [0xA5, data, low] => {
            cell(low, 0xFF, data, false, limits).or_else(|| half_of_a_speed(&[[0xFF, low]], limits))
        }
        [0xA4, _, low] => {
            cell(low, 0xFF, 0, false, limits).or_else(|| half_of_a_speed(&[[0xFF, low]], limits))
        }
        [0x63, lower, upper, low, high] => {
            let next = u16::from_be_bytes([high, low])
                .wrapping_add(1)
                .to_be_bytes();
            cell(low, high, upper, true, limits)
                .or_else(|| cell(next[1], next[0], lower, true, limits))
                .or_else(|| match [high, low] {
                    speed if SPEEDS.contains(&speed) => fast(upper, lower, limits),
                    first => half_of_a_speed(&[first, next], limits),
                })
        }
        _ => unless(false, "unknown"),
    }
}

/// The words that are speeds (14.2.1).
const SPEEDS: [[u8; 2]; 7] = [
    [0xFF, 0x08],
    [0xFF, 0x4C],
    [0xFF, 0x50],
    [0xFF, 0x68],
    [0xFD, 0x8C],
    [0xFD, 0x8E],
    [0xFD, 0x94],
];

/// Cells that are no speeds, through which a motor could turn faster: inputs, their scale, the resolver, the mode, regulators,
/// positions (14.7.2, 14.7.3, 14.6.6, 14.3, 14.6, 14.5.5).
const FASTER: [u16; 23] = [
    0xFD80, 0xFD98, 0xFD99, 0xFD9C, 0xFF01, 0xFF02, 0xFF0A, 0xFF0C, 0xFF0D, 0xFF12, 0xFF14, 0xFF16,
    0xFF18, 0xFF22, 0xFF60, 0xFF61, 0xFF62, 0xFF63, 0xFF70, 0xFF74, 0xFF78, 0xFF79, 0xFF7F,
];

fn half_of_a_speed(touched: &[[u8; 2]], limits: &Limits) -> Option<&'static str> {
    let is_half = |[high, low]: &[u8; 2]| SPEEDS.contains(&[*high, low & 0xFE]);
    (limits.max_speed.is_some() && touched.iter().any(is_half)).then_some("half of a speed")
}

/// 14.5.3.1: 0.5298 rpm a bit at most.
fn fast(high: u8, low: u8, limits: &Limits) -> Option<&'static str> {
    let raw = f64::from(i16::from_be_bytes([high, low]));
    let most = f64::from(limits.max_speed?);
    (raw.abs() * 0.529_819 > most + 0.01).then_some("too fast")
}

/// A byte of a cell; `whole`: written, not masked.
fn cell(low: u8, high: u8, data: u8, whole: bool, limits: &Limits) -> Option<&'static str> {
    let unless = |allowed: bool, why| (!allowed).then_some(why);
    if limits.allow_everything() {
        return None;
    }
    if limits.max_speed.is_some() && FASTER.contains(&u16::from_be_bytes([high, low])) {
        return Some("a motor may turn faster");
    }
    match (high, low) {
        (0xFD, 0x88 | 0x89) => None,
        (0xFD, 0x8A) => match data {
            0x81 | 0x10 if whole => None,
            0x82 | 0x84 if whole => unless(limits.eeprom, "EEPROM"),
            _ => Some("EEPROM controller"),
        },
        (0xFF, 0x38..=0x3C | 0x3E..=0x41) => None,
        (0xFF, 0x34) if whole && data < 0x80 => None,
        // 14.10.2.
        (0xFF, 0x57) if data & 0x04 != 0 && !limits.monitoring && (whole || data != 0) => {
            Some("monitoring")
        }
        // 13.1.1, 13.2.2: a run at speeds of which nothing is known.
        (0xFF, 0x57) if limits.max_speed.is_some() && data & 0xE8 != 0 => Some("a run"),
        (0xFF, 0x43) if limits.max_speed.is_some() && data & 0x7E != 0 => Some("a positioning"),
        // 14.4.3: teach-in.
        (0xFF, 0x57) if data & 0x10 != 0 => {
            unless(limits.eeprom && limits.motion, "EEPROM by teach-in")
        }
        (0xFF, 0x32) if whole && data == 8 => unless(limits.motion, "process data"),
        // 14.10.3: process data write any word there from now on.
        (0xFF, 0x32) if whole && data != 0x31 && data != 0x32 => {
            let any = |low| (0..=0xFF).find_map(|byte| cell(low, 0xFF, byte, true, limits));
            let denied = unless(limits.motion, "process data");
            denied.or(any(data)).or(any(data.wrapping_add(1)))
        }
        // The drive's own bus: commands, address, pointers, buffers.
        (0xFF, 0x2A..=0x36) => Some("the bus itself"),
        (0xFE, 0xA0..) => Some("stack"),
        (0xFF, 0x60 | 0x61 | 0x7B) => {
            unless(limits.outputs && limits.motion, "meaning of an output")
        }
        (0xFF, 0x7C | 0x7D) => unless(limits.outputs, "analogue output"),
        (0xFF, 0x80..) => Some("register"),
        _ => unless(limits.motion, "motion"),
    }
}
