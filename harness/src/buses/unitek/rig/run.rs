//! UNITEK drives on which scenarios are played: what their player offers, and what is set back behind a scenario.

use super::player::{Own, Player, stores};
use super::profile::Profiled;
use super::qualify::{conversations, qualify};
use super::session::UnitekDrives;
use super::{Axis, Session, axes, limits, rate};
use crate::buses::Bus;
use crate::buses::unitek::driver::{Driver, Error};
use crate::buses::unitek::simulate::Bench;
use crate::link::frames::SLACK;
use crate::link::{Link, LinkEvent, Replay};
use crate::rig::Rig;
use crate::rig::port_file::Port;
use crate::rig::port_session::patience;
use crate::rig::segment::observed::Beats;
use crate::rig::segment::run::PortPlayer;
use crate::rig::segment::{OnSegment, Qualified};
use crate::scenario::problem::Problems;
use crate::scenario::run::{Outcome, Skip};
use crate::scenario::source::Source;
use harness_proto::can::BitRate;
use harness_proto::time::Span;
use harness_proto::unitek::frame::Data;
use harness_proto::unitek::master::Job;
use harness_proto::unitek::{Access, Register};
use std::sync::Arc;

/// The shortest time between two writes of 84 (UNITEK ex 7: our choice).
const EEPROM_REST: Span = Span::from_millis(60_000);

/// How long one wait lasts at most: a request to end is looked for between them.
const NAP: Span = Span::from_millis(50);

/// Registers that commands and functions change, which the safe state sets.
const COMMANDS: [u8; 4] = [0x31, 0x51, 0x6E, 0x90];

impl PortPlayer for Player {
    const BUS: Bus = Bus::Unitek;
    const ANEW: bool = false;
    type Drives = UnitekDrives;
    type Own = Own;

    fn new(rig: &Rig, allow_motion: bool, qualifies: bool) -> Self {
        let port = rig.port();
        let segment = Self::segment(rig, allow_motion);
        let mut player = Self::of(
            port.map(axes).unwrap_or_default(),
            port.map_or(BitRate::K500, rate),
            port.map_or(Span::ZERO, patience),
            limits(rig, allow_motion),
            (
                segment.capabilities,
                port.is_none_or(Port::carries_remote_frames),
            ),
        );
        match qualifies {
            true => {
                player.qualify();
                player
            }
            false => player.with_profile(Profiled::of(rig)),
        }
    }

    fn shows_life(&mut self, beats: Beats) {
        self.beats = beats;
    }

    fn segment(rig: &Rig, allow_motion: bool) -> OnSegment {
        let limits = limits(rig, allow_motion);
        let rate = rig.port().map_or(0, |port| rate(port).bits_per_second());
        let permitted = (limits.motion, limits.eeprom);
        OnSegment::of(rig, (rate, SLACK), &Bench::CAPABILITIES, permitted)
    }

    fn read(source: &Source) -> Result<Own, Box<Problems>> {
        Own::read(source)
    }

    fn not_begun(&self, own: &Own) -> Option<Skip> {
        Self::not_begun(self, own)
    }

    fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        Self::replay(self, events, tolerance)
    }

    /// Waits until 84 may be written again.
    fn wait(&mut self, own: &Own, link: &mut dyn Link) {
        if !self.has_stored() || !own.frames().any(stores) {
            return;
        }
        let end = link.now() + EEPROM_REST;
        while link.now() < end && link.trouble().is_none() {
            let now = link.now();
            link.wait(end.min(now + NAP));
            while link.receive(0).is_some() {}
        }
    }

    fn attempt(&mut self, own: &Arc<Own>, link: &mut dyn Link) -> (Outcome, String) {
        Self::attempt(self, own, link)
    }

    /// Sets registers back that a scenario has changed.
    fn set_back(&mut self, own: &Own, session: &mut Session) -> Vec<String> {
        let stored = own.frames().any(stores);
        if stored {
            self.note_stored();
        }
        let mut notes = Vec::new();
        for known in self.known() {
            let axis = known.axis;
            let all = self.written().contains(&(axis.rx, 0x83));
            let changed = |register: &u8| {
                let access = Register::of(*register).access;
                let written = self.written().contains(&(axis.rx, *register));
                (all || written)
                    && matches!(access, Access::RW | Access::SP)
                    && !COMMANDS.contains(register)
            };
            let before = known.cells.iter().filter(|(register, _)| changed(register));
            let mut driver = session.driver();
            for (register, raw) in before {
                notes.extend(set_back(&mut driver, axis, (*register, *raw)));
            }
            if stored && !all {
                notes.push(format!(
                    "drive {}: its EEPROM keeps what the scenario stored; `params save` and `params load` compare and set it",
                    axis.node
                ));
            }
        }
        notes
    }

    fn conversations(rig: &Rig) -> Vec<Source> {
        conversations(&rig.port().map(axes).unwrap_or_default())
    }

    fn qualified(parts: &[&Self], rig: &Rig, began: &str, whole: bool) -> Option<Qualified> {
        Some(qualify(parts, rig, began, whole))
    }
}

/// Sets a register back to what it was. Returns what is left to say.
fn set_back(driver: &mut Driver<'_>, axis: Axis, (register, raw): (u8, u32)) -> Option<String> {
    let name = Register::of(register).name;
    let reads = match driver.read(axis, register) {
        Ok(reply) => reply.data.bits() & Register::of(register).mask(),
        Err(error) => return Some(error.to_string()),
    };
    if reads == raw {
        return None;
    }
    let data = Data::of(Register::of(register), raw);
    let kept = |why: &str| {
        format!(
            "drive {}: register {register:02X} ({name}) reads {reads:X} and is not set back to {raw:X}: {why}",
            axis.node
        )
    };
    if let Some(why) = driver.denied(&[(axis, Job::Write { register, data })]) {
        return Some(kept(&why));
    }
    match driver.write(axis, register, data) {
        Ok(_) => None,
        Err(Error::Differs { .. }) => Some(kept("the drive does not take it")),
        Err(error) => Some(kept(&error.to_string())),
    }
}
