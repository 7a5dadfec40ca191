//! The page of a run of fuzzing, made from its folder and nothing else: the same folder gives the same page.

use super::fuzz_case::sources;
use super::html::{Explored, explored};
use crate::explore::Case;
use crate::explore::Finding;
use crate::explore::play;
use crate::explore::{KeptRun, LogLine};
use crate::language::read::RingScenario;
use crate::report::ring::RingReport;
use crate::simulate::simulated;
use harness_bench::explore::{Differing as _, ExploreError, FuzzCase as _, read_as};
use harness_bench::link::Link;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::{self, AtMismatch, Outcome};
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_bench::shown::{ScenarioView, ShownScenario, section};
use harness_proto::line::{Rate, Received};
use harness_sim::novobus::device::Device as _;
use harness_sim::novobus::transitions::{Reached, Watched};
use harness_sim::record::{Channel, Trace};
use std::path::Path;

/// Findings shown at most.
const MOST: usize = 40;

/// The page of the run in a folder.
///
/// # Errors
/// It holds no run, or its record or a finding is damaged.
pub(crate) fn page(folder: &Path) -> Result<String, ExploreError> {
    let (kept, _) = read_as::<Case>(folder)?;
    let mut findings = Vec::new();
    let mut features = vec![(0, 0)];
    let mut reached = Reached::default();
    for line in &kept.lines {
        match line {
            LogLine::Finding { file, .. } if findings.len() < MOST && is_name(file) => {
                let path = folder.join(format!("{file}.json"));
                let (finding, _) = Finding::read_as(&path)?;
                let number = findings.len() + 1;
                findings.push(shown(number, &finding, file, &path)?);
            }
            LogLine::Kept { number, new, case } => {
                let before = features.last().map_or(0, |(_, all)| *all);
                features.push((number + 1, before + *new as u64));
                reach(&kept, case, &mut reached)?;
            }
            _ => {}
        }
    }
    Ok(explored(Explored {
        about: &kept.about,
        history: &kept.history,
        features: &features,
        reached: &reached,
        findings,
        again: "drivebench fuzz run --resume FOLDER, the folder of this run",
    }))
}

/// Whether a name leads to a file of the folder and nowhere else.
fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-')
}

/// What the drives of the model go through in a case: each hears again what its link carried.
fn reach(kept: &KeptRun, case: &Case, reached: &mut Reached) -> Result<(), ExploreError> {
    if !case.is_bounded() {
        return Err(ExploreError::File(
            "a kept case in the record is larger than a case may be".to_owned(),
        ));
    }
    let mut link = kept.about.setup.model(&case.sizes())?;
    play(&mut link, case);
    for link in link
        .trace(case.ring())
        .channels
        .iter()
        .filter(|link| link.to.is_some())
    {
        reached.join(&heard(link));
    }
    Ok(())
}

fn heard(link: &Channel) -> Reached {
    let mut drive = Watched::<Reached>::default();
    for byte in link.octets() {
        if let Some(value) = byte.received {
            let received = Received {
                byte: value,
                error: byte.error,
            };
            drive.receive(byte.at, received);
        }
    }
    drive.reached().clone()
}

/// A finding as a section: shows the ring under test, or its model if the ring is behind ports.
fn shown(
    number: usize,
    finding: &Finding,
    file: &str,
    path: &Path,
) -> Result<ShownScenario, ExploreError> {
    let sources = sources(finding);
    let text = Case::scenario(finding, &finding.difference.kind(), None, true)?;
    let (mut outcome, traces) = played(&text)?;
    outcome.verdict = match finding.confirmed {
        true => Verdict::Failed,
        false => Verdict::Flaky,
    };
    let again = format!("seen again {} of {} times", finding.seen_again, finding.of);
    outcome.remarks.insert(0, again);
    if finding.ports {
        let model = "the picture shows the model, not the rig: the bench cannot hear the links between drives on a rig";
        outcome.remarks.push(model.to_owned());
    }
    let about = &finding.difference.about;
    match &mut outcome.finding {
        Some(found) => found.message = format!("{about}; the scenario says: {}", found.message),
        None => {
            outcome.finding = Some(run::Mismatch {
                span: TextSpan { start: 0, end: 0 },
                message: about.clone(),
                difference: None,
                in_error: String::new(),
            });
        }
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let again = match finding.ports {
        true => format!(
            "drivebench run --rig {} {file}.scn, in the folder of the run",
            finding.rig
        ),
        false => format!("drivebench shrink {name}, in the folder of the run"),
    };
    let played = ScenarioView {
        name: file,
        title: &finding.difference.signature(),
        sources: &sources,
        drives: &drives(&finding.case.sizes()),
        text: &text,
        outcome: &outcome,
        traces: &traces,
        report: &RingReport,
        rate: Rate::default(),
        again: &again,
    };
    Ok(section(number, &played))
}

/// Numbers of drives as a header line has them.
fn drives(sizes: &[u8]) -> String {
    let sizes: Vec<_> = sizes.iter().map(u8::to_string).collect();
    sizes.join(", ")
}

fn played(text: &str) -> Result<(Outcome, Vec<Trace>), ExploreError> {
    let source = Source {
        name: "the ring under test".to_owned(),
        text: text.into(),
    };
    let entry = RingScenario::new(source, None)?;
    let plan = &entry.plan;
    let mut link = simulated(plan);
    let outcome = run::play(plan, &mut link, AtMismatch::GoOn);
    let traces = (0..plan.rings.len()).map(|ring| link.trace(ring)).collect();
    Ok((outcome, traces))
}
