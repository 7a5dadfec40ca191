//! What a run leaves: a record from which everything else follows, and the files that are derived from it.
//!
//! | file | what it holds |
//! |---|---|
//! | `run.jsonl` | the record: a line an event, written at once, so that a killed run keeps what it saw |
//! | `rig.toml` | the rig's file, byte for byte |
//! | `known-profile.toml` | the profile that it names, if it names one |
//! | `scenarios/*.scn` | the scenarios as they were |
//! | `captures/*.json` | what each link carried, in the form of `drivebench trace --format json` |
//! | `junit.xml`, `report.txt` | the verdicts, for programs and for people |
//! | `profile.toml`, `deviations.txt` | of a qualification: what the drives do where the manual leaves it open, and which deviations they have |
//! | `report.html` | all of it as a page with pictures; `drivebench report` makes it again |
//! | `versions.json` | program, system and date |
//! | `SHA256SUMS` | the sums of all of them, written last: where it is missing, the run did not end |
//! | `SHA256SUMS.sig` | a signature of the sums, where `--sign` asked for one |
//!
//! `drivebench schema record` prints the JSON schema of a line of the record.

pub use harness_bench::evidence::*;

mod attempt;
mod cases;
mod derive;
mod earlier;
mod folder;
pub mod fuzz;
mod gather;
mod header;
mod keep;
mod merge;
mod part;
mod qualified;
mod read_parts;
mod reports;
mod rerun;
mod selection;
mod verify;

pub use cases::too_large;
pub use derive::{Derived, derive};
pub use earlier::Earlier;
pub use folder::{AboutRun, Folder, KeptAttempts};
pub use keep::Keep;
pub use merge::{MERGE, Merged, merge, verify_merged};
pub use part::SplitRun;
pub use verify::{Beside, Rejudged, Verified, judge_record, verify};
