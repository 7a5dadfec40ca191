//! A scenario settled: slaves as they are switched on, telegrams and what they must be, jobs with raw numbers.

mod value;

pub(crate) use value::{PlannedParameter, PlannedWord};

use self::value::{parameter, raw, up_to, word};
use super::Nordac;
use super::syntax::{
    Bad, Damage, JobKind, JobStep, Message, OctetHarm, Outside, Sender, SetupKind, SlaveLine,
    TelegramHarm, TelegramStep, WantedAnswer, WordKind, WordName, WordValue,
};
use crate::simulate::{self, SlaveSetup};
use harness_bench::counted::counted;
use harness_bench::link::Capability;
use harness_bench::scenario::expression::{Located, Scope};
use harness_bench::scenario::language::Settle;
use harness_bench::scenario::pattern::{Expected, MAX_CELLS};
use harness_bench::scenario::plan::Unroll;
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_bench::scenario::syntax::{Action, Scenario};
use harness_bench::scenario::times::Duration;
use harness_proto::line::LineError;
use harness_proto::nordac::PpoType;
use harness_proto::time::Span;
use harness_sim::fault::{Flips, LinkFault};
use harness_sim::nordac::Stimulus;
use harness_sim::octet_segment::{LineFault, LineFaultAt, TelegramFault};

/// The most telegrams that a scenario sends.
const ROOM: usize = 100_000;
/// The highest address of a slave (2.5.1).
const MOST_ADDRESS: i64 = 126;
/// The address of the bench's master.
pub(super) const MASTER: u8 = 2;

/// A telegram of the master.
#[derive(Clone, Debug)]
pub(crate) struct SentTelegram {
    pub(crate) octets: Vec<u8>,
    /// What is wrong with some of them: the place, counted from 0, and what happens to it.
    pub(crate) bad: Vec<(usize, LinkFault)>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct WantedOctet {
    pub(crate) octet: Expected,
    /// The line error that it must come with.
    pub(crate) error: Option<LineError>,
}

/// A step of this bus, settled.
#[derive(Clone, Debug)]
pub(crate) enum PlannedAct {
    Fault(LineFaultAt),
    /// A slave loses its supply, or has it again.
    Power(u8, bool),
    /// This happens to a slave from outside the bus.
    Outside(u8, Stimulus),
    Restart(u8),
    /// Nothing has come that no line asked for.
    Quiet,
    /// A slave's parameter, beside the bus where it can be seen.
    Parameter(u8, PlannedParameter, u32),
    Job(u8, PlannedJob),
}

#[derive(Clone, Debug)]
pub(crate) enum PlannedJob {
    /// Parameters, configuration and diagnosis.
    Start {
        /// The PPO type that is configured.
        ppo: PpoType,
        /// The watchdog factors; off where there are none.
        watchdog: Option<[u8; 2]>,
    },
    /// One Data_Exchange.
    Exchange {
        send: Vec<(WordName, PlannedWord)>,
        expect: Vec<(WordName, PlannedWord)>,
    },
    Read(PlannedParameter, Option<PlannedWanted>),
    /// A value is written; it must be refused with this error, if one is given.
    Write(PlannedParameter, u32, Option<u16>),
    /// Operation is enabled.
    On,
    /// Down the ramp, and off.
    Off,
    /// Down the quick-stop ramp, and off.
    QuickStop,
    Acknowledge,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlannedWanted {
    /// This raw value.
    Value(u32),
    Error(u16),
}

#[derive(Debug)]
pub(crate) struct Planner {
    bench: simulate::Setup,
    scope: Scope,
}

pub(super) fn settle(
    scenario: &Scenario<Nordac>,
    size: Option<u8>,
    found: &mut Vec<Problem>,
) -> Result<Planner, Problem> {
    let header = &scenario.header;
    let mut slaves: Vec<SlaveSetup> = Vec::new();
    for line in &header.slaves {
        if let Err(problem) = apply(line, &mut slaves) {
            found.push(problem);
        }
    }
    let count = slaves.len();
    if let Some(size) = size.filter(|size| usize::from(*size) != count) {
        let span = header
            .slaves
            .first()
            .map_or(TextSpan::default(), |line| line.span);
        let what = format!(
            "the bench has {}, and the scenario {count}",
            counted(size, "slave")
        );
        return Err(Problem::new(span, what, "as many `slave` lines expected"));
    }
    let rate = header.rate.unwrap_or_default();
    Ok(resume(&simulate::Setup {
        rate,
        slaves,
        master: header.master,
    }))
}

/// What settles one more step.
pub(super) fn resume(bench: &simulate::Setup) -> Planner {
    let count = i64::try_from(bench.slaves.len()).unwrap_or(0);
    Planner {
        scope: Scope::new(count),
        bench: bench.clone(),
    }
}

/// A header line about a slave. One about a slave that no line has named before adds it.
fn apply(line: &SlaveLine, slaves: &mut Vec<SlaveSetup>) -> Result<(), Problem> {
    let address = address(&line.slave, Scope::default())?;
    let place = slaves.iter().position(|slave| slave.address == address);
    let place = place.unwrap_or_else(|| {
        slaves.push(SlaveSetup::new(address));
        slaves.len() - 1
    });
    let slave = &mut slaves[place];
    match &line.what {
        SetupKind::There { ppo, posicon } => {
            slave.ppo = ppo.unwrap_or(slave.ppo);
            slave.posicon |= posicon;
        }
        SetupKind::Property(property, word) => {
            if !property.set(&mut slave.properties, word) {
                let what = format!("the property {} does not take this value", property.name);
                return Err(Problem::new(line.span, what, "another value expected"));
            }
        }
        SetupKind::Deviates(deviation) => slave.deviation = Some(deviation),
        SetupKind::Parameter(name, given) => {
            let parameter = parameter(name, Scope::default())?;
            let raw = raw(given, parameter, Scope::default())?;
            let known = parameter.listed(name.span)?;
            let parameters = &mut slave.parameters;
            parameters.push((known, parameter.index, known.number_of(raw)));
        }
    }
    Ok(())
}

pub(crate) fn address(slave: &Located, scope: Scope) -> Result<u8, Problem> {
    let number = slave.value(scope)?;
    let fits = (1..=MOST_ADDRESS).contains(&number);
    let address = u8::try_from(number).ok().filter(|_| fits);
    address.ok_or_else(|| {
        let what = format!("there is no slave {number} on this bus");
        Problem::new(slave.span, what, "an address from 1 to 126 expected here")
    })
}

impl Planner {
    fn slave(&self, slave: &Located) -> Result<&SlaveSetup, Problem> {
        let address = address(slave, self.scope)?;
        let mut slaves = self.bench.slaves.iter();
        let found = slaves.find(|slave| slave.address == address);
        found.ok_or_else(|| {
            let what = format!("the scenario has no slave {address}");
            let problem = Problem::new(slave.span, what, "a slave of the header expected here");
            problem.help(format!("add the line `slave {address}` to the header"))
        })
    }

    /// The place of a sender on the line: 0 is the master, those of slaves are counted from 1. `None` for all stations.
    fn sender(&self, sender: &Sender) -> Result<Option<usize>, Problem> {
        let slave = match sender {
            Sender::Any => return Ok(None),
            Sender::Master => return Ok(Some(0)),
            Sender::Slave(slave) => self.slave(slave)?.address,
        };
        let mut slaves = self.bench.slaves.iter();
        let place = slaves.position(|setup| setup.address == slave);
        Ok(place.map(|place| place + 1))
    }

    fn fault(
        &self,
        sender: &Sender,
        number: &Located,
        fault: LineFault,
    ) -> Result<PlannedAct, Problem> {
        let value = number.value(self.scope)?;
        let Some(value) = u64::try_from(value).ok().filter(|value| *value > 0) else {
            let what =
                format!("there is no number {value}: bytes and telegrams are counted from 1");
            return Err(Problem::new(number.span, what, "1 or more expected here"));
        };
        Ok(PlannedAct::Fault(LineFaultAt {
            station: self.sender(sender)?,
            number: value,
            fault,
        }))
    }

    fn span(&self, time: Duration) -> Span {
        time.on(self.byte_time())
    }

    fn outside(&self, address: u8, what: &Outside) -> Result<PlannedAct, Problem> {
        let stimulus = match what {
            Outside::Restart => return Ok(PlannedAct::Restart(address)),
            Outside::Link(found) => Stimulus::Link(*found),
            Outside::Fault { number, on } => {
                let number = number.as_ref();
                let number = number.map(|fault| up_to(fault, 25, self.scope, "fault"));
                let number = number.transpose()?.unwrap_or(simulate::ANY_FAULT.into());
                Stimulus::Fault(u8::try_from(number).unwrap_or(0), *on)
            }
        };
        Ok(PlannedAct::Outside(address, stimulus))
    }

    fn job(&self, job: &JobStep) -> Result<PlannedAct, Problem> {
        let slave = self.slave(&job.slave)?;
        let words = |words: &[(WordName, WordValue)]| {
            let planned = words
                .iter()
                .map(|(name, value)| Ok((*name, word(value, self.scope)?)));
            planned.collect::<Result<Vec<_>, Problem>>()
        };
        let planned = match &job.what {
            JobKind::Start { ppo, watchdog } => PlannedJob::Start {
                ppo: ppo.unwrap_or(slave.ppo),
                watchdog: watchdog.map(factors).transpose()?,
            },
            JobKind::Exchange { send, expect } => {
                let unknown = send.iter().find(|(_, value)| match &value.kind {
                    WordKind::Bytes(bytes) => bytes.contains(&None),
                    _ => false,
                });
                if let Some((_, value)) = unknown {
                    let what = "`xx` (any byte) is not allowed where every byte must be known";
                    return Err(Problem::new(value.span, what, "`xx` can only be received"));
                }
                PlannedJob::Exchange {
                    send: words(send)?,
                    expect: words(expect)?,
                }
            }
            JobKind::Read(name, wanted) => {
                let named = parameter(name, self.scope)?;
                let wanted = match wanted {
                    None => None,
                    Some(WantedAnswer::Value(value)) => {
                        Some(PlannedWanted::Value(raw(value, named, self.scope)?))
                    }
                    Some(WantedAnswer::Error(number)) => {
                        Some(PlannedWanted::Error(self.error(number)?))
                    }
                };
                PlannedJob::Read(named, wanted)
            }
            JobKind::Write(name, value, error) => {
                let named = parameter(name, self.scope)?;
                let error = error.as_ref().map(|number| self.error(number));
                PlannedJob::Write(named, raw(value, named, self.scope)?, error.transpose()?)
            }
            JobKind::On => PlannedJob::On,
            JobKind::Off => PlannedJob::Off,
            JobKind::QuickStop => PlannedJob::QuickStop,
            JobKind::Acknowledge => PlannedJob::Acknowledge,
        };
        Ok(PlannedAct::Job(slave.address, planned))
    }

    fn error(&self, number: &Located) -> Result<u16, Problem> {
        up_to(number, 0xFFFF, self.scope, "error number")
    }

    /// What is wrong with an octet of a telegram, and with which.
    fn bad(&self, bad: &Bad, octets: usize) -> Result<(usize, LinkFault), Problem> {
        let number = bad.octet.value(self.scope)?;
        let place = usize::try_from(number)
            .ok()
            .filter(|place| (1..=octets).contains(place));
        let Some(place) = place else {
            let what = format!("the telegram has no byte {number}");
            let expected = format!("1 to {octets} expected here");
            return Err(Problem::new(bad.octet.span, what, expected));
        };
        let fault = match bad.how {
            Damage::Gap(time) => LinkFault::Delay(self.span(time)),
            how => LinkFault::Flip(how.flips()),
        };
        Ok((place - 1, fault))
    }
}

impl Damage {
    fn flips(self) -> Flips {
        let none = Flips::default();
        match self {
            Self::Parity => Flips {
                parity: true,
                ..none
            },
            Self::Stop => Flips { stop: true, ..none },
            Self::Flip(flips) => flips,
            Self::Gap(_) => none,
        }
    }
}

/// The watchdog factors of a time: 10 ms x WD1 x WD2, with the smallest WD1.
fn factors(time: Duration) -> Result<[u8; 2], Problem> {
    let span = time.on(Span::ZERO);
    let ten = Span::from_millis(10).units();
    let tens = span.units() / ten;
    let whole = tens * ten == span.units() && tens > 0;
    let pair = (1..=255_u8).filter(|one| tens.is_multiple_of(u64::from(*one)));
    let mut pair = pair.filter_map(|one| Some([one, u8::try_from(tens / u64::from(one)).ok()?]));
    pair.next().filter(|_| whole).ok_or_else(|| {
        let what = format!("{time} is no time of a DP watchdog");
        let expected = "10 ms times two factors from 1 to 255 expected here";
        Problem::new(time.span(), what, expected)
    })
}

impl Settle<Nordac> for Planner {
    fn unroll<'s>(&self, scenario: &'s Scenario<Nordac>) -> Unroll<'s, Nordac> {
        Unroll::new(&scenario.steps, self.scope)
    }

    fn enter(&mut self, scope: Scope) {
        self.scope = scope;
    }

    fn byte_time(&self) -> Span {
        self.bench.rate.octet_time()
    }

    fn room(&self) -> usize {
        ROOM
    }

    fn send(&self, _port: usize, message: &Message) -> Result<Vec<SentTelegram>, Problem> {
        let octets = message.octets.expand_known(self.scope, MAX_CELLS)?;
        let bad = message.bad.iter();
        let bad = bad.map(|damage| self.bad(damage, octets.len()));
        let bad = bad.collect::<Result<_, _>>()?;
        Ok(vec![SentTelegram { octets, bad }])
    }

    fn receive(&self, _port: usize, message: &Message) -> Result<Vec<WantedOctet>, Problem> {
        let octets = message.octets.expand(self.scope, MAX_CELLS)?;
        let wanted = |octet| WantedOctet { octet, error: None };
        let mut wanted: Vec<_> = octets.into_iter().map(wanted).collect();
        for damage in &message.bad {
            let (place, fault) = self.bad(damage, wanted.len())?;
            let error = match fault {
                LinkFault::Flip(flips) => flips.noticed(),
                _ => None,
            };
            let Some(error) = error else {
                let what = "a receiver does not notice this";
                let expected = "`bad N` or `bad N stop` expected behind `<`";
                return Err(Problem::new(damage.octet.span, what, expected));
            };
            wanted[place].error = Some(error);
        }
        Ok(wanted)
    }

    fn act(
        &mut self,
        step: &TelegramStep,
        _: TextSpan,
        needs: &mut Vec<Capability>,
    ) -> Result<PlannedAct, Problem> {
        Ok(match step {
            TelegramStep::Octet(sender, byte, harm) => {
                needs.push(Capability::Interposer);
                let fault = match harm {
                    OctetHarm::Plain(fault) => *fault,
                    OctetHarm::Delay(time) => LinkFault::Delay(self.span(*time)),
                };
                self.fault(sender, byte, LineFault::Octet(fault))?
            }
            TelegramStep::Telegram(sender, telegram, harm) => {
                needs.push(Capability::Interposer);
                let fault = match harm {
                    TelegramHarm::Plain(fault) => *fault,
                    TelegramHarm::Delay(time) => TelegramFault::Late(self.span(*time)),
                };
                self.fault(sender, telegram, LineFault::Telegram(fault))?
            }
            TelegramStep::Power(slave, on) => {
                needs.push(Capability::Power);
                PlannedAct::Power(self.slave(slave)?.address, *on)
            }
            TelegramStep::Outside(slave, what) => {
                needs.push(match what {
                    Outside::Restart => Capability::Power,
                    Outside::Link(_) | Outside::Fault { .. } => Capability::Simulator,
                });
                self.outside(self.slave(slave)?.address, what)?
            }
            TelegramStep::Quiet => PlannedAct::Quiet,
            TelegramStep::Parameter(slave, name, value) => {
                let named = parameter(name, self.scope)?;
                named.listed(name.span)?;
                PlannedAct::Parameter(
                    self.slave(slave)?.address,
                    named,
                    raw(value, named, self.scope)?,
                )
            }
            TelegramStep::Job(job) => self.job(job)?,
        })
    }

    fn pieces(act: &PlannedAct) -> (usize, usize) {
        match act {
            PlannedAct::Job(..) => (1, 1),
            _ => (0, 0),
        }
    }

    fn judges(act: &PlannedAct) -> bool {
        match act {
            PlannedAct::Fault(_)
            | PlannedAct::Power(..)
            | PlannedAct::Outside(..)
            | PlannedAct::Restart(_) => false,
            PlannedAct::Quiet | PlannedAct::Parameter(..) | PlannedAct::Job(..) => true,
        }
    }

    fn needs(&self, scenario: &Scenario<Nordac>) -> Vec<Capability> {
        let lines = scenario.header.slaves.iter();
        let needs = lines.filter_map(|line| match &line.what {
            // A rig has slaves with properties of their own, which are found out.
            SetupKind::There { .. } | SetupKind::Property(..) => None,
            SetupKind::Parameter(..) => Some(Capability::Memory),
            SetupKind::Deviates(_) => Some(Capability::Simulator),
        });
        let sends = scenario.steps.iter().filter_map(|step| match &step.action {
            Action::Send { message, .. } => Some(message),
            _ => None,
        });
        let damaged = sends.filter(|message| !message.bad.is_empty());
        let master = scenario.header.master.iter();
        needs
            .chain(master.map(|_| Capability::Simulator))
            .chain(damaged.map(|_| Capability::Interposer))
            .collect()
    }

    fn finish(self) -> simulate::Setup {
        self.bench
    }
}
