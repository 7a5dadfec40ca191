//! The driver against the simulated drives.

use super::*;
use crate::gate::guarded;
use crate::simulate::{Bench, DriveSetup, Setup};
use harness_bench::guard::Guarded;
use harness_bench::link::{DriveFault, Link, Moment, PlacedFault, Trouble};
use harness_proto::unitek::guard::Limits;

const PATIENCE: Span = Span::from_millis(20);

fn axis(node: u8) -> Axis {
    let drive = DriveSetup::new(node);
    Axis {
        node,
        rx: drive.identifiers.0,
        tx: drive.identifiers.1,
    }
}

fn released() -> Setup {
    let mut setup = Setup::of(2);
    for drive in &mut setup.drives {
        drive.inputs.run = true;
        drive.inputs.rfe = true;
    }
    setup
}

fn line(setup: &Setup, limits: Limits) -> Guarded<Bench> {
    let drives: Vec<_> = setup.drives.iter().map(|drive| drive.identifiers).collect();
    guarded(Bench::new(setup), limits, &drives, false)
}

fn driver(line: &mut Guarded<Bench>) -> Driver<'_> {
    Driver::new(Box::new(line), &[axis(1), axis(2)], PATIENCE)
}

/// Replies of 4 and of 6 bytes, of each drive; a write is read back.
#[test]
fn registers_are_read_and_written() {
    let mut line = line(&released(), Limits::unlimited());
    let mut driver = driver(&mut line);
    let version = driver.read(axis(1), 0x1B).expect("a reply");
    assert_eq!(version.data, Data::Short(0x01D8));
    let position = driver.read(axis(2), 0x6D).expect("a reply");
    assert_eq!(position.data, Data::Long(0x86B9));
    let reads = driver.write(axis(2), 0x31, Data::Short(0x0CCD));
    assert_eq!(
        reads.expect("written").map(|reply| reply.data),
        Some(Data::Short(0x0CCD))
    );
    assert_eq!(
        driver.read(axis(1), 0x31).expect("a reply").data,
        Data::Short(0)
    );
    // A read-only register takes no write; the gate lets it pass with all permissions.
    let sent = driver.write(axis(1), 0xCE, Data::Short(1)).expect("sent");
    assert_eq!(sent, None);
}

#[test]
fn a_drive_without_power_gives_no_reply() {
    let mut line = line(&released(), Limits::unlimited());
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let mut driver = driver(&mut line);
    let error = driver.read(axis(1), 0x1B).expect_err("silence");
    assert_eq!(
        error,
        Error::NoReply {
            node: 1,
            register: 0x1B,
            tries: 3
        }
    );
    assert!(driver.read(axis(2), 0x1B).is_ok());
}

#[test]
fn a_denied_write_ends_the_call_and_nothing_is_sent() {
    let mut line = line(&released(), Limits::default());
    let error = driver(&mut line)
        .write(axis(1), 0x31, Data::Short(1))
        .expect_err("denied");
    assert!(matches!(error, Error::Link(Trouble::Denied(_))), "{error}");
    assert_eq!(line.inner().carried(), 0);
}

/// Ex 11, without and with the hardware enable; stop and lock.
#[test]
fn release_stop_and_lock() {
    let mut open = released();
    open.drives[0].inputs.run = false;
    let mut blocked = line(&open, Limits::unlimited());
    let error = driver(&mut blocked)
        .release(axis(1))
        .expect_err("no enable");
    assert!(
        error.to_string().contains("close the hardware enable"),
        "{error}"
    );
    let mut line = line(&released(), Limits::unlimited());
    let mut driver = driver(&mut line);
    driver.release(axis(1)).expect("released");
    driver
        .write(axis(1), 0x31, Data::Short(0x4000))
        .expect("written");
    driver.run(Span::from_millis(100)).expect("time passes");
    assert_ne!(
        driver.read(axis(1), 0x30).expect("a reply").data,
        Data::Short(0)
    );
    assert_eq!(driver.stop(axis(1)), Ok(StopKind::OnRamp));
    assert_eq!(
        driver.read(axis(1), 0x51).expect("a reply").data,
        Data::Short(0)
    );
    driver.lock(axis(1)).expect("locked");
    assert_eq!(
        driver.read(axis(1), 0x51).expect("a reply").data,
        Data::Short(4)
    );
}

/// Without permission for a speed command a stop locks the drive.
#[test]
fn a_stop_without_permission_locks() {
    let mut line = line(&released(), Limits::default());
    let mut driver = driver(&mut line);
    assert_eq!(driver.stop(axis(1)), Ok(StopKind::Locked));
    assert_eq!(
        driver.read(axis(1), 0x51).expect("a reply").data,
        Data::Short(4)
    );
}

#[test]
fn cycles_come_as_events() {
    let mut line = line(&released(), Limits::unlimited());
    let mut driver = driver(&mut line);
    driver.every(axis(1), 0x30, 10).expect("started");
    driver.run(Span::from_millis(100)).expect("time passes");
    let came: Vec<_> = driver.events().collect();
    assert!((9..=11).contains(&came.len()), "{came:?}");
    assert!(
        came.iter()
            .all(|(_, of, event)| *of == axis(1) && matches!(event, MasterEvent::Cyclic { .. }))
    );
    driver.stop_every(axis(1), 0x30).expect("stopped");
    driver.run(Span::from_millis(30)).expect("time passes");
    let _one_under_way = driver.events().count();
    driver.run(Span::from_millis(100)).expect("time passes");
    assert_eq!(driver.events().count(), 0);
}

/// A computer or an adapter that stands still is outlasted; a drive that stays silent is waited for once, and the other one answers.
#[test]
fn a_silence_is_outlasted_once() {
    let mut line = line(&released(), Limits::unlimited());
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let back = line.now() + Span::from_millis(1_250);
    line.inject(0, PlacedFault::Drive(1, DriveFault::On), Moment::At(back));
    let mut driver = driver(&mut line).outlasting(Span::from_millis(1));
    driver.read(axis(1), 0x1B).expect("it is back");
    assert!(driver.now() >= back);
    drop(driver);
    line.inject(0, PlacedFault::Drive(1, DriveFault::Off), Moment::Now);
    let mut driver = self::driver(&mut line).outlasting(Span::from_millis(1));
    for least in [SILENCE, Span::ZERO] {
        let began = driver.now();
        driver.read(axis(1), 0x1B).expect_err("silence");
        let took = driver.now().since(began);
        assert!(
            took >= least && took < least + Span::from_millis(300),
            "{took}"
        );
    }
    driver.read(axis(2), 0x1B).expect("the other one answers");
}
