//! A scenario settled for rings of given sizes: every number is known, everything that cannot be is
//! refused, and nothing has been sent yet.

use super::check::Check;
use super::expression::Located;
use super::job::{Job, JobKind};
use super::pattern::{Expected, MAX_BYTES, Pattern};
use super::problem::{Problem, Problems, Span, Spanned};
use super::source::Source;
use super::syntax::{
    Action, Drives, Fault, FaultKind, LinkEnds, LinkFaultKind, Scenario, Setup, SetupKind, When,
};
use super::times::Window;
use crate::link::{Capability, Moment, PlacedFault};
use harness_proto::line::Rate;
use harness_proto::nd21;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::{Command, Reply};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::{self, OutputChange};
use harness_proto::novobus::properties::{Properties, ReadLongAnswer, Setting};
use harness_proto::novobus::telegram::{Address, Telegram};
use harness_proto::time::{self, Instant};
use harness_sim::fault::LinkFault;
use std::ops::RangeInclusive;

/// How long a line without a time waits where the scenario does not say.
const DEADLINE: time::Span = time::Span::from_millis(1000);

/// A scenario for rings of given sizes.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The rings; one or two.
    pub rings: Vec<RingSize>,
    /// The rate of the line.
    pub rate: Rate,
    /// Whether bytes that no line asked for are a failure.
    pub strict: bool,
    /// How long a line without a time waits.
    pub deadline: time::Span,
    /// What a rig must have.
    pub needs: Vec<Capability>,
    /// The steps, in order.
    pub steps: Vec<PlannedStep>,
    setups: Vec<PlannedSetup>,
}

#[derive(Clone, Debug)]
struct PlannedSetup {
    ring: usize,
    drives: RangeInclusive<u8>,
    what: PlannedSetupKind,
}

#[derive(Clone, Debug)]
pub(super) enum PlannedSetupKind {
    Memory(u16, Vec<u8>),
    Eeprom(u8, Vec<u8>),
    Word(String, String),
    Time(String, time::Span),
}

impl PlannedSetupKind {
    /// Sets what the setup says of a drive's properties, if it says anything of them.
    pub(super) fn apply_to(&self, properties: &mut Properties) {
        // Planning has refused what cannot be set.
        let _known = match self {
            Self::Word(name, word) => properties.set(name, Setting::Word(word)),
            Self::Time(name, span) => properties.set(name, Setting::Time(*span)),
            Self::Memory(..) | Self::Eeprom(..) => Ok(()),
        };
    }
}

/// A step, settled.
#[derive(Clone, Debug)]
pub struct PlannedStep {
    /// The time in front.
    pub when: PlannedWhen,
    /// What happens.
    pub action: PlannedAction,
    /// Where it stands.
    pub span: Span,
}

/// A time in front of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlannedWhen {
    /// None.
    Now,
    /// After the line before.
    After(PlannedWindow),
    /// Since the start.
    At(PlannedWindow),
}

/// A time from, to, and how exact they are meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedWindow {
    /// From.
    pub from: time::Span,
    /// To.
    pub to: time::Span,
    /// Half a unit of the last digit written, for an exact time; zero for a window.
    pub tolerance: time::Span,
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum PlannedAction {
    /// The master sends.
    Send(usize, Vec<u8>),
    /// The master receives.
    Receive(usize, Vec<Expected>),
    /// A fault.
    Fault(usize, PlacedFault, Moment),
    /// A check.
    Check(PlannedCheck),
    /// A telegram and its answer.
    Telegram(usize, Vec<u8>, Vec<Expected>),
    /// 17 zeros and the check sequence.
    Recover(usize),
}

/// A check, settled.
#[derive(Clone, Debug)]
pub enum PlannedCheck {
    /// The ring spells out this drive.
    Located(usize, u8),
    /// It does so after at most so many zeros.
    Within(u64),
    /// Drives are in the error mode, or are not.
    InError(usize, RangeInclusive<u8>, bool),
    /// A drive's error mode has this cause.
    Error(usize, u8, BusError),
    /// Drives' cells hold these bytes.
    Memory(usize, RangeInclusive<u8>, u16, Vec<Expected>),
    /// So many check sequences came back whole after an error.
    Corrected(u64),
    /// So many bytes were sent since the last check, in this time (and its tolerance).
    Sent(u64, Option<(time::Span, time::Span)>),
    /// So many bytes were received since the start.
    Received(u64),
}

impl Plan {
    /// What drive `drive` is set to hold and how to behave, in order of the lines.
    pub(super) fn setups_of(
        &self,
        ring: usize,
        drive: u8,
    ) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
        setups_of(&self.setups, ring, drive)
    }
}

fn setups_of(
    setups: &[PlannedSetup],
    ring: usize,
    drive: u8,
) -> impl Iterator<Item = &PlannedSetupKind> + '_ {
    setups
        .iter()
        .filter(move |setup| setup.ring == ring && setup.drives.contains(&drive))
        .map(|setup| &setup.what)
}

/// Settles a scenario, for a first ring of `size` drives where that is given.
///
/// # Errors
/// Everything that cannot be in rings of these sizes.
pub fn plan(scenario: &Scenario, source: &Source, size: Option<u8>) -> Result<Plan, Problems> {
    let problems = |all| Problems::new(&source.name, source.text.clone(), all);
    let rings = sizes(scenario, size).map_err(|problem| problems(vec![problem]))?;
    let mut planner = Planner {
        byte_time: scenario.rate.byte_time(),
        rings,
        setups: Vec::new(),
    };
    let mut found = Vec::new();
    for setup in &scenario.setups {
        match planner.setup(setup) {
            Ok(setup) => planner.setups.push(setup),
            Err(problem) => found.push(problem),
        }
    }
    let mut steps = Vec::new();
    let mut needs = scenario.needs.clone();
    let mut bytes = 0;
    for step in &scenario.steps {
        let action = planner.action(&step.action, &mut needs);
        match action {
            Ok(action) => {
                bytes += action.bytes();
                if bytes > MAX_BYTES {
                    found.push(Problem::new(
                        step.span,
                        format!("more than {MAX_BYTES} bytes in one scenario"),
                        "fewer bytes expected here",
                    ));
                    break;
                }
                steps.push(PlannedStep {
                    when: planner.when(step.when),
                    action,
                    span: step.span,
                });
            }
            Err(problem) => found.push(problem),
        }
    }
    if !found.is_empty() {
        return Err(problems(found));
    }
    if planner.rings.len() > 1 {
        needs.push(Capability::TwoRings);
    }
    needs.extend(planner.setups.iter().map(|setup| match setup.what {
        PlannedSetupKind::Eeprom(..) => Capability::Eeprom,
        _ => Capability::Memory,
    }));
    needs.sort();
    needs.dedup();
    Ok(Plan {
        rate: scenario.rate,
        strict: scenario.strict,
        deadline: scenario
            .deadline
            .map_or(DEADLINE, |deadline| deadline.on(planner.byte_time)),
        needs,
        steps,
        setups: planner.setups,
        rings: planner.rings,
    })
}

fn sizes(scenario: &Scenario, size: Option<u8>) -> Result<Vec<RingSize>, Problem> {
    let mut rings = Vec::new();
    for (index, range) in scenario.rings.iter().enumerate() {
        let wanted = size.filter(|_| index == 0).unwrap_or(range.default);
        if !(range.smallest..=range.largest).contains(&wanted) {
            return Err(Problem::new(
                range.span,
                format!("the scenario is not for a ring of {wanted}"),
                format!("{} to {} drives", range.smallest, range.largest),
            ));
        }
        let ring = RingSize::new(u64::from(wanted))
            .map_err(|error| Problem::new(range.span, error.to_string(), "this ring"))?;
        rings.push(ring);
    }
    Ok(rings)
}

impl PlannedAction {
    fn bytes(&self) -> usize {
        match self {
            Self::Send(_, bytes) => bytes.len(),
            Self::Receive(_, bytes) => bytes.len(),
            _ => 0,
        }
    }
}

struct Planner {
    byte_time: time::Span,
    rings: Vec<RingSize>,
    setups: Vec<PlannedSetup>,
}

impl Planner {
    fn ring(&self, index: usize, span: Span) -> Result<RingSize, Problem> {
        self.rings.get(index).copied().ok_or_else(|| {
            Problem::new(
                span,
                "the scenario has one ring",
                "a drive or link of ring 1 expected here",
            )
            .help("a second ring stands behind a comma in the header: `ring 4, 3`")
        })
    }

    fn size(&self, ring: usize) -> i64 {
        self.rings.get(ring).map_or(0, |r| i64::from(r.drives()))
    }

    fn drive(&self, ring: usize, number: &Located) -> Result<u8, Problem> {
        let size = self.ring(ring, number.span)?;
        let value = number.value(i64::from(size.drives()))?;
        match u8::try_from(value) {
            Ok(drive) if drive < size.drives() => Ok(drive),
            _ => Err(Problem::new(
                number.span,
                format!("there is no drive {value} in a ring of {}", size.drives()),
                format!("0 to {} expected here (ND21 8.5)", size.first()),
            )),
        }
    }

    fn drives(&self, drives: &Drives) -> Result<RangeInclusive<u8>, Problem> {
        let from = self.drive(drives.ring, &drives.from)?;
        let to = match &drives.to {
            Some(to) => self.drive(drives.ring, to)?,
            None => from,
        };
        Ok(from.min(to)..=from.max(to))
    }

    fn one(&self, drives: &Drives) -> Result<(usize, u8), Problem> {
        Ok((drives.ring, self.drive(drives.ring, &drives.from)?))
    }

    fn setup(&self, setup: &Setup) -> Result<PlannedSetup, Problem> {
        let drives = self.drives(&setup.drives)?;
        let size = self.size(setup.drives.ring);
        let what = match &setup.what {
            SetupKind::Memory(address, pattern) => {
                let bytes = pattern.expand_known(size)?;
                in_memory(address, bytes.len())?;
                PlannedSetupKind::Memory(address.value, bytes)
            }
            SetupKind::Eeprom(address, pattern) => {
                let bytes = pattern.expand_known(size)?;
                if usize::from(address.value) + bytes.len() > 256 {
                    return Err(Problem::new(
                        address.span,
                        "the bytes go beyond the EEPROM",
                        "the EEPROM has the addresses 00 to FF (ND21 14.2.2)",
                    ));
                }
                PlannedSetupKind::Eeprom(address.value, bytes)
            }
            SetupKind::Word(name, word) => {
                set_property(&name.value, Setting::Word(&word.value), word.span)?;
                PlannedSetupKind::Word(name.value.clone(), word.value.clone())
            }
            SetupKind::Time(name, duration) => {
                let span = duration.on(self.byte_time);
                set_property(&name.value, Setting::Time(span), duration.span())?;
                PlannedSetupKind::Time(name.value.clone(), span)
            }
        };
        Ok(PlannedSetup {
            ring: setup.drives.ring,
            drives,
            what,
        })
    }

    fn when(&self, when: When) -> PlannedWhen {
        match when {
            When::Now => PlannedWhen::Now,
            When::After(window) => PlannedWhen::After(self.window(window)),
            When::At(window) => PlannedWhen::At(self.window(window)),
        }
    }

    fn window(&self, window: Window) -> PlannedWindow {
        let tolerance = if window.is_exact() {
            window.from.tolerance(self.byte_time)
        } else {
            time::Span::ZERO
        };
        PlannedWindow {
            from: window.from.on(self.byte_time),
            to: window.to.on(self.byte_time),
            tolerance,
        }
    }

    fn action(
        &self,
        action: &Action,
        needs: &mut Vec<Capability>,
    ) -> Result<PlannedAction, Problem> {
        match action {
            Action::Send { ring, bytes } => {
                self.ring(*ring, bytes.span)?;
                Ok(PlannedAction::Send(
                    *ring,
                    bytes.expand_known(self.size(*ring))?,
                ))
            }
            Action::Receive { ring, bytes } => {
                self.ring(*ring, bytes.span)?;
                Ok(PlannedAction::Receive(
                    *ring,
                    bytes.expand(self.size(*ring))?,
                ))
            }
            Action::Fault(fault) => self.fault(fault, needs),
            Action::Check(check) => Ok(PlannedAction::Check(self.check(check, needs)?)),
            Action::Job(job) => self.job(job),
        }
    }

    fn fault(&self, fault: &Fault, needs: &mut Vec<Capability>) -> Result<PlannedAction, Problem> {
        let size = self.size(fault.ring);
        let placed = match &fault.what {
            FaultKind::Link(place, ends, kind) => {
                let link = self.link(fault.ring, place.span, ends)?;
                needs.push(Capability::Interposer);
                PlacedFault::Link(link, self.link_fault(*kind))
            }
            FaultKind::Drive(drive, kind) => {
                needs.push(Capability::Power);
                PlacedFault::Drive(self.drive(fault.ring, drive)?, *kind)
            }
        };
        let moment = match (&fault.byte, fault.at) {
            (Some(byte), _) => {
                let number = byte.value(size)?;
                match u64::try_from(number) {
                    Ok(number @ 1..) => Moment::Byte(number),
                    _ => {
                        return Err(Problem::new(
                            byte.span,
                            format!("there is no byte {number}"),
                            "bytes on a link are counted from 1",
                        ));
                    }
                }
            }
            (None, Some(at)) => Moment::At(Instant::START + at.on(self.byte_time)),
            (None, None) => Moment::Now,
        };
        Ok(PlannedAction::Fault(fault.ring, placed, moment))
    }

    fn link(&self, ring: usize, span: Span, ends: &LinkEnds) -> Result<usize, Problem> {
        let size = self.ring(ring, span)?;
        let from = ends
            .from
            .as_ref()
            .map(|k| self.drive(ring, k))
            .transpose()?;
        let to = ends.to.as_ref().map(|k| self.drive(ring, k)).transpose()?;
        let next = match from {
            None => Some(size.first()),
            Some(k) => k.checked_sub(1),
        };
        if to == next {
            let place = from.map_or(0, |k| usize::from(size.drives() - k));
            return Ok(place);
        }
        let name = |end: Option<u8>| end.map_or("master".to_owned(), |k| k.to_string());
        Err(Problem::new(
            span,
            format!("there is no link {}->{}", name(from), name(to)),
            "a link of the ring expected here",
        )
        .help(format!(
            "{} sends to {}: did you mean `{}->{}`?",
            from.map_or("the master".to_owned(), |k| format!("drive {k}")),
            next.map_or("the master".to_owned(), |k| format!("drive {k}")),
            name(from),
            name(next),
        )))
    }

    fn link_fault(&self, kind: LinkFaultKind) -> LinkFault {
        match kind {
            LinkFaultKind::Flip(flips) => LinkFault::Flip(flips),
            LinkFaultKind::Replace(byte) => LinkFault::Replace(byte),
            LinkFaultKind::Drop => LinkFault::Drop,
            LinkFaultKind::Duplicate => LinkFault::Duplicate,
            LinkFaultKind::Insert(byte) => LinkFault::Insert(byte),
            LinkFaultKind::Delay(span) => LinkFault::Delay(span.on(self.byte_time)),
            LinkFaultKind::Break(span) => LinkFault::Break(span.on(self.byte_time)),
            LinkFaultKind::Overrun => LinkFault::Overrun,
            LinkFaultKind::Cut => LinkFault::Cut,
            LinkFaultKind::Join => LinkFault::Join,
        }
    }

    fn check(&self, check: &Check, needs: &mut Vec<Capability>) -> Result<PlannedCheck, Problem> {
        let count = |number: &Located| {
            let value = number.value(self.size(0))?;
            u64::try_from(value).map_err(|_| {
                Problem::new(
                    number.span,
                    format!("{value} is less than nothing"),
                    "0 or more expected here",
                )
            })
        };
        Ok(match check {
            Check::Located(drives) => {
                let (ring, drive) = self.one(drives)?;
                PlannedCheck::Located(ring, drive)
            }
            Check::Within(zeros) => PlannedCheck::Within(count(zeros)?),
            Check::InError { drives, expected } => {
                needs.push(Capability::Tap);
                PlannedCheck::InError(drives.ring, self.drives(drives)?, *expected)
            }
            Check::Error { error, drive } => {
                needs.push(Capability::Tap);
                let (ring, drive) = self.one(drive)?;
                PlannedCheck::Error(ring, drive, *error)
            }
            Check::Memory {
                drives,
                address,
                bytes,
            } => {
                let range = self.drives(drives)?;
                let bytes = bytes.expand(self.size(drives.ring))?;
                in_memory(address, bytes.len())?;
                PlannedCheck::Memory(drives.ring, range, address.value, bytes)
            }
            Check::Corrected(times) => PlannedCheck::Corrected(count(times)?),
            Check::Sent { bytes, time } => {
                let time = time.map(|t| (t.on(self.byte_time), t.tolerance(self.byte_time)));
                PlannedCheck::Sent(count(bytes)?, time)
            }
            Check::Received(bytes) => PlannedCheck::Received(count(bytes)?),
        })
    }

    fn job(&self, job: &Job) -> Result<PlannedAction, Problem> {
        match job {
            Job::Recover(ring) => {
                self.ring(*ring, Span::default())?;
                Ok(PlannedAction::Recover(*ring))
            }
            Job::Exchange {
                drive,
                send,
                receive,
            } => {
                let (ring, k) = self.one(drive)?;
                let data = self.data(send, 2, ring)?;
                let word = u16::from_be_bytes([known(data[0]), known(data[1])]);
                let answer = match receive {
                    Some(pattern) => self.data(pattern, 2, ring)?,
                    None => vec![Expected::Any; 2],
                };
                self.telegram(ring, k, drive.from.span, Some(word), &[], answer)
            }
            Job::Command {
                kind,
                drive,
                address,
                data,
            } => {
                let (ring, k) = self.one(drive)?;
                let command = self.command(*kind, ring, address.as_ref(), data.as_ref())?;
                if let Some(address) = address
                    && !memory::in_range(command.kind(), address.value)
                {
                    let layout = command.layout(ReadLongAnswer::default());
                    return Err(Problem::new(
                        address.span,
                        format!(
                            "{} does not reach {:04X}",
                            layout.printed_name, address.value
                        ),
                        format!(
                            "an address in the ranges of ND21 {} expected here",
                            layout.section
                        ),
                    ));
                }
                let read = match data {
                    Some(pattern) if command.kind().reads() => {
                        self.data(pattern, usize::from(command.kind().width()), ring)?
                    }
                    _ => vec![Expected::Any; 4],
                };
                let answer = expected_answer(&command, &read, self.read_long(ring, k));
                self.telegram(ring, k, drive.from.span, None, &command.encode(), answer)
            }
        }
    }

    fn command(
        &self,
        kind: JobKind,
        ring: usize,
        address: Option<&Spanned<u16>>,
        data: Option<&Pattern>,
    ) -> Result<Command, Problem> {
        let address = address.map_or(memory::PAGE, |address| address.value);
        let [_, address_low] = address.to_be_bytes();
        let byte = || -> Result<u8, Problem> {
            match data {
                Some(pattern) => Ok(known(self.data(pattern, 1, ring)?[0])),
                None => Ok(0),
            }
        };
        let [_, status] = nd21::STATUS.to_be_bytes();
        let status_and = |data| Command::And {
            address_low: status,
            data,
        };
        let status_or = |data| Command::Or {
            address_low: status,
            data,
        };
        Ok(match kind {
            JobKind::ReadByte => Command::ReadByte { address },
            JobKind::ReadWord => Command::ReadWord { address },
            JobKind::ReadLong => Command::ReadLong { address },
            JobKind::WriteByte => Command::WriteByte {
                address,
                data: byte()?,
            },
            JobKind::WriteWord => {
                let word = match data {
                    Some(pattern) => self.data(pattern, 2, ring)?,
                    None => vec![Expected::Byte(0); 2],
                };
                Command::WriteWord {
                    address,
                    data: u16::from_be_bytes([known(word[0]), known(word[1])]),
                }
            }
            JobKind::And => Command::And {
                address_low,
                data: byte()?,
            },
            JobKind::Or => Command::Or {
                address_low,
                data: byte()?,
            },
            JobKind::WriteIo => {
                let code = byte()?;
                let change = OutputChange::from_code(code).ok_or_else(|| {
                    Problem::new(
                        data.map_or(Span::default(), |pattern| pattern.span),
                        format!("{code:02X} is no output code"),
                        "00 to 03 expected here (ND21 10.4)",
                    )
                })?;
                Command::WriteIo(change)
            }
            JobKind::Reset => Command::ResetH8,
            JobKind::Go => status_and(!(nd21::STATUS_BLOCKED | nd21::STATUS_STOPPED)),
            JobKind::Stop => status_or(nd21::STATUS_STOPPED),
            JobKind::Block => status_or(nd21::STATUS_BLOCKED),
            JobKind::DeleteError => Command::WriteByte {
                address: nd21::ERROR_CODE,
                data: nd21::CONFIRM_ERROR,
            },
        })
    }

    /// The form in which a drive is set to answer `ReadLong`.
    fn read_long(&self, ring: usize, drive: u8) -> ReadLongAnswer {
        let mut properties = Properties::default();
        for setup in setups_of(&self.setups, ring, drive) {
            setup.apply_to(&mut properties);
        }
        properties.read_long
    }

    /// Exactly `count` bytes.
    fn data(&self, pattern: &Pattern, count: usize, ring: usize) -> Result<Vec<Expected>, Problem> {
        let bytes = pattern.expand(self.size(ring))?;
        if bytes.len() == count {
            return Ok(bytes);
        }
        Err(Problem::new(
            pattern.span,
            format!("{} bytes stand where {count} are expected", bytes.len()),
            format!("{} hexadecimal digits expected here", 2 * count),
        ))
    }

    /// A telegram with an address byte, and what the master receives for it.
    fn telegram(
        &self,
        ring: usize,
        drive: u8,
        span: Span,
        process_data: Option<u16>,
        parameters: &[u8],
        answer: Vec<Expected>,
    ) -> Result<PlannedAction, Problem> {
        let wrong = |message: String| Problem::new(span, message, "this drive");
        let address = self
            .ring(ring, span)?
            .address_byte(drive)
            .map_err(|error| wrong(error.to_string()))?;
        let bytes = Telegram::new(Address::Byte(address), process_data, parameters)
            .map_err(|error| wrong(error.to_string()))?
            .encode();
        let mut expected = vec![Expected::Byte(bytes[0]), Expected::Byte(drive)];
        expected.extend(answer);
        Ok(PlannedAction::Telegram(ring, bytes, expected))
    }
}

fn known(byte: Expected) -> u8 {
    match byte {
        Expected::Byte(byte) => byte,
        Expected::Any | Expected::MinusChecksum(_) => 0,
    }
}

/// What comes back for a command where the data read are `read`, in memory order.
fn expected_answer(
    command: &Command,
    read: &[Expected],
    read_long: ReadLongAnswer,
) -> Vec<Expected> {
    let layout = command.layout(read_long);
    let sent = command.encode();
    let mut expected = vec![Expected::Byte(layout.code)];
    for (i, reply) in layout.answer.iter().enumerate() {
        let so_far = u8::try_from(expected.len()).unwrap_or(u8::MAX);
        expected.push(match reply {
            Reply::Echo => Expected::Byte(sent[1 + i]),
            Reply::Data(n) => read.get(usize::from(*n)).copied().unwrap_or(Expected::Any),
            Reply::Check => Expected::MinusChecksum(so_far),
        });
    }
    expected
}

fn in_memory(address: &Spanned<u16>, length: usize) -> Result<(), Problem> {
    let last = usize::from(address.value) + length.max(1) - 1;
    let inside = |range: &RangeInclusive<u16>| {
        range.contains(&address.value) && last <= usize::from(*range.end())
    };
    if [memory::ROM_WORDS, memory::RAM_AND_REGISTERS]
        .iter()
        .any(inside)
    {
        return Ok(());
    }
    Err(Problem::new(
        address.span,
        format!("a drive has no memory at {last:04X}"),
        "ROM 2F00-2FDF, RAM FD80-FF7F or registers FF80-FFFF (ND21 10.1) expected here",
    ))
}

fn set_property(name: &str, setting: Setting<'_>, span: Span) -> Result<(), Problem> {
    Properties::default().set(name, setting).map_err(|error| {
        Problem::new(
            span,
            format!("`{name}` cannot be set to this"),
            error.to_string(),
        )
    })
}
