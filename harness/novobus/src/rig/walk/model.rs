//! Right drives of a ring behind the guard, and what a walk sends to one of them.

use harness_bench::qualify::walk::WalkModel;
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::nd21::io::OUTPUTS;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::bus_end::{ParameterByte, Place};
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::{Command, Field, Kind};
use harness_proto::novobus::guard::{Guard, Limits};
use harness_proto::novobus::memory::Memory as _;
use harness_proto::novobus::properties::{BusSetting, PROPERTIES, Properties};
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::device::Device as _;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::transitions::tour::{TourStep, stimulus};
use harness_sim::novobus::transitions::{self, Event, Transition, classify};

/// The cells that are read and written: parameters that no function uses while the drive is blocked and stopped (14.2.1). One is for words and
/// bytes, one for bits, and one for process data.
pub(super) const WORD: u16 = 0xFF74;
pub(super) const BITS: u16 = 0xFF52;
pub(super) const PROCESS: u16 = 0xFF4E;

/// Longer than any time-out (9.9): no error in a drive that does not monitor the line.
const SILENCE: u64 = 25;

/// The most net bytes of a telegram (9.2).
const LONGEST: u8 = 7;

/// What is sent to a drive.
#[derive(Clone, Copy)]
pub(super) enum Put {
    /// A byte that is this where the drive stands; where several are, the one at a place.
    Byte(Event, usize),
    /// The rest of a command with an address at a border of what may be read or written (10.1); of one that is not read to its end, the address.
    Border(u16),
    /// The rest of a command that was begun in another telegram.
    Rest,
    /// The same byte several times.
    Run(u8, usize),
    /// 17 zeros and the check sequence (9.8).
    Recovery,
    /// Nothing, for longer than any time-out.
    Silence,
}

use Put::{Border, Byte, Recovery, Rest, Run, Silence};

/// The inputs of a walk: name, and what is sent.
pub(super) const INPUTS: [(&str, Put); 63] = [
    ("SYNCO", Byte(Event::Synco, 0)),
    ("PAUSE", Byte(Event::Pause, 0)),
    (
        "a short address without net bytes",
        Byte(Event::EmptyShort, 0),
    ),
    (
        "a next address without net bytes",
        Byte(Event::EmptyShort, 1),
    ),
    (
        "a sync byte, an address and a net byte follow",
        Byte(Event::AddressFollows, 0),
    ),
    (
        "a sync byte, an address and 7 net bytes follow",
        Byte(Event::AddressFollows, 1),
    ),
    (
        "a sync byte, process data follow",
        Byte(Event::AddressFollows, 2),
    ),
    (
        "a sync byte, process data and 5 parameter bytes follow",
        Byte(Event::AddressFollows, 3),
    ),
    ("the same drive", Byte(Event::SameDrive, 0)),
    ("the same drive, 7 net bytes", Byte(Event::SameDrive, 1)),
    ("the next drive", Byte(Event::NextDrive, 0)),
    ("a sync byte without bit 7", Byte(Event::NoSyncByte, 0)),
    ("a sync byte with bit 4", Byte(Event::NoSyncByte, 1)),
    ("a sync byte with N alone", Byte(Event::NoSyncByte, 2)),
    ("the drive's own address", Byte(Event::OwnAddress, 0)),
    ("an address that no drive has", Byte(Event::OtherAddress, 0)),
    (
        "the address in front of its own",
        Byte(Event::OtherAddress, 1),
    ),
    ("a net byte for others", Byte(Event::NetByte, 0)),
    ("process data", Byte(Event::ProcessData, 0)),
    ("ReadByte", Byte(Event::ReadByte, 0)),
    ("ReadWord", Byte(Event::ReadWord, 0)),
    ("ReadLong", Byte(Event::ReadLong, 0)),
    ("WriteByte", Byte(Event::WriteByte, 0)),
    ("WriteWord", Byte(Event::WriteWord, 0)),
    ("And", Byte(Event::And, 0)),
    ("Or", Byte(Event::Or, 0)),
    ("WriteIO", Byte(Event::WriteIo, 0)),
    ("ResetH8", Byte(Event::ResetH8, 0)),
    ("an unknown command", Byte(Event::UnknownCommand, 0)),
    ("the unknown command C2", Byte(Event::UnknownCommand, 1)),
    ("the unknown command FF", Byte(Event::UnknownCommand, 2)),
    ("a byte of a command", Byte(Event::Accepted, 0)),
    ("a byte that is refused", Byte(Event::Refused, 0)),
    ("the right checking byte", Byte(Event::RightCheck, 0)),
    (
        "a checking byte with another bit 0",
        Byte(Event::WrongCheck, 0),
    ),
    (
        "a checking byte with another bit 4",
        Byte(Event::WrongCheck, 1),
    ),
    (
        "a checking byte with another bit 7",
        Byte(Event::WrongCheck, 2),
    ),
    ("the address 2EFF", Border(0x2EFF)),
    ("the address 2F00", Border(0x2F00)),
    ("the address 2FBF", Border(0x2FBF)),
    ("the address 2FC0", Border(0x2FC0)),
    ("the address 2FDE", Border(0x2FDE)),
    ("the address 2FDF", Border(0x2FDF)),
    ("the address FD7F", Border(0xFD7F)),
    ("the address FD80", Border(0xFD80)),
    ("the address FEFF", Border(0xFEFF)),
    ("the address FF7C", Border(0xFF7C)),
    ("the address FF7D", Border(0xFF7D)),
    ("the address FF7E", Border(0xFF7E)),
    ("the address FF7F", Border(0xFF7F)),
    ("the address FF80", Border(0xFF80)),
    ("the rest of a command", Rest),
    ("FF in the error mode", Byte(Event::SequenceStart, 0)),
    (
        "the next byte of the check sequence",
        Byte(Event::SequenceNext, 0),
    ),
    ("another byte in the error mode", Byte(Event::OtherByte, 0)),
    ("80 in the error mode", Byte(Event::OtherByte, 1)),
    ("a zero", Byte(Event::Zero, 0)),
    ("7 zeros", Run(0, 7)),
    ("9 zeros", Run(0, 9)),
    ("17 bytes that are no zeros", Run(0x55, 17)),
    ("the check sequence behind 17 zeros", Recovery),
    ("a silence", Silence),
    ("a wrong parity bit", Byte(Event::Parity, 0)),
];

/// By what the states of a drive's end of the bus differ.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct State {
    /// That of the matrix.
    of_matrix: transitions::State,
    /// The command of which the next byte is due, and that byte.
    due: Option<(Kind, Field)>,
    /// A command is begun, in this telegram or in one before.
    begun: bool,
    /// How many net bytes of a telegram for the drive are still to come.
    left: u8,
    /// A short address with N is the drive's own.
    next_is_own: bool,
    /// Another drive is in the error mode, and this one is not: nothing shows of it.
    alone: bool,
}

/// Right drives with a value of what the manual leaves open, the first one behind the master first.
#[derive(Clone)]
struct RightRing {
    /// The property of which they have not the default; nothing where they have all of them.
    open: &'static str,
    drives: Vec<PlainDrive>,
}

impl RightRing {
    fn new(size: RingSize, open: &'static str, properties: Properties) -> Self {
        let mut drive = PlainDrive::new(properties, [0; 256]);
        // Each cell holds something else than its neighbours, so that it shows which ones are read.
        for address in 0x2F00..=0x2FDF {
            let _is_there = drive.memory_mut().poke(address, address as u8 | 1);
        }
        for address in (0xFD80..=0xFEFF).chain(WORD..WORD + 4) {
            drive.memory_mut().write(address, address as u8 | 1);
        }
        Self {
            open,
            drives: vec![drive; usize::from(size.drives())],
        }
    }

    /// Sends a byte around: what comes back. A line error is that of the first drive.
    fn receive(&mut self, now: Instant, received: Received) -> Option<u8> {
        let mut drives = self.drives.iter_mut();
        drives
            .try_fold(received, |byte, drive| {
                drive.receive(now, byte).byte.map(Received::good)
            })
            .map(|byte| byte.byte)
    }

    /// Whether they stand where others do.
    fn stands_as(&self, other: &Self) -> bool {
        let pairs = self.drives.iter().zip(&other.drives);
        pairs
            .map(|(drive, other)| (drive.bus_end(), other.bus_end()))
            .all(|(drive, other)| {
                drive.place() == other.place() && drive.error_mode() == other.error_mode()
            })
    }
}

/// Right drives behind the guard of the rig's file.
#[derive(Clone)]
pub(super) struct Model {
    /// The first has the defaults of what the manual leaves open, each other one another value.
    rings: Vec<RightRing>,
    guard: Guard,
    size: RingSize,
    /// The drive that is walked.
    drive: u8,
    /// Whether bytes with a wrong parity bit are sent.
    pub(super) wrong_parity: bool,
    now: Instant,
}

impl Model {
    pub(super) fn new(size: RingSize, drive: u8, limits: Limits) -> Self {
        let mut rings = vec![RightRing::new(size, "", Properties::default())];
        for property in &PROPERTIES {
            for word in property.values.iter().skip(1) {
                let mut properties = Properties::default();
                // Times are those of time-outs, which are not walked.
                if properties
                    .set(property.name, BusSetting::Word(word))
                    .is_ok()
                {
                    rings.push(RightRing::new(size, property.name, properties));
                }
            }
        }
        let mut guard = Guard::new(size, limits);
        guard.assume_fresh();
        Self {
            rings,
            guard,
            size,
            drive,
            wrong_parity: false,
            now: Instant::START,
        }
    }

    /// How many drives stand in front of the one that is walked.
    fn front(&self) -> usize {
        usize::from(self.size.drives() - 1 - self.drive)
    }

    fn walked(&self) -> &PlainDrive {
        &self.rings[0].drives[self.front()]
    }

    fn place(&self) -> Place {
        self.walked().bus_end().place()
    }

    /// The byte of a command that the drive waits for.
    fn parameter(&self) -> Option<ParameterByte> {
        match self.place() {
            Place::Parameter(parameter) => Some(parameter),
            _ => None,
        }
    }

    /// Whether another drive is in the error mode, and this one is not.
    fn is_alone(&self) -> bool {
        let mut drives = self.rings[0].drives.iter();
        !self.walked().in_error() && drives.any(PlainDrive::in_error)
    }

    /// How many net bytes of a telegram are still to come.
    fn left(&self) -> u8 {
        let left = self.walked().bus_end().remaining();
        left.map_or(0, |remaining| remaining.net_bytes)
    }

    /// Whether it leads to what other ways lead to as well: a command is cut behind its first byte alone, and what follows it in a telegram is
    /// none that is known.
    fn is_more_of_the_same(&self, event: Event, at: usize) -> bool {
        let (begun, left) = (self.walked().bus_end().command_begun(), self.left());
        match event {
            Event::OwnAddress => begun && left == 1,
            Event::SameDrive => begun && at == 0,
            _ if self.place() != Place::Command || left == LONGEST => false,
            Event::ReadByte => left > 1,
            Event::UnknownCommand => at > 0,
            Event::Zero => false,
            _ => true,
        }
    }

    /// Whether the guard lets a recovery follow, or the rest of the command that is begun: nothing else ends a conversation.
    fn may_go_on(&self) -> Result<(), String> {
        let mut guard = self.guard.clone();
        let mut recovery = CHECK_SEQUENCE.iter();
        recovery
            .try_for_each(|byte| admit(&mut guard, self.now, *byte))
            .or_else(|why| match self.walked().bus_end().command_begun() {
                true if !self.walked().in_error() => self.clone().rest().map(|_ended| ()),
                _ => Err(why),
            })
    }

    /// The command that writes, of which the drive waits for the checking byte.
    fn writes(&self) -> Option<Kind> {
        let ParameterByte { kind, field, .. } = self.parameter()?;
        (field == Field::Check && !kind.reads() && kind != Kind::ResetH8).then_some(kind)
    }

    /// The drive's address byte, as the master sends it.
    fn own_address(&self) -> u8 {
        self.drive.wrapping_sub(self.size.drives())
    }

    /// What a byte is to the drive, behind the drives in front of it.
    fn is_to_the_drive(&self, byte: u8) -> Option<Event> {
        let mut front = self.rings[0].drives[..self.front()].to_vec();
        let mut drives = front.iter_mut();
        let arrives = drives.try_fold(Received::good(byte), |byte, drive| {
            drive.receive(self.now, byte).byte.map(Received::good)
        });
        let drive = self.walked();
        arrives.map(|received| classify(drive.bus_end(), drive.memory(), received).event)
    }

    /// The byte that is an event, the one at a place where several are.
    fn byte(&self, event: Event, at: usize) -> Option<u8> {
        let one_of = |bytes: &[u8]| bytes.get(at).copied();
        match event {
            Event::EmptyShort => one_of(&[0xA0, 0xE0]),
            Event::AddressFollows => one_of(&[0x82, 0x8E, 0x85, 0x8F]),
            Event::SameDrive => one_of(&[0xA2, 0xAE]),
            Event::NoSyncByte => one_of(&[0x02, 0x92, 0xC2]),
            Event::OwnAddress => Some(self.own_address()),
            Event::OtherAddress => one_of(&[0x00, self.own_address().wrapping_sub(1)]),
            Event::UnknownCommand => one_of(&[0x01, 0xC2, 0xFF]),
            Event::OtherByte => one_of(&[0x55, 0x80]),
            Event::NetByte => Some(self.for_others()),
            Event::ProcessData => match self.place() {
                Place::ProcessHigh => Some(0x5A),
                _ => Some(0xA7),
            },
            Event::Accepted | Event::Refused | Event::RightCheck | Event::WrongCheck => {
                self.of_command(event, at)
            }
            _ => {
                let drive = self.walked();
                let state = transitions::state(drive.bus_end(), drive.memory());
                match stimulus(Transition { state, event })? {
                    TourStep::Byte(received) => Some(received.byte),
                    TourStep::Silence => None,
                }
            }
        }
    }

    /// The byte of a command.
    fn of_command(&self, event: Event, at: usize) -> Option<u8> {
        let parameter = self.parameter()?;
        let accepted = accepted(&parameter, |address| self.walked().memory().peek(address));
        match (event, parameter.field) {
            (Event::Accepted | Event::RightCheck, _) => Some(accepted),
            (Event::WrongCheck, _) => [0x01, 0x10, 0x80].get(at).map(|bit| accepted ^ bit),
            (_, Field::AddrH) => Some(0x12),
            (_, Field::AddrInPage) => Some(0x80),
            (_, Field::Code) => Some(0x04),
            (_, Field::Fixed(_)) => Some(accepted ^ 0x20),
            _ => None,
        }
    }

    /// A net byte for another drive: a read of what changes nothing in it.
    fn for_others(&self) -> u8 {
        let drives = self.rings[0].drives.iter().enumerate();
        let others = drives.filter(|(place, _)| *place != self.front());
        let addressed = others.map(|(_, drive)| drive.bus_end().place());
        let mut byte = addressed.filter_map(|place| match place {
            Place::Command => Some(0xC0),
            Place::Parameter(parameter) => Some(accepted(&parameter, |_| 0)),
            _ => None,
        });
        byte.next_back().unwrap_or(0x55)
    }

    /// Sends bytes, the first one with a wrong parity bit or not: the line that does so.
    fn send(&mut self, bytes: &[u8], wrong_parity: bool) -> Result<String, String> {
        // A link does so, too.
        if let Some(until) = self.guard.waits_until(self.now, bytes) {
            self.now = self.now.max(until);
        }
        for (place, byte) in bytes.iter().enumerate() {
            admit(&mut self.guard, self.now, *byte)?;
            let received = match wrong_parity && place == 0 {
                true => Received::bad(*byte, LineError::Parity),
                false => Received::good(*byte),
            };
            self.now += Rate::default().byte_time();
            let now = self.now;
            let answers = self
                .rings
                .iter_mut()
                .map(|ring| ring.receive(now, received));
            let answers: Vec<_> = answers.collect();
            let mut others = self.rings.iter().zip(&answers);
            let first = others.next();
            let open = others.find(|(other, answer)| {
                first.is_some_and(|(ring, byte)| byte != *answer || !ring.stands_as(other))
            });
            if let Some((ring, _)) = open {
                return Err(format!("the manual leaves `{}` open", ring.open));
            }
        }
        let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        Ok(format!("> {}", hex.join(" ")))
    }

    /// Sends a command to the drive, in the telegram that it is in and in a new one: the lines that do so.
    pub(super) fn command(&mut self, command: Command) -> Result<Vec<String>, String> {
        let bytes = command.encode();
        let mut lines = Vec::new();
        for (place, byte) in bytes.iter().enumerate() {
            if self.place() == Place::Sync {
                let left = u8::try_from(bytes.len() - place).unwrap_or(7);
                lines.push(self.send(&[0x80 | left << 1, self.own_address()], false)?);
            }
            lines.push(self.send(&[*byte], false)?);
        }
        Ok(lines)
    }

    /// Brings a command that is begun to its end: the lines that do so.
    fn rest(&mut self) -> Result<Vec<String>, String> {
        let mut lines = Vec::new();
        while self.walked().bus_end().command_begun() && !self.walked().in_error() {
            let line = match self.parameter() {
                Some(parameter) => {
                    let byte = accepted(&parameter, |_| 0);
                    self.send(&[byte], false)?
                }
                None => self.send(&[0x80 | LONGEST << 1, self.own_address()], false)?,
            };
            lines.push(line);
        }
        Ok(lines)
    }

    /// Reads what a command that writes would have changed: the lines that do so.
    fn read_back(&mut self, kind: Kind) -> Result<Vec<String>, String> {
        let mut lines = Vec::new();
        if self.walked().in_error() {
            lines.push(self.send(&CHECK_SEQUENCE, false)?);
        }
        lines.extend(self.command(match kind {
            Kind::WriteIo => Command::ReadByte { address: OUTPUTS },
            Kind::And | Kind::Or => Command::ReadWord { address: BITS },
            _ => Command::ReadWord { address: WORD },
        })?);
        Ok(lines)
    }
}

/// Lets a byte pass; what it needs in the rig's file, where it does not.
fn admit(guard: &mut Guard, now: Instant, byte: u8) -> Result<(), String> {
    guard.admit(now, byte, false).map_err(|denial| {
        let missing = guard.limits().denying(denial.cause);
        let missing: Vec<_> = missing.map(|setting| setting.to_string()).collect();
        match missing.is_empty() {
            true => denial.to_string(),
            false => format!("needs {}", missing.join(", ")),
        }
    })
}

/// The byte that a drive accepts here: addresses of the cells that are tried, data that differ from what they hold, and the right checking byte.
fn accepted(parameter: &ParameterByte, holds: impl Fn(u16) -> u8) -> u8 {
    match parameter.field {
        Field::AddrL => WORD as u8,
        Field::AddrH => (WORD >> 8) as u8,
        Field::AddrInPage => BITS as u8,
        Field::Data(_) if parameter.kind == Kind::And => 0x5A,
        Field::Data(_) if parameter.kind == Kind::Or => 0x1B,
        // A zero is an input of its own.
        Field::Data(place) => match !holds(WORD + u16::from(place)) {
            0 => 0x5A,
            other => other,
        },
        Field::Code => 0x01,
        Field::Fixed(byte) => byte,
        Field::Check => parameter.command_sum.plus(),
    }
}

impl WalkModel for Model {
    type State = State;

    fn state(&self) -> State {
        let drive = self.walked();
        let of_matrix = transitions::state(drive.bus_end(), drive.memory());
        let in_front = of_matrix == transitions::State::SyncOther
            || of_matrix == transitions::State::SyncOtherBegun;
        State {
            of_matrix,
            due: self
                .parameter()
                .map(|parameter| (parameter.kind, parameter.field)),
            begun: !drive.in_error() && drive.bus_end().command_begun(),
            left: match self.place() {
                Place::Passing => 0,
                _ => self.left(),
            },
            next_is_own: in_front && drive.memory().peek(ram::BUS_ADDR) == 0xFF,
            alone: self.is_alone(),
        }
    }

    fn takes(&self, input: usize) -> bool {
        let left = self.left();
        match INPUTS[input].1 {
            Recovery => true,
            _ if self.is_alone() => false,
            Byte(Event::Parity, _) => self.wrong_parity || self.front() > 0,
            Byte(event, at) => {
                let byte = self.byte(event, at);
                let is_event = byte.is_some_and(|byte| self.is_to_the_drive(byte) == Some(event));
                is_event && !self.is_more_of_the_same(event, at)
            }
            Border(address) => self.parameter().is_some_and(|parameter| {
                let refused = !self.walked().memory().permits(parameter.kind, address);
                parameter.field == Field::AddrL && left > 3 && (parameter.kind.reads() || refused)
            }),
            Run(..) => self.walked().in_error() || self.place() == Place::Sync,
            Rest => self.place() == Place::Sync && self.walked().bus_end().command_begun(),
            Silence => self
                .parameter()
                .is_none_or(|parameter| parameter.kind == Kind::WriteWord),
        }
    }

    fn put(&mut self, input: usize) -> Result<Vec<String>, String> {
        let writes = self.writes();
        let parameter = self.parameter();
        let between = self.place() == Place::Sync;
        let is = |field| parameter.is_some_and(|parameter| parameter.field == field);
        let kind = parameter.map(|parameter| parameter.kind);
        let resets = kind == Some(Kind::ResetH8) && is(Field::Check);
        let line = match INPUTS[input].1 {
            Silence => {
                self.now += Span::from_millis(SILENCE);
                return Ok(vec![format!("wait {SILENCE}ms")]);
            }
            Byte(Event::RightCheck, _) if resets => {
                return Err("as conversations of their own reset drives".to_owned());
            }
            Byte(Event::Zero, _) if is(Field::AddrInPage) => {
                return Err("as a cell that is used would be written".to_owned());
            }
            Byte(Event::OtherAddress, 1)
                if self
                    .walked()
                    .bus_end()
                    .remaining()
                    .is_some_and(|remaining| remaining.process_data) =>
            {
                return Err("as process data are not sent to other drives".to_owned());
            }
            Byte(Event::Parity, _) if self.front() > 0 => {
                return Err("it reaches the first drive behind the master alone".to_owned());
            }
            Byte(Event::Parity, _) => {
                let was_in_error = self.walked().in_error();
                let flip = "! master->last: flip p".to_owned();
                let mut lines = vec![flip, self.send(&[0x55], true)?];
                // The guard knows of no error.
                if !was_in_error {
                    lines.push(self.send(&CHECK_SEQUENCE, false)?);
                }
                if let Some(kind) = writes {
                    lines.extend(self.read_back(kind)?);
                }
                self.may_go_on()?;
                return Ok(lines);
            }
            Byte(event, at) => {
                let byte = self.byte(event, at).ok_or("no such byte")?;
                self.send(&[byte], false)?
            }
            Border(address) => {
                let whole = match kind {
                    Some(Kind::ReadByte) => Command::ReadByte { address }.encode(),
                    Some(Kind::ReadWord) => Command::ReadWord { address }.encode(),
                    _ => Vec::new(),
                };
                // A drive that takes what it must not takes the rest as well.
                match whole.get(1..) {
                    Some(rest) => self.send(rest, false)?,
                    None => self.send(&address.to_le_bytes(), false)?,
                }
            }
            Rest => return self.rest(),
            Run(byte, times) => self.send(&vec![byte; times], false)?,
            Recovery => self.send(&CHECK_SEQUENCE, false)?,
        };
        let mut lines = vec![line];
        if let Some(kind) = writes {
            lines.extend(self.read_back(kind)?);
        }
        // What stands between two telegrams cuts no command (9.5).
        if between && self.place() == Place::Sync {
            lines.extend(self.rest()?);
        }
        self.may_go_on()?;
        Ok(lines)
    }

    fn now(&self) -> Instant {
        self.now
    }
}
