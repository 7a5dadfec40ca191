//! Which bus: its name, and what kind of line it has.

/// The buses of the product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum BusName {
    /// The ND21's ring.
    Novobus,
    /// UNITEK DS/BAMOCAR on CAN.
    Unitek,
    /// NORDAC vector on PROFIBUS DP.
    Nordac,
}

impl BusName {
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

    /// Whether its drives stand in rings, whose number of drives a scenario takes from its bench.
    pub const fn has_rings(self) -> bool {
        matches!(self, Self::Novobus)
    }

    /// Whether it carries frames.
    pub const fn carries_frames(self) -> bool {
        matches!(self, Self::Unitek)
    }

    /// Whether its stations share a line of octets.
    pub const fn shares_octets(self) -> bool {
        matches!(self, Self::Nordac)
    }
}
