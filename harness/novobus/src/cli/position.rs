//! `drivebench position`: a referencing run, a positioning, or both (ND21 13.2).

use super::axes;
use super::rig::{self, OpenBench};
use crate::driver::cell::find;
use crate::driver::{Axis, Error, OpenRings};
use crate::language::argument::{MemoryRange, cells};
use harness_bench::command::drive::PositionArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::rig_name::Use;
use harness_proto::nd21::bits::{self, ps_status};
use harness_proto::nd21::position::{Position, PositionMode};
use harness_proto::nd21::ram;
use harness_proto::nd21::units::{DriveUnits, UnitError, speed_from_raw, speed_to_raw};
use indicatif::ProgressBar;

/// A run, settled before anything moves.
struct PositionRun {
    axis: Axis,
    units: DriveUnits,
    target: Option<Position>,
    /// `ps_v0`.
    speed: Option<u16>,
    reference: bool,
    init: bool,
    /// Where it ends, in words; none of a referencing run alone.
    words: Option<String>,
}

/// Takes a drive to a position.
pub(crate) fn position(
    arguments: &PositionArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let what = Use::new("position", arguments.leave, arguments.hold.hold);
    rig::on(&arguments.rig, what, output, |bench, output| {
        turn(arguments, bench, output)
    })
}

fn turn(
    arguments: &PositionArguments,
    bench: &OpenBench,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let axis = axes::single(&arguments.drive, &bench.bus.axes())?;
    let run = settle(arguments, axis, bench.units(axis)?)?;
    let [place, speed] = [
        run.cell(bench, "position")?,
        match arguments.speed {
            Some(speed) => speed.to_string(),
            None => run.cell(bench, "ps_v0")?,
        },
    ];
    let mut words = Vec::new();
    if run.reference {
        // Their directions and speeds have nothing to do with ps_v0 (13.1.4).
        let [first, second] = [run.cell(bench, "RefV1")?, run.cell(bench, "RefV2")?];
        words.push(format!("a referencing run (RefV1 {first}, RefV2 {second})"));
    }
    words.extend(run.words.clone());
    let words = words.join(", then ");
    let warning = format!(
        "drive {axis} stands at {place} and will turn: {words}, at most at {speed} (ps_v0)"
    );
    if !arguments.leave {
        return Err(Failure::refused(format!(
            "{warning}; nothing was moved, add --move to allow it"
        )));
    }
    run.check(bench)?;
    output.say(&format!("{warning}\n"));
    let bar = spinner(output.progress);
    let start = bench.bus.now();
    let before = bench.bus.read_word(axis, ram::PS_V0)?;
    let end = run.play(bench, &bar, before);
    bar.finish_and_clear();
    if let Err(failure) = end {
        // The motor must not go on turning. If this stop fails too, the rig is given back in its safe state, which reports whether the drives
        // stand.
        if bench.bus.stop(axis).is_ok() {
            output.say(&format!("drive {axis} was stopped (software stop)\n"));
        }
        return Err(failure);
    }
    let took = bench.bus.now().since(start);
    let place = run.cell(bench, "position")?;
    let speed = bench.bus.read_word(axis, ram::PS_V0)?;
    if speed != before {
        let [now, before] = [speed, before].map(|raw| run.speed_in_words(raw));
        output.say(&format!(
            "drive {axis}: ps_v0 stays at {now}: the rig's [limits] do not let {before} be written back\n"
        ));
    }
    output.result(&format!("drive {axis} stands at {place} after {took}\n"))?;
    Ok(Exit::Passed)
}

fn settle(
    arguments: &PositionArguments,
    axis: Axis,
    units: DriveUnits,
) -> Result<PositionRun, Failure> {
    let wrong = |error: UnitError| Failure::refused(error.to_string());
    let to = arguments.to.map(|to| (PositionMode::Absolute, "to", to));
    let by = arguments.by.map(|by| (PositionMode::Relative, "by", by));
    let end = to.or(by);
    let target = end.map(|(mode, _, turns)| Position::from_turns(mode, turns.value));
    let speed = arguments
        .speed
        .map(|speed| speed_to_raw(speed.value, units.range));
    let speed = speed.transpose().map_err(wrong)?;
    if speed.is_some_and(|speed| speed <= 0) {
        return Err(Failure::refused("--speed must be more than 0 rpm"));
    }
    Ok(PositionRun {
        axis,
        units,
        target: target.transpose().map_err(wrong)?,
        speed: speed.map(i16::cast_unsigned),
        reference: arguments.reference,
        init: arguments.init,
        words: end.map(|(_, how, turns)| format!("{how} {turns}")),
    })
}

impl PositionRun {
    /// The value of a cell in words.
    fn cell(&self, bench: &OpenBench, name: &str) -> Result<String, Failure> {
        let locations: Vec<MemoryRange> = cells(&[name.to_owned()])?;
        let mut text = String::new();
        for location in &locations {
            text = find(&bench.bus, (self.axis, self.units), location)?.value();
        }
        Ok(text)
    }

    /// Refuses a run that would end at once, or never begin.
    fn check(&self, bench: &OpenBench) -> Result<(), Failure> {
        let axis = self.axis;
        let state = bench.bus.state(axis)?;
        let error = state.error_in_words().map(|error| format!(": {error}"));
        if state.mode() != "go" {
            // Without --hold a command ends in the safe state, so `go` alone would not help.
            let remedy = match bench.has_ports() {
                true => format!(
                    "`drivebench go {axis} --move --hold` with the same --rig leaves it in go: its motor may then turn \
                     without supervision until `drivebench block {axis}`"
                ),
                false => "see `drivebench go` and `delete-error`".to_owned(),
            };
            return Err(Failure::drive(format!(
                "drive {axis} is in {}{}; positioning needs a drive in go, with the inputs GPIN3 and GPIN5 high \
                 (ND21 5.3.3); {remedy}",
                state.mode(),
                error.unwrap_or_default()
            )));
        }
        let status = bench.bus.read_byte(axis, ram::PS_STATUS)?;
        if !self.reference && !self.init && status & ps_status::FINISHED == 0 {
            return Err(Failure::drive(format!(
                "drive {axis}: the positioning controller is not initialised (ps_status {status:02X}); add \
                 --reference for a referencing run or --init to take the place where it stands (ND21 13.2.1)"
            )));
        }
        Ok(())
    }

    /// Does it; `before` is `ps_v0`, which another speed is for this run only.
    fn play(&self, bench: &OpenBench, bar: &ProgressBar, before: u16) -> Result<(), Failure> {
        let (bus, axis) = (&bench.bus, self.axis);
        if let Some(speed) = self.speed {
            bus.write_word(axis, ram::PS_V0, speed)?;
        }
        let end = self.turn(bus, bar);
        let restored = match self.speed {
            Some(_) => bus.restore_ps_v0(axis, before).map(|_| ()),
            None => Ok(()),
        };
        Ok(end.and(restored)?)
    }

    fn turn(&self, bus: &OpenRings<'_>, bar: &ProgressBar) -> Result<(), Error> {
        let axis = self.axis;
        if self.reference {
            bus.reference_showing(axis, |flags2| show(bar, ram::FLAGS2, flags2))?;
        }
        if self.init {
            bus.init_ps(axis)?;
        }
        let Some(target) = self.target else {
            return Ok(());
        };
        bus.write_ps(axis, target)?;
        bus.start_ps(axis)?;
        bus.wait_for_end_showing(axis, |status| show(bar, ram::PS_STATUS, status))
    }

    /// A raw `ps_v0` in words.
    fn speed_in_words(&self, raw: u16) -> String {
        let rpm = speed_from_raw(raw.cast_signed(), self.units.range).to_f64();
        format!("{rpm:.2} rpm")
    }
}

/// The phase of a run in the manual's words.
fn show(bar: &ProgressBar, cell: u16, byte: u8) {
    let names: Vec<_> = bits::set_in(cell, byte).collect();
    bar.set_message(names.join(", "));
    bar.tick();
}

fn spinner(shown: bool) -> ProgressBar {
    match shown {
        true => ProgressBar::new_spinner(),
        false => ProgressBar::hidden(),
    }
}
