//! Runs a master in virtual time.

use super::judge::{DATA_IN, DATA_OUT, Judge, Lie};
use super::noted::Watch;
use super::wire;
use super::work::{BITS, CONSTANT_CELLS, CONSTANTS, Work, constant, nominal};
use crate::fuzz::Notebook;
use crate::novobus::counted::Counted;
use crate::novobus::deviation::MasterDeviation;
use crate::novobus::master::AnyMaster;
use crate::novobus::ring::Ring;
use harness_proto::line::Rate;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{CyclePace, Phase};

/// Byte times after the last order in which every job must have ended: more than 8 recoveries of a ring of six take.
const BOUND: u64 = 15_000;

/// Byte times after the last job, in which the master can still report a wrong byte.
const AFTERWARDS: u64 = 500;

/// Runs a master on the work, and judges it.
pub(super) fn play(
    work: &Work,
    deviates: Option<&'static MasterDeviation>,
    notes: &mut Notebook<'_>,
) -> Result<(), Lie> {
    let size = RingSize::new(u64::from(work.drives))
        .map_err(|error| Lie::new("8.5", error.to_string()))?;
    let rate = Rate::Baud38400;
    let watched = notes.wanted();
    let mut ring = Ring::new(size, rate, |k| drive(work, k, watched));
    ring.stop_recording();
    for fault in &work.faults {
        ring.arm_link(fault.link, fault.byte, fault.what);
    }
    let mut master = AnyMaster::new(size, rate, work.options(), deviates);
    let mut judge = Judge::new(work);
    let mut watch = Watch::new(work, notes);
    let done = do_all(work, &mut master, &mut ring, &mut judge, &mut watch);
    watch.drives(&ring);
    // A wrong byte that it sent explains all later mistakes.
    wire::read(work.drives, &judge.sent)?;
    done?;
    actual_values(work, &master, &judge)?;
    judge.end(&ring)
}

/// Submits the orders and runs until all have ended and every disturbance has been reported.
fn do_all(
    work: &Work,
    master: &mut AnyMaster,
    ring: &mut Ring<Counted>,
    judge: &mut Judge<'_>,
    watch: &mut Watch<'_, '_>,
) -> Result<(), Lie> {
    if work.exchange {
        let all: Vec<u8> = (0..work.drives).collect();
        let _all_of_the_ring = master.set_exchange(&all, CyclePace::Continuous);
        for k in 0..work.drives {
            let _of_the_ring = master.set_nominal(k, nominal(k));
        }
    }
    let mut orders = work.orders.iter().peekable();
    let (mut wait, mut idle, mut over) = (0, 0, 0);
    loop {
        if let Some(order) = orders.next_if(|order| wait >= order.gap) {
            wait = 0;
            if let Ok(id) = master.submit(order.job) {
                judge.given(id, *order);
                watch.given(id, order, master.phase());
            }
        }
        wait += 1;
        step(master, ring, judge, watch)?;
        if orders.peek().is_some() {
            continue;
        }
        if judge.open() > 0 {
            idle += 1;
            if idle > BOUND {
                let text = format!(
                    "{} jobs have not ended after {BOUND} byte times",
                    judge.open()
                );
                return Err(Lie::new("11.6", text));
            }
            continue;
        }
        over += 1;
        if over > AFTERWARDS || work.faults.is_empty() && over > u64::from(work.drives) * 8 {
            return Ok(());
        }
    }
}

/// A drive with known contents in cells that no job writes, and with places for process data.
fn drive(work: &Work, k: u8, watched: bool) -> Counted {
    let mut drive = Counted::new(work.monitoring);
    if watched {
        drive.watch();
    }
    let [_, data_in] = DATA_IN.to_be_bytes();
    let [_, data_out] = DATA_OUT.to_be_bytes();
    let constants = (CONSTANTS..CONSTANTS + CONSTANT_CELLS).map(|cell| (cell, constant(k, cell)));
    let bits = (0xFF40..0xFF40 + super::work::MOST_JOBS as u16).map(|cell| (cell, BITS));
    let out = (DATA_OUT..DATA_OUT + 2).map(|cell| (cell, constant(k, cell)));
    let places = [(ram::DATA_IN, data_in), (ram::DATA_OUT, data_out)];
    for (address, byte) in constants.chain(bits).chain(out).chain(places) {
        drive.memory.poke(address, byte);
    }
    drive
}

/// One byte time: what has come is taken, what is due is done, one byte goes out.
fn step(
    master: &mut AnyMaster,
    ring: &mut Ring<Counted>,
    judge: &mut Judge<'_>,
    watch: &mut Watch<'_, '_>,
) -> Result<(), Lie> {
    let now = ring.now();
    let before = master.phase();
    judge.steps += 1;
    let mut last = None;
    while let Some(byte) = ring.receive() {
        if let Some(received) = byte.arrival() {
            judge.heard(received);
            last = Some(received);
            master.handle_byte(byte.at, received);
        }
    }
    if master.poll_timeout().is_some_and(|due| due <= now) {
        master.handle_timeout(now);
    }
    while let Some(event) = master.poll_event() {
        watch.told(&event);
        judge.hear(&event, ring)?;
    }
    let transmitted = master.poll_transmit(now);
    watch.step(before, last, master.phase());
    match transmitted {
        Some(byte) => {
            judge.sent.push(byte);
            ring.send(now, &[byte]);
        }
        None if judge.work.faults.is_empty() && master.phase() != Phase::Stopped => {
            return Err(Lie::new("9.1", "it left a gap on the line"));
        }
        None => {}
    }
    ring.run_until(now + ring.byte_time());
    Ok(())
}

/// The master reports the process data of each drive as that drive's (9.4).
fn actual_values(work: &Work, master: &AnyMaster, judge: &Judge<'_>) -> Result<(), Lie> {
    if work.unchecked() || judge.stopped || work.is_cut() {
        return Ok(());
    }
    for k in 0..work.drives {
        let there = u16::from_be_bytes([constant(k, DATA_OUT), constant(k, DATA_OUT + 1)]);
        match master.actual(k) {
            Some(value) if value != there => {
                let text =
                    format!("drive {k} gives {there:04X} as process data, told is {value:04X}");
                return Err(Lie::new("9.4", text));
            }
            _ => {}
        }
    }
    Ok(())
}
