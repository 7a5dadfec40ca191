//! The codec: frames as text and on the wire, requests, replies, registers and their units.

use crate::fuzz::{Feature, LONGEST, Notebook};
use harness_proto::can::{BadFrame, Frame, Id};
use harness_proto::unitek::frame::{Occasion, reply_data};
use harness_proto::unitek::properties::{Dlc4, Properties, ShortWrite};
use harness_proto::unitek::units::{Decimal, Scaling, shown, to_raw, usual};
use harness_proto::unitek::{BadName, Data, Ignored, NoReply, Register, Reply, Request};

/// The whole input as lines of text, and as a stream of frames: identifier (two bytes; bit 15 for 29 bits, bit 14 for a remote frame), length
/// code, and as many data bytes.
///
/// # Panics
/// A value is written as another one, or has a length that no frame has.
pub fn codec(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the bytes are is noted.
///
/// # Panics
/// As [`codec`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let data = &data[..data.len().min(LONGEST)];
    if let Ok(text) = core::str::from_utf8(data) {
        text.lines().for_each(|line| self::text(line, notes));
    }
    let mut rest = data;
    while let [high, low, dlc, after @ ..] = rest {
        let len = usize::from(dlc % 9).min(after.len());
        let (bytes, behind) = after.split_at(len);
        rest = behind;
        let number = u16::from_be_bytes([*high, *low]);
        if let Some(frame) = frame(number, bytes) {
            on_the_wire(&frame);
            as_text(&frame);
            as_request(&frame, notes);
            as_reply(&frame, notes);
        }
        register(*low, bytes, notes);
    }
}

fn frame(number: u16, bytes: &[u8]) -> Option<Frame> {
    let id = match number >> 15 {
        0 => Id::base(number & 0x7FF)?,
        // Both halves of the 29 bits vary.
        _ => Id::extended(u32::from(number & 0x3FFF) << 15 | u32::from(number & 0x7FF))?,
    };
    if number >> 14 & 1 == 1 {
        Frame::remote(id, bytes.len()).ok()
    } else {
        Frame::new(id, bytes).ok()
    }
}

/// A line as a frame, and as the name of a register.
fn text(line: &str, notes: &mut Notebook<'_>) {
    match line.parse::<Frame>() {
        Ok(frame) => {
            as_text(&frame);
            notes.note(|| {
                let format = if frame.id().is_extended() {
                    "29 bits"
                } else {
                    "11 bits"
                };
                let kind = if frame.is_remote() { "remote" } else { "data" };
                let what = format!("{kind}, {format}, length {}", frame.dlc());
                Feature::new("4.1", "a frame as text", what)
            });
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            notes.note(|| Feature::new("4.1", "a frame as text", bad_frame(error)));
        }
    }
    let what = match Register::named(line) {
        Ok(register) => {
            assert_eq!(register.number, Register::of(register.number).number);
            "a register"
        }
        Err(BadName::Unknown) => return,
        Err(BadName::Ambiguous { first, second, .. }) => {
            assert!(first < second, "{line}: {first:02X} and {second:02X}");
            "several registers"
        }
    };
    notes.note(|| Feature::new("4.7", "a name", what));
}

const fn bad_frame(error: BadFrame) -> &'static str {
    match error {
        BadFrame::Identifier { .. } => "identifier too large",
        BadFrame::TooLong { .. } => "too long",
        BadFrame::NoSeparator => "no separator",
        BadFrame::IdentifierDigits => "bad digits of the identifier",
        BadFrame::DataDigits => "bad digits of the data",
        BadFrame::RemoteLength => "bad length of a remote frame",
    }
}

/// What is written is read as the same frame, also in small letters.
fn as_text(frame: &Frame) {
    let text = frame.to_string();
    assert_eq!(text.parse(), Ok(*frame), "{text}");
    let small = text.to_ascii_lowercase();
    assert_eq!(small.parse(), Ok(*frame), "{small}");
}

/// ISO 11898-1: 47 or 67 bits and 8 for each byte, and at most the stuff bits of the worst case.
fn on_the_wire(frame: &Frame) {
    let bytes = frame.data().len();
    let extended = frame.id().is_extended();
    let plain = if extended { 67 } else { 47 } + 8 * u32::try_from(bytes).unwrap_or(0);
    let bits = frame.wire_bits();
    let worst = Frame::worst_wire_bits(extended, bytes);
    assert!(
        (plain..=worst).contains(&bits),
        "{frame}: {bits} bits, {plain} to {worst}"
    );
    assert!(frame.crc() < 1 << 15, "{frame}");
    assert_eq!(frame.bits_to_difference(frame), None, "{frame}");
}

/// What a drive reads out of a frame is what it reads out of the frame that a master writes for it.
fn as_request(frame: &Frame, notes: &mut Notebook<'_>) {
    let rx = (frame.id().number() & 0x7FF) as u16;
    let [taken, ignored] = [Dlc4::As3, Dlc4::Ignore].map(|dlc4| Request::decode(frame, rx, dlc4));
    if frame.dlc() == 4 && taken.is_ok() {
        assert_eq!(ignored, Err(Ignored::FourBytes), "{frame}");
    } else {
        assert_eq!(taken, ignored, "{frame}");
    }
    notes.note(|| {
        let what = match taken {
            Ok(Request::Write {
                data: Data::Short(_),
                ..
            }) => "a write of 16 bits",
            Ok(Request::Write {
                data: Data::Long(_),
                ..
            }) => "a write of 32 bits",
            Ok(Request::Read { .. }) => "a request for one reply",
            Ok(Request::Cycle { .. }) => "a request for a cycle",
            Ok(Request::Stop { .. }) => "a stop of a cycle",
            Err(ignored) => ignored.about(),
        };
        Feature::new("5.1", format!("to a drive, length {}", frame.dlc()), what)
    });
    let Ok(request) = taken else { return };
    let written = request.encode(rx);
    assert!(written.is_ok(), "{request:?}");
    if let Ok(written) = written {
        assert!(
            matches!(written.dlc(), 3 | 5),
            "{written}: {request:?} (4.1)"
        );
        assert_eq!(
            Request::decode(&written, rx, Dlc4::Ignore),
            Ok(request),
            "{written}"
        );
    }
}

/// A reply is made of the bytes of its frame, and of no others.
fn as_reply(frame: &Frame, notes: &mut Notebook<'_>) {
    let tx = (frame.id().number() & 0x7FF) as u16;
    let reply = Reply::decode(frame, tx);
    notes.note(|| {
        let what = match reply {
            Ok(Reply {
                data: Data::Short(_),
                ..
            }) => "a reply of 16 bits",
            Ok(Reply {
                data: Data::Long(_),
                ..
            }) => "a reply of 32 bits",
            Err(NoReply::OtherIdentifier) => "an identifier of 29 bits",
            Err(NoReply::Remote) => "a remote frame",
            Err(NoReply::Length { .. }) => "a length that no reply has",
        };
        Feature::new("4.5", format!("from a drive, length {}", frame.dlc()), what)
    });
    if let Ok(reply) = reply {
        assert_eq!(reply.encode(tx), Ok(*frame), "{reply:?}");
        let number = reply.number();
        let range = i64::from(i32::MIN)..=i64::from(u32::MAX);
        assert!(range.contains(&number), "{reply:?}: {number}");
    }
}

/// The contents of a register: written, sent, shown with a unit and read back.
fn register(number: u8, bytes: &[u8], notes: &mut Notebook<'_>) {
    let register = Register::of(number);
    let mut value = [0; 4];
    value
        .iter_mut()
        .zip(bytes)
        .for_each(|(to, from)| *to = *from);
    let raw = u32::from_le_bytes(value);
    for data in [Data::Short((raw & 0xFFFF) as u16), Data::Long(raw)] {
        for short_write in [ShortWrite::Extend, ShortWrite::KeepHigh] {
            let held = data.written_to(register, !raw, short_write);
            assert_eq!(held & !register.mask(), 0, "{number:02X}: {held:08X}");
            assert_eq!((held ^ raw) & 0xFFFF, 0, "{number:02X}: {held:08X}");
        }
    }
    let raw = raw & register.mask();
    for (occasion, wide) in [
        (Occasion::Asked, false),
        (Occasion::Asked, true),
        (Occasion::Event, false),
    ] {
        let data = reply_data(register, raw, occasion, wide, &Properties::fw472());
        assert!(
            !wide || matches!(data, Data::Long(_)),
            "{number:02X} (App 3)"
        );
        let reply = Reply {
            register: number,
            data,
            stuff: 0,
        };
        assert_eq!(reply.number(), register.number_of(raw), "{reply:?}");
    }
    let Some(given) = usual(register.unit) else {
        return;
    };
    let scaling = Scaling::default();
    let Some(value) = shown(register, raw, given, scaling) else {
        return;
    };
    let text = value.to_string();
    let decimal = decimal(text.trim_end_matches(given.name()).trim());
    let back = to_raw(register, decimal, given, scaling);
    let what = match back {
        // Either the raw numbers are finer than what is shown, or the other way round.
        Ok(back) => {
            let again = shown(register, back, given, scaling);
            assert!(
                back == raw || again == Some(value),
                "{number:02X} = {text}: {raw:X}, then {back:X}"
            );
            given.name()
        }
        Err(_) => "out of range",
    };
    notes.note(|| Feature::new("4.1", format!("{:?}", register.unit), what));
}

/// A number as it is shown.
fn decimal(text: &str) -> Decimal {
    let places = text.split_once('.').map_or(0, |(_, behind)| behind.len());
    let digits = text.replace('.', "").parse();
    assert!(digits.is_ok(), "{text} is no number");
    Decimal {
        digits: digits.unwrap_or(0),
        places: u8::try_from(places).unwrap_or(u8::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuzz::features;

    #[test]
    fn texts_and_frames_are_told_apart() {
        let said = |data: &[u8]| -> Vec<_> {
            let reached = features(noted, data);
            reached.iter().map(ToString::to_string).collect()
        };
        let text = said(b"201#3D4000\n201#R3\n00000201#\n201\nSPEED_CMD\nrsv");
        for line in [
            "a frame as text: data, 11 bits, length 3",
            "a frame as text: remote, 11 bits, length 3",
            "a frame as text: data, 29 bits, length 0",
            "a frame as text: no separator",
            "a name: a register",
            "a name: several registers",
        ] {
            assert!(text.contains(&line.to_owned()), "{line}: {text:#?}");
        }
        let frames = said(&[0x02, 0x01, 3, 0x3D, 0x40, 0]);
        assert!(frames.contains(&"to a drive, length 3: a request for one reply".to_owned()));
    }
}
