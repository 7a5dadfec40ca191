//! Simulated rigs: what their drives are before anything is sent.

use crate::buses::novobus::language::parse::header::parse_lines;
use crate::buses::novobus::language::syntax::{Drives, Header, Setup, SetupKind};
use crate::rig::check::Rig;
use crate::rig::file::{DriveEntry, Hooks, Retry, RigFile};
use crate::rig::limits;
use crate::rig::profile::KnownProfile;
use crate::scenario::expression::{Expression, Located};
use crate::scenario::parse::parse_header;
use crate::scenario::plan::{Plan, plan};
use crate::scenario::problem::{Problems, Span};
use crate::scenario::source::Source;
use crate::scenario::syntax::Scenario;
use harness_sim::novobus::drive::Model;

/// The types of the device that a header knows, and a model of a rig's file begins with behind `ND21-`.
const TYPES: [&str; 4] = ["5605", "5610", "5615", "5620"];

impl Rig {
    /// Whether it is simulated and its file says no more than how large its rings are and which inputs are connected, and allows
    /// everything, so that every scenario may bring drives of its own.
    #[must_use]
    pub fn is_bare(&self) -> bool {
        let file = &self.file;
        let is_input = |line: &String| {
            let mut words = line.split_whitespace().skip(2);
            words.next() == Some("input")
        };
        let limits = limits(self, true);
        self.is_simulated()
            && limits.allow_everything()
            && limits.bytes_per_second.is_none()
            && file.limits.max_run.is_none()
            && file.retry == Retry::default()
            && file.interlock.is_empty()
            && file.deviation.is_empty()
            && file.power.is_empty()
            && file.hooks == Hooks::default()
            && self.profile.is_none()
            && file.sim.iter().flat_map(|sim| &sim.setup).all(is_input)
    }

    /// The setup of a simulated rig, as `scenario::simulate::bench` takes it: whole ND21s where its file names
    /// no model.
    ///
    /// # Errors
    /// None of a rig that was read: its lines were settled then.
    pub fn plan(&self) -> Result<Plan, Problems> {
        self.plan_with(&[])
    }

    /// The header that `[sim]` gives the drives.
    #[must_use]
    pub fn header(&self) -> Header {
        let lines = self.file.sim.iter().flat_map(|sim| &sim.setup);
        let source = Source {
            name: self.origin.clone(),
            text: lines.cloned().collect::<Vec<_>>().join("\n").into(),
        };
        // The lines were read when the rig was.
        parse_lines(&source).unwrap_or_default()
    }

    /// The same with more lines of a header behind those of the file.
    ///
    /// # Errors
    /// The lines have mistakes.
    pub fn plan_with(&self, more: &[String]) -> Result<Plan, Problems> {
        let (lines, _) = lines(&self.file, self.profile.as_ref(), more);
        settle(&self.origin, &self.file, &lines)
    }
}

/// The header lines of a rig: the types of its devices, its profile, those of `[sim]`, and more; and how many stand in front of those
/// of `[sim]`.
pub(crate) fn lines(
    file: &RigFile,
    profile: Option<&KnownProfile>,
    more: &[String],
) -> (Vec<String>, usize) {
    let mut lines: Vec<_> = file.drive.iter().filter_map(type_line).collect();
    lines.extend(
        profile
            .into_iter()
            .flat_map(|profile| profile.lines.clone()),
    );
    let before = lines.len();
    lines.extend(file.sim.iter().flat_map(|sim| sim.setup.clone()));
    lines.extend_from_slice(more);
    (lines, before)
}

/// Settles header lines for a rig's rings. The places of mistakes are in the lines joined by line ends.
pub(crate) fn settle(name: &str, file: &RigFile, lines: &[String]) -> Result<Plan, Problems> {
    let rings = std::iter::once(&file.ring.first).chain(&file.ring.second);
    let sizes: Vec<_> = rings.map(|ring| ring.drives).collect();
    let source = Source {
        name: name.to_owned(),
        text: lines.join("\n").into(),
    };
    let mut scenario = parse_header(&source, &sizes)?;
    all_nd21(&mut scenario);
    plan(&scenario, &source, None)
}

/// The line of a header with the type of the device that a rig's file names (ND21 2.1): the scales of its currents depend
/// on it.
fn type_line(drive: &DriveEntry) -> Option<String> {
    let model = drive.model.as_deref()?.strip_prefix("ND21-")?;
    let known = TYPES.iter().find(|known| model.starts_with(*known))?;
    let ring = if drive.ring == 2 { "2:" } else { "" };
    Some(format!("drive {ring}{} type {known}", drive.address))
}

/// Makes every drive a whole ND21, where the header names no model at all.
pub(crate) fn all_nd21(scenario: &mut Scenario) {
    let says_model = |setup: &Setup| matches!(setup.what, SetupKind::Model(_));
    if scenario.header.setups.iter().any(says_model) {
        return;
    }
    for ring in 0..scenario.header.rings.len() {
        let last = Located {
            expression: Expression::Last,
            ..Located::number(0)
        };
        scenario.header.setups.push(Setup {
            drives: Drives {
                ring,
                from: Located::number(0),
                to: Some(last),
            },
            what: SetupKind::Model(Model::Nd21),
            span: Span::default(),
        });
    }
}
