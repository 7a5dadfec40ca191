//! The safe state of a bench: every drive stopped, standing and blocked, and read back.

use crate::bus::{Axis, Bus, Error, Options, recover};
use crate::link::{Line, Trouble};
use harness_proto::line::Received;
use harness_proto::nd21::bits::{flags, status};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::speed_from_raw;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::sync::{Addressing, Header, SyncByte};
use harness_proto::time::{Instant, Span};
use std::fmt;

/// How often a ring is brought back before it counts as lost (ND21 9.8; three are the most that were ever needed).
const ATTEMPTS: u8 = 3;

/// What a drive is told on its way to the safe state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SafeStep {
    /// To stop on its ramp, and to stand.
    Stop,
    /// To give no torque, with a nominal speed of 0.
    Block,
}

/// How drives are taken to their safe state, and when they count as standing.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// What they are told, in this order.
    pub order: Vec<SafeStep>,
    /// The speed below which a motor counts as standing, in rpm.
    pub rpm: f64,
    /// How long it may take to stand.
    pub within: Span,
}

impl Default for Standing {
    fn default() -> Self {
        Self {
            order: vec![SafeStep::Stop, SafeStep::Block],
            rpm: 5.0,
            within: Span::from_millis(5_000),
        }
    }
}

/// Whether the bench is in its safe state.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub enum SafeState {
    /// Every drive answered that it is stopped, blocked and standing: so many drives a ring.
    Confirmed(Vec<RingSize>),
    /// Of these drives nobody knows; the others are.
    NotConfirmed(Vec<NotSafe>),
}

/// A drive that was not confirmed to stand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotSafe {
    /// The drive.
    pub axis: Axis,
    /// Why.
    pub why: String,
}

impl fmt::Display for SafeState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Confirmed(rings) => {
                let drives: u32 = rings.iter().map(|size| u32::from(size.drives())).sum();
                write!(
                    f,
                    "safe state: {drives} drives are stopped, standing and blocked"
                )
            }
            Self::NotConfirmed(drives) => {
                f.write_str("the safe state is NOT confirmed; use the emergency stop")?;
                for drive in drives {
                    write!(f, "\n  drive {}: {}", drive.axis, drive.why)?;
                }
                Ok(())
            }
        }
    }
}

/// Brings every drive of the rings to its safe state and reads it back; a guarded line lets all of it pass, behind a
/// denial after [`Guarded::reset_after_denial`](super::Guarded::reset_after_denial).
///
/// A ring is brought back first (9.8), whatever was half-sent. Then all drives get the first of the steps, each is seen to do it, and
/// the next follows, on a drive that does not stand as well. The software stop ends every motion on its ramp (11.8); with the
/// software block goes the nominal speed 0. Confirmed is a drive whose `Flags` show what it was told (14.4.2) and
/// that stands. A ring that does not answer is given the stops all the same, as drives in front of a break hear
/// them.
///
/// It ends within about 15 seconds a ring, and the time to stand a step for a drive that does not stop.
pub fn safe_state(line: &mut dyn Line, rings: &[RingSize], standing: &Standing) -> SafeState {
    let mut not_safe = Vec::new();
    for (ring, &size) in rings.iter().enumerate() {
        not_safe.extend(ring_to_safe_state(line, ring, size, standing));
    }
    if not_safe.is_empty() {
        SafeState::Confirmed(rings.to_vec())
    } else {
        SafeState::NotConfirmed(not_safe)
    }
}

fn ring_to_safe_state(
    line: &mut dyn Line,
    ring: usize,
    size: RingSize,
    standing: &Standing,
) -> Vec<NotSafe> {
    let all = |why: String| {
        let axes = (0..size.drives()).filter_map(|drive| Axis::new(ring, drive));
        let not_safe = axes.map(|axis| NotSafe {
            axis,
            why: why.clone(),
        });
        not_safe.collect()
    };
    if let Err(why) = bring_back(line, ring, size) {
        stop_blindly(line, ring, size);
        return all(why);
    }
    let options = Options {
        patience: Span::from_millis(2_000),
        ..Options::default()
    };
    let line = OneRing { line, ring };
    let bus = match Bus::open(Box::new(line), &[size], options) {
        Ok(bus) => bus,
        Err(error) => return all(error.to_string()),
    };
    // The bus has one ring, whichever it is of the bench.
    let axes = || (0..size.drives()).filter_map(|drive| Axis::new(0, drive));
    let axes: Vec<_> = axes().collect();
    let mut why: Vec<Option<String>> = vec![None; axes.len()];
    let mut told = 0;
    for step in &standing.order {
        let ordered: Vec<_> = axes.iter().map(|axis| order(&bus, *axis, *step)).collect();
        told |= step.flag();
        // Standing is waited for once: a drive that does not stop is not waited for again.
        for ((axis, ordered), why) in axes.iter().zip(ordered).zip(&mut why) {
            let within = match why {
                None => standing.within,
                Some(_) => FLAGS,
            };
            let seen = ordered.and_then(|()| see(&bus, *axis, told, standing.rpm, within));
            *why = why.take().or(seen.err().map(|error| error.to_string()));
        }
    }
    bus.close();
    let not_safe = axes.iter().zip(why).filter_map(|(axis, why)| {
        Some(NotSafe {
            axis: Axis::new(ring, axis.drive())?,
            why: why?,
        })
    });
    not_safe.collect()
}

/// Ends what was half-sent and brings the ring back (ND21 9.8).
fn bring_back(line: &mut dyn Line, ring: usize, size: RingSize) -> Result<(), String> {
    let mut why = String::new();
    for _ in 0..ATTEMPTS {
        let sent = line.send(ring, &CHECK_SEQUENCE);
        while line.now() < sent && line.wait(sent) {}
        let recovery = recover(line, ring);
        if recovery.drives == Some(size) {
            return Ok(());
        }
        let reported = recovery.after.or(recovery.before);
        why = match (line.trouble(), recovery.drives, reported) {
            (Some(trouble), ..) => return Err(trouble.to_string()),
            (None, Some(found), _) => format!(
                "the ring has {} drives, not {} as expected",
                found.drives(),
                size.drives()
            ),
            (None, None, Some(drive)) => {
                format!("the ring is broken in front of drive {drive} (ND21 9.7, 9.9)")
            }
            (None, None, None) => "the ring does not answer".to_owned(),
        };
    }
    Err(why)
}

/// The check sequence (9.8) and the software stop for every drive of a ring (14.10): for whoever can wait for no answer.
#[must_use]
pub fn blind_stop(size: RingSize) -> Vec<u8> {
    let mut bytes = CHECK_SEQUENCE.to_vec();
    let stop = Command::Or {
        address_low: ram::STATUS.to_be_bytes()[1],
        data: status::STOP,
    };
    let net = stop.encode();
    let length = u8::try_from(net.len()).unwrap_or(u8::MAX);
    let Ok(header) = Header::new(Addressing::AddressFollows, false, length) else {
        return bytes;
    };
    for drive in 0..size.drives() {
        if let Ok(address) = size.address_byte(drive) {
            bytes.extend([SyncByte::Telegram(header).encode(), address]);
            bytes.extend(&net[..]);
        }
    }
    bytes
}

fn stop_blindly(line: &mut dyn Line, ring: usize, size: RingSize) {
    if matches!(line.trouble(), Some(Trouble::Lost(_))) {
        return;
    }
    let sent = line.send(ring, &blind_stop(size));
    while line.now() < sent && line.wait(sent) {}
}

/// How long `Flags` may take to follow: they do in the drive's next cycle.
const FLAGS: Span = Span::from_millis(500);

impl SafeStep {
    /// What `Flags` show of it (14.4.2).
    const fn flag(self) -> u8 {
        match self {
            Self::Stop => flags::STOP,
            Self::Block => flags::BLOCK,
        }
    }
}

fn order(bus: &Bus<'_>, axis: Axis, step: SafeStep) -> Result<(), Error> {
    match step {
        SafeStep::Stop => bus.stop(axis),
        SafeStep::Block => {
            bus.write_word(axis, ram::NSOLL, 0)?;
            bus.block(axis)
        }
    }
}

/// Waits until a drive shows what it was told, and stands.
fn see(bus: &Bus<'_>, axis: Axis, told: u8, rpm: f64, within: Span) -> Result<(), Error> {
    let range = bus.speed_range(axis)?;
    let begin = bus.now();
    let mut stood = None;
    loop {
        let found = bus.read_byte(axis, ram::FLAGS)?;
        let raw = bus.read_word(axis, ram::NIST)?.cast_signed();
        let speed = speed_from_raw(raw, range).to_f64();
        let now = bus.now();
        stood = (speed.abs() <= rpm).then(|| stood.unwrap_or(now));
        if stood.is_some() && found & told == told {
            return Ok(());
        }
        let late = match stood {
            None => now >= begin + within,
            Some(stood) => now >= stood + FLAGS,
        };
        if late {
            return Err(Error::TimeOut {
                waited: now.since(begin),
                what: format!(
                    "drive {axis} to do as told and to stand (Flags are {found:02X}, {told:02X} of them told; nist is {speed:.1} rpm)"
                ),
            });
        }
    }
}

/// One ring of a line, as a line of its own.
struct OneRing<'l> {
    line: &'l mut dyn Line,
    ring: usize,
}

impl Line for OneRing<'_> {
    fn byte_time(&self) -> Span {
        self.line.byte_time()
    }

    fn now(&self) -> Instant {
        self.line.now()
    }

    fn send(&mut self, _: usize, bytes: &[u8]) -> Instant {
        self.line.send(self.ring, bytes)
    }

    fn receive(&mut self, _: usize) -> Option<(Instant, Received)> {
        self.line.receive(self.ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.line.wait(until)
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.line.trouble()
    }

    fn lead(&self) -> Span {
        self.line.lead()
    }
}
