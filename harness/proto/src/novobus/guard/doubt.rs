//! Doubt: what drives take the next byte for is not known, until a recovery (ND21 9.8).

use super::denial::Cause;
use crate::novobus::check_sequence::{SEQUENCE, ZEROS};
use crate::novobus::sync::{PAUSE, SYNCO};

/// The most bytes in the place of a check sequence, until the next 17 zeros.
const MOST_FOREIGN: u8 = 8;

/// What has been done about doubt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Doubt {
    /// No drive is in the middle of a telegram.
    pub(super) cleared: bool,
    /// Zeros in a row, up to 17, and not lost by a check sequence behind them.
    pub(super) zeros: u8,
    /// Bytes of the check sequence.
    pub(super) matched: u8,
    /// It began with a bad sync byte, while every drive waited for a sync byte: every drive is in the error mode.
    pub(super) in_error_mode: bool,
    /// Other bytes that may still pass: after 17 zeros every drive in the error mode waits for the check sequence.
    pub(super) foreign: u8,
    /// It began with `ResetH8`.
    pub(super) behind_reset: bool,
}

impl Doubt {
    /// The same behind this many zeros in a row.
    pub(super) fn with_zeros(self, zeros: u8) -> Self {
        Self {
            cleared: self.cleared || zeros >= ZEROS,
            zeros: zeros.min(ZEROS),
            ..self
        }
    }

    /// What follows behind a byte; `None`: the check sequence has ended it.
    pub(super) fn follow(self, byte: u8) -> Result<Option<Self>, Cause> {
        let next = match byte {
            0 => {
                let zeros = (self.zeros + 1).min(ZEROS);
                // A sequence that breaks off leaves a single zero.
                let zeros = if self.matched > 0 { 1 } else { zeros };
                Self {
                    cleared: self.cleared || zeros == ZEROS,
                    zeros,
                    matched: 0,
                    foreign: match self.in_error_mode && zeros == ZEROS {
                        true => MOST_FOREIGN,
                        false => self.foreign,
                    },
                    ..self
                }
            }
            _ if !self.cleared => return Err(Cause::of_doubt(self.behind_reset)),
            SYNCO | PAUSE => Self {
                zeros: 0,
                matched: 0,
                ..self
            },
            _ if byte == SEQUENCE[usize::from(self.matched)] => {
                let matched = self.matched + 1;
                if usize::from(matched) < SEQUENCE.len() {
                    Self { matched, ..self }
                } else if self.zeros == ZEROS {
                    return Ok(None);
                } else {
                    // Every drive may have left the error mode, or none.
                    Self {
                        cleared: true,
                        ..Self::default()
                    }
                }
            }
            0xFF => Self {
                zeros: 0,
                matched: 1,
                ..self
            },
            // ND21 9.7, 9.8: a drive that waits for the check sequence takes these for nothing else. Should it be wrong, they are no sync bytes.
            1..=0x7F if self.foreign > 0 => Self {
                zeros: 0,
                matched: 0,
                foreign: self.foreign - 1,
                ..self
            },
            _ => return Err(Cause::of_doubt(self.behind_reset)),
        };
        Ok(Some(next))
    }
}
