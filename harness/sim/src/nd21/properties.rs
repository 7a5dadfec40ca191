//! What the manual does not say of the drive behind the bus, as named properties with a default each.

use super::plant::PlantParameters;
use super::s_ramp::SRampWire;
use harness_proto::nd21::units::DriveType;
use harness_proto::novobus::properties::BusSetting;
use harness_proto::time::Span;

/// How an ND21 behaves where the manual does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nd21Properties {
    /// The type of the device, on which currents depend (4.2.2).
    pub device: DriveType,
    /// The motor and what it turns.
    pub plant: PlantParameters,
    /// `eeprom-read-time`: how long the EEPROM controller reads a byte.
    pub eeprom_read_time: Span,
    /// `eeprom-write-time`: how long it writes one; `ProgParam` writes 32.
    pub eeprom_write_time: Span,
    /// `self-test-time`: how long the reset mode lasts.
    pub self_test_time: Span,
    /// `self-test-bus`: whether the drive answers the bus while it tests itself.
    pub self_test_bus: SelfTestBus,
    /// `ps-calculation-time`: how long the positioning controller calculates.
    pub ps_calculation_time: Span,
    /// `i2t-time`: how long the motor may have its peak current.
    pub i2t_time: Span,
    /// `ps-position`: the format of `ps_positionH` and `ps_positionL`.
    pub ps_position: PsPosition,
    /// `bus-errors`: which errors of the bus block the regulator.
    pub bus_errors: BusErrors,
    /// `s-ramp-wire`: how the points of support come to the drive.
    pub s_ramp_wire: SRampWire,
}

impl Default for Nd21Properties {
    fn default() -> Self {
        Self {
            device: DriveType::Nd5610,
            plant: PlantParameters::default(),
            eeprom_read_time: Span::from_millis(1),
            eeprom_write_time: Span::from_millis(10),
            self_test_time: Span::from_millis(100),
            self_test_bus: SelfTestBus::default(),
            ps_calculation_time: Span::from_millis(10),
            i2t_time: Span::from_millis(2_000),
            ps_position: PsPosition::default(),
            bus_errors: BusErrors::default(),
            s_ramp_wire: SRampWire::default(),
        }
    }
}

/// The format of a target that is written to `ps_positionH` and `ps_positionL`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PsPosition {
    /// `mode-bit`: 1 mode bit and 31 bits of position, as stored positions are (13.1.9).
    #[default]
    ModeBit,
    /// `whole-word`: an absolute position of 32 bits (13.3.2.1).
    WholeWords,
}

/// What a drive does with bytes from the bus while it tests itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SelfTestBus {
    /// `answered`: it answers and forwards them.
    #[default]
    Answered,
    /// `silent`: it does not receive them, so the ring is open.
    Silent,
}

/// Which errors of the bus put the drive itself into the error mode, which blocks the regulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusErrors {
    /// `block`: all of them; 14.11.14 lists them among the error codes.
    #[default]
    Block,
    /// `time-out-only`: only 0508; the others stay in `errorcode` until the next one and let the motor run,
    /// since the driver corrects them (11.5).
    TimeOutOnly,
}

/// A property.
#[derive(Clone, Copy, Debug)]
pub struct Property {
    /// Its name in scenarios.
    pub name: &'static str,
    /// The section that leaves it open.
    pub section: &'static str,
    /// What it is about.
    pub about: &'static str,
    values: Values,
}

/// A word and what it sets.
type Word = (&'static str, fn(&mut Nd21Properties));

/// What a property can be set to.
#[derive(Clone, Copy, Debug)]
enum Values {
    Time(Span, fn(&mut Nd21Properties, Span)),
    Words(&'static [Word]),
}

const fn time(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    longest_ms: u64,
    set: fn(&mut Nd21Properties, Span),
) -> Property {
    Property {
        name,
        section,
        about,
        values: Values::Time(Span::from_millis(longest_ms), set),
    }
}

const fn words(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    words: &'static [Word],
) -> Property {
    Property {
        name,
        section,
        about,
        values: Values::Words(words),
    }
}

/// Every property.
pub const PROPERTIES: [Property; 9] = [
    time(
        "eeprom-read-time",
        "14.10.5.2",
        "how long the EEPROM controller reads a byte",
        1_000,
        |p, t| p.eeprom_read_time = t,
    ),
    time(
        "eeprom-write-time",
        "14.10.5.3",
        "how long it writes a byte",
        1_000,
        |p, t| p.eeprom_write_time = t,
    ),
    time(
        "self-test-time",
        "11.8",
        "how long the reset mode lasts",
        60_000,
        |p, t| p.self_test_time = t,
    ),
    words(
        "self-test-bus",
        "11.8",
        "whether a drive answers the bus while it tests itself",
        &[
            ("answered", |p| p.self_test_bus = SelfTestBus::Answered),
            ("silent", |p| p.self_test_bus = SelfTestBus::Silent),
        ],
    ),
    time(
        "ps-calculation-time",
        "13.3.2.2",
        "how long the positioning controller calculates",
        1_000,
        |p, t| p.ps_calculation_time = t,
    ),
    time(
        "i2t-time",
        "14.4.2",
        "how long the motor may have its peak current",
        60_000,
        |p, t| p.i2t_time = t,
    ),
    words(
        "ps-position",
        "13.3.2.1",
        "the format of ps_positionH and ps_positionL",
        &[
            ("mode-bit", |p| p.ps_position = PsPosition::ModeBit),
            ("whole-word", |p| p.ps_position = PsPosition::WholeWords),
        ],
    ),
    words(
        "bus-errors",
        "11.8",
        "which errors of the bus block the regulator",
        &[
            ("block", |p| p.bus_errors = BusErrors::Block),
            ("time-out-only", |p| p.bus_errors = BusErrors::TimeOutOnly),
        ],
    ),
    words(
        "s-ramp-wire",
        "13.5.3",
        "how the points of support come to the drive",
        &[
            ("none", |p| p.s_ramp_wire = SRampWire::None),
            ("puffer", |p| p.s_ramp_wire = SRampWire::Puffer),
        ],
    ),
];

impl Property {
    /// What it can be set to, in words; the default first where it is a word.
    #[must_use]
    pub fn values(&self) -> String {
        match self.values {
            Values::Time(longest, _) => format!("0ms to {longest}"),
            Values::Words(words) => {
                let words: Vec<_> = words.iter().map(|(word, _)| *word).collect();
                words.join(" or ")
            }
        }
    }

    /// The longest time that it can be set to; `None` where it is a word.
    #[must_use]
    pub const fn longest(&self) -> Option<Span> {
        match self.values {
            Values::Time(longest, _) => Some(longest),
            Values::Words(_) => None,
        }
    }

    /// The words that it can be set to, the default first; none where it is a time.
    pub fn words(&self) -> impl Iterator<Item = &'static str> {
        let words: &[Word] = match self.values {
            Values::Time(..) => &[],
            Values::Words(words) => words,
        };
        words.iter().map(|(word, _)| *word)
    }

    /// Sets it; false where it has no such value.
    pub fn set(&self, properties: &mut Nd21Properties, setting: BusSetting<'_>) -> bool {
        match (self.values, setting) {
            (Values::Time(longest, set), BusSetting::Time(time)) if time <= longest => {
                set(properties, time);
            }
            (Values::Words(words), BusSetting::Word(word)) => {
                let Some((_, set)) = words.iter().find(|(known, _)| *known == word) else {
                    return false;
                };
                set(properties);
            }
            _ => return false,
        }
        true
    }
}

impl Nd21Properties {
    /// Sets the property `name`; false where there is none of this name or it has no such value.
    pub fn set(&mut self, name: &str, setting: BusSetting<'_>) -> bool {
        PROPERTIES
            .iter()
            .find(|property| property.name == name)
            .is_some_and(|property| property.set(self, setting))
    }
}
