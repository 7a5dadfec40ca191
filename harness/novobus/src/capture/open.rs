//! What a capture does not show of a right drive: whether it monitors time-outs, and how it does what the manual leaves open. One of them
//! may be why a ring differs from plain memory.

use super::stimuli::CapturedFacts;
use crate::choice::{Choice, of_the_bus};
use crate::language::syntax::{CellPlace, DriveRange, Header, Setup, SetupKind, Written};
use harness_bench::capture::Capture;
use harness_bench::scenario::pattern::{Expected, Pattern};
use harness_proto::nd21::{ee, ram};
use std::collections::BTreeSet;

/// `EE_selftest` with bit 7: time-out monitoring (ND21 14.3.6).
const MONITORING: u8 = 0x80;

/// A longer capture is not played once more for each choice: its bytes on all links.
const MOST_BYTES: usize = 100_000;

/// Something that explains what differs.
#[derive(Clone, Debug)]
pub(super) struct CaptureExplanation {
    /// What makes simulated drives behave so.
    pub(super) header: Header,
    /// Whether right drives are so, and it is nothing that the manual leaves open.
    pub(super) is_right: bool,
    /// What it says to the user.
    pub(super) remark: String,
}

impl CaptureExplanation {
    /// Drives that do nothing that the manual leaves open.
    fn right(header: Header, what: &str) -> Self {
        Self {
            header,
            is_right: true,
            remark: format!("the drives are taken to {what}: so every byte is as the model says"),
        }
    }
}

/// What may explain a difference, the simplest first: monitoring, whole drives, then each open value of the bus without monitoring and with it.
pub(super) fn explanations(capture: &Capture, told: &[CapturedFacts]) -> Vec<CaptureExplanation> {
    if capture.bytes() > MOST_BYTES {
        return Vec::new();
    }
    let monitoring = in_eeprom(capture, |ring, drive| !says(told, ring, drive));
    let with = |choice: &Choice, more: &Header, words: &str| CaptureExplanation {
        header: choice.in_all(capture.traces.len()).and(more),
        is_right: false,
        remark: format!(
            "`{choice}`{words} explains every byte that differs: the manual leaves it open; describe the drives with --setup"
        ),
    };
    let open: Vec<_> = of_the_bus().collect();
    let plain = open
        .iter()
        .filter(|choice| !choice.property.starts_with("time-out"));
    let plain = plain.map(|choice| with(choice, &Header::default(), ""));
    let monitored = open
        .iter()
        .map(|choice| with(choice, &monitoring, " with time-out monitoring"));
    let whole = Header::whole(capture.traces.len());
    // What a reset loads was written to the EEPROM before.
    let reset: BTreeSet<(usize, u8)> = told
        .iter()
        .enumerate()
        .flat_map(|(ring, told)| told.resets.iter().map(move |(_, drive)| (ring, *drive)))
        .collect();
    let until_then = reset
        .iter()
        .filter(|(ring, drive)| !says(told, *ring, *drive));
    let until_then: Header = until_then
        .map(|(ring, drive)| {
            let flags = SetupKind::Memory(CellPlace::at(ram::FLAGS2), byte(0));
            Setup::new(DriveRange::one(*ring, *drive), flags)
        })
        .collect();
    let loads = in_eeprom(capture, |ring, drive| reset.contains(&(ring, drive)));
    let loads = whole.and(&loads).and(&until_then);
    [
        CaptureExplanation::right(monitoring.clone(), "monitor time-outs (ND21 9.9, 14.10.2)"),
        CaptureExplanation::right(whole, "be whole ND21s, with their EEPROM (ND21 14.2.2)"),
    ]
    .into_iter()
    .chain((!reset.is_empty()).then(|| {
        CaptureExplanation::right(
            loads,
            "load time-out monitoring from their EEPROM at the reset (ND21 10.5, 14.3.6)",
        )
    }))
    .chain(plain)
    .chain(monitored)
    .collect()
}

/// Whether a drive has reported whether it monitors.
fn says(told: &[CapturedFacts], ring: usize, drive: u8) -> bool {
    let told = told.get(ring);
    told.is_some_and(|told| told.cells.contains_key(&(drive, ram::FLAGS2)))
}

fn byte(value: u8) -> Written {
    Written::Bytes(Pattern::of(&[Expected::Byte(value)], usize::MAX))
}

/// Monitoring in the EEPROM of these drives. What a drive reported of its RAM holds until a reset.
fn in_eeprom(capture: &Capture, of: impl Fn(usize, u8) -> bool) -> Header {
    let rings = capture.traces.iter().enumerate();
    let drives =
        rings.flat_map(|(ring, trace)| (0..trace.stations).map(move |drive| (ring, drive)));
    drives
        .filter(|(ring, drive)| of(*ring, *drive))
        .map(|(ring, drive)| {
            let place = CellPlace::in_eeprom(ee::SELFTEST);
            let on = SetupKind::Eeprom(place, byte(MONITORING));
            Setup::new(DriveRange::one(ring, drive), on)
        })
        .collect()
}
