//! The first line of a record: all of it but date and version follows from the rig's file.

use super::files::{RIG, sum};
use super::keep::Keep;
use super::part;
use super::record::{RecordLine, RunPart, capabilities};
use crate::buses::novobus::rig::Way;
use crate::buses::novobus::rig::limits;
use crate::buses::novobus::rig::open::line_rate;
use crate::buses::novobus::rig::sim::RigOfRings;
use crate::buses::twin::Exactness;
use crate::buses::{SimulatedLink, judge_of};
use crate::link::Capability;
use crate::medium::ErrorMarks;
use crate::rig::Rig;
use crate::rig::file::{Endpoint, Transport};
use crate::rig::rings::rings;
use crate::rig::segment::OnSegment;
use crate::scenario::run::sizes;
use harness_proto::line::Rate;
use harness_proto::novobus::guard::Limits;
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
    pub(super) exactness: Exactness,
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
    pub(super) limits: Limits,
    pub(super) way: Way,
    /// Of a rig with a port: whether motors could turn.
    pub(super) on_segment: Option<bool>,
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
            .flat_map(|own| part::differences(own, selected.as_ref())),
    );
    if *rig_sha256 != sum(rig.text.as_bytes()) {
        wrong.push(format!("{RIG} is not the file that was used"));
    }
    let rings = rings(drives)?;
    let own = rig.sizes();
    if own != *drives {
        return Err(format!(
            "the sizes of the record's rings are {}, and those of {RIG} are {}",
            sizes(drives),
            sizes(&own)
        ));
    }
    let segment = match own_rings {
        true => None,
        false => segment(names, rig),
    };
    let on_segment = segment.as_ref().map(|(_, motion)| *motion);
    let (capabilities, limits) = match (&segment, own_rings) {
        (Some((segment, _)), _) => (segment.capabilities.clone(), Limits::default()),
        (None, true) => (SimulatedLink::CAPABILITIES.to_vec(), limits(rig, true)),
        (None, false) => possible(names, rig),
    };
    let expected_rate = match *own_rings || segment.is_some() {
        true => Rate::default(),
        false => line_rate(rig),
    };
    let expected_bits = match &segment {
        Some((segment, _)) => segment.rate,
        None => expected_rate.bits_per_second(),
    };
    let expected_anew = !own_rings && limits.reset && limits.motion;
    let mut must = |what: &str, stated: String, expected: String| {
        if stated != expected {
            wrong.push(format!(
                "run.jsonl, line 1: {what} is {stated}, by {RIG} it is {expected}"
            ));
        }
    };
    let expected_tolerance = match &segment {
        Some((segment, _)) => segment.tolerance,
        None => tolerance_of(rig),
    };
    must("the rig", id.clone(), rig.id().to_owned());
    must(
        "the rate",
        stated_rate.to_string(),
        expected_bits.to_string(),
    );
    must(
        "the tolerance",
        tolerance.to_string(),
        expected_tolerance.units().to_string(),
    );
    must(
        "`simulated`",
        simulated.to_string(),
        rig.is_simulated().to_string(),
    );
    let listed: Vec<_> = capabilities.iter().map(|own| own.name()).collect();
    must(
        "the list of capabilities",
        names.join(", "),
        listed.join(", "),
    );
    must("`anew`", anew.to_string(), expected_anew.to_string());
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
        None => rig.is_bare(),
    };
    let bare_run = bare && stated == Some("run");
    if *schema > 1 && *own_rings != bare_run {
        must("`own_rings`", own_rings.to_string(), bare_run.to_string());
    }
    Ok(Header {
        schema: *schema,
        program: drivebench.clone(),
        started: started.clone(),
        rate: expected_rate,
        drives: drives.clone(),
        exactness: Exactness {
            tolerance: expected_tolerance,
            line_errors: capabilities.contains(&Capability::LineErrors),
            knows_cells: rig.is_simulated(),
            looks: None,
        },
        capabilities,
        simulated: rig.is_simulated(),
        own_rings: *own_rings,
        qualified: purpose.as_deref() == Some("qualify"),
        selected: selected.clone(),
        part: part.clone(),
        keep,
        limits,
        way: Way {
            rings,
            attempts: rig.examinations().filter(|_| on_segment.is_none()),
            anew: expected_anew,
        },
        on_segment,
    })
}

/// What the first line must say of a rig with a port that has these capabilities, and whether motors could turn; `None` for rings.
fn segment(names: &[String], rig: &Rig) -> Option<(OnSegment, bool)> {
    let [moving, still] = judge_of(rig, true, false)?.segments();
    let listed = |own: &OnSegment| {
        let own = own.capabilities.iter().map(|own| own.name());
        own.eq(names.iter().map(String::as_str))
    };
    match listed(&still) {
        true => Some((still, false)),
        false => Some((moving, true)),
    }
}

/// How exact the times of a rig are.
fn tolerance_of(rig: &Rig) -> Span {
    let of_ring = rig.rings().map(|(_, ring)| ring.time_tolerance.0);
    let longest = of_ring.max().unwrap_or_default();
    match rig.is_simulated() {
        true => Span::ZERO,
        false => Span::from_nanos(u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX)),
    }
}

/// The capabilities that a rig can have had and the limits of the run: those named, where they are possible with or without
/// `--allow-motion`, and whether or not its ports show line errors.
fn possible(names: &[String], rig: &Rig) -> (Vec<Capability>, Limits) {
    let named = capabilities(names);
    let mut all = Vec::new();
    for motion in [true, false] {
        let limits = limits(rig, motion);
        for seen in [(true, true), (false, true), (true, false), (false, false)] {
            let able = abilities(rig, limits, seen);
            let listed = able.iter().map(|own| own.name());
            if able == named && listed.eq(names.iter().map(String::as_str)) {
                return (able, limits);
            }
            all.push((able, limits));
        }
    }
    all.swap_remove(0)
}

/// Whether the ports of a rig show line errors, where its file decides it: those of pseudo terminals and sockets do with in-band marks alone.
fn shows_errors_by_marks(rig: &Rig) -> Option<bool> {
    let shows = |end: &Endpoint| match end.transport {
        Transport::Pty | Transport::Tcp => Some(end.marks == ErrorMarks::InBand),
        Transport::Serial | Transport::Rfc2217 | Transport::Sim => None,
    };
    let mut all = rig.rings().map(|(_, ring)| shows(&ring.endpoint));
    all.try_fold(true, |all, shows| Some(all && shows?))
}

/// What a rig can do within these limits, beside what no record shows.
fn abilities(rig: &Rig, limits: Limits, (line_errors, taps): (bool, bool)) -> Vec<Capability> {
    let file = &rig.file;
    let has_inner = !file.tap.is_empty() || !file.interposer.is_empty();
    let marked = shows_errors_by_marks(rig).filter(|_| !has_inner);
    let has = |capability: &Capability| match capability {
        Capability::Power | Capability::Simulator => false,
        // A record of an earlier version shows no taps.
        Capability::Tap => taps && !rig.is_simulated() && has_inner,
        Capability::Motion => limits.motion,
        Capability::Eeprom => limits.eeprom,
        // A reset ends block and stop (ND21 11.8).
        Capability::Reset => limits.reset && limits.motion,
        Capability::Memory => true,
        Capability::TwoRings => rig.is_simulated() || rig.rings().count() > 1,
        Capability::Interposer => rig.is_simulated() || !file.interposer.is_empty(),
        Capability::LineErrors => rig.is_simulated() || marked.unwrap_or(line_errors),
    };
    let order = match rig.is_simulated() {
        true => &SimulatedLink::CAPABILITIES[..],
        false => &[
            Capability::Memory,
            Capability::Motion,
            Capability::Eeprom,
            Capability::Reset,
            Capability::TwoRings,
            Capability::Interposer,
            Capability::Tap,
            Capability::LineErrors,
        ],
    };
    order.iter().copied().filter(has).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::buses::parse_rig as parse;
    use crate::scenario::source::Source;

    /// A record that says that a port showed no line errors, although the rig's file says that it does, is changed: scenarios that need them would
    /// look as if they were skipped with a reason.
    #[test]
    fn marks_decide_whether_line_errors_are_seen() {
        let seen = |marks: &str, names: &[&str]| {
            let text = format!(
                "schema = 1\n[rig]\nid = \"desk\"\n[ring.1]\ndrives = 3\ntransport = \"tcp\"\nport = \"127.0.0.1:1\"\nmarks = \"{marks}\"\n"
            );
            let source = Source {
                name: "desk.toml".to_owned(),
                text: text.into(),
            };
            let rig = parse(&source).expect("a rig");
            let names: Vec<_> = names.iter().map(|name| (*name).to_owned()).collect();
            let (able, _) = possible(&names, &rig);
            able.contains(&Capability::LineErrors)
        };
        for stated in [&["memory"][..], &["memory", "line-errors"]] {
            assert!(seen("in-band", stated), "{stated:?}");
            assert!(!seen("none", stated), "{stated:?}");
        }
    }
}
