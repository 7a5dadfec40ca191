//! The address byte (ND21 8.5, 9.3).
//!
//! Drives are numbered against the direction of the ring: the last one before the master is drive 0,
//! the first one after it drive N-1. The master sends k-N; each drive adds 1 and passes the sum on; the
//! one that gets 0 is meant; the master receives k.

use core::fmt;

/// The most drives in one ring (ND21 8.4).
pub const MAX_DRIVES: u16 = 250;

/// The number of drives in a ring: 1 to 250 (ND21 8.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RingSize(u8);

impl RingSize {
    /// A ring of `drives` drives.
    ///
    /// # Errors
    /// [`AddressError::RingSize`] for 0 and for more than 250.
    pub fn new(drives: u64) -> Result<Self, AddressError> {
        match u8::try_from(drives) {
            Ok(size) if (1..=u64::from(MAX_DRIVES)).contains(&drives) => Ok(Self(size)),
            _ => Err(AddressError::RingSize { drives }),
        }
    }

    /// How many drives there are.
    #[must_use]
    pub const fn drives(self) -> u8 {
        self.0
    }

    /// The number of the first drive after the master: N-1.
    #[must_use]
    pub const fn first(self) -> u8 {
        self.0 - 1
    }

    /// The lowest address byte that means a drive: that of drive 0 (ND21 9.3).
    #[must_use]
    pub const fn lowest_address(self) -> u8 {
        0_u8.wrapping_sub(self.0)
    }

    /// The address byte that the master sends to drive `drive`: k-N mod 256 (ND21 9.3).
    ///
    /// # Errors
    /// [`AddressError::NoSuchDrive`] where the ring has no such drive.
    pub fn address_byte(self, drive: u8) -> Result<u8, AddressError> {
        if drive < self.0 {
            Ok(drive.wrapping_sub(self.0))
        } else {
            Err(AddressError::NoSuchDrive { drive, ring: self })
        }
    }
}

/// What a drive sends for an address byte (ND21 9.3): "All devices increase the address".
#[must_use]
pub const fn passed_on(address: u8) -> u8 {
    address.wrapping_add(1)
}

/// The sum that tells a drive that it is meant (ND21 9.3).
pub const ADDRESSED: u8 = 0;

/// A ring or a drive that cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AddressError {
    /// A ring has 1 to 250 drives.
    RingSize {
        /// The number that was asked for.
        drives: u64,
    },
    /// The drive is not in the ring.
    NoSuchDrive {
        /// The number that was asked for.
        drive: u8,
        /// The ring.
        ring: RingSize,
    },
}

impl fmt::Display for AddressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::RingSize { drives } => {
                write!(
                    f,
                    "a ring of {drives} drives is not possible: 1 to {MAX_DRIVES} (ND21 8.4)"
                )
            }
            Self::NoSuchDrive { drive, ring } => write!(
                f,
                "no drive {drive} in a ring of {}: drives are numbered 0 to {} (ND21 8.5)",
                ring.drives(),
                ring.first()
            ),
        }
    }
}

impl core::error::Error for AddressError {}
