//! Writes header lines, messages and steps as they are read.

use super::parse::mode_word;
use super::syntax::{
    Content, DriveHarm, Expect, FrameHarm, FrameStep, Header, JobKind, JobStep, Message, Outside,
    PropertyValue, RegisterName, SetupKind, ValueKind, WrittenValue,
};
use harness_bench::scenario::expression::Located;
use harness_proto::can::Id;
use std::fmt::Display;

/// The header lines: those of one word, and those about devices.
pub(super) fn header(header: &Header) -> (Vec<(&'static str, String)>, Vec<String>) {
    let kilo = |rate: harness_proto::can::BitRate| rate.bits_per_second() / 1000;
    let rate = header.rate.map(|rate| ("rate", kilo(rate).to_string()));
    let drives = header.drives.iter().map(|line| {
        let what = setup(&line.what);
        let blank = if what.is_empty() { "" } else { " " };
        format!("drive {}{blank}{what}", line.drive.expression)
    });
    let master = header.master.iter();
    let master = master.map(|wrong| format!("master deviates {}", wrong.name));
    (rate.into_iter().collect(), drives.chain(master).collect())
}

fn setup(what: &SetupKind) -> String {
    match what {
        SetupKind::There { rx, tx } => {
            let given = [("rx", *rx), ("tx", *tx)].into_iter();
            let given = given.filter_map(|(name, id)| Some((name, id?)));
            let words: Vec<_> = given.map(|(name, id)| format!("{name} {id:03X}")).collect();
            words.join(" ")
        }
        SetupKind::Profile(name) => format!("profile {name}"),
        SetupKind::Property(property, value) => {
            let value: &dyn Display = match value {
                PropertyValue::Word(word) => word,
                PropertyValue::Time(time) => time,
            };
            format!("property {} = {value}", property.name)
        }
        SetupKind::Mode(mode) => format!("mode {}", mode_word(*mode)),
        SetupKind::Deviates(deviation) => format!("deviates {}", deviation.name),
        SetupKind::Outside(stimulus) => outside(stimulus),
    }
}

fn outside(what: &Outside) -> String {
    match what {
        Outside::Register(name, raw) => format!("register {} = {}", register(name), value(raw)),
        Outside::Input(name, high) => {
            format!("input {name} {}", if *high { "high" } else { "low" })
        }
        Outside::Force(name, Some(raw)) => format!("force {name} = {}", value(raw)),
        Outside::Force(name, None) => format!("force {name} off"),
        Outside::Restart => "restart".to_owned(),
    }
}

fn register(name: &RegisterName) -> String {
    match name {
        RegisterName::Known { register, by_name } => match by_name {
            true => register.name.to_owned(),
            false => format!("{:02X}", register.number),
        },
        RegisterName::Counted(number) => counted(number),
    }
}

fn counted(number: &Located) -> String {
    format!("({})", number.expression)
}

fn value(value: &WrittenValue) -> String {
    match &value.kind {
        ValueKind::Raw(raw, digits) => format!("{raw:0digits$X}"),
        ValueKind::Given(decimal, given) => {
            let places = usize::from(decimal.places);
            let digits = format!(
                "{:0>width$}",
                decimal.digits.unsigned_abs(),
                width = places + 1
            );
            let (whole, fraction) = digits.split_at(digits.len() - places);
            let sign = if decimal.digits < 0 { "-" } else { "" };
            let point = if places == 0 { "" } else { "." };
            format!("{sign}{whole}{point}{fraction}{}", given.name())
        }
        ValueKind::Counted(number) => counted(number),
    }
}

fn expect(expect: &Expect) -> String {
    match &expect.tolerance {
        Some(tolerance) => format!("{} +- {}", value(&expect.value), value(tolerance)),
        None => value(&expect.value),
    }
}

/// A frame as it stands after `>` or `<`.
pub(super) fn message(message: &Message) -> String {
    let id = identifier(message.id);
    match &message.content {
        Content::Empty => id,
        Content::Data(data) => format!("{id} {data}"),
        Content::Remote(length) => format!("{id} rtr {length}"),
    }
}

/// An identifier: `201`, `x00000201`.
pub(crate) fn identifier(id: Id) -> String {
    let number = id.number();
    match id.is_extended() {
        true => format!("x{number:08X}"),
        false => format!("{number:03X}"),
    }
}

/// Any other step.
pub(super) fn step(step: &FrameStep) -> String {
    match step {
        FrameStep::Frame(number, harm) => {
            let harm = match harm {
                FrameHarm::Lost => "lost".to_owned(),
                FrameHarm::Doubled => "doubled".to_owned(),
                FrameHarm::Delay(time) => format!("delay {time}"),
                FrameHarm::Corrupt => "corrupt".to_owned(),
                FrameHarm::NoAcknowledge => "no-acknowledge".to_owned(),
                FrameHarm::BusOff => "bus-off".to_owned(),
            };
            format!("! frame {}: {harm}", number.expression)
        }
        FrameStep::Drive(drive, harm) => {
            let harm = match harm {
                DriveHarm::Off => "off",
                DriveHarm::On => "on",
                DriveHarm::BusOff => "bus-off",
            };
            format!("! drive {}: {harm}", drive.expression)
        }
        FrameStep::Outside(drive, what) => format!("drive {} {}", drive.expression, outside(what)),
        FrameStep::Quiet => "? quiet".to_owned(),
        FrameStep::Register(drive, name, expected) => {
            let drive = &drive.expression;
            format!(
                "? drive {drive} register {} = {}",
                register(name),
                expect(expected)
            )
        }
        FrameStep::Job(step) => job(step),
        FrameStep::Master(step) => format!("master {}", job(step)),
    }
}

fn job(job: &JobStep) -> String {
    let drive = &job.drive.expression;
    match &job.what {
        JobKind::Read(name, None) => format!("read {drive} {}", register(name)),
        JobKind::Read(name, Some(expected)) => {
            format!("read {drive} {} = {}", register(name), expect(expected))
        }
        JobKind::Write(name, raw) => format!("write {drive} {} = {}", register(name), value(raw)),
        JobKind::Every(name, time) => format!("every {drive} {} {time}", register(name)),
        JobKind::StopEvery(name) => format!("stop-every {drive} {}", register(name)),
        JobKind::Lock => format!("lock {drive}"),
        JobKind::Release => format!("release {drive}"),
        JobKind::StartUp(false) => format!("start-up {drive}"),
        JobKind::StartUp(true) => format!("start-up {drive} = not-ready"),
    }
}
