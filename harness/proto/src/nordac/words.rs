//! The control word STW, the status word ZSW and the states that ZSW shows (NORDAC 3.2.1, 3.2.2, 3.3).

use core::fmt;

/// A bit of STW or ZSW.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WordBit {
    /// Its number, 0 to 15.
    pub number: u8,
    /// A short name.
    pub name: &'static str,
    /// Its meaning when it is 0; empty where it has none.
    pub zero: &'static str,
    /// Its meaning when it is 1; empty where it has none.
    pub one: &'static str,
}

/// One row a bit: number, name, meaning of 0, meaning of 1.
macro_rules! bits {
    ($($number:literal $name:literal $zero:literal $one:literal;)+) => {
        [$(WordBit { number: $number, name: $name, zero: $zero, one: $one },)+]
    };
}

/// STW, bit 0 first (NORDAC 3.2.1).
#[rustfmt::skip]
pub static STW: [WordBit; 16] = bits! {
    0 "ON" "OFF1: ramp down, output off at 0 Hz" "ON";
    1 "OFF2" "OFF2: output off at once, start-disable" "";
    2 "OFF3" "OFF3: quick stop, output off at 0 Hz, start-disable" "";
    3 "enable" "disable operation: output off, ready to start" "enable operation";
    4 "ramp" "ramp generator to zero" "";
    5 "hold" "ramp generator stopped" "";
    6 "setpoint" "setpoint 0 on the ramp" "setpoint enabled";
    7 "acknowledge" "" "0 -> 1: acknowledge a fault";
    8 "8" "" "";
    9 "9" "" "";
    10 "valid" "PZD invalid" "PZD valid";
    11 "clockwise" "" "clockwise";
    12 "anticlockwise" "" "anticlockwise";
    13 "13" "" "";
    14 "set low" "parameter set 1 or 3" "parameter set 2 or 4";
    15 "set high" "parameter set 1 or 2" "parameter set 3 or 4";
};

/// ZSW, bit 0 first (NORDAC 3.2.2).
#[rustfmt::skip]
pub static ZSW: [WordBit; 16] = bits! {
    0 "ready to start" "not ready to start" "ready to start";
    1 "ready for operation" "not ready for operation" "ready for operation";
    2 "operation enabled" "operation disabled" "operation enabled";
    3 "fault" "no fault" "fault";
    4 "no OFF2" "OFF2 active" "OFF2 not active";
    5 "no OFF3" "OFF3 active" "OFF3 not active";
    6 "start-disable" "no start-disable" "start-disable";
    7 "warning" "no warning" "warning";
    8 "at setpoint" "actual value differs from the setpoint" "actual value = setpoint";
    9 "bus control" "local control" "control by the bus requested";
    10 "reference" "below the reference value" "reference value reached";
    11 "clockwise" "" "clockwise";
    12 "anticlockwise" "" "anticlockwise";
    13 "13" "" "";
    14 "set low" "parameter set 1 or 3" "parameter set 2 or 4";
    15 "set high" "parameter set 1 or 2" "parameter set 3 or 4";
};

/// Masks of STW.
pub mod stw {
    /// 0 is OFF1, 1 is ON.
    pub const ON: u16 = 1 << 0;
    /// 0 is OFF2.
    pub const NO_OFF2: u16 = 1 << 1;
    /// 0 is OFF3.
    pub const NO_OFF3: u16 = 1 << 2;
    /// Enable operation.
    pub const ENABLE: u16 = 1 << 3;
    /// 0 takes the ramp generator to zero.
    pub const RAMP: u16 = 1 << 4;
    /// 0 stops the ramp generator.
    pub const RUN: u16 = 1 << 5;
    /// 0 is setpoint 0.
    pub const SETPOINT: u16 = 1 << 6;
    /// A change from 0 to 1 acknowledges.
    pub const ACKNOWLEDGE: u16 = 1 << 7;
    /// The process words count.
    pub const VALID: u16 = 1 << 10;
    /// Clockwise; has priority.
    pub const CLOCKWISE: u16 = 1 << 11;
    /// Anticlockwise.
    pub const ANTICLOCKWISE: u16 = 1 << 12;
    /// Where the two bits of the parameter set begin.
    pub const SET_SHIFT: u32 = 14;
    /// ON, no OFF2, no OFF3, enable: together they switch the output on.
    pub const OPERATE: u16 = ON | NO_OFF2 | NO_OFF3 | ENABLE;

    /// The word that prepares a start: valid, OFF1.
    pub const READY: u16 = 0x047E;
    /// The word that starts: valid, ON, enabled, setpoint enabled.
    pub const START: u16 = 0x047F;
    /// The word that switches the output off at once: valid, OFF2. Zeros do not.
    pub const SAFE: u16 = 0x047D;
    /// The word that stops quickly: valid, OFF3.
    pub const QUICK_STOP: u16 = 0x047B;
}

/// Masks of ZSW.
pub mod zsw {
    /// Ready to start.
    pub const READY_TO_START: u16 = 1 << 0;
    /// Ready for operation.
    pub const READY: u16 = 1 << 1;
    /// Operation enabled: the output is on.
    pub const ENABLED: u16 = 1 << 2;
    /// Fault.
    pub const FAULT: u16 = 1 << 3;
    /// OFF2 is not active.
    pub const NO_OFF2: u16 = 1 << 4;
    /// OFF3 is not active.
    pub const NO_OFF3: u16 = 1 << 5;
    /// Start-disable.
    pub const START_DISABLE: u16 = 1 << 6;
    /// Warning.
    pub const WARNING: u16 = 1 << 7;
    /// The actual value is the setpoint.
    pub const AT_SETPOINT: u16 = 1 << 8;
    /// Control by the bus.
    pub const BUS_CONTROL: u16 = 1 << 9;
    /// The reference value is reached.
    pub const REFERENCE: u16 = 1 << 10;
    /// Clockwise.
    pub const CLOCKWISE: u16 = 1 << 11;
    /// Anticlockwise.
    pub const ANTICLOCKWISE: u16 = 1 << 12;
    /// Where the two bits of the parameter set begin.
    pub const SET_SHIFT: u32 = 14;
}

/// The parameter set, 0 to 3 for sets 1 to 4, in a control or status word.
#[must_use]
pub const fn set_of(word: u16) -> u8 {
    (word >> stw::SET_SHIFT) as u8
}

/// The bits of a table that are 1 in `word`, bit 0 first.
pub fn set_bits(table: &'static [WordBit], word: u16) -> impl Iterator<Item = &'static WordBit> {
    table.iter().filter(move |bit| word >> bit.number & 1 == 1)
}

/// 100 % of HSW and HIW: the maximum frequency (NORDAC 3.2.3).
pub const FULL: i32 = 0x4000;

/// States of the inverter (NORDAC 3.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// NR: not ready to start.
    NotReady,
    /// SD: start-disable.
    StartDisable,
    /// RDY: ready to start.
    ReadyToStart,
    /// RO: ready for operation.
    ReadyForOperation,
    /// OE: operation enabled.
    OperationEnabled,
    /// QS: quick stop active.
    QuickStop,
    /// FR: fault reaction active.
    FaultReaction,
    /// F: fault.
    Fault,
}

impl State {
    /// Every state.
    pub const ALL: [Self; 8] = [
        Self::NotReady,
        Self::StartDisable,
        Self::ReadyToStart,
        Self::ReadyForOperation,
        Self::OperationEnabled,
        Self::QuickStop,
        Self::FaultReaction,
        Self::Fault,
    ];

    /// The name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReady => "not ready to start",
            Self::StartDisable => "start-disable",
            Self::ReadyToStart => "ready to start",
            Self::ReadyForOperation => "ready for operation",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStop => "quick stop active",
            Self::FaultReaction => "fault reaction active",
            Self::Fault => "fault",
        }
    }

    /// The short name.
    #[must_use]
    pub const fn short(self) -> &'static str {
        match self {
            Self::NotReady => "NR",
            Self::StartDisable => "SD",
            Self::ReadyToStart => "RDY",
            Self::ReadyForOperation => "RO",
            Self::OperationEnabled => "OE",
            Self::QuickStop => "QS",
            Self::FaultReaction => "FR",
            Self::Fault => "F",
        }
    }

    /// Bits 6 and 3 to 0 of ZSW.
    #[must_use]
    pub const fn bits(self) -> u16 {
        match self {
            Self::NotReady => 0x00,
            Self::StartDisable => 0x40,
            Self::ReadyToStart => 0x01,
            Self::ReadyForOperation => 0x03,
            Self::OperationEnabled | Self::QuickStop => 0x07,
            Self::FaultReaction => 0x0F,
            Self::Fault => 0x08,
        }
    }

    /// Whether the output is on.
    #[must_use]
    pub const fn output_on(self) -> bool {
        matches!(
            self,
            Self::OperationEnabled | Self::QuickStop | Self::FaultReaction
        )
    }

    /// The state that a status word shows; `None` for bits that no state has. Bit 5 tells a quick stop from operation.
    #[must_use]
    pub fn of_zsw(word: u16) -> Option<Self> {
        let bits = word & 0x4F;
        let quick_stop = word & zsw::NO_OFF3 == 0;
        Self::ALL.into_iter().find(|state| match state {
            Self::OperationEnabled => bits == state.bits() && !quick_stop,
            Self::QuickStop => bits == state.bits() && quick_stop,
            _ => bits == state.bits(),
        })
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
