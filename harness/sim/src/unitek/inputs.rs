//! What is connected to a simulated drive.

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
}
