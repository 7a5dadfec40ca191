//! Checks.

use super::Runner;
use super::look::Miss;
use crate::language::plan::PlannedCheck;
use crate::language::syntax::Ending;
use crate::locate::{self, Location};
use harness_bench::counted::counted;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::Stop;
use harness_proto::novobus::master::{Fault, LinkEnd, RingLink};
use harness_proto::novobus::sync::SYNCO;

/// SYNCO sent to let a ring spell out an address: the bound of 25 zeros, and enough behind it to see
/// that the address stays (ND21 9.7).
const PROBE: usize = 64;

pub(crate) fn check(
    runner: &mut Runner<'_>,
    check: &PlannedCheck,
    timed: bool,
    span: TextSpan,
) -> Result<(), Stop> {
    let failed = |message: String| Err(Stop::failed(span, message));
    match check {
        PlannedCheck::Located(ring, drive, within) => match locate(runner, *ring) {
            Some(location) if location.drive == *drive => enough(location, *within, span),
            Some(location) => failed(format!(
                "the ring spells out drive {}, expected drive {drive}",
                location.drive
            )),
            None => failed(format!(
                "the ring spells out no address, expected drive {drive}"
            )),
        },
        PlannedCheck::Within(zeros) => match locate(runner, 0) {
            Some(location) => enough(location, Some(*zeros), span),
            None => failed("the ring spells out no address".to_owned()),
        },
        PlannedCheck::Drive(check) => {
            // An answer over the bus takes longer than a time in front of a line is exact.
            if timed {
                super::over_bus::forget_answers(runner);
            } else {
                super::over_bus::ask_for(runner, check);
            }
            let seen = super::look::look(runner, check);
            super::drives::judged(runner, seen, span)
        }
        PlannedCheck::Error(ring, drive, error) => {
            if timed {
                super::over_bus::forget_answers(runner);
            } else {
                super::tapped::tap(runner, *ring, *drive..=*drive);
            }
            let seen = match super::tapped::shown_error(runner, *ring, *drive) {
                Some(Some(found)) if found == *error => Ok(()),
                Some(Some(found)) => Err(Miss::Otherwise(format!(
                    "drive {drive} has error {found}, expected {error}"
                ))),
                Some(None) => Err(Miss::Otherwise(format!(
                    "drive {drive} is not in the error mode, expected error {error}"
                ))),
                None => Err(Miss::Unseen(format!(
                    "this link does not show whether drive {drive} is in the error mode"
                ))),
            };
            super::drives::judged(runner, seen, span)
        }
        PlannedCheck::Corrected(times) if *times == runner.own.corrected => Ok(()),
        PlannedCheck::Corrected(times) => failed(format!(
            "{} check sequences came back, expected {times}",
            runner.own.corrected
        )),
        PlannedCheck::Named(ring, link, broken) => named(runner, *ring, *link, *broken, span),
        PlannedCheck::Ended(ending) => all_ended(runner, *ending, span),
        PlannedCheck::RulesKept(ring) => super::master::rules_kept(runner, *ring, span),
        PlannedCheck::Sent(bytes, time) => {
            if *bytes != runner.own.sent {
                return failed(format!(
                    "{} sent since the last check, expected {bytes}",
                    counted(runner.own.sent, "byte")
                ));
            }
            let took = runner.own.sent_to.since(runner.own.sent_from);
            let of_link = runner.link.time_tolerance();
            match time {
                Some((time, tolerance))
                    if took + *tolerance + of_link < *time
                        || *time + *tolerance + of_link < took =>
                {
                    failed(format!(
                        "the {} took {took}, expected {time}",
                        counted(*bytes, "byte")
                    ))
                }
                _ => Ok(()),
            }
        }
        PlannedCheck::Received(bytes) => {
            let received = runner.ports[0].received.len() as u64;
            if received == *bytes {
                return Ok(());
            }
            failed(format!(
                "received {}, expected {bytes}",
                counted(received, "byte")
            ))
        }
    }
}

/// Whether all commands of the driver's last job have ended so.
fn all_ended(runner: &Runner<'_>, ending: Ending, span: TextSpan) -> Result<(), Stop> {
    let other = runner.own.ended.iter().find(|ended| **ended != ending);
    let message = match (runner.own.ended.is_empty(), other) {
        (false, None) => return Ok(()),
        (true, _) => "the driver has had no command before".to_owned(),
        (_, Some(other)) => format!(
            "the driver's command ended as \"{}\", expected \"{}\"",
            other.name(),
            ending.name()
        ),
    };
    Err(Stop::failed(span, message))
}

/// Whether the driver said first that this link is broken, or damages bytes.
fn named(
    runner: &Runner<'_>,
    ring: usize,
    link: usize,
    broken: bool,
    span: TextSpan,
) -> Result<(), Stop> {
    let what = if broken { "broken" } else { "damaged" };
    let expected = format!("{what} {}", runner.plan.link_name(ring, link));
    let Some(fault) = runner.own.disturbed.first() else {
        let message = format!("the driver reports no fault, expected {expected}");
        return Err(Stop::failed(span, message));
    };
    let drives = usize::from(runner.link.drives(ring));
    let place = |named: RingLink| match named.to {
        LinkEnd::Master => drives,
        LinkEnd::Drive(drive) => drives.saturating_sub(1 + usize::from(drive)),
    };
    let right = match fault {
        Fault::Damaged(named) => !broken && place(*named) == link,
        Fault::Broken(named) => broken && place(*named) == link,
        _ => false,
    };
    match right {
        true => Ok(()),
        false => Err(Stop::failed(
            span,
            format!("the driver reports: {fault}; expected {expected}"),
        )),
    }
}

/// The address that the ring spells out. Lets the ring continue if it has not spelled it out yet.
fn locate(runner: &mut Runner<'_>, ring: usize) -> Option<Location> {
    let size = runner.link.drives(ring);
    let record = &runner.ports[ring];
    let mut heard: Vec<_> = record.received[runner.own.rings[ring].since_recovery..]
        .iter()
        .map(|(_, byte)| *byte)
        .collect();
    locate::locate(&heard, size).or_else(|| {
        heard.extend(runner.link.probe(ring, &[SYNCO; PROBE]));
        locate::locate(&heard, size)
    })
}

/// Whether the zeros in front of an address were few enough.
fn enough(location: Location, most: Option<u64>, span: TextSpan) -> Result<(), Stop> {
    match (location.zeros, most) {
        (Some(zeros), Some(most)) if zeros > most => Err(Stop::failed(
            span,
            format!("the address came after {zeros} zeros, expected at most {most}"),
        )),
        _ => Ok(()),
    }
}
