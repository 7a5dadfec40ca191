//! The scenario, its header and its steps.

use crate::buses::Bus;
use crate::buses::novobus::language::syntax::cell::CellPlace;
use crate::buses::novobus::language::syntax::check::{Check, DriveCheck};
use crate::buses::novobus::language::syntax::header::{Drives, Header, Influence};
use crate::buses::novobus::language::syntax::job::Job;
use crate::link::Capability;
use crate::scenario::expression::{Counter, Located};
use crate::scenario::pattern::Pattern;
use crate::scenario::problem::Span;
use crate::scenario::times::{Duration, Window};
use harness_proto::nd21::errors::ErrorCode;
use harness_sim::fault::{DriveFault, Flips, LinkFault};

/// A scenario: what it is, the ring it needs, and its steps.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// What the conversation shows, in a line.
    pub title: String,
    /// The tables of which manuals it pins.
    pub sources: Vec<Citation>,
    /// Which bus.
    pub bus: Bus,
    /// The header lines of the bus.
    pub header: Header,
    /// What it says that it needs of a rig.
    pub needs: Vec<Capability>,
    /// Whether bytes that no line asked for are a failure.
    pub strict: bool,
    /// How long a line without a time waits.
    pub deadline: Option<Duration>,
    /// The steps, in order.
    pub steps: Vec<Step>,
}

impl Scenario {
    /// A scenario without steps.
    #[must_use]
    pub fn new(title: &str, header: Header) -> Self {
        Self {
            title: title.to_owned(),
            sources: Vec::new(),
            bus: Bus::DEFAULT,
            header,
            needs: Vec::new(),
            strict: false,
            deadline: None,
            steps: Vec::new(),
        }
    }
}

/// A reference to a manual: `nd21 9.7`, `nd21 8.2 exchange-6`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Citation {
    /// The whole reference, single spaces between its words.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// A cell that is recorded: `record drive 0 nist every 10ms`.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Of which drives.
    pub drives: Drives,
    /// Which cell.
    pub place: CellPlace,
    /// When it is looked at.
    pub looks: Looks,
}

/// When a recorded cell is noted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Looks {
    /// `every T`
    Every(Duration),
    /// `changes`
    Changes,
    /// `off`: no longer.
    Off,
}

/// A step.
#[derive(Clone, Debug)]
pub struct Step {
    /// The time in front.
    pub when: When,
    /// What happens.
    pub action: Action,
    /// Where it stands.
    pub span: Span,
}

impl From<Action> for Step {
    /// A step without a time in front.
    fn from(action: Action) -> Self {
        Self {
            when: When::Now,
            action,
            span: Span::default(),
        }
    }
}

/// A time in front of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// None: as soon as the line before is done.
    Now,
    /// `+`: after the line before.
    After(Window),
    /// `@`: since the start.
    At(Window),
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum Action {
    /// `>`: the master sends.
    Send {
        /// Which ring, counted from 0.
        ring: usize,
        /// What.
        bytes: Pattern,
    },
    /// `<`: the master receives.
    Receive {
        /// Which ring, counted from 0.
        ring: usize,
        /// What.
        bytes: Pattern,
    },
    /// `!`: a fault.
    Fault(Fault),
    /// `?`: a check.
    Check(Check),
    /// `until`: time passes until a check holds, at most so long.
    Until(DriveCheck, Duration),
    /// `wait`: time passes.
    Wait(Duration),
    /// `drive ...`: something happens to drives from outside the bus.
    Influence(Drives, Influence),
    /// `record`: cells are recorded from here on, or no longer.
    Record(Recording),
    /// A job of the master.
    Job(Job),
    /// `for k in 0..last`: what stands up to its `end` is played for each number, in this order.
    For(Counter, Located, Located),
    /// `end`: of the loop that began last.
    End,
}

/// A fault as written.
#[derive(Clone, Debug)]
pub struct Fault {
    /// Which ring, counted from 0.
    pub ring: usize,
    /// Where and what.
    pub what: FaultKind,
    /// At which byte, counted from 1.
    pub byte: Option<Located>,
    /// At which time since the start.
    pub at: Option<Duration>,
}

impl Fault {
    /// A fault on a link of a ring, counted from 0, at a byte, counted from 1.
    #[must_use]
    pub fn on_link(ring: usize, ends: LinkEnds, kind: LinkFaultKind, byte: u64) -> Self {
        Self {
            ring,
            what: FaultKind::Link(Located::number(0), ends, kind),
            byte: Some(Located::number(byte.cast_signed())),
            at: None,
        }
    }
}

/// Where a fault happens, and what.
#[derive(Clone, Debug)]
pub enum FaultKind {
    /// On a link.
    Link(Located, LinkEnds, LinkFaultKind),
    /// In a drive.
    Drive(Located, DriveFault),
    /// The drive's own monitoring reports an error.
    Error(Located, ErrorCode),
}

/// The ends of a link.
#[derive(Clone, Debug)]
pub struct LinkEnds {
    /// The transmitter; `None` for the master.
    pub from: Option<Located>,
    /// The receiver; `None` for the master.
    pub to: Option<Located>,
}

impl LinkEnds {
    /// The ends of the link that goes from one drive to another; `None` is the master.
    #[must_use]
    pub fn between(from: Option<u8>, to: Option<u8>) -> Self {
        let end = |drive: u8| Located::number(drive.into());
        Self {
            from: from.map(end),
            to: to.map(end),
        }
    }

    /// The ends of a link of a ring of `drives`, by its place: 0 for the link that begins at the master.
    #[must_use]
    pub fn of_place(drives: u8, place: usize) -> Self {
        let behind = |place: usize| u8::try_from(usize::from(drives).checked_sub(place)?).ok();
        let from = behind(place).filter(|_| place > 0);
        Self::between(from, behind(place + 1))
    }
}

/// What happens on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkFaultKind {
    /// `flip b ...`
    Flip(Flips),
    /// `replace HH`
    Replace(u8),
    /// `drop`
    Drop,
    /// `duplicate`
    Duplicate,
    /// `insert HH`
    Insert(u8),
    /// `delay T`
    Delay(Duration),
    /// `break T`
    Break(Duration),
    /// `overrun`
    Overrun,
    /// `cut`
    Cut,
    /// `join`
    Join,
}

impl From<LinkFault> for LinkFaultKind {
    /// The same fault; times to the nanosecond.
    fn from(fault: LinkFault) -> Self {
        match fault {
            LinkFault::Flip(flips) => Self::Flip(flips),
            LinkFault::Replace(byte) => Self::Replace(byte),
            LinkFault::Drop => Self::Drop,
            LinkFault::Duplicate => Self::Duplicate,
            LinkFault::Insert(byte) => Self::Insert(byte),
            LinkFault::Delay(time) => Self::Delay(Duration::nanos(time.as_nanos())),
            LinkFault::Break(time) => Self::Break(Duration::nanos(time.as_nanos())),
            LinkFault::Overrun => Self::Overrun,
            LinkFault::Cut => Self::Cut,
            LinkFault::Join => Self::Join,
        }
    }
}
