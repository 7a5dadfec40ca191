//! Commands with any parameters, proper or not, and perhaps with a wrong byte (ND21 chapter 10).

use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::guard::DriveAct as GuardedAct;
use serde::{Deserialize, Serialize};

/// The bytes of the longest command (ND21 10).
const LONGEST: usize = 6;

/// A command, perhaps spoiled.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CommandSent {
    #[serde(flatten)]
    pub command: RawCommand,
    /// A byte of it that is put wrong after its checking byte was worked out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spoil: Option<Spoil>,
}

/// A byte put wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Spoil {
    /// Which byte of the command, counted from 0; the last one where there are fewer.
    pub at: u8,
    /// What stands there.
    pub byte: u8,
}

/// A command of chapter 10 with any parameters, proper or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case")]
pub(crate) enum RawCommand {
    /// 10.1.
    ReadByte { cell: u16 },
    /// 10.1.
    ReadWord { cell: u16 },
    /// 10.1.
    ReadLong { cell: u16 },
    /// 10.2.
    WriteByte { cell: u16, data: u8 },
    /// 10.2.
    WriteWord { cell: u16, data: u16 },
    /// 10.3.
    And {
        /// The low byte of the address.
        low: u8,
        /// The mask.
        data: u8,
    },
    /// 10.3.
    Or {
        /// The low byte of the address.
        low: u8,
        /// The mask.
        data: u8,
    },
    /// 10.4.
    WriteIo { code: u8 },
    /// 10.5.
    Reset,
}

impl RawCommand {
    /// Its bytes without the checking byte.
    #[must_use]
    pub(crate) fn head(self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(LONGEST);
        self.append_head(&mut bytes);
        bytes
    }

    fn append_head(self, bytes: &mut Vec<u8>) {
        let [high, low] = self.cell().unwrap_or(0).to_be_bytes();
        match self {
            Self::ReadByte { .. } => bytes.extend([0xC0, low, high]),
            Self::ReadWord { .. } => bytes.extend([0xC1, low, high, b'?']),
            Self::ReadLong { .. } => bytes.extend([0xC7, low, high, b'1', b'2']),
            Self::WriteByte { data, .. } => bytes.extend([0x82, data, low, high]),
            Self::WriteWord { data, .. } => {
                let [upper, lower] = data.to_be_bytes();
                bytes.extend([0x63, lower, upper, low, high]);
            }
            Self::And { low, data } => bytes.extend([0xA4, data, low]),
            Self::Or { low, data } => bytes.extend([0xA5, data, low]),
            Self::WriteIo { code } => bytes.extend([0xC8, code]),
            Self::Reset => bytes.extend([0xDD, b'!']),
        }
    }

    /// The address that is written in it whole; none of the bit commands.
    #[must_use]
    pub(crate) const fn cell(self) -> Option<u16> {
        match self {
            Self::ReadByte { cell }
            | Self::ReadWord { cell }
            | Self::ReadLong { cell }
            | Self::WriteByte { cell, .. }
            | Self::WriteWord { cell, .. } => Some(cell),
            _ => None,
        }
    }

    /// The same command with this in its data, or in the low byte of them.
    #[must_use]
    pub(crate) const fn with_data(mut self, new: u8) -> Self {
        match &mut self {
            Self::WriteByte { data, .. } | Self::And { data, .. } | Self::Or { data, .. } => {
                *data = new;
            }
            Self::WriteWord { data, .. } => *data = *data & 0xFF00 | new as u16,
            _ => {}
        }
        self
    }

    /// The same command with the address `new` in place of `old`.
    #[must_use]
    pub(crate) fn at(mut self, old: u16, new: u16) -> Self {
        match &mut self {
            Self::ReadByte { cell }
            | Self::ReadWord { cell }
            | Self::ReadLong { cell }
            | Self::WriteByte { cell, .. }
            | Self::WriteWord { cell, .. }
                if *cell == old =>
            {
                *cell = new;
            }
            _ => {}
        }
        self
    }

    /// What the guard calls it.
    #[must_use]
    pub(crate) const fn act(self) -> GuardedAct {
        match self {
            Self::ReadByte { cell } | Self::ReadWord { cell } | Self::ReadLong { cell } => {
                GuardedAct::Read(cell)
            }
            Self::WriteByte { cell, data } => GuardedAct::WriteByte(cell, data),
            Self::WriteWord { cell, data } => GuardedAct::WriteWord(cell, data),
            Self::And { low, data } => GuardedAct::And(0xFF00 | low as u16, data),
            Self::Or { low, data } => GuardedAct::Or(0xFF00 | low as u16, data),
            Self::WriteIo { code } => GuardedAct::WriteIo(code),
            Self::Reset => GuardedAct::Reset,
        }
    }

    /// The manual's name for it, with its parameters.
    #[must_use]
    pub(crate) fn words(self) -> String {
        match self {
            Self::ReadByte { cell } => format!("ReadByte {cell:04X}"),
            Self::ReadWord { cell } => format!("ReadWord {cell:04X}"),
            Self::ReadLong { cell } => format!("ReadLong {cell:04X}"),
            other => match other.act() {
                // The guard names the cell as well; the address is enough here.
                act @ (GuardedAct::WriteByte(..)
                | GuardedAct::WriteWord(..)
                | GuardedAct::And(..)
                | GuardedAct::Or(..)) => {
                    let words = act.to_string();
                    words.split(" (").next().unwrap_or_default().to_owned()
                }
                act => act.to_string(),
            },
        }
    }
}

impl CommandSent {
    /// A command as it should be.
    #[must_use]
    pub(crate) const fn sound(command: RawCommand) -> Self {
        Self {
            command,
            spoil: None,
        }
    }

    /// Its bytes with the checking byte.
    #[must_use]
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(LONGEST);
        self.append_to(&mut bytes);
        bytes
    }

    /// Appends its bytes with the checking byte.
    pub(super) fn append_to(&self, bytes: &mut Vec<u8>) {
        let begin = bytes.len();
        self.command.append_head(bytes);
        bytes.push(Checksum::over(&bytes[begin..]).plus());
        if let Some(spoil) = self.spoil {
            let at = usize::from(spoil.at).min(bytes.len() - begin - 1);
            bytes[begin + at] = spoil.byte;
        }
    }
}
