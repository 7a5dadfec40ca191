//! Why a slave refuses what a master sets it up with (EN 2).

use harness_proto::counted::counted;
use harness_proto::nordac::{IDENT, PpoType};
use harness_proto::profibus::dp::SetPrm;
use std::fmt;

/// How many octets of a configuration are kept.
const SHOWN: usize = 8;

/// Why Set_Prm or Chk_Cfg was refused. The diagnosis shows no more than Prm_Fault or Cfg_Fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Set_Prm has fewer than 7 octets.
    Short(usize),
    /// Set_Prm is for a slave with this ident number.
    Ident(u16),
    /// Set_Prm switches the watchdog on with a time of 0.
    Watchdog([u8; 2]),
    /// Set_Prm has this number of octets of user parameters (GSD: User_Prm_Data_Len 0).
    UserData(usize),
    /// Set_Prm or Chk_Cfg comes from a master while another one has locked the slave.
    Locked {
        /// The master that asks.
        asks: u8,
        /// The master that has locked it.
        owner: u8,
        /// Whether it was Chk_Cfg.
        checks: bool,
    },
    /// Chk_Cfg comes before Set_Prm was accepted.
    Early,
    /// Chk_Cfg has a configuration of this many octets, of which these are the first, and the slave is set to this PPO type.
    Configuration([u8; SHOWN], usize, PpoType),
}

impl Refusal {
    /// A configuration is refused by a slave of this PPO type.
    pub(super) fn configuration(octets: &[u8], ppo: PpoType) -> Self {
        let mut first = [0; SHOWN];
        first
            .iter_mut()
            .zip(octets)
            .for_each(|(to, from)| *to = *from);
        Self::Configuration(first, octets.len(), ppo)
    }

    /// Why parameters are refused; `None` for those that a slave accepts that may `ignore` user parameters.
    pub(super) fn of(prm: &SetPrm<'_>, ignore: bool) -> Option<Self> {
        if prm.ident != IDENT {
            Some(Self::Ident(prm.ident))
        } else if prm.watchdog_tens_of_ms() == Some(0) {
            Some(Self::Watchdog(prm.watchdog))
        } else if !prm.user.is_empty() && !ignore {
            Some(Self::UserData(prm.user.len()))
        } else {
            None
        }
    }
}

fn hex(octets: &[u8]) -> String {
    if octets.is_empty() {
        return "empty".to_owned();
    }
    let all: Vec<_> = octets.iter().map(|octet| format!("{octet:02X}")).collect();
    all.join(" ")
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short(octets) => {
                write!(
                    f,
                    "Set_Prm is refused: it has {}, and 7 are the fewest",
                    counted(*octets, "octet")
                )
            }
            Self::Ident(ident) => write!(
                f,
                "Set_Prm is refused: it is for ident number {ident:04X}, and a NORDAC vector has {IDENT:04X}"
            ),
            Self::Watchdog([first, second]) => write!(
                f,
                "Set_Prm is refused: it switches the watchdog on with the factors {first} and {second}, and none may be 0"
            ),
            Self::UserData(octets) => write!(
                f,
                "Set_Prm is refused: it has {} of user parameters, and a NORDAC vector takes none",
                counted(*octets, "octet")
            ),
            Self::Locked {
                asks,
                owner,
                checks,
            } => write!(
                f,
                "{} of master {asks} is refused: master {owner} has locked the slave",
                if *checks { "Chk_Cfg" } else { "Set_Prm" }
            ),
            Self::Early => f.write_str("Chk_Cfg is refused: the slave waits for Set_Prm"),
            Self::Configuration(octets, length, ppo) => write!(
                f,
                "Chk_Cfg is refused: its configuration is {}, and that of {ppo}, to which the slave is set (1622), is {}",
                hex(&octets[..(*length).min(SHOWN)]),
                hex(ppo.cfg())
            ),
        }
    }
}
