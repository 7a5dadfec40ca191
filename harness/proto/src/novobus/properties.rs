//! What the manual leaves open, as named properties of a drive with a default each.
//!
//! Only real hardware can settle these. Scenarios set them with `drive K property NAME = VALUE`.

use crate::time::Span;
use core::fmt;

/// How a drive behaves where the manual does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Properties {
    /// `empty-short-telegram`: A0 and E0, a short address without net bytes (ND21 9.2).
    pub empty_short_telegram: EmptyShortTelegram,
    /// `short-address`: a short address before any explicit one, after power-up and after a check
    /// sequence (ND21 9.2).
    pub short_address: ShortAddress,
    /// `read-long`: the form of the answer to `ReadLong` (ND21 10.1).
    pub read_long: ReadLongAnswer,
    /// `broken-sequence`: the byte with which a check sequence breaks off (ND21 9.8).
    pub broken_sequence: BrokenSequence,
    /// `time-out`: silence after which a drive with monitoring detects a time-out; 10 to 20 ms
    /// (ND21 9.9, 14.10.2).
    pub time_out: Span,
    /// `time-out-wait`: how long it then waits before it sends zeros; 10 ms (ND21 9.9).
    pub time_out_wait: Span,
    /// `time-out-answer`: what becomes of a byte received during that wait (ND21 9.7 against 9.9).
    pub time_out_answer: TimeOutAnswer,
}

impl Default for Properties {
    fn default() -> Self {
        Self {
            empty_short_telegram: EmptyShortTelegram::default(),
            short_address: ShortAddress::default(),
            read_long: ReadLongAnswer::default(),
            broken_sequence: BrokenSequence::default(),
            time_out: Span::from_millis(10),
            time_out_wait: Span::from_millis(10),
            time_out_answer: TimeOutAnswer::default(),
        }
    }
}

/// What a drive makes of a short telegram without net bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EmptyShortTelegram {
    /// `accepted`: forwarded; E0 still moves on to the next drive.
    #[default]
    Accepted,
    /// `error`: no sync byte (error 0504).
    Error,
}

/// What a drive makes of a short address when it has not yet passed an address byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ShortAddress {
    /// `not-addressed`: no drive is meant until an address byte has been seen.
    #[default]
    NotAddressed,
    /// `kept-sum`: whatever `BusAddr` (FF36) holds is taken.
    KeptSum,
}

/// The answer to `ReadLong`. The print has six bytes, which cannot hold an echo, four data bytes and a
/// checking byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ReadLongAnswer {
    /// `four-data`: `C7 AddrL Data0 Data1 Data2 Data3`, no checking byte.
    #[default]
    FourData,
    /// `as-printed`: `C7 AddrL Data0 Data1 Data3 -Checksum`.
    AsPrinted,
}

/// How the byte that breaks a check sequence off is answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BrokenSequence {
    /// `answered`: like any other byte in the error mode.
    #[default]
    Answered,
    /// `forwarded`: unchanged, like the bytes of the sequence before it.
    Forwarded,
}

/// What a drive does about a byte that it receives between a time-out and its own zeros. By 9.7 a drive
/// in the error mode answers every byte; by 9.9 it waits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TimeOutAnswer {
    /// `answered`: by the rules of the error mode, as at any other time.
    #[default]
    Answered,
    /// `silent`: heard, but not answered.
    Silent,
}

/// What a property can be set to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusSetting<'a> {
    /// One of the property's words.
    Word(&'a str),
    /// A time.
    Time(Span),
}

/// A property as people see it.
#[derive(Clone, Copy, Debug)]
pub struct BusProperty {
    /// Its name in scenarios.
    pub name: &'static str,
    /// What it can be set to; the default comes first.
    pub values: &'static [&'static str],
    /// The section that leaves it open.
    pub section: &'static str,
    /// What it decides.
    pub about: &'static str,
    set: fn(&mut Properties, BusSetting<'_>) -> bool,
}

/// Every property, with its values.
pub const PROPERTIES: [BusProperty; 7] = [
    BusProperty {
        name: "empty-short-telegram",
        values: &["accepted", "error"],
        section: "9.2",
        about: "A0 and E0: a short address without net bytes",
        set: |p, s| {
            choose(
                &mut p.empty_short_telegram,
                s,
                &[
                    ("accepted", EmptyShortTelegram::Accepted),
                    ("error", EmptyShortTelegram::Error),
                ],
            )
        },
    },
    BusProperty {
        name: "short-address",
        values: &["not-addressed", "kept-sum"],
        section: "9.2",
        about: "a short address after power-up or a check sequence, before any address byte",
        set: |p, s| {
            choose(
                &mut p.short_address,
                s,
                &[
                    ("not-addressed", ShortAddress::NotAddressed),
                    ("kept-sum", ShortAddress::KeptSum),
                ],
            )
        },
    },
    BusProperty {
        name: "read-long",
        values: &["four-data", "as-printed"],
        section: "10.1",
        about: "the answer to ReadLong: four data bytes, or Data0 Data1 Data3 and a checking byte",
        set: |p, s| {
            choose(
                &mut p.read_long,
                s,
                &[
                    ("four-data", ReadLongAnswer::FourData),
                    ("as-printed", ReadLongAnswer::AsPrinted),
                ],
            )
        },
    },
    BusProperty {
        name: "broken-sequence",
        values: &["answered", "forwarded"],
        section: "9.8",
        about: "the byte with which a check sequence breaks off",
        set: |p, s| {
            choose(
                &mut p.broken_sequence,
                s,
                &[
                    ("answered", BrokenSequence::Answered),
                    ("forwarded", BrokenSequence::Forwarded),
                ],
            )
        },
    },
    BusProperty {
        name: "time-out",
        values: &["10ms", "10ms..20ms"],
        section: "9.9",
        about: "silence after which a time-out is detected (monitoring on)",
        set: |p, s| match s {
            BusSetting::Time(t) if (Span::from_millis(10)..=Span::from_millis(20)).contains(&t) => {
                p.time_out = t;
                true
            }
            _ => false,
        },
    },
    BusProperty {
        name: "time-out-wait",
        values: &["10ms", "0ms..100ms"],
        section: "9.9",
        about: "further silence before a drive sends zeros unasked",
        set: |p, s| match s {
            BusSetting::Time(t) if t <= Span::from_millis(100) => {
                p.time_out_wait = t;
                true
            }
            _ => false,
        },
    },
    BusProperty {
        name: "time-out-answer",
        values: &["answered", "silent"],
        section: "9.9",
        about: "a byte received between a time-out and the drive's own zeros",
        set: |p, s| {
            choose(
                &mut p.time_out_answer,
                s,
                &[
                    ("answered", TimeOutAnswer::Answered),
                    ("silent", TimeOutAnswer::Silent),
                ],
            )
        },
    },
];

fn choose<T: Copy>(property: &mut T, setting: BusSetting<'_>, choices: &[(&str, T)]) -> bool {
    let BusSetting::Word(word) = setting else {
        return false;
    };
    match choices.iter().find(|(name, _)| *name == word) {
        Some(&(_, value)) => {
            *property = value;
            true
        }
        None => false,
    }
}

impl Properties {
    /// Sets the property `name`.
    ///
    /// # Errors
    /// What is wrong with the name or the value.
    pub fn set(&mut self, name: &str, setting: BusSetting<'_>) -> Result<(), PropertyError> {
        let Some(description) = PROPERTIES.iter().find(|p| p.name == name) else {
            return Err(PropertyError::NoSuchProperty);
        };
        if (description.set)(self, setting) {
            Ok(())
        } else {
            Err(PropertyError::NoSuchValue {
                values: description.values,
            })
        }
    }
}

/// Why a property was not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PropertyError {
    /// There is none of this name.
    NoSuchProperty,
    /// It cannot be set to this.
    NoSuchValue {
        /// What it can be set to.
        values: &'static [&'static str],
    },
}

impl fmt::Display for PropertyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoSuchProperty => f.write_str("no property of this name"),
            Self::NoSuchValue { values } => {
                f.write_str("the property can be ")?;
                for (i, value) in values.iter().enumerate() {
                    if i > 0 {
                        f.write_str(" or ")?;
                    }
                    f.write_str(value)?;
                }
                Ok(())
            }
        }
    }
}

impl core::error::Error for PropertyError {}
