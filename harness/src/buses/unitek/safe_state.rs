//! The safe state of UNITEK drives: no speed, no torque, locked, cycles stopped, and read back.

use super::driver::{Driver, Error};
use super::rig::Axis;
use crate::guard::{Guarded, Safe, Standstill, StandstillStep};
use crate::link::Line;
use crate::medium::Out;
use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::{Data, Reply, Request};
use harness_proto::unitek::units::{Given, Scaling, shown};
use harness_proto::unitek::words::{ERRORS, MODE_LOCK, set_bits, status};
use std::fmt::Write as _;

/// The registers of a speed and of a torque command.
const COMMANDS: [u8; 2] = [0x31, 0x90];

/// MODE (ex 2).
const MODE: u8 = 0x51;

/// How often the speed of a drive is looked at that does not stand yet.
const AGAIN: Span = Span::from_millis(20);

/// The frames that lock a drive and set its commands to 0, without waiting for anything: for a watchdog.
#[must_use]
pub fn last_words(axes: &[Axis]) -> Vec<Frame> {
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
/// not locked; locked; commands 0; every cycle that was started stopped. Ready, status and errors are read for the report. Changed
/// identifiers are set back.
///
/// A drive is confirmed if it reads locked, not enabled, with commands 0, and stands.
pub fn safe_state<L: Line>(
    line: &mut Guarded<L>,
    axes: &[Axis],
    patience: Span,
    standing: &Standstill,
) -> Safe {
    let (cycles, moved) = line.segment().map_or_else(Default::default, |gate| {
        let cycles: Vec<_> = gate.cycles().collect();
        let moved: Vec<_> = gate.moved().collect();
        (cycles, moved)
    });
    let latest = |axis: &Axis| {
        let moved = moved.iter().find(|(first, _)| *first == (axis.rx, axis.tx));
        moved.map_or(*axis, |(_, (rx, tx))| Axis {
            rx: *rx,
            tx: *tx,
            ..*axis
        })
    };
    let now: Vec<_> = axes.iter().map(latest).collect();
    let mut reports = String::new();
    let mut confirmed = true;
    let known: Vec<_> = now.iter().chain(axes).copied().collect();
    let mut driver = Driver::new(Box::new(&mut *line), &known, patience);
    for (axis, first) in now.iter().zip(axes) {
        // A drive may change its identifiers at the next power-up only, or not take them (3.1, ex 1).
        let moved = axis != first && driver.read(*axis, MODE).is_ok();
        let axis = if moved { axis } else { first };
        let made = make_safe(&mut driver, *axis, &cycles, standing);
        // Writing to a String cannot fail.
        let _infallible = match made {
            Ok(report) => write!(reports, "\n  drive {}: {report}", axis.node),
            Err(why) => {
                confirmed = false;
                write!(reports, "\n  drive {}: NOT confirmed: {why}", axis.node)
            }
        };
    }
    drop(driver);
    for (first, (rx, tx)) in &moved {
        restore(line, (*rx, *tx), *first);
    }
    let words = match confirmed {
        true => format!("safe state: every drive is locked and stands, with commands 0{reports}"),
        false => format!("the safe state is NOT confirmed; use the emergency stop{reports}"),
    };
    Safe { confirmed, words }
}

/// Sets the identifiers of a drive back to those of the rig's file.
fn restore<L: Line>(line: &mut Guarded<L>, latest: (u16, u16), first: (u16, u16)) {
    let write = |register, value| Request::Write {
        register,
        data: Data::Short(value),
    };
    let frames = [
        write(0x69, first.1).encode(latest.0),
        write(0x68, first.0).encode(latest.0),
    ];
    for frame in frames.into_iter().flatten() {
        let end = line.send(0, Out::Frames(&[frame]));
        while line.now() < end && line.wait(end) {}
    }
}

/// Takes one drive to its safe state. Returns what it reads, or why it is not confirmed.
fn make_safe(
    driver: &mut Driver<'_>,
    axis: Axis,
    cycles: &[(u16, u8)],
    standing: &Standstill,
) -> Result<String, String> {
    let mut why = Ok(());
    let mut note = |done: Result<(), Error>| {
        if let (Ok(()), Err(error)) = (&why, done) {
            why = Err(error.to_string());
        }
    };
    if standing.order.contains(&StandstillStep::Stop) && driver.permits_write(axis, COMMANDS[0], 0)
    {
        note(driver.write(axis, COMMANDS[0], Data::Short(0)).map(|_| ()));
        // A torque command would end the ramp. A drive that does not stand in time is locked all the same.
        let _seen_again_below = stands(driver, axis, standing);
        note(driver.write(axis, COMMANDS[1], Data::Short(0)).map(|_| ()));
    }
    if standing.order.contains(&StandstillStep::Block) {
        note(driver.lock(axis));
    }
    for (_, register) in cycles.iter().filter(|(rx, _)| *rx == axis.rx) {
        note(driver.stop_every(axis, *register));
    }
    why?;
    stands(driver, axis, standing)?;
    let read = |driver: &mut Driver<'_>, register| {
        let reply = driver.read(axis, register);
        reply.map_err(|error| error.to_string())
    };
    let [mode, speed, torque] = [0x51, 0x31, 0x90].map(|register| read(driver, register));
    let value = |reply: Reply| low(reply.data.bits());
    let (mode, speed, torque) = (value(mode?), value(speed?), value(torque?));
    let locks = standing.order.contains(&StandstillStep::Block);
    if locks && (mode & MODE_LOCK == 0 || speed != 0 || torque != 0) {
        return Err(format!(
            "MODE reads {mode:04X}, the speed command {speed:04X}, the torque command {torque:04X}"
        ));
    }
    let [ready, errors, state] = [0xE2, 0x8F, 0x40].map(|register| read(driver, register));
    let (ready, errors, state) = (value(ready?), errors?.data.bits(), state?.data.bits());
    if locks && state & status::ENABLED != 0 {
        return Err(format!("STATUS reads {state:X}: the drive is enabled"));
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
fn stands(driver: &mut Driver<'_>, axis: Axis, standing: &Standstill) -> Result<(), String> {
    let text = |error: Error| error.to_string();
    let full = driver.read(axis, 0xCE).map_err(text)?;
    let full = f64::from(low(full.data.bits()));
    let end = driver.now() + standing.within;
    loop {
        let reply = driver.read(axis, 0x30).map_err(text)?;
        // 32767 is 100 % (UNITEK 6.1).
        let raw = f64::from(low(reply.data.bits()).cast_signed());
        let rpm = raw * full / 32_767.0;
        if rpm.abs() <= standing.rpm {
            return Ok(());
        }
        if driver.now() >= end {
            let scaling = Scaling::default();
            let speed = shown(
                Register::of(0x30),
                reply.data.bits(),
                Given::Percent,
                scaling,
            );
            let percent = speed.map_or_else(String::new, |speed| format!(" ({speed})"));
            return Err(format!(
                "waited {} for it to stand; its speed is {rpm:.0} rpm{percent}",
                standing.within
            ));
        }
        driver.run(AGAIN).map_err(text)?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::unitek::gate::guarded;
    use crate::buses::unitek::simulate::{Bench, Setup};
    use crate::link::{DriveFault, Link, Moment, PlacedFault};
    use harness_proto::unitek::guard::Limits;

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
        let drives: Vec<_> = setup.drives.iter().map(|own| own.identifiers).collect();
        guarded(Bench::new(&setup), limits, &drives, false)
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
        safe_state(line, &axes(), PATIENCE, &Standstill::default())
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
        let coasts = safe_state(&mut line, &axes(), PATIENCE, &standing);
        let why = "drive 1: NOT confirmed: waited 50.000 ms for it to stand";
        assert!(coasts.words.contains(why), "{coasts}");
        assert!(!coasts.confirmed);
        assert_eq!(registers(&line, 1)[..3], [4, 0, 0]);
        let stands = safe(&mut line);
        assert!(stands.confirmed, "{stands}");
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

    #[test]
    fn last_words_lock_every_drive() {
        let words: Vec<_> = last_words(&axes()).iter().map(Frame::to_string).collect();
        let one = ["201#510400", "201#310000", "201#900000"];
        assert_eq!(words[..3], one);
        assert_eq!(words.len(), 6);
    }
}
