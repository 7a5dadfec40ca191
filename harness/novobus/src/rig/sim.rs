//! Simulated rigs: what their drives are before anything is sent.

use super::{condition, limits};
use crate::language::parse::drive::DEVICES;
use crate::language::parse::header::{for_other_rings, parse_lines};
use crate::language::plan::{Plan, plan_header};
use crate::language::syntax::{DriveRange, Header, Influence, Setup, SetupKind};
use harness_bench::rig::buses::{RingMistakes, RingRow};
use harness_bench::rig::check::Rig;
use harness_bench::rig::file::{DriveEntry, Hooks, Retry, RigFile};
use harness_bench::rig::profile::{Profile, ProfileSetup};
use harness_bench::scenario::problem::{Problem, Problems, TextSpan};
use harness_bench::scenario::source::{Source, line_number};
use harness_sim::nd21::Stimulus;

pub(crate) trait RigOfRings {
    /// The setup of a simulated rig, as `novobus::simulate::bench` takes it: whole ND21s where its file names
    /// no model.
    ///
    /// # Errors
    /// None of a rig that was read: its lines were settled then.
    fn plan(&self) -> Result<Plan, Problems>;

    /// The same with another header behind that of the file.
    ///
    /// # Errors
    /// The other header has mistakes.
    fn plan_with(&self, more: &Header) -> Result<Plan, Problems>;
}

impl RigOfRings for Rig {
    fn plan(&self) -> Result<Plan, Problems> {
        self.plan_with(&Header::default())
    }

    fn plan_with(&self, more: &Header) -> Result<Plan, Problems> {
        if self.port().is_some() {
            let message = "the rig has no rings";
            let problem = Problem::new(TextSpan::default(), message, "a table [ring.1] expected");
            return Err(Problems::new(
                &self.origin,
                self.text.clone(),
                vec![problem],
            ));
        }
        let profile = self
            .profile
            .as_ref()
            .map(|profile| profile.lines.as_slice());
        let header = header(&self.file, profile, &setup(self));
        plan_header(&self.origin, &header.and(more), &sizes(&self.file))
    }
}

/// Whether a rig is simulated and its file says no more than how large its rings are and which inputs are connected, and allows everything.
pub(crate) fn is_bare(rig: &Rig) -> bool {
    let file = &rig.file;
    let is_input = |setup: &Setup| match &setup.what {
        SetupKind::Influence(Influence::Stimuli(all)) => all
            .iter()
            .all(|stimulus| matches!(stimulus, Stimulus::Input(..))),
        _ => false,
    };
    let limits = limits(rig, true);
    rig.is_simulated()
        && limits.allow_everything()
        && limits.bytes_per_second.is_none()
        && file.limits.max_run.is_none()
        && file.retry == Retry::default()
        && file.interlock.is_empty()
        && file.deviation.is_empty()
        && file.power.is_empty()
        && file.hooks == Hooks::default()
        && rig.profile.is_none()
        && setup(rig).only(|setup| !is_input(setup)).is_empty()
}

/// How many drives each ring of a rig has.
pub(crate) fn sizes(file: &RigFile) -> Vec<u8> {
    file.rings().map(|ring| ring.drives).collect()
}

/// What the lines of `[sim]` say; they were read when the rig was.
pub(crate) fn setup(rig: &Rig) -> Header {
    let lines = rig.file.sim.iter().flat_map(|sim| &sim.setup);
    read(lines)
}

/// Sets simulated drives up like this in place of what the lines of `[sim]` say.
pub(crate) fn set_up(rig: &mut Rig, header: &Header) {
    rig.file.sim.get_or_insert_default().setup = header.lines();
}

/// The lines of a header that have no mistakes.
pub(crate) fn read<'l>(lines: impl Iterator<Item = &'l String>) -> Header {
    let lines: Vec<&str> = lines.map(String::as_str).collect();
    lines.join("\n").parse().unwrap_or_default()
}

/// What the drives of a rig are: the types of its devices, its profile, and the lines of its `[sim]`.
fn header(file: &RigFile, profile: Option<&[String]>, simulated: &Header) -> Header {
    let types: Header = file.drive.iter().filter_map(device).collect();
    let profile = profile.map(|lines| read(lines.iter()));
    let known = profile.map_or_else(|| types.clone(), |profile| types.and(&profile));
    known.and(simulated).nd21_by_default(sizes(file).len())
}

/// What the files of rigs ask of rings.
pub(crate) const RINGS: RingRow = RingRow {
    profile: |text| Ok(Profile::<Header>::parse(text)?.header().lines()),
    mistakes,
    interlock: condition::check,
};

impl ProfileSetup for Header {
    fn add(&mut self, more: &Self) {
        *self = self.and(more);
    }
}

/// What makes no drives of a rig: a line of `[sim]`, or one of the profile.
fn mistakes(file: &RigFile, profile: Option<&[String]>, lines: &Source) -> RingMistakes {
    let simulated = match parse_lines(lines) {
        Ok(simulated) => simulated,
        Err(problems) => {
            let all = problems.all().iter();
            let all = all.map(|problem| (Some(problem.span), problem.clone()));
            return all.collect();
        }
    };
    if let Some(problem) = for_other_rings(&simulated, &sizes(file)) {
        return vec![(Some(problem.span), problem)];
    }
    let whole = header(file, profile, &simulated);
    let Err(problems) = plan_header(&lines.name, &whole, &sizes(file)) else {
        return Vec::new();
    };
    // The lines about drives stand in front of that about the master, and those of `[sim]` behind all others.
    let written = whole.lines();
    let first = written.len() - usize::from(whole.master.is_some()) - simulated.setups.len();
    let text = written.join("\n");
    let placed = problems.all().iter().map(|problem| {
        let line = line_number(&text, problem.span.start) - 1;
        let place = line.checked_sub(first);
        let setup = place.and_then(|place| simulated.setups.get(place));
        (setup.map(|setup| setup.span), problem.clone())
    });
    placed.collect()
}

/// The type of the device that a rig's file names (ND21 2.1): the scales of its currents depend on it.
fn device(drive: &DriveEntry) -> Option<Setup> {
    let model = drive.model.as_deref()?.strip_prefix("ND21-")?;
    let (_, device) = DEVICES.iter().find(|(name, _)| model.starts_with(name))?;
    let whom = DriveRange::one(usize::from(drive.ring - 1), drive.address);
    Some(Setup::new(whom, SetupKind::Type(*device)))
}
