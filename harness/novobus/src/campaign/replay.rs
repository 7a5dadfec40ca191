//! One case as a scenario, to be looked at with `drivebench trace`.

use super::fault::CaseFaults;
use super::run::{Campaign, Contradiction};
use crate::language::syntax::{FaultStep, Header, JobStep, LinkEnds, RingStep};
use crate::language::write::Text;
use harness_bench::link::link_name;
use harness_bench::scenario::pattern::{Expected, Pattern};
use harness_bench::scenario::syntax::{Action, Scenario};
use harness_proto::line::Rate;

/// Maximum number of bytes, and of runs of equal ones, on a line.
const ITEMS_A_LINE: usize = 24;

/// The shortest run of equal bytes that is written as one.
const RUN: usize = 3;

/// The scenario that replays a case: the header of the campaign's scenario, the faults, and the bytes that the master sent in
/// this case; or, if the driver plays, its calls.
///
/// # Errors
/// The case fits no class.
pub(crate) fn scenario(campaign: &Campaign, case: &CaseFaults) -> Result<String, Contradiction> {
    let (outcome, said) = campaign.play(case)?;
    let drives = campaign.shape.drives;
    let entry = &campaign.entry;
    let title = format!("{} of {}", case.name(drives), entry.short_name());
    let header = Header {
        rate: entry.scenario.header.rate.or_else(|| Some(Rate::default())),
        ..entry.scenario.header.and(&Header::of_rings(&[drives]))
    };
    let mut text: Text = Text::default();
    text.header(&Scenario {
        sources: entry.scenario.sources.clone(),
        ..Scenario::new(&title, header)
    });
    text.empty_line();
    let mut about = format!("{}: {}", outcome.class, outcome.class.about());
    if let Some(link) = outcome.evidence.named {
        about += &format!("; named was {}", link_name(0, drives, link));
    }
    text.remark(&about);
    for wrong in &outcome.evidence.wrong {
        text.remark(&wrong.to_string());
    }
    for fault in case.faults() {
        for (distance, what) in fault.what.lines() {
            let ends = LinkEnds::of_place(drives, fault.link);
            let fault = FaultStep::on_link(0, ends, what, fault.byte + distance);
            text.step(&RingStep::Fault(fault).into(), "");
        }
    }
    if campaign.by_driver() {
        for step in &entry.scenario.steps {
            if let Action::Own(RingStep::Job(JobStep::Master { .. } | JobStep::Count(..))) =
                step.action
            {
                text.step(step, "");
            }
        }
    }
    for said in said {
        text.empty_line();
        text.remark(said.why);
        let bytes: Vec<_> = said.bytes.iter().copied().map(Expected::Byte).collect();
        for bytes in Pattern::of(&bytes, RUN).lines(ITEMS_A_LINE) {
            text.step(
                &Action::Send {
                    port: 0,
                    message: bytes,
                }
                .into(),
                "",
            );
        }
    }
    Ok(text.into())
}
