//! `drivebench watch` on UNITEK drives: the values of registers, again and again.

use super::read::{Found, find};
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives};
use crate::value::{bits, hex, registers};
use harness_bench::command::drive::WatchArguments;
use harness_bench::command::exit::Exit;
use harness_bench::command::failure::Failure;
use harness_bench::command::output::Output;
use harness_bench::command::port_bench::{PortBench, on, select};
use harness_bench::command::rig_name::Use;
use harness_bench::command::watch::{HEX, WatchBench, WatchedCell, decimal, watch as show};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::Register;
use harness_proto::unitek::units::{usual, value};

/// Shows values, a line each time.
pub(super) fn watch(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &WatchArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    let registers = registers(&arguments.cells).map_err(Failure::refused)?;
    let as_what = Use::look("watch");
    show(arguments, output, |readings, output| {
        on(bench, &arguments.rig, as_what, output, |session, output| {
            let drives = select(std::slice::from_ref(&arguments.drives), session)?;
            let mut watched = WatchedRegisters {
                session,
                drives: &drives,
                registers: &registers,
            };
            readings.show(&mut watched, output)
        })
    })
}

struct WatchedRegisters<'a> {
    session: &'a mut Session,
    drives: &'a [Axis],
    registers: &'a [&'static Register],
}

impl WatchBench for WatchedRegisters<'_> {
    const DRIVE: &'static str = "drive";

    fn now(&mut self) -> Instant {
        self.session.driver().now()
    }

    fn look(&mut self) -> Result<Vec<WatchedCell>, Failure> {
        let found = find(self.session, self.drives, self.registers)?;
        Ok(found.iter().map(watched_cell).collect())
    }

    fn run(&mut self, time: Span) -> Result<(), Failure> {
        Ok(self.session.driver().run(time)?)
    }
}

fn watched_cell(found: &Found) -> WatchedCell {
    let register = found.register();
    let words = found.words();
    let number = found.reply.number();
    let (digits, unit) = match usual(register.unit) {
        Some(given) => {
            // A short reply of a wide register keeps its sign.
            let raw = (number & i64::from(u32::MAX)) as u32;
            let value = value(register, raw, given, found.scaling);
            (value.map_or(String::new(), decimal), given.name())
        }
        None if bits(register.unit).is_empty() => (number.to_string(), ""),
        None => (hex(found.reply.data), HEX),
    };
    WatchedCell {
        drive: found.axis.node.to_string(),
        name: register.name.to_owned(),
        words: match words.is_empty() {
            true => hex(found.reply.data),
            false => words,
        },
        digits,
        unit,
    }
}
