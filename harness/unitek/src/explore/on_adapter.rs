//! Conversations with UNITEK drives behind an adapter.

use super::act::FrameActKind;
use super::generate::FrameSpice;
use super::oracle::FrameDifference;
use super::{FrameTalk, FramesSeen};
use crate::gate::GuardsSegment as _;
use crate::judge::{Breach, Follower};
use crate::language::Unitek;
use crate::rig::OfUnitek as _;
use crate::rig::{HeldBefore, Session, UnitekDrives, axes, limits};
use harness_bench::explore::ExploreError;
use harness_bench::explore::line::{LineRig, ONLY_SIMULATED, pass};
use harness_bench::link::{Line as _, Link as _};
use harness_bench::medium::Out;
use harness_bench::rig::Rig;
use harness_proto::can::Frame;
use harness_proto::time::Span;
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::{Register, Request};
use harness_sim::record::LineFrame;

/// Maximum time until frames under way have come.
const UNDER_WAY: Span = Span::from_millis(60);

/// The bit rate: a drive that takes it at once is lost (3.2, `rate-change`).
const RATE: u8 = 0x73;

/// Number of frames sent at a time between cases.
const BURST: usize = 16;

/// What a run must put back.
#[derive(Debug)]
pub(crate) struct Leftovers {
    /// Registers with cycles that earlier cases may have left; all of them before the first case.
    cycles: Vec<u8>,
    /// What the drives held before the run, and what cases may have written.
    before: HeldBefore,
}

impl LineRig for Unitek {
    type Drives = UnitekDrives;
    type Kept = Leftovers;

    fn stations(rig: &Rig, _: Option<&Session>) -> Vec<(u8, u16)> {
        let drives = rig.port().map(axes).unwrap_or_default();
        drives.iter().map(|axis| (axis.node, axis.rx)).collect()
    }

    fn lacks(rig: &Rig, allow_motion: bool, spice: FrameSpice) -> Option<&'static str> {
        use FrameSpice as Spice;
        let limits = limits(rig, allow_motion);
        let motion = (limits.motion, "allow_motion");
        let eeprom = (limits.eeprom, "allow_eeprom");
        let bus_settings = (limits.bus_settings, "allow_bus_settings");
        let needed: &[_] = match spice {
            Spice::Read | Spice::Cycles | Spice::Mode => &[],
            Spice::Write | Spice::Motion | Spice::Homing => &[motion],
            Spice::Settings => &[bus_settings],
            Spice::Eeprom => &[eeprom],
            Spice::WriteAny => &[motion, eeprom, bus_settings],
            Spice::Foreign => &[(limits.other_identifiers, "allow_other_identifiers")],
            Spice::Lengths | Spice::Inputs | Spice::Power => return Some(ONLY_SIMULATED),
        };
        needed.iter().find(|limit| !limit.0).map(|limit| limit.1)
    }

    fn keep(session: &mut Session) -> Result<Leftovers, ExploreError> {
        let before = HeldBefore::read(session);
        let before = before.map_err(|error| ExploreError::Lost(error.to_string()))?;
        Ok(Leftovers {
            cycles: (0..=u8::MAX).collect(),
            before,
        })
    }

    fn tidy(session: &mut Session, kept: &mut Leftovers) {
        let mut frames = kept.before.reached_again();
        let registers = std::mem::take(&mut kept.cycles);
        for axis in session.axes().to_vec() {
            let stop = |register: &u8| {
                let register = *register;
                Request::Stop { register }.encode(axis.rx).ok()
            };
            frames.extend(registers.iter().filter_map(stop));
        }
        for some in frames.chunks(BURST) {
            let until = session.link().send(0, Out::Frames(some));
            let now = session.link().now();
            pass(session, until.since(now) + Span::from_millis(1));
        }
    }

    fn restore(session: &mut Session, kept: &mut Leftovers) -> Vec<String> {
        kept.before.set_back(session)
    }

    fn denied(session: &Session, talk: &FrameTalk, seen: &FramesSeen) -> Option<String> {
        let mut gate = session.guarded().segment()?.clone();
        let began = session.guarded().now();
        let mut acts = talk.acts.iter().zip(&seen.done);
        acts.find_map(|(act, at)| match &act.what {
            FrameActKind::Send(frame) => {
                let now = began + at.since_start();
                let denied = gate.admit(now, frame).err().map(|why| why.to_string());
                denied.or_else(|| not_reached(frame))
            }
            _ => Some("only a simulated drive can be switched".to_owned()),
        })
    }

    fn converse(session: &mut Session, kept: &mut Leftovers, talk: &FrameTalk) -> Option<String> {
        for act in &talk.acts {
            if let FrameActKind::Send(frame) = &act.what {
                if let Some(&[0x3D, register, _]) = frame.data().first_chunk() {
                    kept.cycles.push(register);
                }
                let end = session.link().send(0, Out::Frames(&[*frame]));
                kept.before.sent(frame, end);
            }
            pass(session, act.wait());
        }
        pass(session, UNDER_WAY);
        None
    }

    fn judged(session: &Session, _: &Leftovers) -> (Option<FrameDifference>, bool) {
        let trace = session.guarded().trace(0);
        let frames = trace.channels.iter().flat_map(|channel| channel.frames());
        let frames: Vec<LineFrame> = frames.copied().collect();
        let mut found = Vec::new();
        let mut waits = false;
        for axis in session.axes() {
            let mut follower = Follower::settled(axis.node, (axis.rx, axis.tx));
            for (index, frame) in frames.iter().enumerate() {
                follower.hear(index + 1, frame);
            }
            waits |= follower.waits();
            let judged = follower.end(frames.len(), &frames);
            found.extend(judged.breaches.into_iter().next());
        }
        let first = found.into_iter().min_by_key(|breach| breach.frame);
        (first.map(FrameDifference::from), waits)
    }
}

/// Why a frame is not sent because the drive may not be reached after it; `None` if it is sent. A mutated case may hold any frame.
fn not_reached(frame: &Frame) -> Option<String> {
    let rx = u16::try_from(frame.id().number()).ok()?;
    match Request::decode(frame, rx, Dlc4::As3) {
        Ok(Request::Write { register: RATE, .. }) => Some(format!(
            "{frame} is not sent: behind register {RATE:02X} ({}) a drive may have another bit rate, from which a fuzz run does not bring it back",
            Register::of(RATE).name
        )),
        _ => None,
    }
}

impl From<Breach> for FrameDifference {
    fn from(breach: Breach) -> Self {
        Self {
            what: breach.what,
            section: breach.section.to_owned(),
            register: breach.register,
            drive: Some(breach.drive),
            frame: breach.frame,
            under: Vec::new(),
            about: breach.about,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A byte of a case may be changed into a write of the bit rate: it is not sent to a real drive.
    #[test]
    fn a_bit_rate_is_not_sent() {
        for text in ["201#3D4000", "201#6E00000100", "201#681002", "201#840000"] {
            let frame: Frame = text.parse().expect("a frame");
            assert_eq!(not_reached(&frame), None, "{text}");
        }
        for text in ["201#735C40", "27E#73020200"] {
            let frame: Frame = text.parse().expect("a frame");
            assert!(not_reached(&frame).is_some(), "{text}");
        }
    }
}
