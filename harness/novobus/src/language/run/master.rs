//! The driver's part of a scenario: calls over the same line that the scenario plays on, so that what is
//! recorded, limited and shown is all the same.

use super::Runner;
use crate::driver::{Axis, Error, OpenRings, Options, conduct, count_drives};
use crate::language::plan::PlannedCall;
use crate::language::syntax::Ending;
use harness_bench::link::{Lead, Line, Octets, Trouble};
use harness_bench::medium::{HeardPiece, Medium, Out};
use harness_bench::scenario::pattern::Expected;
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::run::halt::Halt;
use harness_bench::scenario::run::outcome::Stop;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::command::Command;
use harness_proto::novobus::master::{Event, Job, Outcome};
use harness_proto::time::{Instant, Span};

/// The line as a master sees it that works in the middle of a scenario.
struct Through<'r, 'a> {
    runner: &'r mut Runner<'a>,
    /// The ring that it works on.
    ring: usize,
    /// Why the scenario cannot go on, if so: its time stands still then.
    halted: Option<Trouble>,
    /// When the last byte sent has left.
    left: Option<Instant>,
}

impl Line for Through<'_, '_> {
    fn medium(&self, port: usize) -> Medium {
        self.runner.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.runner.link.now()
    }

    fn send(&mut self, _ring: usize, what: Out<'_>) -> Instant {
        let end = self.runner.transmit(self.ring, what.octets());
        let start = end - self.byte_time() * what.len() as u64;
        let tolerance = self.runner.link.time_tolerance();
        let late = tolerance.max(self.runner.link.lead().gap());
        if let Some(left) = self.left.replace(end)
            && left + late < start
        {
            self.runner.own.gap = Some(left);
        }
        end
    }

    fn receive(&mut self, _ring: usize) -> Option<(Instant, HeardPiece)> {
        let (at, octet) = self.runner.take_next(self.ring)?;
        Some((at, HeardPiece::Octet(octet)))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let more = self.runner.wait(until);
        self.halted = self.runner.full.as_ref().map(|halt| match halt {
            Halt::Trouble(trouble) => trouble.clone(),
            Halt::Full(why) => Trouble::Lost(why.clone()),
        });
        more
    }

    fn attend(&mut self, _ring: usize, at: Instant) {
        self.runner.link.attend(self.ring, at);
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.halted.as_ref().or_else(|| self.runner.link.trouble())
    }

    fn pause_due(&self) -> Option<Instant> {
        self.runner.link.pause_due()
    }

    fn pause(&mut self) {
        self.runner.pause();
    }

    fn lead(&self) -> Lead {
        self.runner.link.lead()
    }
}

/// Lets the driver do this of these drives; commands go out together.
pub(crate) fn master(
    runner: &mut Runner<'_>,
    ring: usize,
    calls: &[(u8, PlannedCall)],
    once: bool,
    span: TextSpan,
) -> Result<(), Stop> {
    runner.settle();
    runner.forget(ring);
    let size = runner.link.drives(ring);
    let failed = |error: Error| Stop::failed(span, error.to_string());
    let Ok(size) = RingSize::new(u64::from(size)) else {
        return Err(Stop::failed(span, "the ring has no drives"));
    };
    let options = Options {
        deviates: runner.plan.master,
        ..Options::default()
    };
    ask(runner, ring, calls);
    let gap = runner.own.gap;
    let line = Through {
        runner,
        ring,
        halted: None,
        left: None,
    };
    let (mut events, mut ended) = (Vec::new(), Vec::new());
    let result = OpenRings::open(Box::new(line), &[size], options)
        .map_err(failed)
        .and_then(|bus| {
            let result = do_all(&bus, calls, once, &mut ended)
                .map_err(|message| Stop::failed(span, message));
            events = bus.take_events();
            bus.close();
            result
        });
    let faults = events.into_iter().filter_map(|(_, event)| match event {
        Event::Disturbed { fault, .. } => Some(fault),
        _ => None,
    });
    runner.own.disturbed = faults.collect();
    if !runner.own.disturbed.is_empty() {
        // Between two recoveries the driver leaves the line free (9.9).
        runner.own.gap = gap;
    }
    runner.own.ended = ended;
    runner.settle();
    runner.forget(ring);
    runner.line_before = runner.link.now();
    result
}

/// Notes what the driver is asked for; calls of several steps ask for more than is known here.
fn ask(runner: &mut Runner<'_>, ring: usize, calls: &[(u8, PlannedCall)]) {
    let Some(record) = runner.own.rings.get_mut(ring) else {
        return;
    };
    let asked = &mut record.asked;
    for (drive, call) in calls {
        match (call, &mut *asked) {
            (PlannedCall::Command(command, _), Some(asked)) => asked.push((*drive, *command)),
            (PlannedCall::Exchange(..), _) => {}
            (_, asked) => *asked = None,
        }
    }
}

/// Whether what was sent into a ring is as the manual says, without a gap where nothing was wrong. Where time is real, a gap is that
/// of a busy computer, and no drive's fault.
pub(crate) fn rules_kept(runner: &Runner<'_>, ring: usize, span: TextSpan) -> Result<(), Stop> {
    let drives = runner.link.drives(ring);
    let record = runner.own.rings.get(ring);
    let sent = record.into_iter().flat_map(|record| &record.sent);
    let sent: Vec<u8> = sent.map(|(byte, _)| *byte).collect();
    let asked = record.and_then(|record| record.asked.as_deref());
    let of_master = |wrong: String| format!("of the bench's own master: {wrong}");
    let failed = |message: String| Stop::failed(span, of_master(message));
    conduct(drives, &sent, asked).map_err(|wrong| failed(wrong.to_string()))?;
    let Some(gap) = runner.own.gap else {
        return Ok(());
    };
    let message = of_master(format!("it left a gap on the line behind {gap} (ND21 9.1)"));
    Err(match runner.link.time_tolerance() {
        Span::ZERO => Stop::failed(span, message),
        _ => Stop::marginal(span, message + ": the computer was busy"),
    })
}

/// Lets the driver count the drives.
pub(crate) fn count(
    runner: &mut Runner<'_>,
    ring: usize,
    expected: u8,
    span: TextSpan,
) -> Result<(), Stop> {
    runner.settle();
    runner.forget(ring);
    let mut line = Through {
        runner,
        ring,
        halted: None,
        left: None,
    };
    let counted = count_drives(&mut line, 0);
    runner.settle();
    runner.forget(ring);
    runner.line_before = runner.link.now();
    match counted {
        Ok(size) if size.drives() == expected => Ok(()),
        Ok(size) => Err(Stop::failed(
            span,
            format!("the ring has {} drives, expected {expected}", size.drives()),
        )),
        Err(error) => Err(Stop::failed(span, error.to_string())),
    }
}

/// Does it all; how commands have ended is added to `ended`. With `once` they must not run twice, and may end in any way.
fn do_all(
    bus: &OpenRings<'_>,
    calls: &[(u8, PlannedCall)],
    once: bool,
    ended: &mut Vec<Ending>,
) -> Result<(), String> {
    let mut orders = Vec::new();
    let mut values = Vec::new();
    for (drive, call) in calls {
        let Some(axis) = Axis::new(0, *drive) else {
            continue;
        };
        let words = |error: Error| format!("drive {axis}: {error}");
        match call {
            PlannedCall::Command(command, expected) => {
                let job = match once {
                    true => job(*command).once(),
                    false => job(*command),
                };
                let order = bus
                    .start(axis, |drive| Job { drive, ..job })
                    .map_err(words)?;
                orders.push((axis, order, expected));
            }
            PlannedCall::Exchange(value, expected) => values.push((axis, *value, expected)),
            other => do_one(bus, axis, other).map_err(words)?,
        }
    }
    for (axis, order, expected) in orders {
        let words = |error: Error| format!("drive {axis}: {error}");
        let outcome = bus.outcome(order).map_err(words)?;
        ended.push(match outcome {
            Outcome::Read(_)
            | Outcome::Done {
                perhaps_twice: false,
            } => Ending::Done,
            Outcome::Done {
                perhaps_twice: true,
            } => Ending::Twice,
            Outcome::Unknown(_) => Ending::Unknown,
            Outcome::Failed(_) => Ending::Failed,
        });
        match outcome {
            Outcome::Read(data) => compare(axis, data.value(), expected)?,
            Outcome::Unknown(fault) if !once => return Err(words(Error::Unknown(fault))),
            Outcome::Failed(stop) if !once => return Err(words(Error::Stopped(stop))),
            _ => {}
        }
    }
    exchange(bus, &values)
}

/// Exchanges process data with all of these drives in one round.
fn exchange(bus: &OpenRings<'_>, values: &[(Axis, u16, &Vec<Expected>)]) -> Result<(), String> {
    if values.is_empty() {
        return Ok(());
    }
    let nominal: Vec<_> = values
        .iter()
        .map(|(axis, value, _)| (*axis, *value))
        .collect();
    let actual = bus.exchange(&nominal).map_err(|error| error.to_string())?;
    for ((axis, _, expected), actual) in values.iter().zip(actual) {
        compare(*axis, Some(u32::from(actual)), expected)?;
    }
    Ok(())
}

fn job(command: Command) -> Job {
    Job::new(0, command)
}

fn do_one(bus: &OpenRings<'_>, axis: Axis, call: &PlannedCall) -> Result<(), Error> {
    match call {
        PlannedCall::Command(..) | PlannedCall::Exchange(..) => Ok(()),
        PlannedCall::ReadEeprom(address, expected) => {
            let byte = bus.read_eeprom(axis, *address)?;
            compare(axis, Some(u32::from(byte)), &[*expected]).map_err(Error::Value)
        }
        PlannedCall::WriteEeprom(address, byte) => bus.write_eeprom(axis, *address, *byte),
        PlannedCall::RamToEeprom => bus.ram_to_eeprom(axis),
        PlannedCall::Reference => bus.reference(axis),
        PlannedCall::SetActualValue(position) => bus.set_actual_value(axis, *position),
        PlannedCall::InitPs => bus.init_ps(axis),
        PlannedCall::WritePs(position) => bus.write_ps(axis, *position),
        PlannedCall::StartPs => bus.start_ps(axis),
        PlannedCall::WaitForEnd => bus.wait_for_end(axis),
    }
}

/// Whether what was read is what is expected, byte by byte.
fn compare(axis: Axis, value: Option<u32>, expected: &[Expected]) -> Result<(), String> {
    let Some(value) = value else { return Ok(()) };
    let bytes = value.to_be_bytes();
    let bytes = &bytes[bytes.len() - expected.len().min(bytes.len())..];
    let same = bytes
        .iter()
        .zip(expected)
        .all(|(byte, expected)| match expected {
            Expected::Byte(wanted) => byte == wanted,
            _ => true,
        });
    if same {
        return Ok(());
    }
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02X}")).collect::<String>();
    let wanted: String = expected
        .iter()
        .map(|expected| match expected {
            Expected::Byte(byte) => format!("{byte:02X}"),
            _ => "xx".to_owned(),
        })
        .collect();
    Err(format!(
        "drive {axis} holds {}, expected {wanted}",
        hex(bytes)
    ))
}
