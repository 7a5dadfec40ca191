//! The safe state of UNITEK drives: no speed, no torque, locked, cycles stopped, and read back.

use super::driver::{Driver, Error};
use super::rig::Axis;
use super::whereabouts::{Search, still_sent};
use crate::gate::GuardsSegment as _;
use harness_bench::guard::{Guarded, Safe, Standstill, StandstillStep};
use harness_bench::link::Line;
use harness_bench::medium::Medium;
use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use harness_proto::unitek::bit_timing::Nbt;
use harness_proto::unitek::frame::{Data, Reply, Request};
use harness_proto::unitek::guard::{FrameGate, Places};
use harness_proto::unitek::units::{Given, Scaling, shown};
use harness_proto::unitek::words::{ERRORS, MODE_LOCK, set_bits, status};

/// The registers of a speed and of a torque command.
const COMMANDS: [u8; 2] = [0x31, 0x90];

/// MODE (ex 2).
const MODE: u8 = 0x51;

/// How often a register is written that does not take its value: a frame may be lost.
const TRIES: usize = 3;

/// Time behind a port, where a silent drive may be asked again (`Driver::outlasting`).
const REAL: Span = Span::from_millis(1);

/// How often the speed of a drive is looked at that does not stand yet.
const AGAIN: Span = Span::from_millis(20);

/// The frames that lock a drive and set its commands to 0, without waiting for anything: for a watchdog.
#[must_use]
pub(crate) fn last_words(axes: &[Axis]) -> Vec<Frame> {
    let write = |register, value| Request::Write {
        register,
        data: Data::Short(value),
    };
    let words = |axis: &Axis| {
        let all = [
            write(0x51, MODE_LOCK),
            write(COMMANDS[0], 0),
            write(COMMANDS[1], 0),
        ];
        let frames = all.into_iter().flat_map(|request| request.encode(axis.rx));
        frames.collect::<Vec<_>>()
    };
    axes.iter().flat_map(words).collect()
}

/// Takes every drive to its safe state and reads it back: a stop on the ramp, where the rig's file permits commands to a drive that is
/// not locked; locked; commands 0; every cycle that was started stopped. Ready, status and errors are read for the report. A drive whose
/// identifiers were written is looked for, and they are set back.
///
/// A drive is confirmed if it reads locked, not enabled, with commands 0, and stands, and if it is found where the rig's file says.
/// `way_back` is what the rig's file says of a drive with another bit rate.
pub(crate) fn safe_state<L: Line>(
    line: &mut Guarded<L>,
    axes: &[Axis],
    patience: Span,
    standing: &Standstill,
    way_back: Option<&str>,
) -> Safe {
    let gate = line.segment();
    let cycles: Vec<_> = gate.map_or_else(Vec::new, |gate| gate.cycles().collect());
    let places: Vec<_> = gate.map_or_else(Vec::new, |gate| gate.places().collect());
    let mut report = |axis: &Axis, tolerance| {
        let mut places = places.iter();
        let places = places.find(|place| place.first == (axis.rx, axis.tx));
        let mut place = Place {
            line,
            first: *axis,
            patience,
            places,
        };
        let at = place.find();
        let driver = Driver::new(Box::new(&mut *place.line), &[at], patience);
        let mut driver = driver.outlasting(tolerance);
        let running = cycles.iter().filter(|(rx, _)| *rx == axis.rx);
        let running: Vec<_> = running.map(|(_, register)| *register).collect();
        let made = make_safe(&mut driver, at, &running, standing);
        drop(driver);
        let report = match made {
            Ok(report) => report,
            Err(why) => {
                let lost = place.lost(way_back);
                return Report {
                    end: why.end(),
                    words: format!("NOT confirmed: {why}{lost}"),
                };
            }
        };
        let sent = still_sent(place.line, axis.rx, (at.rx, at.tx));
        let sent = sent.iter().map(|register| {
            let rx = at.rx;
            format!("; register {register:02X} is still sent: {rx:03X}#3D{register:02X}FF has not ended it")
        });
        let report = report + &sent.collect::<String>();
        let (end, words) = match place.bring_back(at) {
            Ok(None) => (End::Safe, report),
            Ok(Some(note)) => (End::Safe, format!("{report}; {note}")),
            Err(why) => (
                End::Elsewhere,
                format!("{report}; NOT as it was found: {why}"),
            ),
        };
        Report { end, words }
    };
    let mut reports: Vec<_> = axes.iter().map(|axis| report(axis, Span::ZERO)).collect();
    // An adapter may have stood still. All other drives are safe before one is waited for.
    for (axis, first_report) in axes.iter().zip(&mut reports) {
        if matches!(first_report.end, End::Silent | End::Elsewhere) {
            *first_report = report(axis, REAL);
        }
    }
    let safe = (reports.iter()).all(|report| matches!(report.end, End::Safe | End::Elsewhere));
    let back = reports.iter().all(|report| report.end != End::Elsewhere);
    let words = match (safe, back) {
        (true, true) => "safe state: every drive is locked and stands, with commands 0",
        (true, false) => {
            "every drive is locked and stands, with commands 0, but not every one is as it was found"
        }
        (false, _) => "the safe state is NOT confirmed; use the emergency stop",
    };
    Safe {
        confirmed: safe && back,
        words: (axes.iter().zip(&reports)).fold(words.to_owned(), |words, (axis, report)| {
            format!("{words}\n  drive {}: {}", axis.node, report.words)
        }),
    }
}

struct Report {
    end: End,
    words: String,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    Safe,
    /// Safe, but not on the identifiers of the rig's file.
    Elsewhere,
    Silent,
    NotSafe,
}

/// Why a drive is not confirmed.
#[derive(Debug, thiserror::Error)]
enum SafetyError {
    #[error(transparent)]
    Call(#[from] Error),
    #[error("{0}")]
    Reads(String),
}

impl SafetyError {
    const fn end(&self) -> End {
        match self {
            Self::Call(Error::NoReply { .. }) => End::Silent,
            Self::Call(_) | Self::Reads(_) => End::NotSafe,
        }
    }
}

/// Where a drive is, as far as the gate knows.
struct Place<'p, L> {
    line: &'p mut Guarded<L>,
    /// The drive as the rig's file names it.
    first: Axis,
    patience: Span,
    places: Option<&'p Places>,
}

impl<L: Line> Place<'_, L> {
    fn search(&mut self) -> Option<Search<'_, L>> {
        Some(Search {
            line: &mut *self.line,
            places: self.places?,
            patience: self.patience,
        })
    }

    /// Whether identifiers were written to any drive: another one may have taken them.
    fn may_have_moved(&self) -> bool {
        let given = self.line.segment().map(FrameGate::given);
        given.is_some_and(|given| given.iter().any(|ids| !ids.is_empty()))
    }

    /// The drive where it answers; where the rig's file says if it was not moved, or is not found.
    fn find(&mut self) -> Axis {
        let first = self.first;
        let moved = self.may_have_moved();
        let found = self
            .search()
            .filter(|_| moved)
            .and_then(|mut search| search.find());
        found.map_or(first, |(rx, tx)| Axis { rx, tx, ..first })
    }

    /// Sets the identifiers back. Returns what is to be said all the same.
    fn bring_back(&mut self, at: Axis) -> Result<Option<String>, String> {
        let moved = self.places.is_some_and(Places::has_moved) || at != self.first;
        let Axis { rx, tx, .. } = self.first;
        let Some(mut search) = self.search().filter(|_| moved) else {
            return Ok(None);
        };
        let others = search.bring_back((at.rx, at.tx))?;
        let back = others.then(|| {
            format!(
                "its identifiers are set back to those of the rig's file, {rx:03X} and {tx:03X}"
            )
        });
        let still = search.settle();
        let still =
            still.map(|rx| format!("it still obeys {rx:03X}, which was given to it for a while"));
        let notes: Vec<_> = back.into_iter().chain(still).collect();
        Ok((!notes.is_empty()).then(|| notes.join("; ")))
    }

    /// Where a drive that does not answer was looked for, and where it may be.
    fn lost(&self, way_back: Option<&str>) -> String {
        let mut words = String::new();
        if let Some(places) = self.places.filter(|_| self.may_have_moved()) {
            let ids: Vec<_> = places.rx.iter().map(|id| format!("{id:03X}")).collect();
            words = format!("; it was looked for on {}", ids.join(", "));
        }
        let Medium::Frames(now) = self.line.medium(0) else {
            return words;
        };
        let timing = self.places.and_then(|places| places.timing).map(Nbt);
        if let Some(nbt) = timing.filter(|nbt| nbt.rate() != Some(now)) {
            let rate = nbt.rate().map_or_else(
                || "another bit rate".to_owned(),
                |rate| format!("{} kbit/s", rate.bits_per_second() / 1000),
            );
            let rx = self.first.rx;
            let [low, high] = Nbt::for_rate(now).unwrap_or(Nbt::DEFAULT).0.to_le_bytes();
            words += &format!(
                "; it may be at {rate}, since register 73 (CAN_BTR) was set to {:04X}: there, {rx:03X}#73{low:02X}{high:02X} sets it back",
                nbt.0
            );
            if let Some(way) = way_back {
                words += &format!(" (`bit_rate_way_back`: {way})");
            }
        }
        words
    }
}

/// Writes a register, again where a frame was lost.
fn insist(driver: &mut Driver<'_>, axis: Axis, register: u8, value: u16) -> Result<(), Error> {
    let mut written = driver.write(axis, register, Data::Short(value));
    for _ in 1..TRIES {
        if let Err(Error::Differs { .. }) = written {
            written = driver.write(axis, register, Data::Short(value));
        }
    }
    written.map(|_| ())
}

/// Takes one drive to its safe state. Returns what it reads, or why it is not confirmed.
fn make_safe(
    driver: &mut Driver<'_>,
    axis: Axis,
    cycles: &[u8],
    standing: &Standstill,
) -> Result<String, SafetyError> {
    let mut why = Ok(());
    let mut note = |done: Result<(), Error>| {
        if why.is_ok() {
            why = done;
        }
    };
    if standing.order.contains(&StandstillStep::Stop) && driver.permits_write(axis, COMMANDS[0], 0)
    {
        note(insist(driver, axis, COMMANDS[0], 0));
        // A torque command would end the ramp. A drive that does not stand in time is locked all the same.
        let _seen_again_below = stands(driver, axis, standing);
        note(insist(driver, axis, COMMANDS[1], 0));
    }
    if standing.order.contains(&StandstillStep::Block) {
        let locked = insist(driver, axis, MODE, MODE_LOCK);
        let zero = |driver: &mut _, command| insist(driver, axis, command, 0);
        note(locked.and_then(|()| COMMANDS.iter().try_for_each(|number| zero(driver, *number))));
    }
    for register in cycles {
        note(driver.stop_every(axis, *register));
    }
    why?;
    stands(driver, axis, standing)?;
    let read = |driver: &mut Driver<'_>, register| driver.read(axis, register);
    let [mode, speed, torque] = [0x51, 0x31, 0x90].map(|register| read(driver, register));
    let value = |reply: Reply| low(reply.data.bits());
    let (mode, speed, torque) = (value(mode?), value(speed?), value(torque?));
    let locks = standing.order.contains(&StandstillStep::Block);
    if locks && (mode & MODE_LOCK == 0 || speed != 0 || torque != 0) {
        return Err(SafetyError::Reads(format!(
            "MODE reads {mode:04X}, the speed command {speed:04X}, the torque command {torque:04X}"
        )));
    }
    let [ready, errors, state] = [0xE2, 0x8F, 0x40].map(|register| read(driver, register));
    let (ready, errors, state) = (value(ready?), errors?.data.bits(), state?.data.bits());
    if locks && state & status::ENABLED != 0 {
        let why = format!("STATUS reads {state:X}: the drive is enabled");
        return Err(SafetyError::Reads(why));
    }
    let errors: Vec<_> = set_bits(ERRORS, errors).map(|bit| bit.name).collect();
    let errors = match errors.is_empty() {
        true => "no errors".to_owned(),
        false => format!("errors {}", errors.join(", ")),
    };
    let ready = match ready {
        0 => "not ready",
        _ => "ready",
    };
    Ok(format!("{ready}, STATUS {state:X}, {errors}"))
}

/// The lower 16 bits of a value.
const fn low(bits: u32) -> u16 {
    (bits & 0xFFFF) as u16
}

/// Waits until a drive stands.
fn stands(driver: &mut Driver<'_>, axis: Axis, standing: &Standstill) -> Result<(), SafetyError> {
    let full = driver.read(axis, 0xCE)?;
    let full = f64::from(low(full.data.bits()));
    let end = driver.now() + standing.within;
    loop {
        // The speed may be read before a computer stands still for all that time.
        let over = driver.now() >= end;
        let reply = driver.read(axis, 0x30)?;
        // 32767 is 100 % (UNITEK 6.1).
        let raw = f64::from(low(reply.data.bits()).cast_signed());
        let rpm = raw * full / 32_767.0;
        if rpm.abs() <= standing.rpm {
            return Ok(());
        }
        if over {
            let scaling = Scaling::default();
            let speed = shown(
                Register::of(0x30),
                reply.data.bits(),
                Given::Percent,
                scaling,
            );
            let percent = speed.map_or_else(String::new, |speed| format!(" ({speed})"));
            return Err(SafetyError::Reads(format!(
                "waited {} for it to stand; its speed is {rpm:.0} rpm{percent}",
                standing.within
            )));
        }
        driver.run(AGAIN)?;
    }
}

#[cfg(test)]
mod tests;
