//! The probes: a conversation for each property that the manual leaves open, and its possible values.

use super::hypothesis::Hypothesis;
use crate::language::plan::Exchange;
use crate::language::read::RingScenario;
use crate::language::syntax::{DriveRange, Header, Influence, Setup, SetupKind};
use crate::twin::DecidingBits;
use harness_bench::link::link_name;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::times::Duration;
use harness_proto::nd21::bits::{flags2, ps_status, status};
use harness_proto::nd21::io::Input;
use harness_proto::nd21::ram;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::properties::PROPERTIES;
use harness_sim::nd21::{PROPERTIES as OF_THE_DRIVE, Property, Stimulus};
use include_dir::{Dir, include_dir};
use std::collections::BTreeSet;

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/probes/novobus");

static OF_DRIVES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/probes/nd21");

static CONVERSATIONS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../corpora/qualify/novobus");

static THOROUGH: Dir<'_> =
    include_dir!("$CARGO_MANIFEST_DIR/../../corpora/qualify/novobus-thorough");

/// Placeholder for a drive's number in a conversation that is played for several drives: the first ones, the middle one and the last
/// one.
const EACH: &str = "{drive}";

/// Placeholder for a silence, and its values: halves, because computers are not on time.
const GAP: &str = "{gap}";
const GAPS: [&str; 3] = ["12.5ms", "15.5ms", "18.5ms"];

/// Placeholders for telegrams that switch the monitoring of time-outs on or off in every drive (14.10.2), one after another. A gap between
/// them would be a time-out for the first drives before the last ones are switched (9.9).
const MONITORING: [(&str, u8); 2] = [
    ("{monitoring on}", flags2::MONITORING),
    ("{monitoring off}", 0),
];

/// Times that a time-out may have, in milliseconds (ND21 9.9: 10 to 20).
const TIME_OUTS: std::ops::RangeInclusive<u64> = 10..=20;

/// Times that a drive may wait after its time-out, in milliseconds, the manual's first (9.9).
const WAITS: [u64; 11] = [10, 5, 6, 7, 8, 9, 11, 12, 13, 14, 15];

/// A probe for a ring of a given size.
#[derive(Clone, Debug)]
pub(crate) struct Probe {
    /// The property that it settles.
    pub property: &'static str,
    /// The section that leaves it open.
    pub section: &'static str,
    /// What the probe asks.
    pub asked: ProbeTarget,
    /// What is assumed of the drive.
    pub assumed: Header,
    /// The conversations.
    pub entries: Vec<RingScenario>,
    /// The conversation in place of them for a drive that is silent while it tests itself (property `self-test-bus`): it cannot be polled.
    pub of_silent: Option<RingScenario>,
}

impl Probe {
    /// The drive that it asks; `None` where it asks the whole ring.
    pub(super) const fn drive(&self) -> Option<u8> {
        match self.asked {
            ProbeTarget::Drive(drive, _) => Some(drive),
            ProbeTarget::Ring => None,
        }
    }

    /// The property, and whose.
    pub(super) fn name(&self) -> String {
        let of = self
            .drive()
            .map_or_else(String::new, |drive| format!(" of drive {drive}"));
        format!("{}{of}", self.property)
    }
}

/// The property that says whether a drive is silent while it tests itself: it is asked before the others of a drive.
pub(super) const SELF_TEST_BUS: &str = "self-test-bus";

/// What the names of conversations for silent drives end with.
const OF_SILENT: &str = "-silent";

/// What a probe asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProbeTarget {
    /// The whole ring: every drive answers with its end of the bus.
    Ring,
    /// One drive, by these cells.
    Drive(u8, &'static [DecidingBits]),
}

/// The cells by which a drive is asked for a property of its own.
const LOOKS: &[(&str, &[DecidingBits])] = &[
    ("eeprom-read-time", &[look(ram::EEPROM_CONTROL, 0x20)]),
    ("eeprom-write-time", &[look(ram::EEPROM_CONTROL, 0x10)]),
    ("self-test-time", &[look(ram::STATUS, status::RESET)]),
    ("self-test-bus", &[]),
    (
        "ps-calculation-time",
        &[look(ram::PS_STATUS, ps_status::CALCULATED)],
    ),
    // The limit of the current that holds now is imax, and i0 behind the property's time; and the motor must have had all of it.
    (
        "i2t-time",
        &[
            look(ram::MMAX, 0xFF),
            look(ram::STATUS, status::CURRENT_LIMIT),
        ],
    ),
    ("s-ramp-wire", &[look(ram::PS_STATUS, 0xFF)]),
    // 4096 turns must be distinguished from 28,672, with some tolerance.
    ("ps-position", &[look(ram::PS_UMDREHUNG, 0x60)]),
    (
        "bus-errors",
        &[
            look(ram::STATUS, status::ERROR),
            look(ram::ERRORCODE, 0xFF),
            look(ram::ERRORCODE + 1, 0xFF),
        ],
    ),
];

const fn look(address: u16, mask: u8) -> DecidingBits {
    DecidingBits { address, mask }
}

/// The drives of a ring that are asked individually: the first ones, the middle one and the last one.
pub(crate) fn some_drives(drives: u8) -> BTreeSet<u8> {
    let some = [0, 1, drives / 2, drives.saturating_sub(1)];
    some.into_iter().filter(|drive| *drive < drives).collect()
}

/// The conversation of a property.
fn text(files: &'static Dir<'_>, property: &str) -> Option<&'static str> {
    files.get_file(format!("{property}.scn"))?.contents_utf8()
}

/// The probes for a ring of `drives`: those of the bus, then those of the drives behind it.
///
/// # Errors
/// A probe has mistakes.
pub(crate) fn probes(drives: u8) -> Result<Vec<Probe>, Box<Problems>> {
    let mut probes = Vec::new();
    for property in &PROPERTIES {
        let Some(text) = text(&FILES, property.name) else {
            continue;
        };
        let entries = match text.contains(GAP) {
            true => {
                let each = GAPS.iter().map(|gap| {
                    let name = format!("{}-{gap}", property.name);
                    probe(&name, &text.replace(GAP, gap), drives)
                });
                each.collect::<Result<_, _>>()?
            }
            false => vec![probe(property.name, text, drives)?],
        };
        probes.push(Probe {
            property: property.name,
            section: property.section,
            asked: ProbeTarget::Ring,
            assumed: Header::default(),
            entries,
            of_silent: None,
        });
    }
    let is_first = |first| move |property: &&Property| (property.name == SELF_TEST_BUS) == first;
    let (first, then) = (OF_THE_DRIVE.iter(), OF_THE_DRIVE.iter());
    for property in first
        .filter(is_first(true))
        .chain(then.filter(is_first(false)))
    {
        let looks = LOOKS.iter().find(|(name, _)| *name == property.name);
        let Some((text, (_, looks))) = text(&OF_DRIVES, property.name).zip(looks) else {
            continue;
        };
        for drive in some_drives(drives) {
            let name = format!("{}-drive-{drive}", property.name);
            let text = text.replace(EACH, &drive.to_string());
            let of_silent = self::text(&OF_DRIVES, &format!("{}{OF_SILENT}", property.name));
            let of_silent = of_silent.map(|text| {
                let text = text.replace(EACH, &drive.to_string());
                probe(&format!("{name}{OF_SILENT}"), &text, drives)
            });
            probes.push(Probe {
                property: property.name,
                section: property.section,
                asked: ProbeTarget::Drive(drive, looks),
                assumed: released(drive).into(),
                entries: vec![probe(&name, &text, drives)?],
                of_silent: of_silent.transpose()?,
            });
        }
    }
    Ok(probes)
}

/// The two inputs that release and start a drive, of which the bus shows nothing (ND21 5.3.3).
fn released(drive: u8) -> Setup {
    let high = |input| Stimulus::Input(input, true);
    let inputs = Influence::Stimuli(vec![high(Input::Gpin3), high(Input::Gpin5)]);
    Setup::new(DriveRange::one(0, drive), SetupKind::Influence(inputs))
}

fn probe(name: &str, text: &str, drives: u8) -> Result<RingScenario, Box<Problems>> {
    let mut text = text.to_owned();
    for (stands, data) in MONITORING {
        if text.contains(stands) {
            text = text.replace(stands, &telegrams(drives, ram::FLAGS2, data));
        }
    }
    let source = Source {
        name: format!("probe-{name}"),
        text: text.into(),
    };
    RingScenario::new(source, Some(drives))
}

/// The telegrams that write a byte to a cell of every drive (9.1, 10.2), the first drive behind the master first, as a scenario has bytes.
fn telegrams(drives: u8, address: u16, data: u8) -> String {
    let command = Command::WriteByte { address, data };
    let all = (0..drives).rev();
    let all = all.filter_map(|drive| Exchange::new(drives, drive, command));
    let bytes = all.flat_map(|exchange| exchange.bytes);
    let bytes: Vec<_> = bytes.map(|byte| format!("{byte:02X}")).collect();
    bytes.join(" ")
}

/// The longest silence before a drive sends zeros that the manual allows, in milliseconds: 20 and 10 (9.9).
const LONGEST_SILENCE: u64 = 30;

/// Placeholders for a link, and for the drive behind it, in a conversation that is played for every link that can carry faults.
const LINK: &str = "{link}";
const RECEIVER: &str = "{receiver}";

/// The conversations of a qualification, for a ring of `drives`, by their names; `reaches` says on which links faults can be put.
///
/// # Errors
/// One of them has mistakes.
pub(crate) fn conversations(
    drives: u8,
    reaches: &dyn Fn(usize) -> bool,
) -> Result<Vec<RingScenario>, Box<Problems>> {
    let mut files: Vec<_> = CONVERSATIONS.files().collect();
    files.sort_by_key(|file| file.path().to_owned());
    let named = files.into_iter().filter_map(|file| {
        let name = file.path().file_stem()?.to_str()?;
        Some((name, file.contents_utf8()?))
    });
    let mut entries = Vec::new();
    for (name, text) in named {
        if text.contains(LINK) {
            // Places are counted from the master's outgoing link; behind the last drive there is no drive that would locate a fault.
            for place in (0..drives).filter(|place| reaches(usize::from(*place))) {
                let link = link_name(0, drives, usize::from(place));
                let receiver = (drives - 1 - place).to_string();
                let source = Source {
                    name: format!("qualify-{name}-{}", link.replace("->", "-to-")),
                    text: text
                        .replace(LINK, &link)
                        .replace(RECEIVER, &receiver)
                        .into(),
                };
                entries.extend(entry_for(source, drives)?);
            }
            continue;
        }
        let each = match text.contains(EACH) {
            false => BTreeSet::from([0]),
            true => some_drives(drives),
        };
        for drive in each {
            let several = text.contains(EACH);
            let source = Source {
                name: match several {
                    true => format!("qualify-{name}-drive-{drive}"),
                    false => format!("qualify-{name}"),
                },
                text: text.replace(EACH, &drive.to_string()).into(),
            };
            entries.extend(entry_for(source, drives)?);
        }
    }
    Ok(entries)
}

/// A scenario on a ring of `drives`; `None` where it is for smaller rings.
fn entry_for(source: Source, drives: u8) -> Result<Option<RingScenario>, Box<Problems>> {
    match RingScenario::new(source.clone(), Some(drives)) {
        Ok(entry) => Ok(Some(entry)),
        // Without a size it is planned for its default.
        Err(problems) => match RingScenario::new(source, None) {
            Ok(_) => Ok(None),
            Err(_) => Err(problems),
        },
    }
}

/// The long conversations of a thorough qualification, for a ring of `drives`.
///
/// # Errors
/// One of them has mistakes.
pub(crate) fn thorough(drives: u8) -> Result<Vec<RingScenario>, Box<Problems>> {
    let mut files: Vec<_> = THOROUGH.files().collect();
    files.sort_by_key(|file| file.path().to_owned());
    let entries = files.into_iter().filter_map(|file| {
        let source = Source {
            name: format!("thorough-{}", file.path().file_stem()?.to_str()?),
            text: file.contents_utf8()?.into(),
        };
        entry_for(source, drives).transpose()
    });
    entries.collect()
}

/// The possible values of a property of the bus: first all drives alike, then one drive different from the others.
#[must_use]
pub(crate) fn hypotheses(property: &str, drives: u8) -> Vec<Hypothesis> {
    let known = PROPERTIES.iter().find(|known| known.name == property);
    let values: Vec<SetupKind> = match (property, known.map(|known| known.values)) {
        (_, None) => return Vec::new(),
        ("time-out", _) => return time_outs(),
        ("time-out-wait", _) => WAITS.map(|ms| time(property, ms)).to_vec(),
        (_, Some(words)) => {
            let words = words.iter();
            words.map(|word| SetupKind::word(property, word)).collect()
        }
    };
    let mut hypotheses: Vec<_> = values.iter().map(alike).collect();
    let places = (0..values.len()).flat_map(|value| {
        // Of two drives each is different from the other one.
        let once = move |other: &usize| *other != value && (drives > 2 || *other > value);
        let others = (0..values.len()).filter(once);
        others.flat_map(move |other| (0..drives).map(move |drive| (value, other, drive)))
    });
    // More hypotheses would not help a reader.
    let times = values.len() > 2;
    let places = places.take(if drives > 1 && !times { 1_000 } else { 0 });
    hypotheses.extend(places.map(|(value, other, drive)| {
        let (value, other) = (alike(&values[value]), &values[other]);
        let setup = Setup::new(DriveRange::one(0, drive), other.clone());
        Hypothesis {
            name: format!("{}, but drive {drive} {}", value.name, other.value()),
            header: value.header.and(&setup.into()),
        }
    }));
    hypotheses
}

/// Every drive has this value of a property.
fn alike(value: &SetupKind) -> Hypothesis {
    Hypothesis {
        name: value.value(),
        header: Setup::new(DriveRange::all(0), value.clone()).into(),
    }
}

fn time(property: &str, milliseconds: u64) -> SetupKind {
    SetupKind::time(property, Duration::millis(milliseconds))
}

/// Hypotheses for the time-out: first with the manual's wait and answer, then combined with the other values of these two properties,
/// because all three show together.
fn time_outs() -> Vec<Hypothesis> {
    let mut hypotheses = Vec::new();
    // The first is the default of a drive.
    let waits = std::iter::once(None).chain(WAITS.into_iter().skip(1).map(Some));
    for wait in waits {
        for silent in [false, true] {
            let longest = LONGEST_SILENCE - wait.unwrap_or(10);
            for ms in TIME_OUTS.filter(|ms| *ms <= longest) {
                let mut hypothesis = alike(&time("time-out", ms));
                let wait = wait.map(|ms| time("time-out-wait", ms));
                let silent = silent.then(|| SetupKind::word("time-out-answer", "silent"));
                for more in wait.into_iter().chain(silent) {
                    hypothesis.header = hypothesis.header.and(&alike(&more).header);
                }
                hypotheses.push(hypothesis);
            }
        }
    }
    hypotheses
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ND21 9.7: the drive that a damaged byte comes to spells out its address.
    #[test]
    fn every_reachable_link_is_located() {
        let names = |drives, reaches: &dyn Fn(usize) -> bool| -> Vec<String> {
            let entries = conversations(drives, reaches).expect("no mistakes");
            let names = entries.iter().map(|entry| entry.short_name().to_owned());
            names.filter(|name| name.contains("location")).collect()
        };
        let outer = names(3, &|place| place == 0);
        assert_eq!(outer, ["qualify-location-master-to-2"]);
        let inner = names(3, &|place| place < 2);
        assert_eq!(
            inner,
            ["qualify-location-master-to-2", "qualify-location-2-to-1"]
        );
        assert_eq!(names(250, &|_| true).len(), 250);
    }

    #[test]
    fn conversations_have_no_mistakes_on_rings_of_any_size() {
        for drives in [1, 2, 3, 16, 60, 250] {
            let all = conversations(drives, &|_| false).expect("no mistakes");
            assert!(all.len() >= 10, "{drives}");
            assert!(!thorough(drives).expect("no mistakes").is_empty());
        }
    }

    #[test]
    fn every_property_has_a_probe() {
        let probes = probes(3).expect("no mistakes");
        let asked = probes.iter().map(|probe| probe.property);
        let asked: BTreeSet<_> = asked.collect();
        let of_the_bus = PROPERTIES.iter().map(|property| property.name);
        let of_drives = OF_THE_DRIVE.iter().map(|property| property.name);
        let all: BTreeSet<_> = of_the_bus.chain(of_drives).collect();
        assert_eq!(asked, all);
        assert_eq!(hypotheses("read-long", 3).len(), 2 + 2 * 3);
        // Of two drives one is as the first value says.
        assert_eq!(hypotheses("read-long", 2).len(), 2 + 2);
        assert_eq!(hypotheses("read-long", 1).len(), 2);
    }
}
