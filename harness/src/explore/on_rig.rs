//! Cases on a rig with ports: what the guard would deny is not sent, every case is followed by the twin, and the ring is brought back and
//! examined between two of them.

use super::case::Case;
use super::error::ExploreError;
use super::novelty::features;
use super::oracle::Difference;
use super::play::Seen;
use super::target::{Rehearsal, Target, Tried};
use super::text::{Page, text};
use crate::guard::Guarded;
use crate::library::Entry;
use crate::link::{Event, Line, Link, Recording, SimulatedLink, Trouble};
use crate::rig::{Attempt, Run, play_one};
use crate::scenario::simulate;
use crate::scenario::source::Source;
use crate::scenario::verdict::Verdict;
use crate::twin::unknowable;
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::Limits;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::time::{Instant, Span};

/// How long the drives of the model have been switched on: their self-tests are over (ND21 11.8).
const WARM: Span = Span::from_millis(200);

/// A rig in use.
pub struct OnRig<'r, 's> {
    run: &'r mut Run<'s>,
    /// The model that cases are rehearsed on.
    model: SimulatedLink,
    limits: Limits,
}

impl<'r, 's> OnRig<'r, 's> {
    /// Cases on a rig, within these limits and its own.
    ///
    /// # Errors
    /// Its model cannot be made.
    pub fn new(run: &'r mut Run<'s>, limits: Limits) -> Result<Self, ExploreError> {
        let session = run.session();
        let plan = session.rig().plan_with(&[]).map_err(Box::new)?;
        let mut model = simulate::bench(&plan);
        model.run_until(Instant::START + WARM);
        model.begin();
        Ok(Self { run, model, limits })
    }

    fn entry(case: &Case) -> Result<Entry, ExploreError> {
        let page = Page {
            title: "a case",
            ..Page::default()
        };
        let source = Source {
            name: "a case".to_owned(),
            text: text(case, &page).into(),
        };
        Ok(Entry::new(source, None)?)
    }
}

impl Target for OnRig<'_, '_> {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        let mut rehearsal = Rehearsal::default();
        let Some(plan) = Self::entry(case)?.plan else {
            return Ok(rehearsal);
        };
        let way = self.run.way();
        let mut events: Vec<Event> = Vec::new();
        let mut guarded = Guarded::new(self.model.clone(), self.limits);
        guarded.know_as(self.run.session().guarded());
        let mut recording = Recording::new(&mut guarded, &mut events);
        let played = play_one(&mut recording, &plan, &way);
        let trace = recording.trace(case.ring());
        rehearsal.denied = match (&played, guarded.trouble()) {
            (_, Some(trouble)) => Some(trouble.to_string()),
            (Ok(outcome), _)
                if outcome.verdict == Verdict::Skipped || outcome.unready.is_some() =>
            {
                Some(outcome.remarks.join("; "))
            }
            (Err((_, ill)), _) => Some(ill.to_string()),
            (Ok(_), None) => None,
        };
        let from = events
            .iter()
            .rposition(|event| matches!(event, Event::Begin(_)));
        let own = &events[from.unwrap_or(0)..];
        let received = own.iter().filter_map(|event| match event {
            Event::Received(ring, at, byte) if *ring == case.ring() => Some((*at, *byte)),
            _ => None,
        });
        rehearsal.seen = Seen {
            received: received.collect(),
            took: guarded.now().since_start(),
        };
        let before = events.iter().filter_map(|event| match event {
            Event::Begin(at) => Some(at.since_start()),
            _ => None,
        });
        rehearsal.took = before.fold(rehearsal.seen.took, |sum, span| sum + span);
        rehearsal.features = features(case, &rehearsal.seen, &trace);
        // A ring that nobody speaks to falls silent too.
        let monitors = |(ring, drive): (usize, u8)| {
            guarded.peek(ring, drive, ram::FLAGS2).unwrap_or(0) & flags2::MONITORING != 0
        };
        let rings = case.sizes().into_iter().enumerate();
        let mut drives = rings.flat_map(|(ring, drives)| (0..drives).map(move |k| (ring, k)));
        let received = own
            .iter()
            .filter(|event| matches!(event, Event::Received(..)));
        let unasked = received.count() > case.bytes().len();
        if rehearsal.denied.is_none() && (unasked || drives.any(monitors)) {
            // In real time it is a race how a ring comes out of that.
            let why = "drives would miss bytes and send unasked (ND21 9.9)";
            rehearsal.denied = Some(why.to_owned());
        }
        if rehearsal.denied.is_none() && measures_beside_faults(case) {
            let why = "what a drive measures cannot be told from what a fault makes of it";
            rehearsal.denied = Some(why.to_owned());
        }
        Ok(rehearsal)
    }

    fn attempt(&mut self, case: &Case, _: &Rehearsal) -> Result<Tried, ExploreError> {
        let Some(plan) = Self::entry(case)?.plan else {
            return Ok(Tried::default());
        };
        let began = std::time::Instant::now();
        let mut played = self.run.play(&plan, None)?;
        let unready = played.last_played().is_some_and(|own| !own.was_played());
        if unready && self.run.session().link().trouble().is_none() {
            // A drive does not answer ResetH8 as it should: the case itself is played without.
            self.run.leave_as_they_are();
            played = self.run.play(&plan, None)?;
        }
        let took = u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX);
        let mut tried = Tried {
            took: Span::from_nanos(took),
            ..Tried::default()
        };
        let Some(last) = played.last_played() else {
            tried.not_played = Some(played.outcome.remarks.join("; "));
            return Ok(tried);
        };
        let verdict = last.outcome.verdict;
        if let Some(trouble) = self.run.session().link().trouble() {
            match trouble {
                Trouble::Lost(_) | Trouble::Garbled(_) | Trouble::Interlock(_) => {
                    return Err(ExploreError::Lost(trouble.to_string()));
                }
                Trouble::Denied(_) | Trouble::Interrupted => {
                    tried.not_played = Some(trouble.to_string());
                    return Ok(tried);
                }
            }
        }
        tried.difference = match verdict {
            // A known deviation of the rig's file explains it.
            Verdict::Passed => None,
            // What the manual leaves to the drive has kept it from being played.
            Verdict::Skipped | Verdict::Inconclusive if !last.was_played() => {
                tried.not_played = Some(last.outcome.remarks.join("; "));
                None
            }
            // A busy computer is late now and then, and not as late again.
            Verdict::Marginal if played.telling(self.run.exactness().tolerance).is_none() => None,
            _ => difference(last),
        };
        Ok(tried)
    }

    fn over(&mut self) -> Option<String> {
        let session = self.run.session();
        if session.overdue() {
            return Some("the rig's file allows no longer run (max_run)".to_owned());
        }
        match session.link().trouble() {
            None | Some(Trouble::Denied(_)) => None,
            Some(trouble) => Some(trouble.to_string()),
        }
    }
}

/// Whether a case has faults, and reads what no model knows of a real drive.
fn measures_beside_faults(case: &Case) -> bool {
    let Ok(size) = RingSize::new(u64::from(case.drives)) else {
        return false;
    };
    let all: Vec<_> = case.bytes().into_iter().map(|byte| (byte, true)).collect();
    let unknown = |role: Role| match role {
        Role::Data { address, .. } => unknowable(address),
        _ => false,
    };
    !case.faults().is_empty() && roles(size, &all).into_iter().any(unknown)
}

/// The first divergence of an attempt, that of the case itself before those of what comes before it; without one, the first byte at
/// another time, as `play` repeats what was late once.
fn difference(attempt: &Attempt) -> Option<Difference> {
    let own = attempt.conversations.iter().zip(&attempt.comparisons);
    let own = || {
        own.clone()
            .filter(|(one, _)| one.has_steps())
            .map(|(_, c)| c)
    };
    let all = || attempt.comparisons.iter();
    let divergence = own()
        .chain(all())
        .find_map(|comparison| comparison.divergence.as_ref());
    let untimely = own().chain(all()).find_map(|own| own.untimely.as_ref());
    let late = untimely.filter(|_| attempt.outcome.verdict == Verdict::Marginal);
    divergence.or(late).map(Difference::from)
}
