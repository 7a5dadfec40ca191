//! What a ring behind a port must answer, and what it may: the master's bytes go through the bus ends of a model byte by byte.
//!
//! What the manual leaves to a drive differs from drive to drive: what ROM and RAM hold before the first write, and cells that its own
//! program writes ([`own`]). So each drive of the model is there twice. One makes every such choice in one way, the other in the
//! opposite way. Where both give the same bit, the manual does, and a drive must give it too; where they differ, any bit is right, and
//! both take it over: a cell holds from one read to the next what it held. What the manual leaves open of the bus
//! ([`Properties`]) is a list of models; a ring is wrong when none of them explains it.

use harness_proto::line::Received;
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::{BusEnd, Place};
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{Layout, layout};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::{Memory, RAM_AND_REGISTERS, ROM_WORDS};
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::properties::{Properties, ShortAddress};
use harness_proto::novobus::role::Role;
use harness_proto::time::Instant;
use std::collections::BTreeMap;

const RAM: usize = 0x1_0000 - *RAM_AND_REGISTERS.start() as usize;
const ROM: usize = (*ROM_WORDS.end() - *ROM_WORDS.start()) as usize + 1;

/// The memory of one of the two drives: every choice is made with the bits of `choice`.
#[derive(Clone, Debug)]
struct ChoiceMemory {
    choice: u8,
    ram: Box<[u8; RAM]>,
    rom: Box<[u8; ROM]>,
    /// The bus end asks for its own address, and not for what a command or process data ask for.
    asks_for_address: bool,
    /// What was read for this byte, and where.
    reads: Vec<(u16, u8)>,
    /// What the other drive has read for it.
    others: Vec<(u16, u8)>,
    /// Where was written for this byte.
    writes: Vec<u16>,
    /// Whether a command or process data have changed the address that the bus end keeps (ND21 9.2).
    address_changed: bool,
    /// Whether a `ResetH8` was carried out (ND21 10.5).
    was_reset: bool,
}

impl ChoiceMemory {
    fn new(choice: u8) -> Self {
        Self {
            choice,
            ram: Box::new([choice; RAM]),
            rom: Box::new([choice; ROM]),
            asks_for_address: false,
            reads: Vec::new(),
            others: Vec::new(),
            writes: Vec::new(),
            address_changed: false,
            was_reset: false,
        }
    }

    fn cell(&mut self, address: u16) -> Option<&mut u8> {
        match address.checked_sub(*RAM_AND_REGISTERS.start()) {
            Some(offset) => self.ram.get_mut(usize::from(offset)),
            None => {
                let offset = address.checked_sub(*ROM_WORDS.start())?;
                self.rom.get_mut(usize::from(offset))
            }
        }
    }

    fn held(&self, address: u16) -> u8 {
        let at = |cells: &[u8], from: u16| {
            let offset = address.checked_sub(from)?;
            cells.get(usize::from(offset)).copied()
        };
        let ram = at(&self.ram[..], *RAM_AND_REGISTERS.start());
        ram.or_else(|| at(&self.rom[..], *ROM_WORDS.start()))
            .unwrap_or(self.choice)
    }
}

impl ChoiceMemory {
    /// Whether the drive's program works with a cell in a way that changes what it answers or how (ND21 9.9, 14.2.1, 14.10.6).
    fn is_used(&self, cell: u16) -> bool {
        let monitors = cell == ram::FLAGS2 && self.held(cell) & flags2::MONITORING != 0;
        let of_bus = (ram::NOVOBUS..=ram::DATA_OUT_BUFFER).contains(&cell)
            && ![ram::DATA_IN, ram::DATA_OUT].contains(&cell);
        monitors
            || of_bus
            || own::SCOPE.contains(&cell)
            || (ram::STACK..ram::STATUS).contains(&cell)
    }
}

impl Memory for ChoiceMemory {
    fn read(&mut self, address: u16) -> u8 {
        let mut value = match own::is_own(address) && !self.asks_for_address {
            true => self.choice,
            false => self.held(address),
        };
        // An address that is the drive's choice: what stands there is too.
        if let Some((other, read)) = self.others.get(self.reads.len())
            && *other != address
        {
            value = !read;
        }
        self.reads.push((address, value));
        value
    }

    fn write(&mut self, address: u16, data: u8) {
        self.writes.push(address);
        self.address_changed |= address == ram::BUS_ADDR && !self.asks_for_address;
        if address >= *RAM_AND_REGISTERS.start()
            && let Some(cell) = self.cell(address)
        {
            *cell = data;
        }
    }

    // The outputs are registers, and registers are the drive's own.
    fn write_output(&mut self, _: OutputChange) {}

    fn reset(&mut self) {
        self.ram.fill(self.choice);
        self.was_reset = true;
    }

    fn bus_error(&mut self, _: BusError) {}

    // A bench does not switch it on, see `OnRig`.
    fn monitors_time_out(&self) -> bool {
        false
    }
}

/// A drive that makes its choices in one way, and the same drive with the opposite choices.
#[derive(Clone, Debug)]
struct Drive {
    ends: [BusEnd; 2],
    cells: [ChoiceMemory; 2],
}

/// A byte as the two of them see it; they may differ in whether there is one.
pub(crate) type Both = [Option<Received>; 2];

impl Drive {
    fn new(properties: Properties) -> Self {
        let end = BusEnd::new(properties);
        Self {
            ends: [end.clone(), end],
            cells: [ChoiceMemory::new(0x00), ChoiceMemory::new(0xFF)],
        }
    }

    fn step(&mut self, bytes: Both) -> Both {
        let mut answers = [None; 2];
        for (which, answer) in answers.iter_mut().enumerate() {
            let others = std::mem::take(&mut self.cells[0].reads);
            let (end, cells) = (&mut self.ends[which], &mut self.cells[which]);
            cells.others.clear();
            if which == 1 {
                cells.others.extend_from_slice(&others);
            }
            cells.reads.clear();
            cells.writes.clear();
            if let Some(byte) = bytes[which] {
                cells.asks_for_address = matches!(end.place(), Place::Sync | Place::Address);
                let step = end.receive(Instant::START, byte, cells);
                *answer = step.byte.map(Received::good);
            }
            if which == 1 {
                self.cells[0].reads = others;
            }
        }
        let [one, other] = &self.cells;
        if one.writes != other.writes {
            self.forget_page();
        }
        answers
    }

    /// What was written went to an address that is the drive's choice (ND21 14.10.3): any cell of the page may hold it.
    fn forget_page(&mut self) {
        for address in (0xFF00..=0xFFFF).filter(|cell| *cell != ram::BUS_ADDR) {
            for cells in &mut self.cells {
                let choice = cells.choice;
                if let Some(cell) = cells.cell(address) {
                    *cell = choice;
                }
            }
        }
    }

    /// A read has shown what a cell holds: bits that were the drive's choice are not any more.
    fn adopt(&mut self, address: u16, value: u8) {
        let open = self.cells[0].held(address) ^ self.cells[1].held(address);
        for cells in &mut self.cells {
            if let Some(cell) = cells.cell(address) {
                *cell = *cell & !open | value & open;
            }
        }
    }
}

/// What a byte received must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Must {
    pub(crate) byte: u8,
    /// Bits that are the drive's choice.
    pub(crate) open: u8,
    /// Whether a byte comes at all is the drive's choice.
    pub(crate) may_be_missing: bool,
}

/// A ring of such drives, each with the same properties of the bus.
#[derive(Clone, Debug)]
pub(crate) struct RingModel {
    pub(crate) properties: Properties,
    /// The first drive is the one that hears the master.
    drives: Vec<Drive>,
    /// The answers under way, by their drives.
    answers: BTreeMap<u8, Answer>,
}

/// An answer under way (ND21 9.5).
#[derive(Clone, Debug)]
struct Answer {
    /// How many bytes it has when it is complete.
    length: usize,
    /// What was received of it.
    bytes: Vec<u8>,
    /// Whether some of that was the drive's choice.
    open: bool,
}

impl RingModel {
    /// A ring whose drives wait for a sync byte.
    pub(crate) fn new(size: RingSize, properties: Properties) -> Self {
        Self {
            properties,
            drives: vec![Drive::new(properties); usize::from(size.drives())],
            answers: BTreeMap::new(),
        }
    }

    /// A drive has carried out a `ResetH8`: for how long it tests itself, and what of the bus it does meanwhile, is its choice.
    pub(crate) fn was_reset(&self) -> bool {
        let mut cells = self.drives.iter().flat_map(|drive| &drive.cells);
        cells.any(|cells| cells.was_reset)
    }

    /// Whether a drive has just written cells with which its program works, or it is its choice which.
    pub(crate) fn writes_what_drives_use(&self) -> bool {
        let uses = |drive: &Drive| {
            let [one, other] = &drive.cells;
            one.address_changed
                || one.writes != other.writes
                || one.writes.iter().any(|cell| one.is_used(*cell))
        };
        self.drives.iter().any(uses)
    }

    /// Puts a byte on the link at `place`, the master's outgoing one being 0, and gives what the drive behind it answers.
    pub(crate) fn pass(&mut self, place: usize, bytes: Both) -> Both {
        match self.drives.get_mut(place) {
            Some(drive) => drive.step(bytes),
            None => bytes,
        }
    }

    /// What the master must receive where these came out of the ring.
    pub(crate) fn must(&self, out: Both, role: Role) -> Option<Must> {
        let must = |byte, open, may_be_missing| Must {
            byte,
            open,
            may_be_missing,
        };
        match out {
            [None, None] => None,
            [Some(one), Some(other)] => {
                let open = one.byte ^ other.byte;
                // Bits of a checksum over open data agree by chance. A byte in the error mode is open as a whole or not at all.
                let data = matches!(role, Role::Data { .. } | Role::ProcessData { .. });
                let whole = !data || self.any_in_error();
                Some(match self.sum(role) {
                    // Behind an error the bus does not show which drives have kept the address of which telegram.
                    Some(_) if self.properties.short_address == ShortAddress::KeptSum => {
                        must(one.byte, 0xFF, false)
                    }
                    Some(sum) if !self.any_in_error() => must(sum, 0, false),
                    _ if open != 0 && whole => must(one.byte, 0xFF, false),
                    _ => must(one.byte, open, false),
                })
            }
            [Some(byte), None] | [None, Some(byte)] => Some(must(byte.byte, 0xFF, true)),
        }
    }

    /// The -checksum of an answer with data that are the drive's choice (ND21 9.6).
    fn sum(&self, role: Role) -> Option<u8> {
        let Role::Check {
            drive: Some(drive), ..
        } = role
        else {
            return None;
        };
        let answer = self.answers.get(&drive)?;
        answer.open.then(|| Checksum::over(&answer.bytes).minus())
    }

    /// Whether the checking byte with this role is one over data that are the drive's choice.
    pub(crate) fn awaits_open(&self, role: Role) -> bool {
        self.sum(role).is_some()
    }

    /// Whether a drive is in the error mode.
    pub(crate) fn any_in_error(&self) -> bool {
        let mut ends = self.drives.iter().flat_map(|drive| &drive.ends);
        ends.any(BusEnd::in_error)
    }

    fn drive(&mut self, address: u8) -> Option<&mut Drive> {
        let place = self.drives.len().checked_sub(usize::from(address) + 1)?;
        self.drives.get_mut(place)
    }

    /// Takes over what was received for a byte that was sent.
    pub(crate) fn take(&mut self, sent: u8, role: Role, must: Must, received: u8) {
        if matches!(role, Role::CheckSequence | Role::Foreign) {
            self.answers.clear();
        }
        let Some(drive) = role.drive() else { return };
        let (Role::Command { .. } | Role::Data { .. } | Role::Check { .. }) = role else {
            return;
        };
        let read_long = self.properties.read_long;
        let in_error = self.any_in_error();
        let answer = self.answers.entry(drive).or_insert_with(|| {
            let layout = layout(sent, read_long);
            Answer {
                length: layout.map_or(1, Layout::length),
                bytes: Vec::new(),
                open: false,
            }
        });
        answer.bytes.push(received);
        if let Role::Data { address, .. } = role {
            answer.open |= must.open != 0;
            if must.open != 0
                && !in_error
                && !own::is_own(address)
                && let Some(drive) = self.drive(drive)
            {
                drive.adopt(address, received);
            }
        }
        self.answers
            .retain(|_, answer| answer.bytes.len() < answer.length);
    }
}
