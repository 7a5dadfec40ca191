//! Plays the steps of this bus that are no jobs.

use super::Nordac;
use super::jobs;
use super::plan::{PlannedAct, PlannedParameter, SentTelegram, WantedOctet};
use crate::simulate::{self, Bench};
use harness_bench::link::{AnyStimulus, DriveFault, Link, Moment, PlacedFault};
use harness_bench::medium::Out;
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::plan::{PlannedAction, PlannedStep, PlannedWhen};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::outcome::{Mismatch, Stop};
use harness_bench::scenario::run::player::Runner;
use harness_proto::line::{LineError, Received};
use harness_proto::time::Instant;
use harness_sim::octet_segment::{LineFault, LineFaultAt};

/// Places the faults that wait for their octet or telegram.
pub(super) fn begin(runner: &mut Runner<'_, Nordac>) {
    for step in &runner.plan.steps {
        if let PlannedAction::Own(PlannedAct::Fault(placed)) = &step.action
            && step.when == PlannedWhen::Now
        {
            inject(runner.link, *placed);
        }
    }
}

fn inject(link: &mut dyn Link, placed: LineFaultAt) {
    let what = AnyStimulus::Line(placed);
    link.inject(0, PlacedFault::Stimulus(0, what), Moment::Now);
}

pub(super) fn act(
    runner: &mut Runner<'_, Nordac>,
    act: &PlannedAct,
    step: &PlannedStep<Nordac>,
) -> Result<(), Stop> {
    let now = step.when == PlannedWhen::Now;
    let span = step.span;
    match act {
        PlannedAct::Fault(placed) => {
            // One without a time has been placed by `begin`.
            if !now {
                inject(runner.link, *placed);
            }
        }
        PlannedAct::Power(slave, on) => {
            let fault = if *on { DriveFault::On } else { DriveFault::Off };
            runner.happen(now, &[PlacedFault::Drive(*slave, fault)]);
        }
        PlannedAct::Restart(slave) => {
            let faults = [DriveFault::Off, DriveFault::On];
            let faults = faults.map(|fault| PlacedFault::Drive(*slave, fault));
            runner.happen(now, &faults);
        }
        PlannedAct::Outside(slave, stimulus) => {
            let what = AnyStimulus::Nordac(*stimulus);
            runner.happen(now, &[PlacedFault::Stimulus(*slave, what)]);
        }
        PlannedAct::Quiet => {
            runner.settle();
            // What an adapter holds back comes later.
            let held = runner.link.now() + runner.link.time_tolerance();
            runner.pass_until(held);
            runner.nothing_unasked(span)?;
        }
        PlannedAct::Parameter(slave, parameter, raw) => {
            look(runner, span, *slave, *parameter, *raw)?
        }
        PlannedAct::Job(slave, job) => jobs::play(runner, span, *slave, job)?,
    }
    Ok(())
}

/// A parameter beside the bus; over the bus where the inverter cannot be seen.
fn look(
    runner: &mut Runner<'_, Nordac>,
    span: TextSpan,
    slave: u8,
    parameter: PlannedParameter,
    raw: u32,
) -> Result<(), Stop> {
    runner.settle();
    let bench = runner.link.beside();
    let bench = bench.and_then(|bench| bench.downcast_ref::<Bench>());
    let Some(bench) = bench else {
        return jobs::read(runner, span, slave, parameter, Some(raw));
    };
    let found = bench.parameter(slave, parameter.known, parameter.index);
    let Some(found) = found.and_then(|found| parameter.known?.raw_of(found)) else {
        let message = format!("slave {slave} has no {}", parameter.name());
        return Err(Stop::failed(span, message));
    };
    parameter.compare(span, found, raw)
}

/// Sends telegrams, each as one: idle time in front of it and no gap in it.
pub(super) fn transmit(link: &mut dyn Link, port: usize, telegrams: &[SentTelegram]) -> Instant {
    let mut end = link.now();
    for telegram in telegrams {
        if !telegram.bad.is_empty() {
            // Octets of the master are counted from the start, so those before must have left.
            while link.busy() && link.wait(Instant::NEVER) {}
            let trace = link.trace(port);
            let channel = trace.channels.first().into_iter();
            let octets = channel.flat_map(|channel| channel.octets());
            let sent = octets.filter(|octet| octet.sent.is_some()).count();
            for (place, fault) in &telegram.bad {
                let placed = LineFaultAt {
                    station: Some(simulate::BENCH),
                    number: (sent + place + 1) as u64,
                    fault: LineFault::Octet(*fault),
                };
                inject(link, placed);
            }
        }
        end = link.send(port, Out::Octets(&telegram.octets));
    }
    end
}

pub(super) fn matches(wanted: &WantedOctet, octet: Received) -> bool {
    let same = match wanted.octet {
        Expected::Byte(byte) => byte == octet.byte,
        _ => true,
    };
    same && wanted.error == octet.error
}

/// A wanted octet as messages show it.
pub(super) fn describe(wanted: &WantedOctet) -> String {
    marked(wanted.octet.to_string(), wanted.error)
}

/// A received octet as messages show it.
pub(super) fn show(octet: Received) -> String {
    marked(format!("{:02X}", octet.byte), octet.error)
}

fn marked(text: String, error: Option<LineError>) -> String {
    match error {
        None => text,
        Some(error) => format!("{text} with a {error} error"),
    }
}

/// Adds to a finding the whole telegram that was received.
pub(super) fn complete(runner: &Runner<'_, Nordac>, finding: &mut Mismatch) {
    let Some(port) = runner.ports.first() else {
        return;
    };
    let received = &port.received;
    let Some((last, _)) = received.last() else {
        return;
    };
    // A telegram has no gap: octets of one end one octet time after another.
    let octet = runner.link.medium(0).octet_time();
    let mut first = received.len() - 1;
    let mut at = *last;
    while let Some((earlier, _)) = first.checked_sub(1).and_then(|place| received.get(place)) {
        if *earlier + octet != at {
            break;
        }
        at = *earlier;
        first -= 1;
    }
    let octets = received[first..].iter().map(|(_, octet)| show(*octet));
    let octets: Vec<_> = octets.collect();
    let text = format!(" (the last telegram received is {})", octets.join(" "));
    finding.message.push_str(&text);
}
