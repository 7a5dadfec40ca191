//! The names of the buses.

/// Which bus.
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
    /// The names in a scenario, in the order of the variants.
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
        Self::NAMES[self as usize].0
    }
}
