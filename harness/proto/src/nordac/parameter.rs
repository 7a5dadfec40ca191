//! Parameters: what a number stands for, and how people write it (NORDAC 5, 4.1.3).

use super::pkw::{Index, Pkw};
use super::table::PARAMETERS;
use super::units::Unit;
use core::fmt;

/// A flag of the parameter list (NORDAC 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Flag {
    /// P: depends on the parameter set.
    Set,
    /// O: can be changed while the inverter runs.
    Online,
    /// L: a double word.
    Long,
    /// A: an array.
    Array,
    /// R: read only.
    ReadOnly,
}

impl Flag {
    /// Every flag.
    pub const ALL: [Self; 5] = [
        Self::Set,
        Self::Online,
        Self::Long,
        Self::Array,
        Self::ReadOnly,
    ];

    /// As the manual prints it.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Self::Set => 'P',
            Self::Online => 'O',
            Self::Long => 'L',
            Self::Array => 'A',
            Self::ReadOnly => 'R',
        }
    }
}

/// A limit: a raw number, or the value of another parameter of the same set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Limit {
    /// A raw number.
    Raw(i32),
    /// 1205.
    Fmax,
    /// 1205 with the opposite sign.
    MinusFmax,
    /// 1204.
    Fmin,
    /// 1401.
    Clim1,
    /// 1402.
    Clim2,
}

impl Limit {
    /// The parameter whose value it is; `None` for a raw number.
    #[must_use]
    pub const fn parameter(self) -> Option<u16> {
        match self {
            Self::Raw(_) => None,
            Self::Fmax | Self::MinusFmax => Some(1205),
            Self::Fmin => Some(1204),
            Self::Clim1 => Some(1401),
            Self::Clim2 => Some(1402),
        }
    }

    /// The raw number, where `value` gives the value of a parameter in the set that is meant.
    pub fn resolve(self, value: impl FnOnce(u16) -> i64) -> i64 {
        match (self, self.parameter()) {
            (Self::Raw(raw), _) => raw.into(),
            (Self::MinusFmax, Some(number)) => -value(number),
            (_, Some(number)) => value(number),
            (_, None) => 0,
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Raw(raw) => write!(f, "{raw}"),
            Self::Fmax => f.write_str("the maximum frequency (1205)"),
            Self::MinusFmax => f.write_str("minus the maximum frequency (1205)"),
            Self::Fmin => f.write_str("the minimum frequency (1204)"),
            Self::Clim1 => f.write_str("current limit 1 (1401)"),
            Self::Clim2 => f.write_str("current limit 2 (1402)"),
        }
    }
}

/// The row of each number in [`PARAMETERS`]; behind the last row where a number has none.
static ROWS: [u8; Pkw::LAST_NUMBER as usize + 1] = {
    let mut rows = [u8::MAX; Pkw::LAST_NUMBER as usize + 1];
    let mut row = 0;
    while row < PARAMETERS.len() {
        rows[PARAMETERS[row].number as usize] = row as u8;
        row += 1;
    }
    rows
};

/// One row of the list of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// The number (PNU).
    pub number: u16,
    /// The name as the manual prints it.
    pub name: &'static str,
    /// What the number counts; elements of some arrays have their own, see [`unit_of`](Self::unit_of).
    pub unit: Unit,
    /// The lowest value.
    pub least: Limit,
    /// The highest value.
    pub most: Limit,
    /// The factory setting.
    pub default: i32,
    /// The letters of the flags.
    pub flags: &'static str,
    /// How many sub-indices there are.
    pub count: u8,
    /// The section of the manual.
    pub section: &'static str,
}

impl Parameter {
    /// The parameter with this number.
    #[must_use]
    pub fn of(number: u16) -> Option<&'static Self> {
        let place = ROWS.get(usize::from(number))?;
        PARAMETERS.get(usize::from(*place))
    }

    /// The parameter with this number in decimal, or with this name in capital or small letters.
    ///
    /// # Errors
    /// [`NoParameter`] where there is none.
    pub fn named(text: &str) -> Result<&'static Self, NoParameter> {
        if !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit()) {
            let number = text.parse().ok();
            return number.and_then(Self::of).ok_or(NoParameter::Number);
        }
        let mut all = PARAMETERS.iter();
        all.find(|parameter| parameter.name.eq_ignore_ascii_case(text))
            .ok_or(NoParameter::Name)
    }

    /// Whether the manual prints this flag.
    #[must_use]
    pub const fn has(&self, flag: Flag) -> bool {
        let letters = self.flags.as_bytes();
        let mut index = 0;
        while index < letters.len() {
            if letters[index] == flag.letter() as u8 {
                return true;
            }
            index += 1;
        }
        false
    }

    /// Whether tasks for arrays are allowed: flag A, or more than one sub-index.
    #[must_use]
    pub const fn is_array(&self) -> bool {
        self.count > 1 || self.has(Flag::Array)
    }

    /// How many sets there are: 4 or 1.
    #[must_use]
    pub const fn sets(&self) -> u8 {
        if self.has(Flag::Set) { 4 } else { 1 }
    }

    /// Whether it is there only with the PosiCon option (NORDAC 5.6).
    #[must_use]
    pub const fn needs_posicon(&self) -> bool {
        matches!(self.section.as_bytes(), b"5.6")
    }

    /// Whether its numbers have a sign: a value below 0 is within its limits.
    #[must_use]
    pub const fn is_signed(&self) -> bool {
        matches!(self.least, Limit::MinusFmax) || matches!(self.least, Limit::Raw(..0))
    }

    /// The number that 16 or 32 bits on the wire mean.
    #[must_use]
    pub const fn number_of(&self, raw: u32) -> i64 {
        match (self.has(Flag::Long), self.is_signed()) {
            (true, true) => raw as i32 as i64,
            (true, false) => raw as i64,
            (false, true) => raw as u16 as i16 as i64,
            (false, false) => raw as u16 as i64,
        }
    }

    /// The bits that carry a number on the wire, in the lower 16 or in all 32 bits; `None` if it does not fit.
    #[must_use]
    pub fn raw_of(&self, number: i64) -> Option<u32> {
        let raw = if self.has(Flag::Long) {
            u32::try_from(number).or_else(|_| i32::try_from(number).map(i32::cast_unsigned))
        } else {
            u16::try_from(number)
                .or_else(|_| i16::try_from(number).map(i16::cast_unsigned))
                .map(u32::from)
        };
        raw.ok().filter(|raw| self.number_of(*raw) == number)
    }

    /// The lowest and the highest number, where `value` gives the number of a parameter in the set that is meant.
    pub fn limits(&self, value: impl Fn(u16) -> i64) -> (i64, i64) {
        (self.least.resolve(&value), self.most.resolve(&value))
    }

    /// What an element counts (NORDAC 5.7).
    #[must_use]
    pub fn unit_of(&self, element: u16) -> Unit {
        let units = super::table::ELEMENT_UNITS.iter();
        units
            .filter(|(numbers, _)| numbers.contains(&self.number))
            .find_map(|(_, units)| units.get(usize::from(element)).copied())
            .unwrap_or(self.unit)
    }
}

/// Why a text names no parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoParameter {
    /// There is no parameter with this number.
    Number,
    /// There is no parameter with this name.
    Name,
    /// The parameter does not depend on the set and is no array, so nothing follows its number.
    NoIndex {
        /// The number.
        number: u16,
    },
    /// The set or sub-index is out of range.
    Index {
        /// The number.
        number: u16,
        /// The lowest.
        least: u16,
        /// The highest.
        most: u16,
    },
}

impl fmt::Display for NoParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Number => f.write_str("there is no parameter with this number: the list is chapter 5 of the manual, 1202 to 1825"),
            Self::Name => f.write_str("there is no parameter with this name: give its number, or its name as chapter 5 of the manual prints it"),
            Self::NoIndex { number } => write!(f, "parameter {number} has neither sets nor sub-indices: give {number} alone"),
            Self::Index { number, least, most } => {
                write!(f, "parameter {number} has {} {least} to {most}", index_word(number))
            }
        }
    }
}

impl core::error::Error for NoParameter {}

/// What stands behind the point: a set or a sub-index.
fn index_word(number: u16) -> &'static str {
    match Parameter::of(number) {
        Some(parameter) if parameter.has(Flag::Set) && !parameter.is_array() => "sets",
        _ => "sub-indices",
    }
}

/// A parameter with an element and a set: `1205`, `1205.3` (set 3), `1806.9` (sub-index 9), `1716.5.2` (element 5, set 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterRef {
    /// The parameter.
    pub parameter: &'static Parameter,
    /// The element, counted from 0, and the set, 0 to 3.
    pub index: Index,
}

impl ParameterRef {
    /// Reads a number or a name, and what follows it. Sets count from 1 as the manual does; sub-indices count from 0 as on the wire (E16).
    ///
    /// # Errors
    /// [`NoParameter`] where there is no such parameter, set or sub-index.
    pub fn parse(text: &str) -> Result<Self, NoParameter> {
        if let Ok(parameter) = Parameter::named(text) {
            let index = Index::default();
            return Ok(Self { parameter, index });
        }
        let (head, last) =
            split(text).ok_or_else(|| Parameter::named(text).err().unwrap_or(NoParameter::Name))?;
        if let Ok(parameter) = Parameter::named(head) {
            return Self::with(parameter, &[last]);
        }
        let (name, first) =
            split(head).ok_or_else(|| Parameter::named(head).err().unwrap_or(NoParameter::Name))?;
        Self::with(Parameter::named(name)?, &[first, last])
    }

    fn with(parameter: &'static Parameter, numbers: &[u16]) -> Result<Self, NoParameter> {
        let number = parameter.number;
        let within = |value: u16, least: u16, most: u16| {
            if (least..=most).contains(&value) {
                Ok(value)
            } else {
                Err(NoParameter::Index {
                    number,
                    least,
                    most,
                })
            }
        };
        let last_element = u16::from(parameter.count) - 1;
        let set = |value| within(value, 1, 4).map(|set| (set - 1) as u8);
        let index = match (parameter.has(Flag::Set), parameter.is_array(), numbers) {
            (true, true, &[element, last]) => Index {
                element: within(element, 0, last_element)?,
                set: set(last)?,
            },
            (_, true, &[element]) => Index {
                element: within(element, 0, last_element)?,
                set: 0,
            },
            (true, false, &[value]) => Index {
                element: 0,
                set: set(value)?,
            },
            _ => return Err(NoParameter::NoIndex { number }),
        };
        Ok(Self { parameter, index })
    }

    /// IND of a task.
    #[must_use]
    pub const fn ind(&self) -> u16 {
        self.index.ind(self.parameter)
    }
}

/// The text before the last point, and the number behind it.
fn split(text: &str) -> Option<(&str, u16)> {
    let (head, digits) = text.rsplit_once('.')?;
    let plain = (1..=3).contains(&digits.len()) && digits.bytes().all(|c| c.is_ascii_digit());
    Some((head, plain.then(|| digits.parse().ok())??))
}

/// As [`ParameterRef::parse`] reads it, shortest form.
impl fmt::Display for ParameterRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Index { element, set } = self.index;
        write!(f, "{}", self.parameter.number)?;
        match (self.parameter.is_array(), element, set) {
            (_, 0, 0) => Ok(()),
            (true, _, 0) => write!(f, ".{element}"),
            (true, _, _) => write!(f, ".{element}.{}", set + 1),
            (false, _, _) => write!(f, ".{}", set + 1),
        }
    }
}
