//! Conversations of frames as the engine explores them.

use super::act::{FrameAct, FrameActKind, FrameTalk};
use super::generate::{FrameScope, FrameSpice, Maker};
use super::on_sim::OnBench;
use super::oracle::FrameDifference;
use super::play::FramesSeen;
use super::setup::FrameSetup;
use super::text::text;
use crate::buses::Bus;
use crate::explore::smaller::Acts;
use crate::explore::{
    Confirmation, Dice, Differing, ExploreError, Finding, FuzzCase, FuzzSettings, JudgedAgain,
    Pool, Rehearsal, Swarm, Target,
};
use harness_proto::can::Frame;
use harness_proto::unitek::Register;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

impl Differing for FrameDifference {
    fn is_like(&self, other: &Self) -> bool {
        (self.what, self.register) == (other.what, other.register)
    }
    fn key(&self) -> String {
        self.signature()
    }
    fn signature(&self) -> String {
        let register = Register::of(self.register);
        let drive = self
            .drive
            .map_or(String::new(), |drive| format!("drive {drive}: "));
        format!(
            "{drive}{} (UNITEK {}, register {:02X} {})",
            self.what.words(),
            self.section,
            self.register,
            register.name
        )
    }
    fn about(&self) -> &str {
        &self.about
    }
    fn place(&self) -> Option<usize> {
        Some(self.frame)
    }
    fn is_time(&self) -> bool {
        // Virtual time is the same in every attempt.
        false
    }
}

/// Nothing: simulated drives do the same again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoAttempt {}

impl FuzzCase for FrameTalk {
    type Scope = FrameScope;
    type Setup = FrameSetup;
    type Spice = FrameSpice;
    type Seen = FramesSeen;
    type Difference = FrameDifference;
    type Attempt = NoAttempt;
    type Act = FrameAct;

    fn swarm(seed: u64, round: u64, scope: &FrameScope) -> Swarm<FrameSpice> {
        let needed = [FrameSpice::Read, FrameSpice::Cycles];
        Swarm::drawn(seed, round, &scope.spices, (&needed, FrameSpice::Read))
    }

    fn tour(_: &FrameScope, _: &FuzzSettings<Self>) -> Vec<Self> {
        Vec::new()
    }

    fn made(
        scope: &FrameScope,
        swarm: &Swarm<FrameSpice>,
        _: (&[Self], u64),
        pool: &Pool<Self>,
        dice: &mut Dice,
    ) -> Self {
        let maker = Maker::new(scope, swarm);
        let old = dice.percent(50).then(|| pool.pick(0, dice)).flatten();
        let other = pool.pick(0, dice);
        match old {
            Some(old) => maker.mutated(old, other, dice),
            None => maker.case(dice),
        }
    }

    fn lane(&self) -> usize {
        0
    }

    fn text(finding: &Finding<Self>) -> Result<String, ExploreError> {
        let title = format!("Found by fuzzing: {}", finding.difference.signature());
        text(finding, &title)
    }

    fn again(
        finding: &Finding<Self>,
        about: &FuzzSettings<Self>,
        _: &BTreeMap<String, u8>,
    ) -> Result<JudgedAgain, ExploreError> {
        if about.ports {
            return Ok(JudgedAgain::Unknown);
        }
        let mut target = OnBench::new(finding.setup.under_test()?);
        let rehearsal = target.rehearse(&finding.case)?;
        let found = target.attempt(&finding.case, &rehearsal)?.difference;
        Ok(match found == Some(finding.difference.clone()) {
            true => JudgedAgain::Same,
            false => JudgedAgain::Differs(
                "its conversation does not differ as the finding says".to_owned(),
            ),
        })
    }

    fn is_sound(finding: &Finding<Self>) -> bool {
        finding.case.is_bounded() && finding.setup.bus == Bus::Unitek.name()
    }

    fn confirm(
        confirmation: &mut Confirmation<'_>,
        finding: &mut Finding<Self>,
        rehearsal: &Rehearsal<Self>,
        _: Option<&[FrameAct]>,
        target: &mut dyn Target<Self>,
    ) -> Result<(), ExploreError> {
        confirmation.again(finding, rehearsal, target)?;
        if !finding.confirmed {
            confirmation.by_others(finding);
        }
        Ok(())
    }
}

impl Acts for FrameTalk {
    fn acts(&mut self) -> &mut Vec<FrameAct> {
        &mut self.acts
    }

    fn wait(act: &mut FrameAct) -> &mut u64 {
        &mut act.wait_us
    }

    /// Shorter frames, and lower bytes behind the register.
    fn simpler(act: &FrameAct) -> Vec<FrameAct> {
        let FrameActKind::Send(frame) = act.what else {
            return Vec::new();
        };
        if frame.is_remote() {
            return Vec::new();
        }
        let data = frame.data();
        let mut all: Vec<_> = (0..data.len())
            .map(|length| data[..length].to_vec())
            .collect();
        for (index, own) in data.iter().enumerate().skip(1) {
            let lower = [0, 1, own & 0x0F, own / 2].into_iter();
            for byte in lower.filter(|byte| byte < own) {
                let mut other = data.to_vec();
                other[index] = byte;
                all.push(other);
            }
        }
        let frames = all
            .iter()
            .filter_map(|data| Frame::new(frame.id(), data).ok());
        let with = |frame| FrameAct::new(FrameActKind::Send(frame), act.wait_us);
        frames.map(with).collect()
    }

    fn measure(&self) -> (usize, u64, u64) {
        Self::measure(self)
    }
}

/// What a case shows: which request followed which, what a frame was written to, and how the drives answered.
pub(super) fn features(case: &FrameTalk, seen: &FramesSeen) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    let mut before = 0;
    for act in &case.acts {
        let own = kind(&act.what);
        found.insert(hash(&[1, before, own]));
        if let FrameActKind::Send(frame) = &act.what {
            let register = frame.data().first().copied().unwrap_or(0);
            found.insert(hash(&[2, own, register.into()]));
        }
        before = own;
    }
    for frame in &seen.frames {
        let data = frame.frame.data();
        let register = data.first().copied().unwrap_or(0);
        let shown = match register {
            0x40 | 0x51 | 0x8F => data[1..]
                .iter()
                .fold(0, |sum, byte| sum << 8 | u32::from(*byte)),
            _ => 0,
        };
        found.insert(hash(&[3, register.into(), frame.frame.dlc() as u32, shown]));
    }
    found.insert(hash(&[
        4,
        seen.frames.len().min(64).next_power_of_two() as u32,
    ]));
    found
}

/// A number for what an act is.
fn kind(what: &FrameActKind) -> u32 {
    match what {
        FrameActKind::Send(frame) => {
            let length = frame.dlc() as u32;
            let head = 2 * u32::from(frame.is_remote()) + u32::from(frame.id().is_extended());
            let read = match frame.data() {
                [0x3D, _, 0, ..] => 1,
                [0x3D, _, 0xFF, ..] => 2,
                [0x3D, ..] => 3,
                [0x51, low, ..] => 4 + u32::from(*low),
                _ => 0,
            };
            hash(&[length, head, read])
        }
        FrameActKind::Input { on, .. } => 10 + u32::from(*on),
        FrameActKind::Force { .. } => 12,
        FrameActKind::Restart { .. } => 13,
    }
}

/// FNV-1a.
fn hash(words: &[u32]) -> u32 {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.fold(0x811C_9DC5, |hash: u32, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}
