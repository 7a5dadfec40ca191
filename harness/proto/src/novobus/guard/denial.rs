//! Why a byte did not pass.

use super::effect::DriveAct;
use super::known::Facts;
use super::limits::Need;
use crate::counted::counted;
use crate::nd21::cells::cell_at;
use crate::nd21::units::SpeedRange;
use crate::novobus::address::RingSize;
use core::fmt;

/// A byte that did not pass, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeniedByte {
    /// The number of the byte since the guard began, counted from 1.
    pub number: u64,
    /// The byte.
    pub byte: u8,
    /// The ring.
    pub ring: RingSize,
    /// The address byte of the telegram in which it stands, as the master sends it; `None` outside of one.
    pub address: Option<u8>,
    /// Why.
    pub cause: Cause,
}

/// Why a byte did not pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// With it a drive would do what the rig does not allow.
    NotAllowed {
        /// What.
        act: DriveAct,
        /// What leave is missing.
        missing: Need,
    },
    /// It writes a speed above `max_speed`.
    TooFast {
        /// What.
        act: DriveAct,
        /// `max_speed` in rpm.
        most: u16,
        /// The drive's range of speeds; `None` where it was not read, and a bit counts as in the range to 12000 rpm.
        range: Option<SpeedRange>,
    },
    /// It writes a part of a speed, so that the whole one is not known.
    HalfSpeed {
        /// What.
        act: DriveAct,
        /// `max_speed` in rpm.
        most: u16,
    },
    /// A motor could turn faster than `max_speed` by it.
    Faster {
        /// What.
        act: DriveAct,
        /// `max_speed` in rpm.
        most: u16,
        /// The section of the manual.
        section: &'static str,
        /// Why.
        why: &'static str,
    },
    /// It does what the drive holds, such as a speed, and it is not known that this may be.
    NotKnown {
        /// What.
        act: DriveAct,
        /// `max_speed` in rpm, where there is one.
        most: Option<u16>,
        /// The facts that are not known.
        missing: Facts,
    },
    /// The state of the drives is not known well enough to judge the byte.
    InDoubt,
    /// The same behind `ResetH8`: a drive does not listen for a time after it (ND21 10.5).
    BehindReset,
    /// A drive may keep the byte to itself, as its time may be up by a silence (ND21 9.9).
    BehindSilence,
    /// A short address whose drive is not known (ND21 9.2).
    NoAddress,
    /// A check sequence, or bytes that become one by being counted up, where none is due (ND21 9.7, 9.8).
    CheckSequence,
    /// More bytes in a second than the rig allows.
    TooMany {
        /// The limit, in bytes per second.
        most: u32,
    },
    /// More bytes in all than the rig allows.
    TooLong {
        /// The limit, in bytes.
        most: u64,
    },
    /// An earlier byte was denied.
    Closed,
}

impl Cause {
    /// What denies a byte in doubt.
    pub(super) const fn of_doubt(behind_reset: bool) -> Self {
        match behind_reset {
            true => Self::BehindReset,
            false => Self::InDoubt,
        }
    }
}

impl DeniedByte {
    /// The drive that is meant; `None` where there is none of this address.
    #[must_use]
    pub fn drive(&self) -> Option<u8> {
        let drive = self.address?.wrapping_add(self.ring.drives());
        (drive < self.ring.drives()).then_some(drive)
    }
}

impl fmt::Display for DeniedByte {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {} ({:02X}) is not sent: ", self.number, self.byte)?;
        let whom = |f: &mut fmt::Formatter<'_>| match (self.drive(), self.address) {
            (Some(drive), _) => write!(f, " to drive {drive}"),
            (None, Some(address)) => write!(f, " to address byte {address:02X}"),
            (None, None) => Ok(()),
        };
        match self.cause {
            Cause::NotAllowed { act, missing } => {
                write!(f, "{act}")?;
                whom(f)?;
                write!(f, " needs {missing}")
            }
            Cause::TooFast { act, most, range } => {
                write!(f, "{act}")?;
                whom(f)?;
                write!(f, " is above `max_speed` = {most} rpm in the rig's [limits]: ")?;
                match range {
                    Some(SpeedRange::To8000) => f.write_str(
                        "a bit is 0.2649 rpm in the drive's range to 8000 rpm (SwVersion2 bit 7 = 1, ND21 14.5.3.1)",
                    ),
                    Some(SpeedRange::To12000) => f.write_str(
                        "a bit is 0.5298 rpm in the drive's range to 12000 rpm (SwVersion2 bit 7 = 0, ND21 14.5.3.1)",
                    ),
                    None => f.write_str(
                        "the drive's range is not known (SwVersion2 bit 7 was not read), so a bit counts 0.5298 rpm, as \
                         in the range to 12000 rpm (ND21 14.5.3.1)",
                    ),
                }
            }
            Cause::HalfSpeed { act, most } => {
                write!(f, "{act}")?;
                whom(f)?;
                write!(
                    f,
                    " changes a part of a speed, of which the rest is not known; `max_speed` = {most} rpm in the rig's \
                     [limits] lets whole words pass: use WriteWord at the cell's own address"
                )
            }
            Cause::Faster {
                act,
                most,
                section,
                why,
            } => {
                write!(f, "{act}")?;
                whom(f)?;
                write!(
                    f,
                    " does not pass while the rig's [limits] have `max_speed` (= {most} rpm): {why} (ND21 {section})"
                )
            }
            Cause::NotKnown { act, most, missing } => {
                write!(f, "{act}")?;
                whom(f)?;
                match most {
                    Some(most) => write!(
                        f,
                        " can make the motor turn; to check it against `max_speed` = {most} rpm in the rig's [limits], the guard must \
                         know {missing}"
                    ),
                    None => write!(
                        f,
                        " can change what the rig's [limits] do not allow; the guard must know {missing}"
                    ),
                }
            }
            Cause::InDoubt => f.write_str(
                "the position of the drives in a telegram is not known; send 17 zeros and the check sequence first \
                 (ND21 9.8), or allow everything in the rig's [limits] without `max_speed`",
            ),
            Cause::BehindReset => f.write_str(
                "ResetH8 was sent, and a drive does not listen for a time after it (ND21 10.5), so its position in a telegram is not \
                 known; send 17 zeros and the check sequence first (ND21 9.8), or allow everything in the rig's [limits] without \
                 `max_speed`",
            ),
            Cause::BehindSilence => f.write_str(
                "where time-outs may be monitored, a drive may keep to itself what it receives in the 10 ms behind one (ND21 9.9), so \
                 behind a silence of 8 ms or more in the middle of a telegram nothing is sent before 40 ms are over, and behind any such silence \
                 no zero outside of a telegram; wait for 40 ms, or allow everything in the rig's [limits] without `max_speed`",
            ),
            Cause::NoAddress => f.write_str(
                "a short telegram has no meaning before an address byte has been sent (ND21 9.2)",
            ),
            Cause::CheckSequence => f.write_str(
                "the check sequence, or bytes from which drives in the error mode would make it, is permitted only after \
                 17 zeros (ND21 9.7, 9.8)",
            ),
            Cause::TooMany { most } => write!(
                f,
                "{} sent within a second; the rig's [limits] allow no more",
                counted(most, "byte")
            ),
            Cause::TooLong { most } => write!(
                f,
                "{} sent; the rig's [limits] allow no more",
                counted(most, "byte")
            ),
            Cause::Closed => f.write_str("an earlier byte was not allowed"),
        }
    }
}

impl core::error::Error for DeniedByte {}

impl fmt::Display for DriveAct {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Read(_) => f.write_str("a read")?,
            Self::WriteByte(address, data) => write!(f, "WriteByte {data:02X} to {address:04X}")?,
            Self::WriteWord(address, data) => write!(f, "WriteWord {data:04X} to {address:04X}")?,
            Self::And(address, mask) => write!(f, "And {mask:02X} into {address:04X}")?,
            Self::Or(address, mask) => write!(f, "Or {mask:02X} into {address:04X}")?,
            Self::WriteIo(code) => write!(f, "WriteIO {code:02X}")?,
            Self::Reset => f.write_str("ResetH8")?,
            Self::ProcessDataToCome => f.write_str("a telegram with process data")?,
            Self::ProcessData(data) => write!(f, "process data {data:04X}")?,
            Self::Unknown(code) => write!(f, "the unknown command {code:02X}")?,
        }
        match self.address().and_then(cell_at) {
            Some(cell) => write!(f, " ({})", cell.printed),
            None => Ok(()),
        }
    }
}
