//! What the manual does not say of the drive behind the bus, as named properties with a default each.

use harness_proto::nd21::units::Device;
use harness_proto::time::Span;

/// How an ND21 behaves where the manual does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Nd21Properties {
    /// The type of the device, on which the scales of the currents depend (4.2.2).
    pub device: Device,
    /// `eeprom-read-time`: how long the EEPROM controller reads a byte.
    pub eeprom_read_time: Span,
    /// `eeprom-write-time`: how long it writes one; `ProgParam` writes 32.
    pub eeprom_write_time: Span,
}

impl Default for Nd21Properties {
    fn default() -> Self {
        Self {
            device: Device::Nd5610,
            eeprom_read_time: Span::from_millis(1),
            eeprom_write_time: Span::from_millis(10),
        }
    }
}

/// A property that is a time.
#[derive(Clone, Copy, Debug)]
pub struct TimeProperty {
    /// Its name in scenarios.
    pub name: &'static str,
    /// The section that leaves it open.
    pub section: &'static str,
    /// The longest time that it can be set to.
    pub longest: Span,
    set: fn(&mut Nd21Properties, Span),
}

/// Every property.
pub const PROPERTIES: [TimeProperty; 2] = [
    TimeProperty {
        name: "eeprom-read-time",
        section: "14.10.5.2",
        longest: Span::from_millis(1000),
        set: |properties, time| properties.eeprom_read_time = time,
    },
    TimeProperty {
        name: "eeprom-write-time",
        section: "14.10.5.3",
        longest: Span::from_millis(1000),
        set: |properties, time| properties.eeprom_write_time = time,
    },
];

impl Nd21Properties {
    /// Sets the property `name`; false where there is none of this name or the time is too long.
    pub fn set(&mut self, name: &str, time: Span) -> bool {
        match PROPERTIES.iter().find(|property| property.name == name) {
            Some(property) if time <= property.longest => {
                (property.set)(self, time);
                true
            }
            _ => false,
        }
    }
}
