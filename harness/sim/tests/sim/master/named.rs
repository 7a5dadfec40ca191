//! Each fault by its name, and what becomes of the jobs (ND21 9.7-9.9, 11.5).

use super::common::{Couple, size};
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::{Command, Kind};
use harness_proto::novobus::master::{
    BusStop, CyclePace, Event, Fault, Job, LinkEnd, Master, MasterOptions, Outcome, Packing, Phase,
    Refused, RingLink,
};
use harness_proto::novobus::properties::{Properties, ReadLongAnswer};
use harness_proto::time::Span;
use harness_sim::fault::{DriveFault, Flips, LinkFault};
use harness_sim::novobus::counted::Counted;
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use harness_sim::novobus::ring::Ring;

const READ: Command = Command::ReadByte { address: 0xFE13 };
const WRITE: Command = Command::WriteWord {
    address: 0xFE20,
    data: 0x1234,
};
const PARITY: LinkFault = LinkFault::Flip(Flips {
    data: 1,
    parity: false,
    stop: false,
    start: false,
});

fn link(from: u8, to: u8) -> RingLink {
    RingLink {
        from: LinkEnd::Drive(from),
        to: LinkEnd::Drive(to),
    }
}

fn faults<D: Device>(couple: &Couple<D>) -> Vec<Fault> {
    let fault = |event: &Event| match event {
        Event::Disturbed { fault, .. } => Some(*fault),
        _ => None,
    };
    couple.events.iter().filter_map(|(_, e)| fault(e)).collect()
}

fn stop<D: Device>(couple: &Couple<D>) -> Option<BusStop> {
    couple.events.iter().find_map(|(_, event)| match event {
        Event::Stopped(stop) => Some(*stop),
        _ => None,
    })
}

/// Few attempts, so that the end comes soon.
fn few() -> MasterOptions {
    MasterOptions {
        attempts: 3,
        ..MasterOptions::default()
    }
}

fn counted(drives: u8, monitoring: bool) -> Couple<Counted> {
    Couple::new(drives, few(), |_| Counted::new(monitoring)).ready()
}

/// ND21 9.9: a cable between drive 3 and drive 2 is disconnected. With monitoring the ring spells out 2;
/// so it does when drive 3 is dead.
#[test]
fn a_broken_ring_names_its_place_with_monitoring() {
    for dead in [false, true] {
        let mut couple = counted(5, true);
        let id = couple.submit(Job::new(1, WRITE));
        if dead {
            couple.ring.suffer_drive(3, DriveFault::Off);
        } else {
            couple.ring.suffer_link(2, LinkFault::Cut);
        }
        couple.steps(3_000);
        let broken = Fault::Broken(link(3, 2));
        assert_eq!(stop(&couple).map(|stop| stop.fault), Some(broken));
        // All of the command was sent, so it may have arrived.
        assert_eq!(couple.outcome(id), Some(&Outcome::Unknown(broken)));
        assert_eq!(couple.master.phase(), Phase::Stopped);
        let refused = couple.master.submit(Job::new(1, READ));
        assert!(matches!(refused, Err(Refused::Stopped(_))));
        assert_eq!(
            broken.to_string(),
            "the link from drive 3 to drive 2 is broken, or drive 3 is not ready for operation (ND21 9.9)"
        );
    }
}

/// Without monitoring no drive reports where the ring is broken.
#[test]
fn a_broken_ring_is_silent_without_monitoring() {
    let mut couple = counted(5, false);
    couple.ring.suffer_link(2, LinkFault::Cut);
    let read = couple.submit(Job::new(1, READ));
    couple.steps(3_000);
    let stop = stop(&couple).expect("the end");
    assert_eq!(stop.fault, Fault::Silent);
    assert_eq!(stop.attempts, 3);
    assert_eq!(couple.outcome(read), Some(&Outcome::Failed(stop)));
    assert_eq!(
        couple
            .ring
            .drive(1)
            .expect("a drive")
            .memory
            .written(0xFE20),
        0
    );
}

/// A ring that is joined again goes on, and lost jobs are repeated.
#[test]
fn a_ring_that_is_joined_again_goes_on() {
    for monitoring in [false, true] {
        let options = MasterOptions::default();
        let mut couple = Couple::new(4, options, |_| Counted::new(monitoring)).ready();
        couple.ring.suffer_link(2, LinkFault::Cut);
        let id = couple.submit(Job::new(0, WRITE));
        couple.steps(400);
        couple.ring.suffer_link(2, LinkFault::Join);
        couple.finish(3_000);
        let done = Outcome::Done {
            perhaps_twice: true,
        };
        assert_eq!(couple.outcome(id), Some(&done));
        assert_eq!(
            couple
                .ring
                .drive(0)
                .expect("a drive")
                .memory
                .written(0xFE20),
            1
        );
        assert!(couple.healthy());
    }
}

/// ND21 9.3: the address byte comes back increased by the number of drives. No job goes to a ring of
/// another size: there each address means another drive.
#[test]
fn another_number_of_drives_is_counted_before_any_job() {
    for (thought, there) in [(5u8, 4u8), (4, 5), (1, 2), (250, 249), (100, 150)] {
        let ring = Ring::new(size(there), Rate::Baud38400, |_| Counted::new(false));
        let mut couple = Couple::with(Master::new(size(thought), Rate::Baud38400, few()), ring);
        let ids: Vec<_> = (0..thought)
            .map(|k| couple.submit(Job::new(k, WRITE)))
            .collect();
        couple.steps(20_000);
        let fault = Fault::WrongRingSize {
            counted: there,
            ring: size(thought),
        };
        assert_eq!(stop(&couple).map(|stop| stop.fault), Some(fault));
        for id in ids {
            assert!(matches!(couple.outcome(id), Some(Outcome::Failed(_))));
        }
        for k in 0..there {
            assert_eq!(
                couple
                    .ring
                    .drive(k)
                    .expect("a drive")
                    .memory
                    .written(0xFE20),
                0
            );
        }
    }
}

/// A drive that is bridged in the middle of work: the first address byte that comes back wrong stops it.
#[test]
fn another_number_of_drives_is_noticed_at_work() {
    let mut couple = counted(5, false);
    let mut ring = Ring::new(size(4), Rate::Baud38400, |_| Counted::new(false));
    ring.run_until(couple.ring.now());
    couple.ring = ring;
    let id = couple.submit(Job::new(3, READ));
    couple.steps(2_000);
    let fault = Fault::WrongRingSize {
        counted: 4,
        ring: size(5),
    };
    let stop = stop(&couple).expect("the end");
    assert_eq!(stop.fault, fault);
    assert_eq!(couple.outcome(id), Some(&Outcome::Failed(stop)));
}

#[test]
fn late_lost_and_doubled_bytes_have_names() {
    // After the start 3 + N + 3 bytes have been sent; the telegram is what comes next.
    let cases = [
        (LinkFault::Delay(Span::from_millis(30)), Fault::Late),
        (LinkFault::Drop, Fault::Lost { bytes: 1 }),
        (LinkFault::Duplicate, Fault::Extra { bytes: 1 }),
        (LinkFault::Insert(0x80), Fault::Extra { bytes: 1 }),
    ];
    for (fault, name) in cases {
        // On the last link, where no drive can be disturbed by it.
        let mut couple = counted(3, false);
        let next = couple.master.counters().sent + 1;
        couple.ring.arm_link(3, next + 1, fault);
        let ids: Vec<_> = [0, 1, 2, 0, 1, 2]
            .map(|k| couple.submit(Job::new(k, READ)))
            .to_vec();
        couple.finish(1_500);
        assert_eq!(faults(&couple).first(), Some(&name), "{fault}");
        for id in ids {
            assert!(matches!(couple.outcome(id), Some(Outcome::Read(_))));
        }
        couple.steps(300);
        assert_eq!(couple.master.phase(), Phase::Running, "{fault}");
    }
}

/// A whole telegram is lost: what comes back is the answer for another job, and no job takes it for its own.
#[test]
fn the_answer_for_another_job_is_not_taken() {
    let mut couple = counted(3, false);
    for k in 0..3 {
        let drive = couple.ring.drive_mut(k).expect("a drive");
        drive.memory.poke(0xFE13, 0x10 + k);
    }
    let next = couple.master.counters().sent + 1;
    // The first telegram has 6 bytes: sync, address and four of ReadByte.
    for byte in next..next + 6 {
        couple.ring.arm_link(3, byte, LinkFault::Drop);
    }
    let ids = [0, 2, 1].map(|k| (k, couple.submit(Job::new(k, READ))));
    couple.finish(1_500);
    assert_eq!(faults(&couple), [Fault::Lost { bytes: 6 }]);
    for (k, id) in ids {
        let Some(Outcome::Read(data)) = couple.outcome(id) else {
            panic!("{:?}", couple.events);
        };
        assert_eq!(data.value(), Some(0x10 + u32::from(k)));
    }
}

/// A drive that answers with a wrong checking byte, in step and without an error: every time.
#[test]
fn a_drive_that_answers_out_of_the_protocol_is_named() {
    let mut couple = counted(3, false);
    let next = couple.master.counters().sent + 1;
    // Telegram for drive 1: 8C, address, 63 34 12 20 FE +: the last byte is the checking byte.
    couple.ring.arm_link(3, next + 7, LinkFault::Replace(0x42));
    let id = couple.submit(Job::new(1, WRITE));
    couple.finish(1_500);
    assert_eq!(
        faults(&couple),
        [Fault::Protocol {
            drive: 1,
            expected: Some(0x39),
            received: 0x42
        }]
    );
    // It had run: its answer was lost.
    let done = Outcome::Done {
        perhaps_twice: true,
    };
    assert_eq!(couple.outcome(id), Some(&done));
    assert_eq!(
        couple
            .ring
            .drive(1)
            .expect("a drive")
            .memory
            .written(0xFE20),
        2
    );
}

/// A drive with narrower ranges than the manual's goes into the error mode at a command each time. The
/// bus is stopped, as the manual has it (11.5), and the reason names drive and command.
#[test]
fn a_command_that_a_drive_does_not_accept_is_named() {
    // A drive as of another make: its ReadLong answers as printed, with a check that is no data byte.
    let mut couple = counted(3, false);
    couple
        .ring
        .drive_mut(1)
        .expect("a drive")
        .memory
        .refuse(0xFE40);
    let others = couple.submit(Job::new(2, WRITE));
    let refused = couple.submit(Job::new(1, Command::ReadByte { address: 0xFE40 }));
    couple.steps(2_000);
    let fault = Fault::Rejected {
        drive: 1,
        kind: Kind::ReadByte,
    };
    let stop = stop(&couple).expect("the end");
    assert_eq!(stop.fault, fault);
    assert_eq!(couple.outcome(refused), Some(&Outcome::Failed(stop)));
    assert!(matches!(couple.outcome(others), Some(Outcome::Done { .. })));
}

/// Only the master hears the damaged last link; no drive spells out an address.
#[test]
fn damage_on_the_last_link_is_named_by_the_master() {
    let mut couple = counted(3, false);
    couple
        .ring
        .arm_link(3, couple.master.counters().sent + 3, PARITY);
    let id = couple.submit(Job::new(1, READ));
    couple.finish(500);
    let last = RingLink {
        from: LinkEnd::Drive(0),
        to: LinkEnd::Master,
    };
    assert_eq!(faults(&couple), [Fault::Damaged(last)]);
    assert!(matches!(couple.outcome(id), Some(Outcome::Read(_))));
}

/// A master that comes late, or has sent nothing for a while, has missed nothing: the first byte that it sends is damaged, not its link
/// broken.
#[test]
fn damage_behind_a_pause_is_damage() {
    for drives in [5, 100] {
        for pause in [0, 40, 4_000] {
            let mut ring = Ring::new(size(drives), Rate::Baud38400, |_| Counted::new(false));
            ring.run_until(ring.now() + ring.byte_time() * pause);
            ring.arm_link(2, 1, PARITY);
            let master = Master::new(size(drives), Rate::Baud38400, few());
            let mut couple = Couple::with(master, ring);
            couple.steps(900);
            let damaged = Fault::Damaged(link(drives - 2, drives - 3));
            assert_eq!(faults(&couple), [damaged], "{drives} drives, {pause}");

            // All bytes come back, and then the master is not polled for a while.
            couple.come_home();
            let rest = couple.ring.now() + couple.ring.byte_time() * pause;
            couple.ring.run_until(rest);
            let sent = couple.master.counters().sent;
            couple.ring.arm_link(2, sent + 1, PARITY);
            couple.steps(900);
            assert_eq!(faults(&couple), [damaged; 2], "{drives} drives, {pause}");
            assert_eq!(couple.master.phase(), Phase::Running);
        }
    }
}

/// A link that damages bytes at a fixed interval: the jobs are still done, and the counter of 11.5 counts
/// the errors.
#[test]
fn corrected_errors_are_counted() {
    let mut couple = counted(6, false);
    for n in 1..18 {
        couple.ring.arm_link(2, 400 * n, PARITY);
    }
    let mut ids = Vec::new();
    for n in 0..400u16 {
        let k = (n % 6) as u8;
        ids.push((k, couple.submit(Job::new(k, READ))));
        couple.steps(18);
    }
    couple.finish(2_000);
    assert_eq!(couple.master.counters().corrected, 17);
    assert!(
        faults(&couple)
            .iter()
            .all(|f| *f == Fault::Damaged(link(4, 3)))
    );
    for (_, id) in ids {
        assert!(matches!(couple.outcome(id), Some(Outcome::Read(_))));
    }
}

/// A job that may run only once is not repeated: "unknown, not repeated". A job that was not sent whole did not run.
#[test]
fn what_may_run_but_once_is_not_repeated() {
    for repeat in [false, true] {
        let mut couple = counted(20, false);
        // Damaged in front of drive 3: the command has reached drive 10, its answer is lost.
        let sent = couple.master.counters().sent;
        couple.ring.arm_link(17, sent + 3, PARITY);
        let job = |job: Job| if repeat { job.repeatable() } else { job };
        let reset = couple.submit(job(Job::new(10, Command::ResetH8)));
        let marked = couple.submit(job(Job::new(11, WRITE).once()));
        let plain = couple.submit(Job::new(12, WRITE));
        couple.steps(12);
        couple.finish(1_000);
        let done = Outcome::Done {
            perhaps_twice: true,
        };
        let unknown = Outcome::Unknown(Fault::Damaged(link(3, 2)));
        let expected = if repeat { &done } else { &unknown };
        assert_eq!(couple.outcome(reset), Some(expected));
        assert_eq!(couple.outcome(marked), Some(expected));
        assert_eq!(couple.outcome(plain), Some(&done));
        let runs = |k| {
            couple
                .ring
                .drive(k)
                .expect("a drive")
                .memory
                .written(0xFE20)
        };
        assert_eq!(runs(11), if repeat { 2 } else { 1 });
        assert_eq!(runs(12), 2);
        let resets = couple.ring.drive(10).expect("a drive").memory.resets;
        assert_eq!(resets, if repeat { 2 } else { 1 });
    }
}

/// After a reset the drive knows no address, and waits for a sync byte (ND21 10.5, 9.2).
#[test]
fn jobs_behind_a_reset_get_through() {
    let mut couple = counted(2, false);
    let ids = [READ, Command::ResetH8, READ, WRITE, Command::ResetH8, READ]
        .map(|command| couple.submit(Job::new(1, command)));
    couple.finish(200);
    assert_eq!(faults(&couple), []);
    for id in ids {
        assert!(matches!(
            couple.outcome(id),
            Some(Outcome::Read(_) | Outcome::Done { .. })
        ));
    }
    assert_eq!(couple.ring.drive(1).expect("a drive").memory.resets, 2);
}

/// Jobs that cannot be done are refused, with the range in the message (ND21 10.1-10.3).
#[test]
fn jobs_that_cannot_be_done_are_refused() {
    let options = MasterOptions {
        capacity: 3,
        ..MasterOptions::default()
    };
    let mut master = Master::new(size(4), Rate::Baud38400, options);
    let mut message = |drive, command| {
        let refused = master.submit(Job::new(drive, command)).err();
        refused
            .map(|refused| refused.to_string())
            .unwrap_or_default()
    };
    assert_eq!(
        message(4, READ),
        "no drive 4 in a ring of 4: drives are numbered 0 to 3 (ND21 8.5)"
    );
    assert_eq!(
        message(0, Command::ReadByte { address: 0x2FC0 }),
        "ReadByte at 2FC0: it reaches 2F00 to 2FBF and FD80 to FFFF with all of its 1 bytes (ND21 10)"
    );
    assert_eq!(
        message(
            0,
            Command::WriteWord {
                address: 0xFF7F,
                data: 0
            }
        ),
        "WriteWord at FF7F: it reaches FD80 to FF7F with all of its 2 bytes (ND21 10)"
    );
    assert_eq!(
        message(
            0,
            Command::Or {
                address_low: 0x80,
                data: 1
            }
        ),
        "Or at FF80: it reaches FF00 to FF7F with all of its 1 bytes (ND21 10)"
    );
    for _ in 0..3 {
        assert_eq!(message(3, READ), "");
    }
    assert_eq!(
        message(3, READ),
        "3 jobs and unfetched results are held already (ND21 11.6)"
    );
    assert!(master.set_exchange(&[0, 4], CyclePace::Continuous).is_err());
    assert!(master.set_nominal(4, 0).is_err());
}

/// ND21 10.1: both forms of the answer to `ReadLong`.
#[test]
fn read_long_has_two_answers() {
    for read_long in [ReadLongAnswer::FourData, ReadLongAnswer::AsPrinted] {
        let properties = Properties {
            read_long,
            ..Properties::default()
        };
        let options = MasterOptions {
            read_long,
            packing: Packing::ALL,
            ..MasterOptions::default()
        };
        let mut couple = Couple::new(2, options, |_| PlainDrive::new(properties, [0; 256])).ready();
        for (i, byte) in (0..4).zip([0x11, 0x22, 0x33, 0x44]) {
            couple.poke(1, 0xFE00 + i, byte);
        }
        let id = couple.submit(Job::new(1, Command::ReadLong { address: 0xFE00 }));
        couple.finish(60);
        let Some(Outcome::Read(data)) = couple.outcome(id) else {
            panic!("{:?}", couple.events);
        };
        let whole = read_long == ReadLongAnswer::FourData;
        assert_eq!(data.value(), whole.then_some(0x1122_3344));
        assert_eq!(data.byte(2), whole.then_some(0x33));
        assert_eq!(data.byte(3), Some(0x44));
    }
}

/// In a ring of more than 128 drives SYNCO is the address of one of them as well.
#[test]
fn drive_128_is_not_taken_for_synco() {
    let mut couple = Couple::plain(130, MasterOptions::default()).ready();
    let sent = couple.master.counters().sent;
    // Link 1 ends at drive 128.
    couple.ring.arm_link(1, sent + 20, PARITY);
    couple.steps(600);
    assert_eq!(faults(&couple), [Fault::Damaged(link(129, 128))]);
    let mut couple = Couple::plain(130, MasterOptions::default()).ready();
    let sent = couple.master.counters().sent;
    couple.ring.arm_link(130, sent + 20, PARITY);
    couple.steps(600);
    assert_eq!(faults(&couple), [Fault::Damaged(RingLink::last())]);
}

/// The largest ring there is.
#[test]
fn every_ring_size_starts() {
    for drives in (1..=250u64).step_by(13) {
        let size = RingSize::new(drives).expect("1 to 250");
        let ring = Ring::new(size, Rate::Baud9600, |_| PlainDrive::default());
        let master = Master::new(size, Rate::Baud9600, MasterOptions::default());
        let mut couple = Couple::with(master, ring);
        couple.steps(drives as usize + 10);
        assert_eq!(couple.master.phase(), Phase::Running, "{drives}");
        assert_eq!(couple.master.counters().disturbed, 0);
    }
}

/// A start bit that is lost before the master puts its own receiver out of step: it reads 01 out of every SYNCO, which
/// looks like the address of drive 1. But the first byte that it read had a line error, and no drive passes one on.
#[test]
fn a_master_out_of_step_blames_its_own_link() {
    let start = LinkFault::Flip(Flips {
        start: true,
        ..Flips::default()
    });
    for byte in 1..=12 {
        let mut couple = Couple::plain(3, MasterOptions::default()).ready();
        couple.submit(Job::new(1, READ));
        couple.ring.arm_link(3, 6 + byte, start);
        couple.steps(600);
        let named = faults(&couple);
        let inner =
            |fault: &Fault| matches!(fault, Fault::Damaged(link) if link.to != LinkEnd::Master);
        assert_eq!(named.iter().find(|fault| inner(fault)), None, "byte {byte}");
        assert!(!named.is_empty(), "byte {byte}");
        assert!(couple.healthy(), "byte {byte}");
    }
}
