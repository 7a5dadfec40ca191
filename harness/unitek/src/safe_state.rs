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
use harness_proto::unitek::guard::{Gate, Places};
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
    let cycles: Vec<_> = gate.map_or_else(Vec::new, |own| own.cycles().collect());
    let places: Vec<_> = gate.map_or_else(Vec::new, |own| own.places().collect());
    let mut report = |axis: &Axis, tolerance| {
        let places = places.iter().find(|own| own.first == (axis.rx, axis.tx));
        let mut place = Place {
            line,
            first: *axis,
            patience,
            places,
        };
        let at = place.find();
        let driver = Driver::new(Box::new(&mut *place.line), &[at], patience);
        let mut driver = driver.outlasting(tolerance);
        let own = cycles.iter().filter(|(rx, _)| *rx == axis.rx);
        let own: Vec<_> = own.map(|(_, register)| *register).collect();
        let made = make_safe(&mut driver, at, &own, standing);
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
    for (axis, own) in axes.iter().zip(&mut reports) {
        if own.end == End::Silent {
            *own = report(axis, REAL);
        }
    }
    let safe = (reports.iter()).all(|own| matches!(own.end, End::Safe | End::Elsewhere));
    let back = reports.iter().all(|own| own.end != End::Elsewhere);
    let words = match (safe, back) {
        (true, true) => "safe state: every drive is locked and stands, with commands 0",
        (true, false) => {
            "every drive is locked and stands, with commands 0, but not every one is as it was found"
        }
        (false, _) => "the safe state is NOT confirmed; use the emergency stop",
    };
    Safe {
        confirmed: safe && back,
        words: (axes.iter().zip(&reports)).fold(words.to_owned(), |words, (axis, own)| {
            format!("{words}\n  drive {}: {}", axis.node, own.words)
        }),
    }
}

/// What became of a drive.
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
enum NotSafe {
    #[error(transparent)]
    Call(#[from] Error),
    #[error("{0}")]
    Reads(String),
}

impl NotSafe {
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
        let given = self.line.segment().map(Gate::given);
        given.is_some_and(|given| given.iter().any(|own| !own.is_empty()))
    }

    /// The drive where it answers; where the rig's file says if it was not moved, or is not found.
    fn find(&mut self) -> Axis {
        let first = self.first;
        let moved = self.may_have_moved();
        let found = self
            .search()
            .filter(|_| moved)
            .and_then(|mut own| own.find());
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
            let ids: Vec<_> = places.rx.iter().map(|own| format!("{own:03X}")).collect();
            words = format!("; it was looked for on {}", ids.join(", "));
        }
        let Medium::Frames(own) = self.line.medium(0) else {
            return words;
        };
        let timing = self.places.and_then(|places| places.timing).map(Nbt);
        if let Some(nbt) = timing.filter(|nbt| nbt.rate() != Some(own)) {
            let rate = nbt.rate().map_or_else(
                || "another bit rate".to_owned(),
                |rate| format!("{} kbit/s", rate.bits_per_second() / 1000),
            );
            let rx = self.first.rx;
            let [low, high] = Nbt::for_rate(own).unwrap_or(Nbt::DEFAULT).0.to_le_bytes();
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
) -> Result<String, NotSafe> {
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
        note(locked.and_then(|()| COMMANDS.iter().try_for_each(|own| zero(driver, *own))));
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
        return Err(NotSafe::Reads(format!(
            "MODE reads {mode:04X}, the speed command {speed:04X}, the torque command {torque:04X}"
        )));
    }
    let [ready, errors, state] = [0xE2, 0x8F, 0x40].map(|register| read(driver, register));
    let (ready, errors, state) = (value(ready?), errors?.data.bits(), state?.data.bits());
    if locks && state & status::ENABLED != 0 {
        let why = format!("STATUS reads {state:X}: the drive is enabled");
        return Err(NotSafe::Reads(why));
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
fn stands(driver: &mut Driver<'_>, axis: Axis, standing: &Standstill) -> Result<(), NotSafe> {
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
            return Err(NotSafe::Reads(format!(
                "waited {} for it to stand; its speed is {rpm:.0} rpm{percent}",
                standing.within
            )));
        }
        driver.run(AGAIN)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::guarded;
    use crate::simulate::{Bench, Setup};
    use harness_bench::link::stands_still::StandsStill;
    use harness_bench::link::{DriveFault, FrameFault, Link, Moment, PlacedFault};
    use harness_bench::medium::Out;
    use harness_proto::unitek::guard::Limits;
    use harness_proto::unitek::properties::{IdChange, RateChange};
    use harness_sim::unitek::deviation::deviations;

    const PATIENCE: Span = Span::from_millis(20);

    fn axes() -> Vec<Axis> {
        let axis = |node: u8| Axis {
            node,
            rx: 0x200 + u16::from(node),
            tx: 0x180 + u16::from(node),
        };
        [1, 2].map(axis).to_vec()
    }

    fn line(limits: Limits) -> Guarded<Bench> {
        let mut setup = Setup::of(2);
        for drive in &mut setup.drives {
            (drive.inputs.run, drive.inputs.rfe) = (true, true);
        }
        of(&setup, limits)
    }

    fn of(setup: &Setup, limits: Limits) -> Guarded<Bench> {
        let drives: Vec<_> = setup.drives.iter().map(|own| own.identifiers).collect();
        guarded(Bench::new(setup), limits, &drives, false)
    }

    fn send(line: &mut dyn Line, texts: &[&str]) {
        for text in texts {
            let frame: Frame = text.parse().expect("a frame");
            line.send(0, Out::Frames(&[frame]));
            assert_eq!(line.trouble(), None, "{text}");
            let end = line.now() + Span::from_millis(500);
            while line.now() < end {
                line.wait(end);
            }
            while line.receive(0).is_some() {}
        }
    }

    fn safe(line: &mut Guarded<Bench>) -> Safe {
        safe_state(line, &axes(), PATIENCE, &Standstill::default(), None)
    }

    fn registers(line: &Guarded<Bench>, node: u8) -> [u32; 4] {
        let drive = line.inner().drive(node).expect("a drive");
        [0x51, 0x31, 0x90, 0x30].map(|register| drive.register(register))
    }

    /// From a speed, from a torque and from a position: every drive ends locked and standing.
    #[test]
    fn drives_in_motion_are_stopped_and_locked() {
        for texts in [
            &["201#31FF7F", "202#3133F3"][..],
            &["201#90FF7F", "202#90AAAA"],
            &["201#6E00000040", "202#780100"],
        ] {
            let mut line = line(Limits::unlimited());
            send(&mut line, texts);
            let safe = safe(&mut line);
            assert!(safe.confirmed, "{safe}");
            for node in [1, 2] {
                assert_eq!(registers(&line, node)[..3], [4, 0, 0], "{texts:?}");
                let drive = line.inner().drive(node).expect("a drive");
                assert_eq!(drive.register(0x40) & status::ENABLED, 0);
            }
        }
    }

    /// A drive that is locked, and whose motor still coasts, is not safe yet.
    #[test]
    fn a_motor_that_does_not_stand_is_not_confirmed() {
        let mut line = line(Limits::unlimited());
        send(&mut line, &["201#31FF7F"]);
        let standing = Standstill {
            order: vec![StandstillStep::Block],
            within: Span::from_millis(50),
            ..Standstill::default()
        };
        let coasts = safe_state(&mut line, &axes(), PATIENCE, &standing, None);
        let why = "drive 1: NOT confirmed: waited 50.000 ms for it to stand";
        assert!(coasts.words.contains(why), "{coasts}");
        assert!(!coasts.confirmed);
        assert_eq!(registers(&line, 1)[..3], [4, 0, 0]);
        let stands = safe(&mut line);
        assert!(stands.confirmed, "{stands}");
    }

    /// A computer that stands still, for longer than drives need to stand, is not taken for a drive that does not.
    #[test]
    fn a_computer_that_stands_still_accuses_no_drive() {
        for (after, coasts) in (1..12).flat_map(|own| [(own, false), (own, true)]) {
            let mut line = line(Limits::unlimited());
            send(&mut line, &["201#31FF7F"]);
            let standing = Standstill {
                order: vec![StandstillStep::Block],
                within: Span::from_millis(if coasts { 50 } else { 5_000 }),
                ..Standstill::default()
            };
            let span = Span::from_millis(if coasts { 60 } else { 6_000 });
            let line = &mut line;
            let stands = StandsStill { line, after, span };
            let mut driver = Driver::new(Box::new(stands), &axes(), PATIENCE);
            let made = make_safe(&mut driver, axes()[0], &[], &standing);
            assert_eq!(made.is_err(), coasts, "frame {after}: {made:?}");
        }
    }

    /// Without permission for motion the drives, which another master may have released, are locked first.
    #[test]
    fn drives_that_may_not_be_commanded_are_locked() {
        let mut line = line(Limits::default());
        let safe = safe(&mut line);
        assert!(safe.confirmed, "{safe}");
        assert_eq!(registers(&line, 1)[..3], [4, 0, 0]);
    }

    #[test]
    fn a_silent_drive_is_not_confirmed_and_the_others_are_locked() {
        let mut line = line(Limits::unlimited());
        send(&mut line, &["202#31FF7F"]);
        line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
        let safe = safe(&mut line);
        assert!(!safe.confirmed);
        assert!(
            safe.words
                .contains("drive 1: NOT confirmed: drive 1 does not answer"),
            "{safe}"
        );
        assert!(safe.words.contains("drive 2: ready"), "{safe}");
        assert_eq!(registers(&line, 2)[..3], [4, 0, 0]);
    }

    /// An adapter that stood still for 1.5 s: the other drive is locked first, then the silent one is asked again.
    #[test]
    fn a_drive_that_answers_late_is_confirmed() {
        let mut line = line(Limits::unlimited());
        send(&mut line, &["202#31FF7F"]);
        line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
        let back = Moment::At(line.now() + Span::from_millis(1_500));
        line.inject(0, PlacedFault::Drive(1, DriveFault::On), back);
        let safe = safe(&mut line);
        assert!(safe.confirmed, "{safe}");
        let trace = line.inner().trace(0);
        let frames = trace.channels[0].frames().iter();
        let texts: Vec<_> = frames.map(|own| own.frame.to_string()).collect();
        let first = |text| texts.iter().position(|own| own == text);
        let last = texts.iter().rposition(|own| own == "201#510400");
        assert!(first("202#510400") < last, "{texts:?}");
    }

    /// Cycles that were started are stopped, and identifiers are set back.
    #[test]
    fn cycles_are_stopped_and_identifiers_set_back() {
        let mut line = line(Limits::unlimited());
        send(&mut line, &["201#3D300A", "201#681002", "210#3D201E"]);
        let safe = safe(&mut line);
        assert!(safe.confirmed, "{safe}");
        let drive = line.inner().drive(1).expect("a drive");
        assert_eq!((drive.register(0x68), drive.register(0x69)), (0x201, 0x181));
        let carried = line.inner().carried();
        let end = line.now() + Span::from_millis(200);
        while line.now() < end {
            line.wait(end);
        }
        assert_eq!(line.inner().carried(), carried);
    }

    fn identifiers(line: &Guarded<Bench>, node: u8) -> (u32, u32) {
        let drive = line.inner().drive(node).expect("a drive");
        (drive.register(0x68), drive.register(0x69))
    }

    /// Whichever frame is lost on the way, also one of a scenario's own way back: both drives end on the identifiers of the rig's file,
    /// locked (UNITEK 3.1).
    #[test]
    fn two_drives_are_set_back_whichever_frame_is_lost() {
        let moves = [
            "201#31FF7F",
            "201#687E02",
            "27E#690101",
            "202#687D02",
            "27D#3132F3",
            "27E#698101",
            "27E#680102",
        ];
        for lost in 1..60 {
            let mut line = line(Limits::unlimited());
            let fault = PlacedFault::Frame(FrameFault::Lost);
            line.inject(0, fault, Moment::Byte(lost));
            send(&mut line, &moves);
            let safe = safe(&mut line);
            assert!(safe.confirmed, "frame {lost}: {safe}");
            assert_eq!(identifiers(&line, 1), (0x201, 0x181), "frame {lost}");
            assert_eq!(identifiers(&line, 2), (0x202, 0x182), "frame {lost}");
            for node in [1, 2] {
                assert_eq!(registers(&line, node)[..3], [4, 0, 0], "frame {lost}");
            }
            let gate = line.segment().expect("a gate");
            assert!(!gate.places().any(|own| own.has_moved()), "frame {lost}");
        }
    }

    /// A cycle whose stop a drive has not heard is stopped, whether a scenario or the safe state has sent it (5.2).
    #[test]
    fn a_cycle_is_stopped_although_its_stop_was_lost() {
        let mut met = 0;
        for texts in [&["201#3D1B64", "201#3D1BFF"][..], &["201#3D1B64"]] {
            for lost in 6..40 {
                let mut line = line(Limits::unlimited());
                let fault = PlacedFault::Frame(FrameFault::Lost);
                line.inject(0, fault, Moment::Byte(lost));
                send(&mut line, texts);
                let safe = safe(&mut line);
                let ended = safe.confirmed && !safe.words.contains("still sent");
                assert!(ended, "{texts:?}, frame {lost}: {safe}");
                let drive = line.inner().drive(1).expect("a drive");
                let running = drive.running_cycles().count();
                assert_eq!(running, 0, "{texts:?}, frame {lost}");
                let trace = line.inner().trace(0);
                let frames = trace.channels[0].frames().iter();
                let stops = frames.filter(|own| own.frame.to_string() == "201#3D1BFF");
                met += usize::from(stops.count() == 2);
            }
        }
        assert!(met >= 2, "no stop was lost");
    }

    /// A new identifier that is used from the next power-up on (`id-change`) is set back in the register.
    #[test]
    fn an_identifier_that_is_not_used_yet_is_set_back() {
        let mut setup = Setup::of(2);
        setup.drives[0].properties.id_change = IdChange::Restart;
        let mut line = of(&setup, Limits::unlimited());
        send(&mut line, &["201#681002", "201#699001"]);
        assert_eq!(identifiers(&line, 1), (0x210, 0x190));
        let safe = safe(&mut line);
        assert!(safe.confirmed, "{safe}");
        assert_eq!(identifiers(&line, 1), (0x201, 0x181));
    }

    /// A drive that takes what is meant for another one is found where that one was sent. The two cannot be told apart there: nothing is
    /// written that both would obey, and the report has the frame that sets each of them back.
    #[test]
    fn two_drives_on_one_identifier_are_named() {
        let mut setup = Setup::of(2);
        let wrong = deviations().find(|own| own.name == "hears-its-neighbour");
        setup.drives[0].deviation = wrong;
        let mut line = of(&setup, Limits::unlimited());
        send(&mut line, &["202#687E02"]);
        let safe = safe(&mut line);
        assert!(!safe.confirmed, "{safe}");
        for words in [
            "but not every one is as it was found",
            "drive 1: ready, STATUS 0, no errors; NOT as it was found: it receives on 27E and sends on 181",
            "with no other drive that receives on 27E on the bus, 27E#680102 sets it back",
            "27E#680202 sets it back",
        ] {
            assert!(safe.words.contains(words), "{words}: {safe}");
        }
        for node in [1, 2] {
            assert_eq!(registers(&line, node)[..3], [4, 0, 0]);
        }
    }

    /// A drive that uses a new bit rate at once is lost; the report says at which rate it may be, and what brings it back (3.1).
    #[test]
    fn a_drive_at_another_bit_rate_is_named() {
        let mut setup = Setup::of(2);
        setup.drives[0].properties.rate_change = RateChange::Immediate;
        let mut line = of(&setup, Limits::unlimited());
        send(&mut line, &["201#735C40"]);
        let way = Some("a second adapter");
        let safe = safe_state(&mut line, &axes(), PATIENCE, &Standstill::default(), way);
        assert!(!safe.confirmed, "{safe}");
        for words in [
            "drive 1: NOT confirmed: drive 1 does not answer",
            "it may be at 250 kbit/s, since register 73 (CAN_BTR) was set to 405C: there, 201#732540 sets it back (`bit_rate_way_back`: a \
             second adapter)",
            "drive 2: ready",
        ] {
            assert!(safe.words.contains(words), "{words}: {safe}");
        }
    }

    #[test]
    fn last_words_lock_every_drive() {
        let words: Vec<_> = last_words(&axes()).iter().map(Frame::to_string).collect();
        let one = ["201#510400", "201#310000", "201#900000"];
        assert_eq!(words[..3], one);
        assert_eq!(words.len(), 6);
    }
}
