//! What an input of the target `codec` reaches: every command of ND21 10 and every telegram of 9.2, whole, cut and wrong.

use super::words;
use crate::fuzz::LONGEST;
use crate::fuzz::{Feature, Notebook};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Command, CommandError, Field, LAYOUTS, Layout, layout};
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, PAUSE, SyncByte, SyncError};
use harness_proto::novobus::telegram::{Telegram, TelegramError};
use std::collections::BTreeSet;

/// A stream of commands, and the same bytes as a stream of telegrams: each begins after the one before, or behind the byte that settled
/// that there is none.
///
/// # Panics
/// A value is encoded as other bytes; or a part of it is a value too, or a mistake.
pub fn codec_stream(data: &[u8]) {
    noted(data, &mut Notebook::none());
}

/// The same, and what the bytes are is noted, each beginning of a value among it.
///
/// # Panics
/// As [`codec_stream`].
pub(super) fn noted(data: &[u8], notes: &mut Notebook<'_>) {
    let data = &data[..data.len().min(LONGEST)];
    walk(data, Command::decode, command, notes);
    walk(data, Telegram::decode, telegram, notes);
}

fn walk<T, E>(
    data: &[u8],
    decode: fn(&[u8]) -> Decoded<T, E>,
    feature: fn(&[u8]) -> Feature,
    notes: &mut Notebook<'_>,
) {
    let mut rest = data;
    loop {
        super::codec(rest);
        notes.note(|| feature(rest));
        let used = match decode(rest) {
            Decoded::NeedMore => return,
            Decoded::Bad { offset, .. } => offset + 1,
            Decoded::Value { used, .. } => {
                for length in 0..used {
                    let part = &rest[..length];
                    let needs_more = matches!(decode(part), Decoded::NeedMore);
                    assert!(needs_more, "{part:02X?} is a part of something whole");
                    notes.note(|| feature(part));
                }
                used
            }
        };
        rest = &rest[used..];
    }
}

/// How many features there are.
pub(super) fn count() -> usize {
    all().len()
}

/// Every feature: all sync bytes with up to nine bytes, and of each command each beginning, each wrong byte, and a checking byte
/// that is 01 for 00.
fn all() -> BTreeSet<Feature> {
    let mut all = BTreeSet::from([command(&[]), command(&[0])]);
    for first in 0..=u8::MAX {
        let bytes = [first, 0, 0, 0, 0, 0, 0, 0, 0];
        all.extend((0..=bytes.len()).map(|length| telegram(&bytes[..length])));
    }
    for layout in &LAYOUTS {
        for free in 0..=u8::MAX {
            let bytes = example(layout, free);
            for length in 0..=bytes.len() {
                all.insert(command(&bytes[..length]));
            }
            for place in 1..bytes.len() {
                let mut wrong = bytes.clone();
                wrong[place] ^= 0x80;
                all.insert(command(&wrong));
            }
        }
    }
    all
}

/// A right command, with this byte in the first place where any will do, and 00 in the others.
fn example(layout: &Layout, free: u8) -> Vec<u8> {
    let mut bytes = vec![layout.code];
    let mut free = free;
    for field in layout.command {
        bytes.push(match field {
            Field::Fixed(byte) => *byte,
            Field::Code => std::mem::take(&mut free) & 3,
            Field::Check => Checksum::over(&bytes).plus(),
            _ => std::mem::take(&mut free),
        });
    }
    bytes
}

fn command(data: &[u8]) -> Feature {
    let known = data
        .first()
        .and_then(|code| layout(*code, ReadLongAnswer::default()));
    let Some(known) = known else {
        let place = if data.is_empty() {
            "nothing"
        } else {
            "an unknown command byte"
        };
        return Feature::new("10", "a command", place);
    };
    let (section, name) = words::kind(known.kind);
    let what = match Command::decode(data) {
        Decoded::NeedMore => format!("cut behind {} of {} bytes", data.len(), known.length()),
        Decoded::Value { used, .. } if Checksum::over(&data[..used - 1]) == Checksum::EMPTY => {
            "whole, its sum of 00 sent as 01".to_owned()
        }
        Decoded::Value { .. } => "whole".to_owned(),
        Decoded::Bad { reason, offset } => match reason {
            CommandError::UnknownCommand(_) => "an unknown command byte".to_owned(),
            CommandError::UnknownOutput(_) => "no output has this code".to_owned(),
            CommandError::FixedByte { .. } => format!("byte {} is wrong", offset + 1),
            CommandError::Checksum { .. } => "a wrong checking byte".to_owned(),
        },
    };
    Feature::new(section, name, what)
}

fn telegram(data: &[u8]) -> Feature {
    let Some(first) = data.first() else {
        return Feature::new("9.2", "a sync byte", "nothing");
    };
    let no = |what| Feature::new("9.2", "no telegram", what);
    let header = match SyncByte::decode(*first) {
        Ok(SyncByte::Telegram(header)) => header,
        Ok(SyncByte::Synco | SyncByte::Pause) => {
            return no(if *first == PAUSE { "PAUSE" } else { "SYNCO" });
        }
        Err(error) => return no(wrong_sync(error)),
    };
    let process_data = if header.process_data() {
        ", process data"
    } else {
        ""
    };
    let drive = match header.addressing() {
        Addressing::AddressFollows => "an address byte",
        Addressing::SameDrive => "same drive",
        Addressing::NextDrive => "next drive",
    };
    let what = match Telegram::decode(data) {
        Decoded::Value { .. } => format!("{} net bytes", header.net_length()),
        Decoded::NeedMore => "cut".to_owned(),
        Decoded::Bad { reason, .. } => match reason {
            TelegramError::Sync(error) => wrong_sync(error).to_owned(),
            TelegramError::NoTelegram(_) => "it stands alone".to_owned(),
        },
    };
    Feature::new("9.2", format!("a telegram, {drive}{process_data}"), what)
}

const fn wrong_sync(error: SyncError) -> &'static str {
    match error {
        SyncError::Bit7Clear => "bit 7 is 0",
        SyncError::Bit4Set => "bit 4 is 1",
        SyncError::NextWithoutShort => "next drive without a short address",
        SyncError::NoRoomForProcessData => "no room for process data",
        SyncError::AddressWithoutData => "an address byte without a net byte",
        SyncError::TooLong => "more than 7 net bytes",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 10: 9 commands; 9.2: the telegrams that the manual allows, 41, and what is none.
    #[test]
    fn every_command_and_every_telegram_is_counted() {
        let all = all();
        let whole = |feature: &&Feature| feature.what == "whole";
        assert_eq!(all.iter().filter(whole).count(), 9);
        let net = |feature: &&Feature| feature.what.ends_with("net bytes");
        assert_eq!(all.iter().filter(net).count(), 41);
        // A sum of 00 is possible in every command but WriteIO and ResetH8, whose bytes are given.
        let zero = |feature: &&Feature| feature.what.ends_with("as 01");
        assert_eq!(all.iter().filter(zero).count(), 7);
    }
}
