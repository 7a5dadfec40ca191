//! What may have happened in a silence, which no frame shows. A supply may have been switched off and on: a drive then loses what was written and
//! not stored, and its cycles. In a gap of the log anything may have been written.

use super::cycle::Cycle;
use super::follower::Follower;
use super::held::Contents;
use super::symptom::FrameSymptom::Missing;
use harness_proto::time::{Instant, Span};
use std::collections::BTreeMap;

/// In this time a drive can be switched off and be back; it is longer than the longest cycle, so that none runs meanwhile.
const RESTART: Span = Span::from_millis(300);

/// Frames that are missing at least where nothing but their absence shows that a drive was off.
const OFF: usize = 2;

/// What is known of the supply.
#[derive(Debug, Default)]
pub(super) struct Supply {
    /// It is known not to have failed.
    always_on: bool,
    /// When the last frame of the drive had ended.
    pub(super) sent: Option<Instant>,
    /// Number of differences when the last silence had ended.
    pub(super) breaches: usize,
    /// Registers that were written and not stored: what each held before, where that is known, and when it was last written.
    written: BTreeMap<u8, (Option<u32>, Instant)>,
    /// When the last silence began, and the frame that ended it.
    silent: Instant,
    ended: usize,
    /// What the frames since the last silence show of a drive that was switched off and on in it, or was written to in a gap of the log.
    pub(super) restarted: Option<Box<Follower>>,
    /// The last silence is a gap of the log.
    is_gap: bool,
    /// The log has gaps, in which what reads as before may have been written, so that it refutes nothing.
    has_gaps: bool,
}

impl Supply {
    pub(super) fn always_on() -> Self {
        Self {
            always_on: true,
            ..Self::default()
        }
    }

    /// Whether a frame of the drive that begins at `at` at the latest ends a silence in which a restart fits.
    pub(super) fn may_have_failed(&mut self, at: Instant) -> bool {
        // A drive that has sent nothing yet is silent since the last write to it.
        let wrote = || self.written.values().map(|write| write.1).max();
        let last = self.sent.or_else(wrote).filter(|_| !self.always_on);
        let silent = last.filter(|last| at.since(*last) >= RESTART);
        self.silent = silent.unwrap_or(self.silent);
        silent.is_some()
    }

    /// Since the silence that frame `ended` has ended, a drive may be this one; there were `breaches` before.
    pub(super) fn may_be(&mut self, other: Follower, breaches: usize, ended: usize) {
        (self.breaches, self.ended, self.is_gap) = (breaches, ended, false);
        self.restarted = Some(Box::new(other));
    }

    /// As [`Self::may_be`], after a gap of the log that ends at `at`.
    pub(super) fn has_gap(&mut self, other: Follower, breaches: usize, ended: usize, at: Instant) {
        self.may_be(other, breaches, ended);
        (self.is_gap, self.has_gaps, self.sent) = (true, true, Some(at));
    }

    /// A register was written at `at`, and certainly held `before` until then, if that is known.
    pub(super) fn wrote(&mut self, register: u8, before: Option<u32>, at: Instant) {
        self.written.entry(register).or_insert((before, at)).1 = at;
    }

    /// Registers were stored or loaded.
    pub(super) fn stored(&mut self) {
        self.written.clear();
    }

    /// A register reads `value`, which was written to it: if it was written before the silence and held something else until then, the
    /// supply has not failed.
    pub(super) fn kept(&mut self, register: u8, value: u32) {
        let written = self.written.get(&register);
        let differs = |write: &(Option<u32>, Instant)| {
            write.0.is_some_and(|before| before != value) && write.1 <= self.silent
        };
        if written.is_some_and(differs) && !self.has_gaps {
            self.restarted = None;
        }
    }
}

impl Follower {
    /// The same drive that sends at `at`, switched off and on: nothing is known of its registers but what was written too late to be lost, and
    /// what was asked for before may be lost.
    pub(super) fn restarted(&self, at: Instant) -> Self {
        let (Some(rx), Some(tx)) = (self.rx.first(), self.tx.first()) else {
            return Self::new(self.drive, (0, 0));
        };
        let mut follower = Self::new(self.drive, (*rx, *tx));
        follower.held.fill(Contents::any());
        let late = |written: &Instant| at.since(*written) + self.tolerance < RESTART;
        let written = self.supply.written.iter();
        let written = written.map(|(register, (_, at))| (*register, *at));
        let kept: BTreeMap<u8, Instant> = written.filter(|(_, at)| late(at)).collect();
        for register in kept.keys() {
            let place = usize::from(*register);
            follower.held[place] = self.held[place].clone();
        }
        follower.mode_at = self.mode_at;
        // No cycle survives; one that was asked for in the silence may run, or not.
        follower.cycles = self.cycles.map(|cycle| match cycle {
            Cycle::On(_) => Cycle::Unknown,
            Cycle::Off(_) | Cycle::Unknown => Cycle::Off(Instant::START),
        });
        (follower.rx, follower.tx) = (self.rx.clone(), self.tx.clone());
        (follower.second, follower.other_rate) = (self.second.clone(), self.other_rate);
        follower.asked = self.asked.clone();
        for asked in &mut follower.asked {
            (asked.sure, asked.excused) = (false, false);
            let written = kept.get(&asked.register);
            if written.is_none_or(|written| *written > asked.at) {
                asked.held = Contents::any();
            }
        }
        (follower.slowest, follower.short_map) = (self.slowest, self.short_map);
        (follower.others, follower.used) = (self.others.clone(), self.used);
        follower.elsewhere = self.elsewhere.clone();
        // A restart makes no register writable.
        follower.refused = self.refused.clone();
        follower.guessed = self.guessed;
        (follower.patience, follower.tolerance) = (self.patience, self.tolerance);
        follower.supply = Supply::always_on();
        follower
    }

    /// What differs since the last silence, and does not where the supply was switched off and on in it or the log has a gap, accuses no drive.
    pub(super) fn explain_by_silence(&mut self, number: usize) {
        let Some(restarted) = &self.supply.restarted else {
            return;
        };
        let since = &self.judged.breaches[self.supply.breaches.min(self.judged.breaches.len())..];
        let Some(first) = since.first() else {
            return;
        };
        let is_gap = self.supply.is_gap;
        let any = || since.iter().any(|breach| breach.what != Missing);
        let shown = is_gap || since.len() >= OFF || any();
        if !shown || !restarted.judged.breaches.is_empty() {
            return;
        }
        let doubt = format!(
            "frame {number}, drive {}: {}; {} in the silence in front of frame {}, which explains it",
            self.drive,
            first.about,
            match is_gap {
                true => "the log has a gap, and what it does not have may have come",
                false => "its supply may have been switched off and on",
            },
            self.supply.ended
        );
        let Some(restarted) = self.supply.restarted.take() else {
            return;
        };
        let mut judged = std::mem::take(&mut self.judged);
        let Supply { sent, has_gaps, .. } = self.supply;
        judged.breaches.truncate(self.supply.breaches);
        judged.doubt(doubt);
        *self = *restarted;
        self.judged = judged;
        self.supply = Supply {
            sent,
            has_gaps,
            ..Supply::default()
        };
    }
}
