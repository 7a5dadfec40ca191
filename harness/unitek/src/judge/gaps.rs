//! Gaps of a log: what was due in one accuses no drive, and what never comes after them does.

use super::cycle::Cycle;
use super::follower::{Follower, Homing, PendingRequest};
use super::symptom::FrameSymptom::Missing;
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Register;

/// So often may something be missing after a gap of the log.
const MOST: usize = 3;

/// Why it accuses no drive.
const IN_A_GAP: &str =
    "the log has a gap in which it may have come, or in which a request of a host may be missing";

impl Follower {
    /// The log has a gap in front of frame `number`. From now on the frames come at times that do not count it.
    pub(super) fn gap(&mut self, number: usize, at: Instant, silence: Span) {
        let all = self.asked.drain(..);
        let (waits, known): (Vec<_>, Vec<_>) = all.partition(|asked| asked.excused);
        waits.iter().for_each(|asked| self.unanswered(asked));
        self.asked = known.into();
        for asked in &mut self.asked {
            (asked.excused, asked.sure, asked.at) = (asked.sure, false, at);
        }
        for register in 0..=u8::MAX {
            let cycle = &mut self.cycles[usize::from(register)];
            match cycle {
                Cycle::On(running) => {
                    let due = running.is_missing(at + silence, self.patience);
                    running.owed += usize::from(due);
                    running.blur(at);
                }
                // A host may have asked for it in the gap.
                Cycle::Off(_) => *cycle = Cycle::Unknown,
                Cycle::Unknown => {}
            }
            self.owes_too_long(number, register);
        }
        (self.gap, self.named) = (Some(at), false);
        if self.homes == Homing::Ended {
            self.homes = Homing::Perhaps;
        }
        let mut other = self.restarted(at + silence);
        other.cycles.fill(Cycle::Unknown);
        self.supply
            .has_gap(other, self.judged.breaches.len(), number, at);
    }

    /// The place of the request that a reply answers: one after the last gap of the log, where there is one.
    pub(super) fn answered(&self, register: u8) -> Option<usize> {
        let place = |excused: bool| {
            let mut asked = self.asked.iter();
            asked.position(|asked| asked.register == register && asked.excused == excused)
        };
        place(false).or_else(|| place(true))
    }

    /// A request has found no reply.
    pub(super) fn unanswered(&mut self, asked: &PendingRequest) {
        let register = asked.register;
        let name = Register::of(register).name;
        let about = format!("the request for register {register:02X} ({name}) is not answered");
        self.excused += usize::from(asked.excused);
        let excused = asked.excused && self.excused <= MOST;
        if asked.sure || asked.excused {
            let why = excused.then(|| IN_A_GAP.to_owned());
            self.differs(asked.frame, register, Missing, "5.2", about, why);
        }
    }

    /// A cycle of which a frame was due in gaps and has not come since ends, or another one begins.
    pub(super) fn owes(&mut self, number: usize, register: u8) {
        if let Cycle::On(running) = &mut self.cycles[usize::from(register)]
            && std::mem::take(&mut running.owed) > 0
        {
            let about = running.not_there(register);
            let why = Some(IN_A_GAP.to_owned());
            self.differs(number, register, Missing, "ex 9", about, why);
        }
    }

    fn owes_too_long(&mut self, number: usize, register: u8) {
        if let Cycle::On(running) = &mut self.cycles[usize::from(register)]
            && running.owed > MOST
        {
            (running.owed, running.sure) = (0, false);
            let about = running.not_there(register);
            self.breach(number, register, Missing, "ex 9", about);
        }
    }

    /// The log ends: what waits after a gap did not come.
    pub(super) fn owes_at_the_end(&mut self, number: usize) {
        (0..=u8::MAX).for_each(|register| self.owes(number, register));
        for asked in std::mem::take(&mut self.asked) {
            if asked.excused {
                self.unanswered(&asked);
            }
            self.asked.push_back(asked);
        }
    }
}
