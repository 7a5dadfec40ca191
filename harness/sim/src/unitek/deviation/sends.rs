//! Drives that send something else than the manual says.

use super::{CanInjection, Deviation, How};
use crate::deviation::rows;
use crate::unitek::Cause;
use harness_proto::can::Frame;
use harness_proto::unitek::frame::{DEFAULT_RX, READ};
use harness_proto::unitek::words::status;
use harness_proto::unitek::{Data, Reply};

/// A row: name, section, what it does, and the frames that the drive sends in place of one.
pub(super) static DEVIATIONS: &[Deviation] = rows! { CanInjection(Sends):
    "no-stuff-byte" "4.5" "A reply ends with its data: 3 or 5 bytes." |s| s.bytes(|bytes| bytes[..bytes.len() - 1].to_vec());
    "eight-bytes" "4.5" "A reply always has 8 bytes." |s| s.bytes(|bytes| {
        let mut bytes = bytes.to_vec();
        bytes.resize(8, 0);
        bytes
    });
    "always-six-bytes" "App 2" "A reply always has 6 bytes." |s| {
        s.instead(Reply { data: Data::Long(s.reply.data.bits()), ..s.reply })
    };
    "always-four-bytes" "App 2" "A reply always has 4 bytes." |s| {
        s.instead(Reply { data: Data::Short((s.reply.data.bits() & 0xFFFF) as u16), ..s.reply })
    };
    "replies-most-significant-first" "4.1" "The bytes of a reply stand in the other order." |s| s.contents(|bits| match s.reply.data {
        Data::Short(value) => value.swap_bytes().into(),
        Data::Long(_) => bits.swap_bytes(),
    });
    "replies-to-201" "5.4" "A reply has the identifier to which the drive listens." |s| {
        Frame::base(DEFAULT_RX, s.waiting.frame.data()).into_iter().collect()
    };
    "names-read" "5.2" "Byte 0 of a reply is 3D." |s| s.instead(Reply { register: READ, ..s.reply });
    "names-the-next-register" "5.2" "Byte 0 of a reply is the number of the next register." |s| {
        s.instead(Reply { register: s.reply.register.wrapping_add(1), ..s.reply })
    };
    "answers-twice" "5.2" "Each reply to a single request is sent twice." |s| match s.waiting.cause {
        Cause::Asked => vec![s.waiting.frame; 2],
        _ => s.as_it_is(),
    };
    "loses-each-fifth-reply" "5.2" "Each fifth frame is not sent." |s| {
        if s.memory.sent % 5 == 4 { Vec::new() } else { s.as_it_is() }
    };
    "cyclic-frames-never-change" "ex 9" "A cyclic frame repeats what was first sent of its register." |s| {
        match (s.waiting.cause, s.memory.first.get(&s.reply.register)) {
            (Cause::Cycle(_), Some(first)) => s.instead(Reply { data: *first, ..s.reply }),
            _ => s.as_it_is(),
        }
    };
    "event-sends-masked-bits" "ex 10" "An event frame has only the bits of the mask." |s| match s.waiting.cause {
        Cause::Event => s.contents(|bits| bits & s.drive.register(0x52)),
        _ => s.as_it_is(),
    };
    "event-sends-the-mask" "ex 10" "An event frame is sent as register 52." |s| match s.waiting.cause {
        Cause::Event => s.instead(Reply { register: 0x52, ..s.reply }),
        _ => s.as_it_is(),
    };
    "status-always-enabled" "ex 8" "Bit 0 of STATUS is always 1." |s| s.register(0x40, |bits| bits | status::ENABLED);
    "limit-switches-swapped" "ex 10-1" "Bits 2 and 3 of STATUS are exchanged." |s| s.register(0x40, |bits| {
        let (plus, minus) = (bits >> 2 & 1, bits >> 3 & 1);
        bits & !(status::LIMIT_PLUS | status::LIMIT_MINUS) | minus << 2 | plus << 3
    });
    "never-calibrated" "ex 10" "Bit 12 of STATUS is always 0." |s| s.register(0x40, |bits| bits & !status::CALIBRATED);
    "always-ready" "ex 11" "E2 is always 1." |s| s.register(0xE2, |_| 1);
    "enable-inverted" "ex 11" "E8 is 0 while the hardware enable is closed." |s| s.register(0xE8, |bits| bits ^ 1);
    "always-in-tolerance" "ex 12" "F4 is always 1." |s| s.register(0xF4, |_| 1);
    "speed-read-without-sign" "App 7" "The actual speed has no sign." |s| s.register(0x30, |bits| {
        u32::from(((bits & 0xFFFF) as u16).cast_signed().unsigned_abs())
    });
    "position-of-16-bits" "App 7" "The upper half of the actual position is 0." |s| s.register(0x6D, |bits| bits & 0xFFFF);
    "scale-is-not-c8" "App 7" "CE stays as it was at power-up." |s| s.register(0xCE, |_| 3600);
    "unassigned-reads-zero" "dump" "An unassigned register reads 0." |s| {
        let unassigned = harness_proto::unitek::Register::of(s.reply.register).dump == 0xFACE;
        s.contents(|bits| if unassigned { 0 } else { bits })
    };
};
