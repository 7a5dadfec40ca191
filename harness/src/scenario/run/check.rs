//! Checks.

use super::player::{Runner, Shown, Stop, matches};
use crate::locate::{self, Location};
use crate::scenario::pattern::Expected;
use crate::scenario::plan::PlannedCheck;
use crate::scenario::problem::Span;
use harness_proto::line::Received;

/// SYNCO sent to let a ring spell out an address: the bound of 25 zeros, and enough behind it to see
/// that the address stays (ND21 9.7).
const PROBE: usize = 64;

impl Runner<'_> {
    pub(super) fn check(&mut self, check: &PlannedCheck, span: Span) -> Result<(), Stop> {
        let failed = |message: String| Err(Stop::failed(span, message));
        match check {
            PlannedCheck::Located(ring, drive, within) => match self.locate(*ring) {
                Some(location) if location.drive == *drive => enough(location, *within, span),
                Some(location) => failed(format!(
                    "the ring spells out drive {}, expected is drive {drive}",
                    location.drive
                )),
                None => failed(format!(
                    "the ring spells out no address, expected is drive {drive}"
                )),
            },
            PlannedCheck::Within(zeros) => match self.locate(0) {
                Some(location) => enough(location, Some(*zeros), span),
                None => failed("the ring spells out no address".to_owned()),
            },
            PlannedCheck::InError(ring, drives, expected) => {
                let wrong: Vec<_> = drives
                    .clone()
                    .filter(|k| {
                        self.link
                            .error_of(*ring, *k)
                            .is_some_and(|error| error.is_some() != *expected)
                    })
                    .collect();
                if wrong.is_empty() {
                    return Ok(());
                }
                let not = if *expected { " not" } else { "" };
                failed(format!(
                    "{} {}{not} in the error mode",
                    list(&wrong),
                    are(&wrong)
                ))
            }
            PlannedCheck::Error(ring, drive, error) => {
                match self.link.error_of(*ring, *drive).flatten() {
                    Some(found) if found == *error => Ok(()),
                    Some(found) => failed(format!(
                        "drive {drive} has error {found}, expected is {error}"
                    )),
                    None => failed(format!(
                        "drive {drive} is not in the error mode, expected is error {error}"
                    )),
                }
            }
            PlannedCheck::Memory(ring, drives, address, bytes) => {
                self.check_memory(*ring, drives.clone(), *address, bytes, span)
            }
            PlannedCheck::Corrected(times) if *times == self.corrected => Ok(()),
            PlannedCheck::Corrected(times) => failed(format!(
                "{} check sequences came back, expected are {times}",
                self.corrected
            )),
            PlannedCheck::Sent(bytes, time) => {
                if *bytes != self.sent {
                    return failed(format!(
                        "{} bytes were sent since the last check, expected are {bytes}",
                        self.sent
                    ));
                }
                let took = self.sent_to.since(self.sent_from);
                match time {
                    Some((time, tolerance))
                        if took + *tolerance < *time || *time + *tolerance < took =>
                    {
                        failed(format!("the {bytes} bytes took {took}, expected is {time}"))
                    }
                    _ => Ok(()),
                }
            }
            PlannedCheck::Received(bytes) => {
                let received = self.rings[0].received.len() as u64;
                if received == *bytes {
                    return Ok(());
                }
                failed(format!(
                    "{received} bytes were received, expected are {bytes}"
                ))
            }
        }
    }

    fn check_memory(
        &self,
        ring: usize,
        drives: std::ops::RangeInclusive<u8>,
        address: u16,
        bytes: &[Expected],
        span: Span,
    ) -> Result<(), Stop> {
        for drive in drives {
            for (cell, expected) in (address..=u16::MAX).zip(bytes) {
                let Some(found) = self.link.peek(ring, drive, cell) else {
                    continue;
                };
                if !matches(*expected, Received::good(found)) {
                    return Err(Stop::failed(
                        span,
                        format!(
                            "cell {cell:04X} of drive {drive} holds {found:02X}, expected is {}",
                            Shown(*expected)
                        ),
                    ));
                }
            }
        }
        Ok(())
    }

    /// The address that the ring spells out, letting it go on where it has not come to it yet.
    fn locate(&mut self, ring: usize) -> Option<Location> {
        let size = self.link.drives(ring);
        let record = &self.rings[ring];
        let mut heard: Vec<_> = record.received[record.since_recovery..]
            .iter()
            .map(|(_, byte)| *byte)
            .collect();
        locate::locate(&heard, size).or_else(|| {
            heard.extend(self.link.probe(ring, PROBE));
            locate::locate(&heard, size)
        })
    }
}

/// Whether the zeros in front of an address were few enough.
fn enough(location: Location, most: Option<u64>, span: Span) -> Result<(), Stop> {
    match (location.zeros, most) {
        (Some(zeros), Some(most)) if zeros > most => Err(Stop::failed(
            span,
            format!("the address came after {zeros} zeros, expected are at most {most}"),
        )),
        _ => Ok(()),
    }
}

fn list(drives: &[u8]) -> String {
    let names: Vec<_> = drives.iter().map(u8::to_string).collect();
    let s = if drives.len() == 1 { "" } else { "s" };
    format!("drive{s} {}", names.join(", "))
}

fn are(drives: &[u8]) -> &'static str {
    if drives.len() == 1 { "is" } else { "are" }
}
