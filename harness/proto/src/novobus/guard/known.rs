//! A guard's knowledge of each drive: values that were read, and commands that it has passed since.
//!
//! `max_speed` bounds every speed that is written. A drive also turns at speeds that it holds already: `nsoll` when it is released,
//! `ps_v0` when it positions, `RefV1` and `RefV2` when it searches its reference. Such an order passes when the guard knows the
//! speed that the drive would use. It knows a value in one of two ways:
//!
//! * It was read ([`Guard::learn`](super::Guard::learn)). While `max_speed` holds, only bounded values are written over it, so it
//!   stays bounded until the drive is reset.
//! * It was written by a command that passed. If the command was damaged on its way, the drive is in the error mode and executes
//!   nothing before a check sequence (ND21 9.7), so this knowledge holds until the next doubt.

use super::eeprom::EepromBuffer;
use super::effect::DriveAct;
use super::limits::Limits;
use crate::nd21::bits::{flags2, hw_version, ps_status, sw_version, sw_version2};
use crate::nd21::ram;
use crate::nd21::units::{Ratio, SpeedRange, speed_from_raw};
use core::fmt;

/// Facts about a drive. Each one ensures that an order to it keeps `max_speed`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Facts(u16);

/// For each fact: what is not known without it, and what makes it known.
const TEXTS: &[(Facts, &str, &str)] = &[
    (
        Facts::SOURCE,
        "`SwVersion` (FF62) takes the nominal value from NOVOBUS (bits 1 and 0 = 11, bit 7 = 0; ND21 14.3.1)",
        "it is read when the rig is opened; set it without `max_speed`",
    ),
    (
        Facts::NSOLL,
        "`nsoll` (FF08) is not above it (ND21 14.5.3.1)",
        "write nsoll first",
    ),
    (
        Facts::PS_V0,
        "`ps_v0` (FF4C) is not above it (ND21 13.1.4)",
        "write ps_v0 first",
    ),
    (
        Facts::REF_V1,
        "`RefV1` (FD8C) is not above it (ND21 13.1.4)",
        "write RefV1 first",
    ),
    (
        Facts::REF_V2,
        "`RefV2` (FD8E) is not above it (ND21 13.1.4)",
        "write RefV2 first",
    ),
    (
        Facts::TRAPEZOID,
        "`SwVersion2` (FF63) bit 2 is 1: an S-ramp has speeds of its own (ND21 13.5.2)",
        "it is read when the rig is opened; set it without `max_speed`",
    ),
    (
        Facts::PS_IDLE,
        "`ps_status` (FF43) holds no positioning calculated outside this bench (ND21 13.3.1)",
        "write 00 or 01 to ps_status first",
    ),
    (
        Facts::FLAGS2_IDLE,
        "`Flags2` (FF57) bits 7 to 5 and 3 ask for no run (ND21 14.4.3)",
        "clear them with And 17 first",
    ),
    (
        Facts::NO_SWITCHES,
        "`HwVersion` (FF60) bit 3 is 0: with the cycle control on, a drive that is released steps and positions by its switches (ND21 \
         13.1.8)",
        "it is read when the rig is opened; set it without `max_speed`",
    ),
    (
        Facts::DATA_IN,
        "`DataIn` (FF32) points at nsoll (FF08), as process data are written to the cell to which it points (ND21 14.10.3)",
        "write 08 to DataIn first",
    ),
    (
        Facts::AFTER_RESET,
        "`HwVersion`, `SwVersion` and `SwVersion2` in the EEPROM (20, 22, 23) let the drive stand and keep its range of speeds \
         (ND21 14.2.2)",
        "they are read when a rig that allows resets is opened",
    ),
];

impl Facts {
    /// No fact.
    pub const NONE: Self = Self(0);
    /// The nominal value is that of NOVOBUS, and the reversing test mode is off (ND21 14.3.1).
    pub const SOURCE: Self = Self(1);
    /// `nsoll` is within the limit.
    pub const NSOLL: Self = Self(1 << 1);
    /// `ps_v0` is within the limit.
    pub const PS_V0: Self = Self(1 << 2);
    /// `RefV1` is within the limit.
    pub const REF_V1: Self = Self(1 << 3);
    /// `RefV2` is within the limit.
    pub const REF_V2: Self = Self(1 << 4);
    /// Positionings are trapezoids: the S-ramp is off (ND21 13.5.2).
    pub const TRAPEZOID: Self = Self(1 << 5);
    /// No positioning of another master stands calculated (ND21 13.3.1).
    pub const PS_IDLE: Self = Self(1 << 6);
    /// `Flags2` asks for no run (ND21 14.4.3).
    pub const FLAGS2_IDLE: Self = Self(1 << 7);
    /// Process data are written to `nsoll`, or where the limits let any word be written (ND21 14.10.3).
    pub const DATA_IN: Self = Self(1 << 8);
    /// After a reset the drive stands and waits for a nominal value of the bus (ND21 14.2.2).
    pub const AFTER_RESET: Self = Self(1 << 9);

    /// The cycle control is off (ND21 13.1.8).
    pub const NO_SWITCHES: Self = Self(1 << 10);

    /// What a release needs: the motor turns at once, at what the drive holds (ND21 11.8, 14.10).
    pub(super) const RELEASE: Self = Self(
        Self::SOURCE.0
            | Self::NSOLL.0
            | Self::PS_IDLE.0
            | Self::FLAGS2_IDLE.0
            | Self::NO_SWITCHES.0
            | Self::TRAPEZOID.0,
    );
    /// What a calculation or a start of a positioning needs (ND21 13.3.2).
    pub(super) const POSITIONING: Self = Self(Self::PS_V0.0 | Self::PS_IDLE.0 | Self::TRAPEZOID.0);
    /// What a referencing run needs; its last step positions (ND21 13.1.1).
    pub(super) const REFERENCING: Self =
        Self(Self::REF_V1.0 | Self::REF_V2.0 | Self::POSITIONING.0);
    /// What is known after a reset, if [`Self::AFTER_RESET`] was known before it.
    const BEHIND_RESET: Self = Self(Self::RELEASE.0 | Self::AFTER_RESET.0);

    /// Both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those that are not in `known`.
    #[must_use]
    pub const fn without(self, known: Self) -> Self {
        Self(self.0 & !known.0)
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    const fn when(self, holds: bool) -> Self {
        if holds { self } else { Self::NONE }
    }
}

impl fmt::Display for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unknown = TEXTS.iter().filter(|(fact, ..)| self.contains(*fact));
        for (place, (_, what, remedy)) in unknown.enumerate() {
            let and = if place == 0 { "" } else { "; " };
            write!(f, "{and}that {what}: {remedy}")?;
        }
        Ok(())
    }
}

/// The contents of a drive's cells that say at which speed it would turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// The configuration (ND21 14.3).
    pub configuration: Configuration,
    /// `nsoll` (14.5.3.1).
    pub nsoll: u16,
    /// `ps_v0` (13.1.4).
    pub ps_v0: u16,
    /// `RefV1` and `RefV2` (13.1.4).
    pub ref_speeds: [u16; 2],
    /// `ps_status` (13.3.1).
    pub ps_status: u8,
    /// `Flags2` (14.4.3).
    pub flags2: u8,
    /// `DataIn` (14.10.3).
    pub data_in: u8,
    /// The configuration in the EEPROM; `None` where it was not read.
    pub stored: Option<Configuration>,
}

/// The configuration bytes that say how a drive turns by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configuration {
    /// `HwVersion` (ND21 14.3.3).
    pub hw_version: u8,
    /// `SwVersion` (14.3.1).
    pub sw_version: u8,
    /// `SwVersion2` (14.3.2).
    pub sw_version2: u8,
}

impl Configuration {
    /// The nominal value comes from the bus and the reversing test mode is off (14.3.1).
    const fn waits_for_bus(self) -> bool {
        self.sw_version & sw_version::SOURCE == sw_version::SOURCE_NOVOBUS
            && self.sw_version & sw_version::REVERSING == 0
    }

    /// The cycle control is off (13.1.8).
    const fn no_switches(self) -> bool {
        self.hw_version & hw_version::CYCLE_CONTROL == 0
    }
}

/// What is known of one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct KnownDrive {
    found: Facts,
    written: Facts,
    range: Option<SpeedRange>,
    pub(super) eeprom: EepromBuffer,
}

impl KnownDrive {
    pub(super) fn knows(&self, facts: Facts) -> Facts {
        facts.without(self.found.and(self.written))
    }

    /// The range of speeds; `None` where it was not read.
    pub(super) const fn range(&self) -> Option<SpeedRange> {
        self.range
    }

    /// Takes in values that were read from a drive; earlier knowledge is dropped.
    pub(super) fn learn(&mut self, found: &Found, limits: &Limits) {
        let configuration = found.configuration;
        let range = SpeedRange::from_sw_version2(configuration.sw_version2);
        let slow = |raw: u16| limits.max_speed.is_none_or(|most| within(raw, range, most));
        let unsigned = |raw: u16| raw < 0x8000 && slow(raw);
        let busy = ps_status::CALCULATE
            | ps_status::CALCULATED
            | ps_status::START
            | ps_status::CONSTANT
            | ps_status::BRAKING
            | ps_status::TARGET_BRAKING;
        let stored = found.stored.is_some_and(|stored| {
            stored.waits_for_bus()
                && stored.no_switches()
                && stored.sw_version2 == configuration.sw_version2
        });
        let [first, back] = found.ref_speeds;
        let facts = [
            Facts::SOURCE.when(configuration.waits_for_bus()),
            Facts::NO_SWITCHES.when(configuration.no_switches()),
            Facts::NSOLL.when(slow(found.nsoll)),
            Facts::PS_V0.when(unsigned(found.ps_v0)),
            Facts::REF_V1.when(slow(first)),
            Facts::REF_V2.when(slow(back)),
            Facts::TRAPEZOID.when(configuration.sw_version2 & sw_version2::NO_S_RAMP != 0),
            Facts::PS_IDLE.when(found.ps_status & busy == 0),
            Facts::FLAGS2_IDLE.when(found.flags2 & flags2::ORDERS == 0),
            Facts::AFTER_RESET.when(stored),
        ];
        self.forget();
        self.found = facts.into_iter().fold(Facts::NONE, Facts::and);
        self.range = Some(range);
        self.learn_data_in(found.data_in, limits);
    }

    /// Takes in `DataIn`, which was read.
    pub(super) fn learn_data_in(&mut self, data_in: u8, limits: &Limits) {
        let fact = Facts::DATA_IN.when(DriveAct::WriteByte(ram::DATA_IN, data_in).passes(limits));
        self.found = self.found.without(Facts::DATA_IN).and(fact);
    }

    /// Drops all knowledge. A read of the EEPROM that may be under way is still.
    pub(super) fn forget(&mut self) {
        let eeprom = self.eeprom;
        *self = Self {
            eeprom,
            ..Self::default()
        };
        self.eeprom.forget();
    }

    /// A doubt: what was written may not have been executed.
    pub(super) fn doubt(&mut self) {
        self.written = Facts::NONE;
        self.eeprom.forget();
    }

    /// `ResetH8` (ND21 10.5): the cells are those of the EEPROM, or, where it was not executed, as before.
    pub(super) fn reset(&mut self) {
        self.doubt();
        if self.found.contains(Facts::AFTER_RESET) {
            self.found = Facts(self.found.0 & Facts::BEHIND_RESET.0);
        } else {
            self.forget();
        }
    }

    /// A command has passed that makes these facts true.
    pub(super) fn note(&mut self, facts: Facts) {
        self.written = self.written.and(facts);
    }
}

/// Whether a raw speed is at most this many rpm in either direction (ND21 14.5.3.1).
pub(super) fn within(raw: u16, range: SpeedRange, most: u16) -> bool {
    let rpm = speed_from_raw(raw.cast_signed(), range);
    rpm <= Ratio::whole(most.into()) && rpm >= Ratio::whole(-i32::from(most))
}
