//! `drivebench fuzz replay` on rings: a minute on hardware.

use super::{on_ports, rings, scope, simulated};
use crate::explore::{
    Act, ActKind, Case, CaseScope, FuzzRun, FuzzSettings, MOST_BYTES, OnRig, OnSim, RingSetup,
};
use harness_bench::command::exit::Exit;
use harness_bench::command::fuzz::replay::{MOST_CASES, ReplayArguments, kept, play};
use harness_bench::command::fuzz::tell;
use harness_bench::command::output::Output;
use harness_bench::command::rig_failure::use_options;
use harness_bench::explore::{ExploreError, RECORD};
use harness_bench::regular::{self, Links};
use harness_bench::rig::Rig;
use harness_proto::novobus::guard::Limits;
use std::path::Path;

/// The largest file of a corpus.
const LARGEST: u64 = 64 * 1024;

/// Replays on the rings of a rig.
pub(super) fn replay(
    rig: &Rig,
    arguments: &ReplayArguments,
    output: &mut Output,
) -> std::io::Result<Exit> {
    let cases = match cases(&arguments.folder, rig) {
        Ok(cases) => cases,
        Err(error) => return Ok(tell(&error, output)),
    };
    if cases.is_empty() {
        let sizes: Vec<_> = rig.sizes().iter().map(u8::to_string).collect();
        output.complain(&format!(
            "{} holds no case for a ring of {}",
            arguments.folder.display(),
            sizes.join(" or of ")
        ));
        return Ok(Exit::NothingSelected);
    }
    if rig.is_simulated() {
        let setup = RingSetup::of_rig(rig, &[], false);
        let mut target = match OnSim::ready(setup.clone(), &rig.sizes()) {
            Ok(target) => target,
            Err(error) => return Ok(tell(&error, output)),
        };
        let scope = simulated(rig, Limits::unlimited(), &setup);
        let campaign = campaign(arguments, rig, setup, scope);
        return play(arguments, campaign, cases, &mut target, output);
    }
    let options = use_options("fuzz replay", arguments.allow_motion, arguments.wait);
    on_ports(rig, &options, output, |run, output| {
        let scope = scope(run);
        let limits = scope.limits;
        let campaign = campaign(
            arguments,
            rig,
            RingSetup::of_ports(rig.rings().count()),
            scope,
        );
        match OnRig::new(run, limits) {
            Ok(mut target) => play(arguments, campaign, cases, &mut target, output),
            Err(error) => Ok(tell(&error, output)),
        }
    })
}

fn campaign(arguments: &ReplayArguments, rig: &Rig, setup: RingSetup, scope: CaseScope) -> FuzzRun {
    let about = FuzzSettings {
        schema: <FuzzSettings>::SCHEMA,
        rig: arguments.rig.clone(),
        drives: scope.first.drives,
        second: scope.second.as_ref().map(|ring| ring.drives),
        ports: !rig.is_simulated(),
        seed: 0,
        confirm: 2,
        of: 3,
        setup,
        spices: Vec::new(),
    };
    FuzzRun::new(about, scope)
}

/// The cases of a folder, each on every ring of the rig that has as many drives.
fn cases(folder: &Path, rig: &Rig) -> Result<Vec<Case>, ExploreError> {
    let (first, second) = rings(rig, |_, _| true);
    let places: Vec<_> = std::iter::once(first).chain(second).collect();
    if folder.join(RECORD).exists() {
        let placed = kept::<Case>(folder)?.into_iter().flat_map(|case| {
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
