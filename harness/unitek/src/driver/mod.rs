//! Typed calls to UNITEK drives: requests with a time-out, writes that are read back, cycles, start-up and lock.
//!
//! It runs one sans-IO [`CanMaster`] a drive over a [`Line`]. A call blocks until its result is there. It returns early when the line is in
//! trouble.

mod error;

pub(crate) use error::Error;

use super::rig::Axis;
use harness_bench::link::Line;
use harness_bench::medium::{HeardPiece, Out};
use harness_proto::can::{self, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::frame::{Data, Reply};
use harness_proto::unitek::master::{CanMaster, Job, JobNumber, MasterEvent, Options, Outcome};
use harness_proto::unitek::words::MODE_LOCK;
use std::collections::VecDeque;
use std::fmt;

const MOST_EVENTS: usize = 4096;

/// How long a start-up waits for ready, and for the hardware enable (ex 11).
const START_UP: Span = Span::from_millis(2_000);

/// How long a drive behind an adapter may be silent before one has not answered: the computer or the adapter may stand still for that long.
const SILENCE: Span = Span::from_millis(2_500);

/// What a drive is asked for while it is silent, and how long the line is left alone after each request.
const ALIVE: (u8, Span) = (0x40, Span::from_millis(50));

/// How long replies are waited for that belong to requests from the time of a silence.
const SETTLES: Span = Span::from_millis(300);

/// The registers of a speed and of a torque command.
const COMMANDS: [u8; 2] = [0x31, 0x90];

/// MODE (ex 2).
const MODE: u8 = 0x51;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopKind {
    /// Its speed command is 0: it stops on its ramp.
    OnRamp,
    /// It is locked, and its commands are 0: it coasts. The rig's file does not permit a speed command.
    Locked,
}

/// The drives of a segment.
pub(crate) struct Driver<'l> {
    line: Box<dyn Line + 'l>,
    drives: Vec<Drive>,
    events: VecDeque<(Instant, Axis, MasterEvent)>,
    /// How long a drive may be silent that was asked as often as a request is repeated.
    silence: Span,
}

struct Drive {
    axis: Axis,
    master: CanMaster,
    ended: Vec<(JobNumber, Outcome)>,
}

impl fmt::Debug for Driver<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes: Vec<_> = self.axes().collect();
        f.debug_struct("Driver")
            .field("axes", &axes)
            .finish_non_exhaustive()
    }
}

impl<'l> Driver<'l> {
    /// A driver of these drives; nothing is sent. A reply may take `patience`.
    #[must_use]
    pub(crate) fn new(line: Box<dyn Line + 'l>, axes: &[Axis], patience: Span) -> Self {
        let options = Options {
            time_out: patience,
            ..Options::default()
        };
        let drive = |&axis: &Axis| Drive {
            axis,
            master: CanMaster::new(axis.rx, axis.tx, options),
            ended: Vec::new(),
        };
        Self {
            line,
            drives: axes.iter().map(drive).collect(),
            events: VecDeque::new(),
            silence: Span::ZERO,
        }
    }

    /// The same driver, which outlasts a computer or an adapter that stands still, where `tolerance` says that time is real.
    #[must_use]
    pub(crate) fn outlasting(self, tolerance: Span) -> Self {
        let silence = match tolerance {
            Span::ZERO => Span::ZERO,
            _ => SILENCE,
        };
        Self { silence, ..self }
    }

    pub(crate) fn axes(&self) -> impl Iterator<Item = Axis> {
        self.drives.iter().map(|drive| drive.axis)
    }

    #[must_use]
    pub(crate) fn now(&self) -> Instant {
        self.line.now()
    }

    /// Reads a register (UNITEK 5.2). The reply may have 4 or 6 bytes.
    ///
    /// # Errors
    /// [`Error::NoReply`], [`Error::Link`].
    pub(crate) fn read(&mut self, axis: Axis, register: u8) -> Result<Reply, Error> {
        match self.run_job(axis, Job::Read { register })? {
            Outcome::Read(reply) => Ok(reply),
            other => Err(Error::of(axis, register, other)),
        }
    }

    /// Writes a register. RW and SP registers are read back; of others it is not known what became of them, and this returns `None`.
    ///
    /// # Errors
    /// [`Error::Differs`] where the register reads differently, [`Error::NoReply`], [`Error::Link`].
    pub(crate) fn write(
        &mut self,
        axis: Axis,
        register: u8,
        data: Data,
    ) -> Result<Option<Reply>, Error> {
        match self.run_job(axis, Job::Write { register, data })? {
            Outcome::Written(reply) => Ok(Some(reply)),
            Outcome::Sent => Ok(None),
            other => Err(Error::of(axis, register, other)),
        }
    }

    /// Lets a drive send a register every 1 to 254 ms, and returns the first value.
    ///
    /// # Errors
    /// [`Error::Refused`] for a ninth cycle or another interval, [`Error::NoReply`], [`Error::Link`].
    #[cfg(test)]
    pub(crate) fn every(&mut self, axis: Axis, register: u8, millis: u8) -> Result<Reply, Error> {
        let every = millis;
        match self.run_job(axis, Job::Cycle { register, every })? {
            Outcome::Started(reply) => Ok(reply),
            other => Err(Error::of(axis, register, other)),
        }
    }

    /// Stops the cycle of a register.
    ///
    /// # Errors
    /// [`Error::Link`].
    pub(crate) fn stop_every(&mut self, axis: Axis, register: u8) -> Result<(), Error> {
        self.run_job(axis, Job::Stop { register }).map(|_| ())
    }

    /// Stops a drive: its speed command becomes 0. Where the rig's file permits no command, the drive is [locked](Self::lock).
    ///
    /// # Errors
    /// See [`Self::write`].
    pub(crate) fn stop(&mut self, axis: Axis) -> Result<StopKind, Error> {
        if self.permits_write(axis, COMMANDS[0], 0) {
            self.write(axis, COMMANDS[0], Data::Short(0))?;
            Ok(StopKind::OnRamp)
        } else {
            self.lock(axis)?;
            Ok(StopKind::Locked)
        }
    }

    /// Locks a drive, and sets its commands to 0 (ex 2): it has no torque. Needs no permission.
    ///
    /// # Errors
    /// See [`Self::write`].
    pub(crate) fn lock(&mut self, axis: Axis) -> Result<(), Error> {
        self.write(axis, MODE, Data::Short(MODE_LOCK))?;
        for register in COMMANDS {
            self.write(axis, register, Data::Short(0))?;
        }
        Ok(())
    }

    /// Releases a drive by the routine of ex 11: ready, lock, commands 0, hardware enable, release. The motor may turn from now on.
    ///
    /// # Errors
    /// [`Error::NotReady`]: it is locked then. [`Error::Differs`], [`Error::NoReply`], [`Error::Link`].
    pub(crate) fn release(&mut self, axis: Axis) -> Result<(), Error> {
        match self.run_job(axis, Job::StartUp { patience: START_UP })? {
            Outcome::Released => Ok(()),
            other => Err(Error::of(axis, MODE, other)),
        }
    }

    /// Lets time pass while frames are received.
    ///
    /// # Errors
    /// [`Error::Link`].
    pub(crate) fn run(&mut self, time: Span) -> Result<(), Error> {
        let end = self.now() + time;
        while self.now() < end {
            self.pause();
            let now = self.now();
            // A pause that is not possible now is not waited for.
            let due = self.line.pause_due().filter(|due| *due > now);
            self.pump(due.unwrap_or(end).min(end), |_| false)?;
        }
        self.pump(end, |_| false)
    }

    /// Lets the line make its own queries where they are due: nothing is under way.
    fn pause(&mut self) {
        let now = self.now();
        if self.line.pause_due().is_some_and(|due| due <= now) {
            self.receive();
            self.collect();
            self.line.pause();
        }
    }

    /// Cyclic frames, events and disturbances that were received since the last call, with their times.
    #[cfg(test)]
    pub(crate) fn events(&mut self) -> impl Iterator<Item = (Instant, Axis, MasterEvent)> {
        self.events.drain(..)
    }

    /// Whether the line lets a write of 16 bits pass now.
    #[must_use]
    pub(crate) fn permits_write(&self, axis: Axis, register: u8, value: u16) -> bool {
        let data = Data::Short(value);
        self.permits(axis, Job::Write { register, data })
    }

    /// Whether the line lets the first frame of a job pass now.
    #[must_use]
    pub(crate) fn permits(&self, axis: Axis, job: Job) -> bool {
        let Some(drive) = self.drives.iter().find(|drive| drive.axis == axis) else {
            return false;
        };
        // A copy of the master says which frame it would send.
        let mut master = drive.master.clone();
        let frame = match master.submit(job) {
            Ok(_) => master.poll_transmit(self.line.now()),
            Err(_) => None,
        };
        frame.is_some_and(|frame| self.line.permits(0, Out::Frames(&[frame])))
    }

    /// Why the first of some jobs that the line denies is denied; `None` if the line lets all of them pass, one after the other. Nothing is
    /// sent.
    #[must_use]
    pub(crate) fn denied(&self, jobs: &[(Axis, Job)]) -> Option<String> {
        let mut frames = Vec::new();
        for (axis, job) in jobs {
            let drive = self.drives.iter().find(|drive| drive.axis == *axis)?;
            let mut master = drive.master.clone();
            let _taken = master.submit(*job).ok()?;
            frames.extend(master.poll_transmit(self.line.now()));
        }
        self.line.denied(0, Out::Frames(&frames))
    }

    /// Runs a job to its end. Where a drive is silent, it is asked until it answers or was silent for too long, and the job is run again then.
    fn run_job(&mut self, axis: Axis, job: Job) -> Result<Outcome, Error> {
        let outcome = self.run_once(axis, job)?;
        if self.silence == Span::ZERO || !matches!(outcome, Outcome::NoReply { .. }) {
            return Ok(outcome);
        }
        let (register, pause) = ALIVE;
        let until = self.now() + self.silence;
        while self.now() < until {
            match self.run_once(axis, Job::Read { register })? {
                Outcome::NoReply { .. } => self.run(pause)?,
                _ => {
                    // It answers everything that it was asked meanwhile.
                    self.run(SETTLES)?;
                    return self.run_once(axis, job);
                }
            }
        }
        // It is not waited for again.
        self.silence = Span::ZERO;
        Ok(outcome)
    }

    fn run_once(&mut self, axis: Axis, job: Job) -> Result<Outcome, Error> {
        let place = self.drives.iter().position(|drive| drive.axis == axis);
        let place = place.ok_or(Error::NoSuchDrive(axis.node))?;
        self.pause();
        let submitted = self.drives[place].master.submit(job);
        let id = submitted.map_err(Error::Refused)?;
        let has_ended =
            move |drives: &[Drive]| drives[place].ended.iter().any(|(ended, _)| *ended == id);
        self.pump(Instant::NEVER, has_ended)?;
        let ended = &mut self.drives[place].ended;
        let found = ended.iter().position(|(ended, _)| *ended == id);
        found.map_or(Err(Error::NoSuchDrive(axis.node)), |at| {
            Ok(ended.swap_remove(at).1)
        })
    }

    /// Sends, receives and waits until `end`, or until `done` says so.
    fn pump(&mut self, end: Instant, done: impl Fn(&[Drive]) -> bool) -> Result<(), Error> {
        loop {
            self.receive();
            self.transmit()?;
            self.collect();
            if let Some(trouble) = self.line.trouble() {
                return Err(Error::Link(trouble.clone()));
            }
            let now = self.line.now();
            if done(&self.drives) || now >= end {
                return Ok(());
            }
            let due = self
                .drives
                .iter()
                .filter_map(|drive| drive.master.poll_timeout());
            let next = due.chain([end]).min().unwrap_or(end);
            let _all_is_over = self.line.wait(next);
        }
    }

    fn receive(&mut self) {
        while let Some((at, heard)) = self.line.receive(0) {
            match heard {
                HeardPiece::Frame(can::CanEvent::Frame(frame)) => self.hear(at, &frame),
                HeardPiece::Frame(can::CanEvent::Error(_)) | HeardPiece::Octet(_) => {}
            }
        }
    }

    fn hear(&mut self, at: Instant, frame: &Frame) {
        for drive in &mut self.drives {
            drive.master.handle_frame(at, frame);
        }
    }

    fn transmit(&mut self) -> Result<(), Error> {
        let now = self.line.now();
        for drive in &mut self.drives {
            drive.master.handle_timeout(now);
            while let Some(frame) = drive.master.poll_transmit(now) {
                self.line.send(0, Out::Frames(&[frame]));
                if self.line.refused() > 0
                    && let Some(trouble) = self.line.trouble()
                {
                    return Err(Error::Link(trouble.clone()));
                }
            }
        }
        Ok(())
    }

    fn collect(&mut self) {
        let now = self.line.now();
        for drive in &mut self.drives {
            while let Some(event) = drive.master.poll_event() {
                match event {
                    MasterEvent::Ended { id, outcome } => drive.ended.push((id, outcome)),
                    event if self.events.len() < MOST_EVENTS => {
                        self.events.push_back((now, drive.axis, event));
                    }
                    _ => {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
