//! Writes header lines, telegrams and steps as they are read.

use super::parse::word_name;
use super::syntax::{
    Bad, Damage, Header, JobKind, JobStep, Message, OctetHarm, Outside, ParameterChoice,
    ParameterName, Sender, SetupKind, TelegramHarm, TelegramStep, ValueKind, WantedAnswer,
    WordKind, WordName, WordValue, WrittenValue,
};
use harness_bench::scenario::expression::{Expression, Located};
use harness_sim::fault::Flips;

/// The header lines: those of one word, and those about devices.
pub(super) fn header(header: &Header) -> (Vec<(&'static str, String)>, Vec<String>) {
    let rate = header.rate.map(|rate| ("rate", rate.name().to_owned()));
    let slaves = header.slaves.iter().map(|line| {
        let what = setup(&line.what);
        let blank = if what.is_empty() { "" } else { " " };
        format!("slave {}{blank}{what}", line.slave.expression)
    });
    let master = header.master.iter();
    let master = master.map(|wrong| format!("master deviates {}", wrong.name));
    (rate.into_iter().collect(), slaves.chain(master).collect())
}

fn setup(what: &SetupKind) -> String {
    match what {
        SetupKind::There { ppo, posicon } => {
            let ppo = ppo.map(|ppo| format!("ppo {}", ppo.number()));
            let posicon = posicon.then(|| "posicon".to_owned());
            let words: Vec<_> = ppo.into_iter().chain(posicon).collect();
            words.join(" ")
        }
        SetupKind::Property(property, word) => format!("property {} = {word}", property.name),
        SetupKind::Parameter(name, raw) => assigned(name, raw),
        SetupKind::Deviates(deviation) => format!("deviates {}", deviation.name),
    }
}

fn assigned(name: &ParameterName, raw: &WrittenValue) -> String {
    format!("parameter {} = {}", parameter(name), value(raw))
}

fn outside(what: &Outside) -> String {
    match what {
        Outside::Link(true) => "link found".to_owned(),
        Outside::Link(false) => "link lost".to_owned(),
        Outside::Fault { number, on } => {
            let number = number.as_ref();
            let number = number.map_or(String::new(), |number| format!("{} ", factor(number)));
            format!("fault {number}{}", if *on { "on" } else { "off" })
        }
        Outside::Restart => "restart".to_owned(),
    }
}

/// A number as it is; anything else in parentheses.
fn factor(number: &Located) -> String {
    match number.expression {
        Expression::Number(number) if number >= 0 => number.to_string(),
        _ => counted(number),
    }
}

fn counted(number: &Located) -> String {
    format!("({})", number.expression)
}

/// `1205.3`
fn parameter(name: &ParameterName) -> String {
    let mut text = match &name.which {
        ParameterChoice::Numbered(number) => number.to_string(),
        ParameterChoice::Named(parameter) => format!("\"{}\"", parameter.name),
        ParameterChoice::Counted(number) => counted(number),
    };
    for part in &name.index {
        text.push('.');
        text.push_str(&factor(part));
    }
    text
}

fn value(value: &WrittenValue) -> String {
    match &value.kind {
        ValueKind::Raw(raw) => raw.to_string(),
        ValueKind::Given(given) => given.clone(),
        ValueKind::Counted(number) => counted(number),
    }
}

/// A telegram as it stands after `>` or `<`.
pub(super) fn message(message: &Message) -> String {
    let mut text = message.octets.to_string();
    for Bad { octet, how } in &message.bad {
        text.push_str(&format!(" bad {}", factor(octet)));
        match how {
            Damage::Parity => {}
            Damage::Stop => text.push_str(" stop"),
            Damage::Flip(bits) => text.push_str(&format!(" flip{}", flips(*bits))),
            Damage::Gap(time) => text.push_str(&format!(" gap {time}")),
        }
    }
    text
}

fn flips(flips: Flips) -> String {
    let bits = (0..8).filter(|bit| flips.data >> bit & 1 == 1);
    let mut text: String = bits.map(|bit| format!(" {bit}")).collect();
    for (flipped, name) in [(flips.parity, " p"), (flips.stop, " s")] {
        if flipped {
            text.push_str(name);
        }
    }
    text
}

/// Any other step.
pub(super) fn step(step: &TelegramStep) -> String {
    match step {
        TelegramStep::Octet(sender, byte, harm) => {
            let number = &byte.expression;
            format!(
                "! {}byte {number}: {}",
                self::sender(sender),
                octet_harm(harm)
            )
        }
        TelegramStep::Telegram(sender, telegram, given) => {
            let number = &telegram.expression;
            let harm = match given {
                TelegramHarm::Plain(harm) => harm.to_string(),
                TelegramHarm::Delay(time) => format!("delay {time}"),
            };
            format!("! {}telegram {number}: {harm}", self::sender(sender))
        }
        TelegramStep::Power(slave, on) => {
            let what = if *on { "on" } else { "off" };
            format!("! slave {}: {what}", slave.expression)
        }
        TelegramStep::Outside(slave, what) => {
            format!("slave {} {}", slave.expression, outside(what))
        }
        TelegramStep::Quiet => "? quiet".to_owned(),
        TelegramStep::Parameter(slave, name, raw) => {
            format!("? slave {} {}", slave.expression, assigned(name, raw))
        }
        TelegramStep::Job(step) => job(step),
    }
}

/// Whose octets or telegrams are counted, with a blank after it.
fn sender(sender: &Sender) -> String {
    match sender {
        Sender::Any => String::new(),
        Sender::Master => "master ".to_owned(),
        Sender::Slave(slave) => format!("slave {} ", slave.expression),
    }
}

fn octet_harm(harm: &OctetHarm) -> String {
    match harm {
        OctetHarm::Delay(time) => format!("delay {time}"),
        OctetHarm::Plain(harm) => harm.to_string(),
    }
}

fn job(job: &JobStep) -> String {
    let slave = &job.slave.expression;
    match &job.what {
        JobKind::Start { ppo, watchdog } => {
            let ppo = ppo.map_or(String::new(), |ppo| format!(" ppo {}", ppo.number()));
            let watchdog = watchdog.map_or(String::new(), |time| format!(" watchdog {time}"));
            format!("start {slave}{ppo}{watchdog}")
        }
        JobKind::Exchange { send, expect } => {
            let mut text = format!("exchange {slave}{}", words(send, true));
            if !expect.is_empty() {
                text.push_str(" ->");
                text.push_str(&words(expect, false));
            }
            text
        }
        JobKind::Read(name, wanted) => {
            let wanted = match wanted {
                None => String::new(),
                Some(WantedAnswer::Value(wanted_value)) => format!(" = {}", value(wanted_value)),
                Some(WantedAnswer::Error(number)) => format!(" error {}", factor(number)),
            };
            format!("read {slave} {}{wanted}", parameter(name))
        }
        JobKind::Write(name, raw, error) => {
            let error = error.as_ref();
            let error = error.map_or(String::new(), |number| format!(" error {}", factor(number)));
            format!("write {slave} {} = {}{error}", parameter(name), value(raw))
        }
        JobKind::On => format!("on {slave}"),
        JobKind::Off => format!("off {slave}"),
        JobKind::QuickStop => format!("quick-stop {slave}"),
        JobKind::Acknowledge => format!("acknowledge {slave}"),
    }
}

fn words(words: &[(WordName, WordValue)], sent: bool) -> String {
    let one = |(name, value): &(WordName, WordValue)| {
        format!(" {}={}", word_name(*name, sent), word(value))
    };
    words.iter().map(one).collect()
}

fn word(value: &WordValue) -> String {
    match &value.kind {
        WordKind::Bytes(bytes) => {
            let byte = |byte: &Option<u8>| match byte {
                Some(byte) => format!("{byte:02X}"),
                None => "xx".to_owned(),
            };
            bytes.iter().map(byte).collect()
        }
        WordKind::Percent(digits, places) => {
            let places = *places as usize;
            let text = format!("{:0>width$}", digits.unsigned_abs(), width = places + 1);
            let (whole, fraction) = text.split_at(text.len() - places);
            let sign = if *digits < 0 { "-" } else { "" };
            let point = if places == 0 { "" } else { "." };
            format!("{sign}{whole}{point}{fraction}%")
        }
        WordKind::Counted(number) => counted(number),
    }
}
