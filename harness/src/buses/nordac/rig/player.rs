//! Attempts at scenarios on the slaves of a rig, whose parameters are read first.
//!
//! A scenario describes the slave of the manual; a rig has slaves of its own. So every scenario is played on a model of them first, behind the
//! same limits. It is skipped if a right slave with these parameters would not meet its lines, or if the limits deny a telegram of it. A line
//! that the rig does not meet then accuses the slave, unless a right slave with another value of a point that the manual leaves open would not
//! meet it either, or the computer was late.

use super::RigSlave;
use super::known::Known;
use super::observed::Observed;
use super::profile::Profiled;
use super::settle;
use super::talk::{Talk, TalkError};
use crate::buses::LimitSetting;
use crate::buses::nordac::gate::guarded;
use crate::buses::nordac::language::Nordac;
use crate::buses::nordac::simulate::{self, Bench};
use crate::link::{
    Capability, DriveFault, Line, Link, LinkEvent, Moment, PlacedFault, Recording, Replay, Trouble,
};
use crate::medium::Medium;
use crate::rig::segment::observed::{LinkTimes, Slow};
use crate::scenario::parse::parse;
use crate::scenario::plan::{Plan, plan};
use crate::scenario::problem::Problems;
use crate::scenario::run::outcome::Unready;
use crate::scenario::run::{AtMismatch, Outcome, Skip, Unlock, Why, lacks, play};
use crate::scenario::source::Source;
use crate::scenario::syntax::Scenario;
use crate::scenario::verdict::Verdict;
use harness_proto::nordac::guard::{GuardedSlave, Limits};
use harness_proto::nordac::properties::Properties;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Image, Pkw, Task};
use harness_proto::profibus::BusRate;
use harness_proto::time::Span;
use std::collections::BTreeSet;

/// The word that a slave holds when a scenario begins: OFF2 and OFF3 are not active, as after power-up, and ON without enabling: an ON that
/// stands does nothing before an OFF1 (3.3, rule 2).
const IDLE: u16 = 0x0477;

/// How often it is sent: what the next reply shows may lag behind.
const IDLE_TIMES: usize = 2;

/// The watchdog by which a slave forgets its master before a scenario begins: 100 ms.
const FORGET: [u8; 2] = [1, 10];

/// How long that takes, at most.
const FORGOTTEN: Span = Span::from_millis(150);

/// A scenario of this bus.
pub(crate) struct Own {
    scenario: Scenario<Nordac>,
    pub(super) plan: Plan<Nordac>,
}

impl Own {
    /// Reads a scenario.
    pub(super) fn read(source: &Source) -> Result<Self, Box<Problems>> {
        let scenario: Scenario<Nordac> = parse(source)?;
        let plan = plan(&scenario, source, None)?;
        Ok(Self { scenario, plan })
    }
}

/// What a model is beside what is known of the slaves.
#[derive(Clone, Copy, Default)]
struct Other {
    /// The place of a slave and its properties, in place of those that are known.
    properties: Option<(usize, Properties)>,
    /// What adapter and computer do to telegrams.
    slow: Option<Slow>,
}

/// A scenario played on the model.
struct Rehearsal {
    outcome: Outcome,
    denied: Option<(String, Vec<LimitSetting>)>,
}

/// Plays attempts, on a rig or on a record, and judges them.
#[derive(Debug)]
pub(crate) struct Player {
    slaves: Vec<RigSlave>,
    rate: BusRate,
    patience: Span,
    limits: Limits,
    /// What a record of the rig shows that it can do.
    capabilities: Vec<Capability>,
    /// Slaves can be switched off and on: they are simulated.
    restarts: bool,
    /// What the rig's file says of the slaves, unless they are qualified.
    pub(super) profile: Profiled,
    /// Known from the first attempt on.
    known: Option<Vec<Known>>,
    /// What the last attempt may have written: station, number and IND.
    written: BTreeSet<(u8, u16, u16)>,
    /// What was received before the scenario of the last attempt; `None` where it was not begun.
    before: Option<String>,
}

impl Player {
    pub(super) fn of(
        slaves: Vec<RigSlave>,
        rate: BusRate,
        patience: Span,
        limits: Limits,
        (capabilities, restarts): (Vec<Capability>, bool),
    ) -> Self {
        Self {
            slaves,
            rate,
            patience,
            limits,
            capabilities,
            restarts,
            profile: Profiled::default(),
            known: None,
            written: BTreeSet::new(),
            before: None,
        }
    }

    /// What is known of the slaves; nothing before the first attempt.
    pub(super) fn known(&self) -> &[Known] {
        self.known.as_deref().unwrap_or_default()
    }

    /// What the last attempt may have written.
    pub(super) const fn written(&self) -> &BTreeSet<(u8, u16, u16)> {
        &self.written
    }

    /// Why a scenario is not begun, whatever the slaves are; `None` if it is.
    pub(super) fn not_begun(&self, own: &Own) -> Option<Skip> {
        let bench = &own.plan.setup;
        for slave in &bench.slaves {
            let listed = self.slaves.iter().find(|rig| rig.address == slave.address);
            let why = match listed {
                None => format!("the rig has no slave {}", slave.address),
                Some(rig) if rig.ppo.is_some_and(|ppo| ppo != slave.ppo) => format!(
                    "slave {} of the rig is set to another PPO type than that of the scenario, {}",
                    slave.address,
                    slave.ppo.number()
                ),
                Some(_) if slave.posicon => {
                    format!(
                        "slave {} of the scenario has the option PosiCon",
                        slave.address
                    )
                }
                Some(_) => continue,
            };
            return Some(Why::OtherDrives(why).into());
        }
        let stated = own.scenario.header.rate.is_some();
        if stated && bench.rate != self.rate {
            let why = format!(
                "the rig's line has {} kbit/s, that of the scenario {}",
                self.rate.name(),
                bench.rate.name()
            );
            return Some(Why::OtherDrives(why).into());
        }
        lacks(&own.plan, &self.replay(&[], Span::ZERO))
    }

    /// What was recorded of the rig, as a link.
    pub(super) fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        let drives = u8::try_from(self.slaves.len()).unwrap_or(u8::MAX);
        let medium = Medium::Octets(self.rate.format());
        let capabilities = self.capabilities.clone();
        let drives = vec![drives];
        Replay::new(events.to_vec(), medium, tolerance, drives, capabilities)
    }

    /// One attempt over a link: reads the slaves, rehearses, makes them ready, plays and judges. With what was received before the
    /// scenario, in words.
    pub(super) fn attempt(&mut self, own: &Own, link: &mut dyn Link) -> (Outcome, String) {
        link.begin();
        let mut link = Observed::new(link);
        let outcome = self.attempt_over(own, &mut link);
        let before = match &self.before {
            Some(before) => before.clone(),
            None => link.noted.received(),
        };
        self.written = link.noted.written;
        (outcome, before)
    }

    fn attempt_over(&mut self, own: &Own, link: &mut Observed<'_>) -> Outcome {
        self.before = None;
        if let Err(error) = self.learn(link) {
            return self.unanswered(&error);
        }
        if let Some(slave) = self.slaves_of(own).find(|slave| !slave.ppo().has_pkw()) {
            let why = format!(
                "slave {} is set to PPO type {}, which has no parameter channel: its parameters are not known",
                slave.slave.address,
                slave.ppo().number()
            );
            return Outcome::skipped(Why::OtherDrives(why).into());
        }
        if let Err(skip) = self.rehearsed(own) {
            return Outcome::skipped(skip);
        }
        let ready = self.prepare(own, link);
        self.before = Some(link.noted.received());
        if let Err(error) = ready {
            return self.unanswered(&error);
        }
        link.begin();
        link.take_late();
        let outcome = play(&own.plan, link, AtMismatch::Stop);
        let way = LinkTimes {
            late: link.take_late(),
            longest: link.noted.longest,
            tolerance: link.time_tolerance(),
        };
        self.judged(own, outcome, way)
    }

    /// The slaves that a scenario names.
    fn slaves_of<'p>(&'p self, own: &'p Own) -> impl Iterator<Item = &'p Known> {
        let named = |known: &&Known| {
            let mut slaves = own.plan.setup.slaves.iter();
            slaves.any(|slave| slave.address == known.slave.address)
        };
        self.known().iter().filter(named)
    }

    /// Reads the slaves, the first time.
    fn learn(&mut self, link: &mut Observed<'_>) -> Result<(), TalkError> {
        if self.known.is_some() {
            return Ok(());
        }
        let mut all: Vec<_> = self.slaves.iter().copied().map(Known::new).collect();
        let mut seen = Vec::new();
        let mut talk = Talk::new(Box::new(link), self.patience);
        for known in &mut all {
            let address = known.slave.address;
            talk.restart(address);
            // The record shows it, so that its judge knows it too.
            let found = talk.configuration(address)?;
            known.slave.ppo = found.or(known.slave.ppo);
            known.read_all(&mut talk)?;
            seen.push(settle::converse(known, &mut talk)?);
        }
        drop(talk);
        for (known, seen) in all.iter_mut().zip(&seen) {
            let model = |properties| self.model_replies(known, properties);
            let (properties, open) = settle::settle(seen, model);
            (known.properties, known.open) = (properties, open);
            self.profile.settle(known)?;
        }
        self.known = Some(all);
        Ok(())
    }

    /// What a model of a slave replies in the conversation that settles what the manual leaves open.
    fn model_replies(&self, known: &Known, properties: Properties) -> Option<settle::Replies> {
        let setup = simulate::Setup {
            rate: self.rate,
            slaves: vec![known.model(properties)],
            master: None,
        };
        let gated = [GuardedSlave::from(known.slave)];
        let mut link = guarded(Bench::new(&setup), self.limits, &gated, false);
        let mut talk = Talk::new(Box::new(&mut link), self.patience);
        settle::converse(known, &mut talk).ok()
    }

    /// The outcome where the slaves could not be made ready.
    fn unanswered(&self, error: &TalkError) -> Outcome {
        let remark = error.to_string();
        match error {
            TalkError::Line(trouble) => Outcome::trouble(trouble),
            // Nothing was ever heard of it.
            _ if self.known.is_none() => Outcome::rig_error(remark),
            TalkError::NoReply { .. } => {
                Outcome::not_ready(Verdict::Failed, Unready::NoAnswer, remark)
            }
            // A slave may have reasons of its own to refuse a parameter.
            _ => Outcome::not_ready(Verdict::Inconclusive, Unready::Differs, remark),
        }
    }

    /// Plays a scenario on the model.
    ///
    /// # Errors
    /// Why the rig does not play it.
    fn rehearsed(&self, own: &Own) -> Result<(), Skip> {
        let first = self.rehearse(own, &self.limits, Other::default());
        if first.denied.is_none() && first.outcome.verdict == Verdict::Passed {
            return Ok(());
        }
        let Some((why, settings)) = first.denied else {
            let finding = first.outcome.finding.map(|own| own.message);
            let remark = first.outcome.remarks.into_iter().next();
            let found = finding.or(remark).unwrap_or_default();
            let why = format!("a right slave with the same parameters does not meet it: {found}");
            return Err(Why::OtherDrives(why).into());
        };
        // What the common settings would permit.
        let mut limits = self.limits;
        for setting in &settings {
            permit(&mut limits, *setting);
        }
        let last = self.rehearse(own, &limits, Other::default());
        let plays = last.denied.is_none() && last.outcome.verdict == Verdict::Passed;
        let unlocks: BTreeSet<_> = settings.into_iter().map(Unlock::Limit).collect();
        let skip = Skip::from(Why::Denied(why));
        Err(match plays {
            true => skip.and(unlocks),
            false => skip,
        })
    }

    /// Plays a scenario on the model within limits.
    fn rehearse(&self, own: &Own, limits: &Limits, other: Other) -> Rehearsal {
        let known = self.known().iter().enumerate();
        let slaves = known.map(|(place, known)| {
            let other = other.properties.filter(|own| own.0 == place);
            known.model(other.map_or(known.properties, |own| own.1))
        });
        let setup = simulate::Setup {
            rate: self.rate,
            slaves: slaves.collect(),
            master: None,
        };
        let gated: Vec<_> = self
            .known()
            .iter()
            .map(|own| GuardedSlave::from(own.slave))
            .collect();
        let mut link = guarded(Bench::new(&setup), *limits, &gated, false);
        if let Some(gate) = link.slaves_mut() {
            for known in self.known() {
                for ((number, ind), raw) in &known.values {
                    gate.learn(known.slave.address, *number, (ind >> 8 & 3) as u8, *raw);
                }
            }
        }
        let mut forgotten: Vec<LinkEvent> = Vec::new();
        let mut recording = Recording::new(&mut link, &mut forgotten);
        recording.begin();
        let ready = {
            let mut link = Observed::new(&mut recording);
            self.prepare(own, &mut link)
        };
        recording.begin();
        let outcome = match ready {
            Ok(()) => {
                let mut link = Observed::new(&mut recording).slowed(other.slow);
                play(&own.plan, &mut link, AtMismatch::Stop)
            }
            Err(error) => self.unanswered(&error),
        };
        let denied = match link.trouble() {
            Some(Trouble::Denied(why)) => Some((why.clone(), link.denying().to_vec())),
            _ => None,
        };
        Rehearsal { outcome, denied }
    }

    /// Makes the slaves ready: output off, with the parameters of the header, and without a master, as after power-up.
    fn prepare(&self, own: &Own, link: &mut Observed<'_>) -> Result<(), TalkError> {
        let mut talk = Talk::new(Box::new(&mut *link), self.patience);
        for slave in &own.plan.setup.slaves {
            let known = self
                .known()
                .iter()
                .find(|own| own.slave.address == slave.address);
            let Some(known) = known else { continue };
            let (address, ppo) = (slave.address, known.ppo());
            talk.restart(address);
            talk.start(address, ppo, None)?;
            let off = Image {
                words: [stw::SAFE, 0, 0, 0, 0, 0],
                ..Image::default()
            };
            talk.exchange(address, ppo, &off)?;
            for (parameter, index, value) in &slave.parameters {
                let ind = index.ind(parameter);
                let Some(raw) = parameter.raw_of(*value) else {
                    continue;
                };
                if known.values.get(&(parameter.number, ind)) != Some(&raw) {
                    let ak = Task::change(parameter).ak();
                    known.task(&mut talk, Pkw::of(ak, parameter.number, ind, raw))?;
                }
            }
        }
        match self.restarts {
            true => {
                drop(talk);
                for slave in &own.plan.setup.slaves {
                    for fault in [DriveFault::Off, DriveFault::On] {
                        let fault = PlacedFault::Drive(slave.address, fault);
                        link.inject(0, fault, Moment::Now);
                    }
                }
                // A slave that looks for the rate may miss the first telegram (`autobaud`); a request for its status changes nothing.
                let mut talk = Talk::new(Box::new(&mut *link), self.patience);
                for slave in &own.plan.setup.slaves {
                    talk.status(slave.address)?;
                }
            }
            false => {
                for slave in &own.plan.setup.slaves {
                    let known = self
                        .known()
                        .iter()
                        .find(|own| own.slave.address == slave.address);
                    let ppo = known.map(Known::ppo).unwrap_or_default();
                    let idle = Image {
                        words: [IDLE, 0, 0, 0, 0, 0],
                        ..Image::default()
                    };
                    for _ in 0..IDLE_TIMES {
                        talk.exchange(slave.address, ppo, &idle)?;
                    }
                    talk.start(slave.address, ppo, Some(FORGET))?;
                }
                talk.pass(FORGOTTEN)?;
                for slave in &own.plan.setup.slaves {
                    talk.restart(slave.address);
                    talk.diagnose(slave.address)?;
                }
            }
        }
        Ok(())
    }

    /// Whether a line that was not met accuses the slave.
    fn judged(&self, own: &Own, outcome: Outcome, way: LinkTimes) -> Outcome {
        if outcome.verdict != Verdict::Failed {
            return outcome;
        }
        let real = way.tolerance > Span::ZERO;
        let late = way.late.max(way.longest);
        let why = if real && late > way.tolerance {
            Some(format!(
                "the computer or the adapter was late by {late}: this may not be the slave's fault"
            ))
        } else {
            self.left_open(own, way).map(|property| {
                format!(
                    "a right slave with {property} does not meet it either, and this is not known"
                )
            })
        };
        match why {
            None => outcome,
            Some(why) => Outcome {
                verdict: Verdict::Inconclusive,
                remarks: std::iter::once(why).chain(outcome.remarks).collect(),
                ..outcome
            },
        }
    }

    /// A difference from the model with which a right slave does not meet the scenario either: another value of a point that the manual leaves
    /// open, or times at which telegrams leave.
    fn left_open(&self, own: &Own, way: LinkTimes) -> Option<String> {
        let fails = |other: Other| {
            let played = self.rehearse(own, &self.limits, other);
            played.denied.is_some() || played.outcome.verdict != Verdict::Passed
        };
        for slow in way.slow() {
            let other = Other {
                slow: Some(slow),
                ..Other::default()
            };
            if fails(other) {
                return Some(format!(
                    "an adapter through which telegrams leave {} late",
                    slow.by
                ));
            }
        }
        let known = self.known().iter().enumerate();
        let mut all = known.flat_map(|(place, known)| {
            let open = known.open.iter();
            open.map(move |(words, properties)| (words, (place, *properties)))
        });
        let found = all.find(|(_, properties)| {
            fails(Other {
                properties: Some(*properties),
                ..Other::default()
            })
        });
        found.map(|(words, _)| words.clone())
    }
}

/// Permits what a setting denies.
const fn permit(limits: &mut Limits, setting: LimitSetting) {
    match setting {
        LimitSetting::Motion => limits.motion = true,
        LimitSetting::Eeprom => limits.eeprom = true,
        LimitSetting::MaxSpeed => limits.highest = None,
        _ => {}
    }
}
