//! The drive models that a simulated ring can hold, each drive its own.

use crate::nd21::{Nd21Drive, OutputLevels, Stimulus, factory};
use crate::novobus::cells::Cells;
use crate::novobus::deviation::Deviant;
use crate::novobus::device::Device;
use crate::novobus::plain::PlainDrive;
use crate::novobus::witness::Witness;
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Reaction, Relay};
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::memory::Memory;
use harness_proto::time::{Instant, Span};

/// Which model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Model {
    /// `plain`: memory and bus, and nothing behind them.
    #[default]
    Plain,
    /// `nd21`: the ND21.
    Nd21,
}

impl Model {
    /// The names in a scenario.
    pub const NAMES: [(&'static str, Self); 2] = [("plain", Self::Plain), ("nd21", Self::Nd21)];

    /// The EEPROM of a drive that was never configured: empty, or as delivered.
    #[must_use]
    pub fn eeprom(self) -> [u8; 256] {
        match self {
            Self::Plain => [0; 256],
            Self::Nd21 => factory::eeprom(),
        }
    }
}

/// A drive of any model.
#[expect(
    clippy::large_enum_variant,
    reason = "most drives of a scenario are plain and small, and none is moved after it is built"
)]
#[derive(Clone, Debug)]
pub enum Drive {
    /// A plain drive.
    Plain(PlainDrive),
    /// An ND21.
    Nd21(Nd21Drive),
    /// A drive of either model that deviates from the manual.
    Deviant(Box<Deviant>),
    /// A drive with a witness.
    Witnessed(Box<Witness>),
}

/// The same call for whichever model it is.
macro_rules! each {
    ($self:ident, $drive:ident => $call:expr) => {
        match $self {
            Drive::Plain($drive) => $call,
            Drive::Nd21($drive) => $call,
            Drive::Deviant($drive) => $call,
            Drive::Witnessed($drive) => $call,
        }
    };
}

impl Drive {
    /// Its cells, past all rules of access.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        match self {
            Self::Plain(drive) => drive.memory(),
            Self::Nd21(drive) => drive.program().cells(),
            Self::Deviant(drive) => drive.drive().cells(),
            Self::Witnessed(drive) => drive.drive().cells(),
        }
    }

    /// Its cells, past all rules of access.
    pub fn cells_mut(&mut self) -> &mut Cells {
        match self {
            Self::Plain(drive) => drive.memory_mut(),
            Self::Nd21(drive) => drive.program_mut().cells_mut(),
            Self::Deviant(drive) => drive.drive_mut().cells_mut(),
            Self::Witnessed(drive) => drive.drive_mut().cells_mut(),
        }
    }

    /// The contents of a cell as an outside reader sees it.
    #[must_use]
    pub fn peek(&self, address: u16) -> u8 {
        match self {
            Self::Deviant(drive) => drive.peek(address),
            Self::Witnessed(drive) => drive.drive().peek(address),
            _ => self.cells().peek(address),
        }
    }

    /// Its end of the bus.
    #[must_use]
    pub fn bus_end(&self) -> &BusEnd {
        self.inside().0
    }

    /// Its end of the bus, and the memory on which that works.
    pub(crate) fn inside(&self) -> (&BusEnd, &dyn Memory) {
        match self {
            Self::Plain(drive) => drive.inside(),
            Self::Nd21(drive) => drive.inside(),
            Self::Deviant(drive) => drive.drive().inside(),
            Self::Witnessed(drive) => drive.drive().inside(),
        }
    }

    /// The same, to work with.
    pub(crate) fn parts(&mut self) -> (&mut BusEnd, &mut dyn Memory) {
        match self {
            Self::Plain(drive) => drive.parts(),
            Self::Nd21(drive) => drive.parts(),
            Self::Deviant(drive) => drive.drive_mut().parts(),
            Self::Witnessed(drive) => drive.drive_mut().parts(),
        }
    }

    /// Tells the drive that a caller gave its bus end a byte or a deadline through its [parts](Self::parts).
    pub(crate) fn bus_has_worked(&mut self) {
        if let Self::Nd21(drive) = self {
            drive.bus_has_worked();
        }
    }
}

impl Drive {
    /// Lets something happen to it from outside the bus; false where the model has no outside.
    pub fn stimulate(&mut self, stimulus: Stimulus) -> bool {
        match self {
            Self::Plain(_) => false,
            Self::Nd21(drive) => {
                drive.stimulate(stimulus);
                true
            }
            Self::Deviant(drive) => drive.drive_mut().stimulate(stimulus),
            Self::Witnessed(drive) => drive.drive_mut().stimulate(stimulus),
        }
    }

    /// What it shows outside the bus; `None` where the model has no outside.
    #[must_use]
    pub fn shown(&self) -> Option<OutputLevels> {
        match self {
            Self::Plain(_) => None,
            Self::Nd21(drive) => Some(drive.shown()),
            Self::Deviant(drive) => drive.drive().shown(),
            Self::Witnessed(drive) => drive.drive().shown(),
        }
    }
}

impl Drive {
    /// Keeps from now on which of its invariants is broken first, in place of a debug assertion.
    pub(crate) fn watch_invariants(&mut self) {
        match self {
            Self::Plain(_) => {}
            Self::Nd21(drive) => drive.program_mut().invariants.begin(),
            Self::Deviant(drive) => drive.drive_mut().watch_invariants(),
            Self::Witnessed(drive) => drive.drive_mut().watch_invariants(),
        }
    }

    /// The first of its invariants that was broken since it is watched.
    pub(crate) fn broken_invariant(&self) -> Option<&'static str> {
        match self {
            Self::Plain(_) => None,
            Self::Nd21(drive) => drive.program().invariants.broken(),
            Self::Deviant(drive) => drive.drive().broken_invariant(),
            Self::Witnessed(drive) => drive.drive().broken_invariant(),
        }
    }

    /// Adds a [witness](Witness) to a drive that has not received a byte yet, on a line with this byte time. Returns false if the drive
    /// is not a complete ND21 and cannot have one.
    #[must_use]
    pub fn witness(&mut self, byte_time: Span) -> bool {
        let whole = match &*self {
            Self::Plain(_) | Self::Witnessed(_) => false,
            Self::Nd21(_) => true,
            Self::Deviant(drive) => matches!(drive.drive(), Self::Nd21(_)),
        };
        if whole {
            *self = Self::Witnessed(Box::new(Witness::new(self.clone(), byte_time)));
        }
        whole
    }

    /// Its witness.
    pub fn its_witness(&mut self) -> Option<&mut Witness> {
        match self {
            Self::Witnessed(witness) => Some(witness),
            _ => None,
        }
    }
}

impl Device for Drive {
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        each!(self, drive => drive.receive(now, received))
    }

    fn deadline(&self) -> Option<Deadline> {
        each!(self, drive => drive.deadline())
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        each!(self, drive => drive.handle_deadline(now))
    }

    fn advance(&mut self, now: Instant) {
        each!(self, drive => drive.advance(now));
    }

    fn power_on(&mut self, now: Instant) {
        each!(self, drive => drive.power_on(now));
    }

    fn in_error(&self) -> bool {
        each!(self, drive => drive.in_error())
    }

    fn cause(&self) -> Option<BusError> {
        each!(self, drive => drive.cause())
    }

    fn head_start(&self) -> Span {
        each!(self, drive => drive.head_start())
    }

    fn relay(&self) -> Option<Relay> {
        each!(self, drive => drive.relay())
    }

    fn answer(&mut self, now: Instant, byte: u8) -> Reaction {
        each!(self, drive => drive.answer(now, byte))
    }

    fn has_relayed(&mut self, at: Instant, relay: Relay) {
        each!(self, drive => drive.has_relayed(at, relay));
    }
}
