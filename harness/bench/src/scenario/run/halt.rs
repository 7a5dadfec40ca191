//! How a conversation ends: at its last step, at a finding, or where it cannot go on.

use super::outcome::Stop;
use super::player::Runner;
use crate::link::{Link, Trouble};
use crate::scenario::language::Language;
use crate::scenario::plan::MAX_CARRIED;
use harness_proto::time::Span;
use std::sync::atomic::Ordering;

/// How long a computer may hold bytes that a scenario has given up.
const LATE: Span = Span::from_millis(1_000);

/// Why a scenario cannot go on.
#[derive(Clone, Debug)]
pub enum Halt {
    /// It has grown too long.
    Full(String),
    /// The link carries nothing more.
    Trouble(Trouble),
}

impl<L: Language> Runner<'_, L> {
    /// Ends the conversation: nothing more is sent, and what is under way comes back. Trouble of the
    /// link outweighs every finding, as a finding may be its effect.
    pub(crate) fn wind_up(&mut self, result: Result<(), Stop>) -> Result<(), Stop> {
        let mut result = match (result, self.unseen.take()) {
            (Ok(()), Some(unseen)) => Err(unseen),
            (result, _) => result,
        };
        if let Err(stop) = &mut result {
            stop.finding.in_error = L::in_error(self);
        }
        if result.is_err() {
            self.settle();
            self.come_home();
            self.wait_for_late();
        }
        let halted = self.halted();
        let mut result = match (&self.full, result) {
            (Some(Halt::Full(_)), Err(stop)) => Err(stop),
            (_, result) => halted.and(result),
        };
        if let Err(stop) = &mut result {
            L::complete(self, &mut stop.finding);
        }
        result
    }

    /// Whether the conversation has to end here: the link is in trouble, or there is no room for more in the record. Looked at after
    /// every step and after the last bytes, since no later step may follow.
    pub fn halted(&mut self) -> Result<(), Stop> {
        self.notice();
        match &self.full {
            Some(Halt::Full(why)) => Err(Stop::aborted(self.place, why.clone())),
            Some(Halt::Trouble(trouble)) => Err(Stop::trouble(self.place, trouble)),
            None => Ok(()),
        }
    }

    /// Notes the first reason for which the conversation has to end.
    pub fn notice(&mut self) {
        if self.full.is_some() {
            return;
        }
        let carried = self.link.carried() > MAX_CARRIED;
        let carried =
            carried.then(|| format!("more than {MAX_CARRIED} bytes on the ring's links: too long"));
        let too_much = carried.or_else(|| L::too_much(&self.own));
        let interrupted = self
            .interrupt
            .is_some_and(|flag| flag.load(Ordering::Relaxed));
        let interrupted = interrupted.then_some(Trouble::Interrupted);
        let trouble = || self.link.trouble().cloned().or(interrupted);
        self.full = too_much
            .map(Halt::Full)
            .or_else(|| trouble().map(Halt::Trouble));
    }

    /// Waits for what was sent before the trouble: a denial or an interlock stops only what is sent after it. A drive that never stops
    /// sending must not fill the record.
    fn come_home(&mut self) {
        let end = self.link.now() + L::ROUND;
        let more =
            |link: &dyn Link| link.busy() && link.now() < end && link.carried() <= MAX_CARRIED;
        while more(self.link) && self.link.wait(end) {}
        self.fetch();
    }

    /// Waits for bytes that a busy computer may still hold, where time is real and fewer came than were sent. A byte that comes now was
    /// late; one that does not come is lost. After trouble neither is judged, and what the guard has denied has no answer.
    fn wait_for_late(&mut self) {
        if self.link.time_tolerance() == Span::ZERO || self.link.trouble().is_some() {
            return;
        }
        let end = self.link.now() + LATE;
        while L::lacks_answers(self) && self.link.now() < end && self.link.wait(end) {
            self.fetch();
        }
    }
}
