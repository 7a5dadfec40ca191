//! `drivebench scope`: the drive's oscilloscope is programmed, records and is plotted (ND21 14.10.6).

use super::axes;
use super::rig::{self, OpenBench};
use super::signal::Signal;
use super::write::Orders;
use crate::driver::cell::CellFound;
use crate::driver::{Axis, Error, Measurement, ScopeSettings, Trigger};
use crate::language::argument::{MemoryRange, assignments};
use crate::language::syntax::Written;
use harness_bench::command::drawing::SCOPE_HEADING;
use harness_bench::command::drive::{Edge, ScopeArguments};
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::file;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::Use;
use harness_bench::report::chart::{Chart, Curve};
use harness_bench::report::plot::plot;
use harness_bench::scenario::run::{CellRecord, Sample};
use harness_proto::nd21::units::{self, Scale, UnitError, Value, scope_period_us, trigger_delay};
use harness_proto::time::{Instant, Span};
use std::fmt::Write as _;

/// A recording and what its bytes are.
struct Recording<'a> {
    axis: Axis,
    units: units::DriveUnits,
    signals: &'a [Signal],
    scope: ScopeSettings,
    measurements: Vec<Measurement>,
}

/// Records signals.
pub(crate) fn scope(arguments: &ScopeArguments, output: &mut Output) -> Result<Exit, Failure> {
    let names = [Some(&arguments.signal1), arguments.signal2.as_ref()];
    arguments.drawing.check()?;
    let signals = names
        .into_iter()
        .flatten()
        .map(|name| Signal::new(name))
        .collect::<Result<Vec<_>, _>>()?;
    let then = assignments(&arguments.then)?;
    let holds = arguments.hold.hold || then.is_empty();
    let what = Use::new("scope", arguments.leave, holds);
    rig::on(&arguments.rig, what, output, |bench, output| {
        record(arguments, &signals, &then, bench, output)
    })
}

fn record(
    arguments: &ScopeArguments,
    signals: &[Signal],
    then: &[(MemoryRange, Written)],
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axis = axes::single(&arguments.drive, &bench.bus.axes())?;
    let units = bench.units(axis)?;
    let scope = settle(arguments, signals, units)?;
    let texts = (&arguments.then[..], then);
    let orders = Orders::new(bench, axis, texts, arguments.leave, output)?;
    bench.bus.start_scope(axis, &scope)?;
    orders.write(bench)?;
    let measurements = finish(bench, axis, &scope, arguments.wait)?;
    let recording = Recording {
        axis,
        units,
        signals,
        scope,
        measurements,
    };
    output.result(&recording.text())?;
    if let Some(path) = &arguments.csv {
        file::write(path, &recording.csv())?;
    }
    let curves = recording.curves();
    let zero = match recording.first() {
        None => "the start of the recording",
        Some(_) => "the trigger",
    };
    arguments.drawing.write(&Chart {
        id: "scope",
        title: &format!("Oscilloscope of drive {axis}"),
        note: &format!(
            "Times count from {zero}. The drive records the high byte of a value only (ND21 14.10.6.1)."
        ),
        curves: &curves,
        ..Chart::default()
    })?;
    Ok(Exit::Passed)
}

fn finish(
    bench: &OpenBench,
    axis: Axis,
    scope: &ScopeSettings,
    wait: Span,
) -> Result<Vec<Measurement>, Failure> {
    bench
        .bus
        .finish_scope(axis, scope, wait)
        .map_err(|error| match error {
            Error::TimeOut { .. } => Failure::drive(format!(
                "drive {axis}: the trigger did not come within {wait}; the recording was stopped"
            )),
            other => other.into(),
        })
}

/// The cells of the oscilloscope for what is asked for.
fn settle(
    arguments: &ScopeArguments,
    signals: &[Signal],
    units: units::DriveUnits,
) -> Result<ScopeSettings, Failure> {
    let wrong = |error: UnitError| Failure::refused(error.to_string());
    let period = Value::Exact(arguments.time_base.value);
    let timer0 = match Scale::ScopePeriod.encode(period, units) {
        Some(Ok(raw)) => raw.to_le_bytes()[0],
        Some(Err(error)) => return Err(wrong(error)),
        None => 0,
    };
    let trigger = match (&arguments.trigger, &arguments.level) {
        (Some(name), Some(level)) => {
            let signal = Signal::new(name)?;
            Some(Trigger {
                signal: signal.selector,
                level: signal.level(level, units)?,
                positive: arguments.edge == Edge::Rising,
                delay: trigger_delay(arguments.delay.value.round(), timer0).map_err(wrong)?,
            })
        }
        _ => None,
    };
    let selector = |signal: Option<&Signal>| signal.map_or(0, |signal| signal.selector);
    // One signal alone is selected twice (14.10.6.1).
    Ok(ScopeSettings {
        signals: [selector(signals.first()), selector(signals.last())],
        timer0,
        trigger,
    })
}

impl Recording<'_> {
    fn period(&self) -> u32 {
        scope_period_us(self.scope.timer0)
    }

    /// The measurements of a signal, with their places in the recording.
    fn of(&self, signal: usize) -> impl Iterator<Item = (u32, u8)> + '_ {
        let alone = self.signals.len() == 1;
        let places = (0..).zip(&self.measurements);
        places
            .filter(move |(_, found)| alone || usize::from(found.signal) == signal + 1)
            .map(|(place, found)| (place, found.byte))
    }

    /// A plot of each signal, and where the trigger is.
    fn text(&self) -> String {
        let mut text = String::new();
        for (index, signal) in self.signals.iter().enumerate() {
            let every = self.period() * u32::try_from(self.signals.len()).unwrap_or(1);
            let at = |place: u32| {
                let us = u64::from(place) * u64::from(self.period());
                Instant::START + Span::from_micros(us)
            };
            let samples = self.of(index);
            let record = CellRecord {
                ring: self.axis.ring(),
                drive: self.axis.drive(),
                name: signal.location.name(),
                address: signal.location.address(),
                size: usize::from(signal.location.size),
                scale: signal.location.scale,
                units: self.units,
                every: Some(Span::from_micros(every.into())),
                samples: samples
                    .map(|(place, byte)| Sample::new(at(place), &signal.bytes(byte)))
                    .collect(),
            };
            text.push_str(&plot(&record));
        }
        let _infallible = match self.first() {
            None => writeln!(text, "recorded at once, without a trigger"),
            Some(us) if us <= 0 => writeln!(text, "the trigger is at {}", span(-us)),
            Some(us) => writeln!(text, "the recording begins {} behind the trigger", span(us)),
        };
        text
    }

    /// When the recording begins, in us from the trigger on.
    fn first(&self) -> Option<i64> {
        let trigger = self.scope.trigger?;
        let periods = i64::from(trigger.delay.counter) - 0x100;
        Some(periods * i64::from(self.period()))
    }

    /// The signals as curves; time 0 is the trigger, or the start where there is none.
    #[expect(clippy::cast_precision_loss, reason = "microseconds of a recording")]
    fn curves(&self) -> Vec<Curve> {
        let first = self.first().unwrap_or(0);
        let curve = |(index, signal): (usize, &Signal)| {
            let points = self.of(index).map(|(place, byte)| {
                let us = first + i64::from(place) * i64::from(self.period());
                (us as f64 / 1e3, self.found(signal, byte).number().as_f64())
            });
            Curve {
                name: format!("{} {}", self.axis, signal.location.name()),
                unit: signal
                    .location
                    .scale
                    .map_or_else(String::new, |scale| scale.unit().to_owned()),
                points: points.collect(),
                ..Curve::default()
            }
        };
        self.signals.iter().enumerate().map(curve).collect()
    }

    /// A measurement as a cell: its byte is the highest.
    fn found<'s>(&self, signal: &'s Signal, byte: u8) -> CellFound<'s> {
        CellFound {
            axis: self.axis,
            location: &signal.location,
            bytes: signal.bytes(byte),
            units: self.units,
        }
    }

    fn csv(&self) -> String {
        let mut text = format!("{SCOPE_HEADING}\n");
        let first = self.first().unwrap_or(0);
        let mut rows = Vec::new();
        for (index, signal) in self.signals.iter().enumerate() {
            for (place, byte) in self.of(index) {
                let found = self.found(signal, byte);
                let number = found.number();
                let value = if number.is_null() {
                    String::new()
                } else {
                    number.to_string()
                };
                let time = first + i64::from(place) * i64::from(self.period());
                let (name, unit) = (signal.location.name(), found.unit());
                let row = format!("{time},{},{name},{byte:02X},{value},{unit}\n", index + 1);
                rows.push((place, row));
            }
        }
        rows.sort_by_key(|(place, _)| *place);
        text.extend(rows.into_iter().map(|(_, row)| row));
        text
    }
}

fn span(us: i64) -> Span {
    Span::from_micros(us.unsigned_abs())
}
