//! Runs cases on a rig with ports, one after another. Bytes that the guard would deny are not sent, and a [`Judge`] sees every byte. The
//! drives are made ready again when their state is unknown.

use super::case::{ActKind, Case, Harm, OtherRing};
use super::judge::{BytesExchanged, Judge, prologue};
use super::on_record::{AnsweredCase, AttemptRecord, ByteTimes, acts, untimely};
use super::order::{CommandSent, RawCommand};
use super::play::MasterView;
use crate::explore::features;
use crate::explore::{Rehearsal, Tried};
use crate::gate::guard_rings;
use crate::language::run::over_bus::monitors;
use crate::language::run::over_bus::start_anew;
use crate::link::BesideTheBus;
use crate::link::SimulatedLink;
use crate::rig::sim::RigOfRings;
use crate::rig::{OfRings as _, Run, examine};
use crate::simulate;
use crate::twin::SILENCED;
use harness_bench::explore::ExploreError;
use harness_bench::explore::Target;
use harness_bench::guard::OVERDUE;
use harness_bench::link::{
    Capability, Lead, Line as _, Link, Moment, Octets, PlacedFault, Trouble,
};
use harness_proto::line::Received;
use harness_proto::nd21::bits::flags2;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::guard::Limits;
use harness_proto::time::{Instant, Span};

/// How long the drives of the model have been switched on: their self-tests are over (ND21 11.8).
const WARM: Span = Span::from_millis(200);

/// Maximum number of bytes sent before the drives are made ready again. The bytes sent since then are kept, so they can be replayed.
pub(super) const LONGEST_HISTORY: usize = 40_000;

/// How long a byte may be missing before it counts as lost, in addition to the tolerance of the rig.
const PATIENCE: Span = Span::from_millis(60);

/// How much later than that a late computer may receive a byte.
const LATEST: Span = Span::from_millis(1_000);

/// A rig in use.
pub(crate) struct OnRig<'r, 's> {
    run: &'r mut Run<'s>,
    /// The model that cases are rehearsed on.
    model: SimulatedLink,
    limits: Limits,
    /// What each ring has done since its drives were made ready.
    judges: Vec<Judge>,
    /// What each has taken for possible before that.
    possible: Vec<Vec<u8>>,
    /// The conversations since then, ring by ring; the first one makes the addresses known.
    history: Vec<Vec<AnsweredCase>>,
    /// The last attempt, and how many conversations of its ring came before it.
    last: Option<(AttemptRecord, usize)>,
    /// Whether the state of the drives is unknown.
    stale: bool,
    /// Whether drives monitor time-outs (ND21 9.9), where they say so. No case changes it.
    monitors: Option<bool>,
}

impl<'r, 's> OnRig<'r, 's> {
    /// Cases on a rig, within these limits and its own.
    ///
    /// # Errors
    /// Its model cannot be made.
    pub(crate) fn new(run: &'r mut Run<'s>, limits: Limits) -> Result<Self, ExploreError> {
        let session = run.session();
        let mut rig = session.rig().clone();
        // The setup describes the simulated drives themselves; the model must follow the manual.
        if let Some(sim) = &mut rig.file.sim {
            sim.setup.clear();
        }
        let plan = rig.plan().map_err(Box::new)?;
        let mut model = simulate::bench(&plan);
        model.run_until(Instant::START + WARM);
        model.begin();
        let line_errors = session.link().capabilities();
        let line_errors = line_errors.contains(&Capability::LineErrors);
        let rings = session.rings().iter().enumerate();
        let judges: Vec<_> = rings
            .map(|(ring, size)| Judge::new(ring, *size, line_errors))
            .collect();
        Ok(Self {
            run,
            model,
            limits,
            possible: vec![Vec::new(); judges.len()],
            history: vec![Vec::new(); judges.len()],
            last: None,
            judges,
            stale: true,
            monitors: None,
        })
    }

    /// Makes the drives ready, so that earlier bytes have no effect any more.
    fn begin_anew(&mut self) -> Result<Span, ExploreError> {
        let anew = self.run.way().anew;
        let session = self.run.session();
        session.health()?;
        let rings = session.rings().to_vec();
        // A drive that does not answer `ResetH8` correctly is tested without a reset.
        if anew && start_anew(session.link(), &rings).is_err() {
            self.run.leave_as_they_are();
        }
        let session = self.run.session();
        let axes: Vec<_> = session.axes();
        let drives = axes.iter().map(|axis| (axis.ring(), axis.drive()));
        let drives: Vec<_> = drives.collect();
        if self.monitors.is_none() {
            self.monitors = monitors(session.link(), &drives);
        }
        let took = self.run.session().link().now().since_start();
        self.run.session().health()?;
        self.history.iter_mut().for_each(Vec::clear);
        for (ring, judge) in self.judges.iter_mut().enumerate() {
            judge.begin();
            self.possible[ring] = judge.possible();
            let case = prologue(rings[ring].drives(), beside_of(&rings, ring));
            let link = self.run.session().link();
            let CaseTraffic { received, .. } = converse(link, &case, case.bytes().len());
            let received: Vec<_> = received.into_iter().map(|(_, byte)| byte).collect();
            // A difference here shows again in the first case.
            let _again = judge
                .see(BytesExchanged::of(&case, received.clone()))
                .map(|_| judge.begin());
            self.history[ring].push(AnsweredCase { case, received });
        }
        self.stale = false;
        Ok(took)
    }
}

impl OnRig<'_, '_> {
    /// Whether drives may miss their master in a silence of the bench.
    fn may_monitor(&self) -> bool {
        self.run.exactness().tolerance > Span::ZERO && self.monitors != Some(false)
    }

    /// An attempt of which nothing was played yet.
    fn record(&self, case: &Case) -> AttemptRecord {
        let ring = case.ring();
        AttemptRecord {
            possible: self.possible[ring].clone(),
            line_errors: self.judges[ring].line_errors(),
            before: Vec::new(),
            last: AnsweredCase {
                case: case.clone(),
                received: Vec::new(),
            },
            played: false,
            may_monitor: self.may_monitor(),
            known: false,
            times: ByteTimes::default(),
        }
    }

    /// When bytes went and came. Times that a late computer saw tell nothing of the drives.
    fn times(&mut self, said: &CaseTraffic) -> ByteTimes {
        let link = self.run.session().link();
        let units = |at: &Instant| at.since_start().units();
        ByteTimes {
            byte: link.byte_time().units(),
            tolerance: match said.late {
                true => u64::MAX,
                false => link.time_tolerance().units(),
            },
            sent: said.sent.iter().map(units).collect(),
            came: said.received.iter().map(|(at, _)| units(at)).collect(),
        }
    }
}

impl Target<Case> for OnRig<'_, '_> {
    fn rehearse(&mut self, case: &Case) -> Result<Rehearsal, ExploreError> {
        let mut link = guard_rings(self.model.clone(), self.limits);
        link.know_as(self.run.session().guarded());
        let way = self.run.way();
        if !self.limits.allow_everything() {
            // The guard lets pass what it has seen the drives ready for.
            let ready = examine(&mut link, &way.rings, 1).is_ok();
            if ready && way.anew {
                let _refused = start_anew(&mut link, &way.rings);
            }
        }
        let ring = case.ring();
        let CaseTraffic { received, took, .. } = converse(&mut link, case, usize::MAX);
        let trace = link.trace(ring);
        let denied = match link.trouble() {
            Some(trouble) => Some(trouble.to_string()),
            None => beyond(case, &link, received.len()).map(str::to_owned),
        };
        let seen = MasterView { received, took };
        Ok(Rehearsal {
            took,
            features: features(case, &seen, &trace),
            denied,
            seen,
            of_model: None,
        })
    }

    fn attempt(&mut self, case: &Case, _: &Rehearsal) -> Result<Tried, ExploreError> {
        let began = std::time::Instant::now();
        let mut made_ready = Span::ZERO;
        let sent = self.history.iter().flatten();
        let used: usize = sent.map(|answered| answered.case.bytes().len()).sum();
        // The program has been computing, and drives that monitor time-outs have missed it.
        let waited = self.monitors == Some(true);
        if self.stale || waited || used > LONGEST_HISTORY {
            made_ready = self.begin_anew()?;
        }
        if !self.run.session().rig().file.interlock.is_empty() {
            let session = self.run.session();
            session.health()?;
            session.look_at_interlocks();
        }
        let ring = case.ring();
        self.last = Some((self.record(case), self.history[ring].len()));
        let foreseen = self.judges[ring].foresee(case);
        if foreseen.is_harmful {
            let why = "the result is the drive's choice: it writes cells that the drive's program uses, or a fault hits the drive's own data";
            return Ok(Tried {
                not_played: Some(why.to_owned()),
                ..Tried::default()
            });
        }
        let said = converse(self.run.session().link(), case, foreseen.count);
        let mut tried: Tried = Tried::default();
        if let Some(trouble) = self.run.session().link().trouble() {
            self.stale = true;
            if trouble.is_of_the_bench() {
                return Err(ExploreError::Lost(trouble.to_string()));
            }
            tried.not_played = Some(trouble.to_string());
        } else {
            let times = self.times(&said);
            let received: Vec<_> = said.received.iter().map(|(_, byte)| *byte).collect();
            let before = acts(&self.history[ring]);
            tried.difference = self.judges[ring].see(BytesExchanged::of(case, received.clone()));
            if tried.difference.is_none() {
                tried.difference = untimely(case, &received, &times);
            }
            let answered = AnsweredCase {
                case: case.clone(),
                received,
            };
            let mut record = self.record(case);
            record.before.clone_from(&self.history[ring]);
            (record.last, record.times) = (answered.clone(), times);
            let silenced = tried.difference.take_if(|_| record.is_silenced());
            tried.not_played = silenced.as_ref().map(|_| SILENCED.to_owned());
            // A known deviation of the rig's file explains it.
            let deviations = &self.run.session().rig().file.deviation;
            let known = tried.difference.take_if(|found| {
                let rule = format!("nd21 {}", found.section);
                let drive = found.drive.or(found.meant);
                let mut known = deviations.iter();
                known.any(|entry| entry.explains(&rule, found.ring, drive))
            });
            tried.before = (tried.difference.is_some() && !before.is_empty()).then_some(before);
            if let Some((last, _)) = &mut self.last {
                last.last.received.clone_from(&answered.received);
                (last.times, last.played, last.known) = (record.times, true, known.is_some());
            }
            self.history[ring].push(answered);
            // For how long a drive tests itself is its choice (ND21 11.8).
            let disturbed = silenced.is_some() || known.is_some() || tried.difference.is_some();
            self.stale = disturbed || case.orders().any(resets);
        }
        tried.took = match self.run.session().rig().is_simulated() {
            true => made_ready + said.took,
            false => {
                Span::from_nanos(u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX))
            }
        };
        Ok(tried)
    }

    fn recorded(&self) -> Option<AttemptRecord> {
        let (record, before) = self.last.as_ref()?;
        let history = &self.history[record.last.case.ring()];
        Some(AttemptRecord {
            before: history[..*before].to_vec(),
            ..record.clone()
        })
    }

    fn begin(&mut self) {
        self.stale = true;
    }

    fn over(&mut self) -> Option<String> {
        let session = self.run.session();
        if session.overdue() {
            return Some(OVERDUE.to_owned());
        }
        match session.link().trouble() {
            None | Some(Trouble::Denied(_)) => None,
            Some(trouble) => Some(trouble.to_string()),
        }
    }

    fn end_between_cases(&mut self) {
        self.run.session().link().set_deadline(None);
    }
}

/// What was said in a case.
struct CaseTraffic {
    received: Vec<(Instant, Received)>,
    /// The time of each byte sent.
    sent: Vec<Instant>,
    /// How long the line was used.
    took: Span,
    /// Whether the computer was late at times by more than any drive is.
    late: bool,
}

/// Sends a case and waits for `count` bytes.
fn converse(link: &mut dyn Link, case: &Case, count: usize) -> CaseTraffic {
    let ring = case.ring();
    let mut late = false;
    link.begin();
    for (place, byte, harm) in case.faults() {
        let fault = PlacedFault::Link(usize::from(place), harm.fault());
        link.inject(ring, fault, Moment::Byte(byte));
    }
    let byte_time = link.byte_time();
    let mut received = Vec::new();
    let mut due = Vec::new();
    for act in &case.acts {
        if let ActKind::Wait(ms) = act.what {
            let end = link.now() + Span::from_millis(u64::from(ms));
            late |= await_bytes(link, ring, usize::MAX, end, &mut received);
        }
        let parts = act.parts(case.drives);
        for part in parts.iter().filter(|part| !part.is_empty()) {
            let end = link.send_octets(ring, part);
            let length = part.len() as u64;
            due.extend((0..length).rev().map(|left| end - byte_time * left));
        }
    }
    let round = byte_time * (u64::from(case.drives) + 2) + link.time_tolerance() + PATIENCE;
    let end = due.last().copied().unwrap_or(link.now()) + round;
    late |= await_bytes(link, ring, count, end, &mut received);
    CaseTraffic {
        received,
        sent: due,
        took: link.now().since_start(),
        late,
    }
}

/// Receives bytes until there are `count` of them, or until `end`. Returns whether the computer was late meanwhile.
fn await_bytes(
    link: &mut dyn Link,
    ring: usize,
    count: usize,
    end: Instant,
    received: &mut Vec<(Instant, Received)>,
) -> bool {
    let mut late = false;
    loop {
        let lead = link.lead();
        late |= lead.near == lead.far && lead != Lead::NONE;
        received.extend(std::iter::from_fn(|| link.receive_octet(ring)));
        // A computer that was late in sending awaits the answers later.
        let real = link.time_tolerance() > Span::ZERO;
        let later = real && link.now() < end + LATEST && link.busy();
        let over = link.now() >= end && !later;
        if received.len() >= count || over || link.trouble().is_some() {
            return late;
        }
        link.wait(end.max(link.now() + link.byte_time()));
    }
}

/// Why a case cannot be tried on a ring behind a port.
fn beyond(case: &Case, link: &dyn Link, received: usize) -> Option<&'static str> {
    // A ring to which nothing is sent times out as well.
    let monitors = |(ring, drive): (usize, u8)| {
        link.peek(ring, drive, ram::FLAGS2).unwrap_or(0) & flags2::MONITORING != 0
    };
    let rings = case.sizes().into_iter().enumerate();
    let mut drives = rings.flat_map(|(ring, drives)| (0..drives).map(move |k| (ring, k)));
    let unjudged = |(_, _, harm): &(u8, u64, Harm)| {
        matches!(harm, Harm::Delay(_) | Harm::Break(_) | Harm::Overrun)
    };
    if received > case.bytes().len() && case.faults().is_empty() || drives.any(monitors) {
        // In real time the outcome is a race of clocks.
        Some("drives would miss bytes and send unasked (ND21 9.9)")
    } else if case.faults().iter().any(unjudged) {
        Some("what drives take a broken byte for is their choice")
    } else {
        None
    }
}

/// The other ring of the bench, as a case with this ring names it.
fn beside_of(rings: &[RingSize], ring: usize) -> Option<OtherRing> {
    match (rings, ring) {
        ([_, second], 0) => Some(OtherRing::Second(second.drives())),
        ([first, _], 1) => Some(OtherRing::First(first.drives())),
        _ => None,
    }
}

fn resets(order: &CommandSent) -> bool {
    order.command == RawCommand::Reset && order.spoil.is_none()
}
