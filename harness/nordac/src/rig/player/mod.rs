//! Attempts at scenarios on the slaves of a rig, whose parameters are read first.
//!
//! A scenario describes the slave of the manual; a rig has slaves of its own. So every scenario is played on a model of them first, behind the
//! same limits. It is skipped if a right slave with these parameters would not meet its lines, or if the limits deny a telegram of it. A line
//! that the rig does not meet then accuses the slave, unless a right slave with another value of a point that the manual leaves open would not
//! meet it either, or the computer was late. Where time is virtual, only a right slave that sends the very same octets excuses it.

mod judge;
mod note;
mod ready;
mod rehearse;
mod shorten;
mod unlock;
mod worlds;

use note::DeviantValues;
pub(crate) use note::SlaveNote;
pub(super) use ready::idle;
pub(super) use rehearse::PlayableScenario;

use super::RigSlave;
use super::known::{INTERFACE, KnownInverters};
use super::observed::{Observed, ReceivedOctets, Turn, WrittenParameter};
use super::profile::ProfileSettings;
use super::settle;
use super::talk::{Talk, TalkError};
use crate::gate::GuardsSlaves as _;
use crate::gate::guarded;
use crate::language::Nordac;
use crate::language::syntax::Header;
use crate::simulate::{self, Bench};
use harness_bench::guard::Guarded;
use harness_bench::link::{Capability, Line, Link, LinkEvent, Replay};
use harness_bench::medium::Medium;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::playing::observed::{Beats, LinkTimes};
use harness_bench::scenario::parse::parse;
use harness_bench::scenario::plan::{Plan, plan};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::outcome::Unready;
use harness_bench::scenario::run::{AtMismatch, Outcome, Skip, Why, lacks, play};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::syntax::Scenario;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::nordac::PpoType;
use harness_proto::nordac::guard::{GuardedSlave, Limits};
use harness_proto::nordac::properties::Properties;
use harness_proto::nordac::words::zsw;
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;
use harness_sim::nordac::History;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A scenario, read for a rig.
#[derive(Clone, Debug)]
pub(crate) struct RigScenario {
    name: String,
    header: Header,
    pub(super) plan: Plan<Nordac>,
}

impl RigScenario {
    pub(super) fn read(source: &Source) -> Result<Self, Box<Problems>> {
        let scenario: Scenario<Nordac> = parse(source)?;
        let plan = plan(&scenario, source, None)?;
        Ok(Self {
            name: source.name.clone(),
            header: scenario.header,
            plan,
        })
    }
}

/// How an attempt went, before it is judged.
enum AttemptCourse {
    /// The slaves are not known, or did not become ready.
    Unanswered(TalkError),
    Skipped(Skip),
    Played(Box<Outcome>),
}

/// What is left of an attempt to judge it by.
struct AttemptEvidence {
    way: LinkTimes,
    /// What came from the first telegram on that makes the slaves ready.
    came: ReceivedOctets,
    /// Whether the settings of the bus were switched to those of the scenario.
    switches: bool,
    /// Whether the slaves sent anything.
    heard: bool,
    /// The telegrams of the bench, with what came after each.
    turns: Vec<Turn>,
}

/// Plays attempts, on a rig or on a record, and judges them.
#[derive(Clone, Debug)]
pub(crate) struct Player {
    slaves: Vec<RigSlave>,
    rate: BusRate,
    patience: Span,
    limits: Limits,
    /// What a record of the rig shows that it can do.
    capabilities: Vec<Capability>,
    /// Slaves can be switched off and on: they are simulated.
    restarts: bool,
    /// Known from the first attempt on.
    pub(super) known: Option<Vec<KnownInverters>>,
    /// What the last attempt may have written: station, number and IND.
    pub(super) written: BTreeSet<WrittenParameter>,
    /// Where it says what a scenario changes, before it does.
    pub(super) left: NotPutBack,
    /// What was received before the scenario of the last attempt; `None` where it was not begun.
    before: Option<String>,
    /// What the profile of the rig's file says.
    pub(super) profile: ProfileSettings,
    /// What was found out of the slaves where finding out has failed.
    partly: Vec<KnownInverters>,
    /// What a slave did that no right slave does, before the first scenario: its verdict says so.
    unlike: Option<String>,
    /// The only slave has done what no right slave does: further lines that it does not meet accuse it too.
    proven: bool,
    /// Why nothing can be played on simulated slaves.
    unable: Option<String>,
    qualifies: bool,
    /// In how many attempts, one after the other, something was lost after a telegram: by scenario, and by step and place among its telegrams.
    lost: BTreeMap<String, BTreeMap<(Option<usize>, usize), usize>>,
    /// What shows that the program works while it plays on models.
    pub(super) beats: Beats,
    notes: Vec<SlaveNote>,
    behind: DeviantValues,
}

struct ReadySlaves {
    /// Whether settings of the bus were switched for it.
    switches: bool,
    /// The scenario with shorter waits, which is played in its place.
    shorter: Option<RigScenario>,
    faulted: bool,
}

impl Player {
    pub(super) fn of(
        slaves: Vec<RigSlave>,
        rate: BusRate,
        patience: Span,
        limits: Limits,
        capabilities: Vec<Capability>,
        restarts: bool,
    ) -> Self {
        Self {
            slaves,
            rate,
            patience,
            limits,
            capabilities,
            restarts,
            known: None,
            written: BTreeSet::new(),
            left: NotPutBack::default(),
            before: None,
            profile: ProfileSettings::default(),
            partly: Vec::new(),
            unlike: None,
            proven: false,
            unable: None,
            qualifies: false,
            lost: BTreeMap::new(),
            beats: Beats::default(),
            notes: Vec::new(),
            behind: DeviantValues::default(),
        }
    }

    /// Keeps every attempt from now on.
    pub(super) const fn qualify(&mut self) {
        self.qualifies = true;
    }

    pub(super) fn notes(&self) -> &[SlaveNote] {
        &self.notes
    }

    pub(super) const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// How long a reply may take beside its own time on the line.
    pub(super) const fn patience(&self) -> Span {
        self.patience
    }

    /// What is known of the slaves; nothing before the first attempt.
    pub(super) fn known(&self) -> &[KnownInverters] {
        self.known.as_deref().unwrap_or_default()
    }
    pub(super) fn known_at(&self, address: u8) -> Option<&KnownInverters> {
        let mut known = self.known().iter();
        known.find(|known| known.slave.address == address)
    }

    /// Why a scenario is not begun, whatever the slaves are; `None` if it is.
    pub(super) fn not_begun(&self, scenario: &RigScenario) -> Option<Skip> {
        lacks(&scenario.plan, &self.replay(&[], Span::ZERO))
    }

    /// What was recorded of the rig, as a link.
    pub(super) fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        let drives = u8::try_from(self.slaves.len()).unwrap_or(u8::MAX);
        let medium = Medium::Octets(self.rate.format());
        let capabilities = self.capabilities.clone();
        let drives = vec![drives];
        Replay::new(events.to_vec(), medium, tolerance, drives, capabilities)
    }

    /// Whether a slave may be switched from one PPO type to the other for a scenario, and back. Other settings of the bus go with it: who
    /// controls the inverter may start a motor.
    fn may_switch(&self, from: PpoType, to: PpoType) -> bool {
        // A simulated slave is switched on anew for each attempt.
        let back = self.restarts || to.has_pkw();
        from == to || rehearse::may_switch_settings(&self.limits) && from.has_pkw() && back
    }

    /// One attempt over a link: reads the slaves, rehearses, makes them ready, plays and judges. With what was received before the
    /// scenario, in words.
    pub(super) fn attempt(
        &mut self,
        scenario: &Arc<RigScenario>,
        link: &mut dyn Link,
    ) -> (Outcome, String) {
        link.begin();
        let begun = self.qualifies.then(|| self.without_notes());
        let mut link = Observed::new(link);
        let exact = link.time_tolerance() == Span::ZERO;
        let (gone, switches) = match &self.unable {
            Some(why) => {
                let why = Why::OtherDrives(why.clone());
                (AttemptCourse::Skipped(why.into()), false)
            }
            None => self.go(scenario, &mut link, None),
        };
        if let Some(begun) = begun {
            self.note(begun, scenario, &link, switches, &gone);
        }
        let left = AttemptEvidence {
            way: LinkTimes {
                late: link.take_late(),
                longest: link.noted.longest,
                tolerance: link.time_tolerance(),
            },
            came: link.noted.came(),
            switches,
            heard: link.noted.len() > 0,
            turns: std::mem::take(&mut link.noted.turns),
        };
        let outcome = match gone {
            AttemptCourse::Unanswered(error) => self.unanswered(scenario, &error, &left),
            AttemptCourse::Skipped(skip) => Outcome::skipped(skip),
            AttemptCourse::Played(outcome) => self.judged(scenario, *outcome, &left),
        };
        let outcome = match self.unlike.take() {
            Some(why) if exact && link.trouble().is_none() => {
                Outcome::not_ready(Verdict::Failed, Unready::Differs, why)
            }
            _ => outcome,
        };
        if let Some(note) = self.notes.last_mut() {
            note.judge(&outcome);
        }
        let before = match &self.before {
            Some(before) => before.clone(),
            None => link.noted.received(),
        };
        self.written = link.noted.written;
        (outcome, before)
    }

    /// Reads the slaves, makes them ready, and plays: what their model meets, or `again` a scenario for which the settings of the bus were
    /// switched or not. With whether settings were switched.
    fn go(
        &mut self,
        scenario: &RigScenario,
        link: &mut Observed<'_>,
        again: Option<bool>,
    ) -> (AttemptCourse, bool) {
        self.before = None;
        if let Err(error) = self.learn(link, again.is_none()) {
            return (AttemptCourse::Unanswered(error), false);
        }
        let begun = match self.made_ready(scenario, link, again) {
            // What the slaves keep of the time before is another thing now.
            Ok(ReadySlaves { faulted: true, .. }) => self.made_ready(scenario, link, again),
            begun => begun,
        };
        let ReadySlaves {
            switches, shorter, ..
        } = match begun {
            Ok(ready) => ready,
            Err(gone) => return *gone,
        };
        let real = link.time_tolerance() > Span::ZERO;
        link.noted.reach(link.now());
        link.begin();
        link.take_late();
        // Behind an adapter a line that is not met may be that of a right slave which was asked at another time.
        let at_mismatch = match real {
            true => AtMismatch::GoOn,
            false => AtMismatch::Stop,
        };
        let plan = &shorter.as_ref().unwrap_or(scenario).plan;
        let outcome = play(plan, link, at_mismatch);
        (AttemptCourse::Played(Box::new(outcome)), switches)
    }

    /// Finds out whether right slaves meet a scenario, and makes the slaves of the rig ready for it.
    ///
    /// # Errors
    /// What becomes of the attempt, and whether settings were switched.
    fn made_ready(
        &mut self,
        scenario: &RigScenario,
        link: &mut Observed<'_>,
        again: Option<bool>,
    ) -> Result<ReadySlaves, Box<(AttemptCourse, bool)>> {
        let unanswered = |switches| {
            move |error: TalkError| Box::new((AttemptCourse::Unanswered(error), switches))
        };
        let skipped = |skip: Skip| Box::new((AttemptCourse::Skipped(skip), false));
        self.look(scenario, link).map_err(unanswered(false))?;
        let begun = match again {
            Some(switches) => PlayableScenario {
                switches,
                moved: BTreeSet::new(),
                written: BTreeSet::new(),
            },
            None => {
                let begun = self.rehearsed(scenario);
                begun.map_err(|why| skipped(Skip::from(why).and(self.unlocks(scenario))))?
            }
        };
        let taken = self.other_station(&begun.moved, link);
        if let Some(why) = taken.map_err(unanswered(false))? {
            return Err(skipped(why.into()));
        }
        if again.is_none() {
            self.foretell(&begun);
        }
        let switches = begun.switches;
        let real = link.time_tolerance() > Span::ZERO;
        let shorter = (self.qualifies && real).then(|| self.shortened(scenario, switches));
        link.noted.begin_fresh();
        let ready = self.prepare(scenario, link, switches);
        self.before = Some(link.noted.received());
        let faulted = ready.map_err(unanswered(switches))?;
        Ok(ReadySlaves {
            switches,
            shorter,
            faulted,
        })
    }

    /// Reads the slaves, the first time, and `settles` what the manual leaves open.
    fn learn(&mut self, link: &mut Observed<'_>, settles: bool) -> Result<(), TalkError> {
        if self.known.is_some() {
            return Ok(());
        }
        let mut all: Vec<_> = self
            .slaves
            .iter()
            .copied()
            .map(KnownInverters::new)
            .collect();
        let mut learn = || {
            let each = all.iter_mut();
            let seen = each.map(|known| self.learn_of(known, link));
            seen.collect::<Result<Vec<_>, _>>()
        };
        let seen = match learn() {
            Ok(seen) => seen,
            Err(error) => {
                self.partly = all;
                return Err(error);
            }
        };
        let exact = link.time_tolerance() == Span::ZERO;
        let came = |came: ReceivedOctets| if exact { came } else { came.at_any_time() };
        for (known, seen) in all.iter_mut().zip(seen).filter(|_| settles) {
            let seen = came(seen);
            let conversed = |properties| came(self.conversed(known, properties, (&seen, exact)));
            // What a slave sends follows from parameters too, and without a parameter channel those are not known.
            let is_read = known.ppo().has_pkw();
            match is_read.then(|| settle::settle(|point| conversed(point).agrees(&seen))) {
                None => {}
                Some(Some(settled)) => (known.properties, known.open) = settled,
                // Every value of every point stays open.
                Some(None) => {
                    self.proven = exact && self.slaves.len() == 1;
                    self.unlike = Some(format!(
                        "slave {}: no right slave, whatever the manual leaves open, sends what it sent before the first scenario",
                        known.slave.address
                    ));
                }
            }
            self.profile.settle(known)?;
        }
        self.known = Some(all);
        Ok(())
    }

    /// Reads what the slaves of a scenario keep of the time before. Simulated ones are switched off and on for each scenario.
    fn look(&mut self, scenario: &RigScenario, link: &mut Observed<'_>) -> Result<(), TalkError> {
        if self.restarts {
            return Ok(());
        }
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        for known in self.known.iter_mut().flatten() {
            let address = known.slave.address;
            let mut slaves = scenario.plan.setup.slaves.iter();
            if slaves.any(|slave| slave.address == address) {
                talk.restart(address);
                let now = known.read_history(&mut talk)?;
                // No word of the bus changes the one in force while the terminals control a right slave (2.5.1, interface 0, 1 and 4).
                let switched = self.written.contains(&(address, INTERFACE, 0));
                known.history = History {
                    stw: if switched { now.stw } else { known.history.stw },
                    ..now
                };
            }
        }
        Ok(())
    }

    /// Why slaves are not given these addresses: another station has one of them.
    fn other_station(
        &self,
        moved: &BTreeSet<(u8, u8)>,
        link: &mut Observed<'_>,
    ) -> Result<Option<Why>, TalkError> {
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        for (slave, to) in moved.iter().filter(|(slave, to)| slave != to) {
            if !self.restarts && talk.status(*to)? {
                let why =
                    format!("it gives slave {slave} the address {to}, at which a station answers");
                return Ok(Some(Why::OtherDrives(why)));
            }
        }
        Ok(None)
    }

    /// Reads a slave, and holds the conversation that settles what the manual leaves open. Returns what came in it.
    fn learn_of(
        &self,
        known: &mut KnownInverters,
        link: &mut Observed<'_>,
    ) -> Result<ReceivedOctets, TalkError> {
        let address = known.slave.address;
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        talk.restart(address);
        // The record shows it, so that its judge knows it too.
        let found = talk.configuration(address)?;
        known.slave.ppo = found.or(known.slave.ppo);
        known.read_all(&mut talk)?;
        if !self.restarts {
            known.history = known.read_history(&mut talk)?;
        }
        let zsw = settle::forget(known, &mut talk)?;
        if zsw & zsw::FAULT != 0 {
            let ppo = known.ppo();
            talk.restart(address);
            talk.start(address, ppo, None)?;
            self.without_fault(address, ppo, zsw, &mut talk)?;
            settle::forget(known, &mut talk)?;
        }
        drop(talk);
        link.noted.begin_fresh();
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        settle::converse(known, &mut talk)?;
        drop(talk);
        Ok(link.noted.came())
    }

    /// What comes from a model of a slave in the conversation that settles what the manual leaves open, up to the first octet that was not
    /// `seen`, its time included or not.
    fn conversed(
        &self,
        known: &KnownInverters,
        properties: Properties,
        seen: (&ReceivedOctets, bool),
    ) -> ReceivedOctets {
        let mut link = self.model(vec![known.model(properties)], &self.limits);
        let mut link = Observed::new(&mut link);
        let mut talk = Talk::new(Box::new(&mut link), self.patience);
        let ready = settle::forget(known, &mut talk);
        drop(talk);
        link.noted.begin_fresh();
        link.noted.expect(seen.0, link.noted.fresh, seen.1);
        if ready.is_ok() {
            let mut talk = Talk::new(Box::new(&mut link), self.patience);
            // What came before an error counts.
            let _came = settle::converse(known, &mut talk);
        }
        link.noted.came()
    }

    /// A bench of simulated slaves behind the gate of the rig. They were asked as when a rig is opened.
    fn model(&self, slaves: Vec<simulate::SlaveSetup>, limits: &Limits) -> Guarded<Bench> {
        self.beats.beat();
        let gated = slaves.iter().map(|slave| GuardedSlave {
            address: slave.address,
            ppo: Some(slave.ppo),
        });
        let gated: Vec<_> = gated.collect();
        let setup = simulate::Setup::new(self.rate, slaves);
        let mut link = guarded(Bench::new(&setup), *limits, &gated, false);
        if let Some(gate) = link.slaves_mut() {
            for known in self.known() {
                for ((number, ind), raw) in known.values.iter() {
                    gate.learn(known.slave.address, *number, (ind >> 8 & 3) as u8, *raw);
                }
            }
        }
        let mut talk = Talk::new(Box::new(&mut link), self.patience);
        for slave in &setup.slaves {
            talk.restart(slave.address);
            let asked = talk.diagnose(slave.address);
            let _any = asked.and_then(|_| talk.configuration(slave.address));
        }
        drop(talk);
        link
    }
}
