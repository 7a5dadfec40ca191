//! A hostile ring: random bytes, replies that never end, floods, silence, and a caller that calls in any
//! order. The master never panics, never hangs and never grows; and a sound ring is taken up again.

use super::common::{Random, repeat, seed, size};
use harness_proto::line::{LineError, Rate, Received};
use harness_proto::novobus::command::{Command, LAYOUTS};
use harness_proto::novobus::master::{
    CyclePace, Event, Job, Master, MasterOptions, Outcome, Packing, Phase,
};
use harness_proto::novobus::sync::SYNCO;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

const CASES: u64 = 400;
const CALLS: u64 = 4_000;

/// How a hostile ring makes up its bytes.
#[derive(Clone, Copy)]
enum Ring {
    /// At random.
    Noise,
    /// What was sent, as if there were no drive.
    Echo,
    /// Always the same.
    Same(u8),
    /// Check sequences without end.
    Sequences,
    /// Bytes that mean something, in any order.
    Words,
    /// None at all.
    Silence,
}

impl Ring {
    fn any(random: &mut Random) -> Self {
        match random.below(7) {
            0 => Self::Noise,
            1 => Self::Echo,
            2 => Self::Same(random.below(256) as u8),
            3 => Self::Sequences,
            4 | 5 => Self::Words,
            _ => Self::Silence,
        }
    }

    fn byte(self, random: &mut Random, sent: u8, n: u64) -> Option<Received> {
        let byte = match self {
            Self::Noise => random.below(256) as u8,
            Self::Echo => sent,
            Self::Same(byte) => byte,
            Self::Sequences => [0xFF, 0x44, 0x72, 0x4C, 0x41][n as usize % 5],
            Self::Words => match random.below(5) {
                0 => 0,
                1 => SYNCO,
                2 => sent,
                3 => random.below(8) as u8,
                _ => LAYOUTS[random.below(10) as usize].code,
            },
            Self::Silence => return None,
        };
        let error = match random.below(60) {
            0 => Some(LineError::Parity),
            1 => Some(LineError::Break),
            _ => None,
        };
        Some(Received { byte, error })
    }
}

fn command(random: &mut Random) -> Command {
    let address = random.below(0x1_0000) as u16;
    let data = random.below(0x1_0000) as u16;
    match random.below(6) {
        0 => Command::ReadByte { address },
        1 => Command::ReadLong { address },
        2 => Command::WriteWord { address, data },
        3 => Command::And {
            address_low: address as u8,
            data: data as u8,
        },
        4 => Command::ResetH8,
        _ => Command::ReadWord {
            address: address | 0xFD80,
        },
    }
}

#[test]
fn a_hostile_ring_does_no_harm() {
    let mut stopped = 0;
    for case in 0..CASES {
        let mut random = Random(seed().wrapping_mul(CASES).wrapping_add(case));
        let place = || format!("case {case}; {}", repeat("a_hostile_ring"));
        let drives = 1 + random.below(250) as u8;
        let options = MasterOptions {
            capacity: random.below(40) as u16,
            attempts: random.below(20) as u8,
            packing: if random.below(2) == 0 {
                Packing::ALL
            } else {
                Packing::NONE
            },
            slack: Span::from_millis(random.below(30)),
            check_first: random.below(2) == 0,
            ..MasterOptions::default()
        };
        let rate = Rate::ALL[random.below(3) as usize];
        let mut master = Master::new(size(drives), rate, options);
        let slack = options.slack.units() / rate.byte_time().units();
        let most_under_way = usize::from(drives) + 1 + slack as usize + 2;
        let mut ring = Ring::any(&mut random);
        let (mut now, mut sent, mut open) = (Instant::START, SYNCO, BTreeSet::new());
        let mut others = 0;
        for n in 0..CALLS {
            if random.below(300) == 0 {
                ring = Ring::any(&mut random);
            }
            match random.below(12) {
                0 => {
                    let job = Job::new(random.below(256) as u8, command(&mut random));
                    if let Ok(id) = master.submit(job) {
                        assert!(open.insert(id), "{}", place());
                    }
                }
                1 => {
                    let drives: Vec<u8> = (0..random.below(9))
                        .map(|_| random.below(256) as u8)
                        .collect();
                    let pace = match random.below(3) {
                        0 => CyclePace::Continuous,
                        1 => CyclePace::Every(Span::from_millis(random.below(20))),
                        _ => CyclePace::OnRequest,
                    };
                    let _may_be_refused = master.set_exchange(&drives, pace);
                    let _may_be_refused = master.set_nominal(random.below(256) as u8, 7);
                    master.start_round();
                    master.pause(random.below(5) as u16);
                }
                2..=6 => sent = master.poll_transmit(now).unwrap_or(sent),
                // A flood comes in without a byte of the master's in between.
                7..=9 => {
                    if let Some(received) = ring.byte(&mut random, sent, n) {
                        master.handle_byte(now, received);
                    }
                }
                10 => {
                    if random.below(4) == 0 {
                        // The caller was away for a while.
                        now += Span::from_millis(random.below(200));
                    }
                    master.handle_timeout(now);
                }
                _ => {
                    for _ in 0..random.below(20) {
                        match master.poll_event() {
                            Some(Event::Ended { id, .. }) => {
                                assert!(open.remove(&id), "{}", place());
                            }
                            Some(_) => others += 1,
                            None => break,
                        }
                    }
                }
            }
            if random.below(3) > 0 {
                now += rate.byte_time();
            }
            assert!(master.under_way() <= most_under_way, "{}", place());
            assert!(open.len() <= usize::from(options.capacity), "{}", place());
        }
        // Nothing more is ever heard: it ends, with every job accounted for.
        for _ in 0..250_000 {
            if master.phase() == Phase::Stopped {
                break;
            }
            master.poll_transmit(now);
            now += rate.byte_time();
            master.handle_timeout(now);
        }
        assert_eq!(master.phase(), Phase::Stopped, "{}", place());
        assert_eq!(master.poll_transmit(now), None);
        assert_eq!(master.poll_timeout(), None);
        let mut waiting = 0;
        while let Some(event) = master.poll_event() {
            match event {
                Event::Ended { id, outcome } => {
                    assert!(open.remove(&id), "{}", place());
                    let named = matches!(outcome, Outcome::Failed(_) | Outcome::Unknown(_));
                    assert!(named || n_read(&outcome), "{}", place());
                }
                Event::Stopped(_) => stopped += 1,
                _ => waiting += 1,
            }
        }
        assert!(open.is_empty(), "{}", place());
        assert!(waiting <= 65, "{waiting} events waited, {}", place());
        assert!(others < 20_000);
    }
    assert!(stopped > 0);
}

/// An answer that came right before the end.
fn n_read(outcome: &Outcome) -> bool {
    matches!(outcome, Outcome::Read(_) | Outcome::Done { .. })
}
