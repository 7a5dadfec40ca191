//! The positioning controller over the bus, by the numbered steps of ND21 13.2.

use super::{Axis, Error, OpenRings};
use harness_proto::nd21::bits::{flags, flags2, ps_status, status};
use harness_proto::nd21::position::Position;
use harness_proto::nd21::ram;
use harness_proto::novobus::command::Command;

/// How near the actual value must come (13.2.1.2 step 8).
const NEAR: u32 = 256;
/// How often it is tried.
const ATTEMPTS: u8 = 8;
/// `ps_umdrehung` when no calculation is under way (13.2.1.3 step 4, E69).
const NO_CALCULATION: u16 = 0x00FF;

/// The two words of a double word, the high one first.
fn words(long: u32) -> [u16; 2] {
    let [a, b, c, d] = long.to_be_bytes();
    [u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d])]
}

impl OpenRings<'_> {
    /// Initialises the positioning controller with a referencing run (13.2.1.1) and waits for its end.
    /// The motor turns.
    ///
    /// # Errors
    /// [`Error::InReset`], [`Error::InErrorMode`]; [`Error::Interrupted`] by a stop or a block, then `ps_v0` is as
    /// before, where the line permits it; others see [`Error`].
    #[doc(alias = "NB_Referenzfahrt")]
    pub(crate) fn reference(&self, axis: Axis) -> Result<(), Error> {
        self.reference_showing(axis, |_| {})
    }

    /// The same, and shows each `Flags2` that was read on the way: its bits 7 to 5 say that the run is on.
    ///
    /// # Errors
    /// As of [`Self::reference`].
    pub(crate) fn reference_showing(&self, axis: Axis, seen: impl FnMut(u8)) -> Result<(), Error> {
        // Step 1.
        let speed = self.read_word(axis, ram::PS_V0)?;
        // Step 2.
        self.check_ready(axis)?;
        // Step 3.
        self.write_byte(axis, ram::PS_STATUS, 0)?;
        // Step 4: "both" bits are 6 and 5 (E67).
        let start = flags2::START_REFERENCING;
        self.and(axis, ram::FLAGS2, !(flags2::REFERENCING & !start))?;
        // Step 5.
        self.write_word(axis, ram::NSOLL, 0)?;
        // Step 6.
        self.or(axis, ram::FLAGS2, start)?;
        let end = self.follow_reference(axis, seen);
        // Step 9 (E68), on every way out.
        let restored = self.restore_ps_v0(axis, speed);
        end?;
        restored.map(|_| ())
    }

    /// Gives `ps_v0` the value that it had before a run. A drive sets it to its maximum speed at a reset (13.1.4), which may be more than
    /// the `max_speed` of a rig allows to be written: then the cell stays as it is, and this is `false`.
    ///
    /// # Errors
    /// See [`Error`].
    pub(crate) fn restore_ps_v0(&self, axis: Axis, speed: u16) -> Result<bool, Error> {
        let restore = Command::WriteWord {
            address: ram::PS_V0,
            data: speed,
        };
        if !self.lock().permits(axis.ring(), axis.drive(), restore) {
            return Ok(false);
        }
        self.write_word(axis, ram::PS_V0, speed)?;
        Ok(true)
    }

    fn follow_reference(&self, axis: Axis, mut seen: impl FnMut(u8)) -> Result<(), Error> {
        let patience = self.options.motion_patience;
        // Step 7.
        self.poll_byte(axis, ram::FLAGS2, patience, "the referencing run", |byte| {
            seen(byte);
            self.check_not_interrupted(axis)?;
            Ok(byte & flags2::REFERENCING == 0)
        })?;
        // Step 8.
        self.poll_byte(axis, ram::PS_STATUS, patience, "in-position", |byte| {
            self.check_not_interrupted(axis)?;
            Ok(byte == ps_status::FINISHED)
        })?;
        Ok(())
    }

    /// Bits 5 and 7 of `Flags` (13.2.1.1 steps 7 and 8).
    fn check_not_interrupted(&self, axis: Axis) -> Result<(), Error> {
        let byte = self.read_byte(axis, ram::FLAGS)?;
        let by = if byte & flags::BLOCK != 0 {
            self.check_ready(axis)?;
            "block"
        } else if byte & flags::STOP != 0 {
            "stop"
        } else {
            return Ok(());
        };
        let what = "the referencing run";
        Err(Error::Interrupted { axis, what, by })
    }

    /// Initialises the positioning controller without a referencing run, and gives the rotor's present
    /// place the value `position` (13.2.1.2). A drive that is not blocked is blocked for it.
    ///
    /// # Errors
    /// [`Error::NotSet`] where the value is off by 256 increments or more every time; others see [`Error`].
    #[doc(alias = "NB_IstwertSetzen")]
    pub(crate) fn set_actual_value(&self, axis: Axis, position: u32) -> Result<(), Error> {
        let mut deviation = 0;
        for _ in 0..ATTEMPTS {
            // Step 1.
            let actual = self.read_long(axis, ram::UMDRIST)?;
            let shift = self.read_word(axis, ram::D_LAGE)?;
            // Steps 2 and 3; dLage is the low word (14.2.1).
            let raw = actual.wrapping_sub(u32::from(shift));
            let [_, new_shift] = words(position.wrapping_sub(raw));
            // Step 4.
            let blocked = self.read_byte(axis, ram::STATUS)? & status::BLOCK != 0;
            if !blocked {
                self.block(axis)?;
            }
            // Steps 5 and 6.
            self.write_word(axis, ram::D_LAGE, new_shift)?;
            let [turns, _] = words(position);
            self.write_word(axis, ram::UMDRIST, turns)?;
            // Step 7.
            if !blocked {
                self.and(axis, ram::STATUS, !status::BLOCK)?;
            }
            // Step 8.
            let reached = self.read_long(axis, ram::UMDRIST)?;
            deviation = position.wrapping_sub(reached).cast_signed();
            if deviation.unsigned_abs() < NEAR {
                // Steps 9 and 10.
                self.and(axis, ram::FLAGS2, !flags2::CALCULATE)?;
                return self.write_byte(axis, ram::PS_STATUS, ps_status::FINISHED);
            }
        }
        let attempts = ATTEMPTS;
        Err(Error::NotSet {
            axis,
            deviation,
            attempts,
        })
    }

    /// Initialises the positioning controller without a run and without touching the actual value
    /// (13.2.1.3).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_InitPS")]
    pub(crate) fn init_ps(&self, axis: Axis) -> Result<(), Error> {
        // Steps 1 and 2.
        self.and(axis, ram::FLAGS2, !flags2::CALCULATE)?;
        self.and(axis, ram::PS_STATUS, !ps_status::CALCULATE)?;
        // Step 3.
        if self.read_byte(axis, ram::PS_STATUS)? == ps_status::FINISHED {
            return Ok(());
        }
        // Steps 4 and 5: "bit 1" is taken as it stands.
        if self.read_word(axis, ram::PS_UMDREHUNG)? != NO_CALCULATION {
            let patience = self.options.drive_patience;
            let ended = ps_status::CALCULATED | ps_status::TARGET_BRAKING;
            self.poll_byte(axis, ram::PS_STATUS, patience, "the calculation", |byte| {
                Ok(byte & ended != 0 || byte == 0)
            })?;
        }
        // Step 6.
        self.write_byte(axis, ram::PS_STATUS, ps_status::FINISHED)
    }

    /// Sends a new target and starts the calculation (13.2.2).
    ///
    /// # Errors
    /// See [`Error`].
    #[doc(alias = "NB_WritePS")]
    pub(crate) fn write_ps(&self, axis: Axis, position: Position) -> Result<(), Error> {
        // Step 1.
        let patience = self.options.motion_patience;
        self.poll_byte(
            axis,
            ram::FLAGS2,
            patience,
            "the last positioning",
            |byte| Ok(byte & flags2::CALCULATE == 0),
        )?;
        // Step 2.
        let [high, low] = words(position.encode());
        self.write_word(axis, ram::PS_POSITION_H, high)?;
        self.write_word(axis, ram::PS_POSITION_L, low)?;
        // Step 3.
        self.or(axis, ram::FLAGS2, flags2::CALCULATE)
    }

    /// Starts the positioning that has been calculated (13.2.3). The motor turns.
    ///
    /// # Errors
    /// [`Error::InErrorMode`] where the calculation ended in an error (13.4); others see [`Error`].
    #[doc(alias = "NB_StartPS")]
    pub(crate) fn start_ps(&self, axis: Axis) -> Result<(), Error> {
        // Step 1.
        let patience = self.options.drive_patience;
        self.poll_byte(axis, ram::PS_STATUS, patience, "the calculation", |byte| {
            let done = byte & ps_status::CALCULATED != 0;
            if !done {
                self.check_ready(axis)?;
            }
            Ok(done)
        })?;
        // Step 2.
        self.or(axis, ram::PS_STATUS, ps_status::START)
    }

    /// Waits for the end of a positioning (13.2.4).
    ///
    /// # Errors
    /// [`Error::Interrupted`] where a stop or a block has ended it; others see [`Error`].
    pub(crate) fn wait_for_end(&self, axis: Axis) -> Result<(), Error> {
        self.wait_for_end_showing(axis, |_| {})
    }

    /// The same, and shows each `ps_status` that was read on the way (13.3.1).
    ///
    /// # Errors
    /// As of [`Self::wait_for_end`].
    pub(crate) fn wait_for_end_showing(
        &self,
        axis: Axis,
        mut seen: impl FnMut(u8),
    ) -> Result<(), Error> {
        let patience = self.options.motion_patience;
        let what = "the positioning";
        self.poll_byte(axis, ram::PS_STATUS, patience, what, |byte| {
            seen(byte);
            if byte == 0 {
                self.check_ready(axis)?;
                let by = "stop or block";
                return Err(Error::Interrupted { axis, what, by });
            }
            Ok(byte == ps_status::FINISHED)
        })?;
        Ok(())
    }
}
