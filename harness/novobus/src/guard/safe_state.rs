//! The safe state of a bench: every drive stopped, standing and blocked, and read back.

use crate::driver::{Axis, Error, OpenRings, Options, OrderNumber, recover};
use harness_bench::counted::counted;
use harness_bench::guard::{Safe, Standstill, StandstillStep};
use harness_bench::link::lateness::StoodStill;
use harness_bench::link::{Lead, Line, Octets, Trouble, wait_keeping};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_proto::nd21::bits::{flags, status};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{SpeedRange, speed_from_raw};
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::Job;
use harness_proto::novobus::sync::{Addressing, SyncByte, TelegramHeader};
use harness_proto::time::{Instant, Span};
use std::cell::Cell;
use std::fmt;

/// Number of recovery attempts before a ring counts as lost (ND21 9.8; no ring has needed more than three).
const ATTEMPTS: u8 = 3;

/// How often a ring is taken to its safe state where the computer stood still on the way. Drives are asked in vain meanwhile.
const TURNS: u8 = 3;

/// Whether the bench is in its safe state.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub enum SafeConfirmation {
    /// Every drive reported that it is stopped, blocked and standing. Holds the size of each ring.
    Confirmed(Vec<RingSize>),
    /// These drives are not confirmed; all others are.
    NotConfirmed(Vec<NotSafe>),
}

impl From<SafeConfirmation> for Safe {
    fn from(state: SafeConfirmation) -> Self {
        Self {
            confirmed: matches!(state, SafeConfirmation::Confirmed(_)),
            words: state.to_string(),
        }
    }
}

/// A drive that was not confirmed to stand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotSafe {
    /// The drive.
    pub axis: Axis,
    pub why: String,
}

impl fmt::Display for SafeConfirmation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Confirmed(rings) => {
                let drives: u32 = rings.iter().map(|size| u32::from(size.drives())).sum();
                let are = if drives == 1 { "is" } else { "are" };
                write!(
                    f,
                    "safe state: {} {are} stopped, standing and blocked",
                    counted(drives, "drive")
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

/// Brings every drive of the rings to its safe state and reads it back. A guarded line lets all of these bytes pass; after a denial,
/// [`Guarded::reset_after_denial`](harness_bench::guard::Guarded::reset_after_denial) must be called first.
///
/// A ring is recovered first (9.8), even from a half-sent telegram. Then all drives get the first step and are polled until they have
/// done it or their time is over; the next step goes to all drives, also to those that do not stand. The software stop ends every
/// motion on its ramp (11.8). The software block comes with a nominal speed of 0. A drive is confirmed if its `Flags` show all steps
/// (14.4.2) and it stands. A ring that does not answer gets the stops anyway, because drives in front of a break still receive them.
///
/// It takes up to about 15 seconds per ring, plus the time to stand per step if a drive does not stop. Where the computer stood still on
/// the way, which drives cannot tell from a master that has gone, a ring gets up to three attempts.
pub(crate) fn safe_state(
    line: &mut dyn Line,
    rings: &[RingSize],
    standing: &Standstill,
) -> SafeConfirmation {
    let mut not_safe = Vec::new();
    for (ring, &size) in rings.iter().enumerate() {
        not_safe.extend(ring_to_safe_state(line, ring, size, standing));
    }
    if not_safe.is_empty() {
        SafeConfirmation::Confirmed(rings.to_vec())
    } else {
        SafeConfirmation::NotConfirmed(not_safe)
    }
}

fn ring_to_safe_state(
    line: &mut dyn Line,
    ring: usize,
    size: RingSize,
    standing: &Standstill,
) -> Vec<NotSafe> {
    let mut late = Span::ZERO;
    for turn in 1.. {
        let mut one_ring = OneRing::new(line, ring);
        let mut not_safe = once(&mut one_ring, size, standing);
        let here = one_ring.still.get().total();
        late = late + here;
        let again = here > Span::ZERO && turn < TURNS && line.trouble().is_none();
        if not_safe.is_empty() || !again {
            for drive in &mut not_safe {
                drive.axis = Axis::new(ring, drive.axis.drive()).unwrap_or(drive.axis);
                if late > Span::ZERO {
                    let ms = late.as_nanos() / 1_000_000;
                    drive.why.push_str(&format!(
                        "; the computer stood still for {ms} ms in {} at it",
                        counted(turn, "attempt")
                    ));
                }
            }
            return not_safe;
        }
    }
    Vec::new()
}

/// One attempt at the only ring of a line.
fn once(line: &mut OneRing<'_>, size: RingSize, standing: &Standstill) -> Vec<NotSafe> {
    let all = |why: String| {
        let axes = (0..size.drives()).filter_map(|drive| Axis::new(0, drive));
        let not_safe = axes.map(|axis| NotSafe {
            axis,
            why: why.clone(),
        });
        not_safe.collect()
    };
    if let Err(why) = bring_back(line, 0, size) {
        stop_blindly(line, 0, size);
        return all(why);
    }
    let options = Options {
        patience: Span::from_millis(2_000),
        ..Options::default()
    };
    let bus = match OpenRings::open(Box::new(line), &[size], options) {
        Ok(bus) => bus,
        Err(error) => return all(error.to_string()),
    };
    let axes = (0..size.drives()).filter_map(|drive| Axis::new(0, drive));
    let mut drives: Vec<_> = axes.map(Halt::new).collect();
    let mut told = 0;
    for step in &standing.order {
        for command in commands(*step) {
            let answers = together(&bus, &drives, command);
            for (drive, answer) in drives.iter_mut().zip(answers) {
                drive.note(answer.err());
            }
        }
        told |= flag(*step);
        wait_until_seen(&bus, &mut drives, told, standing);
    }
    bus.close();
    let not_safe = drives.into_iter().filter_map(|drive| {
        Some(NotSafe {
            axis: drive.axis,
            why: drive.why?,
        })
    });
    not_safe.collect()
}

/// A drive on its way to the safe state.
struct Halt {
    axis: Axis,
    /// Why it is not in its safe state.
    why: Option<String>,
    /// When it came to stand.
    stood: Option<Instant>,
    seen: bool,
}

impl Halt {
    const fn new(axis: Axis) -> Self {
        Self {
            axis,
            why: None,
            stood: None,
            seen: false,
        }
    }

    fn note(&mut self, why: Option<String>) {
        self.why = self.why.take().or(why);
    }
}

/// Sends one command to every drive without waiting for each answer, so that the last drive of a long ring gets it without delay.
/// After the first missing answer, the answers behind it are not waited for.
fn together(
    bus: &OpenRings<'_>,
    drives: &[Halt],
    command: Command,
) -> Vec<Result<Option<u32>, String>> {
    let start = |drive: &Halt| bus.start(drive.axis, |k| Job::new(k, command));
    let orders: Vec<_> = drives.iter().map(start).collect();
    let mut lost: Option<String> = None;
    let result = |order: Result<OrderNumber, Error>| match (&lost, order) {
        (Some(lost), _) => Err(lost.clone()),
        (None, order) => order.and_then(|order| bus.result(order)).map_err(|error| {
            let text = error.to_string();
            lost = Some(text.clone());
            text
        }),
    };
    orders.into_iter().map(result).collect()
}

/// Waits until every drive stands and its `Flags` show the bits in `told`. A drive that failed before gets only [`FLAGS`] of time.
fn wait_until_seen(bus: &OpenRings<'_>, drives: &mut [Halt], told: u8, standing: &Standstill) {
    let read = |drives: &[Halt], address, whole| {
        let command = match whole {
            true => Command::ReadWord { address },
            false => Command::ReadByte { address },
        };
        together(bus, drives, command)
    };
    let ranges = read(drives, ram::SW_VERSION2, false);
    let begin = bus.now();
    for drive in drives.iter_mut() {
        (drive.seen, drive.stood) = (false, None);
    }
    loop {
        let found = read(drives, ram::FLAGS, false);
        let speeds = read(drives, ram::NIST, true);
        let now = bus.now();
        let answers = ranges.iter().zip(found).zip(speeds);
        for (drive, ((range, found), speed)) in drives.iter_mut().zip(answers) {
            if drive.seen {
                continue;
            }
            let (range, found, raw) = match (range.clone(), found, speed) {
                (Ok(Some(range)), Ok(Some(found)), Ok(Some(speed))) => {
                    let [.., range] = range.to_be_bytes();
                    let [.., found] = found.to_be_bytes();
                    let [_, _, high, low] = speed.to_be_bytes();
                    (range, found, i16::from_be_bytes([high, low]))
                }
                (Err(why), ..) | (_, Err(why), _) | (.., Err(why)) => {
                    drive.note(Some(why));
                    drive.seen = true;
                    continue;
                }
                _ => continue,
            };
            let range = SpeedRange::from_sw_version2(range);
            let speed = speed_from_raw(raw, range).to_f64();
            let stands = speed.abs() <= standing.rpm;
            drive.stood = stands.then(|| drive.stood.unwrap_or(now));
            if stands && found & told == told {
                drive.seen = true;
                continue;
            }
            let within = match drive.why {
                None => standing.within,
                Some(_) => FLAGS,
            };
            let late = match drive.stood {
                None => now >= begin + within,
                Some(stood) => now >= stood + FLAGS,
            };
            if late {
                drive.seen = true;
                drive.note(Some(format!(
                    "waited {} for drive {} to do as told and to stand (Flags are {found:02X}, {told:02X} of them told; nist is {speed:.1} rpm)",
                    now.since(begin),
                    drive.axis
                )));
            }
        }
        if drives.iter().all(|drive| drive.seen) {
            return;
        }
    }
}

/// Ends a half-sent telegram and recovers the ring (ND21 9.8).
fn bring_back(line: &mut dyn Line, ring: usize, size: RingSize) -> Result<(), String> {
    let mut why = String::new();
    for _ in 0..ATTEMPTS {
        let sent = line.send_octets(ring, &CHECK_SEQUENCE);
        while line.now() < sent && wait_keeping(line, sent) {}
        let recovery = recover(line, ring);
        if recovery.drives == Some(size) {
            return Ok(());
        }
        let reported = recovery
            .after
            .or(recovery.fault().map(|spelled| spelled.drive));
        why = match (line.trouble(), recovery.drives, reported) {
            (Some(trouble), ..) => return Err(trouble.to_string()),
            (None, Some(found), _) => format!(
                "the ring has {}, not {} as expected",
                counted(found.drives(), "drive"),
                size.drives()
            ),
            (None, None, Some(drive)) => {
                format!("the ring is broken in front of drive {drive} (ND21 9.7, 9.9)")
            }
            (None, None, None) if recovery.zeros_unasked => {
                "zeros come without end although nothing is sent (ND21 9.9)".to_owned()
            }
            (None, None, None) => "the ring does not answer".to_owned(),
        };
    }
    Err(why)
}

/// The check sequence (9.8) and the software stop for every drive of a ring (14.10), for senders that cannot wait for an answer.
#[must_use]
pub(crate) fn blind_stop(size: RingSize) -> Vec<u8> {
    let mut bytes = CHECK_SEQUENCE.to_vec();
    let stop = Command::Or {
        address_low: ram::STATUS.to_be_bytes()[1],
        data: status::STOP,
    };
    for drive in 0..size.drives() {
        bytes.extend(telegram(size, drive, stop));
    }
    bytes
}

/// A telegram with a command and nothing else to a drive of a ring, its address spelled out (ND21 9.2); empty for a drive that the ring
/// does not have.
pub(crate) fn telegram(size: RingSize, drive: u8, command: Command) -> Vec<u8> {
    let net = command.encode();
    let length = u8::try_from(net.len()).unwrap_or(u8::MAX);
    let header = TelegramHeader::new(Addressing::AddressFollows, false, length);
    let (Ok(header), Ok(address)) = (header, size.address_byte(drive)) else {
        return Vec::new();
    };
    let mut bytes = vec![SyncByte::Telegram(header).encode(), address];
    bytes.extend(&net[..]);
    bytes
}

fn stop_blindly(line: &mut dyn Line, ring: usize, size: RingSize) {
    if matches!(line.trouble(), Some(Trouble::Lost(_))) {
        return;
    }
    let sent = line.send_octets(ring, &blind_stop(size));
    while line.now() < sent && line.wait(sent) {}
}

/// How long `Flags` may take to follow a command; a drive updates them in its next cycle.
const FLAGS: Span = Span::from_millis(500);

/// The commands of this step (11.8, 14.10).
fn commands(step: StandstillStep) -> Vec<Command> {
    let status = |data| Command::Or {
        address_low: ram::STATUS.to_be_bytes()[1],
        data,
    };
    let stand = Command::WriteWord {
        address: ram::NSOLL,
        data: 0,
    };
    match step {
        StandstillStep::Stop => vec![status(status::STOP)],
        StandstillStep::Block => vec![stand, status(status::BLOCK)],
    }
}

/// What `Flags` show of it (14.4.2).
const fn flag(step: StandstillStep) -> u8 {
    match step {
        StandstillStep::Stop => flags::STOP,
        StandstillStep::Block => flags::BLOCK,
    }
}

/// One ring of a line, as a line of its own. It measures for how long the computer stands still: nothing but the line takes time on the way
/// to the safe state.
struct OneRing<'l> {
    line: &'l mut dyn Line,
    ring: usize,
    still: Cell<StoodStill>,
}

impl<'l> OneRing<'l> {
    fn new(line: &'l mut dyn Line, ring: usize) -> Self {
        Self {
            still: Cell::new(StoodStill::new(line.now())),
            line,
            ring,
        }
    }

    /// The time, which should be that of the last call, or `due` where that is later.
    fn look(&self, due: Instant) -> Instant {
        let (now, mut still) = (self.line.now(), self.still.get());
        still.look(now, due);
        self.still.set(still);
        now
    }
}

impl Line for OneRing<'_> {
    fn medium(&self, port: usize) -> Medium {
        self.line.medium(port)
    }

    fn now(&self) -> Instant {
        self.look(Instant::START)
    }

    fn send(&mut self, _: usize, what: Out<'_>) -> Instant {
        let end = self.line.send(self.ring, what);
        self.look(Instant::START);
        end
    }

    fn receive(&mut self, _: usize) -> Option<(Instant, HeardPiece)> {
        self.line.receive(self.ring)
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.look(Instant::START);
        let more = self.line.wait(until);
        self.look(until);
        more
    }

    fn attend(&mut self, _: usize, at: Instant) {
        self.line.attend(self.ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.line.trouble()
    }

    fn lead(&self) -> Lead {
        self.line.lead()
    }

    fn keep(&mut self) -> Option<Instant> {
        self.line.keep()
    }
}
