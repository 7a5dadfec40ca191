//! What a step does to drives, and what it waits for or reads of them.

use super::Runner;
use super::look::{Miss, judge};
use crate::language::plan::{LOOK, NumberCheck, PlannedDriveCheck};
use crate::language::syntax::Influence;
use harness_bench::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::Stop;
use harness_proto::time::Span;
use std::ops::RangeInclusive;

impl Influence {
    /// Lets it happen to drives, now.
    pub(crate) fn act(&self, link: &mut dyn Link, ring: usize, drives: RangeInclusive<u8>) {
        for drive in drives {
            match self {
                Self::Stimuli(stimuli) => {
                    for stimulus in stimuli {
                        let fault = PlacedFault::Stimulus(drive, AnyStimulus::Novobus(*stimulus));
                        link.inject(ring, fault, Moment::Now);
                    }
                }
                Self::Power(on) => {
                    let fault = if *on { DriveFault::On } else { DriveFault::Off };
                    let fault = PlacedFault::Drive(drive, fault);
                    link.inject(ring, fault, Moment::Now);
                }
            }
        }
    }
}

/// Lets time pass until a check holds. What was sent before goes on its way meanwhile.
pub(crate) fn until(
    runner: &mut Runner<'_>,
    check: &PlannedDriveCheck,
    within: Span,
    span: TextSpan,
) -> Result<(), Stop> {
    let end = runner.link.now() + within + super::over_bus::asking_time(runner, check);
    loop {
        let now = runner.link.now();
        runner.line_before = now;
        super::over_bus::ask_for(runner, check);
        let seen = if now < end {
            super::look::glance(runner, check)
        } else {
            super::look::look(runner, check)
        };
        match seen {
            Err(Miss::Otherwise(message)) if now >= end => {
                let message = format!("not within {within}: {message}");
                return Err(Stop::failed(span, message));
            }
            Err(Miss::Otherwise(_)) => {
                runner.own.recorder.count_look();
                runner.pass_until(end.min(now + LOOK));
                // The caller that plays the step reports why there is no room.
                if runner.full.is_some() {
                    return Ok(());
                }
            }
            seen => return judged(runner, seen, span),
        }
    }
}

/// What a look at drives is for the verdict. What the link does not show does not end the scenario.
pub(crate) fn judged(
    runner: &mut Runner<'_>,
    seen: Result<(), Miss>,
    span: TextSpan,
) -> Result<(), Stop> {
    match seen {
        Ok(()) => Ok(()),
        Err(Miss::Otherwise(message)) => Err(Stop::failed(span, message)),
        Err(Miss::Unseen(message)) => {
            let first = runner.unseen.take();
            runner.unseen = first.or_else(|| Some(Stop::inconclusive(span, message)));
            Ok(())
        }
    }
}

/// The number in an answer that has just come whole.
pub(crate) fn read(
    runner: &Runner<'_>,
    ring: usize,
    answer: usize,
    reading: Option<&NumberCheck>,
    span: TextSpan,
) -> Result<(), Stop> {
    let Some(reading) = reading else {
        return Ok(());
    };
    let record = &runner.ports[ring];
    let answer = &record.received[record.next - answer..record.next];
    let bytes: Vec<_> = reading.bytes.iter().map(|i| answer[*i].1.byte).collect();
    let units = runner.plan.units(ring, reading.drive);
    judge(&reading.cell, &bytes, units).map_err(|message| {
        let prefix = if ring == 0 { "" } else { "2:" };
        Stop::failed(span, format!("drive {prefix}{}: {message}", reading.drive))
    })
}
