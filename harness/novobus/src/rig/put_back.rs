//! What scenarios leave changed in the drives of a ring: read before, put back on drives in their safe state, and read again to see it.
//!
//! A cell of the RAM holds until a reset (ND21 10.5), a cell of the EEPROM for ever (14.10.5), an output until a reset or a `WriteIO` (10.4), an
//! error until it is confirmed (14.10.1). A reset at the end would lose what was in RAM alone before the run (12.7), so each cell that differs
//! is written. Positions, orders and what the drive's program works in are not put back: they are the drive's own.

use super::session::{OfRings as _, Session, come_round};
use crate::driver::{Axis, Error, OpenRings, Options, Width};
use crate::gate::GuardsRings as _;
use crate::guard::safe_state::telegram;
use harness_bench::guard::Guarded;
use harness_bench::link::{Line, Octets as _};
use harness_bench::medium::Out;
use harness_bench::rig::Ends;
use harness_proto::nd21::bits::{flags2, status};
use harness_proto::nd21::cells::{Cell, CellAccess, RAM, cell_at};
use harness_proto::nd21::io::{GPO1, GPO2, OUTPUTS};
use harness_proto::nd21::own::{is_own, outputs_of_the_bus};
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::guard::{DriveAct, Limits, Need, Touched};
use harness_proto::novobus::output::{Output, OutputChange};
use harness_proto::time::Span;
use std::collections::{BTreeMap, BTreeSet};

#[cfg(test)]
mod tests;

/// How often something is tried: a byte may be lost.
const TRIES: usize = 3;

/// How long a drive may take to answer.
const PATIENCE: Span = Span::from_millis(2_000);

/// Settings among the cells in which a part of the drive's program works (14.10.6, 13.1.4): it only reads these.
const SETTINGS: [u16; 6] = [
    ram::SCOPE_TIMER0,
    ram::SCOPE_TRIGGER,
    ram::SCOPE_LEVEL,
    ram::SCOPE_SIGNAL1,
    ram::SCOPE_SIGNAL2,
    ram::PS_V0,
];

/// Something of a drive that is put back, in the order in which it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// A byte of the EEPROM.
    Eeprom(u8),
    /// A cell of the RAM, by its address.
    Ram(u16),
    /// GPO1 and GPO2: in the high byte those that only the bus sets (10.4, 14.7.4, 14.7.5); the drive may set the others at any time.
    Outputs,
    /// The bit of `Flags2` that switches the monitoring of time-outs (14.10.2).
    Monitoring,
}

/// What drives held.
type Values = BTreeMap<(Axis, Place), u16>;

/// What the drives of a rig held before the first scenario that may change it.
#[derive(Debug, Default)]
pub(super) struct HeldValues {
    values: Values,
    /// The drives that were in an error which is not of the bus, with its code; `None` before the first scenario.
    errors: Option<BTreeMap<Axis, u16>>,
    /// What a run before has left, to be said at the end.
    earlier: Option<String>,
}

/// Whether a cell holds what a master sets, and the drive leaves it so. The safe state sets the nominal speed.
fn is_setting(cell: &Cell) -> bool {
    let address = cell.address;
    let free = cell.access == CellAccess::Write && cell.size <= 2 && !is_own(address);
    SETTINGS.contains(&address) || free && address != ram::NSOLL
}

/// What these limits let a scenario change without a reset: RAM and outputs.
pub(super) fn within(limits: &Limits) -> impl Iterator<Item = Touched> {
    let permits = |address| {
        let byte = DriveAct::WriteByte(address, 0);
        let word = DriveAct::WriteWord(address, 0);
        [byte, word]
            .iter()
            .any(|act| limits.missing(act.need()).is_none())
    };
    let cells = RAM.iter().map(|cell| cell.address);
    let cells = cells.filter(move |address| permits(*address) || limits.motion);
    let outputs = limits.outputs.then_some(Touched::Outputs);
    let monitoring = limits.monitoring.then_some(Touched::Ram(ram::FLAGS2));
    cells.map(Touched::Ram).chain(outputs).chain(monitoring)
}

/// What is put back where this may have been changed.
fn places(touched: Touched) -> Vec<Place> {
    match touched {
        Touched::Eeprom(cell) => vec![Place::Eeprom(cell)],
        Touched::Outputs => vec![Place::Outputs],
        Touched::Ram(ram::FLAGS2) => vec![Place::Monitoring],
        Touched::Ram(address) => {
            let cell = cell_at(address).filter(|cell| is_setting(cell));
            cell.map(|cell| Place::Ram(cell.address))
                .into_iter()
                .collect()
        }
        Touched::Reset => {
            let settings = RAM.iter().filter(|cell| is_setting(cell));
            let settings = settings.map(|cell| Place::Ram(cell.address));
            settings
                .chain([Place::Outputs, Place::Monitoring])
                .collect()
        }
    }
}

impl Place {
    fn width(address: u16) -> Width {
        match cell_at(address) {
            Some(cell) if cell.size == 2 => Width::Word,
            _ => Width::Byte,
        }
    }

    /// Whether it holds something else; once it was `written`, only what the drive keeps counts.
    fn differs(self, before: u16, now: u16, written: bool) -> bool {
        let bits = match self {
            Self::Outputs if written => before >> 8,
            Self::Outputs => u16::from(GPO1 | GPO2),
            _ => u16::MAX,
        };
        (before ^ now) & bits != 0
    }

    /// The commands that write what it held; the EEPROM controller needs some time behind its own (14.10.5.3).
    fn commands(self, value: u16) -> Vec<Command> {
        let [_, low] = value.to_be_bytes();
        let write = |address, data| Command::WriteByte { address, data };
        let [_, address_low] = ram::FLAGS2.to_be_bytes();
        match self {
            Self::Eeprom(cell) => vec![
                write(ram::EEPROM_BUFFER, cell),
                write(ram::EEPROM_BUFFER + 1, low),
                write(ram::EEPROM_CONTROL, 0x82),
            ],
            Self::Ram(address) if Self::width(address) == Width::Word => {
                vec![Command::WriteWord {
                    address,
                    data: value,
                }]
            }
            Self::Ram(address) => vec![write(address, low)],
            Self::Outputs => [(GPO1, Output::Gpo1), (GPO2, Output::Gpo2)]
                .into_iter()
                .map(|(bit, output)| {
                    let set = low & bit != 0;
                    Command::WriteIo(OutputChange { output, set })
                })
                .collect(),
            Self::Monitoring if value == 0 => vec![Command::And {
                address_low,
                data: !flags2::MONITORING,
            }],
            Self::Monitoring => vec![Command::Or {
                address_low,
                data: flags2::MONITORING,
            }],
        }
    }

    /// What `drivebench write` takes, and whether it needs --move; in words what it does not.
    fn assignment(self, value: u16) -> Result<(String, bool), String> {
        let [high, low] = value.to_be_bytes();
        let moves = |act: DriveAct| act.need().contains(Need::MOTION);
        match self {
            Self::Eeprom(cell) => Ok((format!("ee:{cell:02X}=0x{low:02X}"), false)),
            Self::Ram(address) if Self::width(address) == Width::Word => {
                let moves = moves(DriveAct::WriteWord(address, value));
                Ok((format!("{address:04X}:2=0x{value:04X}"), moves))
            }
            Self::Ram(address) => {
                let moves = moves(DriveAct::WriteByte(address, low));
                Ok((format!("{address:04X}=0x{low:02X}"), moves))
            }
            Self::Monitoring => Ok((format!("Flags2=0x{low:02X}"), true)),
            Self::Outputs => {
                let one = |(bit, name)| {
                    let level = if low & bit == 0 { "cleared" } else { "set" };
                    (high & bit != 0).then(|| format!("{name} was {level} (WriteIO, ND21 10.4)"))
                };
                let all = [(GPO1, "GPO1"), (GPO2, "GPO2")];
                Err(all
                    .into_iter()
                    .filter_map(one)
                    .collect::<Vec<_>>()
                    .join(", "))
            }
        }
    }
}

/// What is said of drives that hold something else than `values`, with the command that puts it back.
fn sentences(values: &Values, why: &str, origin: &str) -> Vec<String> {
    let axes: BTreeSet<_> = values.keys().map(|(axis, _)| *axis).collect();
    let of_drive = |axis: Axis| {
        let values = values.iter().filter(|(place, _)| place.0 == axis);
        let (mut assignments, mut words, mut moves) = (String::new(), String::new(), "");
        for ((_, place), value) in values {
            match place.assignment(*value) {
                Ok((assignment, needs_motion)) => {
                    assignments += &format!(" {assignment}");
                    moves = if needs_motion { " --move" } else { moves };
                }
                Err(other) if other.is_empty() => {}
                Err(other) => words += &format!("; {other}"),
            }
        }
        if !assignments.is_empty() {
            words += &format!(
                "; to put it back, `drivebench write {axis}{assignments}{moves} --rig {origin}`"
            );
        }
        (!words.is_empty()).then(|| format!("drive {axis}: {why}{words}"))
    };
    axes.into_iter().filter_map(of_drive).collect()
}

/// An error that any master causes which recovers the ring (ND21 9.8, 14.11.14).
fn is_of_the_bus(code: u16) -> bool {
    (0x0501..=0x0508).contains(&code)
}

/// Scenarios are about to be played: says what a run before, which was killed, has left.
pub(super) fn begin(session: &mut Session) {
    session.drives_mut().before.earlier = session.left().take_before();
}

/// Reads what a scenario may change of the drives, where it has not been read: nothing of it is recorded. Where drives may be in the middle
/// of something, their rings are recovered first if that `may_recover`.
pub(super) fn remember(
    session: &mut Session,
    touched: &BTreeSet<(Axis, Touched)>,
    may_recover: bool,
) {
    if session.rig().is_simulated() {
        return;
    }
    let first = session.drives().before.errors.is_none();
    if first {
        let _of_others = session.link().take_touched();
    }
    let all = touched
        .iter()
        .flat_map(|(axis, touched)| places(*touched).into_iter().map(|place| (*axis, place)));
    let mut wanted: BTreeSet<_> = all.collect();
    wanted.retain(|place| !session.drives().before.values.contains_key(place));
    if !first && wanted.is_empty() {
        return;
    }
    if !session.link().at_rest() && may_recover {
        // What is wrong with the rings is said by the examination in front of the scenario.
        let _examined = session.examined();
    }
    if session.link().at_rest() {
        let (rings, axes) = (session.rings().to_vec(), session.axes());
        let read = session.link().aside(|link| {
            with_bus(link, &rings, |bus| {
                let errors = first.then(|| errors(bus, &axes)).transpose()?;
                Ok((read(bus, &wanted)?, errors))
            })
        });
        // What was not read is said at the end, if it was changed.
        if let Ok((values, errors)) = read {
            let before = &mut session.drives_mut().before;
            before.values.extend(values);
            before.errors = errors.or(before.errors.take());
        }
    }
    session.drives_mut().before.errors.get_or_insert_default();
    let (values, origin) = (&session.drives().before.values, &session.rig().origin);
    let left = sentences(values, "nothing was put back", origin);
    session.left().foretell(left, None);
}

/// Puts back what scenarios have changed since drives were [read](remember), where they were seen in their safe state. Returns what is
/// left to say.
pub(crate) fn put_back(session: &mut Session, safe: bool) -> Vec<String> {
    let HeldValues {
        values,
        errors,
        earlier,
    } = std::mem::take(&mut session.drives_mut().before);
    let mut all: Vec<_> = earlier.into_iter().collect();
    if let Some(errors) = errors {
        let notes = all_back(session, safe, values, &errors);
        session.left().keep(&notes);
        all.extend(notes);
    }
    all
}

fn all_back(
    session: &mut Session,
    safe: bool,
    values: Values,
    errors: &BTreeMap<Axis, u16>,
) -> Vec<String> {
    let origin = session.rig().origin.clone();
    let touched = session.link().take_touched();
    let unread: BTreeSet<_> = touched
        .into_iter()
        .flat_map(|(axis, touched)| places(touched).into_iter().map(move |place| (axis, place)))
        .filter(|place| !values.contains_key(place))
        .collect();
    let mut by_drive: BTreeMap<Axis, String> = BTreeMap::new();
    for (axis, place) in unread {
        let name = place.assignment(0).map_or_else(
            |_| " GPO1 or GPO2".to_owned(),
            |(assignment, _)| format!(" {}", assignment.split('=').next().unwrap_or_default()),
        );
        by_drive.entry(axis).or_default().push_str(&name);
    }
    let unread = by_drive.into_iter().map(|(axis, names)| {
        format!("drive {axis}: what was held before a scenario wrote it is not known, and not put back:{names}")
    });
    let mut notes: Vec<_> = unread.collect();
    if !safe {
        notes.extend(sentences(&values, "nothing was put back", &origin));
    } else {
        if !session.link().at_rest() {
            let _examined = session.examined();
        }
        let rings = session.rings().to_vec();
        let link = session.link();
        let left = values_back(link, &rings, values);
        for (why, left) in &left {
            notes.extend(sentences(left, why, &origin));
        }
        if left.is_empty() {
            notes.extend(errors_back(link, &rings, errors, &origin));
        }
    }
    notes
}

/// Does something with the drives of open rings. What was sent before is let back first: it would be taken for bytes without a sender.
fn with_bus<T>(
    link: &mut Guarded<Ends>,
    rings: &[RingSize],
    act: impl FnOnce(&OpenRings<'_>) -> Result<T, Error>,
) -> Result<T, Error> {
    let options = Options {
        patience: PATIENCE,
        ..Options::default()
    };
    come_round(link);
    for ring in 0..rings.len() {
        while link.receive_octet(ring).is_some() {}
    }
    let bus = OpenRings::open(Box::new(&mut *link), rings, options)?;
    let result = act(&bus);
    bus.close();
    result
}

/// What drives hold at these places.
fn read(bus: &OpenRings<'_>, places: &BTreeSet<(Axis, Place)>) -> Result<Values, Error> {
    let mut values = Values::new();
    let mut cells = Vec::new();
    let mut stored: BTreeMap<u8, Vec<Axis>> = BTreeMap::new();
    for (axis, place) in places {
        let byte = |address| (*axis, *place, address, Width::Byte);
        match *place {
            Place::Eeprom(cell) => stored.entry(cell).or_default().push(*axis),
            Place::Ram(address) => cells.push((*axis, *place, address, Place::width(address))),
            Place::Monitoring => cells.push(byte(ram::FLAGS2)),
            Place::Outputs => {
                cells.extend([OUTPUTS, ram::HW_VERSION, ram::HW_VERSION2].map(byte));
            }
        }
    }
    let reads = cells.iter();
    let reads = reads.map(|(axis, _, address, width)| (*axis, *address, *width));
    let words = bus.read_many(reads)?;
    let mut words = cells.iter().zip(words);
    while let Some(((axis, place, ..), word)) = words.next() {
        let value = match place {
            Place::Monitoring => word & u16::from(flags2::MONITORING),
            Place::Outputs => {
                let mut byte = || words.next().map_or(0, |(_, word)| word.to_be_bytes()[1]);
                let outputs = outputs_of_the_bus(byte(), byte());
                u16::from_be_bytes([outputs, word.to_be_bytes()[1]])
            }
            _ => word,
        };
        values.insert((*axis, *place), value);
    }
    // Reading the EEPROM takes the buffer of its controller (14.10.5.2).
    let axes: BTreeSet<_> = stored.values().flatten().copied().collect();
    let buffers = axes
        .iter()
        .map(|axis| (*axis, ram::EEPROM_BUFFER, Width::Word));
    let buffers = bus.read_many(buffers)?;
    for (cell, axes) in &stored {
        let bytes = bus.read_eeprom_of(axes, *cell)?.into_iter().map(u16::from);
        let places = axes.iter().map(|axis| (*axis, Place::Eeprom(*cell)));
        values.extend(places.zip(bytes));
    }
    let address = ram::EEPROM_BUFFER;
    let again = axes.into_iter().zip(buffers);
    bus.run_commands(again.map(|(axis, data)| (axis, Command::WriteWord { address, data })))?;
    Ok(values)
}

/// Puts back what differs. Returns what does not hold then, with the reasons.
fn values_back(
    link: &mut Guarded<Ends>,
    rings: &[RingSize],
    mut values: Values,
) -> BTreeMap<String, Values> {
    let mut left: BTreeMap<String, Values> = BTreeMap::new();
    let mut why = String::new();
    for turn in 0..=TRIES {
        let places = values.keys().copied().collect();
        match with_bus(link, rings, |bus| read(bus, &places)) {
            Ok(now) => values.retain(|key, before| {
                let written = turn > 0;
                now.get(key)
                    .is_none_or(|now| key.1.differs(*before, *now, written))
            }),
            Err(error) => {
                why = error.to_string();
                link.reset_after_denial();
                continue;
            }
        }
        "what was written is not what is read".clone_into(&mut why);
        values.retain(|(axis, place), before| {
            let commands = place.commands(*before).into_iter();
            let size = rings.get(axis.ring()).copied();
            let bytes: Vec<_> = commands
                .filter_map(|command| Some(telegram(size?, axis.drive(), command)))
                .flatten()
                .collect();
            let denied = link.denied(axis.ring(), Out::Octets(&bytes));
            if let Some(why) = &denied {
                let values = left.entry(why.clone()).or_default();
                values.insert((*axis, *place), *before);
            }
            denied.is_none()
        });
        if values.is_empty() || turn == TRIES {
            break;
        }
        let written = with_bus(link, rings, |bus| {
            values
                .iter()
                .try_for_each(|((axis, place), before)| match place {
                    Place::Eeprom(cell) => bus.write_eeprom(*axis, *cell, before.to_be_bytes()[1]),
                    _ => {
                        let commands = place.commands(*before).into_iter();
                        let commands = commands.map(|command| (*axis, command));
                        bus.run_commands(commands).map(drop)
                    }
                })
        });
        if let Err(error) = written {
            why = error.to_string();
            link.reset_after_denial();
        }
    }
    if !values.is_empty() {
        left.entry(why).or_default().extend(values);
    }
    left
}

/// The drives that are in an error, with its code, and whether they are blocked by software.
fn latched(bus: &OpenRings<'_>, axes: &[Axis]) -> Result<BTreeMap<Axis, (u16, bool)>, Error> {
    let cells = axes.iter().flat_map(|axis| {
        [
            (*axis, ram::STATUS, Width::Byte),
            (*axis, ram::ERRORCODE, Width::Word),
        ]
    });
    let words = bus.read_many(cells)?;
    let drives = axes.iter().zip(words.chunks_exact(2));
    let in_error = drives.filter(|(_, words)| words[0] & u16::from(status::ERROR) != 0);
    let blocked = |words: &[u16]| words[0] & u16::from(status::BLOCK) != 0;
    Ok(in_error
        .map(|(axis, words)| (*axis, (words[1], blocked(words))))
        .collect())
}

/// The drives that are in an error which is not of the bus.
fn errors(bus: &OpenRings<'_>, axes: &[Axis]) -> Result<BTreeMap<Axis, u16>, Error> {
    let latched = latched(bus, axes)?.into_iter();
    let all = latched.map(|(axis, (code, _))| (axis, code));
    Ok(all.filter(|(_, code)| !is_of_the_bus(*code)).collect())
}

/// Confirms errors that were not there before, on drives that the software block holds: an error blocks too (11.8, 14.10.1). Those of the bus
/// come with each check sequence (9.8), and nothing is said of them.
fn errors_back(
    link: &mut Guarded<Ends>,
    rings: &[RingSize],
    before: &BTreeMap<Axis, u16>,
    origin: &str,
) -> Vec<String> {
    let axes: Vec<_> = rings
        .iter()
        .enumerate()
        .flat_map(|(ring, size)| (0..size.drives()).filter_map(move |drive| Axis::new(ring, drive)))
        .collect();
    let mut left = BTreeMap::new();
    for turn in 0..=TRIES {
        if let Ok(now) = with_bus(link, rings, |bus| latched(bus, &axes)) {
            left = now;
            left.retain(|axis, (code, blocked)| *blocked && before.get(axis) != Some(code));
        }
        let confirm = Command::WriteByte {
            address: ram::ERRORCODE,
            data: CONFIRM_ERROR,
        };
        let permitted = |axis: &&Axis| {
            let size = rings.get(axis.ring());
            let bytes = size.map(|size| telegram(*size, axis.drive(), confirm));
            let bytes = bytes.unwrap_or_default();
            link.denied(axis.ring(), Out::Octets(&bytes)).is_none()
        };
        let axes: Vec<_> = left.keys().filter(permitted).copied().collect();
        if axes.is_empty() || turn == TRIES {
            break;
        }
        let confirm =
            |bus: &OpenRings<'_>| axes.iter().try_for_each(|axis| bus.delete_error(*axis));
        // Where it fails, the drives still show their errors.
        let _tried = with_bus(link, rings, confirm);
    }
    left.retain(|_, (code, _)| !is_of_the_bus(*code));
    let sentence = |(axis, (code, _)): (&Axis, &(u16, bool))| {
        format!(
            "drive {axis}: error {code:04X} was not there before; `drivebench delete-error {axis} --move --rig {origin}` confirms it"
        )
    };
    left.iter().map(sentence).collect()
}
