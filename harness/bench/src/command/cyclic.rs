//! The arguments of the commands on slaves with a cyclic master, and the setpoints that they take.

use super::axes::Axes;
use super::drive::{OutputForm, RigArguments, SelectArguments};
use crate::scenario::argument::duration;
use clap::{Args, Subcommand};
use harness_proto::nordac::words::FULL;
use harness_proto::time::Span;

const EXCHANGE_HELP: &str = "\
WORDS are STW=047F, HSW=50% or HSW=20Hz or HSW=2000, PZD3=0000 and PZD4=0000; `then` begins the next step, and what a step does
not name stays. After each step the reply is shown that can show its effect: the second one behind it (NORDAC 3.3).

  drivebench exchange 8 STW=047E then STW=047F HSW=50% --for 2s --move --rig sim:nordac

With --format json: {\"schema\": 1, \"slave\": n, \"exchanges\": [...]}, each with the words that were sent (`stw`, `hsw`, `pzd3`, `pzd4`)
and the `reply`: `zsw`, `state`, `hiw`, `actual`, `pzd3`, `pzd4`. Words are numbers, `state` and `actual` their meaning.";

const START_HELP: &str = "\
With --format json: {\"schema\": 1, \"slaves\": [...]}, each with `slave`, `ppo`, `octets`, `diagnosis`, `master`, and the `reply` as
`exchange` shows it.";

/// Commands on slaves of a bus with a cyclic master. DRIVE is an address: 8, 8..10, all.
#[derive(Debug, Subcommand)]
pub enum CyclicCommand {
    /// Bring slaves into the exchange and show what they are (NORDAC 3, PROFIBUS DP).
    ///
    /// The process words stay 0, so they change nothing. The exchange ends with the command.
    #[command(after_help = START_HELP)]
    Start(StartArguments),
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
    pub const fn rig(&self) -> &RigArguments {
        match self {
            Self::Start(arguments) => &arguments.select.rig,
            Self::Off(arguments) | Self::QuickStop(arguments) => &arguments.rig,
            Self::Exchange(arguments) => &arguments.rig,
            Self::On(arguments) => &arguments.select.rig,
            Self::Acknowledge(arguments) => &arguments.select.rig,
        }
    }

    /// The same, to be changed.
    pub const fn rig_mut(&mut self) -> &mut RigArguments {
        match self {
            Self::Start(arguments) => &mut arguments.select.rig,
            Self::Off(arguments) | Self::QuickStop(arguments) => &mut arguments.rig,
            Self::Exchange(arguments) => &mut arguments.rig,
            Self::On(arguments) => &mut arguments.select.rig,
            Self::Acknowledge(arguments) => &mut arguments.select.rig,
        }
    }
}

/// For `start`.
#[derive(Debug, Args)]
pub struct StartArguments {
    /// The slaves.
    #[command(flatten)]
    pub select: SelectArguments,
    /// Output format.
    #[arg(long, value_enum, value_name = "FORM", default_value_t = OutputForm::Text)]
    pub format: OutputForm,
}

/// For commands that leave a motor on for a time.
#[derive(Clone, Copy, Debug, Args)]
pub struct StayArguments {
    /// How long the last words are exchanged before the reply is shown and the command ends.
    #[arg(long = "for", value_name = "TIME", value_parser = duration, default_value = "0ms")]
    pub length: Span,
    /// Go on exchanging the last words until Ctrl-C, which takes the rig to its safe state. Words of a simulated bench end with the
    /// command.
    #[arg(long, conflicts_with = "length")]
    pub hold: bool,
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
    /// How long.
    #[command(flatten)]
    pub stay: StayArguments,
    /// Output format.
    #[arg(long, value_enum, value_name = "FORM", default_value_t = OutputForm::Text)]
    pub format: OutputForm,
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
    #[arg(long, value_name = "SPEED", default_value = "0%", value_parser = setpoint, allow_hyphen_values = true)]
    pub setpoint: Setpoint,
    /// How long.
    #[command(flatten)]
    pub stay: StayArguments,
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

/// A setpoint as it was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setpoint {
    /// As it travels: 4000h is the maximum frequency.
    Raw(u16),
    /// In 0.1 Hz.
    Tenths(i32),
}

impl Setpoint {
    /// The word, where the maximum frequency (1205) is `maximum` x 0.1 Hz; `None` where it does not fit a word.
    #[must_use]
    pub fn word(self, maximum: i64) -> Option<u16> {
        match self {
            Self::Raw(word) => Some(word),
            Self::Tenths(0) => Some(0),
            Self::Tenths(tenths) => {
                let size = i64::from(tenths.unsigned_abs()) * i64::from(FULL);
                // Half a step is rounded away from 0.
                let raw = (2 * size + maximum).checked_div(2 * maximum)?;
                let signed = raw * i64::from(tenths.signum());
                i16::try_from(signed).ok().map(i16::cast_unsigned)
            }
        }
    }
}

/// Reads one HSW: `50%`, `-20.5Hz`, `2000`.
///
/// # Errors
/// What is wrong and what is expected, in a sentence.
pub fn setpoint(text: &str) -> Result<Setpoint, String> {
    let text = text.trim();
    let wrong = |why: &str| format!("`{text}` is no setpoint: {why}");
    let ends = |unit: &str| {
        let split = text.len().checked_sub(unit.len())?;
        let (number, end) = (text.get(..split)?, text.get(split..)?);
        end.eq_ignore_ascii_case(unit).then_some(number.trim())
    };
    let number = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
    if let Some(number) = ends("%").map(number) {
        let raw = number.map(|percent| (percent * f64::from(FULL) / 100.0).round());
        let fits = raw.filter(|raw| (-32_768.0..=32_767.0).contains(raw));
        return fits
            .map(|raw| Setpoint::Raw((raw as i16).cast_unsigned()))
            .ok_or_else(|| wrong("a number from -200% to 199.99% expected"));
    }
    if let Some(number) = ends("Hz").map(number) {
        let fits = number.filter(|hertz| hertz.abs() <= 2_000.0);
        return fits
            .map(|hertz| Setpoint::Tenths((hertz * 10.0).round() as i32))
            .ok_or_else(|| wrong("a number up to 2000Hz expected"));
    }
    match word(text) {
        Ok(raw) => Ok(Setpoint::Raw(raw)),
        Err(_) => Err(wrong("50%, 20.0Hz or four hexadecimal digits expected")),
    }
}

/// Four hexadecimal digits, with or without `0x`.
///
/// # Errors
/// What is expected, in a sentence.
pub fn word(text: &str) -> Result<u16, String> {
    let digits = text.trim();
    let digits = digits
        .strip_prefix("0x")
        .or_else(|| digits.strip_prefix("0X"))
        .unwrap_or(digits);
    let plain = digits.len() == 4 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    u16::from_str_radix(digits, 16)
        .ok()
        .filter(|_| plain)
        .ok_or_else(|| format!("`{text}` is no word: four hexadecimal digits expected"))
}
