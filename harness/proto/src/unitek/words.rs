//! The words whose bits have names: STATUS (40), errors and warnings (8F), inputs and outputs (D8), MODE (51).

/// Where the name of a bit comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Origin {
    /// The manual prints it.
    Printed,
    /// Client code of several teams uses it; the manual does not name it.
    Field,
}

/// A named bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bit {
    /// Its number, 0 to 31.
    pub number: u8,
    /// Its name.
    pub name: &'static str,
    /// Its meaning when it is 1.
    pub meaning: &'static str,
    /// Where the name comes from.
    pub origin: Origin,
}

/// One row a bit.
macro_rules! bits {
    ($($number:literal $origin:ident $name:literal $meaning:literal;)+) => {
        &[$(Bit { number: $number, name: $name, meaning: $meaning, origin: Origin::$origin },)+]
    };
}

/// STATUS, register 40 (ex 8, 10, 10-1).
pub const STATUS: &[Bit] = bits! {
    0 Printed "Ena" "drive enabled";
    1 Field "NcR0" "bit 1";
    2 Printed "Lim+" "limit switch + active";
    3 Printed "Lim-" "limit switch - active";
    4 Field "OK" "drive in order";
    5 Printed "Icns" "current reduced to the continuous current";
    6 Field "T-Nlim" "torque control with speed limit";
    7 Printed "P-N" "position control";
    8 Printed "N-I" "speed control";
    9 Field "<N0" "speed below 1 %";
    10 Field "Rsw" "reference switch";
    11 Field "Cal0" "homing runs";
    12 Printed "Cal" "calibrated";
    13 Printed "Tol" "position in tolerance";
    14 Field "Rdy" "ready";
    15 Field "Brk" "brake";
};

/// Errors (bits 0 to 15, and 16, 17) and warnings (from 20 on), register 8F. The manual names no bit; names differ a little
/// from team to team.
pub const ERRORS: &[Bit] = bits! {
    0 Field "BADPARAS" "bad parameters";
    1 Field "POWERFAULT" "power stage fault";
    2 Field "RFE" "safety input fault";
    3 Field "BUS-TIMEOUT" "no frame on the bus within the time-out";
    4 Field "FEEDBACK" "feedback fault";
    5 Field "POWERVOLTAGE" "no power voltage";
    6 Field "MOTORTEMP" "motor temperature too high";
    7 Field "DEVICETEMP" "device temperature too high";
    8 Field "OVERVOLTAGE" "over-voltage";
    9 Field "I_PEAK" "over-current";
    10 Field "RACEAWAY" "race-away";
    11 Field "USER" "user error";
    14 Field "CPU" "processor or current measurement";
    15 Field "BALLAST" "ballast overload";
    16 Field "DEVICE" "device identity";
    17 Field "RUN" "run signal";
    20 Field "POWERVOLTAGE-WARNING" "power voltage";
    21 Field "MOTORTEMP-WARNING" "motor temperature";
    22 Field "DEVICETEMP-WARNING" "device temperature";
    23 Field "VOUT-LIMIT" "output voltage limit";
    24 Field "I_PEAK-WARNING" "over-current";
    25 Field "RACEAWAY-WARNING" "race-away";
    30 Field "BALLAST-WARNING" "ballast overload";
};

/// Inputs and outputs, register D8. The manual names no bit.
pub const IO: &[Bit] = bits! {
    0 Field "Limit1" "limit switch 1";
    1 Field "Limit2" "limit switch 2";
    2 Field "Din2" "digital input 2";
    3 Field "Din1" "digital input 1";
    4 Field "FRG" "hardware enable (run)";
    5 Field "RFE" "safety input";
    8 Field "Dout1" "digital output 1";
    9 Field "Dout2" "digital output 2";
    10 Field "BTB" "ready";
    11 Field "Go" "internal run";
};

/// MODE, register 51 (ex 2, ex 10). The other bits are unknown: write 0.
pub const MODE: &[Bit] = bits! {
    2 Printed "LOCK" "the drive is locked";
    4 Printed "EVENT" "STATUS is sent when a selected bit changes";
};

/// Bit 2 of MODE: lock (ex 2).
pub const MODE_LOCK: u16 = 1 << 2;
/// Bit 4 of MODE: sending by event (ex 10).
pub const MODE_EVENT: u16 = 1 << 4;

/// Masks of the bits of STATUS.
pub mod status {
    /// Drive enabled (ex 8).
    pub const ENABLED: u32 = 1 << 0;
    /// Limit switch + (ex 10-1); that this is limit input 1 is assumed.
    pub const LIMIT_PLUS: u32 = 1 << 2;
    /// Limit switch - (ex 10-1); that this is limit input 2 is assumed.
    pub const LIMIT_MINUS: u32 = 1 << 3;
    /// In order (field).
    pub const OK: u32 = 1 << 4;
    /// Reduced to the continuous current (ex 10-1).
    pub const CONTINUOUS: u32 = 1 << 5;
    /// Torque control with speed limit (field).
    pub const TORQUE: u32 = 1 << 6;
    /// Position control (ex 8).
    pub const POSITION: u32 = 1 << 7;
    /// Speed control (ex 8).
    pub const SPEED: u32 = 1 << 8;
    /// Speed below 1 % (field).
    pub const STANDING: u32 = 1 << 9;
    /// Homing runs (field).
    pub const HOMING: u32 = 1 << 11;
    /// Calibrated (ex 10).
    pub const CALIBRATED: u32 = 1 << 12;
    /// Position in tolerance (ex 10).
    pub const TOLERANCE: u32 = 1 << 13;
    /// Ready (field).
    pub const READY: u32 = 1 << 14;
}

/// Bit 3 of 8F: no frame within the time-out of D0 (field).
pub const ERROR_TIME_OUT: u32 = 1 << 3;
/// Bit 5 of 8F: no power voltage (dump).
pub const ERROR_NO_POWER: u32 = 1 << 5;
/// Bits of 8F that make the drive not ready.
pub const ERRORS_NOT_READY: u32 = 0xFFFF;
/// Bits of 8F that are a fault (EF = 0): those above but no power voltage.
pub const ERRORS_FAULT: u32 = ERRORS_NOT_READY & !ERROR_NO_POWER;

/// The named bits that are 1 in `word`, in order of their numbers.
pub fn set_bits(bits: &'static [Bit], word: u32) -> impl Iterator<Item = &'static Bit> {
    bits.iter().filter(move |bit| word >> bit.number & 1 == 1)
}
