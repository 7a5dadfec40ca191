//! Each deviation shows in a fixed conversation; a wrapper without a deviation changes nothing.

use super::common::Member;
use harness_proto::can::{BitRate, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Data;
use harness_proto::unitek::master::{Job, MasterEvent, Options, Outcome};
use harness_proto::unitek::properties::Properties;
use harness_sim::segment::{Host, Segment, Station};
use harness_sim::unitek::deviation::{
    DEVIATIONS, Deviant, DeviantCanMaster, Deviation, MASTER_DEVIATIONS, MasterDeviation,
};
use harness_sim::unitek::{Drive, Inputs};
use std::collections::BTreeSet;

/// A line is a frame of the host with 2 ms behind it, a wait in ms, or an input that is switched over.
const CONVERSATION: &str = "
    201#3D4000 201#3D1B00 201#3DE200 201#3DE800 201#3DF400 201#3D6D00 201#3D8100 201#3D7800
    201#R3 00000201#3D4000 202#3D1B00 201#1C0B 201#3D1C00
    201#D411223344 201#3DD400 201#D4556677889900AA 201#3DD400 201#D4FFFF 201#3DD400
    201#DC3001 201#3D2800 201#3D1B00 201#DC3000
    201#C8E803 201#3DCE00 201#C8100E
    201#681002 201#3D1B00 210#3D1B00 210#680102 201#3D1B00
    201#7A78563412 201#3D6D00 201#3D4000
    201#35640001 201#EDE803 201#3133F3 50 201#3D3000 201#310000 50 201#3D3000 201#3DF400
    201#3D300A 100 201#31CD0C 50 201#510400 50 201#3D4000 201#510000 50 201#3D4000 201#3D30FF 300
    201#310000 201#900040 20 201#3D2000 201#900000
    201#3D1B96 201#3DE296 201#3DE396 201#3DE496 201#3DE596 201#3DE696 400 201#3DE3FF 400
    201#3D1BFF 201#3DE2FF 201#3DE4FF 201#3DE5FF 201#3DE6FF 300
    201#520C00 201#511000 limit1 10 limit1 10 limit2 10 limit2 10
    201#520030 201#780200 10 201#3D4000 201#780100 600 201#3D4000
    201#6E00000200 10 201#3DF400 100 201#3D6D00 201#510000
    201#310000 201#1C3700 201#840000 201#1C0A00 201#830100 201#3D1C00 201#830000 201#3D1C00
    dc-bus 10 201#3DE200 201#3D4000 dc-bus 10
    201#D06400 300 201#3D8F00 201#3DE200 201#8E0000 201#3D8F00 201#D00000
";

/// Frames of the drive with their milliseconds.
fn conversation<S: Station>(drive: S, set: fn(&mut S, Instant, &str)) -> Vec<(u64, Frame)> {
    let mut segment = Segment::new(
        BitRate::K500,
        vec![Member::Host(Host::default()), Member::Drive(drive)],
    );
    let mut now = Instant::START;
    for word in CONVERSATION.split_whitespace() {
        let mut wait = 0;
        if word.contains('#') {
            let Member::Host(host) = segment.station_mut(0) else {
                panic!("the host")
            };
            host.send(now, word.parse().expect("a frame"));
            wait = 2;
        } else if let Ok(millis) = word.parse() {
            wait = millis;
        } else if let Member::Drive(drive) = segment.station_mut(1) {
            set(drive, now, word);
        }
        now += Span::from_millis(wait);
        segment.run_until(now);
    }
    let of_drive = segment.record().iter().filter(|line| line.from == Some(1));
    of_drive
        .map(|line| (line.start.since_start().as_nanos() / 1_000_000, line.frame))
        .collect()
}

fn switch(drive: &mut Drive, at: Instant, name: &str) {
    let mut inputs = *drive.inputs();
    let input = inputs.switch(name).expect("an input");
    *input = !*input;
    drive.set_inputs(at, inputs);
}

fn drive() -> Drive {
    Drive::new(Properties::default(), Inputs::default(), Instant::START)
}

fn with(deviation: Option<&'static Deviation>) -> Vec<(u64, Frame)> {
    conversation(Deviant::new(drive(), deviation), |deviant, at, name| {
        switch(deviant.drive_mut(), at, name)
    })
}

/// Names are unique, and there are at least 40 deviations of the drive and 15 of the master.
#[test]
fn the_tables() {
    let names = BTreeSet::from_iter(DEVIATIONS.names());
    assert_eq!(names.len(), DEVIATIONS.all().count());
    assert!(names.len() >= 40, "{}", names.len());
    let masters = BTreeSet::from_iter(MASTER_DEVIATIONS.names());
    assert!(masters.len() == MASTER_DEVIATIONS.all().count() && masters.len() >= 15);
    for (name, about) in DEVIATIONS
        .all()
        .map(|d| (d.name, d.about))
        .chain(MASTER_DEVIATIONS.all().map(|d| (d.name, d.about)))
    {
        assert!(
            name.bytes()
                .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-'),
            "{name}"
        );
        assert!(about.ends_with('.') && about.len() < 120, "{name}: {about}");
    }
    assert!(DEVIATIONS.named("no-lock").is_some() && DEVIATIONS.named("none").is_none());
}

#[test]
fn each_deviation_of_the_drive_shows() {
    let right = conversation(drive(), switch);
    assert!(right.len() > 80, "{}", right.len());
    assert_eq!(with(None), right, "a wrapper without a deviation");
    let hidden: Vec<_> = DEVIATIONS
        .all()
        .filter(|d| with(Some(d)) == right)
        .map(|d| d.name)
        .collect();
    assert_eq!(hidden, [""; 0], "these do not show");
}

/// What a master leaves behind: the drive's frames, the outcomes of its jobs, the drive's registers, and those after a restart.
type Left = (Vec<(u64, Frame)>, Vec<Outcome>, Vec<u32>, Vec<u32>);

fn jobs(deviation: Option<&'static MasterDeviation>) -> Left {
    let long = |register, value| Job::Write {
        register,
        data: Data::Long(value),
    };
    let short = |register, value: i16| Job::Write {
        register,
        data: Data::Short(value.cast_unsigned()),
    };
    let jobs = [
        Job::Read { register: 0x40 },
        Job::Read { register: 0x6D },
        long(0x52, 0x0C),
        long(0x35, 0x0001_01F4),
        long(0xED, 0x0001_0064),
        short(0x1C, 300),
        short(0x31, -3277),
        Job::Read { register: 0x31 },
        Job::Cycle {
            register: 0x30,
            every: 20,
        },
        Job::Stop { register: 0x30 },
        Job::StartUp {
            patience: Span::from_millis(50),
        },
        Job::Read { register: 0xE2 },
        long(0x6E, 3_000_000),
    ];
    let mut master = DeviantCanMaster::new(0x201, 0x181, Options::default(), deviation);
    let mut segment = Segment::new(
        BitRate::K500,
        vec![Member::Host(Host::default()), Member::Drive(drive())],
    );
    let mut outcomes = Vec::new();
    for job in jobs {
        master.submit(job).expect("room");
    }
    let mut now = Instant::START;
    for _ in 0..20_000 {
        while let Some(frame) = master.poll_transmit(now) {
            let Member::Host(host) = segment.station_mut(0) else {
                panic!("the host")
            };
            host.send(now, frame);
        }
        now += Span::from_micros(100);
        segment.run_until(now);
        let Member::Host(host) = segment.station_mut(0) else {
            panic!("the host")
        };
        while let Some((at, heard)) = host.receive() {
            if let harness_proto::can::CanEvent::Frame(frame) = heard {
                master.handle_frame(at, &frame);
            }
        }
        if master.poll_timeout().is_some_and(|at| at <= now) {
            master.handle_timeout(now);
        }
        let events = std::iter::from_fn(|| master.poll_event());
        outcomes.extend(events.filter_map(|event| match event {
            MasterEvent::Ended { outcome, .. } => Some(outcome),
            _ => None,
        }));
    }
    let of_drive = segment.record().iter().filter(|line| line.from == Some(1));
    let frames = of_drive
        .map(|line| (line.start.since_start().as_nanos() / 1_000_000, line.frame))
        .collect();
    let Member::Drive(drive) = segment.station_mut(1) else {
        panic!("the drive")
    };
    let registers = (0..=255).map(|number| drive.register(number)).collect();
    drive.restart(now);
    let stored = (0..=255).map(|number| drive.register(number)).collect();
    (frames, outcomes, registers, stored)
}

#[test]
fn each_deviation_of_the_master_shows() {
    let right = jobs(None);
    assert_eq!(right.1.len(), 13, "{:?}", right.1);
    assert!(
        right.1.iter().all(|o| !matches!(
            o,
            Outcome::NoReply { .. } | Outcome::Differs { .. } | Outcome::NotReady(_)
        )),
        "{:?}",
        right.1
    );
    let hidden: Vec<_> = MASTER_DEVIATIONS
        .all()
        .filter(|d| jobs(Some(d)) == right)
        .map(|d| d.name)
        .collect();
    assert_eq!(hidden, [""; 0], "these do not show");
}
