//! The attempts of a record on rings, judged again.

use super::able::possible;
use super::beside::judged;
use super::judge::{AttemptFacts, known};
use super::open::line_rate;
use super::reach::{heard, keeping_parity, reached};
use super::run::{Way, not_played, play_one, twin};
use super::session::unhealthy;
use super::walk::Walks;
use crate::language::read::RingScenario;
use crate::qualify::{
    QualificationFacts, TRIALS, conversations, of_parts, of_run, probes, thorough,
};
use crate::rig::sim::RigOfRings as _;
use crate::twin::{Conversation, Exactness, Twin};
use harness_bench::bus_name::BusName;
use harness_bench::link::{Capability, LinkEvent, Replay, Trouble};
use harness_bench::rig::playing::{
    QualificationRecord, Qualified, QualifyingScenario, RecordJudge, RecordedAttempt,
    RecordedBench, RepeatedVerdict, of_bus,
};
use harness_bench::rig::rings::rings;
use harness_bench::rig::{Attempt, Rig};
use harness_bench::scenario::run::{DENIED, Outcome, Why};
use harness_bench::scenario::source::Source;
use harness_proto::line::Rate;
use harness_proto::novobus::guard::Limits;
use harness_proto::time::Span;

/// Judges the attempts of a record on rings.
pub(crate) struct RingJudge {
    rig: Rig,
    qualifies: bool,
    rate: Rate,
    exactness: Exactness,
    capabilities: Vec<Capability>,
    limits: Limits,
    way: Way,
    twin: Twin,
    /// Whether the limits denied something in the attempt before.
    denied: bool,
}

impl RingJudge {
    /// Of a qualification or of a run.
    ///
    /// # Errors
    /// The rig's file describes no rings, in a sentence.
    pub(crate) fn new(rig: &Rig, qualifies: bool) -> Result<Self, String> {
        let rings = rings(&rig.sizes())?;
        let twin = twin(rig, &known(rig)).map_err(|problems| problems.to_string())?;
        let mut judge = Self {
            rate: line_rate(rig),
            exactness: Exactness {
                tolerance: tolerance(rig),
                line_errors: false,
                knows_cells: rig.is_simulated(),
                looks: None,
            },
            capabilities: Vec::new(),
            limits: Limits::default(),
            way: Way {
                rings,
                attempts: rig.examinations(),
                anew: false,
            },
            twin,
            denied: false,
            rig: rig.clone(),
            qualifies,
        };
        judge.adopt(&[]);
        Ok(judge)
    }

    fn fresh(&mut self) {
        // It was made before.
        if let Ok(twin) = twin(&self.rig, &known(&self.rig)) {
            self.twin = twin;
        }
    }

    /// A record of these events, as a link.
    fn replay(&self, events: &[LinkEvent]) -> Replay {
        Replay::new(
            events.to_vec(),
            self.rate,
            self.exactness.tolerance,
            self.rig.sizes(),
            self.capabilities.clone(),
        )
        .reaching(reached(&self.rig))
        .listening(heard(&self.rig))
    }

    fn scenario(&self, source: &Source) -> Result<RingScenario, String> {
        let size = self.way.rings.first().map(|ring| ring.drives());
        let entry = RingScenario::fitting(source.clone(), size);
        entry.map_err(|problems| problems.to_string())
    }

    /// Nothing could be played.
    fn impossible(why: String) -> RepeatedVerdict {
        RepeatedVerdict {
            attempt: Attempt::new(Outcome::rig_error(why), Vec::new()),
            left: None,
            played: None,
            trouble: false,
            exact: false,
        }
    }
}

impl RecordJudge for RingJudge {
    fn adopt(&mut self, capabilities: &[String]) -> RecordedBench {
        (self.capabilities, self.limits) = possible(capabilities, &self.rig);
        self.exactness.line_errors = self.capabilities.contains(&Capability::LineErrors);
        self.way.anew = self.limits.reset && self.limits.motion;
        RecordedBench {
            rate: self.rate.bits_per_second(),
            drives: self.rig.ring_size(),
            tolerance: self.exactness.tolerance,
            capabilities: self.capabilities.clone(),
            anew: self.way.anew,
        }
    }

    fn plays_again(&self) -> bool {
        false
    }

    fn not_begun(&self, source: &Source, remarks: &[String]) -> Option<Outcome> {
        let entry = match of_bus(BusName::Novobus, source, |source| self.scenario(source)) {
            Ok(entry) => entry,
            Err(skip) => return Some(Outcome::skipped(skip)),
        };
        let link = self.replay(&[]).keeping_parity(keeping_parity(&self.rig));
        // What the guard knew of the drives is not in the record.
        let limited = !self.limits.allow_everything();
        let words = remarks
            .first()
            .and_then(|remark| remark.strip_prefix(DENIED));
        let denied = words.filter(|_| limited);
        let denied = denied.map(|words| Why::Denied(words.to_owned()).into());
        let why = not_played(&entry.plan, &link, &self.way.rings).or(denied)?;
        Some(Outcome::skipped(why))
    }

    fn conversations(&self) -> Vec<QualifyingScenario> {
        let drives = self.rig.ring_size();
        let all = reached(&self.rig);
        let reaches =
            |place: usize| place == 0 || place < usize::from(drives) && all.contains(&(0, place));
        let listed = |entry: RingScenario, always| QualifyingScenario {
            source: Source {
                name: entry.short_name().to_owned(),
                text: entry.source.text.clone(),
            },
            always,
        };
        let mut own = conversations(drives, &reaches).unwrap_or_default();
        own.extend(Walks::new(&self.rig).conversations());
        let mut list: Vec<_> = own.into_iter().map(|entry| listed(entry, true)).collect();
        let long = thorough(drives).unwrap_or_default();
        list.extend(long.into_iter().map(|entry| listed(entry, false)));
        for probe in probes(drives).unwrap_or_default() {
            // A drive that is silent while it tests itself is asked by the other conversation.
            let other = probe.of_silent;
            let alone = other.is_none();
            let entries = probe.entries.into_iter().enumerate();
            list.extend(entries.map(|(place, entry)| listed(entry, place == 0 && alone)));
            list.extend(other.map(|entry| listed(entry, false)));
        }
        list
    }

    fn is_trial(&self, name: &str) -> bool {
        TRIALS.iter().any(|trial| name.starts_with(trial))
    }

    fn begin_part(&mut self) {
        self.denied = false;
        self.fresh();
    }

    fn qualified(
        &mut self,
        began: &str,
        record: QualificationRecord<'_>,
    ) -> Result<Vec<Qualified>, String> {
        let links = reached(&self.rig).into_iter();
        let facts = QualificationFacts {
            rig: self.rig.clone(),
            byte_time: self.rate.byte_time(),
            exactness: self.exactness,
            resets: self.way.anew,
            reached: links
                .filter_map(|(ring, place)| (ring == 0).then_some(place))
                .collect(),
        };
        match record {
            QualificationRecord::Run {
                cases, selected, ..
            } => of_run(&facts, began, cases, selected),
            QualificationRecord::Parts { parts, missing } => {
                of_parts(&facts, began, parts, missing).map(|made| vec![made])
            }
        }
    }

    fn judge(
        &mut self,
        source: &Source,
        recorded: RecordedAttempt<'_>,
    ) -> Result<RepeatedVerdict, String> {
        let mut way = self.way.clone();
        if std::mem::replace(&mut self.denied, was_denied(recorded.events)) {
            way.examine_after_denial(&self.rig);
        }
        let mut plan = match self.scenario(source) {
            Ok(entry) if entry.plan.rings == way.rings => entry.plan,
            Ok(_) => {
                return Ok(Self::impossible(
                    "it is for other rings than the rig has".to_owned(),
                ));
            }
            Err(why) => return Ok(Self::impossible(why)),
        };
        let rig = &self.rig;
        let own = rig.plan().ok().and_then(|rig| rig.master);
        plan.master = own.or(plan.master);
        let mut replay = self.replay(recorded.events);
        let exact = replay.is_exact();
        let outcome = match play_one(&mut replay, &plan, &way) {
            Ok(outcome) => outcome,
            Err((ring, ill)) => Outcome::rig_error(unhealthy(rig, ring, ill).to_string()),
        };
        let byte_time = self.rate.byte_time();
        let said = Conversation::all(recorded.events, byte_time, rig.is_simulated());
        let facts = AttemptFacts {
            rig,
            plan: &plan,
            way: &way,
            exactness: self.exactness,
            conversations: &[],
            comparisons: &[],
            unplaced: recorded.unplaced,
            alive: &|| {},
        };
        let recorded = (recorded.events, self.capabilities.as_slice());
        let mut attempt = judged(facts, said, recorded, outcome, &mut self.twin);
        if !self.qualifies {
            (attempt.master_is_right, attempt.own) = (true, None);
        }
        Ok(RepeatedVerdict::of(attempt, &replay, exact))
    }
}

/// Whether the rig's limits denied something in an attempt.
fn was_denied(events: &[LinkEvent]) -> bool {
    let denied = |event: &LinkEvent| matches!(event, LinkEvent::Trouble(Trouble::Denied(_)));
    events.iter().any(denied)
}

/// How exact the times of a rig are.
fn tolerance(rig: &Rig) -> Span {
    let of_ring = rig.rings().map(|(_, ring)| ring.time_tolerance.0);
    let longest = of_ring.max().unwrap_or_default();
    match rig.is_simulated() {
        true => Span::ZERO,
        false => Span::from_nanos(u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX)),
    }
}
