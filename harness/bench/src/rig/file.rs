//! The content of a rig file. The JSON schema is derived from these types, and every file is checked against it; `drivebench rig
//! schema` prints these doc comments.

use super::port_file::{PortBus, PortLimits, Ports};
use crate::file::values::{LinkName, MaxSpeed, Speed, Time};
use crate::medium::ErrorMarks;
use harness_proto::line::Rate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The JSON schema of a rig file, draft 2020-12.
#[must_use]
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(RigFile).to_value()
}

/// The newest version of the schema. Version 1 knows rings only.
pub const SCHEMA: u32 = 2;

/// A rig file.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigFile {
    /// The version of this schema: 1, or 2 for a file with `[port.1]`.
    #[schemars(range(min = 1, max = 2))]
    pub schema: u32,
    /// Which bench this is.
    pub rig: About,
    /// Its rings: `[ring.1]`, and `[ring.2]` where there are two (ND21 12.2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ring: Option<Rings>,
    /// In place of rings, a port of a bus whose stations share one segment: `[port.1]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<Ports>,
    /// Ports that listen on a link. RxD and GND alone are wired: Linux raises RTS and DTR whenever a port is opened.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 500))]
    pub tap: Vec<Tap>,
    /// Pairs of ports that stand in a link and can change what goes through.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 500))]
    pub interposer: Vec<Interposer>,
    /// What is known of single drives.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 500))]
    pub drive: Vec<DriveEntry>,
    /// How simulated drives are set up; only where the rings are simulated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sim: Option<Sim>,
    /// Switches for power, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub power: BTreeMap<String, Power>,
    /// Conditions under which a run is ended and the rig taken to its safe state.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 100))]
    pub interlock: Vec<Interlock>,
    /// How the rig is taken to its safe state.
    #[serde(default)]
    pub safe_state: SafeState,
    /// When the rig itself is examined.
    #[serde(default)]
    pub health: Health,
    /// Set where the rig must not be used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quarantine: Option<Quarantine>,
    /// How often a scenario that did not pass is played again.
    #[serde(default)]
    pub retry: Retry,
    /// Programs that are run around a run.
    #[serde(default)]
    pub hooks: Hooks,
    /// What may be sent to the rig. Where nothing is said, nothing that moves, writes EEPROM, resets or
    /// switches outputs.
    #[serde(default)]
    pub limits: Limits,
    /// Known deviations of the drives of this rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 100))]
    pub deviation: Vec<Deviation>,
}

impl RigFile {
    /// Its rings, in order; none of a bench with `[port.1]`.
    pub fn rings(&self) -> impl Iterator<Item = &Ring> {
        let rings = self.ring.iter();
        rings.flat_map(|rings| std::iter::once(&rings.first).chain(&rings.second))
    }
}

/// Which bench this is.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Its name: letters, digits, `.`, `_` and `-`, at most 64. The lock goes by it.
    pub id: String,
    /// A line for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Where it stands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub location: Option<String>,
    /// What `qualify` has found of its drives: the path of a profile, from the folder of this file. Simulated drives behave so,
    /// and so does the model beside real ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<String>,
    /// Words by which rigs are chosen.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 32))]
    pub labels: Vec<String>,
}

/// The rings of a bench (ND21 12.2).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rings {
    /// The first ring.
    #[serde(rename = "1")]
    pub first: Ring,
    /// The second ring.
    #[serde(rename = "2", default, skip_serializing_if = "Option::is_none")]
    pub second: Option<Ring>,
}

/// A ring.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Ring {
    /// How many drives: 1 to 250 (ND21 8.4).
    #[schemars(range(min = 1, max = 250))]
    pub drives: u8,
    /// How much the time of a byte may be off before a scenario calls it late; default 3ms.
    #[serde(default = "three_milliseconds")]
    pub time_tolerance: Time,
    /// The master's port.
    #[serde(flatten)]
    pub endpoint: Endpoint,
}

/// Where bytes go in and out.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Endpoint {
    /// What carries the bytes.
    pub transport: Transport,
    /// A device such as `/dev/ttyUSB0` (serial, pty), or `host:port` (tcp, rfc2217).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<String>,
    /// In place of `port`, what udev says of a serial adapter, as `drivebench rig scan` prints it:
    /// `{ ID_SERIAL_SHORT = "..." }`. All keys must fit, and one port only.
    #[serde(rename = "match", default, skip_serializing_if = "BTreeMap::is_empty")]
    pub udev: BTreeMap<String, String>,
    /// Speed and format of the line; default `38400 8O1` (ND21 8.1).
    #[serde(default)]
    pub line: LineFormat,
    /// Whether line errors stand in the stream itself (pty and tcp only); default `none`.
    #[serde(default)]
    pub marks: ErrorMarks,
    /// Whether a serial adapter is asked for a short latency (ASYNC_LOW_LATENCY); default true.
    #[serde(default = "yes")]
    pub low_latency: bool,
}

/// What carries the bytes of a ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// Simulated in the program, in virtual time.
    Sim,
    /// A serial port.
    Serial,
    /// A pseudo-terminal.
    Pty,
    /// A TCP connection that carries the bytes and nothing else.
    Tcp,
    /// A serial port behind a network (RFC 2217). It cannot carry the value of a bad byte.
    Rfc2217,
}

impl Transport {
    /// The name as written in the file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sim => "sim",
            Self::Serial => "serial",
            Self::Pty => "pty",
            Self::Tcp => "tcp",
            Self::Rfc2217 => "rfc2217",
        }
    }
}

/// Speed and format of a line: eight bits, odd parity, one stop bit (ND21 8.1).
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize, JsonSchema,
)]
#[schemars(rename = "Line")]
pub enum LineFormat {
    /// 38400 baud.
    #[default]
    #[serde(rename = "38400 8O1")]
    Baud38400,
    /// 19200 baud.
    #[serde(rename = "19200 8O1")]
    Baud19200,
    /// 9600 baud.
    #[serde(rename = "9600 8O1")]
    Baud9600,
}

impl From<LineFormat> for Rate {
    fn from(line: LineFormat) -> Self {
        match line {
            LineFormat::Baud38400 => Self::Baud38400,
            LineFormat::Baud19200 => Self::Baud19200,
            LineFormat::Baud9600 => Self::Baud9600,
        }
    }
}

impl LineFormat {
    /// Bits a second.
    #[must_use]
    pub const fn baud(self) -> u32 {
        match self {
            Self::Baud38400 => 38_400,
            Self::Baud19200 => 19_200,
            Self::Baud9600 => 9_600,
        }
    }
}

/// A port that listens on a link.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Tap {
    /// In which ring, 1 or 2; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 2))]
    pub ring: u8,
    /// On which link.
    pub link: LinkName,
    /// Its port.
    #[serde(flatten)]
    pub endpoint: Endpoint,
}

/// Two ports that stand in a link: what comes in at one leaves, perhaps changed, by the other.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interposer {
    /// In which ring, 1 or 2; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 2))]
    pub ring: u8,
    /// In which link.
    pub link: LinkName,
    /// The port toward the sender of the link.
    pub upstream: Endpoint,
    /// The port toward its receiver.
    pub downstream: Endpoint,
}

/// What is known of one drive.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveEntry {
    /// In which ring, 1 or 2; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 2))]
    pub ring: u8,
    /// Its axis number: 0 is the last before the master (ND21 8.4).
    #[schemars(range(min = 0, max = 249))]
    pub address: u8,
    /// What it is, such as `ND21-4`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<String>,
    /// Its serial number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Its firmware.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub firmware: Option<String>,
    /// The highest speed that may be demanded of it; default that of `[limits]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_speed: Option<Speed>,
    /// Whether it may turn, where `[limits]` allows motion at all; default true.
    #[serde(default = "yes")]
    pub motion: bool,
}

/// How simulated drives are set up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sim {
    /// The bus that is simulated at `[port.1]`; rings say so by their `transport`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bus: Option<PortBus>,
    /// Lines of a scenario's header, such as `drive 0..last input GPIN3 GPIN5 high`.
    #[serde(default)]
    #[schemars(length(max = 1000))]
    pub setup: Vec<String>,
}

/// A switch for power: programs that are run, without a shell.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Power {
    /// Switches on: program and arguments.
    #[schemars(length(min = 1, max = 100))]
    pub on: Vec<String>,
    /// Switches off.
    #[schemars(length(min = 1, max = 100))]
    pub off: Vec<String>,
    /// Says whether it is on: exit code 0 for on, 1 for off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1, max = 100))]
    pub status: Option<Vec<String>>,
    /// How long each may take; default 30s.
    #[serde(default = "half_a_minute")]
    pub timeout: Time,
}

/// A condition that must hold throughout a run: a cell within bounds, or an input at its level.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interlock {
    /// In which ring, 1 or 2; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 2))]
    pub ring: u8,
    /// Of which drive.
    #[schemars(range(min = 0, max = 249))]
    pub drive: u8,
    /// A RAM cell by its printed name, with `min`, `max` or both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell: Option<String>,
    /// On a CAN bus: a register by its name or number, with `min`, `max` or both, or with `bit` and `level`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub register: Option<String>,
    /// On PROFIBUS: a parameter by its name or number, or the status word, with the same keys beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
    /// A bit of that register or of the status word by its name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bit: Option<String>,
    /// The least that is allowed, in a unit of the cell: `-100rpm`; a whole number where it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<String>,
    /// The most that is allowed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<String>,
    /// An input by its printed name: `GPIN1` to `GPIN8`, `ESCHP`, `ESCHN` (ND21 5.3).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input: Option<String>,
    /// The level at which that input or bit must stay.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<Level>,
    /// How often it is looked at; default 100ms.
    #[serde(default = "tenth")]
    pub every: Time,
    /// What is said when it trips.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
}

/// The level of an input: high is 5 to 24 V (ND21 5.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// 5 to 24 V.
    High,
    /// 0 V.
    Low,
}

/// A step on the way to the safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SafeStep {
    /// Speed 0 is demanded of every drive.
    Stop,
    /// Every drive is blocked.
    Block,
    /// Every switch of `[power]` is switched off.
    PowerOff,
}

/// How the rig is taken to its safe state.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SafeState {
    /// The steps in order; default stop, block.
    #[schemars(length(min = 1, max = 3))]
    pub order: Vec<SafeStep>,
    /// The speed below which a drive counts as standing; default 5rpm.
    pub speed_tolerance: Speed,
    /// How long it may take until all drives stand; default 5s.
    pub within: Time,
    /// How long the program may show no sign of life before the watchdog stops the drives; default 10s, at
    /// least 1s.
    pub watchdog: Time,
}

impl Default for SafeState {
    fn default() -> Self {
        Self {
            order: vec![SafeStep::Stop, SafeStep::Block],
            speed_tolerance: Speed(5.0),
            within: Time::seconds(5),
            watchdog: Time::seconds(10),
        }
    }
}

/// When the rig itself is examined: port, number of drives, error mode.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Health {
    /// Before a run; default true.
    pub before: bool,
    /// Between scenarios; default true.
    pub between: bool,
    /// Whether a ring that this program left at rest is opened without the check sequence, whose zeros put every drive in
    /// error 0504 and stop its motor (ND21 9.8); default false. For rigs whose port no other program uses.
    pub quiet: bool,
    /// How often, before the rig is called ill: 1 to 10; default 2.
    #[schemars(range(min = 1, max = 10))]
    pub attempts: u8,
}

impl Default for Health {
    fn default() -> Self {
        Self {
            before: true,
            between: true,
            quiet: false,
            attempts: 2,
        }
    }
}

/// Why and since when the rig must not be used. `drivebench rig quarantine` keeps the same beside the lock,
/// and never writes into this file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Quarantine {
    /// Since when, as a date: `2026-03-14`, with or without a time behind it.
    pub since: String,
    /// Why.
    pub reason: String,
}

/// How often a scenario that did not pass is played again. Every attempt is kept.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Retry {
    /// Attempts in all: 1 to 10; default 1.
    #[schemars(range(min = 1, max = 10))]
    pub attempts: u8,
}

impl Default for Retry {
    fn default() -> Self {
        Self { attempts: 1 }
    }
}

/// Programs that are run around a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hooks {
    /// Before the ports are opened.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<HookEntry>,
    /// After the safe state was reached.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after: Option<HookEntry>,
    /// After a run that ended with a rig error or an interlock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_error: Option<HookEntry>,
}

/// A program that is run, without a shell.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HookEntry {
    /// Program and arguments.
    #[schemars(length(min = 1, max = 100))]
    pub command: Vec<String>,
    /// How long it may take; default 30s.
    #[serde(default = "half_a_minute")]
    pub timeout: Time,
}

/// What may be sent to the rig.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub struct Limits {
    /// Whether a motor may turn (and --allow-motion is needed beside it); default false.
    pub allow_motion: bool,
    /// Whether the EEPROM may be written; default false.
    pub allow_eeprom: bool,
    /// Whether drives may be reset; default false.
    pub allow_reset: bool,
    /// Whether outputs may be switched; default false.
    pub allow_outputs: bool,
    /// Whether the watch over silences may be switched on (ND21 14.10.2), behind which a pause of 10 ms stops a ring; default false.
    pub allow_monitoring: bool,
    /// The highest speed at which a motor may turn by what the bus says, such as `300rpm`, or `10%` at `[port.1]`; default no limit but
    /// the drives' own. Cells through which a motor could turn faster than the speeds written cannot be written then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_speed: Option<MaxSpeed>,
    /// The most bytes that are sent in a second, 1 to 100000; default what the line carries.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 100_000))]
    pub max_bytes_per_second: Option<u32>,
    /// The longest run; default no limit. Then what is being done ends like by an interlock, with the drives in their safe state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_run: Option<Time>,
    /// What only benches with `[port.1]` permit.
    #[serde(flatten)]
    pub port: PortLimits,
}

/// A known deviation of this rig's drives from the manual.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// A name, such as `late-answer`.
    pub name: String,
    /// In which ring, 1 or 2; default 1.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 2))]
    pub ring: u8,
    /// Which drives; all where none is named.
    #[serde(default)]
    #[schemars(length(max = 250), inner(range(min = 0, max = 249)))]
    pub drives: Vec<u8>,
    /// Which rule, by manual and section: `nd21 9.7`.
    pub rule: String,
    /// The scenario, or the text in its name, that shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
    /// What the manual demands, in a scenario's notation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// What the drive does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub received: Option<String>,
    /// Why it is put up with.
    pub reason: String,
}

impl Deviation {
    /// Whether it explains a difference from this rule in a ring, counted from 0. Of which drive that is may not be known.
    #[must_use]
    pub fn explains(&self, rule: &str, ring: usize, drive: Option<u8>) -> bool {
        self.rule == rule
            && usize::from(self.ring) == ring + 1
            && (self.drives.is_empty() || drive.is_none_or(|drive| self.drives.contains(&drive)))
    }
}

const fn yes() -> bool {
    true
}

const fn one() -> u8 {
    1
}

const fn half_a_minute() -> Time {
    Time::seconds(30)
}

fn tenth() -> Time {
    Time(std::time::Duration::from_millis(100))
}

fn three_milliseconds() -> Time {
    Time(std::time::Duration::from_millis(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A known deviation of one drive excuses no other one, and no other ring.
    #[test]
    fn a_known_deviation_is_of_its_drives() {
        let known = |drives: &[u8]| Deviation {
            name: "an-old-quirk".to_owned(),
            ring: 1,
            drives: drives.to_vec(),
            rule: "manual 10.2".to_owned(),
            scenario: None,
            expected: None,
            received: None,
            reason: "it has always done so".to_owned(),
        };
        let deviation = known(&[0, 3]);
        assert!(deviation.explains("manual 10.2", 0, Some(3)));
        assert!(deviation.explains("manual 10.2", 0, None));
        assert!(!deviation.explains("manual 10.2", 0, Some(2)));
        assert!(!deviation.explains("manual 10.2", 1, Some(3)));
        assert!(!deviation.explains("manual 10.3", 0, Some(3)));
        assert!(known(&[]).explains("manual 10.2", 0, Some(2)));
    }
}
