//! The wrapper alone changes nothing, and the table is whole.

use super::MASTER_DEVIATIONS;
use super::how::{How, MasterDeviation, Sending};
use super::table::wrong;
use crate::novobus::counted::Counted;
use crate::novobus::fuzz::jobs::Work;
use crate::novobus::master::AnyMaster;
use crate::novobus::ring::Ring;
use harness_proto::line::Rate;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::master::{CyclePace, Event};

static NEUTRAL: [MasterDeviation; 3] = [
    wrong(
        "mistakes-nothing",
        "9.1",
        "it sends and hears what it should",
        How::Mistakes(|s| Sending::Byte(s.byte), |h| h.received),
    ),
    wrong(
        "tells-all",
        "9.1",
        "it tells what it should",
        How::Tells(|_, event| Some(event)),
    ),
    wrong(
        "waits-as-it-should",
        "9.1",
        "it waits for as long as it should",
        How::Waits(|(_, due, ..)| Some(due)),
    ),
];

/// What a master sends in each byte time, and what it tells.
fn run(
    work: &Work,
    deviates: Option<&'static MasterDeviation>,
) -> (Vec<Option<u8>>, Vec<Event>, usize) {
    let size = RingSize::new(u64::from(work.drives)).expect("1 to 6");
    let rate = Rate::Baud38400;
    let mut ring = Ring::new(size, rate, |_| Counted::new(work.monitoring));
    for fault in &work.faults {
        ring.arm_link(fault.link, fault.byte, fault.what);
    }
    let mut master = AnyMaster::new(size, rate, work.options(), deviates);
    if work.exchange {
        master
            .set_exchange(&[0], CyclePace::Continuous)
            .expect("drive 0");
    }
    let (mut sent, mut events) = (Vec::new(), Vec::new());
    for step in 0..1_500 {
        if let Some(order) = work.orders.get(step / 20).filter(|_| step % 20 == 0) {
            master.submit(order.job).expect("room");
        }
        let now = ring.now();
        while let Some(byte) = ring.receive() {
            if let Some(received) = byte.arrival() {
                master.handle_byte(byte.at, received);
            }
        }
        if master.poll_timeout().is_some_and(|due| due <= now) {
            master.handle_timeout(now);
        }
        events.extend(std::iter::from_fn(|| master.poll_event()));
        let byte = master.poll_transmit(now);
        sent.push(byte);
        ring.send(now, byte.as_slice());
        ring.run_until(now + ring.byte_time());
    }
    (sent, events, master.under_way())
}

#[test]
fn the_wrapper_changes_nothing() {
    let mut random = 1_u64;
    let mut byte = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 56) as u8
    };
    for case in 0..60 {
        let input: Vec<u8> = (0..2 + 6 * 12).map(|_| byte()).collect();
        let work = Work::read(&input);
        let right = run(&work, None);
        for deviation in &NEUTRAL {
            let wrapped = run(&work, Some(deviation));
            assert_eq!(wrapped, right, "{}, case {case}", deviation.name);
        }
    }
}

#[test]
fn names_are_unique_and_sections_are_the_manuals() {
    let mut names = MASTER_DEVIATIONS.names();
    let all = names.len();
    assert!(all >= 15, "{all}");
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all);
    for deviation in MASTER_DEVIATIONS.all() {
        let kebab = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        assert!(deviation.name.chars().all(kebab), "{}", deviation.name);
        assert!(
            crate::novobus::deviation::deviation(deviation.name).is_none(),
            "{} is a drive's too",
            deviation.name
        );
        let chapter = deviation.section.split('.').next();
        assert!(
            matches!(chapter, Some("8" | "9" | "10" | "11")),
            "{}",
            deviation.name
        );
    }
}
