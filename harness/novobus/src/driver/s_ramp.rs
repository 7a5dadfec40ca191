//! Positioning with the S-ramp over the bus (ND21 13.5.3, 13.5.4).
//!
//! The driver calculates the points of support ([`SRamp`]). How they come to the drive the manual does not
//! say: without [`Options::s_ramp_puffer`](super::Options::s_ramp_puffer) these calls refuse and say so; with
//! it they use the wire `puffer` of the simulated drive.

use super::{Axis, Error, OpenRings};
use harness_proto::nd21::bits::{ps_status, sw_version2};
use harness_proto::nd21::ram;
use harness_proto::nd21::s_ramp::{Direction, SRamp};
use harness_proto::nd21::units::{Ratio, SpeedRange, speed_to_raw};

/// What `SK_StatusPS` gives (13.5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkStatus {
    /// 0: the transmission is finished.
    Ready,
    /// 1: waiting for a hardware or software start.
    Wait,
    /// 2: positioning in operation.
    Doing,
    /// 3: positioning finished.
    Done,
    /// FF: the drive was stopped or blocked.
    Stopped,
}

const OPEN: Error = Error::Open(
    "the manual does not say how the points of support come to the drive (ND21 13.5.3): \
     only simulated drives with the property s-ramp-wire = puffer take them",
);

impl OpenRings<'_> {
    /// Sends a distance in impulses (65536 a turn), a speed in rpm and an acceleration time in ms.
    ///
    /// # Errors
    /// [`Error::Open`], see the module; [`Error::Value`] where the run would last longer than 120 minutes;
    /// others see [`Error`].
    #[doc(alias = "SK_WritePS")]
    pub fn sk_write_ps(
        &self,
        axis: Axis,
        distance: u32,
        rpm: u16,
        ramp_ms: u8,
    ) -> Result<(), Error> {
        if !self.options.s_ramp_puffer {
            return Err(OPEN);
        }
        let software = self.read_byte(axis, ram::SW_VERSION2)?;
        if software & sw_version2::NO_S_RAMP != 0 {
            return Err(Error::Value(format!(
                "drive {axis}: bit 2 of SwVersion2 must be 0 for the S-ramp (ND21 13.5.2)"
            )));
        }
        let range = SpeedRange::from_sw_version2(software);
        let value = |error: &dyn std::fmt::Display| Error::Value(error.to_string());
        let speed = speed_to_raw(Ratio::whole(i32::from(rpm)), range).map_err(|e| value(&e))?;
        let ramp =
            SRamp::new(distance, speed.unsigned_abs(), range, ramp_ms).map_err(|e| value(&e))?;
        let mut address = ram::SCOPE_PUFFER;
        for point in ramp.points() {
            for byte in point.to_bytes() {
                self.write_byte(axis, address, byte)?;
                address += 1;
            }
        }
        let count = u16::try_from(ramp.points().len()).unwrap_or(u16::MAX);
        self.write_word(axis, ram::PS_UMDREHUNG, count)?;
        self.or(axis, ram::PS_STATUS, ps_status::CALCULATE)?;
        let patience = self.options.drive_patience;
        self.poll_byte(axis, ram::PS_STATUS, patience, "the points", |byte| {
            Ok(byte & ps_status::CALCULATE == 0)
        })?;
        Ok(())
    }

    /// Starts the run in this direction. The motor turns.
    ///
    /// # Errors
    /// [`Error::Open`], see the module; others see [`Error`].
    #[doc(alias = "SK_StartPS")]
    pub fn sk_start_ps(&self, axis: Axis, direction: Direction) -> Result<(), Error> {
        if !self.options.s_ramp_puffer {
            return Err(OPEN);
        }
        let sign = match direction {
            Direction::Positive => 0,
            Direction::Negative => ps_status::NEGATIVE,
        };
        self.and(axis, ram::PS_STATUS, !ps_status::NEGATIVE)?;
        self.or(axis, ram::PS_STATUS, ps_status::START | sign)
    }

    /// The status of the run.
    ///
    /// # Errors
    /// [`Error::Open`], see the module; others see [`Error`].
    #[doc(alias = "SK_StatusPS")]
    pub fn sk_status_ps(&self, axis: Axis) -> Result<SkStatus, Error> {
        if !self.options.s_ramp_puffer {
            return Err(OPEN);
        }
        match self.read_word(axis, ram::PS_IMPULS)? {
            0 => Ok(SkStatus::Ready),
            1 => Ok(SkStatus::Wait),
            2 => Ok(SkStatus::Doing),
            3 => Ok(SkStatus::Done),
            0xFF => Ok(SkStatus::Stopped),
            other => Err(Error::Value(format!(
                "drive {axis}: {other:04X} is no status of the S-ramp (ND21 13.5.4)"
            ))),
        }
    }
}
