//! Conversations with UNITEK drives behind an adapter.

use super::act::FrameActKind;
use super::generate::FrameSpice;
use super::oracle::FrameDifference;
use super::{FrameTalk, FramesSeen};
use crate::driver::Error;
use crate::gate::GuardsSegment as _;
use crate::judge::{Breach, Follower};
use crate::language::Unitek;
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives, axes, limits};
use harness_bench::explore::ExploreError;
use harness_bench::explore::line::{LineRig, pass};
use harness_bench::link::{Line as _, Link as _};
use harness_bench::medium::Out;
use harness_bench::rig::Rig;
use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_proto::unitek::master::Job;
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::{Data, Register, Request};
use harness_sim::record::LineFrame;

/// How long frames that are under way may take.
const UNDER_WAY: Span = Span::from_millis(60);

/// The safe state sets MODE.
const MODE: u8 = 0x51;

/// What cases write, and what is written back at the end of a run.
const WRITTEN: [u8; 9] = [0xD1, 0xD2, 0xD3, 0xD4, 0x35, 0xED, 0x34, 0x79, 0x52];

/// How often a register is written back that does not take its value: a frame may be lost.
const TRIES: usize = 3;

/// Frames that are sent at a time between cases.
const BURST: usize = 16;

/// What a run has to put right.
#[derive(Debug)]
pub struct Left {
    /// Registers with cycles that earlier cases may have left; all of them before the first case.
    cycles: Vec<u8>,
    /// What the drives held before the run.
    before: Vec<(Axis, u8, Data)>,
}

impl LineRig for Unitek {
    type Drives = UnitekDrives;
    type Kept = Left;

    fn stations(rig: &Rig, _: Option<&Session>) -> Vec<(u8, u16)> {
        let drives = rig.port().map(axes).unwrap_or_default();
        drives.iter().map(|own| (own.node, own.rx)).collect()
    }

    fn possible(rig: &Rig, allow_motion: bool, spice: FrameSpice) -> bool {
        let limits = limits(rig, allow_motion);
        match spice {
            FrameSpice::Read | FrameSpice::Cycles | FrameSpice::Mode => true,
            FrameSpice::Write => limits.motion,
            FrameSpice::Foreign => limits.other_identifiers,
            _ => false,
        }
    }

    fn keep(session: &mut Session) -> Result<Left, ExploreError> {
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
        Ok(Left {
            cycles: (0..=u8::MAX).collect(),
            before,
        })
    }

    fn tidy(session: &mut Session, kept: &mut Left) {
        let registers = std::mem::take(&mut kept.cycles);
        for axis in session.axes().to_vec() {
            let stop = |register: &u8| {
                let register = *register;
                Request::Stop { register }.encode(axis.rx).ok()
            };
            let frames: Vec<Frame> = registers.iter().filter_map(stop).collect();
            for some in frames.chunks(BURST) {
                let until = session.link().send(0, Out::Frames(some));
                let now = session.link().now();
                pass(session, until.since(now) + Span::from_millis(1));
            }
        }
    }

    fn restore(session: &mut Session, kept: &mut Left) -> Vec<String> {
        let mut remarks = Vec::new();
        let mut driver = session.driver();
        for (axis, register, data) in &kept.before {
            // What may not be written was not written by the run either.
            let job = Job::Write {
                register: *register,
                data: *data,
            };
            if !driver.permits(*axis, job) {
                continue;
            }
            let mut written = driver.write(*axis, *register, *data);
            for _ in 1..TRIES {
                if let Err(Error::Differs { .. }) = written {
                    written = driver.write(*axis, *register, *data);
                }
            }
            if let Err(error) = written {
                let name = Register::of(*register).name;
                remarks.push(format!(
                    "drive {}: register {register:02X} ({name}) was not restored: {error}",
                    axis.node
                ));
            }
        }
        remarks
    }

    fn denied(session: &Session, talk: &FrameTalk, seen: &FramesSeen) -> Option<String> {
        let mut gate = session.guarded().segment()?.clone();
        let began = session.guarded().now();
        let mut acts = talk.acts.iter().zip(&seen.done);
        acts.find_map(|(act, at)| match &act.what {
            FrameActKind::Send(frame) => {
                let now = began + at.since_start();
                let denied = gate.admit(now, frame).err().map(|why| why.to_string());
                denied.or_else(|| not_restored(frame))
            }
            _ => Some("only a simulated drive can be switched".to_owned()),
        })
    }

    fn converse(session: &mut Session, kept: &mut Left, talk: &FrameTalk) -> Option<String> {
        for act in &talk.acts {
            if let FrameActKind::Send(frame) = &act.what {
                if let Some(&[0x3D, register, _]) = frame.data().first_chunk() {
                    kept.cycles.push(register);
                }
                session.link().send(0, Out::Frames(&[*frame]));
            }
            pass(session, act.wait());
        }
        pass(session, UNDER_WAY);
        None
    }

    fn judged(session: &Session, _: &Left) -> (Option<FrameDifference>, bool) {
        let trace = session.guarded().trace(0);
        let frames = trace.channels.iter().flat_map(|own| own.frames());
        let frames: Vec<LineFrame> = frames.copied().collect();
        let mut found = Vec::new();
        let mut waits = false;
        for axis in session.axes() {
            let mut follower = Follower::settled(axis.node, (axis.rx, axis.tx));
            for (index, frame) in frames.iter().enumerate() {
                follower.hear(index + 1, frame);
            }
            waits |= follower.waits();
            found.extend(
                follower
                    .end(frames.len(), &frames)
                    .breaches
                    .into_iter()
                    .next(),
            );
        }
        let first = found.into_iter().min_by_key(|own| own.frame);
        (first.map(FrameDifference::from), waits)
    }
}

/// Why a frame is not sent that may change something which the end of a run does not restore, such as identifiers or the EEPROM; `None` if
/// it is sent. A case of which one byte was changed may hold any.
fn not_restored(frame: &Frame) -> Option<String> {
    let rx = u16::try_from(frame.id().number()).ok()?;
    match Request::decode(frame, rx, Dlc4::As3) {
        Ok(Request::Write { register, .. }) if register != MODE && !WRITTEN.contains(&register) => {
            Some(format!(
                "{frame} is not sent: it may change register {register:02X} ({}), which the end of a fuzz run does not restore",
                Register::of(register).name
            ))
        }
        _ => None,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A byte of a case may be changed into a write of identifiers, bit rate, EEPROM, time-out or position: none is sent to a real drive.
    #[test]
    fn what_is_not_restored_is_not_sent() {
        for text in [
            "201#68",
            "201#6810",
            "201#3D4000",
            "201#3D40FF",
            "201#D411223344",
            "201#510400",
            "201#3412FF",
        ] {
            let frame: Frame = text.parse().expect("a frame");
            assert_eq!(not_restored(&frame), None, "{text}");
        }
        for text in [
            "201#681002",
            "201#735C40",
            "201#840000",
            "201#D00500",
            "202#6E00000100",
            "201#8E444D",
            "27E#68010200",
        ] {
            let frame: Frame = text.parse().expect("a frame");
            assert!(not_restored(&frame).is_some(), "{text}");
        }
    }
}
