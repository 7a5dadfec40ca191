//! The command line.

use super::campaign::ClassName;
use super::capture::CaptureArguments;
use super::extcap::ExtcapArguments;
use super::fuzz::FuzzCommand;
use super::merge::MergeArguments;
use super::plot::PlotArguments;
use super::rig::RigCommand;
use super::shell::ShellArguments;
use crate::bus_name::BusName;
use crate::capture::{NamedLink, UartFormat};
use crate::command::args::{
    CellsArguments, ColourWhen, DeviationsArguments, ShowProgress, TableFormat, duration,
};
use crate::command::drive::DriveCommand;
use crate::command::exit::Exit;
use crate::command::fuzz::promote::PromoteArguments;
use crate::command::fuzz::shrink::ShrinkArguments;
use crate::evidence::Keep;
use crate::partition::Partition;
use crate::rig::rings::ring_size;
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};
use harness_proto::line::Rate;
use std::path::PathBuf;
use std::time::Duration;

/// A test bench and fuzzer for serial servo drives: plays conversations and compares every byte with the manual.
///
/// Without a command it plays all built-in scenarios on simulated drives.
#[derive(Debug, Parser)]
#[command(name = "drivebench", version, after_help = EXAMPLES, after_long_help = after_long_help())]
pub struct Arguments {
    /// The command; `run` by default.
    #[command(subcommand)]
    pub command: Option<ProgramCommand>,
    /// Whether to use colours.
    #[arg(long, global = true, value_enum, default_value_t = ColourWhen::Auto)]
    pub color: ColourWhen,
    /// Whether to show a progress bar on standard error.
    #[arg(long, global = true, value_enum, default_value_t = ShowProgress::Auto)]
    pub progress: ShowProgress,
}

const EXAMPLES: &str = "\
Examples:
  drivebench                                 play all built-in scenarios
  drivebench run --filter 9.7                play those of section 9.7 of the manual
  drivebench run my.scn tests/               play a file and all files of a folder
  drivebench trace 9.7-parity-error          every byte of the manual's example of 100 drives
  drivebench trace my.scn --format svg -o my.svg
                                             a picture of the ring
  drivebench info --rig sim:5                the drives of a simulated ring of five
  drivebench read all nist Status            cells of drives by name
  drivebench fuzz run --deviates 1=writes-ignored
                                             search for a planted fault

Where to go on:
  drivebench help run                        the options of a command
  drivebench list                            the built-in scenarios
  drivebench rig scan                        the serial ports of this machine
  harness/docs/first-run.md                  ten minutes without hardware
  harness/docs/README.md                     the guide";

fn after_long_help() -> String {
    format!("{EXAMPLES}\n\n{}", Exit::HELP)
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum ProgramCommand {
    /// Play scenarios and report which passed.
    Run(RunArguments),
    /// List scenarios with the tables of the manual that they test.
    List(Selection),
    /// Look for mistakes in scenarios without playing them.
    Check(CheckArguments),
    /// Play a scenario and show every byte on every link.
    Trace(TraceArguments),
    /// Judge the drives of a capture, show it, or turn it into a scenario.
    ///
    /// Captures and logs of many programs are read: Wireshark, candump, logic analysers, CAN tools, and what `trace` writes. The guide has the table
    /// (Reports, "Files of other programs"); a file of another kind is named with what to do about it.
    Import(ImportArguments),
    /// Listen to a ring at taps without sending anything, keep what is heard, and judge it.
    ///
    /// The program opens ports read-only and turns echo and flow control off. The kernel raises DTR and RTS at every open: connect the
    /// receiving line of a tap alone.
    Capture(CaptureArguments),
    /// Answer Wireshark, which captures live from taps and simulated rings (extcap).
    Extcap(ExtcapArguments),
    /// Compare two captures or scenarios byte by byte.
    ///
    /// The exit code is 1 if they differ.
    Diff(DiffArguments),
    /// Compare recorded values: draw them over the same times, and tell their steps apart.
    Plot(PlotArguments),
    /// Print the Wireshark dissector for `trace --format pcapng`.
    Dissector {
        /// The bus.
        #[arg(long, value_enum, default_value_t = BusName::DEFAULT)]
        bus: BusName,
    },
    /// Print a DBC file of UNITEK drives on CAN, for tools that decode frames by one.
    ///
    /// Byte 0 of a frame, REGID, selects the signals behind it. Frames may be shorter than a message says: a register of 16 bits has 3 bytes from
    /// the master and 4 bytes from the drive. Let the tool accept that: `cantools decode --no-strict drive.dbc` on the command line, `allow_truncated=True` in
    /// a call of cantools. For a tool that refuses short frames, fill each frame up with zero bytes, to 5 from the master and 6 from the drive.
    Dbc {
        /// How many drives: drive n has the identifiers 200 + n and 180 + n.
        #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=127))]
        drives: u16,
    },
    /// Print the GSD file of NORDAC inverters, which PROFIBUS masters read.
    Gsd,
    /// List the manual's tables with the scenarios that test them, and the errata.
    Manual(ManualArguments),
    /// List the drive's memory cells: address, access, unit, meaning, section.
    Cells(CellsArguments),
    /// Test the drives of a rig against the whole manual and keep the evidence.
    ///
    /// Plays every scenario that the rig can play, finds out what the manual leaves open, names deviations, and keeps the evidence.
    Qualify(QualifyArguments),
    /// Repeat every verdict of an evidence folder from its recorded bytes.
    Verify(VerifyArguments),
    /// Make one folder of evidence of the parts of a run, or add the counts of campaigns.
    ///
    /// Parts of `qualify` become one qualification. The exit code is that of the whole run, or of the whole campaigns. It is 5 if a part is
    /// missing and nothing failed.
    Merge(MergeArguments),
    /// Write the reports of a run again from its evidence folder.
    Report(ReportArguments),
    /// Print a JSON schema (draft 2020-12).
    Schema {
        /// The kind of file.
        of: SchemaName,
    },
    /// Hold a bench and type commands while its bus stays alive; --json is for programs.
    ///
    /// An editor with history and completion at a terminal, or lines of a pipe. Ctrl-C stops what moves. The end of the input, a signal or a
    /// lost port ends in the safe state.
    Shell(ShellArguments),
    /// Search for unknown faults with random conversations.
    Fuzz {
        /// What to do.
        #[command(subcommand)]
        command: FuzzCommand,
    },
    /// Reduce a finding of `fuzz run` to the bytes that matter.
    Shrink(ShrinkArguments),
    /// Turn a finding into a scenario of the repository.
    ///
    /// Writes a scenario, an input of the fuzz targets and a snapshot into a checkout.
    Promote(PromoteArguments),
    /// List, check and lock rigs; find serial ports.
    Rig {
        /// What to do.
        #[command(subcommand)]
        command: RigCommand,
    },
    /// Play a conversation once for every possible fault and count the outcomes.
    Campaign(CampaignArguments),
    /// List the faults that can be planted in a simulated drive.
    Deviations(DeviationsArguments),
    /// Commands on a bus.
    #[command(flatten)]
    Drive(Box<DriveCommand>),
    /// Print a completion script for a shell.
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Print what can stand in place of the last word; completion scripts call it.
    #[command(hide = true)]
    Complete {
        /// The words of the command line behind `drivebench`, up to the cursor.
        words: Vec<String>,
    },
    /// Print the man page (roff), or write one for every command into a folder.
    Man {
        /// An existing folder for the pages.
        folder: Option<PathBuf>,
    },
}

/// Which scenarios.
#[derive(Clone, Debug, Default, Args)]
pub struct Selection {
    /// Files, folders, or names of built-in scenarios; by default all built-in ones.
    #[arg(value_name = "SCENARIO")]
    pub paths: Vec<PathBuf>,
    /// Only scenarios with this text in their name, title or source.
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
}

/// For `run`.
#[derive(Clone, Debug, Default, Args)]
pub struct RunArguments {
    /// Which scenarios.
    #[command(flatten)]
    pub selection: Selection,
    /// Number of drives of the ring, for scenarios that allow it.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size, conflicts_with = "rig")]
    pub ring: Option<u8>,
    /// The rig: sim:N, a file, or a name that `rig list` shows. By default each scenario gets a simulated ring of its own size.
    #[arg(long, value_name = "RIG")]
    pub rig: Option<String>,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, visible_alias = "wait-for-rig", value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
    /// Keep the evidence of a run on a rig in this folder, which must be new or empty. `verify` checks it.
    #[arg(long, value_name = "FOLDER", requires = "rig")]
    pub evidence: Option<PathBuf>,
    /// Sign the evidence with this `ssh-keygen` key; `verify --allowed-signers` checks the signature.
    #[arg(long, value_name = "KEY", requires = "evidence")]
    pub sign: Option<PathBuf>,
    /// The captures in the evidence: all, failed (those of attempts that did not pass), or N (these, and every N-th that passed).
    #[arg(long, value_name = "KEPT", requires = "evidence")]
    pub keep: Option<Keep>,
    /// Play one part of the selected scenarios: slice:M/N takes every N-th, hash:M/N takes them by name. `merge` joins the evidence of the parts.
    #[arg(long, value_name = "PART")]
    pub partition: Option<Partition>,
    /// Play only what did not pass in this folder of evidence, what it did not come to, and what is new. May repeat: a later folder counts.
    #[arg(long, value_name = "FOLDER", requires = "rig")]
    pub rerun: Vec<PathBuf>,
    /// Write the verdicts into this file, as JUnit XML.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Show what scenarios recorded, also if several are played.
    #[arg(long)]
    pub records: bool,
    /// Write the report into this file, as one HTML page.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Let a skipped scenario make the run incomplete (exit code 5).
    #[arg(long)]
    pub require_all: bool,
}

/// For `qualify`.
#[derive(Clone, Debug, Args)]
pub struct QualifyArguments {
    /// Which scenarios.
    #[command(flatten)]
    pub selection: Selection,
    /// The rig: sim:N, a file, or a name that `rig list` shows.
    #[arg(long, value_name = "RIG")]
    pub rig: String,
    /// Let motors turn; the rig's file must allow it too.
    #[arg(long)]
    pub allow_motion: bool,
    /// Also play long soaks of every command, every silence, and every EEPROM cell that `[limits]` permit: several minutes more.
    #[arg(long)]
    pub thorough: bool,
    /// How long to wait if another program holds the rig, such as 30s.
    #[arg(long, visible_alias = "wait-for-rig", value_name = "TIME", value_parser = duration)]
    pub wait: Option<Duration>,
    /// Play one part of the selected scenarios, slice:M/N or hash:M/N, and everything that a qualification plays besides. `merge` makes one
    /// qualification of the parts.
    #[arg(long, value_name = "PART")]
    pub partition: Option<Partition>,
    /// The folder for the evidence, which must be new or empty; by default evidence-RIG-DATE.
    #[arg(long, value_name = "FOLDER")]
    pub evidence: Option<PathBuf>,
    /// Sign the evidence with this `ssh-keygen` key; `verify --allowed-signers` checks the signature.
    #[arg(long, value_name = "KEY")]
    pub sign: Option<PathBuf>,
    /// Write the report into this file, as one HTML page.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Let a skipped scenario make the run incomplete (exit code 5).
    #[arg(long)]
    pub require_all: bool,
}

/// For `verify`.
#[derive(Clone, Debug, Args)]
pub struct VerifyArguments {
    /// The evidence folder.
    pub folder: PathBuf,
    /// Check the signature of the folder against this file of allowed signers (see `ssh-keygen(1)`).
    #[arg(long, value_name = "FILE", requires = "identity")]
    pub allowed_signers: Option<PathBuf>,
    /// The signer, as the file of allowed signers names them.
    #[arg(long, value_name = "ID", requires = "allowed_signers")]
    pub identity: Option<String>,
}

/// For `report`.
#[derive(Clone, Debug, Args)]
#[command(group = ArgGroup::new("form").required(true).multiple(true))]
pub struct ReportArguments {
    /// The folder that `run --evidence`, `qualify` or `fuzz run` wrote.
    pub folder: PathBuf,
    /// Write one HTML page into this file.
    #[arg(long, value_name = "FILE", group = "form")]
    pub html: Option<PathBuf>,
    /// Write the verdicts into this file, as JUnit XML.
    #[arg(long, value_name = "FILE", group = "form")]
    pub junit: Option<PathBuf>,
}

/// For `check`.
#[derive(Clone, Debug, Args)]
pub struct CheckArguments {
    /// Files, folders, or names of built-in scenarios.
    #[arg(value_name = "SCENARIO", required = true)]
    pub files: Vec<PathBuf>,
    /// Number of drives of the ring.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size)]
    pub ring: Option<u8>,
}

/// For `trace`.
#[derive(Clone, Debug, Args)]
pub struct TraceArguments {
    /// A file, or the name of a built-in scenario.
    #[arg(value_name = "SCENARIO")]
    pub file: PathBuf,
    /// Output format.
    #[arg(long, value_enum, default_value_t = TraceFormat::Table)]
    pub format: TraceFormat,
    /// Number of drives of the ring.
    #[arg(long, value_name = "DRIVES", value_parser = ring_size)]
    pub ring: Option<u8>,
    /// How it is shown and where it goes.
    #[command(flatten)]
    pub showing: TraceOutput,
}

/// How a trace is shown, and where it goes.
#[derive(Clone, Debug, Default, Args)]
pub struct TraceOutput {
    /// Only these rows of the table or the picture, counted from 1.
    #[arg(long, value_name = "FIRST..LAST", value_parser = rows)]
    pub rows: Option<Rows>,
    /// Vertical position of a byte in the picture (svg).
    #[arg(long, value_enum, default_value_t = TraceLayout::Index)]
    pub time: TraceLayout,
    /// Write only the lines into a value change dump (vcd); sigrok up to 0.5.2 stops at the first vector.
    #[arg(long)]
    pub lines_only: bool,
    /// Write into this file instead of standard output.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// For `import`.
#[derive(Clone, Debug, Args)]
pub struct ImportArguments {
    /// The capture: pcapng, pcap, what `trace` writes, VCD, Saleae's and sigrok's files, the log of candump, ASC. Files of one capture are joined:
    /// the parts that `capture` has written, or a file for each channel.
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Show the capture in this format instead of comparing it.
    #[arg(long, value_enum, conflicts_with = "scenario")]
    pub format: Option<TraceFormat>,
    /// Print a scenario that replays the capture.
    #[arg(long)]
    pub scenario: bool,
    /// A scenario whose header describes the drives: models, cells, properties. By default the drives are plain memory that holds
    /// the first value that they report for each cell.
    #[arg(long, value_name = "FILE", conflicts_with = "format")]
    pub setup: Option<PathBuf>,
    /// How far the time of a byte, frame or telegram may be off, such as 2ms for a real clock, or 16ms where a computer stamps what a USB
    /// adapter gives it; by default 2 ns.
    #[arg(long, value_name = "TIME", value_parser = duration, conflicts_with = "format")]
    pub tolerance: Option<Duration>,
    /// Judge these slaves or drives of a shared line and no others, such as 8,9; by default those that are no other device's.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub judge: Vec<u8>,
    /// How the file is read.
    #[command(flatten)]
    pub reading: ReadingArguments,
    /// How it is shown and where it goes.
    #[command(flatten)]
    pub showing: TraceOutput,
}

/// For `diff`.
#[derive(Clone, Debug, Args)]
pub struct DiffArguments {
    /// A capture, a scenario's file, or the name of a built-in scenario.
    #[arg(value_name = "A")]
    pub left: PathBuf,
    /// A second one.
    #[arg(value_name = "B")]
    pub right: PathBuf,
    /// Permitted difference of times, such as 2ms; by default 2 ns.
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub tolerance: Option<Duration>,
    /// How the files are read.
    #[command(flatten)]
    pub reading: ReadingArguments,
}

/// What a file with a capture does not say itself.
#[derive(Clone, Debug, Default, Args)]
pub struct ReadingArguments {
    /// Bit rate of the line, if the capture does not state it.
    #[arg(long, value_name = "RATE", value_parser = rate)]
    pub line: Option<Rate>,
    /// A channel of the file is this link: 98->97=CHANNEL, master->99=CHANNEL, 0->master=CHANNEL; on a shared line bus=CHANNEL, master=CHANNEL,
    /// "slave 8=CHANNEL". Without =CHANNEL it is the only channel. May be given several times.
    #[arg(long, value_name = "LINK=CHANNEL")]
    pub link: Vec<NamedLink>,
    /// How levels of a line are decoded, such as "38400 8O1" or "38400 8O1 inverted"; by default, `auto`, the bus's format with the rate and
    /// polarity that fit.
    #[arg(long, value_name = "FORMAT", value_parser = uart)]
    pub uart: Option<UartChoice>,
    /// Samples per second, if a table of samples does not state it.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000_000))]
    pub samples: Option<u64>,
}

/// A format that is given or to be found.
#[derive(Clone, Copy, Debug)]
pub enum UartChoice {
    /// It is found.
    Auto,
    /// It is this.
    Given(UartFormat),
}

fn uart(text: &str) -> Result<UartChoice, String> {
    match text {
        "auto" => Ok(UartChoice::Auto),
        text => text.parse().map(UartChoice::Given),
    }
}

/// For `manual`.
#[derive(Clone, Debug, Args)]
pub struct ManualArguments {
    /// Only entries that no scenario tests yet.
    #[arg(long)]
    pub missing: bool,
    /// Only entries with this text.
    #[arg(long, value_name = "TEXT")]
    pub filter: Option<String>,
}

/// For `campaign`.
#[derive(Clone, Debug, Args)]
pub struct CampaignArguments {
    /// Files, or names of built-in campaigns; by default all built-in ones.
    #[arg(value_name = "CAMPAIGN")]
    pub campaigns: Vec<PathBuf>,
    /// Output format.
    #[arg(long, value_enum, default_value_t = TableFormat::Table)]
    pub format: TableFormat,
    /// Show the cases of this class, one per line.
    #[arg(long, value_name = "CLASS", value_enum)]
    pub only: Option<ClassName>,
    /// Print a scenario that replays this case: on a ring LINK:BYTE:WHAT, such as 98->97:10:0; on CAN and PROFIBUS a name that --format json
    /// lists, such as 3:lost.
    #[arg(long, value_name = "CASE", conflicts_with_all = ["only", "format"])]
    pub case: Option<String>,
    /// Count what two faults do: every pair of the cases of a campaign of single faults.
    #[arg(long, requires = "campaigns", conflicts_with_all = ["only", "case", "html"])]
    pub pairs: bool,
    /// Draw this number of pairs, and play each from the start; show the shares of all pairs with 95 % confidence.
    #[arg(long, value_name = "NUMBER", requires = "pairs", conflicts_with_all = ["partition", "output"], value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub sample: Option<u64>,
    /// Where the drawing starts: the same seed draws the same pairs.
    #[arg(long, value_name = "NUMBER", requires = "sample", default_value_t = 0)]
    pub seed: u32,
    /// Play one part of the cases of each campaign: slice:M/N takes every N-th, hash:M/N takes them by name; with --pairs, all pairs whose
    /// second fault is in the part. `merge` adds the counts of the parts.
    #[arg(long, value_name = "PART", requires = "output", conflicts_with_all = ["case", "html"])]
    pub partition: Option<Partition>,
    /// Write the counts into this file, as JSON.
    #[arg(long, short, value_name = "FILE", conflicts_with = "case")]
    pub output: Option<PathBuf>,
    /// Write the report into this file, as one HTML page.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Number of threads; by default one per core. The outcome does not depend on it.
    #[arg(long, value_name = "NUMBER", value_parser = threads)]
    pub threads: Option<usize>,
}

/// Shells with a completion script.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Shell {
    /// Bash 4 or later.
    Bash,
    /// Zsh.
    Zsh,
    /// Fish.
    Fish,
}

/// What has a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SchemaName {
    /// A line of `run.jsonl`, the record in an evidence folder.
    Record,
    /// A rig's file, as `rig schema`.
    Rig,
    /// A line of `shell --json`, in either direction.
    Session,
}

/// The forms of a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TraceFormat {
    /// The manual's own table for people: one column per drive.
    Table,
    /// JSON for tools; the guide describes it.
    Json,
    /// A picture: drives across, time down, a colour for what each drive did.
    Svg,
    /// The lines bit by bit, for logic analyser programs (sigrok, GTKWave).
    Vcd,
    /// A capture for Wireshark; `drivebench dissector` prints the dissector.
    Pcapng,
    /// One row per byte, or per frame of CAN.
    Csv,
    /// The log of candump: a line per frame of CAN.
    Candump,
}

/// How the rows of a picture are placed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum TraceLayout {
    /// Row n is the n-th byte of each link, as in the manual.
    #[default]
    Index,
    /// Every byte at its time.
    True,
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

pub(crate) fn rate(text: &str) -> Result<Rate, String> {
    let bits = text.parse().ok();
    bits.and_then(Rate::from_bits_per_second)
        .ok_or_else(|| "38400, 19200 or 9600 is expected".to_owned())
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
