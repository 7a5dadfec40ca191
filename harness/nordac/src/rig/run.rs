//! NORDAC inverters on which scenarios are played: what their player offers, and what is set back after a scenario.

use super::player::{Player, RigScenario};
use super::profile::ProfileSettings;
use super::qualify::{conversations, qualify};
use super::session::{Inverters, patience_of};
use super::{Session, limits, rate, setup, slaves};
use crate::simulate::Bench;
use crate::stream::TOLERANCE;
use harness_bench::bus_name::BusName;
use harness_bench::link::{Capability, Link, LinkEvent, Replay};
use harness_bench::rig::Rig;
use harness_bench::rig::left::NotPutBack;
use harness_bench::rig::playing::observed::Beats;
use harness_bench::rig::playing::run::PortPlayer;
use harness_bench::rig::playing::{Qualified, RecordedBench};
use harness_bench::rig::session::setup_text;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::{Outcome, Skip};
use harness_bench::scenario::source::Source;
use harness_proto::time::Span;
use std::sync::Arc;

impl PortPlayer for Player {
    const BUS: BusName = BusName::Nordac;
    const ANEW: bool = true;
    type Drives = Inverters;
    type Scenario = RigScenario;

    fn new(rig: &Rig, allow_motion: bool, qualifies: bool) -> Self {
        let port = rig.port();
        let mut player = Self::of(
            port.map(slaves).unwrap_or_default(),
            port.map(rate).unwrap_or_default(),
            port.map_or(Span::ZERO, |port| patience_of(rig, port)),
            limits(rig, allow_motion),
            Self::segment(rig, allow_motion).capabilities,
            rig.is_simulated(),
        );
        if qualifies {
            player.qualify();
        } else {
            player.profile = ProfileSettings::of(rig);
        }
        player
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
        RecordedBench::of(rig, (rate, TOLERANCE), &Bench::CAPABILITIES, permitted)
    }

    fn read(source: &Source) -> Result<RigScenario, Box<Problems>> {
        RigScenario::read(source)
    }

    fn not_begun(&self, scenario: &RigScenario) -> Option<Skip> {
        Self::not_begun(self, scenario)
    }

    fn disturbs(scenario: &RigScenario) -> bool {
        let faults = [
            Capability::Power,
            Capability::Interposer,
            Capability::LineErrors,
        ];
        scenario.plan.needs.iter().any(|need| faults.contains(need))
    }

    fn deviates(rig: &Rig) -> bool {
        let setup = rig.port().map(|port| setup(port, &setup_text(rig)));
        let slaves = setup.and_then(Result::ok).map(|setup| setup.slaves);
        let mut slaves = slaves.into_iter().flatten();
        slaves.any(|slave| slave.deviation.is_some())
    }

    fn replay(&self, events: &[LinkEvent], tolerance: Span) -> Replay {
        Self::replay(self, events, tolerance)
    }

    fn attempt(&mut self, scenario: &Arc<RigScenario>, link: &mut dyn Link) -> (Outcome, String) {
        Self::attempt(self, scenario, link)
    }

    fn set_back(&mut self, _: &RigScenario, session: &mut Session) -> Vec<String> {
        let origin = session.rig().origin.clone();
        self.put_back(session.link(), &origin)
    }

    fn conversations(rig: &Rig) -> Vec<Source> {
        conversations(rig)
    }

    fn qualified(parts: &[&Self], rig: &Rig, began: &str, whole: bool) -> Qualified {
        qualify(parts, rig, began, whole)
    }
}
