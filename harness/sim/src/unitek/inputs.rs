//! What is connected to a simulated drive.

use core::fmt;

/// Inputs and sensors of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Inputs {
    /// Hardware enable FRG/RUN (E8).
    pub run: bool,
    /// Second safety input; bit 5 of D8.
    pub rfe: bool,
    /// Power voltage. Without it bit 5 of 8F is set.
    pub dc_bus: bool,
    /// Limit switch 1 (E4), of the positive direction.
    pub limit1: bool,
    /// Limit switch 2 (E5), of the negative direction.
    pub limit2: bool,
    /// Digital input 1 (E6).
    pub din1: bool,
    /// Digital input 2 (E7).
    pub din2: bool,
    /// The current is reduced to the continuous current (F3).
    pub icns: bool,
    /// Motor temperature, raw (49).
    pub motor_temperature: u16,
    /// Temperature of the power stage, raw (4A).
    pub igbt_temperature: u16,
    /// Air temperature, raw (4B).
    pub air_temperature: u16,
    /// Bus voltage with the power on, raw (EB).
    pub voltage: u16,
    /// Bits of 8F that are there as long as they are set here.
    pub faults: u32,
    /// Bit 13 of STATUS and F4, in place of what the drive finds.
    pub tolerance: Option<bool>,
    /// Bit 12 of STATUS, in place of what the drive finds.
    pub calibrated: Option<bool>,
    /// The speed that the drive measures, in place of the motor's: 30, 32, A8, F5 and bit 9 of STATUS.
    pub speed: Option<i16>,
}

impl Default for Inputs {
    /// Enabled, with power, nothing else active. Temperatures and voltage are our choice.
    fn default() -> Self {
        Self {
            run: true,
            rfe: true,
            dc_bus: true,
            limit1: false,
            limit2: false,
            din1: false,
            din2: false,
            icns: false,
            motor_temperature: 4_500,
            igbt_temperature: 19_000,
            air_temperature: 8_000,
            voltage: 10_000,
            faults: 0,
            tolerance: None,
            calibrated: None,
            speed: None,
        }
    }
}

impl Inputs {
    /// EB: 1 without power, as in the dump.
    #[must_use]
    pub const fn bus_voltage(&self) -> u16 {
        if self.dc_bus { self.voltage } else { 1 }
    }

    /// The names of the inputs that are on or off.
    pub const SWITCHES: [&'static str; 8] = [
        "run", "rfe", "dc-bus", "limit1", "limit2", "din1", "din2", "icns",
    ];

    /// The input with this name.
    #[must_use]
    pub fn switch(&mut self, name: &str) -> Option<&mut bool> {
        Some(match name {
            "run" => &mut self.run,
            "rfe" => &mut self.rfe,
            "dc-bus" => &mut self.dc_bus,
            "limit1" => &mut self.limit1,
            "limit2" => &mut self.limit2,
            "din1" => &mut self.din1,
            "din2" => &mut self.din2,
            "icns" => &mut self.icns,
            _ => return None,
        })
    }

    /// The names of what can be overruled by [`Inputs::force`].
    pub const FORCED: [&'static str; 8] = [
        "tol",
        "cal",
        "speed",
        "errors",
        "motor-temperature",
        "igbt-temperature",
        "air-temperature",
        "bus-voltage",
    ];

    /// Overrules a value of plant or sensors by a raw number, or lets it be what it is by itself. `false` if there is none with this name.
    #[must_use]
    pub fn force(&mut self, name: &str, raw: Option<u32>) -> bool {
        let usual = Self::default();
        let low = raw.map(|raw| (raw & 0xFFFF) as u16);
        match name {
            "tol" => self.tolerance = raw.map(|raw| raw != 0),
            "cal" => self.calibrated = raw.map(|raw| raw != 0),
            "speed" => self.speed = low.map(u16::cast_signed),
            "errors" => self.faults = raw.unwrap_or(usual.faults),
            "motor-temperature" => {
                self.motor_temperature = low.unwrap_or(usual.motor_temperature);
            }
            "igbt-temperature" => self.igbt_temperature = low.unwrap_or(usual.igbt_temperature),
            "air-temperature" => self.air_temperature = low.unwrap_or(usual.air_temperature),
            "bus-voltage" => self.voltage = low.unwrap_or(usual.voltage),
            _ => return false,
        }
        true
    }
}

/// What happens to a drive from outside the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stimulus {
    /// The input with this name, one of [`Inputs::SWITCHES`], is switched.
    Input(&'static str, bool),
    /// What has this name, one of [`Inputs::FORCED`], is overruled by a raw number, or no longer.
    Force(&'static str, Option<u32>),
    /// The contents of a register are changed, as NDrive does over RS232.
    Register(u8, u32),
    /// Its CAN controller goes to bus-off.
    BusOff,
}

impl fmt::Display for Stimulus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(name, on) => write!(f, "input {name} {}", if *on { "on" } else { "off" }),
            Self::Force(name, Some(raw)) => write!(f, "{name} forced to {raw}"),
            Self::Force(name, None) => write!(f, "{name} no longer forced"),
            Self::Register(number, raw) => write!(f, "register {number:02X} = {raw}"),
            Self::BusOff => f.write_str("bus-off"),
        }
    }
}
