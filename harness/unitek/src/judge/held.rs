//! What a register can hold after writes that the manual leaves open.

use harness_proto::unitek::{Access, Data, Register, Width};

/// Contents that a register can have, of which more than these are not kept.
const MOST: usize = 8;

/// A possible content: the bits that are known, and which they are.
type Bits = (u32, u32);

/// What a register can hold; `None` where it can be anything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Contents(Option<Vec<Bits>>);

/// Registers that show the plant, inputs or sensors, or that a drive changes by itself (UNITEK 8, dump): they are not compared.
const LIVE: [u8; 54] = [
    0x11, 0x1F, 0x20, 0x22, 0x23, 0x24, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x30, 0x32, 0x33, 0x38, 0x39,
    0x40, 0x41, 0x42, 0x43, 0x45, 0x48, 0x49, 0x4A, 0x4B, 0x5C, 0x5D, 0x5F, 0x61, 0x66, 0x6D, 0x6F,
    0x70, 0x74, 0x7B, 0x8A, 0x8F, 0x91, 0x92, 0x93, 0x95, 0x96, 0x97, 0x9A, 0xA0, 0xA1, 0xA8, 0xA9,
    0xAA, 0xCC, 0xCE, 0xD5, 0xD6, 0xD8,
];

/// Whether a register changes by itself.
pub(super) fn is_live(number: u8) -> bool {
    // Logic inputs and outputs, bus voltage, power and converted inputs: DE to FC but ED, F0, F1, F8 to FA.
    let logic = matches!(number, 0xDE..=0xEC | 0xEE | 0xEF | 0xF2..=0xF7 | 0xFB..=0xFC);
    logic || LIVE.contains(&number)
}

impl Contents {
    pub(super) fn one(raw: u32) -> Self {
        Self(Some(vec![(raw, u32::MAX)]))
    }

    pub(super) const fn any() -> Self {
        Self(None)
    }

    pub(super) fn or(&self, other: &Self) -> Self {
        let (Some(ours), Some(others)) = (&self.0, &other.0) else {
            return Self::any();
        };
        let mut all = ours.clone();
        all.extend(others.iter().filter(|bits| !ours.contains(bits)));
        match all.len() <= MOST {
            true => Self(Some(all)),
            false => Self::any(),
        }
    }

    /// What it can hold after a write; `sure` where the drive has certainly heard it and takes it.
    pub(super) fn written(&self, register: &Register, data: Data, sure: bool) -> Self {
        let new = match (register.width, data) {
            (Width::Bits16, data) => Self::one(data.bits() & 0xFFFF),
            (Width::Bits32, Data::Long(value)) => Self::one(value),
            // Extended, or the upper half stays (`short-write`).
            (Width::Bits32, Data::Short(value)) => {
                let low = u32::from(value);
                let kept = match &self.0 {
                    Some(all) => all
                        .iter()
                        .map(|(raw, mask)| (raw & 0xFFFF_0000 | low, mask | 0xFFFF))
                        .collect(),
                    None => vec![(low, 0xFFFF)],
                };
                Self::one(register.extend(value)).or(&Self(Some(kept)))
            }
        };
        match sure {
            true => new,
            false => self.or(&new),
        }
    }

    /// It may have been set to this as well.
    pub(super) fn may_be(&self, raw: u32) -> Self {
        self.or(&Self::one(raw))
    }

    /// Whether it can read this, as far as `mask` is compared.
    pub(super) fn can_be(&self, raw: u32, mask: u32) -> bool {
        let fits = |(bits, known): &Bits| (bits ^ raw) & known & mask == 0;
        self.0.as_ref().is_none_or(|all| all.iter().any(fits))
    }

    /// What it was known to hold, where that is one thing.
    pub(super) fn sure(&self) -> Option<u32> {
        match self.0.as_deref() {
            Some([(raw, u32::MAX)]) => Some(*raw),
            _ => None,
        }
    }

    /// In words: the contents that are possible.
    pub(super) fn words(&self, width: Width) -> String {
        let digits = width.bits() as usize / 4;
        let one = |(raw, mask): &Bits| match mask {
            0xFFFF => format!("xxxx{:04X}", raw & 0xFFFF),
            _ => format!("{raw:0digits$X}"),
        };
        let all: Vec<_> = self.0.iter().flatten().map(one).collect();
        all.join(" or ")
    }
}

/// Whether a write to a register changes what it holds.
pub(super) fn takes_writes(register: &Register) -> bool {
    matches!(register.access, Access::RW | Access::SP)
}
