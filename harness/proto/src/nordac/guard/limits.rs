//! What a rig's file permits.

/// What the rig's file permits. Reading needs no permission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Motors may be enabled and given setpoints.
    pub motion: bool,
    /// Parameters may be written: every write is permanent (NORDAC 5).
    pub eeprom: bool,
    /// Data of the motor and of its protection may be written.
    pub motor_data: bool,
    /// Address, PPO type, bus mode and interface may be changed, slaves unlocked, and commands sent to all slaves.
    pub bus_settings: bool,
    /// Stations that the rig's file does not list may be sent more than requests that read.
    pub other_stations: bool,
    /// Motors may be enabled without bus time-out (1625) and watchdog, and the exchange may end while they run.
    pub unsupervised: bool,
    /// The highest setpoint or frequency; any where this is `None`.
    pub highest: Option<Highest>,
    /// Most writes to parameters; any number where this is `None`.
    pub most_writes: Option<u32>,
}

/// The highest setpoint or frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Highest {
    /// As HSW counts it: 4000h is the maximum frequency (1205).
    Setpoint(u16),
    /// In 0.1 Hz; 1205 says what 4000h is.
    Frequency(u16),
}

impl Limits {
    /// Permits everything but what is never permitted, as on a bench of simulated inverters.
    #[must_use]
    pub const fn unlimited() -> Self {
        Self {
            motion: true,
            eeprom: true,
            motor_data: true,
            bus_settings: true,
            other_stations: true,
            unsupervised: true,
            highest: None,
            most_writes: None,
        }
    }

    /// Whether every permission that a task of the parameter channel can need is there.
    pub(super) const fn all(&self) -> bool {
        self.motion && self.eeprom && self.motor_data && self.bus_settings
    }
}
