//! The options of `fuzz power`.

use clap::Args;

/// For `fuzz power`.
#[derive(Clone, Debug, Args)]
pub struct PowerArguments {
    /// Only deviations with this text in their name.
    pub filter: Option<String>,
    /// Number of seeds per deviation.
    #[arg(long, value_name = "NUMBER", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// Judge complete ND21s with witnesses, as `fuzz run --whole` does. Only for deviations of drives.
    #[arg(long)]
    pub whole: bool,
    /// Number of cases after which a deviation counts as not found.
    #[arg(long, value_name = "NUMBER", default_value_t = 10_000)]
    pub cases: u64,
}
