//! The buses: one folder each. Only this file names them all.

pub mod novobus;

pub(crate) use novobus::language::write;
pub(crate) use novobus::{cli as commands, driver, drives, qualify, serve::state_of, twin};

/// What happens to a drive from outside the bus, by the bus that it is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stimulus {
    /// To an ND21.
    Novobus(harness_sim::nd21::Stimulus),
}

/// The buses of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bus {
    /// The ND21's ring.
    Novobus,
    /// UNITEK DS/BAMOCAR on CAN; not built yet.
    Unitek,
    /// NORDAC vector on PROFIBUS DP; not built yet.
    Nordac,
}

impl Bus {
    /// The names in a scenario.
    pub const NAMES: [(&'static str, Self); 3] = [
        ("novobus", Self::Novobus),
        ("unitek", Self::Unitek),
        ("nordac", Self::Nordac),
    ];

    /// The bus of a scenario without a `bus` line.
    pub const DEFAULT: Self = Self::Novobus;

    /// The name in a scenario, and of its folders in `corpora/scenarios` and `snapshots/scenarios`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Novobus => "novobus",
            Self::Unitek => "unitek",
            Self::Nordac => "nordac",
        }
    }

    /// Whether its scenarios can be settled and played.
    #[must_use]
    pub const fn is_built(self) -> bool {
        matches!(self, Self::Novobus)
    }
}
