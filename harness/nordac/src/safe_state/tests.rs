//! The safe state on simulated inverters.

use super::*;
use crate::gate::guarded;
use crate::rig::values;
use crate::simulate::{Bench, Setup, SlaveSetup};
use harness_bench::link::stands_still::StandsStill;
use harness_bench::link::{DriveFault, Link, Moment, Octets, PlacedFault, Trouble};
use harness_proto::nordac::Parameter;
use harness_proto::nordac::guard::{GuardedSlave, Limits};
use harness_proto::nordac::pkw::Index;
use harness_proto::nordac::properties::{NordacProperty, PROPERTIES};
use harness_proto::profibus::fdl::{FcFunction, FrameControl, Sequence};
use harness_proto::profibus::{BusRate, Pdu};
use harness_sim::nordac::deviation::DEVIATIONS;

const PATIENCE: Span = Span::from_millis(5);

fn set(slave: &mut SlaveSetup, number: u16, value: i64) {
    let parameter = Parameter::of(number).expect("a parameter");
    slave.parameters.push((parameter, Index::default(), value));
}

/// An inverter that the bus controls (1621).
fn slave(address: u8, ppo: PpoType) -> SlaveSetup {
    let mut slave = SlaveSetup::new(address);
    slave.ppo = ppo;
    set(&mut slave, 1621, 2);
    slave
}

fn line(slaves: Vec<SlaveSetup>, limits: Limits) -> (Guarded<Bench>, Vec<RigSlave>) {
    let known = slaves.iter().map(|slave| RigSlave {
        address: slave.address,
        ppo: Some(slave.ppo),
    });
    let known: Vec<_> = known.collect();
    let setup = Setup::new(BusRate::K500, slaves);
    let gated: Vec<GuardedSlave> = known.iter().copied().map(Into::into).collect();
    (guarded(Bench::new(&setup), limits, &gated, false), known)
}

/// Takes motors to a frequency.
fn run(line: &mut Guarded<Bench>, slaves: &[RigSlave]) {
    let mut talk = Talk::new(Box::new(line), PATIENCE);
    for slave in slaves {
        let ppo = slave.ppo.expect("known");
        talk.start(slave.address, ppo, None).expect("starts");
        for word in [stw::READY, stw::START, stw::START] {
            let words = Image::of_words(word, 0x2000);
            talk.exchange(slave.address, ppo, &words).expect("answers");
        }
        talk.pass(Span::from_millis(2_000)).expect("sound");
    }
}

fn is_on(line: &Guarded<Bench>, address: u8) -> bool {
    let drive = line.inner().drive(address).expect("a drive");
    drive.inverter().state().output_on()
}

fn safe(line: &mut Guarded<Bench>, slaves: &[RigSlave], order: &[StandstillStep]) -> Safe {
    let standing = Standstill {
        order: order.to_vec(),
        within: Span::from_millis(500),
        ..Standstill::default()
    };
    safe_state(line, slaves, PATIENCE, &standing)
}

/// In every PPO type and under every value of every open point: motors that run are off afterwards, and it is seen.
#[test]
fn motors_that_run_are_stopped_whatever_the_manual_leaves_open() {
    let mut all = PpoType::ALL
        .map(|ppo| vec![slave(8, ppo), slave(9, ppo)])
        .to_vec();
    for property in PROPERTIES {
        for word in values(property) {
            let mut setup = slave(8, PpoType::One);
            assert!(property.set(&mut setup.properties, &word), "{word}");
            all.push(vec![setup]);
        }
    }
    for setup in all {
        let name = format!("{:?} {:?}", setup[0].ppo, setup[0].properties);
        let (mut line, slaves) = line(setup, Limits::unlimited());
        run(&mut line, &slaves);
        assert!(is_on(&line, 8), "{name}");
        let safe = safe(
            &mut line,
            &slaves,
            &[StandstillStep::Stop, StandstillStep::Block],
        );
        assert!(safe.confirmed, "{safe} {name}");
        for slave in &slaves {
            assert!(!is_on(&line, slave.address), "{name}");
        }
    }
}

/// Without permission for motion, with words that wait for Sync, and after the slave has fallen out of the exchange.
#[test]
fn other_ways_in() {
    let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::default());
    let none = safe(&mut line, &slaves, &[StandstillStep::Block]);
    assert!(none.confirmed, "{none}");
    for seconds in [0, 5] {
        let (mut line, slaves) = self::line(vec![slave(8, PpoType::One)], Limits::unlimited());
        run(&mut line, &slaves);
        match seconds {
            // Sync and Freeze, which Set_Prm asked for.
            0 => {
                let prm = [0xB8, 1, 100, 0, 0x75, 0x31, 0];
                let control = FrameControl::request(FcFunction::SrdLow, Sequence::First);
                let pdu = Pdu::with_saps(8, MASTER, control, Some(61), Some(62), &prm);
                let prm = Telegram::Pdu(pdu.expect("fits")).encode();
                let control = FrameControl::request(FcFunction::SrdLow, Sequence::None);
                let cfg = PpoType::One.cfg();
                let pdu = Pdu::with_saps(8, MASTER, control, Some(62), Some(62), cfg);
                let cfg = Telegram::Pdu(pdu.expect("fits")).encode();
                let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
                for octets in [prm, cfg] {
                    talk.send(&octets).expect("sent");
                    talk.pass(PATIENCE).expect("sound");
                }
                let started = talk.exchange(8, PpoType::One, &Image::of_words(stw::START, 0));
                started.expect("answers");
                let both = GlobalControl::SYNC | GlobalControl::FREEZE;
                talk.command(8, both).expect("sent");
            }
            // The watchdog ends the exchange.
            _ => {
                let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
                let started = talk.start(8, PpoType::One, Some(WATCHDOG));
                started.expect("starts");
                talk.pass(Span::from_millis(5_000)).expect("sound");
            }
        }
        assert!(
            is_on(&line, 8),
            "zeros and an end of the exchange stop nothing"
        );
        let safe = safe(
            &mut line,
            &slaves,
            &[StandstillStep::Stop, StandstillStep::Block],
        );
        assert!(safe.confirmed && !is_on(&line, 8), "{safe}");
    }
}

/// The reply to a request of before comes after the first request of the safe state. It is no reply to that.
#[test]
fn a_late_reply_is_not_taken_for_another() {
    let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::unlimited());
    run(&mut line, &slaves);
    let control = FrameControl::request(FcFunction::SrdHigh, Sequence::First);
    let words = Image::of_words(stw::START, 0).encode(PpoType::One);
    let exchange = Pdu::new(8, MASTER, control, &words).expect("fits");
    line.send_octets(0, &Telegram::Pdu(exchange).encode());
    let safe = safe(
        &mut line,
        &slaves,
        &[StandstillStep::Stop, StandstillStep::Block],
    );
    assert!(safe.confirmed && !is_on(&line, 8), "{safe}");
}

#[test]
fn a_silent_slave_is_not_confirmed_and_the_others_are_stopped() {
    let both = vec![slave(8, PpoType::One), slave(9, PpoType::One)];
    let (mut line, slaves) = line(both, Limits::unlimited());
    run(&mut line, &slaves[1..]);
    line.inject(0, PlacedFault::Drive(8, DriveFault::Off), Moment::Now);
    let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
    assert!(!safe.confirmed);
    assert!(
        safe.words
            .contains("slave 8: NOT confirmed: slave 8 does not reply to Slave_Diag"),
        "{safe}"
    );
    assert!(safe.words.contains("slave 9: start-disable"), "{safe}");
    assert!(!is_on(&line, 9));
}

/// An inverter that ignores OFF2 keeps its output on: that is seen, also where its first replies are from before the start (`pzd-latency`).
/// On its quick-stop ramp it stops.
#[test]
fn an_output_that_stays_on_is_not_confirmed() {
    for latency in [1, 5, 20] {
        let mut deaf = slave(8, PpoType::One);
        deaf.deviation = DEVIATIONS.named("no-off2");
        assert!(deaf.deviation.is_some());
        deaf.properties.pzd_latency = latency;
        let (mut line, slaves) = line(vec![deaf], Limits::unlimited());
        run(&mut line, &slaves);
        let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
        assert!(!safe.confirmed, "{latency}: {safe}");
        assert!(safe.words.contains("the output is on"), "{safe}");
        let safe = self::safe(&mut line, &slaves, &[StandstillStep::Stop]);
        assert!(safe.confirmed && !is_on(&line, 8), "{latency}: {safe}");
    }
}

/// A denied telegram of which the begin was sent, and whose FCS is the begin of the telegram that stops: it is ended first.
#[test]
fn a_begun_telegram_does_not_keep_the_stop_back() {
    let (mut line, slaves) = line(vec![slave(8, PpoType::One)], Limits::default());
    // 047F with an HSW that makes the FCS 68.
    let telegram = (0..=u16::MAX).find_map(|main| {
        let control = FrameControl::request(FcFunction::SrdHigh, Sequence::First);
        let words = Image::of_words(stw::START, main);
        let pdu = Pdu::new(8, MASTER, control, &words.encode(PpoType::One)).ok()?;
        let octets = Telegram::Pdu(pdu).encode().to_vec();
        (octets[octets.len() - 2] == SD2).then_some(octets)
    });
    let telegram = telegram.expect("one of them");
    line.send_octets(0, &telegram[..telegram.len() - 2]);
    assert_eq!(line.trouble(), None);
    line.send_octets(0, &[SD2]);
    assert!(matches!(line.trouble(), Some(Trouble::Denied(_))));
    line.reset_after_denial();
    let safe = safe(&mut line, &slaves, &[StandstillStep::Block]);
    assert!(safe.confirmed, "{safe}");
}

/// In the exchange, and in Wait_Prm after the DP watchdog of the slaves; with PPO types that are known, and with those that are not.
#[test]
fn last_words_switch_every_output_off() {
    for (waits, known) in [(0, true), (0, false), (5_000, true), (5_000, false)] {
        let all = PpoType::ALL.into_iter().zip(8..);
        let all = all.map(|(ppo, address)| slave(address, ppo)).collect();
        let (mut line, mut slaves) = line(all, Limits::unlimited());
        run(&mut line, &slaves);
        let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
        for slave in &slaves {
            let ppo = slave.ppo.expect("known");
            let started = talk.start(slave.address, ppo, Some(WATCHDOG));
            started.expect("starts");
        }
        talk.pass(Span::from_millis(waits)).expect("sound");
        drop(talk);
        assert!(slaves.iter().all(|slave| is_on(&line, slave.address)));
        if !known {
            slaves.iter_mut().for_each(|slave| slave.ppo = None);
        }
        for telegram in last_words(&slaves) {
            line.send_octets(0, &telegram);
            let end = line.now() + PATIENCE;
            while line.now() < end && line.wait(end) {}
        }
        for slave in &slaves {
            assert!(!is_on(&line, slave.address), "{waits} {known} {slave:?}");
        }
    }
}

/// A computer that stands still, for less or more than the DP watchdog and the time to stop, is not taken for an inverter that does not stop;
/// and an inverter whose output stays on is never confirmed by it (NORDAC 2.6, 3.2.2).
#[test]
fn a_computer_that_stands_still_accuses_no_inverter() {
    let latency = NordacProperty::of("pzd-latency");
    let latency = latency.expect("an open point");
    let orders = [
        vec![StandstillStep::Stop, StandstillStep::Block],
        vec![StandstillStep::Block],
    ];
    let mut all = Vec::new();
    let both = |order| [(order, true), (order, false)];
    for (order, obeys) in orders.iter().flat_map(both) {
        for waits in [0, 5_000] {
            let ms = [700, 1_500, 12_000].into_iter();
            all.extend(ms.flat_map(|ms| (1..16).map(move |sent| (order, obeys, waits, ms, sent))));
        }
    }
    for (order, obeys, waits, ms, telegrams) in all {
        let standing = Standstill {
            order: order.clone(),
            within: Span::from_millis(500),
            ..Standstill::default()
        };
        let mut setup = slave(8, PpoType::One);
        assert!(latency.set(&mut setup.properties, "2"));
        if !obeys {
            setup.deviation = DEVIATIONS
                .all()
                .find(|deviation| deviation.name == "always-enabled-shown");
        }
        let (mut line, slaves) = line(vec![setup], Limits::unlimited());
        run(&mut line, &slaves);
        if waits > 0 {
            let mut talk = Talk::new(Box::new(&mut line), PATIENCE);
            let started = talk.start(8, PpoType::One, Some(WATCHDOG));
            started.expect("starts");
            talk.pass(Span::from_millis(waits)).expect("sound");
        }
        let (line, span) = (&mut line, Span::from_millis(ms));
        let stands = StandsStill {
            line,
            after: telegrams,
            span,
        };
        let mut talk = Talk::new(Box::new(stands), PATIENCE);
        let made = make_safe(&mut talk, slaves[0], &[8], &standing);
        drop(talk);
        assert_eq!(
            made.is_ok(),
            obeys,
            "{order:?} {waits} telegram {telegrams}, {span}: {made:?}"
        );
    }
}
