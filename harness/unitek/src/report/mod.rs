//! How frames of UNITEK drives read: a row a frame, JSON, the log of candump.

pub(crate) mod csv;
pub(crate) mod curves;
pub(crate) mod json;
pub(crate) mod sequence;
pub(crate) mod table;
#[cfg(test)]
mod tests;

use harness_bench::bus_name::BusName;
use harness_bench::html::Html;
use harness_bench::report::pcapng_frames;
use harness_bench::shown::{
    FileForm, SegmentReport, ShownRun, TablePart, TraceView, drawn, no_form,
};
use harness_proto::can::Frame;
use harness_proto::unitek::properties::Dlc4;
use harness_proto::unitek::register::Unit;
use harness_proto::unitek::units::{Scaling, shown, usual};
use harness_proto::unitek::words::{Bit, ERRORS, IO, MODE, STATUS, set_bits};
use harness_proto::unitek::{Data, Register, Reply, Request};
use harness_sim::record::Trace;
use std::io::{Error, Write};

/// How frames are shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameReport;

impl SegmentReport for FrameReport {
    fn carries(&self) -> &'static str {
        "frames of CAN"
    }

    fn rows(&self, trace: &Trace, part: &TablePart) -> String {
        table::table(trace, part.rows.clone(), part.at_most)
    }

    fn pictures(&self, view: &TraceView<'_>) -> Vec<(String, Html)> {
        let TraceView {
            trace, id, title, ..
        } = *view;
        drawn(
            |html| sequence::sequence(html, id, title, trace),
            |html| curves::curves(html, id, trace),
        )
    }

    fn write(&self, run: &ShownRun<'_>, form: FileForm, out: &mut dyn Write) -> Result<(), Error> {
        let traces = run.traces;
        match form {
            FileForm::Json => json::write(BusName::Unitek, traces, out),
            FileForm::Candump => json::candump(traces, out),
            FileForm::Csv => csv::write(traces, out),
            FileForm::Pcapng => pcapng_frames::write(traces, out),
            FileForm::Vcd(_) | FileForm::Svg(..) => Err(no_form(self.carries(), &form)),
        }
    }
}

/// What a frame says: of the bench to a drive, or of a drive.
#[must_use]
pub(crate) fn meaning(frame: &Frame, of_drive: bool) -> String {
    let id = u16::try_from(frame.id().number()).unwrap_or(0);
    if of_drive {
        return match Reply::decode(frame, id) {
            Ok(reply) => format!(
                "{} = {}",
                name(reply.register),
                contents(reply.register, reply.data)
            ),
            Err(odd) => format!("no reply: {odd}"),
        };
    }
    match Request::decode(frame, id, Dlc4::As3) {
        Ok(Request::Read { register }) => format!("read {}", name(register)),
        Ok(Request::Cycle { register, every }) => format!("every {every} ms {}", name(register)),
        Ok(Request::Stop { register }) => format!("stop {}", name(register)),
        Ok(Request::Write { register, data }) => {
            format!("write {} = {}", name(register), contents(register, data))
        }
        Err(ignored) => format!("ignored: {ignored}"),
    }
}

/// `40 STATUS`
fn name(register: u8) -> String {
    let register = Register::of(register);
    format!("{:02X} {}", register.number, register.name)
}

/// The raw number, and what it means.
fn contents(register: u8, data: Data) -> String {
    let register = Register::of(register);
    let raw = match data {
        Data::Short(value) if register.width.bits() == 32 => register.extend(value),
        data => data.bits() & register.mask(),
    };
    let digits = match data {
        Data::Short(_) => 4,
        Data::Long(_) => 8,
    };
    let mut text = format!("{:0digits$X}", data.bits());
    let meaning = match register.unit {
        Unit::Status => bits(STATUS, raw),
        Unit::Errors => bits(ERRORS, raw),
        Unit::Io => bits(IO, raw),
        Unit::Mode => bits(MODE, raw),
        unit => usual(unit)
            .and_then(|given| shown(register, raw, given, Scaling::default()))
            .map_or(String::new(), |shown| shown.to_string()),
    };
    if !meaning.is_empty() {
        text.push_str("  ");
        text.push_str(&meaning);
    }
    text
}

/// The names of the bits that are set.
pub(super) fn bits(names: &'static [Bit], word: u32) -> String {
    let names: Vec<_> = set_bits(names, word).map(|bit| bit.name).collect();
    names.join(" ")
}
