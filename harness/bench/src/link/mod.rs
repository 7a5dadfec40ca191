//! What a scenario is played on: a ring as the master sees it, and what else can be seen and done there.
//!
//! A scenario sees a link and nothing behind it. Each link says what it can observe and inject; what it
//! cannot makes a scenario that needs it skipped, never wrong.

pub mod bench_clock;
pub mod echo;
pub mod frames;
pub mod inner;
pub mod lateness;
pub mod octets;
pub mod port_end;
pub mod pump;
pub mod record;
pub mod replay;
pub mod stamp;
#[cfg(any(test, feature = "trials"))]
pub mod stands_still;
pub mod stimulus;
pub mod tamper;

pub use crate::trouble::Trouble;
pub use harness_sim::fault::{DriveFault, LinkFault};
pub use harness_sim::segment::FrameFault;
pub use inner::{Delay, InnerLink, InnerPorts};
pub use octets::Octets;
pub use record::{LinkEvent, Look, Recording, Sink};
pub use replay::Replay;
pub use stimulus::AnyStimulus;
pub(crate) use tamper::is_wrong_parity;
pub use tamper::{needs_line_errors, only_simulated};

use crate::medium::{HeardPiece, Medium, Out};
use crate::port::{LastWords, Switch};
use harness_proto::line::Received;
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// What a rig can be asked to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Capability {
    /// Bytes on inner links can be changed.
    Interposer,
    /// Bytes on inner links can be seen.
    Tap,
    /// Drives' cells can be set and read beside the bus.
    Memory,
    /// Drives can be switched off and on.
    Power,
    /// Drives may turn.
    Motion,
    /// EEPROM may be written.
    Eeprom,
    /// Drives may be reset.
    Reset,
    /// Line errors can be sent, and are shown at their byte.
    LineErrors,
    TwoRings,
    /// Simulated drives, for what must not be tried on a machine.
    Simulator,
}

impl Capability {
    /// The names in a scenario.
    pub const NAMES: [(&'static str, Self); 10] = [
        ("interposer", Self::Interposer),
        ("tap", Self::Tap),
        ("memory", Self::Memory),
        ("power", Self::Power),
        ("motion", Self::Motion),
        ("eeprom", Self::Eeprom),
        ("reset", Self::Reset),
        ("line-errors", Self::LineErrors),
        ("two-rings", Self::TwoRings),
        ("simulator", Self::Simulator),
    ];

    /// The name in a scenario.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES
            .iter()
            .find(|(_, capability)| *capability == self)
            .map_or("", |(name, _)| name)
    }
}

/// A fault, where it happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlacedFault {
    /// On a link of the ring: 0 is the master's outgoing one, N the one that ends at the master.
    Link(usize, LinkFault),
    /// On a frame of a shared segment.
    Frame(FrameFault),
    Drive(u8, DriveFault),
    /// To a drive, from outside the bus; at a time only.
    Stimulus(u8, AnyStimulus),
}

impl fmt::Display for PlacedFault {
    /// As a scenario writes it after its place: `flip 0`, `drive 3 off`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Link(_, fault) => fault.fmt(f),
            Self::Frame(fault) => fault.fmt(f),
            Self::Drive(drive, fault) => write!(f, "drive {drive} {fault}"),
            Self::Stimulus(drive, stimulus) => write!(f, "drive {drive} {stimulus}"),
        }
    }
}

/// A link as a scenario writes it: `98->97`, `2:0->master`; `place` counts from the master's outgoing link.
#[must_use]
pub fn link_name(ring: usize, drives: u8, place: usize) -> String {
    let prefix = if ring == 0 { "" } else { "2:" };
    let end = |place: usize| match usize::from(drives).checked_sub(place) {
        Some(drive) if place > 0 => drive.to_string(),
        _ => "master".to_owned(),
    };
    format!("{prefix}{}->{}", end(place), end(place + 1))
}

/// When a fault happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// Now; what needs a byte takes the next one.
    Now,
    /// At the n-th piece since the start, counted from 1: a byte of a link, a frame of a segment.
    Byte(u64),
    /// At this time.
    At(Instant),
}

/// How far ahead of the line bytes may be queued. In real time a busy computer that queues none leaves gaps between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lead {
    /// While no answer is awaited.
    pub far: Span,
    /// Past the time at which an awaited answer arrives: what the caller sends next leaves after these bytes.
    pub near: Span,
}

/// The longest [probe](Link::probe): far more than the longest round.
const PROBED: Span = Span::from_millis(10_000);

/// A gap on the line that no drive takes for a time-out: drives wait for at least 10 ms (ND21 9.9).
pub const HARMLESS: Span = Span::from_millis(5);

impl Lead {
    /// Each byte is handed over when the line is free for it: time waits for the sender.
    pub const NONE: Self = Self {
        far: Span::ZERO,
        near: Span::ZERO,
    };

    /// The longest gap between bytes that a late computer explains; a longer one is the sender's own.
    #[must_use]
    pub fn gap(self) -> Span {
        match self {
            Self::NONE => Span::ZERO,
            Self { near, .. } => near + HARMLESS,
        }
    }
}

/// A bus as the bench's own station sees it: what its ports carry and the time, and nothing else. A port is a place where the bench
/// itself speaks, counted from 0.
pub trait Line: Send {
    /// What a port carries, and how fast. For a port that the line does not have: that of the first port.
    fn medium(&self, port: usize) -> Medium;

    fn now(&self) -> Instant;

    /// Sends pieces one after another, after what is still to be sent. Returns when the last one will have left, as far as the line
    /// knows: on a bus that other stations use, it can be later. Pieces of another medium than the port's are not sent.
    fn send(&mut self, port: usize, what: Out<'_>) -> Instant;

    /// Whether this may be sent now, as far as the line knows: a guarded one knows its limits.
    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        let _any = (port, what);
        true
    }

    /// Why this may not be sent now, in a sentence; `None` if it may. Nothing is sent.
    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        let _any = (port, what);
        None
    }

    /// How many of the pieces of the last [`Self::send`] were not taken: those from the first that was denied on.
    fn refused(&self) -> usize {
        0
    }

    /// Takes the next piece that was received and has not been fetched yet.
    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)>;

    /// Lets time pass until something happens, at most until `until`. Returns false if nothing will ever happen unless the master
    /// sends. Edge-triggered: input that was already reported and is still unread may not be reported again. With
    /// [trouble](Self::trouble) time may stand still: a caller that waits in a loop must check for it.
    fn wait(&mut self, until: Instant) -> bool;

    /// Hint: the caller expects a reply at `at`; real-time links busy-poll around that time.
    fn attend(&mut self, port: usize, at: Instant) {
        let _always_awake = (port, at);
    }

    /// Why nothing more is carried; `None` while all is well. A simulated link has no trouble.
    fn trouble(&self) -> Option<&Trouble> {
        None
    }

    /// Puts the line in this trouble, unless it is in another one: its user has found that nothing must go on.
    fn fail(&mut self, trouble: Trouble) {
        let _only_guarded_lines = trouble;
    }

    /// When this line next needs a [pause](Self::pause), on its own clock: a time without traffic in which it queries drives
    /// itself. `None` if it never needs one.
    fn pause_due(&self) -> Option<Instant> {
        None
    }

    /// Lets the line make its own queries. The caller has nothing under way, has fetched all that was received, and waits. Afterwards the
    /// drives are in the same state as before, and the same drive is the last one addressed; only time has passed.
    fn pause(&mut self) {}

    /// How far ahead of the line a driver may hand over its bytes.
    fn lead(&self) -> Lead {
        Lead::NONE
    }

    /// Adds what the bus carries when it is idle on every port, after what waits to be sent, so that drives that watch for silence hear no
    /// gap. Returns when it must be called again; `None` for a line that is not kept. What it adds comes back like all else.
    fn keep(&mut self) -> Option<Instant> {
        None
    }
}

/// Like [`Line::wait`], and meanwhile [keeps](Line::keep) the line.
pub fn wait_keeping(line: &mut dyn Line, until: Instant) -> bool {
    let again = line.keep();
    line.wait(again.map_or(until, |again| again.min(until)))
}

/// A borrowed line: its owner can use it again afterwards.
impl<L: Line + ?Sized> Line for &mut L {
    fn medium(&self, port: usize) -> Medium {
        (**self).medium(port)
    }

    fn now(&self) -> Instant {
        (**self).now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        (**self).send(port, what)
    }

    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        (**self).permits(port, what)
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        (**self).denied(port, what)
    }

    fn refused(&self) -> usize {
        (**self).refused()
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, HeardPiece)> {
        (**self).receive(port)
    }

    fn wait(&mut self, until: Instant) -> bool {
        (**self).wait(until)
    }

    fn attend(&mut self, port: usize, at: Instant) {
        (**self).attend(port, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        (**self).trouble()
    }

    fn fail(&mut self, trouble: Trouble) {
        (**self).fail(trouble);
    }

    fn pause_due(&self) -> Option<Instant> {
        (**self).pause_due()
    }

    fn pause(&mut self) {
        (**self).pause();
    }

    fn lead(&self) -> Lead {
        (**self).lead()
    }

    fn keep(&mut self) -> Option<Instant> {
        (**self).keep()
    }
}

/// A link over ports, in real time.
pub trait PortLink: Link {
    /// A counter that increases as long as the user of this link keeps calling it; a watchdog reads it.
    fn beats(&self) -> Arc<AtomicU64>;

    /// How a watchdog can send when the owner of this link hangs, on each port as it codes pieces.
    ///
    /// # Errors
    /// No file descriptor is left.
    fn last_words(&self) -> io::Result<Vec<LastWords>>;

    /// Allows sending again after an interruption, or at an interface that is back, so that a safe state can be reached. Other trouble stays.
    fn resume(&mut self);

    /// Number of line errors since the last call that the transport reported without their byte.
    fn take_unplaced(&mut self) -> u64;

    /// Number of reports since the last call that do not say whether something was lost.
    fn take_doubtful(&mut self) -> u64 {
        0
    }

    /// Every time that the parity of a port was switched, to send a byte with a wrong parity bit.
    fn take_switches(&mut self) -> Vec<Switch>;

    /// Whether the driver of a serial port switches the parity, as far as it says so; `None` at other ports.
    fn switches_parity(&self, port: usize) -> Option<bool> {
        let _none = port;
        None
    }

    /// Whether a port is a serial one of which it is not known that it makes the line's rate.
    fn has_unproven_rate(&self, port: usize) -> bool {
        let _none = port;
        false
    }

    /// Where a port leads, as the rig's file says it.
    fn port_name(&self, port: usize) -> &str {
        let _none = port;
        "the port"
    }

    /// The inner links at which the bench has a port.
    fn inner_links(&self) -> &[InnerLink];
}

/// A bus as a scenario sees it.
pub trait Link: Line {
    /// What this link can do besides sending and receiving.
    fn capabilities(&self) -> &[Capability];

    /// Begins a conversation: restarts the time and the byte counts, and drops pending faults and unread input. The drives keep
    /// their state.
    fn begin(&mut self);

    /// Marks the start of the scenario step at this place of its text, for links that record.
    fn step(&mut self, place: usize) {
        let _forgotten = place;
    }

    /// Whether what the bench has sent is still on its way, or its answers are.
    fn busy(&self) -> bool;

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment);

    /// Whether a fault can be put on a link of a ring: 0 is the master's outgoing one.
    fn reaches(&self, ring: usize, link: usize) -> bool {
        let _any = (ring, link);
        true
    }

    /// Whether a byte on a link that is [reached](Self::reaches) can get a wrong parity bit.
    fn damages_parity(&self, ring: usize, link: usize) -> bool {
        let _any = (ring, link);
        true
    }

    /// Whether the bytes on a link of a ring are seen: 0 is the master's outgoing one.
    fn listens(&self, ring: usize, link: usize) -> bool {
        let _any = (ring, link);
        false
    }

    /// The bytes that have arrived at the end of a link of a ring since the conversation began; `None` where nothing
    /// [listens](Self::listens).
    fn tapped(&mut self, ring: usize, link: usize) -> Option<Vec<Received>> {
        let listens = self.listens(ring, link);
        let trace = listens.then(|| self.trace(ring))?;
        let bytes = trace.channels.get(link)?.octets().iter();
        let arrived = bytes.filter_map(|carried| {
            let byte = carried.received?;
            Some(Received {
                byte,
                error: carried.error,
            })
        });
        Some(arrived.collect())
    }

    /// How exact its times are: zero where time is virtual.
    fn time_tolerance(&self) -> Span {
        Span::ZERO
    }

    /// When the bench had last looked at or waited for its ports before it read the latest input, which may have come at any time since.
    /// `None` where time is virtual, or where the driver stamps what comes.
    fn unwatched_since(&self) -> Option<Instant> {
        None
    }

    /// Sends octets outside the conversation and returns those received until the answers are back. Where a link can, it leaves no trace of
    /// this.
    fn probe(&mut self, port: usize, octets: &[u8]) -> Vec<Received> {
        self.send_octets(port, octets);
        let mut came = Vec::new();
        let end = self.now() + PROBED;
        while self.busy() && self.now() < end && self.wait(end) {
            came.extend(std::iter::from_fn(|| self.receive_octet(port)).map(|(_, octet)| octet));
        }
        came.extend(std::iter::from_fn(|| self.receive_octet(port)).map(|(_, octet)| octet));
        came
    }

    /// Access beside the bus: the simulation itself, which only a bus's own code knows by its type. `None` on a rig and behind a
    /// recording.
    fn beside(&self) -> Option<&dyn Any> {
        None
    }

    /// Faults that were never injected, in words.
    fn unused_faults(&self) -> Vec<String>;

    /// Empties the record of what was carried; times and counts go on. A simulated link records what comes only if `on`; a link over ports
    /// always does, as its record has a bound. Other links keep their record.
    fn record(&mut self, on: bool) {
        let _kept = on;
    }

    /// How many pieces all channels together have carried, as far as they are recorded.
    fn carried(&self) -> u64;

    /// Number of stations on a port besides the bench: the drives of a ring.
    fn drives(&self, port: usize) -> u8;

    /// Everything seen of a port.
    fn trace(&self, port: usize) -> Trace;
}
