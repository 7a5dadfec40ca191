//! The serial ports of this machine, with what udev says of each, and its CAN interfaces.
//!
//! Linux tells it in files: `/sys/class/tty/*` has the ports, `/run/udev/data/c4:64` the keys of the port with
//! these numbers. Nothing is opened, so that no port is disturbed.

use super::buses::{PortRow, RigBuses};
use super::port_file::PortBus;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The most ports that are looked at.
const MAX_PORTS: usize = 4096;

/// Keys that name an adapter, from the most telling on; the serial number alone is not always unique.
const TELLING: [&str; 4] = [
    "ID_VENDOR_ID",
    "ID_MODEL_ID",
    "ID_SERIAL_SHORT",
    "ID_USB_INTERFACE_NUM",
];

/// A serial port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundPort {
    /// Its device, such as `/dev/ttyUSB0`.
    pub device: PathBuf,
    /// What udev says of it: ID_SERIAL_SHORT and so on.
    pub udev: BTreeMap<String, String>,
}

impl FoundPort {
    /// Whether every key has this value.
    #[must_use]
    pub fn fits(&self, wanted: &BTreeMap<String, String>) -> bool {
        wanted
            .iter()
            .all(|(key, value)| self.udev.get(key) == Some(value))
    }

    /// The keys by which a rig file best names it: those of a USB adapter with a serial number, else its place
    /// (ID_PATH); none where udev knows neither.
    #[must_use]
    pub fn telling(&self) -> BTreeMap<String, String> {
        let pick = |keys: &[&str]| -> BTreeMap<_, _> {
            let found = keys.iter().filter_map(|key| self.udev.get_key_value(*key));
            found
                .map(|(key, value)| (key.clone(), value.clone()))
                .collect()
        };
        if self.udev.contains_key("ID_SERIAL_SHORT") {
            pick(&TELLING)
        } else {
            pick(&["ID_PATH"])
        }
    }
}

/// Why no port, or no single one, has these keys.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "failed to find the one port with {wanted}: {found}; `drivebench rig scan` shows the ports"
)]
pub struct MatchError {
    /// The keys.
    pub wanted: String,
    /// What was found.
    pub found: String,
}

/// The port with these udev keys.
///
/// # Errors
/// There is none, or more than one.
pub fn resolve(
    ports: &[FoundPort],
    wanted: &BTreeMap<String, String>,
) -> Result<PathBuf, MatchError> {
    let fitting: Vec<_> = ports.iter().filter(|port| port.fits(wanted)).collect();
    let names = |ports: &mut dyn Iterator<Item = &FoundPort>| {
        let names: Vec<_> = ports
            .map(|port| port.device.display().to_string())
            .collect();
        names.join(", ")
    };
    let found = match fitting.as_slice() {
        [one] => return Ok(one.device.clone()),
        [] if ports.is_empty() => "this machine has no serial port".to_owned(),
        [] => format!("none of {} has them", names(&mut ports.iter())),
        many => format!("{} have them", names(&mut many.iter().copied())),
    };
    let wanted: Vec<_> = wanted
        .iter()
        .map(|(key, value)| format!("{key} = {value}"))
        .collect();
    Err(MatchError {
        wanted: wanted.join(", "),
        found,
    })
}

/// The serial ports of the machine whose files stand under `root`, which is `/` but in tests. What cannot be
/// read is not there.
#[must_use]
pub fn scan(root: &Path) -> Vec<FoundPort> {
    let consoles = std::fs::read_to_string(root.join("sys/class/tty/console/active"));
    let consoles = consoles.unwrap_or_default();
    let entries = std::fs::read_dir(root.join("sys/class/tty"))
        .into_iter()
        .flatten();
    // The kernel writes its messages to a console.
    let is_console = |name: &str| consoles.split_whitespace().any(|console| console == name);
    let mut ports: Vec<_> = entries
        .take(MAX_PORTS)
        .filter_map(Result::ok)
        .filter(|entry| !entry.file_name().to_str().is_some_and(is_console))
        .filter_map(|entry| port(root, &entry.path()))
        .collect();
    ports.sort_by_key(|port| natural(&port.device));
    ports
}

/// The CAN interfaces of the machine whose files stand under `root`.
#[must_use]
pub fn interfaces(root: &Path) -> Vec<String> {
    // ARPHRD_CAN of `linux/if_arp.h`.
    let is_can = |folder: &Path| {
        std::fs::read_to_string(folder.join("type")).is_ok_and(|kind| kind.trim() == "280")
    };
    let entries = std::fs::read_dir(root.join("sys/class/net"));
    let entries = entries.into_iter().flatten().take(MAX_PORTS);
    let mut names: Vec<_> = entries
        .filter_map(Result::ok)
        .filter(|entry| is_can(&entry.path()))
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort_by_key(|name| natural(Path::new(name)));
    names
}

/// ttyUSB2 before ttyUSB10.
fn natural(device: &Path) -> (String, u32) {
    let name = device.display().to_string();
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (
        letters.to_owned(),
        name[letters.len()..].parse().unwrap_or(0),
    )
}

fn port(root: &Path, folder: &Path) -> Option<FoundPort> {
    // Consoles and pseudo-terminals have no device behind them.
    if !folder.join("device").exists() {
        return None;
    }
    let line = |file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).ok()?;
        Some(text.trim().to_owned())
    };
    // A place for a chip where there is none (8250: type 0, PORT_UNKNOWN).
    if line("type").as_deref() == Some("0") {
        return None;
    }
    let numbers = line("dev").unwrap_or_default();
    let data = std::fs::read_to_string(root.join(format!("run/udev/data/c{numbers}")));
    let udev = data.unwrap_or_default();
    let keys = udev
        .lines()
        .filter_map(|line| line.strip_prefix("E:")?.split_once('='));
    Some(FoundPort {
        device: Path::new("/dev").join(folder.file_name()?),
        udev: keys
            .filter(|(key, _)| key.starts_with("ID_"))
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .collect(),
    })
}

/// A block of a rig file for each port, to choose from: each is made for ring 1, and as a comment for an SLCAN adapter.
#[must_use]
pub fn propose(ports: &[FoundPort], buses: &RigBuses) -> String {
    let mut text = String::new();
    for (number, port) in ports.iter().enumerate() {
        let device = port.device.display().to_string();
        let model = ["ID_MODEL_FROM_DATABASE", "ID_MODEL"]
            .iter()
            .find_map(|key| port.udev.get(*key));
        let model = model.map(|model| format!(": {model}")).unwrap_or_default();
        let telling = port.telling();
        let place = if telling.is_empty() {
            format!("port = {}", quoted(&device))
        } else {
            let keys: Vec<_> = telling
                .iter()
                .map(|(key, value)| format!("{key} = {}", quoted(value)))
                .collect();
            format!("match = {{ {} }}", keys.join(", "))
        };
        let gap = if number == 0 { "" } else { "\n" };
        // Writing to a String cannot fail.
        let _infallible = write!(
            text,
            "{gap}# {device}{model}\n[ring.1]\ndrives = 1                      # how many there are\n\
             transport = \"serial\"\n{place}\nline = \"38400 8O1\"\n"
        );
        for bus in with_adapter("slcan", buses) {
            let _infallible = write!(
                text,
                "# Or, if it is an SLCAN adapter, in a file with schema = 2:\n# [port.1]\n# bus = {}\n# slcan = {}\n# drives = [{{ node = 1 }}]\n",
                quoted(bus.name()),
                quoted(&device)
            );
        }
    }
    text
}

/// A block of a rig file for each CAN interface.
#[must_use]
pub fn propose_interfaces(names: &[String], buses: &RigBuses) -> String {
    let mut text = String::new();
    for name in names {
        for bus in with_adapter("socketcan", buses) {
            let _infallible = write!(
                text,
                "# {name}, in a file with schema = 2:\n[port.1]\nbus = {}\nsocketcan = {}\ndrives = [{{ node = 1 }}]\n",
                quoted(bus.name()),
                quoted(name)
            );
        }
    }
    text
}

/// The buses that are reached by an adapter of this kind.
fn with_adapter(kind: &'static str, buses: &RigBuses) -> impl Iterator<Item = PortBus> {
    let rows = buses.ports.iter().copied();
    let has = move |row: &&PortRow| row.adapters.contains(&kind);
    rows.filter(has).map(|row| row.bus)
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}
