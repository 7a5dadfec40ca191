//! Judges whether the reports of a master are true.

use super::wire;
use super::work::{BITS, JobOrder, Work, constant, nominal};
use crate::novobus::counted::Counted;
use crate::novobus::ring::Ring;
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Event, Fault, JobId, LinkEnd, Outcome, RingLink};
use std::borrow::Cow;
use std::fmt;

/// An act or a report of a master that breaks the manual.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lie {
    /// The section of the ND21's manual that is broken.
    pub section: &'static str,
    /// What is wrong, in a sentence.
    pub what: Cow<'static, str>,
}

impl Lie {
    pub(super) fn new(section: &'static str, what: impl Into<Cow<'static, str>>) -> Self {
        Self {
            section,
            what: what.into(),
        }
    }
}

impl fmt::Display for Lie {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (ND21 {})", self.what, self.section)
    }
}

/// Where DataIn points to: the cell that process data are written to (ND21 14.10.3).
pub(super) const DATA_IN: u16 = 0xFF10;
/// Where DataOut points to.
pub(super) const DATA_OUT: u16 = 0xFF18;

/// Byte times within which the master must report a wrong byte: one round trip, slack, a spelled-out address, the wait for drives with
/// monitoring.
const PATIENCE: u64 = 450;

/// Everything that is known of a run.
pub(super) struct Judge<'w> {
    pub(super) work: &'w Work,
    /// What was sent, and what was heard.
    pub(super) sent: Vec<u8>,
    heard: Vec<Received>,
    /// The byte time in which each was heard.
    heard_in: Vec<u64>,
    /// How many byte times there have been.
    pub(super) steps: u64,
    /// How many bytes had been heard when the master first reported a disturbance.
    first_told: Option<usize>,
    pub(super) stopped: bool,
    /// When the ring was back for the last time; `None` while something is wrong.
    runs_since: Option<u64>,
    jobs: Vec<(JobId, JobOrder, bool)>,
}

impl<'w> Judge<'w> {
    pub(super) fn new(work: &'w Work) -> Self {
        Self {
            work,
            sent: Vec::new(),
            heard: Vec::new(),
            heard_in: Vec::new(),
            steps: 0,
            first_told: None,
            stopped: false,
            runs_since: Some(0),
            jobs: Vec::new(),
        }
    }

    pub(super) fn heard(&mut self, received: Received) {
        self.heard.push(received);
        self.heard_in.push(self.steps);
    }

    pub(super) fn given(&mut self, id: JobId, order: JobOrder) {
        self.jobs.push((id, order, false));
    }

    /// How many jobs have not ended.
    pub(super) fn open(&self) -> usize {
        self.jobs.iter().filter(|(.., ended)| !ended).count()
    }

    /// Takes an event that the master reports.
    pub(super) fn hear(&mut self, event: &Event, ring: &Ring<Counted>) -> Result<(), Lie> {
        match event {
            Event::Ready | Event::Round { .. } => Ok(()),
            Event::Recovered { .. } => {
                self.runs_since = Some(self.steps);
                Ok(())
            }
            Event::Disturbed { fault, .. } => {
                self.runs_since = None;
                self.disturbed(*fault)
            }
            Event::Stopped(_) => {
                self.stopped = true;
                let text = "it stopped the bus, and no link is broken";
                let rightly = self.work.may_stop();
                rightly.then_some(()).ok_or_else(|| Lie::new("11.5", text))
            }
            Event::Ended { id, outcome } => {
                let text = format!(
                    "it told of the end of job {}, which is not open",
                    id.number()
                );
                let wrong = || Lie::new("11.6", text);
                let open = self.jobs.iter_mut().find(|(known, ..)| known == id);
                let (_, order, ended) = open.ok_or_else(wrong)?;
                if std::mem::replace(ended, true) {
                    let text = format!("it told twice of the end of job {}", id.number());
                    return Err(Lie::new("11.6", text));
                }
                let order = *order;
                self.ended(&order, outcome, ring)
            }
        }
    }

    fn disturbed(&mut self, fault: Fault) -> Result<(), Lie> {
        if self.work.faults.is_empty() {
            let text = format!("it told that {fault}, and nothing was wrong");
            return Err(Lie::new("8.2", text));
        }
        if self.first_told.replace(self.heard.len()).is_some() {
            return Ok(());
        }
        let Some(link) = self.work.damaged() else {
            return Ok(());
        };
        let drives = usize::from(self.work.drives);
        let place = |named: RingLink| match named.to {
            LinkEnd::Master => drives,
            LinkEnd::Drive(drive) => drives - 1 - usize::from(drive),
        };
        match fault {
            Fault::Damaged(named) if place(named) == link => Ok(()),
            other => Err(Lie::new(
                "9.7",
                format!("it told that {other}, and a bit was inverted on link {link}"),
            )),
        }
    }

    fn ended(&self, order: &JobOrder, outcome: &Outcome, ring: &Ring<Counted>) -> Result<(), Lie> {
        let job = &order.job;
        let Some(drive) = ring.drive(job.drive) else {
            return Ok(());
        };
        let runs = drive.memory.written(order.address);
        let told = |section, what: &str| {
            let text = format!("{what}: {job:?} ran {runs} times, told is {outcome:?}");
            Err(Lie::new(section, text))
        };
        if self.work.may_fool() {
            return Ok(());
        }
        if *job == job.once() && runs > 1 {
            return told("11.5", "a job that must not be repeated was repeated");
        }
        match outcome {
            Outcome::Read(_) if !job.command.kind().reads() => {
                told("11.6", "a write read something")
            }
            Outcome::Read(data) => {
                let width = u16::from(job.command.kind().width());
                let read: Vec<_> = (0..4).filter_map(|i| data.byte(i)).collect();
                let cells = order.address..order.address + width;
                let there: Vec<_> = cells.map(|cell| constant(job.drive, cell)).collect();
                // ReadLong has no check of its own.
                let fooled = width == 4 && self.work.unchecked();
                match read == there || fooled {
                    true => Ok(()),
                    false => told("10.1", "the data are others"),
                }
            }
            Outcome::Done { .. } if job.command.kind().reads() => told("11.6", "a read wrote"),
            Outcome::Done { perhaps_twice } => {
                if runs == 0 {
                    return told("9.6", "a job that has not run is done");
                }
                if runs > 1 && !perhaps_twice {
                    return told("11.5", "a job has run twice");
                }
                if *perhaps_twice && *job == job.once() {
                    return told("11.5", "a job that must not be repeated may have been");
                }
                match holds(order, drive) {
                    true => Ok(()),
                    false => told("10.2", "the cell holds something else"),
                }
            }
            Outcome::Unknown(_) => Ok(()),
            Outcome::Failed(_) if runs > 0 => told("11.5", "a job that failed has run"),
            Outcome::Failed(_) => Ok(()),
        }
    }

    /// Judges the whole run, once it is over.
    pub(super) fn end(&self, ring: &Ring<Counted>) -> Result<(), Lie> {
        let wire = wire::read(self.work.drives, &self.sent)?;
        let asked = self.jobs.iter().map(|(_, order, _)| order.job);
        let asked: Vec<_> = asked.map(|job| (job.drive, job.command)).collect();
        wire.asked_for(&asked)?;
        self.told_in_time(&wire.back)?;
        self.strays(ring)
    }

    /// The master reports a wrong byte (11.5).
    fn told_in_time(&self, back: &[wire::Back]) -> Result<(), Lie> {
        let compared = self.first_told.unwrap_or(self.heard.len());
        let heard = &self.heard[..compared.min(self.heard.len())];
        let wrong = wire::first_wrong(back, heard);
        let told = self.first_told.is_some();
        let long_ago = |index: &usize| {
            let heard_in = self.heard_in.get(*index);
            heard_in.is_some_and(|step| step + PATIENCE < self.steps)
        };
        match wrong.filter(|index| !told && long_ago(index)) {
            Some(index) => Err(Lie::new(
                "11.5",
                format!(
                    "byte {} came back wrong, and it was not reported",
                    index + 1
                ),
            )),
            None => Ok(()),
        }
    }

    /// No drive was written to without a job that asks for it.
    fn strays(&self, ring: &Ring<Counted>) -> Result<(), Lie> {
        for k in 0..self.work.drives {
            let Some(drive) = ring.drive(k) else { continue };
            let asked = |address: u16| {
                let by_job = |order: &JobOrder| {
                    let width = u16::from(order.job.command.kind().width());
                    order.job.drive == k
                        && (order.address..order.address + width).contains(&address)
                };
                let exchange = self.work.exchange && (DATA_IN..DATA_IN + 2).contains(&address);
                exchange
                    || address == ram::BUS_ADDR
                    || self.jobs.iter().any(|(_, order, _)| by_job(order))
            };
            // A missing or extra byte can turn other bytes into process data. So can a drive that missed the check sequence because of
            // a second fault and sends received + 1 (9.7): 88 becomes 89.
            let stray = drive.memory.all_written().find(|address| !asked(*address));
            if let Some(address) =
                stray.filter(|_| !self.work.may_fool() && self.work.faults.len() < 2)
            {
                let text = format!("cell {address:04X} of drive {k} was written without a request");
                return Err(Lie::new("9.3", text));
            }
            let value = [drive.memory.peek(DATA_IN), drive.memory.peek(DATA_IN + 1)];
            let written = drive.memory.written(DATA_IN) > 0;
            // A drive that gets the zeros of another takes them too, until the next round.
            let runs = match (self.work.faults.len(), self.runs_since) {
                (0, _) => true,
                (1, Some(step)) => step > 0 && step + PATIENCE < self.steps,
                _ => false,
            };
            let sure = runs && !self.work.unchecked() && !self.stopped && !self.work.is_cut();
            if self.work.exchange && written && sure && value != nominal(k).to_be_bytes() {
                let text = format!("drive {k} got {value:02X?} as process data");
                return Err(Lie::new("9.4", text));
            }
        }
        Ok(())
    }
}

/// Whether the cell of a write holds what the write must leave there.
fn holds(order: &JobOrder, drive: &Counted) -> bool {
    let cell = drive.memory.peek(order.address);
    match order.job.command {
        Command::WriteByte { data, .. } => cell == data,
        Command::WriteWord { data, .. } => {
            [cell, drive.memory.peek(order.address + 1)] == data.to_be_bytes()
        }
        Command::And { data, .. } => cell == BITS & data,
        Command::Or { data, .. } => cell == BITS | data,
        _ => true,
    }
}
