//! What the target `guard` reaches: where the drives stood, what came, and what the guard made of it.

use super::words;
use crate::fuzz::{Feature, Notebook};
use harness_proto::novobus::command::layout;
use harness_proto::novobus::guard::{Cause, DeniedByte, DriveAct, Guard, Need, Stage};
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, PAUSE, SYNCO, SyncByte};

/// A byte, where the drives stood before it, and whether it leaves damaged.
pub(super) struct RingByte {
    pub(super) stage: Stage,
    pub(super) byte: u8,
    pub(super) bad: bool,
}

/// What the guard made of a byte: where the drives stand behind it, or why it did not pass.
pub(super) fn note(
    notes: &mut Notebook<'_>,
    heard: &RingByte,
    admitted: Result<(), DeniedByte>,
    guard: &Guard,
) {
    if !notes.wanted() {
        return;
    }
    let (section, place) = stage(heard.stage);
    let event = event(heard);
    match admitted {
        Ok(()) => {
            let (_, behind) = stage(guard.stage());
            notes.note(|| Feature::new(section, place, format!("{event}; then {behind}")));
        }
        Err(DeniedByte { cause, .. }) => {
            let why = why(&cause);
            notes.note(|| Feature::new(section, place, format!("{event}; denied, {why}")));
            if let Cause::NotAllowed { act, missing } = cause {
                let place = format!("denied {}", name(&act));
                for needs in needs(missing) {
                    notes.note(|| Feature::new("10", place.clone(), needs));
                }
            }
        }
    }
}

/// A byte passed while a drive is in the error mode (ND21 9.7).
pub(super) fn note_error_mode(notes: &mut Notebook<'_>, heard: &RingByte) {
    notes.note(|| {
        let (_, place) = stage(heard.stage);
        Feature::new("9.7", "a drive is in the error mode", place)
    });
}

/// A drive has executed a command.
pub(super) fn note_executed(notes: &mut Notebook<'_>, command: &[u8]) {
    notes.note(|| {
        let code = command.first().copied().unwrap_or(0);
        let kind = layout(code, ReadLongAnswer::default()).map(|layout| words::kind(layout.kind));
        // The model calls a word of process data a command of 00.
        let (section, name) = kind.unwrap_or(("9.4", "process data"));
        Feature::new(section, "a drive executes", name)
    });
}

const fn stage(stage: Stage) -> (&'static str, &'static str) {
    match stage {
        Stage::Doubt => ("9.8", "in doubt"),
        Stage::Cleared => ("9.8", "in doubt, no telegram open"),
        Stage::Zeros => ("9.8", "behind 17 zeros"),
        Stage::Sequence => ("9.8", "check sequence behind 17 zeros"),
        Stage::IdleSequence => ("9.8", "check sequence without 17 zeros"),
        Stage::Sync => ("9.2", "sync byte due"),
        Stage::Address => ("9.3", "address byte due"),
        Stage::Nobody => ("9.3", "net byte for nobody due"),
        Stage::ProcessHigh => ("9.4", "high byte of process data due"),
        Stage::ProcessLow => ("9.4", "low byte of process data due"),
        Stage::Command => ("9.5", "command byte due"),
        Stage::Parameter => ("9.5", "byte of a command due"),
        Stage::Check => ("9.6", "checking byte due"),
    }
}

fn event(heard: &RingByte) -> &'static str {
    let byte = heard.byte;
    if heard.bad {
        return "a line error";
    }
    match heard.stage {
        _ if byte == 0 => "00",
        Stage::Doubt | Stage::Cleared | Stage::Zeros | Stage::Sequence | Stage::IdleSequence => {
            match byte {
                SYNCO => "SYNCO",
                PAUSE => "PAUSE",
                0xFF => "FF",
                0x44 | 0x72 | 0x4C | 0x41 => "a byte of the check sequence",
                _ => "another byte",
            }
        }
        Stage::Sync => sync(byte),
        Stage::Address if byte < 6 => "an address byte for nobody",
        Stage::Address => "an address byte",
        Stage::Command => layout(byte, ReadLongAnswer::default())
            .map_or("an unknown command byte", |layout| {
                words::kind(layout.kind).1
            }),
        _ => "a byte",
    }
}

fn sync(byte: u8) -> &'static str {
    match SyncByte::decode(byte) {
        Err(_) if byte & 0x90 == 0x80 => "a sync byte of a wrong form",
        Err(_) => "no sync byte",
        Ok(SyncByte::Synco) => "SYNCO",
        Ok(SyncByte::Pause) => "PAUSE",
        Ok(SyncByte::Telegram(header)) => match (header.addressing(), header.process_data()) {
            (Addressing::AddressFollows, false) => "address byte follows",
            (Addressing::AddressFollows, true) => "address byte and process data follow",
            (_, false) if header.net_length() == 0 => "short address without net bytes",
            (Addressing::SameDrive, false) => "same drive",
            (Addressing::SameDrive, true) => "same drive, process data",
            (Addressing::NextDrive, false) => "next drive",
            (Addressing::NextDrive, true) => "next drive, process data",
        },
    }
}

const fn why(cause: &Cause) -> &'static str {
    match cause {
        Cause::NotAllowed { .. } => "not allowed",
        Cause::TooFast { .. } => "too fast",
        Cause::HalfSpeed { .. } => "half of a speed",
        Cause::Faster { .. } => "turns faster",
        Cause::NotKnown { .. } => "not known to be slow",
        Cause::InDoubt | Cause::BehindReset => "in doubt",
        Cause::BehindSilence => "behind a silence",
        Cause::NoAddress => "no address is known",
        Cause::CheckSequence => "a check sequence",
        Cause::TooMany { .. } => "too many a second",
        Cause::TooLong { .. } => "too many",
        Cause::Closed => "closed",
    }
}

const fn name(act: &DriveAct) -> &'static str {
    match act {
        DriveAct::Read(_) => "read",
        DriveAct::WriteByte(..) => "WriteByte",
        DriveAct::WriteWord(..) => "WriteWord",
        DriveAct::And(..) => "And",
        DriveAct::Or(..) => "Or",
        DriveAct::WriteIo(_) => "WriteIO",
        DriveAct::Reset => "ResetH8",
        DriveAct::ProcessDataToCome => "process data to come",
        DriveAct::ProcessData(_) => "process data",
        DriveAct::Unknown(_) => "unknown command byte",
    }
}

/// The missing permissions, one by one. `EVERYTHING`, for cells of unknown meaning, replaces the others.
fn needs(missing: Need) -> impl Iterator<Item = &'static str> {
    let names = [
        (Need::EVERYTHING, "needs everything"),
        (Need::MOTION, "needs motion"),
        (Need::EEPROM, "needs EEPROM"),
        (Need::RESET, "needs reset"),
        (Need::OUTPUTS, "needs outputs"),
        (Need::MONITORING, "needs monitoring"),
    ];
    let unknown = missing.contains(Need::EVERYTHING);
    let one = move |(need, _): &(Need, &str)| {
        missing.contains(*need) && (!unknown || *need == Need::EVERYTHING)
    };
    names.into_iter().filter(one).map(|(_, name)| name)
}
