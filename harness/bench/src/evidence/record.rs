//! The lines of a record, and events written as such.

use super::files::sum;
use crate::link::{Capability, LinkEvent, Sink};
use crate::rig::Attempt;
use crate::scenario::run::Outcome;
use crate::scenario::verdict::Verdict;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;

/// The version of the form.
pub const SCHEMA: u32 = 2;

/// A line of a record. Times are in thirds of a nanosecond since the conversation began (a bit at 38400 bit/s is
/// 78125 of them); bytes are hexadecimal; rings are counted from 1.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum RecordLine {
    /// The first line.
    Run {
        /// The version of the form: 2. Records of schema 1 have no looks, no purpose, and no sums of skipped scenarios.
        #[schemars(extend("enum" = [1, 2]))]
        schema: u32,
        /// The program's version.
        drivebench: String,
        /// The rig's id.
        rig: String,
        /// The sum of the rig's file.
        #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
        rig_sha256: String,
        /// When the run began, in UTC.
        started: String,
        /// Bits a second: of a ring, or of a CAN bus.
        #[schemars(extend("enum" = [
            38_400, 19_200, 9_600, 10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 625_000, 800_000, 1_000_000
        ]))]
        rate: u32,
        /// How many drives each ring has.
        #[schemars(length(min = 1, max = 2), inner(range(min = 1, max = 250)))]
        rings: Vec<u8>,
        /// How exactly times were compared.
        tolerance: u64,
        /// Whether the rings are simulated.
        simulated: bool,
        /// What the link could do.
        capabilities: Vec<String>,
        /// Whether drives were reset before each scenario.
        anew: bool,
        /// Whether each scenario was played on simulated rings of its own, as its text describes them.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        own_rings: bool,
        /// The command: `run` or `qualify`. It decides how often a scenario is played, and which are rehearsed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("enum" = ["run", "qualify", null]))]
        purpose: Option<String>,
        /// The sums of the texts of the scenarios that were selected, in order: none of them is left out without a trace.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        selected: Option<Vec<String>>,
        /// Of one part of a run that was split (`--partition`): which part of what.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        part: Option<RunPart>,
        /// Which captures of attempts that passed were kept (`--keep`): `failed` for none, N for the first and each N-th behind it. By default all.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        keep: Option<String>,
    },
    /// An attempt at a scenario begins.
    Scenario {
        /// Its name.
        name: String,
        /// The sum of its text.
        #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
        sha256: String,
        /// Which attempt, counted from 1.
        #[schemars(range(min = 1))]
        attempt: usize,
    },
    /// A conversation begins, at this time of the one before.
    Begin {
        /// When.
        t: u64,
    },
    /// A step of the scenario, by the place of its line in the text.
    Step {
        /// Which byte of the text.
        place: usize,
    },
    /// Bytes were sent; the last one will have left at this time.
    Sent {
        /// Which ring.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// Which.
        #[schemars(regex(pattern = "^([0-9A-F]{2})*$"))]
        bytes: String,
    },
    /// The bench looked at its ports, where time is real. What had come since the last look follows. Between two looks the bench goes by
    /// what this one says; a wait ends with a look, and only where there is news or its time is over.
    Look {
        /// When.
        t: u64,
        /// Whether bytes were still on their way round.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        busy: bool,
        /// How far ahead of the line bytes may be handed over, where that has changed: while no answer is awaited, and beyond the time of
        /// an awaited answer.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        lead: Option<(u64, u64)>,
        /// When the line wants a pause for its interlocks; none where it wants none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pause: Option<u64>,
        /// Since when the bench had not looked, where that was more than 4 ms: what follows came between then and this look.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        since: Option<u64>,
    },
    /// A byte was received.
    Received {
        /// Which ring.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// Which.
        #[schemars(regex(pattern = "^[0-9A-F]{2}$"))]
        byte: String,
        /// What the line status said.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("enum" = ["parity", "framing", "break", "overrun", null]))]
        error: Option<String>,
    },
    /// Frames were sent, on a bus of frames; the last one will have left at this time at the earliest.
    SentFrames {
        /// Through which port.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// Which, as candump writes them.
        frames: Vec<String>,
    },
    /// A frame was received, or an error of the bus. It is one of them.
    Frame {
        /// At which port.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// Which, as candump writes it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        frame: Option<String>,
        /// What went wrong.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("enum" = ["error-frame", "no-acknowledge", "bus-off", null]))]
        error: Option<String>,
    },
    /// A fault was asked for on a link.
    Fault {
        /// Which ring.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// Which link, counted from the master's outgoing one as 0.
        link: usize,
        /// At which byte; none for now.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        byte: Option<u64>,
        /// At which time; none for now.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        at: Option<u64>,
        /// What: the kind and its number, as `[kind, number]`.
        #[schemars(with = "FaultWritten")]
        what: (String, u64),
    },
    /// Bytes were sent beside the conversation, so that a ring spells out its address.
    Probe {
        /// Which ring.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// When.
        t: u64,
        /// How many.
        count: usize,
        /// Which; SYNCO, 80, where it is left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(regex(pattern = "^([0-9A-F]{2})*$"))]
        sent: Option<String>,
        /// What came.
        #[schemars(with = "Vec<ByteWritten>")]
        bytes: Vec<(String, Option<String>)>,
    },
    /// Bytes that arrived at the end of a link between two drives, as a tap there has seen them; those that the record has not shown
    /// before in this conversation.
    Tapped {
        /// Which ring.
        #[schemars(range(min = 1, max = 2))]
        ring: usize,
        /// Which link, counted from the master's outgoing one, which is 0.
        link: usize,
        /// When.
        t: u64,
        /// What came.
        #[schemars(with = "Vec<ByteWritten>")]
        bytes: Vec<(String, Option<String>)>,
    },
    /// The link carries nothing more.
    Trouble {
        /// `denied`, `lost`, `garbled`, `interlock` or `interrupted`.
        #[schemars(extend("enum" = ["denied", "lost", "garbled", "interlock", "interrupted"]))]
        cause: String,
        /// In a sentence.
        text: String,
    },
    /// What came of the attempt.
    Verdict {
        /// The verdict.
        #[schemars(schema_with = "verdict_schema")]
        verdict: String,
        /// What differed, in a sentence.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        finding: Option<String>,
        /// What is worth saying.
        remarks: Vec<String>,
        /// How long it took.
        took: u64,
        /// Line errors that the transport told of without their bytes.
        #[serde(default)]
        unplaced: u64,
        /// How the bytes received before the drives were reset compare with a ring at rest; none where they are judged with the rest. On a
        /// bus of frames, how many came before the scenario, with their checksum.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        opening: Option<String>,
    },
    /// What came of a scenario, all its attempts together.
    Case {
        /// Its name; that of its file where it was played.
        name: String,
        /// Its title.
        title: String,
        /// How many drives its rings have.
        drives: String,
        /// The verdict.
        #[schemars(schema_with = "verdict_schema")]
        verdict: String,
        /// What differed, in a sentence.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        finding: Option<String>,
        /// What is worth saying.
        remarks: Vec<String>,
        /// How long it took.
        took: u64,
        /// The sum of its text.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
        sha256: Option<String>,
    },
    /// The last line: what came of all scenarios.
    End {
        /// The verdicts of all scenarios in order.
        #[schemars(schema_with = "verdicts_schema")]
        verdicts: Vec<String>,
        /// Whether the safe state was confirmed; none for simulated rings.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        safe: Option<bool>,
    },
}

/// Which part of a run that was split a record is, and the whole that was split. Parts of one run say the same but for their numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunPart {
    /// The part, as on the command line: `slice:3/16`.
    #[schemars(regex(pattern = "^(slice|hash):[0-9]+/[0-9]+$"))]
    pub partition: String,
    /// The filter of the command, if it had one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<String>,
    /// The sum of the names and texts of all scenarios that were split.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub corpus: String,
    /// All scenarios that were split, in order, those of other parts included.
    pub scenarios: Vec<PartItem>,
}

/// A scenario of a run that was split.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartItem {
    /// Its name in the folder of a run that is not split.
    pub name: String,
    /// Whether the user named it itself: it is wrong usage if the rig's limits deny it.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub named: bool,
    /// The sum of its text.
    #[schemars(regex(pattern = "^[0-9a-f]{64}$"))]
    pub sha256: String,
}

/// A fault on a link, as the schema has it.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "only its schema is used")]
struct FaultWritten(
    #[schemars(extend("enum" = ["flip", "replace", "drop", "duplicate", "insert", "delay", "break", "overrun", "cut", "join"]))]
     String,
    u64,
);

/// A byte with its line status, as the schema has it.
#[derive(JsonSchema)]
#[expect(dead_code, reason = "only its schema is used")]
struct ByteWritten(
    #[schemars(regex(pattern = "^[0-9A-F]{2}$"))] String,
    #[schemars(extend("enum" = ["parity", "framing", "break", "overrun", null]))] Option<String>,
);

fn verdict_schema(_: &mut SchemaGenerator) -> Schema {
    let names = Verdict::ALL.map(Verdict::name);
    json_schema!({"type": "string", "enum": names})
}

fn verdicts_schema(generator: &mut SchemaGenerator) -> Schema {
    let items = verdict_schema(generator);
    json_schema!({"type": "array", "items": items})
}

/// The JSON schema of a line of a record, draft 2020-12.
#[must_use]
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(RecordLine).to_value()
}

/// Lines of the evidence of a scenario.
impl RecordLine {
    /// An attempt at a scenario of this text begins.
    pub fn of_scenario(name: &str, text: &str, attempt: usize) -> Self {
        Self::Scenario {
            name: name.to_owned(),
            sha256: sum(text.as_bytes()),
            attempt,
        }
    }

    /// What came of an attempt.
    pub fn of_verdict(attempt: &Attempt) -> Self {
        let outcome = &attempt.outcome;
        Self::Verdict {
            verdict: outcome.verdict.name().to_owned(),
            finding: outcome.finding.as_ref().map(|found| found.message.clone()),
            remarks: outcome.remarks.clone(),
            took: outcome.took.units(),
            unplaced: attempt.unplaced,
            opening: attempt.opening.clone(),
        }
    }

    /// The line for a scenario with this title on rings of these sizes.
    pub fn of_case(
        name: &str,
        title: &str,
        drives: &str,
        sha256: Option<String>,
        outcome: &Outcome,
    ) -> Self {
        Self::Case {
            name: name.to_owned(),
            title: title.to_owned(),
            drives: drives.to_owned(),
            verdict: outcome.verdict.name().to_owned(),
            finding: outcome.finding.as_ref().map(|found| found.message.clone()),
            remarks: outcome.remarks.clone(),
            took: outcome.took.units(),
            sha256,
        }
    }
}

/// Writes a record as it happens.
#[derive(Debug)]
pub struct Writer {
    file: File,
    failed: Option<std::io::Error>,
}

impl Writer {
    /// Writes into a file.
    #[must_use]
    pub fn new(file: File) -> Self {
        Self { file, failed: None }
    }

    /// Writes a line at once; what goes wrong is kept for [`Self::failed`].
    pub fn line(&mut self, line: &RecordLine) {
        if self.failed.is_some() {
            return;
        }
        let text = serde_json::to_string(line).map_err(std::io::Error::other);
        let written = text.and_then(|text| self.file.write_all((text + "\n").as_bytes()));
        self.failed = written.err();
    }

    /// The first error, once.
    pub fn failed(&mut self) -> Option<std::io::Error> {
        self.failed.take()
    }
}

impl Sink for Writer {
    fn take(&mut self, event: &LinkEvent) {
        if let Some(line) = RecordLine::of(event) {
            self.line(&line);
        }
    }
}

/// Capabilities by their names; unknown ones are left out.
#[must_use]
pub fn capabilities(names: &[String]) -> Vec<Capability> {
    let all = BTreeMap::from(Capability::NAMES);
    let named = |name: &String| all.get(name.as_str()).copied();
    names.iter().filter_map(named).collect()
}
