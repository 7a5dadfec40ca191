//! Plays a case on a simulated line.

use super::act::{Counts, OutgoingTelegram, TelegramActKind, TelegramTalk, slot};
use crate::language::Nordac;
use crate::language::plan::SentTelegram;
use crate::simulate::{Bench, Setup};
use harness_bench::capture::runs::{HeardTelegram, said};
use harness_bench::explore::line::LineSeen;
use harness_bench::link::{AnyStimulus, DriveFault, Line, Link, Moment, PlacedFault};
use harness_bench::scenario::language::Language as _;
use harness_proto::time::{Instant, Span};
use harness_sim::nordac::Stimulus;

/// How long a case goes on after its last act.
const TAIL: Span = Span::from_millis(20);

/// What a case has shown: what the slaves sent, and each act as often as it happened.
pub(crate) type TelegramsSeen = LineSeen<HeardTelegram, PlayedAct>;

/// An act that has happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct PlayedAct {
    /// When it began.
    pub(crate) at: Instant,
    /// Its place in the case.
    pub(crate) act: usize,
    /// What was sent; `None` for what happens to a slave.
    pub(crate) sent: Option<OutgoingTelegram>,
}

/// Plays a case on fresh slaves.
#[must_use]
pub(crate) fn play(setup: &Setup, case: &TelegramTalk) -> TelegramsSeen {
    let mut bench = Bench::new(setup);
    let mut counts = Counts::default();
    let mut done = Vec::new();
    for (number, act) in case.acts.iter().enumerate() {
        for _ in 0..act.times {
            let sent = counts.outgoing(&act.what);
            done.push(PlayedAct {
                at: bench.now(),
                act: number,
                sent: sent.clone(),
            });
            match sent {
                Some(sent) => send(&mut bench, setup, sent),
                None => suffer(&mut bench, &act.what),
            }
            pass(&mut bench, act.wait());
        }
    }
    pass(&mut bench, TAIL);
    let slaves = said(&bench.trace(0)).into_iter();
    TelegramsSeen {
        said: slaves.filter(|telegram| telegram.from.is_some()).collect(),
        done,
        took: bench.now().since(Instant::START),
    }
}

/// Sends, and waits until the reply has ended, or can no longer begin.
fn send(bench: &mut Bench, setup: &Setup, sent: OutgoingTelegram) {
    let telegram = SentTelegram {
        octets: sent.octets,
        bad: sent.bad.into_iter().collect(),
    };
    Nordac::transmit(bench, 0, &[telegram]);
    loop {
        pass(bench, slot(setup.rate));
        if !bench.busy() {
            break;
        }
    }
}

/// What an act does to a slave from outside its bus.
fn suffer(bench: &mut Bench, what: &TelegramActKind) {
    let outside = |slave, stimulus| PlacedFault::Stimulus(slave, AnyStimulus::Nordac(stimulus));
    let faults = match *what {
        TelegramActKind::Link { slave, found } => vec![outside(slave, Stimulus::Link(found))],
        TelegramActKind::Fault { slave, number, on } => {
            vec![outside(slave, Stimulus::Fault(number, on))]
        }
        TelegramActKind::Restart { slave } => {
            let both = [DriveFault::Off, DriveFault::On];
            both.map(|fault| PlacedFault::Drive(slave, fault)).to_vec()
        }
        TelegramActKind::Ask(_) | TelegramActKind::Octets { .. } => Vec::new(),
    };
    for fault in faults {
        bench.inject(0, fault, Moment::Now);
    }
}

/// Lets `time` pass, and the rest of the last microsecond: scenarios have times in microseconds.
fn pass(bench: &mut Bench, time: Span) {
    let micro = Span::from_micros(1).units();
    let until = (bench.now() + time).since_start().units().div_ceil(micro) * micro;
    bench.run_to(Instant::START + Span::from_units(until));
}
