//! What the program asks of a bus. The crate of a bus exports one [`Bus`].

use crate::bus_name::BusName;
use crate::campaign::{Campaign, CampaignError};
use crate::capture::live::LiveText;
use crate::capture::{Capture, Carries, JudgeOptions, JudgedCapture, RecordedPlace};
use crate::command::args::CellsArguments;
use crate::command::deviations::DeviationRow;
use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::output::Output;
use crate::command::rig_commands::RigCommands;
use crate::command::sim::SimArguments;
use crate::embed::Embedding;
use crate::link::Capability;
use crate::manual::Manual;
use crate::rig::buses::{PortRow, RigBuses, RingRow};
use crate::scenario::problem::Problems;
use crate::scenario::settled::{BenchSize, Settled};
use crate::scenario::source::Source;
use crate::scenario::syntax::ScenarioHead;
use crate::serve::{ServeEnd, ServeError};
use crate::shown::SegmentReport;
use harness_sim::fuzz::{FuzzTarget, Noting};
use std::path::Path;
use std::sync::Arc;

/// A scenario in the words of every bus, and settled in those of its own; or its mistakes.
pub type FoundScenario = Result<(ScenarioHead, Arc<dyn Settled>), Problems>;

/// How serving ended.
pub type Served = Result<Result<ServeEnd, ServeError>, Failure>;

/// A campaign that was found and read; or what is wrong with it.
pub(crate) type ReadCampaign = Result<Box<dyn Campaign>, CampaignError>;

pub struct Bus {
    pub name: BusName,
    pub manual: Manual,
    /// What its channels carry.
    pub carries: Carries,
    /// The built-in scenario that shows it at work.
    pub example: &'static str,
    /// Reads and settles a scenario.
    pub settle: fn(&Source, BenchSize) -> FoundScenario,
    /// Writes what a scenario says and reads it again, in tests: a panic, if that is another scenario.
    pub comes_back: fn(&Source) -> Result<(), Problems>,
    /// The names of what its drives hold, for completions.
    pub cell_names: fn() -> Vec<String>,
    /// Lists what its drives hold.
    pub cells: fn(&CellsArguments, &mut Output) -> std::io::Result<Exit>,
    /// The deviations of its drives, and those of its master.
    pub deviations: fn() -> [Vec<DeviationRow>; 2],
    /// Its dissector for Wireshark.
    pub dissector: fn() -> String,
    /// Serves simulated drives.
    pub sim: fn(&SimArguments, &'static RigBuses, &mut Output) -> Served,
    /// What a simulated bench of its own can do.
    pub simulates: &'static [Capability],
    /// Text of what a place of a capture carries, while it arrives; with the number of drives where it is known.
    pub live: fn(&RecordedPlace, Option<u8>) -> Box<dyn LiveText>,
    /// How what it carries is shown.
    pub report: &'static dyn SegmentReport,
    /// Judges a capture; or what is missing, in a sentence.
    pub judged: fn(&Capture, &JudgeOptions<'_>) -> Result<JudgedCapture, String>,
    /// A scenario that replays a capture; or what is missing.
    pub replayed: fn(&Capture, &JudgeOptions<'_>) -> Result<String, String>,
    /// Targets whose inputs are bytes or frames of the bus, and what their inputs reach.
    pub fuzz: (&'static [FuzzTarget], &'static [Noting]),
    /// What the commands ask of its rigs; `None` for a bus that has none.
    pub rigs: Option<RigCommands>,
    /// The names of the built-in campaigns, in order.
    pub campaigns: fn() -> Vec<String>,
    /// Reads a campaign: a file that names the bus, or a built-in one by its name. `None` where it is neither.
    pub campaign: fn(&Path) -> Option<ReadCampaign>,
    /// What it lends to other programs in Rust; `None` where this is not built.
    pub embedding: Option<Embedding>,
    /// What the files of rigs ask of its rings; `None` where stations share one line.
    pub rings: Option<RingRow>,
    /// What it has where its stations share one line; `None` for rings.
    pub shared: Option<SharedLine>,
}

/// What the program asks of a bus whose stations share one line.
pub struct SharedLine {
    /// What the files of rigs ask.
    pub port: &'static PortRow,
    /// The file that describes this many drives to other tools.
    pub description: fn(u16) -> String,
}
