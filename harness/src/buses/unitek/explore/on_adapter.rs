//! Cases on drives behind an adapter, in real time.

use super::act::{FrameActKind, FrameTalk};
use super::oracle::FrameDifference;
use super::play::play;
use crate::buses::unitek::judge::{Breach, Follower};
use crate::buses::unitek::language::Unitek;
use crate::buses::unitek::rig::{Axis, Session};
use crate::buses::unitek::simulate::Setup;
use crate::explore::line::LineBus as _;
use crate::explore::{ExploreError, Rehearsal, Target, Tried};
use crate::link::{Line as _, Link as _, Trouble};
use crate::medium::Out;
use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_proto::unitek::master::Job;
use harness_proto::unitek::{Data, Register, Request};
use harness_sim::record::LineFrame;

/// How long a case goes on behind its last act at least, and at most while a reply is missing.
const TAIL: [Span; 2] = [Span::from_millis(60), Span::from_millis(1_000)];

/// What cases write, and what is written back at the end of a run.
const WRITTEN: [u8; 9] = [0xD1, 0xD2, 0xD3, 0xD4, 0x35, 0xED, 0x34, 0x79, 0x52];

/// Frames that are sent at a time between cases.
const BURST: usize = 16;

/// Plays cases on drives behind an adapter, and judges what they send as a capture is judged: with any value of every open point, and
/// without what a motor or an input decides. Times are not judged, since a busy computer delays what it reads.
#[derive(Debug)]
pub struct OnAdapter<'s> {
    session: &'s mut Session,
    model: Setup,
    axes: Vec<Axis>,
    /// Registers with cycles that earlier cases may have left; all of them before the first case.
    cycles: Vec<u8>,
    /// What the drives held before the run.
    before: Vec<(Axis, u8, Data)>,
}

impl<'s> OnAdapter<'s> {
    /// Drives of a session; `model` are simulated ones with the same identifiers. Reads what the cases write.
    ///
    /// # Errors
    /// A drive does not answer.
    pub fn new(session: &'s mut Session, model: Setup) -> Result<Self, ExploreError> {
        let axes = session.axes().to_vec();
        let mut before = Vec::new();
        let mut driver = session.driver();
        for axis in &axes {
            for register in WRITTEN {
                let reply = driver.read(*axis, register);
                let reply = reply.map_err(|error| ExploreError::Lost(error.to_string()))?;
                let data = Data::of(Register::of(register), reply.data.bits());
                before.push((*axis, register, data));
            }
        }
        drop(driver);
        Ok(Self {
            session,
            model,
            axes,
            cycles: (0..=u8::MAX).collect(),
            before,
        })
    }

    /// Stops the cycles that are left, and writes back what the drives held before the run, as far as the rig's file permits that.
    /// Returns what could not be restored, in sentences.
    pub fn restore(&mut self) -> Vec<String> {
        let mut remarks = Vec::new();
        if self.stop_cycles().is_err() {
            remarks.push("cycles that the run has started may still run".to_owned());
        }
        let mut driver = self.session.driver();
        for (axis, register, data) in &self.before {
            // What may not be written was not written by the run either.
            let job = Job::Write {
                register: *register,
                data: *data,
            };
            if !driver.permits(*axis, job) {
                continue;
            }
            if let Err(error) = driver.write(*axis, *register, *data) {
                let name = Register::of(*register).name;
                remarks.push(format!(
                    "drive {}: register {register:02X} ({name}) was not restored: {error}",
                    axis.node
                ));
            }
        }
        remarks
    }

    /// Lets `time` pass.
    fn pass(&mut self, time: Span) {
        let link = self.session.link();
        let until = link.now() + time;
        while link.now() < until && link.trouble().is_none() {
            link.wait(until);
            while link.receive(0).is_some() {}
        }
    }

    fn stop_cycles(&mut self) -> Result<(), ExploreError> {
        let registers = std::mem::take(&mut self.cycles);
        for axis in self.axes.clone() {
            let stop = |register: &u8| {
                Request::Stop {
                    register: *register,
                }
                .encode(axis.rx)
                .ok()
            };
            let frames: Vec<Frame> = registers.iter().filter_map(stop).collect();
            for some in frames.chunks(BURST) {
                let until = self.session.link().send(0, Out::Frames(some));
                let now = self.session.link().now();
                self.pass(until.since(now) + Span::from_millis(1));
            }
        }
        // What was in flight comes.
        self.pass(TAIL[0]);
        self.sound()
    }

    fn sound(&mut self) -> Result<(), ExploreError> {
        match self.session.link().trouble() {
            Some(trouble @ (Trouble::Lost(_) | Trouble::Garbled(_) | Trouble::Interlock(_))) => {
                Err(ExploreError::Lost(trouble.to_string()))
            }
            _ => Ok(()),
        }
    }

    /// What came, judged from nothing but these frames; and whether a reply is missing.
    fn judged(&mut self) -> (Option<Breach>, bool) {
        let trace = self.session.link().trace(0);
        let frames = trace.channels.iter().flat_map(|own| own.frames());
        let frames: Vec<LineFrame> = frames.copied().collect();
        let mut first: Option<Breach> = None;
        let mut waits = false;
        for axis in &self.axes {
            let mut follower = Follower::settled(axis.node, (axis.rx, axis.tx));
            for (index, frame) in frames.iter().enumerate() {
                follower.hear(index + 1, frame);
            }
            waits |= follower.waits();
            let own = follower.end(&frames).breaches.into_iter().next();
            first = match (first, own) {
                (Some(a), Some(b)) => Some(if b.frame < a.frame { b } else { a }),
                (a, b) => a.or(b),
            };
        }
        (first, waits)
    }
}

impl Target<FrameTalk> for OnAdapter<'_> {
    fn rehearse(&mut self, case: &FrameTalk) -> Result<Rehearsal<FrameTalk>, ExploreError> {
        let seen = play(&self.model, case);
        let link = self.session.link();
        let (mut gate, mut now) = (link.segment().cloned(), link.now());
        let mut denied = None;
        for act in &case.acts {
            match (&act.what, &mut gate) {
                (FrameActKind::Send(frame), Some(gate)) => {
                    if let Err(why) = gate.admit(now, frame) {
                        denied.get_or_insert(why.to_string());
                    }
                }
                (FrameActKind::Send(_), None) => {}
                _ => {
                    denied.get_or_insert("only a simulated drive can be switched".to_owned());
                }
            }
            now += act.wait();
        }
        Ok(Rehearsal {
            took: seen.took + TAIL[0] + TAIL[0],
            features: Unitek::features(case, &seen),
            seen,
            denied,
            of_model: None,
        })
    }

    fn attempt(
        &mut self,
        case: &FrameTalk,
        rehearsal: &Rehearsal<FrameTalk>,
    ) -> Result<Tried<FrameTalk>, ExploreError> {
        self.stop_cycles()?;
        self.session.link().begin();
        for act in &case.acts {
            if let FrameActKind::Send(frame) = &act.what {
                if let Some(&[0x3D, register, _]) = frame.data().first_chunk() {
                    self.cycles.push(register);
                }
                self.session.link().send(0, Out::Frames(&[*frame]));
            }
            self.pass(act.wait());
        }
        self.pass(TAIL[0]);
        let end = self.session.link().now() + TAIL[1];
        let (mut found, mut waits) = self.judged();
        while waits && self.session.link().now() < end && self.session.link().trouble().is_none() {
            self.pass(TAIL[0]);
            (found, waits) = self.judged();
        }
        self.sound()?;
        let not_played = self.session.link().trouble().map(ToString::to_string);
        self.session.link().reset_after_denial();
        let played = not_played.is_none();
        Ok(Tried {
            took: rehearsal.took,
            difference: found.filter(|_| played).map(FrameDifference::from),
            before: None,
            not_played,
        })
    }

    fn over(&mut self) -> Option<String> {
        let interrupted = self.session.link().trouble() == Some(&Trouble::Interrupted);
        interrupted.then(|| "the run was interrupted".to_owned())
    }
}

impl From<Breach> for FrameDifference {
    fn from(own: Breach) -> Self {
        Self {
            what: own.what,
            section: own.section.to_owned(),
            register: own.register,
            drive: Some(own.drive),
            frame: own.frame,
            under: Vec::new(),
            about: own.about,
        }
    }
}
