//! The four layouts of the process data (NORDAC 3.1, GSD).
//!
//! The table of 3.1 ends PPO2 and PPO4 at PZD4; the GSD configures two words more, which are ignored in requests and 0 in replies (E8).

use super::pkw::Pkw;
use crate::profibus::Buffer;
use core::fmt;

/// A PPO type (PNU 1622).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PpoType {
    /// 12 octets: PKW, PZD1, PZD2.
    #[default]
    One,
    /// 20 octets: PKW, PZD1 to PZD6.
    Two,
    /// 4 octets: PZD1, PZD2.
    Three,
    /// 12 octets: PZD1 to PZD6.
    Four,
}

impl PpoType {
    /// Every type.
    pub const ALL: [Self; 4] = [Self::One, Self::Two, Self::Three, Self::Four];

    /// 1 to 4.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Three => 3,
            Self::Four => 4,
        }
    }

    /// The type with this number, 1 to 4.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|ppo| ppo.number() == number)
    }

    /// The value of PNU 1622: 0 to 3 (E7).
    #[must_use]
    pub const fn raw(self) -> u8 {
        self.number() - 1
    }

    /// The type with this value of PNU 1622.
    #[must_use]
    pub fn from_raw(raw: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|ppo| ppo.raw() == raw)
    }

    /// The configuration: what Chk_Cfg must carry, and Get_Cfg replies.
    #[must_use]
    pub const fn cfg(self) -> &'static [u8] {
        match self {
            Self::One => &[0xF3, 0xF1],
            Self::Two => &[0xF3, 0xF5],
            Self::Three => &[0xF1],
            Self::Four => &[0xF5],
        }
    }

    /// The type with this configuration.
    #[must_use]
    pub fn from_cfg(cfg: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|ppo| ppo.cfg() == cfg)
    }

    /// Whether the process data begin with a parameter channel.
    #[must_use]
    pub const fn has_pkw(self) -> bool {
        matches!(self, Self::One | Self::Two)
    }

    /// How many process words follow: 2 or 6.
    #[must_use]
    pub const fn words(self) -> usize {
        match self {
            Self::One | Self::Three => 2,
            Self::Two | Self::Four => 6,
        }
    }

    /// Buffer in each direction.
    #[must_use]
    pub const fn octets(self) -> usize {
        let pkw = if self.has_pkw() { Pkw::LEN } else { 0 };
        pkw + 2 * self.words()
    }

    /// Where the control or status word begins.
    #[must_use]
    pub const fn words_begin(self) -> usize {
        self.octets() - 2 * self.words()
    }

    /// Whether the parameter channel carries double words (NORDAC 3.4.1, footnotes).
    #[must_use]
    pub const fn carries_double_words(self) -> bool {
        matches!(self, Self::Two)
    }
}

impl fmt::Display for PpoType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PPO{}", self.number())
    }
}

/// The process data of one direction. What the type does not carry is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Image {
    /// The parameter channel.
    pub pkw: Pkw,
    /// STW or ZSW, HSW or HIW, PZD3 to PZD6.
    pub words: [u16; 6],
}

impl From<Pkw> for Image {
    fn from(pkw: Pkw) -> Self {
        Self {
            pkw,
            ..Self::default()
        }
    }
}

impl Image {
    /// These two process words, STW and HSW or ZSW and HIW; all else is 0.
    #[must_use]
    pub const fn of_words(first: u16, main: u16) -> Self {
        Self {
            pkw: Pkw::of(0, 0, 0, 0),
            words: [first, main, 0, 0, 0, 0],
        }
    }

    /// Reads the data of a Data_Exchange; `None` if it has another length than the type.
    #[must_use]
    pub fn decode(ppo: PpoType, data: &[u8]) -> Option<Self> {
        if data.len() != ppo.octets() {
            return None;
        }
        let (pkw, rest) = data.split_at(ppo.words_begin());
        let mut words = [0; 6];
        for (word, octets) in words.iter_mut().zip(rest.as_chunks().0) {
            *word = u16::from_be_bytes(*octets);
        }
        Some(Self {
            pkw: pkw.try_into().map(Pkw::decode).unwrap_or_default(),
            words,
        })
    }

    /// The data of a Data_Exchange.
    #[must_use]
    pub fn encode(&self, ppo: PpoType) -> Buffer {
        let mut all = Buffer::new();
        if ppo.has_pkw() {
            let _fits = all.extend(&self.pkw.encode());
        }
        for word in &self.words[..ppo.words()] {
            let _fits = all.extend(&word.to_be_bytes());
        }
        all
    }

    /// PZD1: the control word or the status word.
    #[must_use]
    pub const fn first(&self) -> u16 {
        self.words[0]
    }

    /// PZD2: the main setpoint or the main actual value.
    #[must_use]
    pub const fn main(&self) -> u16 {
        self.words[1]
    }

    /// PZD3: the low word of a position.
    #[must_use]
    pub const fn third(&self) -> u16 {
        self.words[2]
    }

    /// PZD4: the second setpoint or actual value 2.
    #[must_use]
    pub const fn fourth(&self) -> u16 {
        self.words[3]
    }
}
