//! The error mode of single drives (ND21 9.7), seen on the links in front of them and behind them.
//!
//! A drive shows its error mode by what it sends: 00, and later what it received plus 1. Which byte it is that it must not accept follows from
//! the bytes that it received. So a model of the bus end takes these, and what the drive sends must be what the model sends. The number that
//! the drive keeps of its error is not on the bus: the cause is the one that the manual gives for the byte at which the zeros begin.

use super::Runner;
use crate::link::BesideTheBus;
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::Place;
use harness_proto::novobus::command::Field;
use harness_proto::novobus::error::BusError;
use harness_proto::time::{Instant, Span};
use harness_sim::novobus::device::Device;
use harness_sim::novobus::plain::PlainDrive;
use std::ops::RangeInclusive;

/// How long the port of a tap may lag behind that of the ring, and how often it is looked at meanwhile.
const PATIENCE: Span = Span::from_millis(1_000);
const LOOK: Span = Span::from_millis(10);

/// Looks at the links around drives, where the link itself does not show their error mode.
pub(crate) fn tap(runner: &mut Runner<'_>, ring: usize, drives: RangeInclusive<u8>) {
    let size = runner.link.drives(ring);
    let listens = |runner: &Runner<'_>, drive: u8| {
        let place = usize::from(size.saturating_sub(drive));
        drive < size
            && [place - 1, place]
                .iter()
                .all(|p| runner.link.listens(ring, *p))
    };
    super::over_bus::forget_answers(runner);
    let hidden = |runner: &Runner<'_>, drive: u8| runner.link.error_of(ring, drive).is_none();
    let wanted: Vec<_> = drives
        .filter(|drive| hidden(runner, *drive) && listens(runner, *drive))
        .collect();
    if wanted.is_empty() {
        return;
    }
    runner.settle();
    for drive in wanted {
        let place = usize::from(size - drive);
        let columns = [place - 1, place].map(|place| column(runner, ring, place));
        if let [Some(input), Some(output)] = columns
            && let Some(shown) = shown(&input, &output)
        {
            runner.own.tapped.insert((ring, drive), shown);
        }
    }
}

/// What a link has carried. The port of a tap may be slower than that of the ring: each link carries as many bytes as have come round.
fn column(runner: &mut Runner<'_>, ring: usize, place: usize) -> Option<Vec<Received>> {
    let round = runner.ports.get(ring).map_or(0, |port| port.received.len());
    let end = runner.link.now() + PATIENCE;
    loop {
        let column = runner.link.tapped(ring, place)?;
        let now = runner.link.now();
        if column.len() >= round || now >= end || runner.full.is_some() {
            return Some(column);
        }
        runner.wait(end.min(now + LOOK));
    }
}

/// The error mode of a drive, as the link or its taps show it.
pub(crate) fn shown_error(runner: &Runner<'_>, ring: usize, drive: u8) -> Option<Option<BusError>> {
    let tapped = || runner.own.tapped.get(&(ring, drive)).copied();
    runner.link.error_of(ring, drive).or_else(tapped)
}

/// The error of a drive that received and sent these bytes since it waited for a sync byte: `Some(None)` where it is not in the error mode,
/// `None` where the bytes do not tell.
fn shown(input: &[Received], output: &[Received]) -> Option<Option<BusError>> {
    if input.is_empty() {
        return None;
    }
    let mut model = PlainDrive::default();
    let mut output = output.iter();
    // Since the model went into the error mode: whether the drive does what the model does, whether it passes bytes on, and whether
    // the two can be told apart.
    let (mut alike, mut passes, mut telling) = (true, true, false);
    for byte in input {
        let was = model.in_error();
        // The checking byte of an answer is never 00 (9.6).
        let checks = matches!(
            model.bus_end().place(),
            Place::Parameter(parameter) if parameter.field == Field::Check
        );
        let Some(expected) = model.receive(Instant::START, *byte).byte else {
            continue;
        };
        if was != model.in_error() {
            (alike, passes, telling) = (true, true, false);
        }
        let sent = output.next()?;
        alike &= sent.is(expected);
        passes &= sent.is(byte.byte);
        telling |= expected != byte.byte || checks && model.in_error();
    }
    // Bytes that nothing was received for are those of a time-out (9.9).
    if output.next().is_some() {
        return None;
    }
    match (model.in_error(), alike, passes && telling) {
        (true, true, _) if telling => Some(model.cause()),
        (true, false, true) | (false, true, _) => Some(None),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(input: &[u8], output: &[u8]) -> Option<Option<u16>> {
        let good = |bytes: &[u8]| -> Vec<_> { bytes.iter().map(|b| Received::good(*b)).collect() };
        shown(&good(input), &good(output)).map(|error| error.map(BusError::code))
    }

    #[test]
    fn the_bytes_around_a_drive_show_its_error_mode() {
        // A bad sync byte (9.2), and an unknown command (9.5) to this drive.
        assert_eq!(
            of(&[0x80, 0x10, 0x80], &[0x80, 0x00, 0x00]),
            Some(Some(0x0504))
        );
        let unknown = [0x82, 0xFF, 0x17, 0x80];
        assert_eq!(of(&unknown, &[0x82, 0x00, 0x00, 0x00]), Some(Some(0x0505)));
        let zero = [0x88, 0xFF, 0xC0, 0x13, 0xFE, 0x00];
        let answer = [0x88, 0x00, 0xC0, 0x13, 0x00, 0x00];
        assert_eq!(of(&zero, &answer), Some(Some(0x0507)));
        // It goes on as if nothing were wrong.
        assert_eq!(of(&unknown, &[0x82, 0x00, 0x17, 0x80]), Some(None));
        // It takes offence one byte late, or where nothing is wrong: that is for the comparison with the twin.
        assert_eq!(of(&unknown, &[0x82, 0x00, 0x17, 0x00]), None);
        assert_eq!(of(&[0x80, 0x80], &[0x80, 0x00]), None);
        assert_eq!(of(&[0x80, 0x80], &[0x80, 0x80]), Some(None));
        // A byte has not come; and one was sent that nothing was received for.
        assert_eq!(of(&[0x80, 0x10, 0x80], &[0x80, 0x00]), None);
        assert_eq!(of(&[0x80], &[0x80, 0x00]), None);
        assert_eq!(of(&[], &[]), None);
    }
}
