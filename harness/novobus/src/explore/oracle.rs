//! Compares a ring with what it must answer: with the model of the manual, byte for byte and to the nanosecond, and with the reference
//! model, on every link and in every cell.

use super::case::{ActKind, Case, Harm, OtherRing};
use super::order::CommandSent;
use super::play::MasterView;
use super::setup::drive_name;
use crate::calm::calm;
use crate::link::BesideTheBus;
use crate::link::SimulatedLink;
use crate::section::SentBytes;
use crate::twin::{self, Symptom};
use harness_bench::explore::{Differing, is_first};
use harness_bench::link::{Link, Octets, link_name};
use harness_proto::line::Received;
use harness_proto::nd21::ram;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::{Role, roles};
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::reference;
use harness_sim::novobus::witness::Complaint;
use harness_sim::record::{Channel, Trace};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// Mismatch of a ring with the expected behaviour.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Difference {
    /// What differs.
    pub what: Symptom,
    /// The section of the ND21 manual with the rule, such as `9.6`.
    pub section: String,
    /// The rule in a few words.
    pub rule: String,
    /// In which ring, counted from 0.
    #[serde(default, skip_serializing_if = "is_first")]
    pub ring: usize,
    /// The drive to blame, if the bytes or an experiment show which.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<u8>,
    /// The drive addressed by the telegram; another one may have changed its bytes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meant: Option<u8>,
    /// The number of the received byte, counted from 1; `None` if the difference is not in a byte at the master.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub byte: Option<usize>,
    /// Whether only the time of that byte differs.
    #[serde(default)]
    pub time: bool,
    /// The whole difference, as a sentence.
    pub about: String,
}

impl Difference {
    /// The kind of the finding in words.
    #[must_use]
    pub(crate) fn kind(&self) -> String {
        let what = self.what.words();
        format!("{what} (ND21 {}, {})", self.section, self.rule)
    }

    fn signature_of(&self, drive: Option<u8>) -> String {
        let kind = self.kind();
        match (drive, self.ring) {
            (Some(drive), ring) => format!("drive {}: {kind}", drive_name(ring, drive)),
            (None, 0) => kind,
            (None, _) => format!("ring 2: {kind}"),
        }
    }
}

impl Differing for Difference {
    fn is_like(&self, other: &Self) -> bool {
        let same_rule = self.section == other.section && self.rule == other.rule;
        same_rule && self.what == other.what
    }

    /// The same kind, in telegrams to the same drive.
    fn key(&self) -> String {
        match self.meant {
            Some(drive) => format!(
                "to drive {}: {}",
                drive_name(self.ring, drive),
                self.signature_of(None)
            ),
            None => self.signature(),
        }
    }

    /// The kind, and the drive that is to blame where that is known.
    fn signature(&self) -> String {
        self.signature_of(self.drive)
    }

    fn about(&self) -> &str {
        &self.about
    }

    fn place(&self) -> Option<usize> {
        self.byte
    }

    fn is_time(&self) -> bool {
        self.time
    }
}

impl From<&twin::Divergence> for Difference {
    fn from(found: &twin::Divergence) -> Self {
        let (section, rule) = found.rule;
        Self {
            what: found.what,
            section: section.to_owned(),
            rule: rule.to_owned(),
            ring: found.ring,
            drive: None,
            meant: found.role.answering(),
            byte: Some(found.byte),
            time: found.what == Symptom::Time,
            about: found.to_string(),
        }
    }
}

/// The first received byte that differs from the model: in value, line status or number, or else in time.
#[must_use]
pub(crate) fn against_model(
    case: &Case,
    model: &MasterView,
    seen: &MasterView,
) -> Option<Difference> {
    if model.received == seen.received {
        return None;
    }
    let size = RingSize::new(u64::from(case.drives)).ok()?;
    let same = |a: &(Instant, Received), b: &(Instant, Received)| {
        (a.1.byte, a.1.error.is_some()) == (b.1.byte, b.1.error.is_some())
    };
    let (expected, received) = (&model.received, &seen.received);
    let pairs = || expected.iter().zip(received);
    let shorter = expected.len().min(received.len());
    let index = pairs()
        .position(|(a, b)| !same(a, b))
        .or((expected.len() != received.len()).then_some(shorter));
    let (index, what) = match index {
        Some(index) => (index, twin::what_of(expected, received, index)),
        None => (pairs().position(|(a, b)| a.0 != b.0)?, Symptom::Time),
    };
    let sent = sent(case);
    let roles = roles(size, &sent);
    let found = twin::answering(&roles, &sent).nth(index);
    let (place, role) = found.unwrap_or((sent.len(), Role::Foreign));
    let bytes = SentBytes {
        bytes: &sent,
        roles: &roles,
    };
    let is_calm = calm(size, &sent).get(place) == Some(&true);
    let divergence = twin::Divergence {
        ring: case.ring(),
        byte: index + 1,
        what,
        expected: expected.get(index).copied(),
        received: received.get(index).copied(),
        role,
        rule: bytes.broken(place, what),
        step: None,
        drive: None,
    };
    let found = Difference::from(&divergence);
    Some(Difference {
        meant: found.meant.filter(|_| is_calm),
        ..found
    })
}

/// The bytes that a case sends, and whether each goes round whole; what comes late is whole.
pub(crate) fn sent(case: &Case) -> Vec<(u8, bool)> {
    let faults = case.faults().into_iter();
    let spoiling = faults.filter(|(.., harm)| !matches!(harm, Harm::Delay(_)));
    let damaged: BTreeSet<u64> = spoiling.map(|(_, byte, _)| byte).collect();
    let numbered = (1..).zip(case.bytes());
    let whole = numbered.map(|(number, byte)| (byte, !damaged.contains(&number)));
    whole.collect()
}

/// The first place where a simulated ring of plain drives differs from the reference model. `None` also if the model does not cover
/// the case: it has no time and no power.
#[must_use]
pub(crate) fn against_reference(
    case: &Case,
    link: &SimulatedLink,
    trace: &Trace,
) -> Option<Difference> {
    let beyond =
        |act: &super::case::Act| matches!(act.what, ActKind::Wait(_) | ActKind::Power { .. });
    if case.acts.iter().any(beyond) || asks_for_code(case) {
        return None;
    }
    let faults = reference_faults(case)?;
    let ring = case.ring();
    let monitors = |drive| link.peek(ring, drive, ram::FLAGS2).unwrap_or(0) & 0x04 != 0;
    if (0..case.drives).any(monitors) {
        return None;
    }
    let mut drives: Vec<_> = (0..case.drives).map(|_| reference::Drive::new()).collect();
    let links = reference::run(&mut drives, &case.bytes(), &faults);
    // A reset may have switched the monitoring off again after a time-out.
    if drives.iter().any(reference::Drive::has_monitored) {
        return None;
    }
    for (place, (link, expected)) in trace.channels.iter().zip(&links).enumerate() {
        let received = || {
            let arrived = link.octets().iter().filter_map(|byte| byte.arrival());
            arrived.map(|byte| (byte.byte, byte.error.is_some()))
        };
        let expected = || expected.iter().map(|cell| (cell.byte, cell.error));
        if !received().eq(expected()) {
            let (received, expected): (Vec<_>, Vec<_>) =
                (received().collect(), expected().collect());
            let shorter = received.len().min(expected.len());
            let pairs = received.iter().zip(&expected);
            let at = pairs.clone().position(|(a, b)| a != b).unwrap_or(shorter);
            return Some(on_link(case, place, at, received.get(at), expected.get(at)));
        }
    }
    drives.iter().rev().zip(0..).find_map(|(other, drive)| {
        let in_error = link.error_of(ring, drive).flatten().is_some();
        if in_error != other.in_error() {
            return Some(beside_bus(ring, drive, "error mode", "9.7", ""));
        }
        // The reference model knows one code for every bad byte.
        let held = link.ring(ring)?.drive(drive)?.cells().ram_and_registers();
        if held == other.ram_and_registers() {
            return None;
        }
        let cells = held.iter().zip(other.ram_and_registers());
        let mut cells = (0xFD80_u16..=0xFFFF).zip(cells);
        let differing = cells.find(|(cell, (held, other))| {
            held != other && ![ram::ERRORCODE, ram::ERRORCODE + 1].contains(cell)
        });
        differing.map(|(cell, _)| {
            let detail = format!(" {cell:04X}");
            beside_bus(ring, drive, "contents of a cell", "10.2", &detail)
        })
    })
}

/// What the witnesses of whole ND21s complain of, or an answer that did not go out a byte time after the byte received.
#[must_use]
pub(crate) fn against_witnesses(
    case: &Case,
    link: &mut SimulatedLink,
    trace: &Trace,
) -> Option<Difference> {
    let ring = case.ring();
    let Some((drive, found)) = link.complaint(ring) else {
        return untimely(case, link.byte_time(), trace);
    };
    let name = drive_name(ring, drive);
    let Complaint {
        heard, at, about, ..
    } = found;
    let at = at.since_start();
    Some(Difference {
        what: Symptom::Drive,
        section: found.section.to_owned(),
        rule: found.rule.to_owned(),
        ring,
        drive: Some(drive),
        meant: None,
        byte: None,
        time: false,
        about: format!("drive {name}, byte {heard} on the link to it, at {at}: {about}"),
    })
}

/// A byte that did not go out when the byte that it answers had arrived (ND21 8.2). After faults and silence other bytes may delay it.
fn untimely(case: &Case, byte_time: Span, trace: &Trace) -> Option<Difference> {
    let waits = |act: &super::case::Act| matches!(act.what, ActKind::Wait(_));
    if !case.faults().is_empty() || case.acts.iter().any(waits) {
        return None;
    }
    trace.channels.windows(2).find_map(|pair| {
        let mut heard = pair[0].octets().iter().map(|byte| byte.at + byte_time);
        // Bytes without an answer are skipped: PAUSE, and everything that a drive without power receives.
        let early = |at: Instant| !heard.any(|due| due == at);
        let place = pair[1].octets().iter().map(|byte| byte.at).position(early)?;
        let drive = pair[1].from?;
        let (number, at) = (place + 1, pair[1].octets()[place].at.since_start());
        let name = drive_name(case.ring(), drive);
        Some(Difference {
            what: Symptom::Time,
            section: "8.2".to_owned(),
            rule: "answer".to_owned(),
            ring: case.ring(),
            drive: Some(drive),
            meant: None,
            byte: None,
            time: true,
            about: format!(
                "byte {number} that drive {name} sent came at {at}, no byte time behind one that it heard"
            ),
        })
    })
}

/// The first byte on the other ring of the bench, to whose drives nothing was sent (ND21 12.2).
#[must_use]
pub(crate) fn beside(case: &Case, link: &SimulatedLink) -> Option<Difference> {
    let other = match case.beside? {
        OtherRing::First(_) => 0,
        OtherRing::Second(_) => 1,
    };
    let trace = link.trace(other);
    let spoke = |link: &Channel| !link.octets().is_empty();
    let place = trace.channels.iter().position(spoke)?;
    let name = link_name(other, trace.stations, place);
    Some(Difference {
        what: Symptom::OtherRing,
        section: "12.2".to_owned(),
        rule: "two rings".to_owned(),
        ring: other,
        drive: None,
        meant: None,
        byte: None,
        time: false,
        about: format!(
            "{name} carried a byte, and the master had sent nothing to ring {}",
            other + 1
        ),
    })
}

/// Whether a case reads the kind of a line error from a drive: the reference model has one code for every bad byte.
fn asks_for_code(case: &Case) -> bool {
    // A long read begins up to three cells in front of it.
    const CODE: RangeInclusive<u16> = ram::ERRORCODE - 3..=ram::ERRORCODE + 1;
    let no_parity = |(_, _, harm): &(u8, u64, Harm)| match harm {
        Harm::Flip { stop, .. } => *stop,
        Harm::Break(_) | Harm::Overrun => true,
        _ => false,
    };
    let asks = |order: &CommandSent| {
        order
            .command
            .cell()
            .is_some_and(|cell| CODE.contains(&cell))
    };
    case.faults().iter().any(no_parity) && case.orders().any(asks)
}

fn on_link(
    case: &Case,
    place: usize,
    at: usize,
    received: Option<&(u8, bool)>,
    expected: Option<&(u8, bool)>,
) -> Difference {
    let show = |byte: Option<&(u8, bool)>| match byte {
        None => "nothing".to_owned(),
        Some((byte, false)) => format!("{byte:02X}"),
        Some((byte, true)) => format!("{byte:02X} (bad)"),
    };
    let name = link_name(case.ring(), case.drives, place);
    Difference {
        what: Symptom::Link,
        section: "9.1".to_owned(),
        rule: "ring".to_owned(),
        ring: case.ring(),
        drive: None,
        meant: None,
        byte: (place == usize::from(case.drives)).then_some(at + 1),
        time: false,
        about: format!(
            "byte {} on {name} is {}, the reference model says {}",
            at + 1,
            show(received),
            show(expected)
        ),
    }
}

fn beside_bus(ring: usize, drive: u8, rule: &str, section: &str, detail: &str) -> Difference {
    let name = drive_name(ring, drive);
    Difference {
        what: Symptom::State,
        section: section.to_owned(),
        rule: rule.to_owned(),
        ring,
        drive: Some(drive),
        meant: None,
        byte: None,
        time: false,
        about: format!("drive {name}: {rule}{detail} differs from the reference model"),
    }
}

/// The faults in the words of the reference model; `None` where it has none for one of them, or two meet.
fn reference_faults(case: &Case) -> Option<Vec<(usize, usize, reference::Fault)>> {
    let mut places = BTreeSet::new();
    let mut faults = Vec::new();
    for (link, byte, harm) in case.faults() {
        if !places.insert((link, byte)) {
            return None;
        }
        let fault = match harm {
            Harm::Flip { data, parity, stop } => reference::Fault::Flip(data, parity, stop),
            Harm::Replace(byte) => reference::Fault::Replace(byte),
            Harm::Drop => reference::Fault::Drop,
            Harm::Duplicate => reference::Fault::Duplicate,
            Harm::Insert(byte) => reference::Fault::Insert(byte),
            // Shorter than a byte: nothing but the byte itself is lost.
            Harm::Break(..=280) => reference::Fault::Break,
            // The byte is read as it is, and marked bad.
            Harm::Overrun => reference::Fault::Flip(0, true, false),
            Harm::Delay(_) | Harm::Break(_) => return None,
        };
        faults.push((usize::from(link), usize::try_from(byte).ok()?, fault));
    }
    Some(faults)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Folders of older versions hold the description in place of the name.
    #[test]
    fn old_and_new_findings_are_of_one_kind() {
        let text = |what: &str| {
            format!(
                r#"{{"what":"{what}","section":"9.6","rule":"command","byte":3,"about":"any text"}}"#
            )
        };
        let read = |what: &str| serde_json::from_str::<Difference>(&text(what));
        let names = [
            ("value", "another value"),
            ("line-status", "another line status"),
            ("missing", "a byte is missing"),
            ("surplus", "a byte too many"),
            ("time", "another time"),
            ("drive", "another drive than that of the manual"),
            ("other-ring", "a byte on the other ring"),
            ("link", "another byte on a link than in the reference model"),
            ("state", "another state than in the reference model"),
        ];
        for (name, described) in names {
            let (new, old) = (read(name).expect(name), read(described).expect(described));
            assert!(new.is_like(&old), "{name}");
            assert_eq!(old.what.words(), described);
            let written = serde_json::to_string(&old).expect("a form");
            assert!(
                written.contains(&format!("\"what\":\"{name}\"")),
                "{written}"
            );
        }
        let other = Difference {
            section: "9.5".to_owned(),
            ..read("value").expect("one")
        };
        assert!(!other.is_like(&read("value").expect("one")));
        assert!(read("anything").is_err());
    }

    /// ND21 9.3: every drive on its way changes an address byte, so that the drive that is addressed need not be wrong.
    #[test]
    fn an_address_byte_is_meant_for_no_drive_alone() {
        let drive = Some(0);
        let meant = |role| {
            let found = twin::Divergence {
                ring: 0,
                byte: 2,
                what: Symptom::Value,
                expected: None,
                received: None,
                role,
                rule: role.rule(),
                step: None,
                drive: None,
            };
            Difference::from(&found).meant
        };
        assert_eq!(meant(Role::Address { drive }), None);
        assert_eq!(meant(Role::ProcessData { drive }), drive);
    }
}
