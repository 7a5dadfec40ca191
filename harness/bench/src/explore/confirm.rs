//! Whether a difference is seen again.

use super::target::{Rehearsal, Target};
use super::{Differing, ExploreError, Finding, FuzzCase};
use harness_proto::time::Span;
use std::collections::BTreeMap;

/// How many times in a row a byte must be late before the drive is blamed. A busy computer sometimes delays the same byte twice.
const TIMES_LATE: u8 = 4;

/// The attempts at a finding after the first one.
#[derive(Clone, Copy, Debug)]
pub struct Confirmation<'k> {
    /// A finding is confirmed when it is seen again this often ...
    confirm: u8,
    /// ... in this many attempts.
    of: u8,
    /// How often each difference was seen before, by its key.
    known: &'k BTreeMap<String, u8>,
    /// How long the line was used.
    pub took: Span,
    /// Whether the last finding was at another byte when it was seen again.
    pub moves: bool,
}

impl<'k> Confirmation<'k> {
    /// The confirmation of a finding that must be seen again `confirm` times in `of` attempts.
    pub const fn new(confirm: u8, of: u8, known: &'k BTreeMap<String, u8>) -> Self {
        Self {
            confirm,
            of,
            known,
            took: Span::ZERO,
            moves: false,
        }
    }

    /// Repeats a case until it has shown the same kind of difference often enough, or no longer can.
    pub fn again<C: FuzzCase>(
        &mut self,
        finding: &mut Finding<C>,
        rehearsal: &Rehearsal<C>,
        target: &mut dyn Target<C>,
    ) -> Result<(), ExploreError> {
        (finding.seen_again, finding.of) = (0, 0);
        self.moves = false;
        let (confirm, of) = match finding.difference.is_time() {
            true => (TIMES_LATE, TIMES_LATE),
            false => (self.confirm, self.of),
        };
        let original = finding.difference.clone();
        while finding.of < of && target.over().is_none() {
            target.begin();
            let tried = target.attempt(&finding.case, rehearsal)?;
            self.took = self.took + tried.took;
            finding.attempts.extend(target.recorded());
            finding.of += 1;
            let Some(other) = tried.difference.filter(|other| other.is_like(&original)) else {
                if confirm > finding.seen_again + (of - finding.of) {
                    return Ok(());
                }
                continue;
            };
            // A late computer delays another byte the next time; a drive that counts is wrong at another byte too.
            let moved = other.place() != finding.difference.place();
            self.moves |= finding.of > 1 && moved;
            let late = finding.difference.is_time() && moved;
            finding.seen_again += u8::from(!late);
            finding.difference = if late {
                finding.difference.clone()
            } else {
                other
            };
            if finding.seen_again >= confirm {
                finding.confirmed = true;
                return Ok(());
            }
        }
        Ok(())
    }

    /// A difference that several cases have shown counts as confirmed too: a disturbed line or a busy computer does not repeat itself in
    /// different cases.
    pub fn by_others<C: FuzzCase>(&self, finding: &mut Finding<C>) {
        let times = self.known.get(&finding.difference.key());
        let times = times.copied().unwrap_or(0);
        if times >= self.confirm && !finding.difference.is_time() {
            (finding.seen_again, finding.of) = (times, times);
            finding.confirmed = true;
        }
    }
}
