//! What a master has sent, read by the rules of the bus alone (ND21 9.1-9.8, 10).

use super::judge::Lie;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, ZEROS};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Command, Reply, layout};
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{Addressing, SYNCO, SyncByte};
use std::collections::BTreeMap;

/// What must come back for a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Back {
    /// This.
    Byte(u8),
    /// Data: any byte. The drive whose answer it belongs to, where it has a checksum.
    Data(Option<u8>),
    /// The command byte, with which an answer of this drive begins.
    Code(u8, u8),
    /// A byte of the answer of this drive that comes back as it was sent.
    Echo(u8, u8),
    /// The -checksum of the answer of this drive (9.6).
    Check(u8),
    /// It begins a check sequence, or stands in one: drives pass it on when they are back.
    Sequence,
}

#[derive(Debug, Default)]
pub(super) struct WireText {
    /// What must come back, byte by byte.
    pub(super) back: Vec<Back>,
    /// The whole commands: their drives, and what they are.
    pub(super) commands: Vec<(u8, Command)>,
    /// How many check sequences there are.
    pub(super) sequences: usize,
}

impl WireText {
    /// Whether every command is one of those asked for, and was not sent too often.
    pub(super) fn asked_for(&self, asked: &[(u8, Command)]) -> Result<(), Lie> {
        for command in &self.commands {
            let asked = asked.iter().filter(|asked| *asked == command).count();
            let sent = self.commands.iter().filter(|sent| *sent == command).count();
            if sent > asked * (1 + self.sequences) {
                let (drive, command) = command;
                let text = format!(
                    "it sent {command:?} to drive {drive} {sent} times, asked for {asked} times"
                );
                return Err(Lie::new("11.6", text));
            }
        }
        Ok(())
    }
}

/// Reads all bytes that were sent into a ring of `drives` drives.
pub(super) fn read(drives: u8, sent: &[u8]) -> Result<WireText, Lie> {
    let mut read = WireText::default();
    let mut begun: BTreeMap<u8, Vec<u8>> = BTreeMap::new();
    let mut last = None;
    let mut at = 0;
    while let Some(&byte) = sent.get(at) {
        if byte == 0 {
            at += sequence(&sent[at..])?;
            read.back.resize(at, Back::Sequence);
            read.sequences += usize::from(sent.get(at - 1) == CHECK_SEQUENCE.last());
            begun.clear();
            last = None;
            continue;
        }
        let Ok(sync) = SyncByte::decode(byte) else {
            return Err(Lie::new(
                "9.2",
                format!("it sent {byte:02X} as a sync byte"),
            ));
        };
        read.back.push(Back::Byte(byte));
        at += 1;
        let SyncByte::Telegram(header) = sync else {
            if byte != SYNCO {
                return Err(Lie::new("9.2", "it sent PAUSE without a request"));
            }
            continue;
        };
        let follows = header.addressing() == Addressing::AddressFollows;
        let Some(drive) = addressed(drives, header.addressing(), last, sent.get(at))? else {
            break;
        };
        if let (true, Some(address)) = (follows, sent.get(at)) {
            read.back.push(Back::Byte(address.wrapping_add(drives)));
            at += 1;
        }
        last = drive;
        let net = usize::from(header.net_length());
        let bytes = &sent[at..sent.len().min(at + net)];
        at += bytes.len();
        let process_data = if header.process_data() { 2 } else { 0 };
        for (index, &byte) in bytes.iter().enumerate() {
            let back = match drive {
                _ if index < process_data => Back::Data(None),
                None => Back::Byte(byte),
                Some(drive) => {
                    let bytes = begun.entry(drive).or_default();
                    bytes.push(byte);
                    let (back, whole) = parameter(drive, bytes)?;
                    if let Some(command) = whole {
                        read.commands.push((drive, command));
                        begun.remove(&drive);
                    }
                    back
                }
            };
            read.back.push(back);
        }
    }
    Ok(read)
}

/// The drive that a telegram addresses, `Some(None)` if it addresses none (9.2, 9.3); `None` if the address byte has not been sent.
fn addressed(
    drives: u8,
    addressing: Addressing,
    last: Option<u8>,
    byte: Option<&u8>,
) -> Result<Option<Option<u8>>, Lie> {
    let drive = match (addressing, byte) {
        (Addressing::AddressFollows, None) => return Ok(None),
        (Addressing::AddressFollows, Some(&address)) => {
            let sum = address.wrapping_add(drives);
            if sum >= drives && address != 0 {
                let text = format!("it sent the address byte {address:02X}, which is no drive's");
                return Err(Lie::new("9.3", text));
            }
            return Ok(Some((sum < drives).then_some(sum)));
        }
        (Addressing::SameDrive, _) => last,
        (Addressing::NextDrive, _) => last.and_then(|drive| drive.checked_add(1)),
    };
    if drive.is_none_or(|drive| drive >= drives) {
        let text = "it sent a short address, and no drive was addressed before";
        return Err(Lie::new("9.2", text));
    }
    Ok(Some(drive))
}

/// How long the check sequence is that begins here (9.8); shorter where nothing more was sent.
fn sequence(sent: &[u8]) -> Result<usize, Lie> {
    let zeros = sent.iter().take_while(|byte| **byte == 0).count();
    let length = sent.len().min(CHECK_SEQUENCE.len());
    let zeros_missing = zeros < usize::from(ZEROS) && zeros < sent.len();
    if zeros_missing || zeros > usize::from(ZEROS) || sent[..length] != CHECK_SEQUENCE[..length] {
        let found = &sent[..sent.len().min(CHECK_SEQUENCE.len() + 1)];
        return Err(Lie::new(
            "9.8",
            format!("it sent {found:02X?} as the check sequence"),
        ));
    }
    Ok(length)
}

/// What comes back for the last of these bytes of a command, and the command where it is whole.
fn parameter(drive: u8, bytes: &[u8]) -> Result<(Back, Option<Command>), Lie> {
    let whole = match Command::decode(bytes) {
        Decoded::Value { value, .. } => Some(value),
        Decoded::NeedMore => None,
        Decoded::Bad { .. } => {
            let text = format!("it sent {bytes:02X?} as a command to drive {drive}");
            return Err(Lie::new("9.6", text));
        }
    };
    let last = bytes.last().copied().unwrap_or(0);
    let layout = bytes
        .first()
        .and_then(|code| layout(*code, ReadLongAnswer::default()));
    let place = bytes.len().checked_sub(2);
    let reply = layout
        .zip(place)
        .and_then(|(layout, place)| layout.answer.get(place));
    let back = match reply {
        None => Back::Code(drive, last),
        Some(Reply::Echo) => Back::Echo(drive, last),
        Some(Reply::Data(_)) => Back::Data(Some(drive)),
        Some(Reply::Check) => Back::Check(drive),
    };
    Ok((back, whole))
}

/// The first wrong byte that came back; `None` if all are right. Bytes in and after a check sequence are left out.
pub(super) fn first_wrong(back: &[Back], heard: &[harness_proto::line::Received]) -> Option<usize> {
    let mut answers: BTreeMap<u8, Checksum> = BTreeMap::new();
    for (index, (back, received)) in back.iter().zip(heard).enumerate() {
        let right = match back {
            Back::Sequence => return None,
            Back::Byte(byte) => received.is(*byte),
            Back::Data(_) => received.error.is_none(),
            Back::Echo(_, byte) | Back::Code(_, byte) => received.is(*byte),
            Back::Check(drive) => {
                let sum = answers.get(drive).map(|sum| sum.minus());
                received.error.is_none() && sum == Some(received.byte)
            }
        };
        if !right {
            return Some(index);
        }
        match back {
            Back::Code(drive, byte) => {
                answers.insert(*drive, Checksum::EMPTY.with(*byte));
            }
            Back::Echo(drive, _) | Back::Data(Some(drive)) => {
                let sum = answers.entry(*drive).or_default();
                *sum = sum.with(received.byte);
            }
            _ => {}
        }
    }
    None
}
