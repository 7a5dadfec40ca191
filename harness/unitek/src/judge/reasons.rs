//! Why a drive sends a frame: a request, a cycle, an event.

use super::cycle::{Cycle, Untimely};
use super::follower::{Follower, LONGEST_CYCLE, PendingRequest};
use super::symptom::FrameSymptom::{Time, Unasked};
use crate::language::written;
use harness_proto::time::Instant;
use harness_proto::unitek::Register;
use harness_proto::unitek::frame::Reply;
use harness_proto::unitek::words::MODE_EVENT;
use harness_sim::record::LineFrame;

impl Follower {
    /// Why the drive sends it: the request that it answers, if it is one. What nothing asks for differs.
    pub(super) fn why(
        &mut self,
        number: usize,
        frame: &LineFrame,
        reply: &Reply,
    ) -> Option<PendingRequest> {
        let register = reply.register;
        let used = self.used;
        let place = self.answered(register);
        let cycle = &mut self.cycles[usize::from(register)];
        if let Some(asked) = place.and_then(|place| self.asked.remove(place)) {
            // A frame of a cycle or an event would not show how long a reply takes.
            let may_be_other = match cycle {
                Cycle::On(running) => {
                    running.blur(frame.start);
                    true
                }
                Cycle::Unknown => self.unsolicited.contains_key(&register),
                Cycle::Off(_) => false,
            };
            if may_be_other || self.may_be_event(register, frame.start) {
                self.may_come_later(&asked, frame.start);
            } else {
                let late = frame.start.since(asked.at);
                self.slowest = Some(self.slowest.map_or(late, |slowest| slowest.max(late)));
            }
            return Some(asked);
        }
        if self.may_be_event(register, frame.start) {
            match &mut self.cycles[usize::from(register)] {
                Cycle::On(running) => running.blur(frame.start),
                // A cycle from before the first frame may send it, and goes on when events are switched off (5.2).
                Cycle::Unknown => drop(self.unsolicited.insert(register, frame.start)),
                Cycle::Off(_) => {}
            }
            return None;
        }
        let cycle = &mut self.cycles[usize::from(register)];
        let untimely = match cycle {
            Cycle::On(running) => {
                let why = running.comes(frame.start, used, self.tolerance);
                why.filter(|_| self.timed).map(|why| (why, running.every()))
            }
            Cycle::Unknown => {
                self.older_cycle(number, frame);
                None
            }
            Cycle::Off(_) => {
                let patience = self.patience;
                if !self.cycles[usize::from(register)].in_flight(frame.start, patience, !self.timed)
                {
                    let why = self.asked_elsewhere(register, frame.start);
                    self.differs(number, register, Unasked, "5.2", unasked(frame), why);
                }
                None
            }
        };
        if let Some((untimely, every)) = untimely {
            let name = Register::of(register).name;
            let (what, gap) = match untimely {
                Untimely::Gap(gap) => ("it comes".to_owned(), gap),
                Untimely::Mean(gap, count) => (format!("{count} intervals last on average"), gap),
            };
            let about = format!(
                "register {register:02X} ({name}) is asked for every {every}: {what} {gap} behind the one before"
            );
            self.breach(number, register, Time, "ex 9", about);
        }
        None
    }

    /// A frame that no request of these frames asks for: of a cycle that runs since before the first of them. Such a cycle shows itself
    /// within 254 ms, again and again.
    fn older_cycle(&mut self, number: usize, frame: &LineFrame) {
        let register = frame.frame.data().first().copied().unwrap_or(0);
        let before = self.unsolicited.get(&register).copied().or(self.begin);
        let before = before.max(self.gap);
        let longest = LONGEST_CYCLE + self.tolerance;
        if before.is_some_and(|before| frame.start.since(before) > longest) {
            let about = format!("{}: no cycle is as long", unasked(frame));
            let guessed = (self.guessed && self.slowest.is_none()).then(|| {
                format!(
                    "it has answered no request on {:03X}, and may receive on another identifier",
                    self.rx[0]
                )
            });
            let why = self.asked_elsewhere(register, frame.start).or(guessed);
            self.differs(number, register, Unasked, "5.2", about, why);
        }
        self.unsolicited.insert(register, frame.start);
    }

    /// Whether a frame can have been sent by event (ex 10).
    fn may_be_event(&self, register: u8, at: Instant) -> bool {
        let off = self.held[0x51].sure();
        let off = off.is_some_and(|mode| mode & u32::from(MODE_EVENT) == 0);
        register == 0x40 && (!off || at.since(self.mode_at) <= self.patience)
    }
}

/// What differs where nothing asks for a frame.
fn unasked(line_frame: &LineFrame) -> String {
    let register = line_frame.frame.data().first().copied().unwrap_or(0);
    let (frame, name) = (written(&line_frame.frame), Register::of(register).name);
    format!("{frame} comes, and nothing asks for register {register:02X} ({name})")
}
