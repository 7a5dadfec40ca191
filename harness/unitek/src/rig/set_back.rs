//! What a scenario or a probe has left of its own in drives: set back after it, and read. What cannot be set back is said, with the command
//! that does it.

use super::known::KnownDrives;
use super::observed::{FrameNotes, GivenIdentifier, WrittenRegisters};
use super::{Axis, Session};
use crate::driver::{Driver, Error};
use crate::gate::GuardsSegment as _;
use crate::rig::OfUnitek as _;
use crate::safe_state::last_words;
use harness_bench::medium::{Out, Pieces};
use harness_bench::rig::Rig;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::playing::observed::LinkNotes as _;
use harness_proto::can::Frame;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::guard::{Class, class};
use harness_proto::unitek::master::Job;
use harness_proto::unitek::words::{ERROR_TIME_OUT, ERRORS, ERRORS_FAULT, set_bits};
use harness_proto::unitek::{Access, Register, Request, Width};
use std::collections::BTreeSet;

/// Registers that commands and functions change, which the safe state sets.
const COMMANDS: [u8; 4] = [0x31, 0x51, 0x6E, 0x90];

/// CAN_TIMEOUT: set back first, since a drive may time out again while others are.
const TIME_OUT: u8 = 0xD0;

const MODE: u8 = 0x51;
const ERROR_MAP: u8 = 0x8F;

/// The function that clears errors, and the value that clients write.
const CANCEL: (u8, u16) = (0x8E, 0x4D44);

/// The registers of the identifiers: to receive, and to send.
const IDENTIFIERS: [u8; 2] = [0x68, 0x69];

/// Identifiers and bit rate: a drive that stores new ones may be lost.
const BUS_SETTINGS: [u8; 3] = [0x68, 0x69, 0x73];

/// How a drive is reached: on which identifiers it sends, its second ones, its time-out of the bus.
const REACHED_BY: [u8; 4] = [0x69, 0x88, 0x89, TIME_OUT];

/// The most identifiers beside those of the rig's file on which a watchdog stops drives.
const MOST_STOPPED: usize = 16;

/// How often something is tried: a frame may be lost.
const TRIES: usize = 3;

/// What a drive needs to take notice: some of its scans of 1 ms.
const SCANS: Span = Span::from_millis(5);

/// What drives held before conversations, and what those may have written.
#[derive(Debug)]
pub(crate) struct HeldBefore {
    drives: Vec<KnownDrives>,
    notes: FrameNotes,
}

impl HeldBefore {
    /// Reads what the drives of a session hold.
    ///
    /// # Errors
    /// The link is in trouble, or a drive does not answer.
    pub(crate) fn read(session: &mut Session) -> Result<Self, Error> {
        let axes = session.axes().to_vec();
        let mut driver = session.driver();
        let mut drives = Vec::new();
        for axis in axes {
            let mut known = KnownDrives::new(axis);
            known.read_all(&mut driver)?;
            drives.push(known);
        }
        let notes = FrameNotes::default();
        Ok(Self { drives, notes })
    }

    /// Notes a frame that was sent.
    pub(crate) fn sent(&mut self, frame: &Frame, end: Instant) {
        self.notes.sent(Out::Frames(&[*frame]), end);
    }

    /// The frames that bring drives back to their identifiers and to their time-out of the bus, those on other identifiers first.
    pub(crate) fn reached_again(&self) -> Vec<Frame> {
        let mut frames = Vec::new();
        for known in &self.drives {
            let axis = known.axis;
            let mut write = |rx: u16, register: u8, raw: u32| {
                let data = Data::of(Register::of(register), raw);
                frames.extend(Request::Write { register, data }.encode(rx).ok());
            };
            for rx in places(axis, &self.notes.given, 0x68).skip(1) {
                write(rx, 0x68, axis.rx.into());
            }
            for register in REACHED_BY {
                if self.notes.written.contains(&(axis.rx, register)) {
                    let before = known.first.get(&register).copied();
                    write(axis.rx, register, before.unwrap_or_default());
                }
            }
        }
        frames
    }

    /// Sets back what was changed. Returns what is left to say.
    pub(crate) fn set_back(&self, session: &mut Session) -> Vec<String> {
        let stored = self.notes.stored().collect();
        set_back(session, &self.drives, &self.notes.written, &stored)
    }
}

/// Sets back what was changed in the drives since they were read at first: registers that may have been written, and levels of the EEPROM that
/// may have been stored. Returns what is left to say.
pub(super) fn set_back(
    session: &mut Session,
    drives: &[KnownDrives],
    written: &WrittenRegisters,
    stored: &BTreeSet<(u16, u16)>,
) -> Vec<String> {
    let rig = session.rig().clone();
    // No motor is released once an interlock has tripped.
    let may_release = rig.file.interlock.is_empty();
    let mut notes = Vec::new();
    for known in drives {
        let axis = known.axis;
        let gate = session.link().segment();
        let moved = gate.is_some_and(|gate| gate.has_moved(axis.rx));
        if let Some(gate) = session.link().segment_mut() {
            gate.held_before(axis.rx, held_before(known, written));
        }
        let mut driver = session.driver();
        let mut set_back = SetBack {
            driver: &mut driver,
            axis,
            rig: &rig,
        };
        let registers = set_back.registers(known, written);
        let silent = registers.is_err();
        let moved_back = match moved && !silent {
            true => set_back.moved_back(known),
            false => Ok(false),
        };
        notes.extend(registers.unwrap_or_else(|error| vec![error.to_string()]));
        if !silent {
            let errors = set_back.errors(known, may_release);
            notes.extend(errors.unwrap_or_else(|error| Some(error.to_string())));
        }
        let levels = stored.iter().filter(|level| level.0 == axis.rx);
        notes.extend(levels.map(|(_, level)| set_back.level(*level)));
        drop(driver);
        if let (Ok(true), Some(gate)) = (moved_back, session.link().segment_mut()) {
            gate.moved_back(axis.rx);
        }
    }
    notes
}

/// Says what is about to be written to drives, and the identifiers that they are given, with the commands that set it back. A drive is stopped on
/// these identifiers too.
pub(super) fn foretell(
    left: &NotPutBack,
    drives: &[KnownDrives],
    written: &WrittenRegisters,
    given: &[GivenIdentifier],
) {
    let origin = left.origin();
    let of_drive = |known: &KnownDrives| {
        let mut before = held_before(known, written);
        let has = |register| before.iter().any(|cell: &(u8, u32)| cell.0 == register);
        let node = known.axis.node;
        let cleared = match has(TIME_OUT) {
            true => {
                let delete = delete_error(node, origin);
                format!("; `{delete}` clears a time-out of the bus behind that")
            }
            false => String::new(),
        };
        let moved = moved(known.axis, given, origin);
        before.retain(|cell| !IDENTIFIERS.contains(&cell.0));
        let moves = before.iter().any(|cell| needs_motion(cell.0));
        let moves = if moves { "--move " } else { "" };
        let values: String = before
            .iter()
            .map(|cell| assignment(cell.0, cell.1) + " ")
            .collect();
        let command = format!("drivebench write {node} {values}{moves}--rig {origin}");
        let note =
            format!("drive {node}: registers may be left changed; `{command}` sets them back");
        [moved, (!before.is_empty()).then(|| note + &cleared)]
    };
    let all = drives.iter().flat_map(of_drive).flatten().collect();
    let elsewhere = drives.iter().flat_map(|known| {
        let others = places(known.axis, given, 0x68).skip(1);
        others.map(|rx| Axis { rx, ..known.axis })
    });
    let elsewhere: Vec<_> = elsewhere.take(MOST_STOPPED).collect();
    let stops = Pieces::Frames(last_words(&elsewhere));
    left.foretell(all, (!elsewhere.is_empty()).then_some(stops));
}

/// The identifiers that a drive may have: that of the rig's file first, and those that were written to a register.
fn places(axis: Axis, given: &[GivenIdentifier], register: u8) -> impl Iterator<Item = u16> {
    let first = if register == 0x68 { axis.rx } else { axis.tx };
    let ids = given
        .iter()
        .filter(move |given| (given.0, given.2) == (register, axis.rx));
    let others: BTreeSet<u16> = ids.map(|given| given.1).filter(|id| *id != first).collect();
    std::iter::once(first).chain(others)
}

/// On which identifiers a drive may be found, and the command that sets them back; `None` for those of the rig's file.
fn moved(axis: Axis, given: &[GivenIdentifier], origin: &str) -> Option<String> {
    let [rx, tx] = IDENTIFIERS.map(|register| {
        let ids = places(axis, given, register).map(|id| format!("{id:03X}"));
        ids.collect::<Vec<_>>().join(" or ")
    });
    let Axis {
        node,
        rx: first,
        tx: second,
    } = axis;
    (rx.len() + tx.len() > 6).then(|| {
        format!(
            "drive {node} may receive on {rx} and send on {tx} (68, 69): with its `rx` and `tx` in the rig's file it is found there, and \
             `drivebench write {node} 0x69=0x{second:04X} 0x68=0x{first:04X} --hold --rig {origin}` sets them back"
        )
    })
}

/// What the registers held at first that may have been written, CAN_TIMEOUT before the others.
fn held_before(known: &KnownDrives, written: &WrittenRegisters) -> Vec<(u8, u32)> {
    let written = |register| written.contains(&(known.axis.rx, register));
    // 83 has loaded all parameters.
    let all = written(0x83);
    let changed = |register: &u8| {
        let access = Register::of(*register).access;
        (all || written(*register))
            && matches!(access, Access::RW | Access::SP)
            && !COMMANDS.contains(register)
    };
    let before = known.first.iter().filter(|(register, _)| changed(register));
    let mut before: Vec<_> = before.map(|(register, raw)| (*register, *raw)).collect();
    before.sort_by_key(|(register, _)| *register != TIME_OUT);
    before
}

/// The command that clears errors.
fn delete_error(node: u8, origin: &str) -> String {
    format!("drivebench delete-error {node} --move --rig {origin}")
}

/// A register and its value for `drivebench write`.
fn assignment(register: u8, raw: u32) -> String {
    let digits = digits(Register::of(register));
    format!("0x{register:02X}=0x{raw:0digits$X}")
}

/// Whether `drivebench write` needs `--move` for a register.
fn needs_motion(register: u8) -> bool {
    matches!(class(register), Class::Motion | Class::EepromAndMotion)
}

const fn digits(register: &Register) -> usize {
    match register.width {
        Width::Bits16 => 4,
        Width::Bits32 => 8,
    }
}

struct SetBack<'d, 'l> {
    driver: &'d mut Driver<'l>,
    axis: Axis,
    rig: &'d Rig,
}

impl SetBack<'_, '_> {
    /// Sets registers back that may have been written.
    fn registers(
        &mut self,
        known: &KnownDrives,
        written: &WrittenRegisters,
    ) -> Result<Vec<String>, Error> {
        let mut notes = Vec::new();
        for (register, raw) in held_before(known, written) {
            notes.extend(self.register(register, raw)?);
        }
        Ok(notes)
    }

    /// Whether the settings of the bus read as they did at first.
    fn moved_back(&mut self, known: &KnownDrives) -> Result<bool, Error> {
        for register in BUS_SETTINGS {
            let mask = Register::of(register).mask();
            let reads = self.driver.read(self.axis, register)?.data.bits() & mask;
            if known.first.get(&register).map(|first| first & mask) != Some(reads) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Sets a register back to what it was. Returns what is left to say.
    fn register(&mut self, register: u8, raw: u32) -> Result<Option<String>, Error> {
        let about = Register::of(register);
        let mut reads = self.driver.read(self.axis, register)?.data.bits() & about.mask();
        let data = Data::of(about, raw);
        let job = Job::Write { register, data };
        let denied = self.driver.denied(&[(self.axis, job)]);
        for _ in 0..TRIES {
            if reads == raw || denied.is_some() {
                break;
            }
            match self.driver.write(self.axis, register, data) {
                Ok(_) => return Ok(None),
                Err(Error::Differs { reads: reply, .. }) => {
                    reads = reply.data.bits() & about.mask()
                }
                Err(error) => return Err(error),
            }
        }
        if reads == raw {
            return Ok(None);
        }
        let why = denied.unwrap_or_else(|| "the drive does not take it".to_owned());
        let digits = digits(about);
        Ok(Some(format!(
            "drive {}: register {register:02X} ({}) reads {reads:0digits$X} and is not set back to {raw:0digits$X}: {why}; `{}` sets it back",
            self.axis.node,
            about.name,
            self.write(register, raw),
        )))
    }

    /// The command that writes a register.
    fn write(&self, register: u8, raw: u32) -> String {
        let moves = if needs_motion(register) {
            " --move"
        } else {
            ""
        };
        format!(
            "drivebench write {} {}{moves} --rig {}",
            self.axis.node,
            assignment(register, raw),
            self.rig.origin
        )
    }

    /// Clears errors that are latched now and were not at first: by 8E (dump), and where that is not enough for a time-out of the bus, by a
    /// lock and its release with commands 0 [field]. Returns what is left to say.
    fn errors(&mut self, known: &KnownDrives, may_release: bool) -> Result<Option<String>, Error> {
        let Some(before) = known.first.get(&ERROR_MAP) else {
            return Ok(None);
        };
        let cancel = Data::Short(CANCEL.1);
        let job = Job::Write {
            register: CANCEL.0,
            data: cancel,
        };
        let denied = self.driver.denied(&[(self.axis, job)]);
        let mut left = self.latched(*before)?;
        for _ in 0..TRIES {
            if left == 0 || denied.is_some() {
                break;
            }
            self.driver.write(self.axis, CANCEL.0, cancel)?;
            self.driver.run(SCANS)?;
            left = self.latched(*before)?;
            let releases = may_release && self.driver.permits_write(self.axis, MODE, 0);
            if left & ERROR_TIME_OUT != 0 && releases {
                self.release_and_lock()?;
                left = self.latched(*before)?;
            }
        }
        if left == 0 {
            return Ok(None);
        }
        let names: Vec<_> = set_bits(ERRORS, left).map(|bit| bit.name).collect();
        let (node, rig) = (self.axis.node, &self.rig.origin);
        let delete = delete_error(node, rig);
        let cleared = format!("`{delete}` clears it when its cause is gone");
        let (why, way) = match denied {
            Some(why) => (why, cleared),
            None if left & ERROR_TIME_OUT != 0 => (
                "8E does not clear it".to_owned(),
                format!(
                    "`drivebench write {node} MODE=0x0004 MODE=0x0000 --move --rig {rig}`, a lock and its release, may"
                ),
            ),
            None => ("8E does not clear it".to_owned(), cleared),
        };
        let names = names.join(", ");
        Ok(Some(format!(
            "drive {node}: {names} was not there before: {why}; {way}"
        )))
    }

    /// The errors that were not there before.
    fn latched(&mut self, before: u32) -> Result<u32, Error> {
        let now = self.driver.read(self.axis, ERROR_MAP)?.data.bits();
        Ok(now & !before & ERRORS_FAULT)
    }

    /// Locks a drive that has commands 0, releases it and locks it again.
    fn release_and_lock(&mut self) -> Result<(), Error> {
        self.driver.lock(self.axis)?;
        let released = self.driver.write(self.axis, MODE, Data::Short(0));
        let waited = self.driver.run(SCANS);
        self.driver.lock(self.axis)?;
        released.and(waited)
    }

    /// What is to be said of a level of the EEPROM that was stored (ex 7).
    fn level(&self, level: u16) -> String {
        let node = self.axis.node;
        let loaded = match level {
            0 => " and loads it at its next power-up",
            _ => "",
        };
        format!(
            "drive {node}: level {level} of its EEPROM keeps what the scenario stored{loaded}; its registers are set back, and `{}` stores them there",
            self.write(0x84, level.into())
        )
    }
}

#[cfg(test)]
mod tests;
