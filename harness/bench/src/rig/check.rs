//! From the text of a rig file to a [`Rig`]: every mistake is found here, before a port is opened.

use super::buses::{PortRow, RigBuses};
use super::file::schema;
use super::file::{Endpoint, RigFile, Ring, SCHEMA, SafeStep, Transport};
use super::port_file::Port;
use super::profile::KnownProfile;
use super::session_error::SessionError;
use crate::counted::counted;
use crate::file::schema::{PathStep, compare, place, syntax};
use crate::file::values::LinkName;
use crate::medium::ErrorMarks;
use crate::scenario::problem::{Problem, Problems, TextSpan};
use crate::scenario::source::Source;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use toml::Spanned;
use toml::de::DeTable;

/// The longest id of a rig.
const MAX_ID: usize = 64;

/// A rig whose file has no mistakes.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Where it comes from, for messages: a path, `sim:3`, or the name of a built-in rig.
    pub origin: String,
    /// The text of its file.
    pub text: Arc<str>,
    /// What its file says.
    pub file: RigFile,
    /// The profile that it names, read.
    pub profile: Option<KnownProfile>,
    /// What its buses know of rigs.
    pub buses: &'static RigBuses,
}

impl Rig {
    /// Its id, by which it is locked.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.file.rig.id
    }

    /// Its rings with their numbers, 1 and 2.
    pub fn rings(&self) -> impl Iterator<Item = (u8, &Ring)> {
        self.file
            .rings()
            .zip(1..)
            .map(|(ring, number)| (number, ring))
    }

    /// How many drives its first ring has; 0 of a bench without rings.
    #[must_use]
    pub fn ring_size(&self) -> u8 {
        self.file.rings().next().map_or(0, |ring| ring.drives)
    }

    /// How many drives each of its rings has; of a bench with a port, how many are there.
    #[must_use]
    pub fn sizes(&self) -> Vec<u8> {
        match self.port() {
            Some(port) => vec![u8::try_from(port.drives.len()).unwrap_or(u8::MAX)],
            None => self.rings().map(|(_, ring)| ring.drives).collect(),
        }
    }

    /// Refuses a bench without rings.
    ///
    /// # Errors
    /// [`SessionError::OtherBus`].
    pub fn of_rings(&self) -> Result<(), SessionError> {
        self.port().map_or(Ok(()), |port| {
            Err(SessionError::OtherBus {
                rig: self.id().to_owned(),
                bus: port.bus.name(),
            })
        })
    }

    /// Its port on a bus whose stations share one segment, in place of rings.
    #[must_use]
    pub fn port(&self) -> Option<&Port> {
        self.file.port.as_ref().map(|ports| &ports.first)
    }

    /// What its bus knows of the port.
    pub fn port_row(&self) -> Option<&'static PortRow> {
        self.port().map(|port| self.buses.port(port.bus))
    }

    /// How often a ring is examined before a scenario until it counts as ill; `None` where its file asks for no examination. An interlock
    /// asks for one: its drive must answer, whatever the scenario before has left.
    pub fn examinations(&self) -> Option<u8> {
        let wanted = self.file.health.between || !self.file.interlock.is_empty();
        wanted.then_some(self.file.health.attempts)
    }

    /// When the longest run is over that its file allows, for one that started at this time.
    pub fn deadline(&self, started: Instant) -> Option<Instant> {
        let longest = self.file.limits.max_run.as_ref()?;
        started.checked_add(longest.0)
    }

    /// The same rig for a run that is played again from its record: it touches nothing outside the program.
    #[must_use]
    pub fn for_replay(&self) -> Self {
        let mut rig = self.clone();
        rig.file.hooks = Default::default();
        rig.file.power.clear();
        rig.file.quarantine = None;
        rig
    }

    /// Whether its drives are simulated in the program. Such a rig needs no lock: everyone has a copy.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        match self.file.rings().next() {
            Some(ring) => ring.endpoint.transport == Transport::Sim,
            None => self.file.sim.as_ref().is_some_and(|sim| sim.bus.is_some()),
        }
    }
}

/// The profile of a name that stands in a rig's file, or why there is none.
pub(crate) type FindProfile<'f> = dyn Fn(&str) -> Result<Source, String> + 'f;

/// Reads a rig file.
///
/// # Errors
/// All its mistakes, each with its place.
pub fn parse(source: &Source, buses: &'static RigBuses) -> Result<Rig, Problems> {
    let beside = |named: &str| {
        let folder = Path::new(&source.name).parent();
        let path = folder.unwrap_or(Path::new("")).join(named);
        Source::read(&path).map_err(|error| error.to_string())
    };
    parse_beside(source, buses, &beside)
}

/// The same, with the text of the profile that it may name found by `profile`.
///
/// # Errors
/// All its mistakes, each with its place.
pub fn parse_beside(
    source: &Source,
    buses: &'static RigBuses,
    profile: &FindProfile<'_>,
) -> Result<Rig, Problems> {
    let problems = |mut problems: Vec<Problem>| {
        problems.sort_by_key(|problem| (problem.span.start, problem.span.end));
        problems.dedup();
        Problems::new(&source.name, source.text.clone(), problems)
    };
    let table = DeTable::parse(&source.text).map_err(|e| problems(vec![syntax(&e)]))?;
    let mistakes = compare(&schema(), "a rig file", &table);
    if !mistakes.is_empty() {
        return Err(problems(mistakes));
    }
    let file: RigFile = toml::from_str(&source.text).map_err(|e| problems(vec![syntax(&e)]))?;
    let mut check = RigCheck {
        table: &table,
        file: &file,
        buses,
        problems: Vec::new(),
    };
    let profile = check.all(source, profile);
    if !check.problems.is_empty() {
        return Err(problems(check.problems));
    }
    Ok(Rig {
        origin: source.name.clone(),
        text: source.text.clone(),
        file,
        profile,
        buses,
    })
}

/// Whether a text is an address of the form host:port.
pub(crate) fn is_address(text: &str) -> bool {
    text.rsplit_once(':').is_some_and(|(host, number)| {
        !host.is_empty() && number.parse::<u16>().is_ok_and(|number| number > 0)
    })
}

pub struct RigCheck<'a> {
    pub table: &'a Spanned<DeTable<'a>>,
    pub file: &'a RigFile,
    pub buses: &'static RigBuses,
    pub problems: Vec<Problem>,
}

impl RigCheck<'_> {
    /// The place of a value, or of the nearest table around it that is there.
    pub fn place(&self, path: &[PathStep<'_>]) -> TextSpan {
        place(self.table, path)
    }

    pub fn wrong(
        &mut self,
        path: &[PathStep<'_>],
        message: impl Into<String>,
        expected: impl Into<String>,
    ) {
        let problem = Problem::new(place(self.table, path), message, expected);
        self.problems.push(problem);
    }

    fn all(&mut self, source: &Source, find_profile: &FindProfile<'_>) -> Option<KnownProfile> {
        let file = self.file;
        debug_assert!(file.schema <= SCHEMA);
        self.id();
        if self.has_port() {
            self.safe_state();
            self.programs();
            self.quarantine();
            let port = file.port.as_ref().map(|ports| &ports.first);
            return port.and_then(|port| self.port_profile(port, find_profile));
        }
        for (ring, number) in file.rings().zip(["1", "2"]) {
            let path = [PathStep::Key("ring"), PathStep::Key(number)];
            self.endpoint(&path, &ring.endpoint);
        }
        self.one_world();
        for (index, tap) in file.tap.iter().enumerate() {
            let path = ["tap".into(), index.into()];
            self.link(&path, tap.ring, tap.link);
            self.endpoint(&path, &tap.endpoint);
            self.is_physical(&path, &tap.endpoint);
        }
        for (index, interposer) in file.interposer.iter().enumerate() {
            let path = ["interposer".into(), index.into()];
            self.link(&path, interposer.ring, interposer.link);
            let ends = [
                ("upstream", &interposer.upstream),
                ("downstream", &interposer.downstream),
            ];
            for (key, endpoint) in ends {
                let path = [path[0], path[1], key.into()];
                self.endpoint(&path, endpoint);
                self.is_physical(&path, endpoint);
            }
        }
        self.ports();
        self.drives();
        for (index, interlock) in file.interlock.iter().enumerate() {
            (self.buses.rings.interlock)(
                &mut *self,
                &["interlock".into(), index.into()],
                interlock,
            );
        }
        self.safe_state();
        self.programs();
        self.quarantine();
        let profile = self.profile(find_profile);
        self.setup(source, profile.as_ref());
        profile
    }

    fn id(&mut self) {
        let id = &self.file.rig.id;
        let fits = |c: char| c.is_ascii_alphanumeric() || ".-_".contains(c);
        if id.is_empty() || id.len() > MAX_ID || id.starts_with(['.', '-']) || !id.chars().all(fits)
        {
            let expected =
                "1 to 64 letters, digits, `.`, `_` or `-`, a letter or digit first, expected here";
            self.wrong(
                &["rig".into(), "id".into()],
                format!("`{id}` is not an id"),
                expected,
            );
        }
    }

    /// Telegrams come before the power goes, and each step once.
    fn safe_state(&mut self) {
        if self.file.safe_state.watchdog.0 < Duration::from_secs(1) {
            let path = ["safe_state".into(), "watchdog".into()];
            self.wrong(
                &path,
                "a computer may be busy for longer",
                "at least 1s expected here",
            );
        }
        let order = &self.file.safe_state.order;
        for (index, step) in order.iter().enumerate() {
            let path = ["safe_state".into(), "order".into(), index.into()];
            if order[..index].contains(step) {
                self.wrong(
                    &path,
                    "this step is listed twice",
                    "each step once expected",
                );
            } else if *step == SafeStep::PowerOff && index + 1 < order.len() {
                let expected =
                    "`power-off` as the last step expected: drives without power receive nothing";
                self.wrong(&path, "a step follows `power-off`", expected);
            } else if *step == SafeStep::PowerOff && self.file.power.is_empty() {
                let expected = "a table [power.NAME] expected beside it";
                self.wrong(&path, "there is no power to switch off", expected);
            }
        }
    }

    /// Ports that fit their transport.
    pub(crate) fn endpoint(&mut self, path: &[PathStep<'_>], endpoint: &Endpoint) {
        let at = |key| [path, &[PathStep::Key(key)]].concat();
        let transport = endpoint.transport.name();
        match (endpoint.transport, &endpoint.port, endpoint.udev.is_empty()) {
            (Transport::Sim, Some(_), _) => {
                self.wrong(
                    &at("port"),
                    "a simulated ring has no port",
                    "no `port` expected here",
                );
            }
            (Transport::Sim, None, true) => {}
            (Transport::Serial, Some(_), false) => self.wrong(
                &at("match"),
                "both `port` and `match` are given",
                "one of them expected",
            ),
            (Transport::Serial, None, true) => self.wrong(
                &at("transport"),
                "a serial port needs `port` or `match`",
                "`port = \"/dev/ttyUSB0\"` or `match = { ... }` expected beside it",
            ),
            (Transport::Serial, ..) => {}
            (_, _, false) => self.wrong(
                &at("match"),
                format!("`match` finds serial ports; this is {transport}"),
                "`port` expected in its place",
            ),
            (_, None, _) => self.wrong(
                &at("transport"),
                format!("transport {transport} needs `port`"),
                "`port` expected beside it",
            ),
            (Transport::Pty, ..) => {}
            (Transport::Tcp | Transport::Rfc2217, Some(port), _) => {
                if !is_address(port) {
                    let message = format!("`{port}` is not an address");
                    self.wrong(
                        &at("port"),
                        message,
                        "host:port such as \"127.0.0.1:4021\" expected here",
                    );
                }
            }
        }
        if endpoint.port.as_deref() == Some("") {
            self.wrong(
                &at("port"),
                "`port` is empty",
                "a device or host:port expected here",
            );
        }
        let carries = matches!(endpoint.transport, Transport::Pty | Transport::Tcp);
        if endpoint.marks == ErrorMarks::InBand && !carries {
            let why = match endpoint.transport {
                Transport::Rfc2217 => "RFC 2217 cannot carry the value of a bad byte",
                Transport::Serial => "a serial port reports line errors itself",
                _ => "a simulated ring reports line errors itself",
            };
            self.wrong(
                &at("marks"),
                why,
                "\"none\" expected here; in-band marks are for pty and tcp",
            );
        }
    }

    fn is_physical(&mut self, path: &[PathStep<'_>], endpoint: &Endpoint) {
        if endpoint.transport == Transport::Sim {
            let path = [path, &["transport".into()]].concat();
            self.wrong(
                &path,
                "taps and interposers have ports; a simulated ring shows every link by itself",
                "\"serial\", \"pty\", \"tcp\" or \"rfc2217\" expected here",
            );
        }
    }

    /// Rings are all simulated or all outside the program: one clock for all.
    fn one_world(&mut self) {
        let sim = |ring: &Ring| ring.endpoint.transport == Transport::Sim;
        let first = self.file.rings().next().is_some_and(sim);
        if self.file.rings().any(|ring| sim(ring) != first) {
            self.wrong(
                &["ring".into(), "2".into(), "transport".into()],
                "one ring is simulated and the other is not",
                "both simulated or both with ports expected",
            );
        }
        if !first && self.file.sim.is_some() {
            self.wrong(
                &["sim".into()],
                "[sim] is only for simulated rings; this rig has ports",
                "no [sim] expected here",
            );
        }
    }

    /// How many drives the ring has; `None`, and a mistake, where there is no such ring.
    fn ring(&mut self, path: &[PathStep<'_>], ring: u8) -> Option<u8> {
        let found = self.file.rings().nth(usize::from(ring.saturating_sub(1)));
        if found.is_none() {
            let path = [path, &["ring".into()]].concat();
            self.wrong(
                &path,
                "the rig has no ring 2",
                "1, or a table [ring.2], expected",
            );
        }
        found.map(|ring| ring.drives)
    }

    fn link(&mut self, path: &[PathStep<'_>], ring: u8, link: LinkName) {
        let Some(drives) = self.ring(path, ring) else {
            return;
        };
        if !link.is_in(drives) {
            let last = drives.saturating_sub(1);
            let message = format!("ring {ring} has no link {link}");
            let expected = match last {
                0 => "master->0 or 0->master expected here: the ring has one drive".to_owned(),
                _ => format!(
                    "master->{last}, {last}->{} and so on to 0->master expected here: the ring has {drives} drives",
                    last - 1
                ),
            };
            self.wrong(&[path, &["link".into()]].concat(), message, expected);
        }
    }

    /// No port is named twice.
    fn ports(&mut self) {
        let file = self.file;
        let mut all: Vec<(Vec<PathStep<'_>>, &Endpoint)> = Vec::new();
        for (ring, key) in file.rings().zip(["1", "2"]) {
            all.push((vec!["ring".into(), key.into()], &ring.endpoint));
        }
        for (index, tap) in file.tap.iter().enumerate() {
            all.push((vec!["tap".into(), index.into()], &tap.endpoint));
        }
        for (index, both) in file.interposer.iter().enumerate() {
            let up = ("upstream", &both.upstream);
            let down = ("downstream", &both.downstream);
            // One port for both: its receiver is upstream, its transmitter downstream.
            let two = Some(down).filter(|_| both.upstream != both.downstream);
            for (key, endpoint) in std::iter::once(up).chain(two) {
                all.push((
                    vec!["interposer".into(), index.into(), key.into()],
                    endpoint,
                ));
            }
        }
        let mut seen = BTreeSet::new();
        for (mut path, endpoint) in all {
            let Some(port) = &endpoint.port else { continue };
            if !seen.insert(port) {
                path.push("port".into());
                let message = format!("the port {port} is named twice");
                self.wrong(&path, message, "another port expected here");
            }
        }
    }

    /// The drive is one of the ring.
    pub fn drive(&mut self, path: &[PathStep<'_>], ring: u8, address: u8) {
        let at = path.split_last().map_or(path, |(_, before)| before);
        let Some(drives) = self.ring(at, ring) else {
            return;
        };
        if address >= drives {
            let message = format!("ring {ring} has no drive {address}");
            let expected = format!(
                "0 to {} expected here: the ring has {}",
                drives.saturating_sub(1),
                counted(drives, "drive")
            );
            self.wrong(path, message, expected);
        }
    }

    fn drives(&mut self) {
        let file = self.file;
        let mut seen = BTreeSet::new();
        for (index, drive) in file.drive.iter().enumerate() {
            let path = ["drive".into(), index.into(), "address".into()];
            self.drive(&path, drive.ring, drive.address);
            if !seen.insert((drive.ring, drive.address)) {
                let message = format!(
                    "drive {} of ring {} is described twice",
                    drive.address, drive.ring
                );
                self.wrong(&path, message, "another address expected here");
            }
        }
        for (index, deviation) in file.deviation.iter().enumerate() {
            for drive in &deviation.drives {
                let path = ["deviation".into(), index.into(), "drives".into()];
                self.drive(&path, deviation.ring, *drive);
            }
        }
    }

    /// Programs have a name, and none of their words holds a zero byte.
    fn programs(&mut self) {
        let file = self.file;
        let mut all: Vec<(Vec<PathStep<'_>>, &[String])> = Vec::new();
        for (name, power) in &file.power {
            let entries = [
                ("on", Some(&power.on)),
                ("off", Some(&power.off)),
                ("status", power.status.as_ref()),
            ];
            for (key, command) in entries {
                all.extend(command.map(|c| {
                    (
                        vec!["power".into(), name.as_str().into(), key.into()],
                        c.as_slice(),
                    )
                }));
            }
        }
        let hooks = &file.hooks;
        for (key, hook) in [
            ("before", &hooks.before),
            ("after", &hooks.after),
            ("on_error", &hooks.on_error),
        ] {
            all.extend(hook.as_ref().map(|hook| {
                (
                    vec!["hooks".into(), key.into(), "command".into()],
                    hook.command.as_slice(),
                )
            }));
        }
        for (path, command) in all {
            if command.first().is_none_or(String::is_empty)
                || command.iter().any(|word| word.contains('\0'))
            {
                self.wrong(
                    &path,
                    "this is not a program",
                    "[\"program\", \"argument\"] expected here",
                );
            }
        }
    }

    fn quarantine(&mut self) {
        let Some(quarantine) = &self.file.quarantine else {
            return;
        };
        let date = quarantine.since.parse::<toml::value::Datetime>();
        if !date.is_ok_and(|date| date.date.is_some()) {
            let message = format!("`{}` is not a date", quarantine.since);
            self.wrong(
                &["quarantine".into(), "since".into()],
                message,
                "a date such as \"2026-03-14\" expected here",
            );
        }
    }
}
