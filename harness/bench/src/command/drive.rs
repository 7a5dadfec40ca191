//! The arguments of the commands on a bus.

use super::axes::Axes;
use super::cyclic::CyclicCommand;
use super::drawing::DrawingArguments;
use super::rig_name::RigName;
use super::sim::{SIM_HELP, SimArguments};
use crate::rig::Rig;
use crate::scenario::argument::{duration, number};
use crate::scenario::quantity::{Dimension, Quantity};
use clap::{Args, Subcommand, ValueEnum};
use harness_proto::time::Span;
use std::any::Any;
use std::path::PathBuf;
use std::rc::Rc;

const READ_JSON: &str = "\
With --format json: {\"schema\": 1, \"cells\": [...]}, each cell with `axis`, `name`, `memory` (\"ram\" or
\"eeprom\"), `address` and `raw` (hexadecimal digits), `value` (a number, a text such as \"off\", or null if
the manual gives no meaning), `unit`, `bits` (the names of those that are set) and `section`.";

const INFO_JSON: &str = "\
With --format json: {\"schema\": 1, \"corrected\": n, \"drives\": [...]}, each drive with `axis`,
`serial_number`, `mode`, `error` (null or `code` and `text`), `speed_rpm`, `position_turns`, `cooler_celsius`,
`motor_ohm`, `hours`, `hours_blocked`, `start_up`, `changed` (YYYY-MM-DD) and `ee_version`; a value that the drive
does not report is null.";

const WATCH_FORM: &str = "\
With --format csv the first line names the columns: time_ms, then each cell with its unit, such as `0 nist [rpm]`. A column
marked [hex] holds hexadecimal digits. A value without a meaning in the manual is empty.

--csv, --html and --svg write their files when the time is over and after Ctrl-C; --csv FILE has the lines of --format csv,
whatever is shown. The values of a line are read one after another; its time is when the first one was asked for.";

const TOP_KEYS: &str = "\
Keys: q or Esc quit, x stop a drive or all, / filter by text, e only drives in error, s sort, p pause, c clear messages,
arrows and PgUp/PgDn scroll, ? help. Drives are only read, but for x. Ctrl-C, a signal or a lost port end in the safe state of the rig.";

const SCOPE_JSON: &str = "\
Only the high byte of a cell of two bytes is recorded (14.10.6.1); its value is shown with 00 as the low byte. Two signals are measured in turn (14.10.6.6).

--csv FILE has one line per measurement: time_us, signal (1 or 2), name, raw, value, unit. The time counts from the
trigger, or from the start of the recording if there is no trigger.";

const RECOVER_JSON: &str = "\
With --format json: {\"schema\": 1, \"rings\": [...]}, each ring with `reported` (the drive that spelled out its
address because of a fault, or null), `missed_master` (the drive that did so because no master sent, or null),
`drives` (how many answer, or null) and `still` (the drive that spells out its address now).";

/// Commands on a bus of drives. DRIVE is an axis number: 3, 2:3 in the second ring, 0..2, all.
#[derive(Debug, Subcommand)]
pub enum DriveCommand {
    /// Read cells of drives by name or address.
    #[command(after_help = READ_JSON)]
    Read(ReadArguments),
    /// Write cells of a drive, read them back and show both.
    Write(WriteArguments),
    /// List drives with mode, error, position and temperatures.
    #[command(after_help = INFO_JSON)]
    Info(InfoArguments),
    /// Show the values of cells repeatedly.
    #[command(after_help = WATCH_FORM)]
    Watch(WatchArguments),
    /// Show all drives live: states, errors, traffic.
    #[command(after_help = TOP_KEYS)]
    Top(TopArguments),
    /// Save, load and compare the parameters of a drive.
    #[command(subcommand)]
    Params(ParamsCommand),
    /// Record signals with the drive's oscilloscope and plot them (ND21 14.10.6).
    #[command(after_help = SCOPE_JSON)]
    Scope(ScopeArguments),
    /// Move a drive to a position or reference it: the motor turns (ND21 13.2).
    Position(PositionArguments),
    /// Release drives: their motors may turn (ND21 12.6).
    ///
    /// Takes software stop and software block away. A rig with ports ends the command in its safe state, unless --hold is given.
    Go(MoveArguments),
    /// Stop drives on their ramps: software stop (ND21 12.6).
    ///
    /// Needs no permission.
    Stop(SelectArguments),
    /// Block drives, so that they have no torque: software block (ND21 12.6).
    ///
    /// Needs no permission.
    Block(SelectArguments),
    /// Reset drives; values that are not in the EEPROM are lost (ND21 12.7).
    Reset(MoveArguments),
    /// Confirm the errors of drives (ND21 14.10.1).
    DeleteError(DeleteErrorArguments),
    /// Bring a ring out of the error mode and count its drives (ND21 9.8).
    #[command(after_help = RECOVER_JSON)]
    Recover(RecoverArguments),
    /// On slaves with a cyclic master.
    #[command(flatten)]
    Cyclic(CyclicCommand),
    /// Serve a simulated ring in real time to a master under test.
    #[command(after_help = SIM_HELP)]
    Sim(SimArguments),
}

impl DriveCommand {
    /// The bench of a command; `None` for `sim`, which is one.
    pub const fn rig(&self) -> Option<&RigArguments> {
        Some(match self {
            Self::Read(arguments) => &arguments.rig,
            Self::Write(arguments) => &arguments.rig,
            Self::Info(arguments) => &arguments.rig,
            Self::Watch(arguments) => &arguments.rig,
            Self::Top(arguments) => &arguments.rig,
            Self::Params(ParamsCommand::Save(arguments) | ParamsCommand::Diff(arguments)) => {
                &arguments.rig
            }
            Self::Params(ParamsCommand::Load(arguments)) => &arguments.params.rig,
            Self::Scope(arguments) => &arguments.rig,
            Self::Position(arguments) => &arguments.rig,
            Self::Go(arguments) | Self::Reset(arguments) => &arguments.select.rig,
            Self::Stop(arguments) | Self::Block(arguments) => &arguments.rig,
            Self::DeleteError(arguments) => &arguments.select.rig,
            Self::Recover(arguments) => &arguments.rig,
            Self::Cyclic(command) => command.rig(),
            Self::Sim(_) => return None,
        })
    }

    /// The same, to be changed.
    pub const fn rig_mut(&mut self) -> Option<&mut RigArguments> {
        Some(match self {
            Self::Read(arguments) => &mut arguments.rig,
            Self::Write(arguments) => &mut arguments.rig,
            Self::Info(arguments) => &mut arguments.rig,
            Self::Watch(arguments) => &mut arguments.rig,
            Self::Top(arguments) => &mut arguments.rig,
            Self::Params(ParamsCommand::Save(arguments) | ParamsCommand::Diff(arguments)) => {
                &mut arguments.rig
            }
            Self::Params(ParamsCommand::Load(arguments)) => &mut arguments.params.rig,
            Self::Scope(arguments) => &mut arguments.rig,
            Self::Position(arguments) => &mut arguments.rig,
            Self::Go(arguments) | Self::Reset(arguments) => &mut arguments.select.rig,
            Self::Stop(arguments) | Self::Block(arguments) => &mut arguments.rig,
            Self::DeleteError(arguments) => &mut arguments.select.rig,
            Self::Recover(arguments) => &mut arguments.rig,
            Self::Cyclic(command) => command.rig_mut(),
            Self::Sim(_) => return None,
        })
    }
}

/// Which bench.
#[derive(Clone, Debug, Args)]
pub struct RigArguments {
    /// The rig: a file, a name that `rig list` shows, sim:N for a simulated ring of N drives, sim:N,M for two rings, sim:unitek:N for
    /// UNITEK drives on CAN, or sim:nordac:N for NORDAC inverters on PROFIBUS; by default sim:3.
    #[arg(long, value_name = "RIG")]
    pub rig: Option<RigName>,
    /// Put the rig sim:N into the state that the header of a scenario describes; its steps are ignored. By default the inputs
    /// GPIN3 and GPIN5 of all drives are high.
    #[arg(long, value_name = "FILE")]
    pub setup: Option<PathBuf>,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long = "wait-for-rig", value_name = "TIME", value_parser = duration, default_value = "0ms")]
    pub patience: Span,
    /// The bench of a session, in place of one that is opened for the command: what the bus of its drives holds.
    #[arg(skip)]
    pub held: Option<Rc<dyn Any>>,
    /// The rig of this name, read.
    #[arg(skip)]
    pub found: Option<Rc<Rig>>,
}

/// For commands that change something on drives with ports.
#[derive(Clone, Copy, Debug, Args)]
pub struct HoldArguments {
    /// Leave the drives as they are at the end of the command. Their motors may then turn without supervision. Without --hold a
    /// rig with ports ends a command that changes something in its safe state: stopped, standing and blocked.
    #[arg(long)]
    pub hold: bool,
}

/// Output format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OutputForm {
    /// For people.
    Text,
    /// For tools; the help of the command describes it.
    Json,
}

/// For `read`.
#[derive(Debug, Args)]
pub struct ReadArguments {
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// A cell: its printed name (nist, EE_pole), or an address: FF0C, FF0C:2 for a word, ee:47 in the EEPROM. On NORDAC inverters a
    /// parameter (1205.3, "Accel. time"), a word of the reply (ZSW, HIW, PZD4) or `all`.
    #[arg(value_name = "CELL", required = true)]
    pub cells: Vec<String>,
    /// Output format.
    #[arg(long, value_enum, default_value_t = OutputForm::Text)]
    pub format: OutputForm,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `write`.
#[derive(Debug, Args)]
pub struct WriteArguments {
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// A cell and its value: nsoll=1500rpm, FF08:2=0652, nRampe+=off, EE_pole=06. On NORDAC inverters 1205.3=50.0Hz, "Accel. time" = 5s.
    #[arg(value_name = "CELL=VALUE", required = true)]
    pub values: Vec<String>,
    /// Write even if a motor may turn.
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
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[arg(value_name = "DRIVE", default_value = "all")]
    pub drives: Axes,
    /// Output format.
    #[arg(long, value_enum, default_value_t = OutputForm::Text)]
    pub format: OutputForm,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// The forms of `watch`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WatchForm {
    /// One line per reading; a terminal shows only the last one.
    Text,
    /// Columns for tools.
    Csv,
}

/// For `watch`.
#[derive(Debug, Args)]
pub struct WatchArguments {
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[arg(value_name = "DRIVE")]
    pub drives: Axes,
    /// Cells, as for `read`.
    #[arg(value_name = "CELL", required = true)]
    pub cells: Vec<String>,
    /// Time between two readings.
    #[arg(long, value_name = "TIME", default_value = "100ms", value_parser = duration)]
    pub every: Span,
    /// Total time.
    #[arg(long = "for", value_name = "TIME", default_value = "2s", value_parser = duration)]
    pub length: Span,
    /// Output format.
    #[arg(long, value_enum, default_value_t = WatchForm::Text)]
    pub format: WatchForm,
    /// Also write the columns of `--format csv` into this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Files of curves.
    #[command(flatten)]
    pub drawing: DrawingArguments,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `top`.
#[derive(Debug, Args)]
pub struct TopArguments {
    /// Time between two readings of a drive, if the ring is fast enough.
    #[arg(long, value_name = "TIME", default_value = "500ms", value_parser = duration)]
    pub every: Span,
    /// Print one page as plain text and end. Needs no terminal.
    #[arg(long)]
    pub once: bool,
    /// Show a page in a browser in place of the terminal: HOST:PORT, port 0 for a free one. Its address with a token is printed. The page
    /// only looks on. Drives are read while it is open.
    #[arg(long, value_name = "ADDRESS", conflicts_with = "once")]
    pub web: Option<String>,
    /// Allow --web at an address that other machines can reach.
    #[arg(long, requires = "web")]
    pub allow_remote: bool,
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
    /// Compare a drive with a file; exit code 1 if they differ.
    Diff(ParamsArguments),
}

/// For `params save` and `params diff`.
#[derive(Debug, Args)]
pub struct ParamsArguments {
    /// The drive: 3, or 2:3 in the second ring.
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
    /// Write the parameters. Without --yes the command only shows what would change.
    #[arg(long)]
    pub yes: bool,
    /// Also write into the EEPROM, so that the values outlast a reset (ProgParam, ND21 14.10.5.4).
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
    /// The drive: 3, or 2:3 in the second ring.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// The signal: a cell FFxx.
    #[arg(value_name = "SIGNAL")]
    pub signal1: String,
    /// A second signal.
    #[arg(value_name = "SIGNAL")]
    pub signal2: Option<String>,
    /// The cell whose value starts the recording. Without a trigger the recording starts at once (14.10.6.7).
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
    /// Direction in which the trigger signal passes the threshold.
    #[arg(long, value_enum, default_value_t = Edge::Rising)]
    pub edge: Edge,
    /// The scan period, 108us to 27.648ms; a recording has 256 measurements (14.10.6.2).
    #[arg(long, value_name = "TIME", default_value = "108us", value_parser = time)]
    pub time_base: Quantity,
    /// Start of the recording relative to the trigger; negative for before it (14.10.6.4).
    #[arg(long, value_name = "TIME", default_value = "0ms", value_parser = time, allow_hyphen_values = true)]
    #[arg(requires = "trigger")]
    pub delay: Quantity,
    /// How long to wait for the trigger.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = duration)]
    pub wait: Span,
    /// Write this cell as soon as the recording has started; see `write`.
    #[arg(long, value_name = "CELL=VALUE")]
    pub then: Vec<String>,
    /// Write `--then` even if the motor may turn.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
    /// Also write the measurements into this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Files of curves.
    #[command(flatten)]
    pub drawing: DrawingArguments,
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
    /// The drive: 3, or 2:3 in the second ring.
    #[arg(value_name = "DRIVE")]
    pub drive: Axes,
    /// Target position, such as 10.25turns.
    #[arg(long, value_name = "POSITION", value_parser = angle, allow_hyphen_values = true)]
    pub to: Option<Quantity>,
    /// Distance to move, such as -50deg.
    #[arg(long, value_name = "PATH", value_parser = angle, allow_hyphen_values = true, conflicts_with = "to")]
    pub by: Option<Quantity>,
    /// Do a referencing run first (13.2.1.1).
    #[arg(long)]
    pub reference: bool,
    /// Initialise the positioning controller first, without a run: the present position is the reference (13.2.1.3).
    #[arg(long, conflicts_with = "reference")]
    pub init: bool,
    /// Speed of this movement (`ps_v0`).
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
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[arg(value_name = "DRIVE", required = true)]
    pub drives: Vec<Axes>,
    /// Which bench.
    #[command(flatten)]
    pub rig: RigArguments,
}

/// For `delete-error`.
#[derive(Debug, Args)]
pub struct DeleteErrorArguments {
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
    #[command(flatten)]
    pub select: SelectArguments,
    /// Let the motors turn: a released drive runs again when its error is confirmed. Needed on a rig with ports.
    #[arg(long = "move", visible_alias = "allow-motion")]
    pub leave: bool,
}

/// For `go` and `reset`.
#[derive(Debug, Args)]
pub struct MoveArguments {
    /// The drives: 3, 2:3 in the second ring, 0..2, or all.
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
    /// Output format.
    #[arg(long, value_enum, default_value_t = OutputForm::Text)]
    pub format: OutputForm,
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
