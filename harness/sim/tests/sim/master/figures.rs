//! How long exchanges take, in virtual time, against the two tables of ND21 8.2; and the packing that
//! they need.

use super::common::{Couple, size};
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{CyclePace, Event, Job, MasterOptions, Outcome, Packing};
use harness_proto::novobus::timing::{exchange_bytes, position_bytes};
use harness_proto::time::{Instant, Span};

/// The ring sizes of both tables.
const SIZES: [u8; 9] = [1, 2, 3, 4, 5, 6, 10, 100, 250];

/// ps_positionH and ps_positionL (ND21 13.1.3).
const POSITION: [u16; 2] = [0xFF1C, 0xFF1E];

/// A figure of 8.2 in milliseconds, as printed, and how many hundredths of a millisecond it may be off:
/// the first table is rounded to a tenth.
fn printed_exchange(drives: u8) -> Option<(f64, f64)> {
    match drives {
        1 => Some((0.86, 0.005)),
        2 => Some((2.0, 0.05)),
        3 => Some((2.9, 0.05)),
        4 => Some((3.7, 0.05)),
        5 => Some((4.6, 0.05)),
        6 => Some((5.4, 0.05)),
        _ => None,
    }
}

/// The printed 1002,79 is a misprint for 1002,89: 3501 bytes.
fn printed_position(drives: u8) -> Option<f64> {
    match drives {
        1 => Some(4.01),
        10 => Some(40.39),
        100 => Some(401.33),
        250 => Some(1002.89),
        _ => None,
    }
}

fn rounds(couple: &Couple) -> Vec<(Instant, u64)> {
    let number = |event: &Event| match event {
        Event::Round { number } => Some(*number),
        _ => None,
    };
    let all = couple.events.iter();
    all.filter_map(|(at, event)| Some((*at, number(event)?)))
        .collect()
}

/// ND21 8.2, first table: 3 bytes for one drive, else 3N + 1.
#[test]
fn nominal_and_actual_values_take_what_the_manual_says() {
    for drives in SIZES {
        let mut couple = Couple::plain(drives, MasterOptions::default()).ready();
        let all: Vec<u8> = (0..drives).collect();
        for k in 0..drives {
            // DataIn 08 (nsoll), DataOut 18 (ND21 14.10.3).
            couple.poke(k, 0xFF32, 0x08);
            couple.poke(k, 0xFF34, 0x18);
            couple.poke(k, 0xFF18, 0x40);
            couple.poke(k, 0xFF19, k);
            couple
                .master
                .set_nominal(k, 0x1200 | u16::from(k))
                .expect("a drive");
        }
        couple
            .master
            .set_exchange(&all, CyclePace::Continuous)
            .expect("drives");
        let bytes = exchange_bytes(size(drives));
        couple.steps(usize::from(drives) + 8 + 4 * bytes as usize);
        let rounds = rounds(&couple);
        assert!(rounds.len() >= 3, "ring {drives}: {rounds:?}");
        for pair in rounds.windows(2) {
            let span = pair[1].0.since(pair[0].0);
            assert_eq!(span, couple.ring.byte_time() * bytes, "ring {drives}");
            if let Some((ms, within)) = printed_exchange(drives) {
                assert!((span.as_millis_f64() - ms).abs() <= within, "{span}");
            }
        }
        for k in 0..drives {
            assert_eq!(couple.master.actual(k), Some(0x4000 | u16::from(k)));
            assert_eq!([couple.peek(k, 0xFF08), couple.peek(k, 0xFF09)], [0x12, k]);
        }
        assert_eq!(couple.master.counters().disturbed, 0);
    }
}

/// ND21 8.2, second table: 14 bytes for one drive, else 14N + 1.
#[test]
fn position_targets_take_what_the_manual_says() {
    for drives in SIZES {
        let mut couple = Couple::plain(drives, MasterOptions::default()).ready();
        // In a ring of one the drive has been addressed before, as in the table.
        let read = Command::ReadByte { address: 0xFE13 };
        couple.submit(Job::new(size(drives).first(), read));
        couple.finish(usize::from(drives) + 20);
        let mut last = None;
        for k in 0..drives {
            for address in POSITION {
                let data = 0x0100 | u16::from(k);
                let job = Job::new(k, Command::WriteWord { address, data });
                last = Some(couple.submit(job));
            }
        }
        let start = couple.ring.now();
        couple.finish(15 * usize::from(drives) + 20);
        let expected = Outcome::Done {
            perhaps_twice: false,
        };
        assert_eq!(couple.outcome(last.expect("a job")), Some(&expected));
        // The last answer is in when the last byte has gone round.
        let way_round = couple.ring.byte_time() * (u64::from(drives) + 1);
        let span = (couple.ring.now() - way_round).since(start);
        let bytes = position_bytes(size(drives));
        assert_eq!(span, couple.ring.byte_time() * bytes, "ring {drives}");
        if let Some(ms) = printed_position(drives) {
            assert!((span.as_millis_f64() - ms).abs() <= 0.01, "{span}");
        }
    }
}

/// The same again and again: in a ring of one no address byte is needed (ND21 8.2), and commands that
/// share telegrams need less than the table has.
#[test]
fn a_ring_of_one_needs_no_address_byte() {
    let mut couple = Couple::plain(1, MasterOptions::default()).ready();
    let rounds = 60;
    for n in 0..rounds {
        for address in POSITION {
            couple.submit(Job::new(0, Command::WriteWord { address, data: n }));
        }
    }
    couple.finish(2000);
    let telegrams: u64 = (u64::from(rounds) * 12).div_ceil(7);
    let net = u64::from(rounds) * 12 + telegrams + 1;
    let bytes = couple
        .bytes()
        .iter()
        .rposition(|b| *b != 0x80)
        .expect("one") as u64
        + 1;
    assert_eq!(bytes, net);
    assert!(bytes < u64::from(rounds) * position_bytes(size(1)));
}

/// With packing switched off every telegram has its address byte and one whole command (for drives whose
/// reading of short addresses is none of those that the manual leaves open, 9.2).
#[test]
fn packing_can_be_switched_off() {
    let options = MasterOptions {
        packing: Packing::NONE,
        ..MasterOptions::default()
    };
    let mut couple = Couple::plain(3, options).ready();
    for k in 0..3 {
        for address in POSITION {
            couple.submit(Job::new(k, Command::WriteWord { address, data: 1 }));
        }
    }
    couple.finish(100);
    let bytes = couple.bytes();
    for (telegram, k) in bytes.chunks(8).zip([0, 0, 1, 1, 2, 2u8]) {
        assert_eq!(telegram[..2], [0x8C, k.wrapping_sub(3)]);
    }
}

/// ND21 9.1, 9.5: five parameter bytes find room beside process data; a word to be written needs two
/// telegrams, in two rounds, and no byte more than the exchange of process data and its own six.
#[test]
fn commands_are_woven_into_process_data() {
    let mut couple = Couple::plain(3, MasterOptions::default()).ready();
    couple
        .master
        .set_exchange(&[2, 0, 1], CyclePace::Continuous)
        .expect("drives");
    let id = couple.submit(Job::new(
        1,
        Command::WriteWord {
            address: 0xFF1C,
            data: 0x1234,
        },
    ));
    couple.finish(60);
    assert_eq!(
        couple.outcome(id),
        Some(&Outcome::Done {
            perhaps_twice: false
        })
    );
    assert_eq!(
        [couple.peek(1, 0xFF1C), couple.peek(1, 0xFF1D)],
        [0x12, 0x34]
    );
    couple.steps(10);
    let expected = [
        &[0x85, 0xFD, 0, 0][..],
        &[0xEF, 0, 0, 0x63, 0x34, 0x12, 0x1C, 0xFF],
        &[0xE5, 0, 0],
        &[0x85, 0xFD, 0, 0],
        &[0xE7, 0, 0, 0xC4],
        &[0xE5, 0, 0],
    ]
    .concat();
    assert_eq!(couple.bytes()[..expected.len()], expected);
}

/// A drive that takes no part in the exchange gets a telegram between two rounds.
#[test]
fn others_are_not_starved_by_the_exchange() {
    let mut couple = Couple::plain(4, MasterOptions::default()).ready();
    couple
        .master
        .set_exchange(&[0, 1], CyclePace::Continuous)
        .expect("drives");
    let ids: Vec<_> = (0..20)
        .map(|_| couple.submit(Job::new(3, Command::ReadByte { address: 0xFE00 })))
        .collect();
    couple.finish(20 * (7 + 9));
    for id in ids {
        assert!(matches!(couple.outcome(id), Some(Outcome::Read(_))));
    }
    assert!(couple.master.counters().rounds >= 10);
}

/// Rounds on request, and at a period: values given by the caller for each.
#[test]
fn rounds_begin_when_they_are_asked_for() {
    let mut couple = Couple::plain(2, MasterOptions::default()).ready();
    for k in 0..2 {
        couple.poke(k, 0xFF32, 0x08);
        couple.poke(k, 0xFF34, 0x08);
    }
    couple
        .master
        .set_exchange(&[0, 1], CyclePace::OnRequest)
        .expect("drives");
    couple.steps(30);
    assert_eq!(couple.master.counters().rounds, 0);
    for n in 1..5u16 {
        couple.master.set_nominal(1, n).expect("a drive");
        couple.master.start_round();
        couple.steps(30);
        assert_eq!(couple.master.counters().rounds, u64::from(n));
        // DataOut is latched before DataIn is written (9.4): the actual value is the one before.
        assert_eq!(couple.master.actual(1), Some(n - 1));
    }
    let period = Span::from_millis(8);
    couple
        .master
        .set_exchange(&[0, 1], CyclePace::Every(period))
        .expect("drives");
    couple.events.clear();
    couple.steps(280);
    let rounds = rounds(&couple);
    assert_eq!(rounds.len(), 10, "{rounds:?}");
    for pair in rounds.windows(2) {
        let off = pair[1].0.since(pair[0].0).as_millis_f64() - 8.0;
        assert!(off.abs() <= 0.3, "{off}");
    }
}

/// ND21 9.1: "the master transmits telegrams continuously". With work queued at least 99.5 % of the byte
/// times carry a byte; here all do, and nearly none of them is SYNCO.
#[test]
fn the_line_has_no_gaps() {
    for drives in [1, 6, 100, 250] {
        let mut couple = Couple::plain(drives, MasterOptions::default()).ready();
        let mut jobs = 0;
        for n in 0..20_000u32 {
            while couple.master.jobs() < 400 {
                let drive = (jobs / 2 % u32::from(drives)) as u8;
                let address = POSITION[jobs as usize % 2];
                couple.submit(Job::new(drive, Command::WriteWord { address, data: 7 }));
                jobs += 1;
            }
            couple.step();
            if n == 0 {
                couple.events.clear();
            }
        }
        let carried = couple.sent.iter().filter(|(_, b)| b.is_some()).count();
        assert!(carried * 1000 >= couple.sent.len() * 995, "ring {drives}");
        // Jobs a byte time: at least as many as by the table, which has 2N jobs in 14N + 1 bytes.
        let done = couple.master.counters().done;
        let rounds = (carried as u64 - 8 - u64::from(drives)) / position_bytes(size(drives));
        assert!(
            done >= 2 * u64::from(drives) * rounds,
            "ring {drives}: {done} jobs"
        );
        assert_eq!(couple.bytes().iter().filter(|b| **b == 0x80).count(), 0);
    }
}

/// PAUSE loosens the data flow and gets no answer (ND21 9.2).
#[test]
fn pause_is_sent_on_request() {
    let mut couple = Couple::plain(2, MasterOptions::default()).ready();
    couple.master.pause(5);
    let heard = couple.heard.len();
    couple.steps(20);
    assert_eq!(couple.bytes()[..6], [0x81, 0x81, 0x81, 0x81, 0x81, 0x80]);
    assert_eq!(couple.heard.len() - heard, 15);
    assert_eq!(couple.master.counters().disturbed, 0);
}
