//! The arguments of the commands on a bus.

use super::axes::Axes;
use super::rig::RigName;
use super::sim::{SIM_HELP, SimArguments};
use crate::scenario::argument::{duration, number};
use crate::scenario::quantity::{Dimension, Quantity};
use clap::{Args, Subcommand, ValueEnum};
use harness_proto::time::Span;
use std::path::PathBuf;

const READ_JSON: &str = "\
With --format json: {\"schema\": 1, \"cells\": [...]}, each cell with `axis`, `name`, `memory` (\"ram\" or
\"eeprom\"), `address` and `raw` (hexadecimal digits), `value` (a number, a text such as \"off\", or null where
the manual gives no meaning), `unit`, `bits` (the names of those that are set) and `section`.";

const INFO_JSON: &str = "\
With --format json: {\"schema\": 1, \"corrected\": n, \"drives\": [...]}, each drive with `axis`,
`serial_number`, `mode`, `error` (null or `code` and `text`), `speed_rpm`, `position_turns`, `cooler_celsius`,
`motor_ohm`, `hours`, `hours_blocked`, `start_up`, `changed` (YYYY-MM-DD) and `ee_version`; what the drive does
not say is null.";

const WATCH_FORM: &str = "\
With --format csv the first line names the columns: time_ms, then the cells with their units; a value that the
manual gives no meaning to is empty.";

const TOP_KEYS: &str = "\
Keys: q or Esc quit, / filter by text, e only drives in error, s sort, p pause, arrows and PgUp/PgDn scroll, ? help.
The drives are only read and stay as they are; Ctrl-C, a signal or a lost port end in the bench's safe state. The terminal is left
as it was.";

const SCOPE_JSON: &str = "\
A cell of two bytes is recorded with its high byte (14.10.6.1), and its value is that of this byte with 00
behind it. Of two signals each measurement is of one, in turn (14.10.6.6).

With --csv FILE a line each measurement: time_us, signal (1 or 2), name, raw, value, unit; the time counts from
the trigger, without one from the beginning.";

const RECOVER_JSON: &str = "\
With --format json: {\"schema\": 1, \"rings\": [...]}, each ring with `reported` (the drive that spelled out its
address, or null), `drives` (how many answer, or null) and `still` (the drive that spells out its address now).";

/// Commands on a bus of drives. DRIVE is an axis number: 3, 2:3 in the second ring, 0..2, all.
#[derive(Debug, Subcommand)]
pub enum DriveCommand {
    /// Read cells of drives by name or address.
    #[command(after_help = READ_JSON)]
    Read(ReadArguments),
    /// Write cells of a drive, read them back and show both.
    Write(WriteArguments),
    /// Show which drives there are and how they are.
    #[command(after_help = INFO_JSON)]
    Info(InfoArguments),
    /// Show the values of cells again and again.
    #[command(after_help = WATCH_FORM)]
    Watch(WatchArguments),
    /// Show all drives live: states, errors, traffic, disturbances.
    #[command(after_help = TOP_KEYS)]
    Top(TopArguments),
    /// Save, load and compare the parameters of a drive.
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Record signals with the drive's oscilloscope and plot them (ND21 14.10.6).
    #[command(after_help = SCOPE_JSON)]
    Scope(ScopeArguments),
    /// Reference a drive or take it to a position (ND21 13.2). The motor turns.
    Position(PositionArguments),
    /// Take the software stop and block away: the motor may turn (ND21 12.6).
    Go(MoveArguments),
    /// Stop drives on their ramps (software stop, ND21 12.6). Never asks.
    Stop(SelectArguments),
    /// Block drives: no torque (software block, ND21 12.6). Never asks.
    Block(SelectArguments),
    /// Reset drives: what is not in their EEPROM is lost (ND21 12.7).
    Reset(MoveArguments),
    /// Confirm the errors of drives (ND21 14.10.1).
    DeleteError(DeleteErrorArguments),
    /// Bring a ring back from the error mode and count its drives (ND21 9.8, 9.3).
    #[command(after_help = RECOVER_JSON)]
    Recover(RecoverArguments),
    /// Serve a simulated bench in real time, so that anyone's master can talk to it.
    #[command(after_help = SIM_HELP)]
    Sim(SimArguments),
}

/// Which bench.
#[derive(Clone, Debug, Args)]
pub struct RigArguments {
    /// The bench: a file, a name that `rig list` shows, sim:N for a simulated ring of N drives (sim:3 where nothing is said),
    /// or sim:N,M for two of them.
    #[arg(long, value_name = "NAME")]
    pub rig: Option<RigName>,
    /// Put the bench sim:N into the state that the header of a scenario describes; its steps are ignored.
    /// Without it all inputs GPIN3 and GPIN5 are high.
    #[arg(long, value_name = "FILE")]
    pub setup: Option<PathBuf>,
    /// How long to wait for a bench that another program holds, such as 30s.
    #[arg(long = "wait-for-rig", value_name = "TIME", value_parser = duration, default_value = "0ms")]
    pub patience: Span,
}

/// For commands that change something on drives with ports.
#[derive(Clone, Copy, Debug, Args)]
pub struct HoldArguments {
    /// Leave the drives as the command leaves them. Without it a bench with ports ends every command that changes
    /// something in its safe state: stopped, standing and blocked. Motors may go on turning without supervision.
    #[arg(long)]
    pub hold: bool,
}

/// In which form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// For people.
    Text,
    /// For tools, described in the help of the command.
    Json,
}

/// For `read`.
#[derive(Debug, Args)]
pub struct ReadArguments {
    /// Which drives.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// A cell: its printed name (nist, EE_pole), or an address: FF0C, FF0C:2 for a word, ee:47 in the EEPROM.
    #[arg(value_name = "CELL", required = true)]
    pub cells: Vec<String>,
    /// In which form.
    #[arg(long, value_enum, default_value_t = Form::Text)]
    pub format: Form,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `write`.
#[derive(Debug, Args)]
pub struct WriteArguments {
    /// Which drives.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// A cell and its value: nsoll=1500rpm, FF08:2=0652, nRampe+=off, EE_pole=06.
    #[arg(value_name = "CELL=VALUE", required = true)]
    pub values: Vec<String>,
    /// Write although it can make a motor turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
    /// What becomes of the drives afterwards.
    #[command(flatten)]
    pub hold: HoldArguments,
}

/// For `info`.
#[derive(Debug, Args)]
pub struct InfoArguments {
    /// Which drives.
    #[arg(value_name = "DRIVE", default_value = "all")]
    pub drives: Axes,
    /// In which form.
    #[arg(long, value_enum, default_value_t = Form::Text)]
    pub format: Form,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// The forms of `watch`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WatchForm {
    /// A line each time, on a terminal always the same line.
    Text,
    /// Columns for tools.
    Csv,
}

/// For `watch`.
#[derive(Debug, Args)]
pub struct WatchArguments {
    /// Which drives.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// Cells, as of `read`.
    #[arg(value_name = "CELL", required = true)]
    pub cells: Vec<String>,
    /// How often.
    #[arg(long, value_name = "TIME", default_value = "100ms", value_parser = duration)]
    pub every: Span,
    /// For how long.
    #[arg(long = "for", value_name = "TIME", default_value = "2s", value_parser = duration)]
    pub length: Span,
    /// In which form.
    #[arg(long, value_enum, default_value_t = WatchForm::Text)]
    pub format: WatchForm,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `top`.
#[derive(Debug, Args)]
pub struct TopArguments {
    /// How often every drive is read, if the ring is fast enough.
    #[arg(long, value_name = "TIME", default_value = "500ms", value_parser = duration)]
    pub every: Span,
    /// Print one page as plain text and end; needs no terminal.
    #[arg(long)]
    pub once: bool,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// The commands of `params`: the parameters FF60-FF7F, and the cells that are loaded from the EEPROM at reset.
#[derive(Debug, Subcommand)]
pub enum ParamsCommand {
    /// Write the parameters of a drive into a file (TOML).
    Save(ParamsArguments),
    /// Write the parameters of a file into a drive.
    Load(LoadArguments),
    /// Compare a drive with a file: exit code 0 where they are equal, 1 where they differ.
    Diff(ParamsArguments),
}

/// For `params save` and `params diff`.
#[derive(Debug, Args)]
pub struct ParamsArguments {
    /// Which drive.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// The file.
    pub file: PathBuf,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `params load`.
#[derive(Debug, Args)]
pub struct LoadArguments {
    /// Drive and file.
    #[command(flatten)]
    pub params: ParamsArguments,
    /// Write; without it, it is only shown what would change.
    #[arg(long)]
    pub yes: bool,
    /// Write into the EEPROM too, so that a reset does not undo it (ProgParam, ND21 14.10.5.4).
    #[arg(long)]
    pub store: bool,
    /// What becomes of the drives afterwards.
    #[command(flatten)]
    pub hold: HoldArguments,
}

/// The flanks of a trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Edge {
    /// The signal rises to the level.
    Rising,
    /// The signal falls to the level.
    Falling,
}

/// For `scope`.
#[derive(Debug, Args)]
pub struct ScopeArguments {
    /// Which drive.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// The signal: a cell FFxx.
    pub signal1: String,
    /// A second signal.
    pub signal2: Option<String>,
    /// The cell whose value starts the recording; without it the recording begins at once (14.10.6.7).
    #[arg(long, value_name = "SIGNAL", requires = "level")]
    pub trigger: Option<String>,
    /// The trigger threshold (14.10.6.3): a number with a unit, or a byte.
    #[arg(
        long,
        value_name = "VALUE",
        requires = "trigger",
        allow_hyphen_values = true
    )]
    pub level: Option<String>,
    /// Which way the trigger signal must pass the threshold.
    #[arg(long, value_enum, default_value_t = Edge::Rising)]
    pub edge: Edge,
    /// The scan period, 108us to 27.648ms: 256 measurements are one recording (14.10.6.2).
    #[arg(long, value_name = "TIME", default_value = "108us", value_parser = time)]
    pub time_base: Quantity,
    /// When the recording begins, counted from the trigger; before it if negative (14.10.6.4).
    #[arg(long, value_name = "TIME", default_value = "0ms", value_parser = time, allow_hyphen_values = true)]
    #[arg(requires = "trigger")]
    pub delay: Quantity,
    /// How long to wait for the trigger.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = duration)]
    pub wait: Span,
    /// Write this as soon as the recording has been started; see `write`.
    #[arg(long, value_name = "CELL=VALUE")]
    pub then: Vec<String>,
    /// Write `--then` although it can make the motor turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// Write the measurements into this file too.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
    /// What becomes of the drives afterwards.
    #[command(flatten)]
    pub hold: HoldArguments,
}

/// For `position`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("what").args(["to", "by", "reference"]).required(true).multiple(true))]
pub struct PositionArguments {
    /// Which drive.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// To this position: 10.25turns.
    #[arg(long, value_name = "POSITION", value_parser = angle, allow_hyphen_values = true)]
    pub to: Option<Quantity>,
    /// By this path: -50deg.
    #[arg(long, value_name = "PATH", value_parser = angle, allow_hyphen_values = true, conflicts_with = "to")]
    pub by: Option<Quantity>,
    /// First a referencing run (13.2.1.1).
    #[arg(long)]
    pub reference: bool,
    /// First initialise the positioning controller where the drive stands, without a run (13.2.1.3).
    #[arg(long, conflicts_with = "reference")]
    pub init: bool,
    /// The first speed (`ps_v0`), for this command only.
    #[arg(long, value_name = "SPEED", value_parser = speed)]
    pub speed: Option<Quantity>,
    /// Let the motor turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
    /// What becomes of the drives afterwards.
    #[command(flatten)]
    pub hold: HoldArguments,
}

/// For `stop` and `block`.
#[derive(Debug, Args)]
pub struct SelectArguments {
    /// Which drives.
    #[arg(value_name = "DRIVE", required = true)]
    pub drives: Vec<Axes>,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `delete-error`.
#[derive(Debug, Args)]
pub struct DeleteErrorArguments {
    /// Which drives.
    #[command(flatten)]
    pub select: SelectArguments,
    /// Let the motors turn: a drive that is released goes on when its error is confirmed. Needed on a bench with ports.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
}

/// For `go` and `reset`.
#[derive(Debug, Args)]
pub struct MoveArguments {
    /// Which drives.
    #[command(flatten)]
    pub select: SelectArguments,
    /// Let the motors turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// What becomes of the drives afterwards.
    #[command(flatten)]
    pub hold: HoldArguments,
}

/// For `recover`.
#[derive(Debug, Args)]
pub struct RecoverArguments {
    /// In which form.
    #[arg(long, value_enum, default_value_t = Form::Text)]
    pub format: Form,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

fn time(text: &str) -> Result<Quantity, String> {
    number(text, Dimension::Time)
}

fn angle(text: &str) -> Result<Quantity, String> {
    number(text, Dimension::Angle)
}

fn speed(text: &str) -> Result<Quantity, String> {
    number(text, Dimension::Speed)
}
