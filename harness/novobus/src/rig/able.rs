//! What a record may say that a rig with rings could do: its first line names the capabilities, and by them how the run was limited.

use super::permitted::limits;
use crate::link::SimulatedLink;
use harness_bench::link::Capability;
use harness_bench::medium::ErrorMarks;
use harness_bench::rig::Rig;
use harness_bench::rig::file::{Endpoint, Transport};
use harness_proto::novobus::guard::Limits;

/// The capabilities that a rig can have had and the limits of the run: those named, where they are possible with or without
/// `--allow-motion`, and whether or not its ports show line errors.
pub(super) fn possible(names: &[String], rig: &Rig) -> (Vec<Capability>, Limits) {
    let mut all = Vec::new();
    for motion in [true, false] {
        let limits = limits(rig, motion);
        for seen in [(true, true), (false, true), (true, false), (false, false)] {
            let able = abilities(rig, limits, seen);
            let listed = able.iter().map(|capability| capability.name());
            if listed.eq(names.iter().map(String::as_str)) {
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
    use crate::rig::parse;
    use harness_bench::scenario::source::Source;

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
