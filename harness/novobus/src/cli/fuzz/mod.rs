//! How rings are explored. A rig with ports is opened as `run --rig` opens it and given back in its safe state.

mod power;

use super::give_back_session as give_back;
use crate::explore::{
    Act, ActKind, Case, CaseScope, Finding, MOST_BYTES, OnRig, OnSim, RingScope, RingSetup, Spice,
    planted_setup,
};
use crate::language::run::over_bus::start_anew;
use crate::rig::sim;
use crate::rig::wrong_parity;
use crate::rig::{OfRings as _, Run, Session, session};
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::case::{ExploredCase, PortWork};
use harness_bench::command::fuzz::replay::{MOST_CASES, kept};
use harness_bench::command::fuzz::run::FuzzRunArguments;
use harness_bench::command::fuzz::{FuzzCommands, tell};
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::exit_of;
use harness_bench::explore::smaller::Subject;
use harness_bench::explore::{ExploreError, Planted, RECORD, Spiced as _, Target};
use harness_bench::link::Line as _;
use harness_bench::link::{Capability, Link, Trouble};
use harness_bench::regular::{self, Links};
use harness_bench::rig::{Rig, UseOptions};
use harness_proto::novobus::guard::Limits;
use harness_sim::novobus::deviation::DEVIATIONS;
use std::path::Path;

/// How rings are explored.
pub(crate) const COMMANDS: FuzzCommands = FuzzCommands {
    power: Some(power::power),
    ..FuzzCommands::of::<Case>()
};

/// The largest file of a corpus.
const LARGEST: u64 = 64 * 1024;

impl ExploredCase for Case {
    fn refused(rig: &Rig, arguments: &FuzzRunArguments) -> Option<String> {
        if arguments.whole && !rig.is_simulated() {
            return Some("--whole is for simulated rings; this rig has ports".to_owned());
        }
        arguments.deviates.iter().find_map(|planted| {
            if planted_setup(planted).is_none() {
                return Some(format!(
                    "drives on a ring have no deviation `{}`; `drivebench deviations` lists them",
                    planted.name
                ));
            }
            let ring = rig.rings().nth(planted.ring);
            let drives = ring.map_or(0, |(_, ring)| ring.drives);
            (planted.drive >= drives).then(|| match drives {
                0 => "the rig has one ring, and no ring 2".to_owned(),
                _ => format!(
                    "ring {} has the drives 0 to {}, and no drive {}",
                    planted.ring + 1,
                    drives - 1,
                    planted.drive
                ),
            })
        })
    }

    fn plant(rig: &mut Rig, planted: &[Planted]) {
        if rig.is_simulated() {
            let mut setup = sim::setup(rig);
            setup
                .setups
                .extend(planted.iter().filter_map(planted_setup));
            sim::set_up(rig, &setup);
        }
    }

    fn setup(rig: &Rig, arguments: Option<&FuzzRunArguments>) -> RingSetup {
        let deviates = arguments.map_or(&[][..], |arguments| &arguments.deviates);
        RingSetup::of_rig(rig, deviates, arguments.is_some_and(|run| run.whole))
    }

    /// Plain drives have nothing behind their bus.
    fn scope(rig: &Rig, setup: &RingSetup, everything: bool) -> CaseScope {
        let permitted = &rig.file.limits;
        let limits = Limits {
            motion: permitted.allow_motion,
            eeprom: permitted.allow_eeprom,
            reset: permitted.allow_reset,
            outputs: permitted.allow_outputs,
            monitoring: permitted.allow_monitoring,
            ..Limits::default()
        };
        let behind = [Spice::Motion, Spice::Eeprom];
        let all = Spice::ALL.iter().map(|(_, spice)| *spice);
        let (first, second) = rings(rig, |_, _| true);
        CaseScope {
            first,
            second,
            spices: all
                .filter(|spice| !setup.is_plain() || !behind.contains(spice))
                .collect(),
            limits: if everything {
                Limits::unlimited()
            } else {
                limits
            },
            spare_eeprom: false,
        }
    }

    fn simulated(
        setup: &RingSetup,
        rig: Option<&Rig>,
    ) -> Result<Box<dyn Target<Self>>, ExploreError> {
        Ok(Box::new(match rig {
            Some(rig) => OnSim::ready(setup.clone(), &rig.sizes())?,
            None => OnSim::new(setup.clone()),
        }))
    }

    fn on_ports(
        rig: &Rig,
        options: &UseOptions,
        output: &mut Output,
        work: &mut PortWork<'_, Self>,
    ) -> std::io::Result<Exit> {
        let mut session = match session::open(rig, options) {
            Ok(session) => session,
            Err(error) => {
                output.complain(&error.to_string());
                return Ok(exit_of(&error));
            }
        };
        match wrong_parity::obstacles(&mut session) {
            Ok(all) => all.iter().for_each(|why| output.say(&format!("{why}\n"))),
            Err(error) => {
                output.complain(&error.to_string());
                let exit = exit_of(&error);
                return Ok(give_back(session, exit, output));
            }
        }
        let worked = match Run::new(&mut session) {
            Ok(mut run) => {
                let scope = port_scope(&mut run);
                let setup = RingSetup::of_ports(rig.rings().count());
                match OnRig::new(&mut run, scope.limits) {
                    Ok(mut target) => work(&mut target, (scope, setup), output),
                    Err(error) => Ok(tell(&error, output)),
                }
            }
            Err(problems) => {
                output.mistakes(&problems);
                Ok(Exit::Usage)
            }
        };
        leave_clean(&mut session, output);
        session.end_if_overdue();
        let exit = worked.unwrap_or_else(|error| output.unwritable(&error));
        Ok(give_back(session, exit, output))
    }

    fn parts(scope: &CaseScope) -> ((u8, Option<u8>), &[Spice]) {
        let second = scope.second.as_ref().map(|ring| ring.drives);
        ((scope.first.drives, second), &scope.spices)
    }

    /// Each on every ring of the rig that has as many drives; those of a corpus on every ring.
    fn kept(folder: &Path, rig: &Rig) -> Result<Vec<Self>, ExploreError> {
        let (first, second) = rings(rig, |_, _| true);
        let places: Vec<_> = std::iter::once(first).chain(second).collect();
        if folder.join(RECORD).exists() {
            let placed = kept::<Self>(folder)?.into_iter().flat_map(|case| {
                let places = places.iter();
                let fit = places.filter(move |place| place.drives == case.drives);
                fit.map(move |place| place.case(case.acts.clone()))
            });
            return Ok(placed.take(MOST_CASES).collect());
        }
        let unreadable = |error: std::io::Error| {
            let error = regular::in_words(folder, error);
            ExploreError::File(format!("failed to read {}: {error}", folder.display()))
        };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder)
            .map_err(unreadable)?
            .take(MOST_CASES)
        {
            let path = entry.map_err(unreadable)?.path();
            if path.extension().is_some_and(|ending| ending == "hex") {
                files.push(path);
            }
        }
        files.sort();
        let mut cases = Vec::new();
        for path in &files {
            let acts = of_hex(path)?;
            cases.extend(places.iter().map(|place| place.case(acts.clone())));
        }
        Ok(cases)
    }

    fn missing(rig: &Rig) -> String {
        let sizes: Vec<_> = rig.sizes().iter().map(u8::to_string).collect();
        format!("case for a ring of {}", sizes.join(" or of "))
    }

    fn size(&self) -> (usize, &'static str) {
        (self.bytes().len(), "byte")
    }

    fn is_of_another(finding: &Finding, rig: &Rig) -> Option<String> {
        let sizes = finding.case.sizes();
        let is_same = !rig.is_simulated() && rig.of_rings().is_ok() && rig.sizes() == sizes;
        (!is_same).then(|| {
            let sizes: Vec<_> = sizes.iter().map(u8::to_string).collect();
            let sizes = sizes.join(", ");
            format!("a rig with ports whose rings have the sizes {sizes}")
        })
    }

    fn has_drives_of(&self, other: &Self) -> bool {
        (self.drives, self.beside) == (other.drives, other.beside)
    }

    /// A known deviation in the accused drive, or in each.
    fn suspects(finding: &Finding) -> Vec<(String, Subject<Self>)> {
        let drives = 0..finding.case.drives;
        let accused = finding.difference.drive;
        let drives = accused.map_or_else(|| drives.collect(), |drive| vec![drive]);
        let all = DEVIATIONS.all().flat_map(|deviation| {
            let drives = drives.iter();
            drives.map(|drive| (deviation.name, *drive))
        });
        let suspect = |(name, drive): (&str, u8)| {
            let planted = Planted {
                ring: finding.case.ring(),
                drive,
                name: name.to_owned(),
            };
            let mut subject = finding.subject();
            subject.setup.deviates = vec![planted];
            (format!("drive {drive} deviates {name}"), subject)
        };
        all.map(suspect).collect()
    }
}

/// A file of corpora/fuzz/ring: two bytes that say what is damaged, and the bytes of the wire. The bytes alone are a case: what they
/// damage lies on links that a rig does not reach.
fn of_hex(path: &Path) -> Result<Vec<Act>, ExploreError> {
    let wrong = |why: &str| ExploreError::File(format!("{}: {why}", path.display()));
    let read = regular::read(path, Links::Follow, LARGEST);
    let text = read.and_then(|bytes| String::from_utf8(bytes).map_err(std::io::Error::other));
    let text = text.map_err(|error| wrong(&error.to_string()))?;
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default());
    let words: Vec<_> = lines.flat_map(str::split_whitespace).collect();
    let bytes = words
        .iter()
        .map(|word| u8::from_str_radix(word, 16))
        .collect::<Result<Vec<_>, _>>()
        .map_err(|_| wrong("bytes are two hexadecimal digits each"))?;
    let wire = bytes.get(2..).unwrap_or_default().to_vec();
    match wire.len() <= MOST_BYTES {
        true => Ok(vec![Act::sound(ActKind::Bytes(wire))]),
        false => Err(wrong("more bytes than a case has")),
    }
}

/// What cases have left in the drives' RAM goes with a reset, where that is allowed.
fn leave_clean(session: &mut Session, output: &mut Output) {
    let limits = session.limits();
    let lost = |trouble: &Trouble| !matches!(trouble, Trouble::Denied(_));
    if !(limits.reset && limits.motion) || session.link().trouble().is_some_and(lost) {
        return;
    }
    let rings = session.rings().to_vec();
    let done = match session.health() {
        Ok(_) => start_anew(session.link(), &rings).map_err(|why| why.to_string()),
        Err(error) => Err(error.to_string()),
    };
    if let Err(why) = done {
        output.complain(&format!("the drives were not reset after the run: {why}"));
    }
}

/// The rings of a rig, and where faults can be put on them.
fn rings(rig: &Rig, reaches: impl Fn(usize, u8) -> bool) -> (RingScope, Option<RingScope>) {
    let second = rig.file.rings().nth(1).map(|ring| ring.drives);
    RingScope::both(rig.ring_size(), second, reaches)
}

/// What cases may have on a rig with ports. What a case leaves in a drive's RAM the next reset takes away (ND21 10.5): without leave for
/// it cases only read, stop and block. The EEPROM is never written.
pub(crate) fn port_scope(run: &mut Run<'_>) -> CaseScope {
    let capabilities = run.capabilities();
    let session = run.session();
    let allowed = session.limits();
    let limits = match allowed.reset && allowed.motion {
        true => allowed,
        false => Limits {
            bytes_per_second: allowed.bytes_per_second,
            most_bytes: allowed.most_bytes,
            ..Limits::default()
        },
    };
    let rig = session.rig().clone();
    let has = |capability| capabilities.contains(&capability);
    let link = session.link();
    // On a simulated ring that is tried like one behind a port, only the master's own link is in reach.
    let (first, second) = rings(&rig, |ring, place| match rig.is_simulated() {
        true => place == 0,
        false => {
            let place = usize::from(place);
            // A case's fault may be one of parity.
            link.reaches(ring, place) && link.damages_parity(ring, place)
        }
    });
    let reaches = |ring: &RingScope| !ring.links.is_empty();
    let reached = reaches(&first) || second.as_ref().is_some_and(reaches);
    let possible = |spice: &Spice| match spice {
        Spice::Power => false,
        Spice::Flip | Spice::Framing => has(Capability::LineErrors) && reached,
        Spice::Slip => limits.allow_everything() && reached,
        // The manual leaves open what drives take a broken byte for.
        Spice::Late => false,
        // Time-outs of drives are not judged in real time. A reset takes as long as 100 commands; the tour has some.
        Spice::Silence | Spice::Reset => false,
        Spice::ProcessData => limits.motion,
        Spice::WriteIo => limits.outputs,
        Spice::Motion => limits.motion,
        Spice::Eeprom => false,
        _ => true,
    };
    let all = Spice::NAMES.iter().map(|(_, spice)| *spice);
    CaseScope {
        first,
        second,
        spices: all.filter(possible).collect(),
        limits,
        spare_eeprom: true,
    }
}
