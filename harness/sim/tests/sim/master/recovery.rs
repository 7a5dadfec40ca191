//! Recovery: the example of ND21 9.8 byte by byte, and every single bit on every link (9.7).

use super::common::Couple;
use harness_proto::line::Received;
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::ram;
use harness_proto::novobus::check_sequence::CHECK_SEQUENCE;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::decode::Decoded;
use harness_proto::novobus::master::{
    CyclePace, Event, Fault, Job, LinkEnd, MasterOptions, Outcome, Packing, Phase, RingLink,
};
use harness_proto::novobus::output::OutputChange;
use harness_proto::novobus::sync::SYNCO;
use harness_proto::novobus::telegram::{Address, Telegram};
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::novobus::counted::Counted;
use std::collections::BTreeSet;

fn flip(data: u8) -> LinkFault {
    LinkFault::Flip(Flips {
        data,
        ..Flips::default()
    })
}

/// ND21 9.7 and 9.8: 100 drives, a bit of the fourth byte of the second telegram damaged between drive
/// 98 and drive 97. The master reads 61 = 97 and repeats the telegrams for 96 to 99; the check sequence
/// and the telegrams are those of the print.
#[test]
fn the_example_of_9_8_byte_by_byte() {
    let options = MasterOptions {
        packing: Packing::NONE,
        ..MasterOptions::default()
    };
    let mut couple = Couple::plain(100, options).ready();
    for k in 95..100 {
        couple.poke(k, 0xFE13, 0x88);
    }
    let ids: Vec<_> = (95..100)
        .map(|k| couple.submit(Job::new(k, Command::ReadByte { address: 0xFE13 })))
        .collect();
    couple
        .ring
        .arm_link(2, couple.master.counters().sent + 6 + 4, flip(1));
    let heard = couple.heard.len();
    couple.finish(500);

    let telegram = |k: u8| [0x88, k.wrapping_sub(100), 0xC0, 0x13, 0xFE, 0xD1];
    let expected = [
        (95..100).flat_map(telegram).collect(),
        // The wrong byte was the 10th; it comes back 101 byte times later. 35 bytes settle the address.
        vec![SYNCO; 9 + 101 + 34 - 30],
        CHECK_SEQUENCE.to_vec(),
        vec![SYNCO; 100],
        (96..100).flat_map(telegram).collect(),
    ]
    .concat();
    assert_eq!(couple.bytes()[..expected.len()], expected);
    assert_eq!(
        expected[144..166],
        [
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0x44, 0x72, 0x4C, 0x41
        ]
    );
    // What the master hears, by the last column of the table of 9.7: telegram 95 with its answer, the
    // first three bytes of the next one, zeros, and in the end 61 for ever.
    // A hundred SYNCO were under way before the first telegram.
    let heard = &couple.heard[heard + 101..];
    let start = [0x88, 0x5F, 0xC0, 0x13, 0x88, 0xA5, 0x88, 0x60, 0xC0, 0x00];
    assert_eq!(heard[..10], start.map(Received::good));
    assert_eq!(heard[9 + 34], Received::good(0x61));

    let link = RingLink {
        from: LinkEnd::Drive(98),
        to: LinkEnd::Drive(97),
    };
    let events: Vec<_> = couple.events.iter().map(|(_, e)| e.clone()).collect();
    assert_eq!(
        events[1..3],
        [
            Event::Disturbed {
                fault: Fault::Damaged(link),
                attempt: 1
            },
            Event::Recovered { attempts: 1 }
        ]
    );
    for id in ids {
        let Some(Outcome::Read(data)) = couple.outcome(id) else {
            panic!("{events:?}");
        };
        assert_eq!(data.value(), Some(0x88));
    }
    assert_eq!(couple.master.counters().corrected, 1);
    assert_eq!(couple.master.counters().repeated, 4);
    assert!(couple.healthy());
}

/// Every single bit, and what else a receiver cannot but notice.
fn noticed_faults() -> Vec<LinkFault> {
    let mut all: Vec<_> = (0..8).map(|bit| flip(1 << bit)).collect();
    for (parity, stop) in [(true, false), (false, true)] {
        all.push(LinkFault::Flip(Flips {
            data: 0,
            parity,
            stop,
            start: false,
        }));
    }
    all.push(LinkFault::Overrun);
    all.push(LinkFault::Break(Span::from_millis(1)));
    all
}

/// A conversation with every form of a telegram: address byte, same and next, with and without process
/// data, commands whole, shared and cut, and SYNCO.
fn conversation(couple: &mut Couple) -> Vec<(Job, harness_proto::novobus::master::JobId)> {
    let drives = couple.ring.size().drives();
    let mut ids = Vec::new();
    let mut submit = |couple: &mut Couple, drive: u8, command| {
        let job = Job::new(drive % drives, command);
        ids.push((job, couple.submit(job)));
    };
    let word = Command::WriteWord {
        address: 0xFF08,
        data: 0x1234,
    };
    for k in 0..drives {
        submit(couple, k, Command::ReadByte { address: 0xFE13 });
    }
    submit(couple, 0, word);
    submit(couple, 0, Command::ReadWord { address: 0xFF08 });
    submit(couple, 1, Command::ReadLong { address: 0xFF08 });
    submit(
        couple,
        2,
        Command::WriteByte {
            address: 0xFE00,
            data: 0,
        },
    );
    let output = OutputChange::from_code(3).expect("set GPO2");
    submit(couple, 2, Command::WriteIo(output));
    couple.steps(40);
    let all: Vec<u8> = (0..drives).collect();
    couple
        .master
        .set_exchange(&all, CyclePace::OnRequest)
        .expect("drives");
    for _ in 0..4 {
        couple.master.start_round();
    }
    submit(couple, 3, word);
    submit(
        couple,
        3,
        Command::Or {
            address_low: 0x20,
            data: 0x81,
        },
    );
    submit(
        couple,
        1,
        Command::And {
            address_low: 0x21,
            data: 0x0F,
        },
    );
    couple.steps(80);
    ids
}

/// ND21 9.7: the drive that is named is the one behind the damaged link, for every bit of every byte on
/// every link; the last link is named as well, by the master itself. All jobs are done in the end.
#[test]
fn every_single_bit_blames_the_right_link() {
    let mut runs = 0;
    let mut forms = BTreeSet::new();
    for drives in 1..=4u8 {
        let sound = Couple::plain(drives, MasterOptions::default());
        let mut counting = sound;
        counting.steps(usize::from(drives) + 6);
        conversation(&mut counting);
        let bytes = counting.master.counters().sent;
        assert_eq!(counting.master.counters().disturbed, 0);
        forms.extend(forms_in(&counting.bytes()));
        for link in 0..=usize::from(drives) {
            let damaged = RingLink {
                from: match link {
                    0 => LinkEnd::Master,
                    _ => LinkEnd::Drive(drives - link as u8),
                },
                to: match drives.checked_sub(link as u8 + 1) {
                    Some(k) => LinkEnd::Drive(k),
                    None => LinkEnd::Master,
                },
            };
            for byte in 1..=bytes - 10 {
                for fault in noticed_faults() {
                    let place = || format!("ring {drives}, link {link}, byte {byte}, {fault}");
                    runs += 1;
                    let mut couple = Couple::plain(drives, MasterOptions::default());
                    couple.ring.arm_link(link, byte, fault);
                    couple.steps(usize::from(drives) + 6);
                    let jobs = conversation(&mut couple);
                    couple.steps(400);
                    assert_eq!(
                        couple.master.jobs(),
                        0,
                        "{} {:?} {:?}",
                        place(),
                        couple.events,
                        couple.master.phase()
                    );
                    couple.steps(80);
                    let faults: Vec<_> = couple
                        .events
                        .iter()
                        .filter_map(|(_, event)| match event {
                            Event::Disturbed { fault, attempt } => Some((*fault, *attempt)),
                            _ => None,
                        })
                        .collect();
                    assert_eq!(faults, [(Fault::Damaged(damaged), 1)], "{}", place());
                    assert_eq!(couple.master.counters().corrected, 1, "{}", place());
                    assert_eq!(couple.master.counters().rounds, 4, "{}", place());
                    assert_eq!(couple.master.phase(), Phase::Running, "{}", place());
                    assert!(couple.healthy(), "{}", place());
                    for (job, id) in jobs {
                        let outcome = couple.outcome(id);
                        let done = matches!(outcome, Some(Outcome::Done { .. } | Outcome::Read(_)));
                        assert!(done, "{job:?} {outcome:?} {}", place());
                    }
                }
            }
        }
    }
    assert_eq!(forms.len(), 9, "{forms:?}");
    // More than 100 bytes on 2 + 3 + 4 + 5 links, 10 bits and two faults more each.
    assert!(runs > 14 * 12 * 100, "{runs}");
}

/// The forms of telegrams in a stream: with which address, with process data, with parameter bytes. Of
/// the telegrams without net bytes (9.2) the master needs none.
fn forms_in(mut bytes: &[u8]) -> BTreeSet<(&'static str, bool, bool)> {
    let mut forms = BTreeSet::new();
    while !bytes.is_empty() {
        let used = match Telegram::decode(bytes) {
            Decoded::Value { value, used } => {
                let address = match value.address() {
                    Address::Byte(_) => "address byte",
                    Address::SameDrive => "same",
                    Address::NextDrive => "next",
                };
                let process_data = value.process_data().is_some();
                forms.insert((address, process_data, !value.parameters().is_empty()));
                used
            }
            _ => 1,
        };
        bytes = &bytes[used..];
    }
    forms
}

/// A second fault at any byte of the recovery from a first one, on any link: the jobs are still
/// done, a job that ran once is reported as run once, and the ring is sound (9.8, 11.5).
#[test]
fn a_second_fault_during_the_recovery_does_no_harm() {
    let write = |k: u8| Command::WriteWord {
        address: 0xFE20 + 2 * u16::from(k),
        data: 0x1234,
    };
    let second = [
        flip(0x10),
        LinkFault::Drop,
        LinkFault::Duplicate,
        LinkFault::Insert(0),
    ];
    for drives in 1..=4u8 {
        for link in 0..=usize::from(drives) {
            for (byte, fault) in (0..170).flat_map(|byte| second.map(|fault| (byte, fault))) {
                let place = || format!("ring {drives}, link {link}, byte {byte}, {fault}");
                let mut couple =
                    Couple::new(drives, MasterOptions::default(), |_| Counted::new(false));
                couple.steps(usize::from(drives) + 6);
                let sent = couple.master.counters().sent;
                couple
                    .ring
                    .arm_link(usize::from(drives) / 2, sent + 4, flip(1));
                couple.ring.arm_link(link, sent + 5 + byte, fault);
                let ids: Vec<_> = (0..8)
                    .map(|n| (n, couple.submit(Job::new(n % drives, write(n)))))
                    .collect();
                couple.finish(4_000);
                couple.steps(120);
                let read = couple.submit(Job::new(0, Command::ReadByte { address: 0xFE20 }));
                couple.finish(2_000);
                assert!(
                    matches!(couple.outcome(read), Some(Outcome::Read(_))),
                    "{}",
                    place()
                );
                assert!(couple.healthy(), "{}", place());
                for (n, id) in ids {
                    let Some(Outcome::Done { perhaps_twice }) = couple.outcome(id) else {
                        panic!("{:?} {}", couple.outcome(id), place());
                    };
                    let drive = couple.ring.drive(n % drives).expect("a drive");
                    let runs = drive.memory.written(0xFE20 + 2 * u16::from(n));
                    assert!(
                        runs == 1 || runs > 1 && *perhaps_twice,
                        "{runs} {}",
                        place()
                    );
                }
            }
        }
    }
}

/// ND21 9.8, 9.9: a sound ring whose drives monitor time-outs runs again after silences of any length between telegrams.
#[test]
fn a_sound_ring_runs_again_after_silences() {
    for drives in [1, 2, 5, 12, 250] {
        let mut couple = Couple::plain(drives, MasterOptions::default()).ready();
        (0..drives).for_each(|drive| couple.poke(drive, ram::FLAGS2, flags2::MONITORING));
        for millis in [500, 23, 500, 41] {
            couple.steps(usize::from(drives) + 10);
            let silent = couple.ring.now() + Span::from_millis(millis);
            couple.ring.run_until(silent);
            let id = couple.submit(Job::new(0, Command::ReadByte { address: 0xFE13 }));
            couple.finish(40_000);
            let outcome = couple.outcome(id);
            let events = &couple.events;
            assert!(
                matches!(outcome, Some(Outcome::Read(_))),
                "{drives}, {millis} ms: {outcome:?} {events:?}"
            );
        }
    }
}
