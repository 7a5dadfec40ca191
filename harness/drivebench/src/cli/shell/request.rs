//! What a session is asked, as JSON, and which command line that is.

use super::session::COMMANDS;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The version of the session's JSON.
pub(crate) const SCHEMA: u32 = 1;

/// The drives: a number, or a text as on the command line (`"2:3"`, `"0..2"`, `"all"`).
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum DriveWords {
    /// A drive by its number.
    Number(u8),
    /// Drives as on the command line.
    Text(String),
}

impl DriveWords {
    fn word(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.clone(),
        }
    }
}

/// A request: `do` says what is to be done. `id`, a number or a text, stands beside it and comes back in the answer.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum SessionRequest {
    /// The bench and its drives.
    // Not `Info`: of a variant without braces serde does not refuse unknown fields.
    Info {},
    /// Reads cells, registers or parameters by their names.
    Read {
        /// The drives.
        drive: DriveWords,
        /// Their names or addresses.
        cells: Vec<String>,
    },
    /// Writes cells, registers or parameters and reads them back.
    Write {
        /// The drives.
        drive: DriveWords,
        /// `name=value`, with units: `nsoll=100rpm`.
        values: Vec<String>,
    },
    /// Runs a command of `drivebench` on the bench, by its words: `["position", "0", "--by", "1turns", "--init"]`.
    Command {
        /// The words.
        words: Vec<String>,
    },
    /// The drives' modes, errors and states, as `info --format json` has them.
    State {
        /// The drives; all by default.
        drive: Option<DriveWords>,
    },
    /// Releases drives: their motors may turn.
    Go {
        /// The drives.
        drive: DriveWords,
    },
    /// Stops drives; without a drive all of them. Overtakes: what is under way ends, and what waits is cancelled.
    Stop {
        /// The drives; all by default.
        drive: Option<DriveWords>,
    },
    /// Blocks drives: no torque.
    Block {
        /// The drives.
        drive: DriveWords,
    },
    /// Switches motors off on their ramps, on slaves with a cyclic master.
    Off {
        /// The drives.
        drive: DriveWords,
    },
    /// Brings rings out of the error mode and counts their drives.
    Recover {},
    /// Lets time pass. Simulated time passes at once.
    Wait {
        /// Milliseconds, 0 to 60000.
        ms: u32,
    },
    /// Plays scenarios.
    Run {
        /// The text of a scenario.
        scenario: Option<String>,
        /// A file, a folder, or a built-in scenario by its name.
        path: Option<String>,
    },
    /// Injects a fault into simulated drives, as a scenario writes it: `98->97: flip 0`, `98->97 byte 10: flip 0`, `drive 3 off`. A byte is
    /// counted from now on.
    Fault {
        /// The line.
        line: String,
    },
    /// Captures what is exchanged from now on. The file grows with it.
    Capture {
        /// The file in pcapng; it must not be there yet.
        path: String,
    },
    /// Ends the capture; so does the end of the session.
    CaptureEnd {},
    /// Ends the request under way, and takes those back that wait; with `of` only that one. Overtakes.
    Cancel {
        /// The `id` of the request; all by default.
        of: Option<Value>,
    },
    /// Ends the session in the safe state.
    End {},
    /// What people typed and what is no request.
    #[serde(skip)]
    Wrong {
        /// Why.
        what: String,
    },
    /// The list of commands for people, or how one is used.
    #[serde(skip)]
    Help {
        /// The command.
        command: Option<String>,
    },
}

impl SessionRequest {
    /// Whether it is done in front of all that waits.
    pub(crate) const fn overtakes(&self) -> bool {
        matches!(self, Self::Stop { .. } | Self::Cancel { .. })
    }

    /// The words of the command line that does it; `None` for what is no command.
    pub(crate) fn words(&self) -> Option<Vec<String>> {
        let all =
            |drive: &Option<DriveWords>| drive.as_ref().map_or("all".to_owned(), DriveWords::word);
        let (name, drive, rest): (&str, String, &[String]) = match self {
            Self::Command { words } => return Some(words.clone()),
            Self::Read { drive, cells } => ("watch", drive.word(), cells),
            Self::Write { drive, values } => ("write", drive.word(), values),
            Self::State { drive } => ("info", all(drive), &[]),
            Self::Stop { drive } => ("stop", all(drive), &[]),
            Self::Go { drive } => ("go", drive.word(), &[]),
            Self::Block { drive } => ("block", drive.word(), &[]),
            Self::Off { drive } => ("off", drive.word(), &[]),
            _ => return None,
        };
        let options: &[&str] = match self {
            Self::Read { .. } => &["--for", "0ms", "--format", "csv"],
            Self::State { .. } => &["--format", "json"],
            _ => &[],
        };
        let front = [name.to_owned()].into_iter();
        let options = options.iter().map(|word| (*word).to_owned());
        let back = [String::from("--"), drive].into_iter();
        Some(
            front
                .chain(options)
                .chain(back)
                .chain(rest.iter().cloned())
                .collect(),
        )
    }
}

/// A line of the session's output.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum SessionLine {
    /// The answer to a request.
    Result {
        /// The request's.
        id: Value,
        /// What came of it.
        result: Value,
    },
    /// A request that was not done, or not to its end.
    Error {
        /// The request's; null where the line has none.
        id: Value,
        /// Why.
        error: SessionFault,
    },
    /// What no request asked for.
    Event(SessionEvent),
}

/// Why a request was not done.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct SessionFault {
    /// The exit code that the command would have.
    pub(crate) code: u8,
    /// What failed, where, and what to do.
    pub(crate) what: String,
}

/// What no request asked for.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub(crate) enum SessionEvent {
    /// The first line.
    Hello {
        /// The version of this schema.
        schema: u32,
        /// The program's version.
        version: &'static str,
        /// The rig as it was named.
        rig: String,
    },
    /// The bench is open.
    Ready {
        /// The bus.
        bus: &'static str,
        /// The numbers of its drives.
        drives: Vec<String>,
        /// Whether the drives are simulated in this program.
        simulated: bool,
        /// Whether motors may turn, as far as the rig's file permits it too.
        motion: bool,
    },
    /// Something happened on the bus.
    Bus {
        /// What.
        what: String,
    },
    /// The last line.
    End {
        /// The exit code.
        code: u8,
        /// How the bench was given back, or why it could not be opened.
        what: String,
    },
}

/// The JSON schema of the lines in both directions.
pub(crate) fn schema() -> Value {
    let request = schemars::schema_for!(SessionRequest).to_value();
    let line = schemars::schema_for!(SessionLine).to_value();
    serde_json::json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "drivebench session",
        "$defs": {"request": request, "answer": line},
        "anyOf": [{"$ref": "#/$defs/request"}, {"$ref": "#/$defs/answer"}],
    })
}

/// The longest text of an `id`.
const LONGEST_ID: usize = 256;

/// Reads a line: its `id`, and the request.
pub(crate) fn parse(line: &[u8]) -> (Value, Result<SessionRequest, String>) {
    let mut object: Map<String, Value> = match serde_json::from_slice(line) {
        Ok(object) => object,
        Err(error) => {
            let what = format!(
                "no JSON object in a line: {error}; {{\"id\": 1, \"do\": \"info\"}} expected"
            );
            return (Value::Null, Err(what));
        }
    };
    let id = object.remove("id").unwrap_or_default();
    let fits = match &id {
        Value::Number(_) => true,
        Value::String(text) => text.len() <= LONGEST_ID,
        _ => false,
    };
    if !fits {
        let what = format!("`id`: a number, or a text of at most {LONGEST_ID} bytes expected");
        return (Value::Null, Err(what));
    }
    let named = object.get("do").and_then(Value::as_str).map(str::to_owned);
    let request = serde_json::from_value(Value::Object(object));
    let request = request.map_err(|error| match named {
        Some(name) if COMMANDS.contains(&name.as_str()) && error.to_string().contains("variant") => {
            format!("`{name}` is a command, which `command` runs: {{\"do\": \"command\", \"words\": [\"{name}\", ...]}} expected")
        }
        _ => error.to_string(),
    });
    (id, request)
}
