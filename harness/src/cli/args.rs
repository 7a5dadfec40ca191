//! The command line.

use super::campaign::ClassName;
use super::exit::Exit;
use super::fuzz::FuzzCommand;
use super::promote::PromoteArguments;
use super::rig::RigCommand;
use super::shrink::ShrinkArguments;
use crate::buses::commands::DriveCommand;
use crate::file::values::{Time, ValueError};
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use harness_proto::line::Rate;
use std::path::PathBuf;
use std::time::Duration;

/// Plays scripted conversations with serial servo drives and compares every byte with the manual.
///
/// Without a command all built-in scenarios are played on the simulated ring.
#[derive(Debug, Parser)]
#[command(name = "drivebench", version, after_help = EXAMPLES, after_long_help = after_long_help())]
pub struct Arguments {
    /// What to do; `run` where nothing is said.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// When to use colours.
    #[arg(long, global = true, value_enum, default_value_t = When::Auto)]
    pub color: When,
    /// When to show a progress bar (on standard error).
    #[arg(long, global = true, value_enum, default_value_t = Progress::Auto)]
    pub progress: Progress,
}

const EXAMPLES: &str = "\
Examples:
  drivebench                                 play all built-in scenarios
  drivebench run --filter 9.7                play those that pin section 9.7
  drivebench run my-machine.scn tests/       play a file and all files of a folder
  drivebench trace 9.7-parity-error          the 100-axis table of ND21 9.7
  drivebench trace my.scn --format json      every byte on every link, for tools
  drivebench trace my.scn --format svg -o my.svg
                                             a picture of the ring; also vcd, pcapng and csv
  drivebench check my.scn                    look for mistakes, play nothing
  drivebench manual                          which tables of the manual are pinned
  drivebench cells ps_                       the cells of the positioning controller
  drivebench info --rig sim:5                the drives of a bench, here a simulated ring of five
  drivebench read all nist Status            cells of drives by name, with units and bits
  drivebench position 0 --to 10turns --init --move
                                             the motor turns only with --move";

fn after_long_help() -> String {
    format!("{EXAMPLES}\n\n{}", Exit::HELP)
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Play scenarios and say which passed.
    Run(RunArguments),
    /// Show what scenarios there are and which table of the manual each pins.
    List(Selection),
    /// Read a scenario and say what is wrong with it; nothing is played.
    Check(CheckArguments),
    /// Play a scenario and print every byte on every link.
    Trace(TraceArguments),
    /// Read a capture (pcapng, or the JSON of `trace`): judge it beside the model, show it, or make a scenario of it.
    Import(ImportArguments),
    /// Compare two captures or scenarios byte by byte, on every link; exit code 1 where they differ.
    Diff(DiffArguments),
    /// Print the dissector that lets Wireshark and tshark read what `trace --format pcapng` writes.
    Dissector,
    /// Show which tables and examples of the manual are pinned, and the errata ledger.
    Manual(ManualArguments),
    /// Show the drive's cells: address, size, access, unit, meaning and section of the manual.
    Cells(CellsArguments),
    /// Play everything that fits a rig, settle what the manual leaves open, name deviations, and keep the evidence.
    Qualify(QualifyArguments),
    /// Judge every verdict of a folder of evidence again, from its record.
    Verify(VerifyArguments),
    /// Make the reports of a run's folder again, from its record and captures: the same bytes as the run wrote.
    Report(ReportArguments),
    /// Print a JSON schema (draft 2020-12).
    Schema {
        /// Of what.
        of: SchemaName,
    },
    /// Look for unknown faults: conversations from a seed, on simulated rings or on a rig.
    Fuzz {
        /// What to do.
        #[command(subcommand)]
        command: FuzzCommand,
    },
    /// Make a finding of `fuzz run` small: what is not needed for it is left out.
    Shrink(ShrinkArguments),
    /// Turn a finding into a scenario, an input of the fuzz targets and a snapshot, in a checkout of the repository.
    Promote(PromoteArguments),
    /// Show benches, lock them, find their ports.
    Rig {
        /// What to do.
        #[command(subcommand)]
        command: RigCommand,
    },
    /// Play a conversation again and again, each time with another fault, and count what comes of it.
    Campaign(CampaignArguments),
    /// Show the ways in which a simulated drive can deviate from the manual.
    Deviations(DeviationsArguments),
    /// Commands on a bus.
    #[command(flatten)]
    Drive(Box<DriveCommand>),
    /// Print a completion script for a shell.
    Completions {
        /// For which shell.
        shell: Shell,
    },
    /// Print the man page (roff), or write one for every command into a folder.
    Man {
        /// The folder; it must be there.
        folder: Option<PathBuf>,
    },
}

/// Which scenarios.
#[derive(Clone, Debug, Default, Args)]
pub struct Selection {
    /// Files, folders, or names of built-in scenarios; all built-in ones where none is given.
    #[arg(value_name = "FILE|FOLDER")]
    pub paths: Vec<PathBuf>,
    /// Only those with this text in their name, title or source.
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
}

/// For `run`.
#[derive(Clone, Debug, Default, Args)]
pub struct RunArguments {
    /// Which scenarios.
    #[command(flatten)]
    pub selection: Selection,
    /// Play on a ring of this many drives, where a scenario allows it.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size, conflicts_with = "rig")]
    pub ring: Option<u8>,
    /// On which rig: sim:N, a file, or a name that `rig list` shows; a simulated ring of each scenario's own size where
    /// nothing is said.
    #[arg(long, value_name = "NAME")]
    pub rig: Option<String>,
    /// Let motors turn, where the rig's file allows it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait for a rig that another program holds, such as 30s.
    #[arg(long, visible_alias = "wait-for-rig", value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
    /// Keep the evidence of a run on a rig in this folder, which is not there or is empty; `verify` judges it again.
    #[arg(long, value_name = "FOLDER", requires = "rig")]
    pub evidence: Option<PathBuf>,
    /// Sign the evidence with this key of `ssh-keygen`; `verify --allowed-signers` checks the signature.
    #[arg(long, value_name = "KEY", requires = "evidence")]
    pub sign: Option<PathBuf>,
    /// Write the verdicts into this file too, as JUnit's XML.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Show what scenarios recorded, also where several are played.
    #[arg(long)]
    pub records: bool,
    /// Write the report as one page of HTML into this file, which is there whole or not at all.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Count a skipped scenario as missing (exit code 5).
    #[arg(long)]
    pub require_all: bool,
}

/// For `qualify`.
#[derive(Clone, Debug, Args)]
pub struct QualifyArguments {
    /// Which scenarios; all that fit where none is given.
    #[command(flatten)]
    pub selection: Selection,
    /// On which rig: sim:N, a file, or a name that `rig list` shows.
    #[arg(long, value_name = "NAME")]
    pub rig: String,
    /// Let motors turn, where the rig's file allows it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait for a rig that another program holds, such as 30s.
    #[arg(long, visible_alias = "wait-for-rig", value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
    /// Where the evidence goes: a folder that is not there or is empty; evidence-RIG-DATE where nothing is said.
    #[arg(long, value_name = "FOLDER")]
    pub evidence: Option<PathBuf>,
    /// Sign the evidence with this key of `ssh-keygen`; `verify --allowed-signers` checks the signature.
    #[arg(long, value_name = "KEY")]
    pub sign: Option<PathBuf>,
    /// Write the report as one page of HTML into this file, which is there whole or not at all.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Count a skipped scenario as missing (exit code 5).
    #[arg(long)]
    pub require_all: bool,
}

/// For `verify`.
#[derive(Clone, Debug, Args)]
pub struct VerifyArguments {
    /// The folder.
    pub folder: PathBuf,
    /// Check the signature of the folder against this file of allowed signers (see `ssh-keygen(1)`).
    #[arg(long, value_name = "FILE", requires = "identity")]
    pub allowed_signers: Option<PathBuf>,
    /// Whose signature it must be, as the file of allowed signers names them.
    #[arg(long, value_name = "ID", requires = "allowed_signers")]
    pub identity: Option<String>,
}

/// For `report`.
#[derive(Clone, Debug, Args)]
#[command(group = ArgGroup::new("form").required(true).multiple(true))]
pub struct ReportArguments {
    /// The folder that `run --evidence`, `qualify` or `fuzz run` has written.
    pub folder: PathBuf,
    /// Write one page of HTML into this file, which is there whole or not at all.
    #[arg(long, value_name = "FILE", group = "form")]
    pub html: Option<PathBuf>,
    /// Write the verdicts as JUnit's XML into this file.
    #[arg(long, value_name = "FILE", group = "form")]
    pub junit: Option<PathBuf>,
}

/// For `check`.
#[derive(Clone, Debug, Args)]
pub struct CheckArguments {
    /// Files, folders, or names of built-in scenarios.
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// For a ring of this many drives.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size)]
    pub ring: Option<u8>,
}

/// For `trace`.
#[derive(Clone, Debug, Args)]
pub struct TraceArguments {
    /// A file, or the name of a built-in scenario.
    pub file: PathBuf,
    /// In which form.
    #[arg(long, value_enum, default_value_t = TraceFormat::Table)]
    pub format: TraceFormat,
    /// Play on a ring of this many drives.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size)]
    pub ring: Option<u8>,
    /// How it is shown and where it goes.
    #[command(flatten)]
    pub showing: Showing,
}

/// How a trace is shown, and where it goes.
#[derive(Clone, Debug, Default, Args)]
pub struct Showing {
    /// Only these rows of the table or the picture, counted from 1.
    #[arg(long, value_name = "FIRST..LAST", value_parser = rows)]
    pub rows: Option<Rows>,
    /// How the picture (svg) is laid out: row n the n-th byte of each link, as in the manual, or every byte at its time.
    #[arg(long, value_enum, default_value_t = Layout::Index)]
    pub time: Layout,
    /// Of a value change dump (vcd) only the lines: sigrok up to 0.5.2 stops at the first vector.
    #[arg(long)]
    pub lines_only: bool,
    /// Write into this file, which is there whole or not at all, in place of standard output.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// For `import`.
#[derive(Clone, Debug, Args)]
pub struct ImportArguments {
    /// The capture: pcapng with one interface a link, named as in 98->97, or the JSON of `trace`.
    pub file: PathBuf,
    /// Show it in this form; nothing is judged then.
    #[arg(long, value_enum, conflicts_with = "scenario")]
    pub format: Option<TraceFormat>,
    /// Print a scenario that plays it again.
    #[arg(long)]
    pub scenario: bool,
    /// A scenario whose header says how the drives are: models, cells, properties. Without one they are plain ones that hold
    /// what they first say of their cells.
    #[arg(long, value_name = "FILE", conflicts_with = "format")]
    pub setup: Option<PathBuf>,
    /// How far times may be apart, such as 2ms: real clocks are not exact; 2 ns where nothing is said.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub tolerance: Option<Duration>,
    /// The rate of the line, where the capture does not say it.
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub line: Option<Rate>,
    /// How it is shown and where it goes.
    #[command(flatten)]
    pub showing: Showing,
}

/// For `diff`.
#[derive(Clone, Debug, Args)]
pub struct DiffArguments {
    /// A capture, a scenario's file, or the name of a built-in scenario.
    #[arg(value_name = "A")]
    pub left: PathBuf,
    /// What it is compared with.
    #[arg(value_name = "B")]
    pub right: PathBuf,
    /// How far times may be apart, such as 2ms; 2 ns where nothing is said.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub tolerance: Option<Duration>,
    /// The rate of the line, where a capture does not say it.
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub line: Option<Rate>,
}

/// For `manual`.
#[derive(Clone, Debug, Args)]
pub struct ManualArguments {
    /// Only what is not pinned yet.
    #[arg(long)]
    pub missing: bool,
    /// Only entries with this text in them.
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
}

/// For `cells`.
#[derive(Clone, Debug, Args)]
pub struct CellsArguments {
    /// Only cells with this text in their name, address or meaning.
    pub filter: Option<String>,
    /// The EEPROM in place of the RAM.
    #[arg(long)]
    pub eeprom: bool,
}

/// For `campaign`.
#[derive(Clone, Debug, Args)]
pub struct CampaignArguments {
    /// Files, or names of built-in campaigns; all built-in ones where none is given.
    #[arg(value_name = "NAME|FILE")]
    pub campaigns: Vec<PathBuf>,
    /// In which form.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
    /// Show the cases of this class, one line each.
    #[arg(long, value_name = "CLASS", value_enum)]
    pub only: Option<ClassName>,
    /// Play nothing but this case, and print the scenario that replays it: LINK:BYTE:WHAT, such as 98->97:10:0.
    #[arg(long, value_name = "CASE", conflicts_with_all = ["only", "format"])]
    pub case: Option<String>,
    /// Write the report as one page of HTML into this file, which is there whole or not at all.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// On how many threads; on all cores where nothing is said. The outcome is the same.
    #[arg(long, value_name = "NUMBER", value_parser = threads)]
    pub threads: Option<usize>,
}

/// For `deviations`.
#[derive(Clone, Debug, Args)]
pub struct DeviationsArguments {
    /// Only those with this text in their name, section or sentence.
    pub filter: Option<String>,
    /// In which form.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    pub format: Format,
}

/// What has a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SchemaName {
    /// A line of the record of a run, `run.jsonl` in a folder of evidence.
    Record,
    /// A bench's file, as `rig schema`.
    Rig,
}

/// The forms of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people; a trace as the manual's own table, one column a drive.
    Table,
    /// JSON for tools, described in the documentation.
    Json,
}

/// The forms of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TraceFormat {
    /// For people: the manual's own table, one column a drive.
    Table,
    /// JSON for tools, described in the documentation.
    Json,
    /// A picture: drives across, time down, colours for what each did.
    Svg,
    /// The lines bit by bit, for logic analysers' programs (sigrok, GTKWave).
    Vcd,
    /// A capture for Wireshark; `drivebench dissector` prints what reads it.
    Pcapng,
    /// A row a byte.
    Csv,
}

/// How the rows of a picture are placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Layout {
    /// Row n is the n-th byte of each link.
    #[default]
    Index,
    /// A byte stands where its time is.
    True,
}

/// When to do something that suits a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum When {
    /// On a terminal (and NO_COLOR is heeded).
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// When to show a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Progress {
    /// On a terminal.
    Auto,
    /// Always.
    Bar,
    /// Never.
    None,
}

/// Rows of a table, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    /// The first.
    pub first: usize,
    /// The last.
    pub last: usize,
}

/// A number of threads.
fn threads(text: &str) -> Result<usize, String> {
    let number = text
        .parse()
        .ok()
        .filter(|number| (1..=256).contains(number));
    number.ok_or_else(|| "1 to 256 expected".to_owned())
}

fn ring_size(text: &str) -> Result<u8, String> {
    let number: u64 = text
        .parse()
        .map_err(|_| "a number of drives is expected, 1 to 250 (ND21 8.4)".to_owned())?;
    harness_proto::novobus::address::RingSize::new(number)
        .map(harness_proto::novobus::address::RingSize::drives)
        .map_err(|error| error.to_string())
}

fn rate(text: &str) -> Result<Rate, String> {
    let bits = text.parse().ok();
    bits.and_then(Rate::from_bits_per_second)
        .ok_or_else(|| "38400, 19200 or 9600 is expected (ND21 8.3)".to_owned())
}
/// What `--wire-time` of the commands of `fuzz` says of itself.
pub(crate) const WIRE_TIME_HELP: &str = "How long the line is used at most, such as 60s; on a rig with ports one minute \
                                         where nothing is said";

/// A time such as `30s`; at most a day.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    const LONGEST: Duration = Duration::from_secs(24 * 3_600);
    let time: Time = text
        .parse()
        .map_err(|error: ValueError| error.to_string())?;
    if time.0 > LONGEST {
        return Err("at most 24 hours (86400s)".to_owned());
    }
    Ok(time.0)
}

fn rows(text: &str) -> Result<Rows, String> {
    let wrong = || "rows are given as FIRST..LAST, counted from 1, such as 1..30".to_owned();
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let rows = Rows {
        first: first.parse().map_err(|_| wrong())?,
        last: last.parse().map_err(|_| wrong())?,
    };
    if rows.first == 0 || rows.last < rows.first {
        return Err(wrong());
    }
    Ok(rows)
}
