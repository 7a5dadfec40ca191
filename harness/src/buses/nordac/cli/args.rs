//! The arguments of the commands that only this bus has.

use super::super::value;
use crate::buses::commands::{Axes, RigArguments, SelectArguments};
use crate::scenario::argument::duration;
use clap::{Args, Subcommand};
use harness_proto::time::Span;

const EXCHANGE_HELP: &str = "\
WORDS are STW=047F, HSW=50% or HSW=20Hz or HSW=2000, PZD3=0000 and PZD4=0000; `then` begins the next step, and what a step does
not name stays. After each step the reply is shown that can show its effect: the second one behind it (NORDAC 3.3).

  drivebench exchange 8 STW=047E then STW=047F HSW=50% --for 2s --move --rig sim:nordac";

/// Commands on slaves of a bus with a cyclic master. DRIVE is an address: 8, 8..10, all.
#[derive(Debug, Subcommand)]
pub enum CyclicCommand {
    /// Bring slaves into the exchange and show what they are (NORDAC 3, PROFIBUS DP).
    ///
    /// The process words stay 0, so they change nothing. The exchange ends with the command.
    Start(SelectArguments),
    /// Exchange process words with a slave and show its replies (NORDAC 3.2).
    #[command(after_help = EXCHANGE_HELP)]
    Exchange(ExchangeArguments),
    /// Switch motors on by 047E and 047F, for a given time (NORDAC 3.3).
    ///
    /// At its end they are switched off on their ramps.
    On(OnArguments),
    /// Switch motors off on their ramps: OFF1, 047E (NORDAC 3.2.1).
    ///
    /// Needs no permission.
    Off(SelectArguments),
    /// Stop motors on the quick-stop ramp: OFF3, 047B (NORDAC 3.2.1).
    ///
    /// They stop within their quick stop time (1615), and their start is disabled. Needs no permission.
    QuickStop(SelectArguments),
    /// Acknowledge faults, with the outputs kept off (NORDAC 3.2.1, bit 7).
    Acknowledge(AcknowledgeArguments),
}

impl CyclicCommand {
    /// The bench of a command.
    pub(crate) const fn rig(&self) -> &RigArguments {
        match self {
            Self::Start(own) | Self::Off(own) | Self::QuickStop(own) => &own.rig,
            Self::Exchange(own) => &own.rig,
            Self::On(own) => &own.select.rig,
            Self::Acknowledge(own) => &own.select.rig,
        }
    }
}

/// For `exchange`.
#[derive(Debug, Args)]
pub struct ExchangeArguments {
    /// The slave: its address.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// The process words of each step.
    #[arg(value_name = "WORDS", required = true)]
    pub words: Vec<String>,
    /// How long the words of the last step are exchanged before the reply is shown.
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "0ms")]
    pub length: Span,
    /// Send words even if a motor may turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `on`.
#[derive(Debug, Args)]
pub struct OnArguments {
    /// The slaves.
    #[command(flatten)]
    pub select: SelectArguments,
    /// The setpoint: 50%, 20Hz, or four hexadecimal digits (4000 is the maximum frequency, 1205).
    #[arg(long, value_name = "SPEED", default_value = "0%", value_parser = value::setpoint, allow_hyphen_values = true)]
    pub setpoint: value::Setpoint,
    /// How long the motors stay on.
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "0ms")]
    pub length: Span,
    /// Let the motors turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
}

/// For `acknowledge`.
#[derive(Debug, Args)]
pub struct AcknowledgeArguments {
    /// The slaves.
    #[command(flatten)]
    pub select: SelectArguments,
    /// Acknowledge even if terminals may start a motor then.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
}
