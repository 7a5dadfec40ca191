//! The first line of a record: all of it but date and version follows from the rig's file.

use super::files::{RIG, sum};
use super::keep::Keep;
use super::part;
use super::record::{RecordLine, RunPart};
use crate::bus_name::BusName;
use crate::buses::{bus_of, is_bare, judge_of, named};
use crate::capture::Carries;
use crate::link::Capability;
use crate::rig::Rig;
use crate::rig::playing::RecordedBench;
use crate::rig::rings::rings;
use crate::scenario::run::sizes;
use harness_proto::line::Rate;
use harness_proto::time::Span;

/// What a record is judged by.
pub(super) struct Header {
    /// The version of its form.
    pub(super) schema: u32,
    /// The version of the program.
    pub(super) program: String,
    /// When the run began, in UTC.
    pub(super) started: String,
    pub(super) rate: Rate,
    pub(super) drives: Vec<u8>,
    /// How exact its times are.
    pub(super) tolerance: Span,
    pub(super) capabilities: Vec<Capability>,
    pub(super) simulated: bool,
    /// Whether each scenario had simulated rings of its own.
    pub(super) own_rings: bool,
    /// Whether the run was a qualification.
    pub(super) qualified: bool,
    /// The sums of the texts of the scenarios that were selected, in order, where the record has them.
    pub(super) selected: Option<Vec<String>>,
    /// Which part of a run that was split it is.
    pub(super) part: Option<RunPart>,
    /// Which captures the folder keeps.
    pub(super) keep: Keep,
    /// The names of the capabilities in it.
    pub(super) names: Vec<String>,
    /// Whether the rig has rings.
    pub(super) of_rings: bool,
}

/// Reads the first line. What the rig's file contradicts is added to `wrong`, and the file's value is used.
///
/// # Errors
/// It is no first line, or of other rings than the rig has.
pub(super) fn header(
    lines: &[RecordLine],
    rig: &Rig,
    wrong: &mut Vec<String>,
) -> Result<Header, String> {
    let Some(RecordLine::Run {
        schema,
        drivebench,
        rig: id,
        rig_sha256,
        started,
        rate: stated_rate,
        rings: drives,
        tolerance,
        simulated,
        capabilities: names,
        anew,
        own_rings,
        purpose,
        selected,
        part,
        keep,
    }) = lines.first()
    else {
        return Err("the record of a run expected here".to_owned());
    };
    let keep = match keep.as_deref().map(str::parse::<Keep>) {
        None => Keep::All,
        Some(Ok(keep)) => keep,
        Some(Err(why)) => {
            wrong.push(format!("run.jsonl, line 1: `keep`: {why}"));
            Keep::All
        }
    };
    wrong.extend(
        part.iter()
            .flat_map(|part| part::differences(part, selected.as_ref())),
    );
    if *rig_sha256 != sum(rig.text.as_bytes()) {
        wrong.push(format!("{RIG} is not the file that was used"));
    }
    rings(drives)?;
    let drives_of_rig = rig.sizes();
    if drives_of_rig != *drives {
        return Err(format!(
            "the sizes of the record's rings are {}, and those of {RIG} are {}",
            sizes(drives),
            sizes(&drives_of_rig)
        ));
    }
    let of_rings = bus_of(rig).carries == Carries::Link;
    let expected = match own_rings {
        true => RecordedBench {
            rate: Rate::default().bits_per_second(),
            drives: rig.ring_size(),
            tolerance: Span::ZERO,
            capabilities: named(BusName::DEFAULT).simulates.to_vec(),
            anew: false,
        },
        false => judge_of(rig, purpose.as_deref() == Some("qualify"))?.adopt(names),
    };
    let rate = Rate::from_bits_per_second(expected.rate).filter(|_| of_rings);
    let mut must = |what: &str, stated: String, expected: String| {
        if stated != expected {
            wrong.push(format!(
                "run.jsonl, line 1: {what} is {stated}, by {RIG} it is {expected}"
            ));
        }
    };
    must("the rig", id.clone(), rig.id().to_owned());
    must(
        "the rate",
        stated_rate.to_string(),
        expected.rate.to_string(),
    );
    must(
        "the tolerance",
        tolerance.to_string(),
        expected.tolerance.units().to_string(),
    );
    must(
        "`simulated`",
        simulated.to_string(),
        rig.is_simulated().to_string(),
    );
    let listed = expected.capabilities.iter().copied();
    let listed: Vec<_> = listed.map(Capability::name).collect();
    must(
        "the list of capabilities",
        names.join(", "),
        listed.join(", "),
    );
    must("`anew`", anew.to_string(), expected.anew.to_string());
    let purposes = match *own_rings {
        true => &["run"][..],
        false => &["run", "qualify"],
    };
    let stated = purpose.as_deref();
    if *schema > 1 && !stated.is_some_and(|stated| purposes.contains(&stated)) {
        must(
            "the purpose",
            stated.unwrap_or("nothing").to_owned(),
            purposes.join(" or "),
        );
    }
    // What `sim:unitek:1` names and a file that says the same look alike in the folder. What was recorded on benches of their own must come
    // again in any case.
    let bare = match rig.port() {
        Some(_) => rig.is_simulated() && *own_rings,
        None => is_bare(rig),
    };
    let bare_run = bare && stated == Some("run");
    if *schema > 1 && *own_rings != bare_run {
        must("`own_rings`", own_rings.to_string(), bare_run.to_string());
    }
    Ok(Header {
        schema: *schema,
        program: drivebench.clone(),
        started: started.clone(),
        rate: rate.unwrap_or_default(),
        drives: drives.clone(),
        tolerance: expected.tolerance,
        capabilities: expected.capabilities,
        simulated: rig.is_simulated(),
        own_rings: *own_rings,
        qualified: purpose.as_deref() == Some("qualify"),
        selected: selected.clone(),
        part: part.clone(),
        keep,
        names: names.clone(),
        of_rings,
    })
}
