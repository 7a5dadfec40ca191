//! A rig by its name: `sim:3`, a file, a file of a folder of rigs, or one that the program carries.

use super::buses::RigBuses;
use super::check::{Rig, parse};
use super::port_file::PortBus;
use crate::rig::rings::{simulated_rings, sizes_of_rings};
use crate::scenario::problem::{Problems, nearest};
use crate::scenario::source::{Source, SourceError};
use include_dir::{Dir, include_dir};
use std::path::{Path, PathBuf};

/// The rigs that the binary carries.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../rigs");

/// The folder of rigs, where the environment names one.
pub(crate) const FOLDER_VARIABLE: &str = "DRIVEBENCH_RIGS";

/// The most rigs that are taken from a folder.
const MAX_RIGS: usize = 1000;

/// Why a rig cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// Nothing has this name.
    #[error("failed to find the rig {name}: neither a file nor a rig of that name; {remedy}")]
    NotFound {
        /// The name as given.
        name: String,
        remedy: String,
    },
    /// `sim:` followed by something other than sizes of rings.
    #[error("failed to make the rig {name}: {reason}")]
    Simulated {
        /// The name as given.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A file cannot be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// A file has mistakes.
    #[error(transparent)]
    Mistakes(#[from] Box<Problems>),
}

/// The folder in which rigs are kept: `$DRIVEBENCH_RIGS`, else `rigs` where the program was started.
#[must_use]
pub fn folder() -> PathBuf {
    std::env::var_os(FOLDER_VARIABLE)
        .filter(|folder| !folder.is_empty())
        .map_or_else(|| PathBuf::from("rigs"), PathBuf::from)
}

/// Finds and reads a rig: `sim:N`, `sim:N,M` and `sim:BUS:N`, the path of a file, the name of a file of `folder`, or
/// the name of a built-in one, in this order.
///
/// # Errors
/// There is no such rig, or its file has mistakes.
pub fn find(name: &str, folder: &Path, buses: &'static RigBuses) -> Result<Rig, FindError> {
    if let Some(sizes) = name.strip_prefix("sim:") {
        let text = match simulated_port(sizes) {
            Some((bus, drives)) => drives.map(|drives| simulated_bus(bus, drives, buses)),
            None => simulated_rings(sizes).map_err(|reason| or_meant(sizes, reason)),
        };
        let text = text.map_err(|reason| FindError::Simulated {
            name: name.to_owned(),
            reason,
        })?;
        let source = Source {
            name: name.to_owned(),
            text: text.into(),
        };
        return read(&source, buses);
    }
    let path = Path::new(name);
    let is_path = name.contains('/') || path.extension().is_some_and(|ending| ending == "toml");
    if is_path && path.exists() {
        return read(&Source::read(path)?, buses);
    }
    let all = all(folder);
    if let Some((_, place)) = all.iter().find(|(known, _)| known == name) {
        return read(&place.source()?, buses);
    }
    let known: Vec<_> = all.iter().map(|(name, _)| name.as_str()).collect();
    let near = nearest(name, &known).map(str::to_owned);
    let near = near
        .or_else(|| simulated_name(name))
        .map(|near| format!("did you mean `{near}`? "));
    Err(FindError::NotFound {
        name: name.to_owned(),
        remedy: format!(
            "{}the rigs are {}, and sim:N",
            near.unwrap_or_default(),
            known.join(", ")
        ),
    })
}

/// The name of the simulated rig that was probably meant, given what stands behind `sim:`: `nordca:2` means `sim:nordac:2`.
fn meant_bus(text: &str) -> Option<String> {
    let (word, number) = text.split_once(':').unwrap_or((text, ""));
    let names = PortBus::ALL.map(PortBus::name);
    let bus = nearest(word, &names)?;
    let colon = if number.is_empty() { "" } else { ":" };
    let meant = format!("{bus}{colon}{number}");
    simulated_port(&meant)?.1.ok()?;
    Some(format!("sim:{meant}"))
}

/// Why there is no simulated rig of this name, given what stands behind `sim:`: the bus that was probably meant, or this reason.
pub(crate) fn or_meant(text: &str, reason: String) -> String {
    meant_bus(text).map_or(reason, |meant| {
        format!("there is no bus of this name; did you mean `{meant}`?")
    })
}

/// The name of a simulated rig that was probably meant: `simm:3`, `sim3` and `SIM 3` mean `sim:3`, `sin:nordac` means `sim:nordac`.
fn simulated_name(name: &str) -> Option<String> {
    if let Some((word, bus)) = name.split_once(':') {
        nearest(word, &["sim"])?;
        if let Some(meant) = meant_bus(bus) {
            return Some(meant);
        }
    } else if let Some(meant) = meant_bus(name) {
        return Some(meant);
    }
    let digit = name.find(|c: char| c.is_ascii_digit())?;
    let (word, sizes) = name.split_at(digit);
    let word = word.trim_end_matches(|c: char| !c.is_alphanumeric());
    nearest(word, &["sim"])?;
    sizes_of_rings(sizes).ok()?;
    Some(format!("sim:{sizes}"))
}

/// Where a rig stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RigPlace {
    /// In a file.
    File(PathBuf),
    /// In the binary; the name of its file.
    BuiltIn(String),
}

impl RigPlace {
    /// The text of the file.
    ///
    /// # Errors
    /// It cannot be read or is no text.
    pub fn source(&self) -> Result<Source, SourceError> {
        match self {
            Self::File(path) => Source::read(path),
            Self::BuiltIn(name) => {
                let bytes = BUILT_IN
                    .get_file(name)
                    .map_or(&[][..], include_dir::File::contents);
                Source::from_bytes(name.clone(), bytes.to_vec())
            }
        }
    }
}

/// Reads a rig.
///
/// # Errors
/// Its mistakes.
pub fn read(source: &Source, buses: &'static RigBuses) -> Result<Rig, FindError> {
    parse(source, buses).map_err(|problems| Box::new(problems).into())
}

/// Every rig with its name, in order: those of `folder`, and the built-in ones with other names.
#[must_use]
pub fn all(folder: &Path) -> Vec<(String, RigPlace)> {
    let mut all = std::collections::BTreeMap::new();
    for file in BUILT_IN.files() {
        if let Some(name) = rig_name(file.path()) {
            let place = file.path().display().to_string();
            all.insert(name, RigPlace::BuiltIn(place));
        }
    }
    // A folder that is not there has no rigs.
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    for path in entries
        .take(MAX_RIGS)
        .filter_map(Result::ok)
        .map(|entry| entry.path())
    {
        if let Some(name) = rig_name(&path) {
            all.insert(name, RigPlace::File(path));
        }
    }
    all.into_iter().collect()
}

fn rig_name(path: &Path) -> Option<String> {
    path.extension().filter(|ending| *ending == "toml")?;
    Some(path.file_stem()?.to_str()?.to_owned())
}

/// The number of drives of `sim:BUS` and `sim:BUS:N` for a bus of [`Port`](super::port_file::Port), given what stands behind `sim:`; `None`
/// where no bus is named.
#[must_use]
pub(crate) fn simulated_port(text: &str) -> Option<(PortBus, Result<u8, String>)> {
    let (bus, number) = text.split_once(':').unwrap_or((text, "1"));
    let bus = PortBus::ALL.into_iter().find(|known| known.name() == bus)?;
    let most = bus.most_drives();
    let drives = number.parse().ok();
    let drives = drives.filter(|drives| (1..=most).contains(drives));
    let wrong = || format!("`{number}` is not a number of drives: 1 to {most} expected");
    Some((bus, drives.ok_or_else(wrong)))
}

/// The file of a simulated bench with a port. All is permitted.
fn simulated_bus(bus: PortBus, drives: u8, buses: &RigBuses) -> String {
    let (nodes, limits) = (buses.port(bus).simulated)(drives);
    let name = bus.name();
    format!(
        "schema = 2\n[rig]\nid = \"sim-{name}-{drives}\"\n[port.1]\nbus = \"{name}\"\ndrives = [{nodes}]\n[sim]\nbus = \"{name}\"\n\
         [limits]\nallow_motion = true\nallow_eeprom = true\n{limits}"
    )
}
