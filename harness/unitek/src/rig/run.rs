//! UNITEK drives on which scenarios are played: what their player offers.

use super::player::{Player, RigScenario, stores};
use super::profile::ProfileSettings;
use super::qualify::{conversations, qualify};
use super::session::UnitekDrives;
use super::set_back::set_back;
use super::{Session, axes, limits, rate};
use crate::simulate::Bench;
use harness_bench::bus_name::BusName;
use harness_bench::link::frames::SLACK;
use harness_bench::link::{Link, LinkEvent, Replay};
use harness_bench::medium::Out;
use harness_bench::rig::Rig;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::playing::observed::Beats;
use harness_bench::rig::playing::run::PortPlayer;
use harness_bench::rig::playing::{Qualified, RecordedBench};
use harness_bench::rig::port_file::Port;
use harness_bench::rig::session::patience;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::{Outcome, Skip};
use harness_bench::scenario::source::Source;
use harness_proto::can::BitRate;
use harness_proto::time::Span;
use std::sync::Arc;

/// The shortest time between two writes of 84 (UNITEK ex 7: our choice).
const EEPROM_REST: Span = Span::from_millis(60_000);

/// How long one wait lasts at most: a request to end is looked for between them.
const NAP: Span = Span::from_millis(50);

impl PortPlayer for Player {
    const BUS: BusName = BusName::Unitek;
    const ANEW: bool = false;
    type Drives = UnitekDrives;
    type Scenario = RigScenario;

    fn new(rig: &Rig, allow_motion: bool, qualifies: bool) -> Self {
        let port = rig.port();
        let segment = Self::segment(rig, allow_motion);
        let mut player = Self::of(
            port.map(axes).unwrap_or_default(),
            port.map_or(BitRate::K500, rate),
            port.map_or(Span::ZERO, patience),
            limits(rig, allow_motion),
            segment.capabilities,
            port.is_none_or(Port::carries_remote_frames),
        );
        match qualifies {
            true => {
                player.qualify();
                player
            }
            false => player.with_profile(ProfileSettings::of(rig)),
        }
    }

    fn doubt(&mut self) {
        self.forget();
    }

    fn shows_life(&mut self, beats: Beats) {
        self.beats = beats;
    }

    fn tells(&mut self, left: NotPutBack) {
        self.left = left;
    }

    fn segment(rig: &Rig, allow_motion: bool) -> RecordedBench {
        let limits = limits(rig, allow_motion);
        let rate = rig.port().map_or(0, |port| rate(port).bits_per_second());
        let permitted = (limits.motion, limits.eeprom);
        RecordedBench::of(rig, (rate, SLACK), &Bench::CAPABILITIES, permitted)
    }

    fn read(source: &Source) -> Result<RigScenario, Box<Problems>> {
        RigScenario::read(source)
    }

    fn not_begun(&self, scenario: &RigScenario) -> Option<Skip> {
        Self::not_begun(self, scenario)
    }

    fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        Self::replay(self, events, tolerance)
    }

    /// Waits until 84 may be written again, as the guard sees it.
    fn wait(&mut self, scenario: &RigScenario, link: &mut dyn Link) {
        let Some(stores) = scenario.frames().find(|frame| stores(frame)) else {
            return;
        };
        let stores = [*stores];
        let end = link.now() + EEPROM_REST;
        while self.has_stored() && !link.permits(0, Out::Frames(&stores)) {
            let now = link.now();
            if now >= end || link.trouble().is_some() {
                return;
            }
            link.wait(end.min(now + NAP));
            while link.receive(0).is_some() {}
        }
    }

    fn attempt(&mut self, scenario: &Arc<RigScenario>, link: &mut dyn Link) -> (Outcome, String) {
        Self::attempt(self, scenario, link)
    }

    /// Sets registers back that a scenario has changed.
    fn set_back(&mut self, scenario: &RigScenario, session: &mut Session) -> Vec<String> {
        if scenario.frames().any(stores) {
            self.note_stored();
        }
        let (written, stored) = (self.written(), self.stored_levels());
        set_back(session, self.read_so_far(), written, stored)
    }

    fn conversations(rig: &Rig) -> Vec<Source> {
        let limits = limits(rig, rig.file.limits.allow_motion);
        conversations(&rig.port().map(axes).unwrap_or_default(), &limits)
    }

    fn qualified(parts: &[&Self], rig: &Rig, began: &str, whole: bool) -> Qualified {
        qualify(parts, rig, began, whole)
    }
}
