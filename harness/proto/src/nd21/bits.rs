//! The bits of the drive's status and configuration bytes (ND21 13.3.1, 14.3, 14.4).
//!
//! The figures of 14.3 and 14.4 have lost their lines: only the order of the labels is left. Where the
//! text gives a bit a number, that number holds. The others are choices, each named with its reason;
//! erratum E91 to E92 and E102 keep them open.

use super::ram;

/// `Status` (ND21 14.4.1). Bits 0, 5 and 7 have their numbers from 14.10; the labels in their printed order
/// fit bits 3 to 7 if "software stop" is taken as bit 7 and "software block" as bit 0.
pub mod status {
    /// Bit 0, software block: the regulator is disabled (14.10).
    pub const BLOCK: u8 = 1 << 0;
    /// Bit 3, current limit reached; the number is a choice (E91).
    pub const CURRENT_LIMIT: u8 = 1 << 3;
    /// Bit 5, error (14.10.1).
    pub const ERROR: u8 = 1 << 5;
    /// Bit 6, reset active; the number is a choice (E91).
    pub const RESET: u8 = 1 << 6;
    /// Bit 7, software stop (14.10).
    pub const STOP: u8 = 1 << 7;
}

/// `Flags` (ND21 14.4.2), read only. Stop and block have their numbers from 13.2.1.1; the labels in their
/// printed order then give the others, and "for ND21 timing" the bits that are left (E117).
pub mod flags {
    /// Bits 0 to 2, for the timing of the ND21: the low bits of the counted cycles.
    pub const TIMING: u8 = 0b0000_0111;
    /// Bit 3, for tripping the resolver switch: set above 700 rpm, where the resolution is less than
    /// 16 bit (4.1); the number is a choice.
    pub const RESOLVER: u8 = 1 << 3;
    /// Bit 4, i2t current limit reached; the number is a choice.
    pub const I2T: u8 = 1 << 4;
    /// Bit 5, stop, by software or by hardware (13.2.1.1 step 8).
    pub const STOP: u8 = 1 << 5;
    /// Bit 6, hardware stop; the number is a choice.
    pub const HARDWARE_STOP: u8 = 1 << 6;
    /// Bit 7, block, by software, by hardware or by an error (13.2.1.1 step 8).
    pub const BLOCK: u8 = 1 << 7;
}

/// `Flags2` (ND21 14.4.3).
pub mod flags2 {
    /// Bit 0, NOVOBUS timeout, read only; the number is a choice (E92).
    pub const TIMEOUT: u8 = 1 << 0;
    /// Bit 1, NOVOBUS OK, read only; the number is a choice (E92).
    pub const OK: u8 = 1 << 1;
    /// Bit 2, NOVOBUS time monitoring active (14.10.2).
    pub const MONITORING: u8 = 1 << 2;
    /// Bit 3, start the PS calculation: determine the direction (13.2.2).
    pub const CALCULATE: u8 = 1 << 3;
    /// Bit 4, store the actual position in the EEPROM: teach-in; the number is what is left (E92).
    pub const TEACH_IN: u8 = 1 << 4;
    /// Bits 7 to 5, referencing run: 100 starts it, 000 is its end (13.2.1.1 steps 6 and 7).
    pub const REFERENCING: u8 = 0b1110_0000;
    /// Bits 7 to 5 = 100.
    pub const START_REFERENCING: u8 = 1 << 7;
    /// Bits 7 to 5 and 3: what asks for a run (13.1.1, 13.2.2).
    pub const ORDERS: u8 = REFERENCING | CALCULATE;
}

/// `ps_status` (ND21 13.3.1).
pub mod ps_status {
    /// Bit 7, direction of the positioning: 1 is negative (E118).
    pub const NEGATIVE: u8 = 1 << 7;
    /// Bit 6 starts the PS calculation.
    pub const CALCULATE: u8 = 1 << 6;
    /// Bit 5, PS calculation finished.
    pub const CALCULATED: u8 = 1 << 5;
    /// Bit 4 starts the positioning.
    pub const START: u8 = 1 << 4;
    /// Bit 3, phase "acceleration and constant drive".
    pub const CONSTANT: u8 = 1 << 3;
    /// Bit 2, phase "braking".
    pub const BRAKING: u8 = 1 << 2;
    /// Bit 1, phase "target braking".
    pub const TARGET_BRAKING: u8 = 1 << 1;
    /// Bit 0, positioning finished.
    pub const FINISHED: u8 = 1 << 0;
}

/// `HwVersion`, since H8 version 01.07.93 (ND21 14.3.3).
pub mod hw_version {
    /// Bits 1 and 0, sensor of the motor's temperature: 00 none, 01 NTC, 10 PTC, 11 opener.
    pub const SENSOR: u8 = 0b0000_0011;
    /// Bit 3, cycle control activated (13.1.8).
    pub const CYCLE_CONTROL: u8 = 1 << 3;
    /// Bit 4, end switch: 0 = stop, 1 = block.
    pub const END_SWITCH_BLOCKS: u8 = 1 << 4;
    /// Bits 6 and 5, what GPO2 shows (14.7.5).
    pub const GPO2: u8 = 0b0110_0000;
    /// [`GPO2`] = 00: set by the bus.
    pub const GPO2_BUS: u8 = 0b0000_0000;
    /// [`GPO2`] = 01: current limit reached.
    pub const GPO2_CURRENT_LIMIT: u8 = 0b0010_0000;
    /// [`GPO2`] = 10: in position.
    pub const GPO2_IN_POSITION: u8 = 0b0100_0000;
    /// [`GPO2`] = 11: motor idling.
    pub const GPO2_IDLING: u8 = 0b0110_0000;
    /// Bit 7, at reset the counter is set up for the analogue input, with 0 for the frequency input.
    pub const ANALOGUE: u8 = 1 << 7;
}

/// `HwVersion2` (ND21 14.3.4). Most of its bits are active with 0.
pub mod hw_version2 {
    /// Bit 1 = 0: the positioning control is activated after switching on (13.2.1, E65).
    pub const NO_AUTOMATIC_PS: u8 = 1 << 1;
    /// Bit 4 = 0: `RdPos` switches to the analogue nominal value (13.1.9.5).
    pub const RD_POS: u8 = 1 << 4;
    /// Bit 6 = 0: the analogue output is active, and GPO1 no digital output (14.7.4).
    pub const NO_ANALOGUE_OUTPUT: u8 = 1 << 6;
    /// Bit 7, end switches: 0 active low, 1 active high.
    pub const END_SWITCH_HIGH: u8 = 1 << 7;
}

/// `SwVersion` (ND21 14.3.1).
pub mod sw_version {
    /// Bits 1 and 0, source of the nominal value.
    pub const SOURCE: u8 = 0b0000_0011;
    /// [`SOURCE`] = 00: analogue input.
    pub const SOURCE_ANALOGUE: u8 = 0b00;
    /// [`SOURCE`] = 10: frequency input.
    pub const SOURCE_FREQUENCY: u8 = 0b10;
    /// [`SOURCE`] = 11: NOVOBUS.
    pub const SOURCE_NOVOBUS: u8 = 0b11;
    /// Bit 3, direction of rotation: 0 = +, 1 = -.
    pub const REVERSED: u8 = 1 << 3;
    /// Bit 5, block after reset.
    pub const BLOCK_AFTER_RESET: u8 = 1 << 5;
    /// Bit 6, position regulator.
    pub const POSITION_REGULATOR: u8 = 1 << 6;
    /// Bit 7, reversing mode, a test mode.
    pub const REVERSING: u8 = 1 << 7;
}

/// `SwVersion2` (ND21 14.3.2).
pub mod sw_version2 {
    /// Bit 0 = 0: with stepping, the analogue input limits the torque (13.1.4).
    pub const NO_ANALOGUE_TORQUE: u8 = 1 << 0;
    /// Bit 1 = 0: GPIN8 is a mode switch of the cycle control (13.1.7.5).
    pub const NO_GPIN8: u8 = 1 << 1;
    /// Bit 2 = 0: positioning with the S-ramp (13.5.2, E74).
    pub const NO_S_RAMP: u8 = 1 << 2;
    /// Bit 6, an error at the impulse input: 0 warning, 1 error.
    pub const IMPULSE_ERROR: u8 = 1 << 6;
    /// Bit 7, range of speeds: 0 to 12000 rpm, 1 to 8000 rpm.
    pub const TO_8000: u8 = 1 << 7;
}

/// `EE_selftest` (ND21 14.3.6).
pub mod selftest {
    /// Bit 7: time-out monitoring is switched on at reset (14.10.2, E102).
    pub const MONITORING: u8 = 1 << 7;
}

/// `scope_status` (ND21 14.10.6.5).
pub mod scope_status {
    /// Bit 7: the recording is stopped.
    pub const STOPPED: u8 = 1 << 7;
    /// Bit 6: triggering has occurred.
    pub const TRIGGERED: u8 = 1 << 6;
    /// Bit 5: trigger status, set at the start; 0 while the signal is on the near side of the threshold.
    pub const ARMED: u8 = 1 << 5;
    /// Bit 4: trigger flank, 1 positive, 0 negative (14.10.6.6, E108).
    pub const POSITIVE: u8 = 1 << 4;
}

/// The bits that have a name of their own: address of the cell, bits, short name. A name of several bits
/// holds where any of them is set.
const NAMES: &[(u16, u8, &str)] = &[
    (ram::STATUS, status::STOP, "stop"),
    (ram::STATUS, status::RESET, "reset"),
    (ram::STATUS, status::ERROR, "error"),
    (ram::STATUS, status::CURRENT_LIMIT, "current limit"),
    (ram::STATUS, status::BLOCK, "block"),
    (ram::FLAGS, flags::BLOCK, "block"),
    (ram::FLAGS, flags::HARDWARE_STOP, "hardware stop"),
    (ram::FLAGS, flags::STOP, "stop"),
    (ram::FLAGS, flags::I2T, "i2t limit"),
    (ram::FLAGS, flags::RESOLVER, "resolver switch"),
    (ram::FLAGS2, flags2::REFERENCING, "referencing"),
    (ram::FLAGS2, flags2::TEACH_IN, "teach-in"),
    (ram::FLAGS2, flags2::CALCULATE, "calculate"),
    (ram::FLAGS2, flags2::MONITORING, "monitoring"),
    (ram::FLAGS2, flags2::OK, "NOVOBUS OK"),
    (ram::FLAGS2, flags2::TIMEOUT, "NOVOBUS timeout"),
    (ram::PS_STATUS, ps_status::NEGATIVE, "negative"),
    (ram::PS_STATUS, ps_status::CALCULATE, "calculate"),
    (ram::PS_STATUS, ps_status::CALCULATED, "calculated"),
    (ram::PS_STATUS, ps_status::START, "start"),
    (
        ram::PS_STATUS,
        ps_status::CONSTANT,
        "acceleration and constant drive",
    ),
    (ram::PS_STATUS, ps_status::BRAKING, "braking"),
    (ram::PS_STATUS, ps_status::TARGET_BRAKING, "target braking"),
    (ram::PS_STATUS, ps_status::FINISHED, "finished"),
    (ram::SCOPE_STATUS, scope_status::STOPPED, "stopped"),
    (ram::SCOPE_STATUS, scope_status::TRIGGERED, "triggered"),
    (ram::SCOPE_STATUS, scope_status::ARMED, "trigger status"),
    (ram::SCOPE_STATUS, scope_status::POSITIVE, "positive flank"),
];

/// The names of the bits that are set in `byte`, the content of the cell at `address`; the highest first.
pub fn set_in(address: u16, byte: u8) -> impl Iterator<Item = &'static str> {
    let names = NAMES.iter();
    let set = names.filter(move |(cell, bits, _)| *cell == address && byte & bits != 0);
    set.map(|(_, _, name)| *name)
}
