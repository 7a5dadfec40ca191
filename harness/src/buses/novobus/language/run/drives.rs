//! What a step does to drives, and what it waits for or reads of them.

use super::Runner;
use super::look::{Miss, judge};
use crate::buses::novobus::language::plan::{LOOK, NumberCheck, PlannedDriveCheck};
use crate::buses::novobus::language::syntax::Influence;
use crate::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use crate::scenario::problem::TextSpan;
use crate::scenario::run::outcome::Stop;
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

impl Runner<'_> {
    /// Lets time pass until a check holds. What was sent before goes on its way meanwhile.
    pub(crate) fn until(
        &mut self,
        check: &PlannedDriveCheck,
        within: Span,
        span: TextSpan,
    ) -> Result<(), Stop> {
        let end = self.link.now() + within + self.asking_time(check);
        loop {
            let now = self.link.now();
            self.line_before = now;
            self.ask_for(check);
            let seen = if now < end {
                self.glance(check)
            } else {
                self.look(check)
            };
            match seen {
                Err(Miss::Otherwise(message)) if now >= end => {
                    let message = format!("not within {within}: {message}");
                    return Err(Stop::failed(span, message));
                }
                Err(Miss::Otherwise(_)) => {
                    self.own.recorder.count_look();
                    self.pass_until(end.min(now + LOOK));
                    // The caller that plays the step reports why there is no room.
                    if self.full.is_some() {
                        return Ok(());
                    }
                }
                seen => return self.judged(seen, span),
            }
        }
    }

    /// What a look at drives is for the verdict. What the link does not show does not end the scenario.
    pub(crate) fn judged(&mut self, seen: Result<(), Miss>, span: TextSpan) -> Result<(), Stop> {
        match seen {
            Ok(()) => Ok(()),
            Err(Miss::Otherwise(message)) => Err(Stop::failed(span, message)),
            Err(Miss::Unseen(message)) => {
                let first = self.unseen.take();
                self.unseen = first.or_else(|| Some(Stop::inconclusive(span, message)));
                Ok(())
            }
        }
    }

    /// The number in an answer that has just come whole.
    pub(crate) fn read(
        &self,
        ring: usize,
        answer: usize,
        reading: Option<&NumberCheck>,
        span: TextSpan,
    ) -> Result<(), Stop> {
        let Some(reading) = reading else {
            return Ok(());
        };
        let record = &self.ports[ring];
        let answer = &record.received[record.next - answer..record.next];
        let bytes: Vec<_> = reading.bytes.iter().map(|i| answer[*i].1.byte).collect();
        let units = self.plan.units(ring, reading.drive);
        judge(&reading.cell, &bytes, units).map_err(|message| {
            let prefix = if ring == 0 { "" } else { "2:" };
            Stop::failed(span, format!("drive {prefix}{}: {message}", reading.drive))
        })
    }
}
