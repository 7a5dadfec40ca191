//! The parameter channel PKW: tasks of the master and answers of the inverter (NORDAC 3.4).

use super::parameter::{Flag, Parameter};
use super::properties::SubindexBits;
use core::fmt;

/// The 8 octets of the parameter channel in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Pkw {
    /// PKE: bits 15 to 12 the task or answer (AK), 11 SPM, 10 to 0 the parameter (PNU).
    pub pke: u16,
    /// IND: the index, in the high octet.
    pub ind: u16,
    /// PWE1 and PWE2; a word stands in PWE2, the lower half.
    pub pwe: u32,
}

impl Pkw {
    /// Buffer of the channel.
    pub const LEN: usize = 8;
    /// The highest number that PKE carries.
    pub const LAST_NUMBER: u16 = 0x07FF;

    /// Any task or answer: AK (its lower four bits), PNU (its lower eleven), IND, PWE.
    #[must_use]
    pub const fn of(ak: u8, number: u16, ind: u16, pwe: u32) -> Self {
        Self {
            pke: (ak as u16) << 12 | (number & Self::LAST_NUMBER),
            ind,
            pwe,
        }
    }

    /// Reads 8 octets; every combination is a value.
    #[must_use]
    pub const fn decode(octets: [u8; 8]) -> Self {
        let [a, b, c, d, e, f, g, h] = octets;
        Self {
            pke: u16::from_be_bytes([a, b]),
            ind: u16::from_be_bytes([c, d]),
            pwe: u32::from_be_bytes([e, f, g, h]),
        }
    }

    /// The 8 octets.
    #[must_use]
    pub const fn encode(self) -> [u8; 8] {
        let [a, b] = self.pke.to_be_bytes();
        let [c, d] = self.ind.to_be_bytes();
        let [e, f, g, h] = self.pwe.to_be_bytes();
        [a, b, c, d, e, f, g, h]
    }

    /// AK: bits 15 to 12.
    #[must_use]
    pub const fn ak(self) -> u8 {
        (self.pke >> 12) as u8
    }

    /// SPM: bit 11, not supported (NORDAC 3.4.1).
    #[must_use]
    pub const fn spm(self) -> bool {
        self.pke & 0x0800 != 0
    }

    /// PNU: bits 10 to 0.
    #[must_use]
    pub const fn number(self) -> u16 {
        self.pke & Self::LAST_NUMBER
    }

    /// PWE2.
    #[must_use]
    pub const fn low_word(self) -> u16 {
        (self.pwe & 0xFFFF) as u16
    }

    /// PWE1.
    #[must_use]
    pub const fn high_word(self) -> u16 {
        (self.pwe >> 16) as u16
    }

    /// What the master asks for.
    #[must_use]
    pub const fn task(self) -> Task {
        Task::of(self.ak())
    }

    /// What the inverter answers; `None` for an AK that it never sends.
    #[must_use]
    pub fn answer(self) -> Option<Answer> {
        Answer::of(self)
    }
}

/// As the manual writes it: four groups of four digits.
impl fmt::Display for Pkw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { pke, ind, .. } = self;
        write!(
            f,
            "{pke:04X} {ind:04X} {:04X} {:04X}",
            self.high_word(),
            self.low_word()
        )
    }
}

/// The tasks of a master (NORDAC 3.4.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Task {
    /// 0: no task.
    #[default]
    None,
    /// 1: request the value.
    Request,
    /// 2: change the value, a word.
    ChangeWord,
    /// 3: change the value, a double word.
    ChangeDouble,
    /// 4: request a description element.
    RequestDescription,
    /// 5: change a description element.
    ChangeDescription,
    /// 6: request an array value.
    RequestArray,
    /// 7: change an array value, a word.
    ChangeArrayWord,
    /// 8: change an array value, a double word.
    ChangeArrayDouble,
    /// 9: request the number of array elements.
    Elements,
    /// 10 to 15.
    Invalid(u8),
}

impl Task {
    /// The task with this AK (its lower four bits).
    #[must_use]
    pub const fn of(ak: u8) -> Self {
        match ak & 0x0F {
            0 => Self::None,
            1 => Self::Request,
            2 => Self::ChangeWord,
            3 => Self::ChangeDouble,
            4 => Self::RequestDescription,
            5 => Self::ChangeDescription,
            6 => Self::RequestArray,
            7 => Self::ChangeArrayWord,
            8 => Self::ChangeArrayDouble,
            9 => Self::Elements,
            other => Self::Invalid(other),
        }
    }

    /// AK.
    #[must_use]
    pub const fn ak(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Request => 1,
            Self::ChangeWord => 2,
            Self::ChangeDouble => 3,
            Self::RequestDescription => 4,
            Self::ChangeDescription => 5,
            Self::RequestArray => 6,
            Self::ChangeArrayWord => 7,
            Self::ChangeArrayDouble => 8,
            Self::Elements => 9,
            Self::Invalid(ak) => ak & 0x0F,
        }
    }

    /// The task that reads this parameter.
    #[must_use]
    pub const fn read(parameter: &Parameter) -> Self {
        if parameter.is_array() {
            Self::RequestArray
        } else {
            Self::Request
        }
    }

    /// The task that changes this parameter.
    #[must_use]
    pub const fn change(parameter: &Parameter) -> Self {
        match (parameter.is_array(), parameter.has(Flag::Long)) {
            (false, false) => Self::ChangeWord,
            (false, true) => Self::ChangeDouble,
            (true, false) => Self::ChangeArrayWord,
            (true, true) => Self::ChangeArrayDouble,
        }
    }

    /// Whether it changes a value: 2, 3, 7, 8.
    #[must_use]
    pub const fn is_change(self) -> bool {
        matches!(
            self,
            Self::ChangeWord | Self::ChangeDouble | Self::ChangeArrayWord | Self::ChangeArrayDouble
        )
    }

    /// Whether the value that it carries is a double word: 3, 8.
    #[must_use]
    pub const fn is_double(self) -> bool {
        matches!(self, Self::ChangeDouble | Self::ChangeArrayDouble)
    }

    /// Whether it is for arrays only: 6 to 9.
    #[must_use]
    pub const fn is_array(self) -> bool {
        matches!(
            self,
            Self::RequestArray | Self::ChangeArrayWord | Self::ChangeArrayDouble | Self::Elements
        )
    }

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "no task",
            Self::Request => "request value",
            Self::ChangeWord => "change value, word",
            Self::ChangeDouble => "change value, double word",
            Self::RequestDescription => "request description element",
            Self::ChangeDescription => "change description element",
            Self::RequestArray => "request array value",
            Self::ChangeArrayWord => "change array value, word",
            Self::ChangeArrayDouble => "change array value, double word",
            Self::Elements => "request number of elements",
            Self::Invalid(_) => "invalid task",
        }
    }
}

/// What an inverter answers (NORDAC 3.4.1). Answers carry the PNU and the IND of the task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Answer {
    /// 0: no answer.
    #[default]
    None,
    /// 1: the value, a word.
    Word(u16),
    /// 2: the value, a double word.
    Double(u32),
    /// 4: an array value, a word.
    ArrayWord(u16),
    /// 5: an array value, a double word.
    ArrayDouble(u32),
    /// 6: the number of array elements (missing in the printed table, E13).
    Elements(u16),
    /// 7: not executable.
    Error(PkwError),
}

impl Answer {
    /// The value of this parameter, of which `raw` holds 16 or 32 bits.
    #[must_use]
    pub const fn value(parameter: &Parameter, array: bool, raw: u32) -> Self {
        let word = (raw & 0xFFFF) as u16;
        match (array, parameter.has(Flag::Long)) {
            (false, false) => Self::Word(word),
            (false, true) => Self::Double(raw),
            (true, false) => Self::ArrayWord(word),
            (true, true) => Self::ArrayDouble(raw),
        }
    }

    /// AK.
    #[must_use]
    pub const fn ak(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Word(_) => 1,
            Self::Double(_) => 2,
            Self::ArrayWord(_) => 4,
            Self::ArrayDouble(_) => 5,
            Self::Elements(_) => 6,
            Self::Error(_) => 7,
        }
    }

    /// PWE: 0 in the upper half for a word.
    #[must_use]
    pub const fn pwe(self) -> u32 {
        match self {
            Self::None => 0,
            Self::Word(word) | Self::ArrayWord(word) | Self::Elements(word) => word as u32,
            Self::Double(double) | Self::ArrayDouble(double) => double,
            Self::Error(error) => error.code() as u32,
        }
    }

    /// The answer to this task. No answer is 8 octets of 0; SPM is 0.
    #[must_use]
    pub const fn to(self, task: Pkw) -> Pkw {
        match self {
            Self::None => Pkw::of(0, 0, 0, 0),
            _ => Pkw::of(self.ak(), task.number(), task.ind, self.pwe()),
        }
    }

    /// Reads an answer; `None` for an AK that no inverter sends (3, 8 to 15). PWE1 of a word is not read.
    #[must_use]
    pub fn of(pkw: Pkw) -> Option<Self> {
        Some(match pkw.ak() {
            0 => Self::None,
            1 => Self::Word(pkw.low_word()),
            2 => Self::Double(pkw.pwe),
            4 => Self::ArrayWord(pkw.low_word()),
            5 => Self::ArrayDouble(pkw.pwe),
            6 => Self::Elements(pkw.low_word()),
            7 => Self::Error(PkwError::of(pkw.low_word())),
            _ => return None,
        })
    }
}

/// Why a task cannot be executed: the number in PWE2 (NORDAC 3.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PkwError {
    /// 0: illegal parameter number.
    Number,
    /// 1: the value cannot be changed.
    ReadOnly,
    /// 2: a limit is exceeded.
    Limit,
    /// 3: incorrect sub-index.
    Index,
    /// 4: no array.
    NoArray,
    /// 7: the description element cannot be changed.
    Description,
    /// 9: no description data.
    NoDescription,
    /// 201: invalid task element.
    Task,
    /// 202: the internal reply identifier cannot be shown.
    Reply,
    /// A number that this manual does not print.
    Other(u16),
}

impl PkwError {
    /// The errors that the manual prints.
    pub const PRINTED: [Self; 9] = [
        Self::Number,
        Self::ReadOnly,
        Self::Limit,
        Self::Index,
        Self::NoArray,
        Self::Description,
        Self::NoDescription,
        Self::Task,
        Self::Reply,
    ];

    /// The number in PWE2.
    #[must_use]
    pub const fn code(self) -> u16 {
        match self {
            Self::Number => 0,
            Self::ReadOnly => 1,
            Self::Limit => 2,
            Self::Index => 3,
            Self::NoArray => 4,
            Self::Description => 7,
            Self::NoDescription => 9,
            Self::Task => 201,
            Self::Reply => 202,
            Self::Other(code) => code,
        }
    }

    /// The error with this number.
    #[must_use]
    pub fn of(code: u16) -> Self {
        Self::PRINTED
            .into_iter()
            .find(|error| error.code() == code)
            .unwrap_or(Self::Other(code))
    }

    /// As the manual prints it.
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::Number => "illegal parameter number",
            Self::ReadOnly => "value cannot be changed",
            Self::Limit => "limit exceeded",
            Self::Index => "incorrect sub-index",
            Self::NoArray => "no array",
            Self::Description => "description element cannot be changed",
            Self::NoDescription => "no description data",
            Self::Task => "invalid task element",
            Self::Reply => "internal reply identifier cannot be shown",
            Self::Other(_) => "an error that this manual does not print",
        }
    }
}

impl fmt::Display for PkwError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error {}: {}", self.code(), self.about())
    }
}

/// What IND means for a parameter: an element and a set, both counted from 0 (NORDAC 3.4.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Index {
    /// The array element or sub-index; 0 is the first.
    pub element: u16,
    /// The parameter set, 0 to 3 for sets 1 to 4; 0 for a parameter that does not depend on the set.
    pub set: u8,
}

impl Index {
    /// Reads IND. With flag P bits 9 and 8 are the set and 15 to 10 the element; without it 15 to 8 are the sub-index (print: 7 to 15, E15).
    #[must_use]
    pub fn of(parameter: &Parameter, ind: u16, bits: SubindexBits) -> Self {
        match (parameter.has(Flag::Set), bits) {
            (true, _) => Self {
                element: ind >> 10,
                set: (ind >> 8 & 3) as u8,
            },
            (false, SubindexBits::From8) => Self {
                element: ind >> 8,
                set: 0,
            },
            (false, SubindexBits::From7) => Self {
                element: ind >> 7,
                set: 0,
            },
        }
    }

    /// IND with a low octet of 0; bits that have no room are dropped.
    #[must_use]
    pub const fn ind(self, parameter: &Parameter) -> u16 {
        if parameter.has(Flag::Set) {
            self.element << 10 | (self.set as u16 & 3) << 8
        } else {
            self.element << 8
        }
    }
}
