//! Why a scenario is not played on a rig, and what would let it be played.

use crate::bus_name::BusName;
use crate::link::{Capability, Link, is_wrong_parity};
use crate::scenario::language::Language;
use crate::scenario::plan::Plan;
use harness_proto::limit::LimitSetting;
use std::collections::BTreeSet;
use std::fmt;

/// A scenario that is not played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skip {
    /// Why, as far as one obstacle hides others: the first of them.
    pub why: Why,
    /// All that would let it be played, together; empty where nothing on this rig would.
    pub unlocks: BTreeSet<Unlock>,
}

/// The first obstacle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Why {
    /// The rig cannot do this.
    Lacks(Vec<Capability>),
    /// A fault is to be put on this link, where the rig has no interposer.
    NoInterposer(String),
    /// A byte is to get a wrong parity bit on this link, where the interposer has one UART for both directions.
    OneUart(String),
    /// What goes over this link must be seen, where the rig has no tap.
    NoTap(String),
    /// It is for rings with these numbers of drives, each from the first to the second, and the rig has those.
    OtherSize(Vec<(u8, u8)>, Vec<u8>),
    /// The rig's limits deny a byte or a fault of it, in the guard's words.
    Denied(String),
    /// The rig's drives are not those that it is for: what differs, in a sentence.
    OtherDrives(String),
    /// The bench knows no such bus.
    NoBus(BusName),
    /// The rig has no such bus.
    NotOnRig,
    /// The run ended before it.
    RunEnded,
}

/// One thing that would let scenarios be played, together with others.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unlock {
    /// A change of this setting in the rig's `[limits]`.
    Limit(LimitSetting),
    /// A change of a setting in the rig's `[limits]` that only some buses have, as one says it.
    PortLimit(&'static str),
    /// Another setting of the rig's `[port.1]`, as its file has it.
    Port(String),
    /// A tap at this link.
    Tap(String),
    /// An interposer at this link.
    Interposer(String),
    /// An interposer with a port for each direction at this link.
    TwoPorts(String),
    /// Ports that send and show line errors.
    LineErrors,
    /// Rings with these numbers of drives, each from the first to the second.
    Rings(Vec<(u8, u8)>),
    SecondRing,
    /// Drives that are simulated in the program.
    Simulated,
    /// No rig: simulated drives of which no record must show everything.
    NoRig,
    /// A rig with this bus.
    Bus(BusName),
}

impl Skip {
    /// A scenario for another bus than the rig's.
    #[must_use]
    pub fn not_on_rig(bus: BusName) -> Self {
        Self {
            why: Why::NotOnRig,
            unlocks: [Unlock::Bus(bus)].into(),
        }
    }

    /// A scenario for a bus that the bench does not know.
    #[must_use]
    pub fn no_bus(bus: BusName) -> Self {
        Why::NoBus(bus).into()
    }

    /// A scenario for rings of these sizes, on a rig of those.
    #[must_use]
    pub fn other_size(sizes: Vec<(u8, u8)>, rig: Vec<u8>) -> Self {
        Self {
            unlocks: [Unlock::Rings(sizes.clone())].into(),
            why: Why::OtherSize(sizes, rig),
        }
    }

    /// Adds further needs. What needs the simulator needs nothing else.
    #[must_use]
    pub fn and(mut self, more: impl IntoIterator<Item = Unlock>) -> Self {
        self.unlocks.extend(more);
        if self.unlocks.contains(&Unlock::Simulated) {
            self.unlocks = [Unlock::Simulated].into();
        }
        self
    }

    /// The same on a rig with a port, where not even simulated drives show what only the simulator has.
    #[must_use]
    pub(crate) fn on_port(mut self) -> Self {
        if self.unlocks.remove(&Unlock::Simulated) {
            self.unlocks.insert(Unlock::NoRig);
        }
        self
    }
}

impl From<Why> for Skip {
    fn from(why: Why) -> Self {
        Self {
            why,
            unlocks: BTreeSet::new(),
        }
    }
}

impl Why {
    /// The reason without places and other details, so that skipped scenarios can be counted by it.
    #[must_use]
    pub fn group(&self) -> String {
        match self {
            Self::NoInterposer(_) => "the rig has no interposer".to_owned(),
            Self::OneUart(_) => format!("an interposer has one port: {ONE_PARITY}"),
            Self::NoTap(_) => "the rig has no tap".to_owned(),
            Self::OtherSize(..) => "it is for rings of another size".to_owned(),
            Self::Denied(_) => DENIED.trim_end_matches(": ").to_owned(),
            Self::OtherDrives(_) => "it is for drives in another state than the rig's".to_owned(),
            // Whatever else is missing, a simulated rig has it.
            Self::Lacks(missing) if missing.iter().any(|capability| simulated(*capability)) => {
                "the rig has no simulator".to_owned()
            }
            Self::Lacks(_) | Self::NoBus(_) | Self::NotOnRig | Self::RunEnded => self.to_string(),
        }
    }
}

/// Why an interposer with one port damages no parity bit.
const ONE_PARITY: &str = "a UART has one parity setting for both directions, so wrong parity needs two ports, one for each direction";

/// The start of a denial in a record; the guard's message follows.
pub const DENIED: &str = "the rig's [limits] do not let it be played to its end: ";

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lacks(missing) => {
                let names: Vec<_> = missing.iter().map(|capability| capability.name()).collect();
                write!(f, "the rig has no {}", names.join(", no "))
            }
            Self::NoTap(place) => write!(f, "the rig has no tap at {place}"),
            Self::OneUart(place) => {
                write!(f, "the interposer at {place} has one port: {ONE_PARITY}")
            }
            Self::NoInterposer(place) => write!(f, "the rig has no interposer at {place}"),
            Self::OtherSize(wanted, rig) => write!(
                f,
                "it is for rings of another size ({}, the rig has {})",
                in_words(wanted),
                sizes(rig)
            ),
            Self::Denied(words) => write!(f, "{DENIED}{words}"),
            Self::OtherDrives(words) => f.write_str(words),
            Self::NoBus(bus) => write!(f, "the bench has no bus `{}` yet", bus.name()),
            Self::NotOnRig => f.write_str("the rig has no such bus"),
            Self::RunEnded => f.write_str("the run ended before it"),
        }
    }
}

/// Numbers of drives: `3 and 2`.
pub fn sizes(sizes: &[u8]) -> String {
    let sizes: Vec<_> = sizes.iter().map(u8::to_string).collect();
    sizes.join(" and ")
}

/// `1 drive`, `2 to 8 and 250 drives`.
fn in_words(sizes: &[(u8, u8)]) -> String {
    if let [(1, 1)] = sizes {
        return "1 drive".to_owned();
    }
    let words = |(smallest, largest): &(u8, u8)| match smallest == largest {
        true => smallest.to_string(),
        false => format!("{smallest} to {largest}"),
    };
    let words: Vec<_> = sizes.iter().map(words).collect();
    format!("{} drives", words.join(" and "))
}

/// What is needed together, in words.
#[must_use]
pub fn together(unlocks: &BTreeSet<Unlock>) -> String {
    let (mut settings, mut port_limits, mut port) = (Vec::new(), Vec::new(), Vec::new());
    let (mut taps, mut interposers, mut others) = (Vec::new(), Vec::new(), Vec::new());
    for unlock in unlocks {
        match unlock {
            Unlock::Limit(setting) => settings.push(*setting),
            Unlock::PortLimit(setting) => port_limits.push((*setting).to_owned()),
            Unlock::Port(setting) => port.push(setting.clone()),
            Unlock::Tap(place) => taps.push(place.as_str()),
            Unlock::Interposer(place) => interposers.push(place.as_str()),
            other => others.push(other.to_string()),
        }
    }
    let everything = |all: &[LimitSetting]| all.iter().all(|setting| settings.contains(setting));
    let mut limits = match everything(&LimitSetting::PERMISSIONS) {
        true => vec!["every permission".to_owned()],
        false => settings.iter().map(LimitSetting::to_string).collect(),
    };
    limits.extend(port_limits);
    let limits = within("limits", &limits);
    let port = within("port.1", &port);
    let motion = settings.contains(&LimitSetting::Motion);
    let option = motion.then(|| "--allow-motion".to_owned());
    let taps = at_places("tap", &taps);
    let interposers = at_places("interposer", &interposers);
    let all = limits
        .into_iter()
        .chain(option)
        .chain(port)
        .chain(taps)
        .chain(interposers)
        .chain(others);
    all.collect::<Vec<_>>().join(" and ")
}

/// `` `rate = 500` and `drives = [...]` in [port.1] ``.
fn within(table: &str, settings: &[String]) -> Option<String> {
    let some = !settings.is_empty();
    some.then(|| format!("{} in [{table}]", settings.join(" and ")))
}

/// The most links that are named one by one.
const NAMED_LINKS: usize = 3;

/// `a tap at 1->0`, `taps at 1->0 and 2->1`, `taps at 99 links`.
fn at_places(what: &str, places: &[&str]) -> Option<String> {
    let article = if what.starts_with('i') { "an" } else { "a" };
    match places {
        [] => None,
        [place] => Some(format!("{article} {what} at {place}")),
        few if few.len() <= NAMED_LINKS => Some(format!("{what}s at {}", few.join(" and "))),
        many => Some(format!("{what}s at {} links", many.len())),
    }
}

impl fmt::Display for Unlock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limit(setting) => write!(f, "{setting} in [limits]"),
            Self::PortLimit(setting) => write!(f, "{setting} in [limits]"),
            Self::Port(setting) => write!(f, "{setting} in [port.1]"),
            Self::Tap(place) => write!(f, "a tap at {place}"),
            Self::Interposer(place) => write!(f, "an interposer at {place}"),
            Self::TwoPorts(place) => write!(f, "two ports at the interposer at {place}"),
            Self::LineErrors => f.write_str("ports that show line errors and send wrong parity"),
            Self::Rings(drives) => match drives.as_slice() {
                [one] => write!(f, "a ring of {}", in_words(&[*one])),
                all => write!(f, "rings of {}", in_words(all)),
            },
            Self::SecondRing => f.write_str("a second ring"),
            Self::Simulated => f.write_str("a simulated rig"),
            Self::NoRig => f.write_str("`run` without --rig"),
            Self::Bus(bus) => write!(f, "a rig with the bus `{}`", bus.name()),
        }
    }
}

/// What a link lacks for a plan; `None` where the plan can be played.
#[must_use]
pub fn lacks<L: Language>(plan: &Plan<L>, link: &dyn Link) -> Option<Skip> {
    let able = |need: &Capability| link.capabilities().contains(need);
    let missing: Vec<_> = plan
        .needs
        .iter()
        .copied()
        .filter(|need| !able(need))
        .collect();
    let name = |(port, place): &(usize, usize)| L::link_name(plan, *port, *place);
    let faults = L::fault_links(plan).into_iter();
    let unreached: Vec<_> = faults
        .map(|(ring, place, _)| (ring, place))
        .filter(|(ring, place)| !link.reaches(*ring, *place))
        .collect();
    let faults = L::fault_links(plan).into_iter();
    let one_uart: BTreeSet<_> = faults
        .filter(|(ring, place, fault)| {
            is_wrong_parity(*fault) && !link.damages_parity(*ring, *place)
        })
        .map(|(ring, place, _)| (ring, place))
        .collect();
    // An interposer sees what it passes on.
    let unheard: Vec<_> = L::heard_links(plan)
        .into_iter()
        .filter(|(ring, place)| !link.listens(*ring, *place))
        .filter(|place| !unreached.contains(place))
        .collect();
    let first = (unreached.first(), unheard.first(), one_uart.first());
    let why = match (missing.as_slice(), first) {
        ([], (None, None, None)) => return None,
        ([], (Some(place), ..)) => Why::NoInterposer(name(place)),
        ([], (None, Some(place), _)) => Why::NoTap(name(place)),
        ([], (None, None, Some(place))) => Why::OneUart(name(place)),
        (missing, _) => Why::Lacks(missing.to_vec()),
    };
    let unlocks = missing.iter().filter_map(|capability| unlock(*capability));
    let interposers = unreached.iter().map(name).map(Unlock::Interposer);
    let taps = unheard.iter().map(name).map(Unlock::Tap);
    let ports = one_uart.iter().map(name).map(Unlock::TwoPorts);
    let places = interposers.chain(taps).chain(ports);
    Some(Skip::from(why).and(unlocks.chain(places)))
}

/// What a plan for rings of other sizes needs besides them. Inner links have their names of its own rings.
pub fn lacks_as_well<L: Language>(
    plan: &Plan<L>,
    link: &dyn Link,
    is_inner: impl Fn(usize, usize) -> bool,
) -> Vec<Unlock> {
    let lacks = |need: &Capability| !link.capabilities().contains(need);
    let inner = |links: Vec<(usize, usize)>| {
        let inner = links
            .into_iter()
            .filter(|(ring, place)| is_inner(*ring, *place));
        let names = inner.map(|(ring, place)| L::link_name(plan, ring, place));
        names.collect::<Vec<_>>()
    };
    let missing: Vec<_> = plan.needs.iter().filter(|need| lacks(need)).collect();
    let unlocks = missing.iter().filter_map(|capability| unlock(**capability));
    let unlocks = unlocks.filter(|unlock| *unlock != Unlock::SecondRing);
    let mut unlocks: Vec<_> = unlocks.collect();
    if lacks(&Capability::Interposer) {
        let places = L::fault_links(plan).into_iter();
        let places = inner(places.map(|(ring, place, _)| (ring, place)).collect());
        unlocks.extend(places.into_iter().map(Unlock::Interposer));
    }
    if lacks(&Capability::Tap) && lacks(&Capability::Interposer) {
        let places = inner(L::heard_links(plan).into_iter().collect());
        unlocks.extend(places.into_iter().map(Unlock::Tap));
    }
    unlocks
}

/// What gives a rig a capability; `None` for taps and interposers, whose places are known.
fn unlock(missing: Capability) -> Option<Unlock> {
    Some(match missing {
        Capability::Interposer | Capability::Tap => return None,
        Capability::Motion => Unlock::Limit(LimitSetting::Motion),
        Capability::Eeprom => Unlock::Limit(LimitSetting::Eeprom),
        Capability::Reset => Unlock::Limit(LimitSetting::Reset),
        Capability::LineErrors => Unlock::LineErrors,
        Capability::TwoRings => Unlock::SecondRing,
        Capability::Memory | Capability::Power | Capability::Simulator => Unlock::Simulated,
    })
}

/// Whether only drives that are simulated in the program have it: looks into a drive, its plugs and its power.
fn simulated(missing: Capability) -> bool {
    unlock(missing) == Some(Unlock::Simulated)
}
