//! Makes a finding small: as long as the same kind of difference stays, acts are left out, and times and values are lowered.

use super::act::{FrameAct, FrameActKind, FrameTalk};
use super::on_sim::OnBench;
use super::oracle::FrameDifference;
use crate::explore::{Differing, ExploreError, Finding, Target};
use harness_proto::can::Frame;

/// What came of making a finding small.
#[derive(Clone, Debug)]
pub struct Smaller {
    /// The finding.
    pub finding: Finding<FrameTalk>,
    /// Whether nothing more can be taken away.
    pub complete: bool,
}

struct Shrinker {
    target: OnBench,
    best: FrameTalk,
    difference: FrameDifference,
    runs: u32,
    most: u32,
}

/// Makes a finding of simulated drives small, in at most `most` runs.
///
/// # Errors
/// The header has mistakes.
pub fn smaller(finding: &Finding<FrameTalk>, most: u32) -> Result<Smaller, ExploreError> {
    let mut shrinker = Shrinker {
        target: OnBench::new(finding.setup.under_test()?),
        best: finding.case.clone(),
        difference: finding.difference.clone(),
        runs: 0,
        most,
    };
    loop {
        let before = shrinker.best.measure();
        shrinker.acts()?;
        shrinker.times()?;
        shrinker.values()?;
        if shrinker.best.measure() == before || shrinker.is_spent() {
            break;
        }
    }
    Ok(Smaller {
        complete: !shrinker.is_spent(),
        finding: Finding {
            shrunk_in: Some(shrinker.runs),
            difference: shrinker.difference,
            case: shrinker.best,
            ..finding.clone()
        },
    })
}

impl Shrinker {
    const fn is_spent(&self) -> bool {
        self.runs >= self.most
    }

    /// Takes a smaller case if it shows the same kind of difference.
    fn offer(&mut self, case: FrameTalk) -> Result<bool, ExploreError> {
        if case.measure() >= self.best.measure() || self.is_spent() {
            return Ok(false);
        }
        self.runs += 1;
        let rehearsal = self.target.rehearse(&case)?;
        let tried = self.target.attempt(&case, &rehearsal)?;
        let same = tried.difference.filter(|own| own.is_like(&self.difference));
        let Some(difference) = same else {
            return Ok(false);
        };
        self.difference = difference;
        self.best = case;
        Ok(true)
    }

    fn change(
        &mut self,
        at: usize,
        change: impl FnOnce(&mut FrameAct),
    ) -> Result<bool, ExploreError> {
        let mut case = self.best.clone();
        if let Some(act) = case.acts.get_mut(at) {
            change(act);
        }
        self.offer(case)
    }

    /// Leaves out acts: long runs of them first. Their time is left out too, or given to the act before them.
    fn acts(&mut self) -> Result<(), ExploreError> {
        let mut length = self.best.acts.len();
        while length > 0 {
            let mut from = 0;
            while from < self.best.acts.len() {
                let to = (from + length).min(self.best.acts.len());
                let mut dropped = self.best.clone();
                let gone: u64 = dropped.acts.drain(from..to).map(|act| act.wait_us).sum();
                let mut waits = dropped.clone();
                if let Some(act) = from.checked_sub(1).and_then(|at| waits.acts.get_mut(at)) {
                    act.wait_us += gone;
                }
                if !self.offer(dropped)? && !self.offer(waits)? {
                    from += length;
                }
            }
            length /= 2;
        }
        Ok(())
    }

    /// Lowers waits: to none, to that of a reply, to whole milliseconds, by halves.
    fn times(&mut self) -> Result<(), ExploreError> {
        for at in 0..self.best.acts.len() {
            let own = self.best.acts[at].wait_us;
            let round = own / 1_000 * 1_000;
            let steps = [0, 1_000, 2_000, 5_000, 10_000, 50_000, own / 2, round];
            for wait in steps.into_iter().filter(|wait| *wait < own) {
                if self.change(at, |act| act.wait_us = wait)? {
                    break;
                }
            }
        }
        Ok(())
    }

    /// Shortens frames and lowers their bytes behind the register.
    fn values(&mut self) -> Result<(), ExploreError> {
        for at in 0..self.best.acts.len() {
            let FrameActKind::Send(frame) = self.best.acts[at].what else {
                continue;
            };
            if frame.is_remote() {
                continue;
            }
            for length in 0..frame.dlc() {
                let shorter = Frame::new(frame.id(), &frame.data()[..length]);
                if let Ok(shorter) = shorter
                    && self.change(at, |act| act.what = FrameActKind::Send(shorter))?
                {
                    break;
                }
            }
            self.bytes(at)?;
        }
        Ok(())
    }

    fn bytes(&mut self, at: usize) -> Result<(), ExploreError> {
        let length = match &self.best.acts[at].what {
            FrameActKind::Send(frame) => frame.dlc(),
            _ => 0,
        };
        for index in 1..length {
            let FrameActKind::Send(frame) = self.best.acts[at].what else {
                break;
            };
            let own = frame.data()[index];
            for byte in [0, 1, own & 0x0F, own / 2]
                .into_iter()
                .filter(|byte| *byte < own)
            {
                let mut data = frame.data().to_vec();
                data[index] = byte;
                let lower = Frame::new(frame.id(), &data);
                if let Ok(lower) = lower
                    && self.change(at, |act| act.what = FrameActKind::Send(lower))?
                {
                    break;
                }
            }
        }
        Ok(())
    }
}
