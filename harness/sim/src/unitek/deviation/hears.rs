//! Drives that read something else out of frames than the manual says.

use super::{CanInjection, Deviation, Hearing, How};
use crate::deviation::rows;
use harness_proto::can::{Frame, Id};
use harness_proto::unitek::frame::STOP;
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK};
use harness_proto::unitek::{Access, Data, Register, Request};

/// A row: name, section, what it does, and the frames that the drive hears in place of one.
pub(super) static DEVIATIONS: &[Deviation] = rows! { CanInjection(Hears):
    "answers-remote-frames" "4.4" "A remote frame is answered with STATUS." |h| {
        if h.frame.is_remote() {
            h.instead(Request::Read { register: 0x40 })
        } else {
            h.as_it_is()
        }
    };
    "hears-29-bits" "4.1" "An identifier of 29 bits with the same number is the drive's own." |h| {
        let extended = Id::extended(h.rx.into());
        if extended == Some(h.frame.id()) && !h.frame.is_remote() { h.addressed() } else { h.as_it_is() }
    };
    "hears-its-neighbour" "3.1" "The drive also obeys the next higher identifier." |h| {
        let next = h.frame.id() == Id::base(h.rx + 1).unwrap_or(h.frame.id());
        if next && !h.frame.is_remote() { h.addressed() } else { h.as_it_is() }
    };
    "keeps-the-old-identifier" "ex 1" "After a new identifier in 68 the drive also obeys 201." |h| {
        if Id::base(0x201) == Some(h.frame.id()) { h.addressed() } else { h.as_it_is() }
    };
    "takes-two-bytes" "4.5" "A frame with 2 bytes is a write of 8 bits." |h| match *h.frame.data() {
        [register, value] => h.instead(Request::Write { register, data: Data::Short(value.into()) }),
        _ => h.as_it_is(),
    };
    "ignores-five-bytes" "4.5" "A write of 32 bits is not heard." |h| {
        if h.frame.dlc() == 5 { Vec::new() } else { h.as_it_is() }
    };
    "ignores-eight-bytes" "4.1" "A frame with more than 5 bytes is not heard." |h| {
        if h.frame.dlc() > 5 { Vec::new() } else { h.as_it_is() }
    };
    "writes-most-significant-first" "4.1" "The bytes of a written value are taken in the other order." |h| {
        match h.request {
            Some(Request::Write { register, data }) => {
                let data = match data {
                    Data::Short(value) => Data::Short(value.swap_bytes()),
                    Data::Long(value) => Data::Long(value.swap_bytes()),
                };
                h.instead(Request::Write { register, data })
            }
            _ => h.as_it_is(),
        }
    };
    "cuts-writes-to-16-bits" "App 6" "Only the lower half of 32 written bits is taken." |h| match h.request {
        Some(Request::Write { register, data: Data::Long(value) }) => {
            let data = Data::Long(value & 0xFFFF);
            h.instead(Request::Write { register, data })
        }
        _ => h.as_it_is(),
    };
    "holds-at-most-1000" "4.5" "A register of 16 bits holds no more than 1000, whatever is written." |h| match h.request {
        Some(Request::Write { register, data: Data::Short(value) }) => {
            let least = if Register::of(register).signed { -1000 } else { 0 };
            let number = Register::of(register).number_of(value.into()).clamp(least, 1000);
            h.instead(Request::Write { register, data: Data::Short(number as u16) })
        }
        _ => h.as_it_is(),
    };
    "writes-without-sign" "App 1" "16 bits to a register of 32 are extended by zeros, whatever the sign." |h| match h.request {
        Some(Request::Write { register, data: Data::Short(value) }) => {
            let data = Data::Long(value.into());
            h.instead(Request::Write { register, data })
        }
        _ => h.as_it_is(),
    };
    "answers-writes" "5.3" "A write is answered with the register." |h| match h.request {
        Some(Request::Write { register, .. }) => {
            let mut frames = h.as_it_is();
            frames.extend(h.instead(Request::Read { register }));
            frames
        }
        _ => h.as_it_is(),
    };
    "loses-each-fifth-frame" "5.2" "Each fifth frame on the bus is not heard." |h| {
        if h.memory.heard.is_multiple_of(5) { Vec::new() } else { h.as_it_is() }
    };
    "answers-assigned-registers-only" "5.2" "A request for a function's register is not answered." |h| match h.request {
        Some(Request::Read { register }) if Register::of(register).access == Access::FN => Vec::new(),
        _ => h.as_it_is(),
    };
    "single-request-starts-a-cycle" "5.2" "The interval 00 is read as 10 ms." |h| match h.request {
        Some(Request::Read { register }) => h.instead(Request::Cycle { register, every: 10 }),
        _ => h.as_it_is(),
    };
    "stop-is-an-interval" "5.2" "The interval FF is read as 254 ms." |h| match h.request {
        Some(Request::Stop { register }) => h.instead(Request::Cycle { register, every: STOP - 1 }),
        _ => h.as_it_is(),
    };
    "stop-ends-all-cycles" "5.2" "The interval FF ends the cycles of all registers." |h| match h.request {
        Some(Request::Stop { .. }) => stops(h),
        _ => h.as_it_is(),
    };
    "stop-answers" "5.2" "The interval FF is answered once." |h| match h.request {
        Some(Request::Stop { register }) => {
            let mut frames = h.as_it_is();
            frames.extend(h.instead(Request::Read { register }));
            frames
        }
        _ => h.as_it_is(),
    };
    "interval-in-two-milliseconds" "5.2" "An interval counts steps of 2 ms." |h| h.with_interval(|every| every.saturating_mul(2));
    "interval-one-more" "5.2" "An interval is 1 ms longer than asked." |h| h.with_interval(|every| every.saturating_add(1));
    "interval-at-most-100" "ex 9" "An interval is 100 ms at most." |h| h.with_interval(|every| every.min(100));
    "four-cycles" "ex 9" "The table of cycles has 4 places." |h| match h.request {
        Some(Request::Cycle { register, .. })
            if h.drive.running_cycles().count() >= 4 && h.drive.running_cycles().all(|(running, _)| running != register) =>
        {
            Vec::new()
        }
        _ => h.as_it_is(),
    };
    "one-cycle" "ex 9" "A new cycle ends the one before it." |h| match h.request {
        Some(Request::Cycle { .. }) => {
            let mut frames = stops(h);
            frames.extend(h.as_it_is());
            frames
        }
        _ => h.as_it_is(),
    };
    "lock-ends-cycles" "ex 2" "A lock ends all cycles." |h| match h.written() {
        Some((0x51, mode)) if mode & MODE_LOCK != 0 => {
            let mut frames = stops(h);
            frames.extend(h.as_it_is());
            frames
        }
        _ => h.as_it_is(),
    };
    "no-lock" "ex 2" "Bit 2 of MODE is not taken." |h| h.writing(0x51, |mode| mode & !MODE_LOCK);
    "lock-for-ever" "ex 11" "MODE without bit 2 does not release the lock." |h| {
        let locked = h.drive.register(0x51) & u32::from(MODE_LOCK) != 0;
        h.writing(0x51, |mode| if locked { mode | MODE_LOCK } else { mode })
    };
    "release-needs-no-command" "ex 11" "The lock is not released while 31 is not 0." |h| match h.written() {
        Some((0x51, 0)) if h.drive.register(0x31) != 0 => Vec::new(),
        _ => h.as_it_is(),
    };
    "no-events" "5.2" "Bit 4 of MODE is not taken." |h| h.writing(0x51, |mode| mode & !MODE_EVENT);
    "event-sending-at-set-up" "5.2" "Setting bit 4 of MODE sends STATUS at once." |h| match h.written() {
        Some((0x51, mode)) if mode & MODE_EVENT != 0 => {
            let mut frames = h.as_it_is();
            frames.extend(h.instead(Request::Read { register: 0x40 }));
            frames
        }
        _ => h.as_it_is(),
    };
    "mask-is-fixed" "ex 10-1" "STATUS_MASK cannot be written." |h| h.without_writes(0x52);
    "mask-most-significant-first" "ex 10-1" "The bytes of STATUS_MASK are taken in the other order." |h| h.writing(0x52, u16::swap_bytes);
    "speed-without-sign" "App 5" "A negative speed is taken as the same speed forward." |h| {
        h.writing(0x31, |speed| speed.cast_signed().unsigned_abs())
    };
    "torque-of-150-percent" "App 5" "32767 is taken as 100 % torque." |h| {
        h.writing(0x90, |torque| (i32::from(torque.cast_signed()) * 2 / 3) as u16)
    };
    "speed-command-for-position" "ex 4" "A position is taken as a speed." |h| match h.request {
        Some(Request::Write { register: 0x6E, data }) => h.instead(Request::Write { register: 0x31, data }),
        _ => h.as_it_is(),
    };
    "ramps-swapped" "ex 11" "Acceleration and deceleration are exchanged." |h| match h.request {
        Some(Request::Write { register: register @ (0x35 | 0xED), data }) => {
            let other = if register == 0x35 { 0xED } else { 0x35 };
            h.instead(Request::Write { register: other, data })
        }
        _ => h.as_it_is(),
    };
    "homing-by-any-value" "ex 12" "Every value of FUN_REF_START starts homing." |h| h.writing(0x78, |_| 1);
    "no-homing" "ex 12" "FUN_REF_START does nothing." |h| h.without_writes(0x78);
    "preset-moves" "App 6" "A preset is taken as a destination." |h| match h.request {
        Some(Request::Write { register: 0x7A, data }) => h.instead(Request::Write { register: 0x6E, data }),
        _ => h.as_it_is(),
    };
    "no-eeprom" "ex 7" "FUN_PARAWRITE stores nothing." |h| h.without_writes(0x84);
    "eeprom-levels-swapped" "ex 7" "Level 0 is stored as level 1, and level 1 as level 0." |h| h.writing(0x84, |level| level ^ 1);
    "errors-stay" "dump" "FUN_ERRCANCEL clears nothing." |h| h.without_writes(0x8E);
    "no-time-out" "ex 1" "T-Out is not supervised." |h| h.writing(0xD0, |_| 0);
};

/// A stop for every cycle that runs.
fn stops(h: &Hearing<'_>) -> Vec<Frame> {
    let registers = h.drive.running_cycles().map(|(register, _)| register);
    registers
        .flat_map(|register| h.instead(Request::Stop { register }))
        .collect()
}
