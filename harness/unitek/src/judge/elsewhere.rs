//! Frames of hosts on other identifiers: a second pair may have been set in 88 and 89 before the first frame (`second-identifiers`).

use super::follower::Follower;
use harness_proto::can::Frame;
use harness_proto::time::Instant;
use harness_proto::unitek::Request;
use harness_proto::unitek::properties::Dlc4;
use std::collections::BTreeMap;

/// What hosts have sent on identifiers that are neither the drive's nor those of another one.
#[derive(Clone, Debug, Default)]
pub(super) struct Elsewhere {
    /// On which the other drives receive, where that is known.
    pub(super) declared: Vec<u16>,
    /// When a register was last asked for, on which identifier, and whether again and again.
    asked: BTreeMap<u8, (Instant, u16, bool)>,
    /// The identifier on which a register was last written.
    written: BTreeMap<u8, u16>,
}

impl Elsewhere {
    pub(super) fn hear(&mut self, frame: &Frame, at: Instant) {
        let id = u16::try_from(frame.id().number()).ok();
        let Some(id) = id.filter(|id| !self.declared.contains(id)) else {
            return;
        };
        match Request::decode(frame, id, Dlc4::As3) {
            Ok(Request::Read { register }) => _ = self.asked.insert(register, (at, id, false)),
            Ok(Request::Cycle { register, .. }) => {
                self.asked.insert(register, (at, id, true));
            }
            Ok(Request::Write { register, .. }) => _ = self.written.insert(register, id),
            Ok(Request::Stop { .. }) | Err(_) => {}
        }
    }

    fn doubt(id: u16) -> String {
        format!(
            "a host has sent that on {id:03X}, which may be its second identifier (88), set before the first frame"
        )
    }
}

impl Follower {
    /// Why a frame of a register that nothing asks for may be right all the same.
    pub(super) fn asked_elsewhere(&self, register: u8, at: Instant) -> Option<String> {
        let (asked, id, cycle) = self.elsewhere.asked.get(&register)?;
        let fits = *cycle || at.since(*asked) <= self.patience;
        fits.then(|| Elsewhere::doubt(*id))
    }

    /// Why a register may have been written that reads something else.
    pub(super) fn written_elsewhere(&self, register: u8) -> Option<String> {
        let id = self.elsewhere.written.get(&register)?;
        Some(Elsewhere::doubt(*id))
    }
}
