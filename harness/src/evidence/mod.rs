//! What a run leaves: a record from which everything else follows, and the files that are derived from it.
//!
//! | file | what it holds |
//! |---|---|
//! | `run.jsonl` | the record: a line an event, written at once, so that a killed run keeps what it saw |
//! | `rig.toml` | the rig's file with every default filled in |
//! | `scenarios/*.scn` | the scenarios as they were |
//! | `captures/*.json` | what each link carried, in the form of `drivebench trace --format json` |
//! | `junit.xml`, `report.txt` | the verdicts, for programs and for people |
//! | `report.html` | all of it as a page with pictures; `drivebench report` makes it again |
//! | `versions.json` | program, system and date |
//! | `SHA256SUMS` | the sums of all of them, written last: where it is missing, the run did not end |

mod derive;
mod folder;
mod junit;
mod record;
mod verify;

pub use derive::{Derived, derive};
pub use folder::{About, EvidenceError, Folder, Kept, PAGE, RIG};
pub use junit::{Case, junit};
pub use record::{Line, RecordError, Writer, read};
pub use verify::{Finding, Verified, verify};
