//! Right inverters over every way to a bench, and wrong ones.

use super::super::rehearse::ModelOptions;
use super::super::{Player, RigScenario};
use super::*;
use crate::rig::RigSlave;
use harness_bench::scenario::source::Source;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::guard::Limits;
use harness_sim::nordac::deviation::DEVIATIONS;
use std::sync::Arc;

/// Up to 25 % in 1.25 s, down by OFF3, a fault by 1625, and a parameter that follows the motor.
const RUN: &str = "title x\nbus nordac\nslave 8\nstart 8\nexchange 8 STW=047E HSW=25%\nexchange 8\nexchange 8 STW=047F\nexchange 8\n\
    wait 300ms\nexchange 8\nwait 400ms\nexchange 8\nread 8 1813\nwait 1s\nexchange 8\nexchange 8 STW=045F HSW=50%\nwait 200ms\n\
    exchange 8\nexchange 8 STW=047F\nwait 300ms\nexchange 8\nexchange 8 STW=047E\nwait 200ms\nexchange 8\nwait 3s\nexchange 8\nexchange 8 STW=047F\n\
    exchange 8 STW=047E\nexchange 8 STW=047F\nwait 500ms\nexchange 8 STW=047B\nwait 50ms\nexchange 8\nwait 1s\nexchange 8\n\
    read 8 1801\nread 8 1802\nread 8 1202\nexchange 8\n";

/// Motors that run up and stop by OFF3 within some milliseconds, again and again.
const QUICK: &str = "title x\nbus nordac\nslave 8\nstart 8\nexchange 8 STW=047E HSW=25%\nexchange 8\n\
    exchange 8 STW=047F\nwait 2ms\nexchange 8\nexchange 8 STW=047B\nexchange 8\nexchange 8\nwait 3ms\nexchange 8 STW=047E\n\
    exchange 8 STW=047F\nexchange 8\nexchange 8 STW=047B\nexchange 8\nexchange 8\nexchange 8 STW=047E\n\
    exchange 8 STW=047F\nexchange 8\nexchange 8 STW=047B\nexchange 8\nexchange 8\nexchange 8 STW=047E\n\
    exchange 8 STW=047F\nwait 4ms\nexchange 8 STW=047B\nexchange 8\nexchange 8\nexchange 8\nexchange 8\n";

/// Ramps of 0.05 s (5.1).
const FAST: [(u16, u32); 3] = [(1202, 1), (1203, 1), (1615, 1)];

fn known(parameters: &[(u16, u32)]) -> KnownInverters {
    let mut known = KnownInverters::new(RigSlave {
        address: 8,
        ppo: Some(PpoType::One),
    });
    let values = parameters.iter().map(|(number, raw)| ((*number, 0), *raw));
    let fixed = [((1621, 0), 2), ((1615, 0), 20)].into_iter();
    known.values = Arc::new(fixed.chain(values).collect());
    known
}

/// The telegrams of a run with a slave.
fn turns(slave: &KnownInverters) -> Vec<Turn> {
    turns_of(slave, RUN)
}

fn turns_of(slave: &KnownInverters, text: &'static str) -> Vec<Turn> {
    let source = Source::new("x", text);
    let scenario = RigScenario::read(&source).expect("a scenario");
    let limits = Limits::unlimited();
    let patience = Span::from_millis(5);
    let (slaves, rate) = (vec![slave.slave], BusRate::K500);
    let mut player = Player::of(slaves, rate, patience, limits, Vec::new(), false);
    player.known = Some(vec![slave.clone()]);
    player
        .rehearse(&scenario, &limits, ModelOptions::default())
        .turns
}

/// Whether right slaves send this over a line that loses at most `most_lost` telegrams.
fn sent_by(
    known: &[KnownInverters],
    most_lost: usize,
    turns: &[Turn],
) -> Result<Vec<usize>, Divergence> {
    right_slaves_send(known, BusRate::K500, most_lost, turns, &Beats::default())
}

fn judged(turns: &[Turn]) -> Result<(), Divergence> {
    sent_by(&[known(&[])], 0, turns).map(|_| ())
}

/// What slaves reply to octets that reach them at a time.
fn replies(line: &mut Line<LONG>, octets: &[u8], at: Instant) -> Vec<u16> {
    line.advance(at);
    line.hear(at, &Piece::of(&wide(octets)));
    let said = std::iter::from_fn(|| line.say());
    said.flat_map(|piece| piece.octets).collect()
}

/// The main actual value in the reply to an exchange by PPO1.
fn actual(octets: &[u16]) -> Option<u16> {
    let place = octets.len().checked_sub(4)?;
    (octets.len() == 21).then(|| octets[place] << 8 | octets[place + 1])
}

/// A right slave is not accused, however late the computer hands over a telegram, or reads what comes to it.
#[test]
fn a_computer_that_stands_still_accuses_no_slave() {
    stands_still(&known(&[]), RUN);
}

/// What has begun and ended within a scan.
#[test]
fn a_quick_stop_between_two_telegrams_accuses_no_slave() {
    stands_still(&known(&FAST), QUICK);
}

fn stands_still(slave: &KnownInverters, text: &'static str) {
    let right = turns_of(slave, text);
    let judged = |turns: &[Turn]| sent_by(std::slice::from_ref(slave), 0, turns).map(|_| ());
    assert_eq!(judged(&right), Ok(()));
    for place in 0..right.len() {
        for millis in [1, 30, 300, 2_000] {
            let pause = Span::from_millis(millis);
            // The telegram had left long before it reached the slave.
            let mut early = right.clone();
            let before = place.checked_sub(1).and_then(|place| right[place].read);
            early[place].left = (right[place].left - pause).max(before.unwrap_or_default());
            assert_eq!(judged(&early), Ok(()), "{place} {millis}");
            // The reply was read long after it was there.
            let mut late = right.clone();
            late[place].read = late[place].read.map(|read| read + pause);
            for turn in &mut late[place + 1..] {
                turn.left += pause;
                turn.read = turn.read.map(|read| read + pause);
            }
            let moves = |turn: &Turn| actual(&turn.came).is_some_and(|value| value != 0);
            // What moves has gone on.
            let rests = place + 1 >= right.len() || !moves(&right[place + 1]);
            assert!(
                !rests || judged(&late).is_ok(),
                "{place} {millis} {:?}",
                judged(&late)
            );
        }
    }
}

/// A reply that the computer has read after its next telegram.
#[test]
fn a_reply_may_be_read_late() {
    let mut late = turns(&known(&[]));
    let place = late.len() - 2;
    let came = std::mem::take(&mut late[place].came);
    late[place].read = None;
    late[place + 1].came.splice(0..0, came);
    assert_eq!(judged(&late), Ok(()));
    late[place + 1].came.clear();
    assert!(judged(&late).is_err());
}

/// NORDAC 3.3, 5.1, 5.5: a ramp in another time, a stop by another ramp, another time of the quick stop.
#[test]
fn a_ramp_in_another_time_is_found() {
    for (number, raw) in [
        (1202, 80),
        (1202, 120),
        (1203, 50),
        (1203, 200),
        (1615, 10),
        (1205, 650),
    ] {
        let wrong = turns(&known(&[(number, raw)]));
        assert!(judged(&wrong).is_err(), "{number} = {raw}");
    }
}

/// NORDAC 5.7: only its last fault is known of a slave that had some.
#[test]
fn earlier_faults_are_not_known() {
    let faults = |faults: &[u8]| {
        let mut slave = known(&[]);
        slave.history.faults = faults.to_vec();
        slave
    };
    let came = turns(&faults(&[3, 5, 10]));
    let last = faults(&[10]);
    assert_eq!(
        sent_by(std::slice::from_ref(&last), 0, &came),
        Ok(Vec::new())
    );
    assert!(judged(&came).is_err());
    // All else is compared.
    let mut other = faults(&[3, 5, 10]);
    Arc::make_mut(&mut other.values).insert((1202, 0), 80);
    assert!(sent_by(&[last], 0, &turns(&other)).is_err());
}

/// What no line of a scenario asks for is compared.
#[test]
fn deviations_are_found_without_a_line() {
    let right = turns(&known(&[]));
    for name in [
        "directions-exchanged",
        "values-of-one-more",
        "answers-without-number",
        "pzd-low-byte-first",
    ] {
        let deviation = DEVIATIONS.named(name);
        assert!(deviation.is_some(), "{name}");
        let mut slave = known(&[]).model(Default::default());
        slave.deviation = deviation;
        assert!(
            could_send(&[slave], BusRate::K500, &right).is_err(),
            "{name}"
        );
    }
}

/// A line that loses a telegram or a reply, or damages one, accuses no slave; a reply that came whole and is wrong does.
#[test]
fn a_line_that_loses_something_accuses_no_slave() {
    let all = [known(&[])];
    let right = turns(&all[0]);
    let lossy = |turns: &[Turn]| sent_by(&all, MOST_LOST, turns);
    assert_eq!(lossy(&right), Ok(Vec::new()));
    let played = |place: &&usize| right[**place].step.is_some() && !right[**place].came.is_empty();
    let places: Vec<_> = (0..right.len()).collect();
    for place in places.iter().filter(played).copied() {
        let mut lost = right.clone();
        lost[place].came.clear();
        lost[place].read = None;
        let mut cut = right.clone();
        cut[place].came.pop();
        let mut changed = right.clone();
        changed[place].came[0] ^= 1;
        // The bench does not wait for what comes after the damage.
        let mut slipped = right.clone();
        let mut came = slipped[place].came.split_off(1);
        came.drain(..came.len().min(1));
        if let Some(next) = slipped.get_mut(place + 1) {
            next.came.splice(0..0, came);
        }
        for (way, turns) in [lost, cut, changed, slipped].iter().enumerate() {
            // The place is that of the next telegram where both replies are the same; what has slipped whole was late.
            let found = lossy(turns);
            let least = usize::from(way < 3);
            let one = found
                .as_ref()
                .is_ok_and(|lost| (least..=1).contains(&lost.len()));
            assert!(one, "{place}, {way}: {found:?}");
        }
    }
    // Too many are none of the line's.
    let mut silent = right.clone();
    for turn in silent.iter_mut().filter(|turn| turn.step.is_some()) {
        turn.came.clear();
    }
    assert!(lossy(&silent).is_err());
    assert!(lossy(&turns(&known(&[(1202, 80)]))).is_err());
}

/// EN 1: a slave that has not heard a request takes the next one, with the frame count bit of the one before, for its repetition.
#[test]
fn a_line_that_loses_a_request_accuses_no_slave() {
    let all = [known(&[])];
    let right = turns(&all[0]);
    let played = |place: &usize| right[*place].step.is_some() && !right[*place].came.is_empty();
    for place in (0..right.len()).filter(played) {
        let mut line = Line::new(&[all[0].model(Default::default())]);
        let mut lost = right.clone();
        for (number, turn) in lost.iter_mut().enumerate() {
            let mut came = Vec::new();
            if number != place {
                came = replies(&mut line, &turn.octets, turn.left);
            }
            turn.came = came;
        }
        lost[place].read = None;
        let found = sent_by(&all, MOST_LOST, &lost);
        assert!(found.is_ok(), "{place}: {found:?}");
    }
}

/// An adapter, or the simulator of a slave, that stands still gets the next telegram too, and handles both at once: the motor has moved since.
#[test]
fn telegrams_that_are_held_up_accuse_no_slave() {
    let pause = Span::from_millis(700);
    let all = [known(&[])];
    let right = turns(&all[0]);
    let played = |place: &usize| right[*place].step.is_some() && !right[*place].came.is_empty();
    for place in (0..right.len() - 1).filter(played) {
        let mut line = Line::new(&[all[0].model(Default::default())]);
        let mut late = right.clone();
        let held = std::mem::take(&mut late[place].came);
        assert!(!held.is_empty());
        late[place].read = None;
        for (number, turn) in late.iter_mut().enumerate() {
            let mut came = Vec::new();
            if number > place {
                turn.read = turn.read.map(|read| read + pause);
            }
            if number > place + 1 {
                turn.left += pause;
            }
            let mut at = turn.left;
            if number == place + 1 {
                at += pause;
                came = replies(&mut line, &right[place].octets, at);
            }
            if number != place {
                came.extend(replies(&mut line, &turn.octets, at));
            }
            turn.came = came;
        }
        assert_eq!(judged(&late), Ok(()), "{place}");
    }
}

/// An octet after a reply was not lost, and no reply is there that the line has changed.
#[test]
fn a_line_adds_nothing() {
    let kinds = |octets: &[u16]| -> Vec<_> {
        let pieces = pieces(octets, &[]).into_iter();
        let pieces = pieces.map(|range| Piece::of(&octets[range]));
        pieces.map(|piece| piece.damaged).collect()
    };
    assert_eq!(kinds(&[0xE5, 0x10]), [false, true]);
    assert_eq!(kinds(&[0x10]), [true]);
}

/// Worlds are merged by this checksum.
#[test]
fn slaves_of_the_same_state_do_the_same() {
    let text = "title x\nbus nordac\nslave 8\nstart 8\nexchange 8 STW=047E HSW=25%\nexchange 8 STW=047F HSW=25%\n\
        exchange 8 STW=047F HSW=12.5%\nexchange 8 STW=047B HSW=25%\nexchange 8 STW=007F\nread 8 1202\nwrite 8 1202 = 5 s\n";
    let all = turns_of(&known(&[]), text);
    // What makes the slave exchange is not played again.
    let start = all.iter().find_map(|turn| turn.step);
    let rest = all
        .iter()
        .take_while(|turn| turn.step.is_none() || turn.step == start);
    let rest = rest.count();
    let played = &all[rest..];
    let mut begun = Line::<LONG>::new(&[known(&[]).model(Default::default())]);
    let mut at = Instant::START;
    for turn in &all[..rest] {
        replies(&mut begun, &turn.octets, at);
    }
    let play = |line: &mut Line<LONG>, at: Instant, number: usize| match played.get(number) {
        Some(turn) => replies(line, &turn.octets, at),
        None => Vec::new(),
    };
    at += Span::from_millis(50);
    // One number more is a pause.
    let inputs = 0..=played.len();
    let mut states: HashMap<u64, Line<LONG>> = HashMap::new();
    let mut alike = 0;
    let count = inputs.clone().count().pow(3);
    for history in 0..count {
        let mut line = begun.clone();
        let mut now = at;
        let mut left = history;
        for _ in 0..3 {
            play(&mut line, now, left % inputs.clone().count());
            left /= inputs.clone().count();
            now += Span::from_millis(30);
        }
        line.advance(now);
        let mut other = states
            .entry(line.state())
            .or_insert_with(|| line.clone())
            .clone();
        for (place, number) in (0..).zip(inputs.clone().chain(inputs.clone().rev())) {
            let then = now + Span::from_millis(20 * place);
            let both = [&mut line, &mut other].map(|line| play(line, then, number));
            assert_eq!(both[0], both[1], "{history} {number}");
        }
        alike += 1;
    }
    assert!(
        states.len() > 50 && alike - states.len() > 50,
        "{alike} {}",
        states.len()
    );
}
