//! A DBC file of drives on a CAN bus, for tools that decode frames by one.
//!
//! A drive has two messages: what the master sends to it (5 bytes) and what it sends (6 bytes). Byte 0 of each is the register, REGID, which
//! selects the signals after it. REGID 3D of the master's message reads a register; its next byte is which (`READ`), and the byte
//! after that the interval of the replies. There is one level of selectors and no `SG_MUL_VAL_` line, which many readers do not know.
//! A register is as wide as the drive keeps it, so a tool must accept shorter frames: the
//! drive answers for a register of 16 bits with 4 bytes. A register whose bits have names is one signal a bit.

use harness_proto::unitek::register::{Access, Register, Unit, Width};
use harness_proto::unitek::words::{self, Bit};
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX, REGISTERS, frame};
use std::fmt::Write as _;

const MAX_NAME: usize = 32;

/// Bits of a position that are one turn (6.1, App 6).
const TURN: f64 = 65_536.0;

/// The counts that are 100 % of speed and of torque (App 5).
const FULL_SPEED: f64 = 32_767.0;
const FULL_TORQUE: f64 = 21_845.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Selection {
    /// It selects others, and is always there.
    Selector,
    /// It is there for one value of REGID.
    By(u8),
}

/// One signal: bits of a message, lowest byte first.
struct Signal {
    name: String,
    selected: Selection,
    /// The first bit of the message.
    start: u8,
    bits: u8,
    signed: bool,
    /// What one count is.
    factor: f64,
    unit: &'static str,
    /// Names of single values.
    values: Vec<(u8, String)>,
    comment: String,
}

impl Signal {
    /// An unsigned number without a unit.
    fn plain(name: &str, selected: Selection, start: u8, bits: u8) -> Self {
        Self {
            name: name.to_owned(),
            selected,
            start,
            bits,
            signed: false,
            factor: 1.0,
            unit: "",
            values: Vec::new(),
            comment: String::new(),
        }
    }

    /// The least and the greatest value in its unit.
    fn range(&self) -> (f64, f64) {
        let half = 2_f64.powi(i32::from(self.bits) - 1);
        let (least, greatest) = match self.signed {
            true => (-half, half - 1.0),
            false => (0.0, half * 2.0 - 1.0),
        };
        (least * self.factor, greatest * self.factor)
    }
}

struct DbcMessage {
    id: u16,
    name: String,
    length: u8,
    sender: String,
    receiver: String,
    signals: Vec<Signal>,
    comment: &'static str,
}

/// A DBC file of the first `drives` drives, 1 to 127, with the default identifiers: drive n has 200 + n and 180 + n.
#[must_use]
pub(crate) fn dbc(drives: u16) -> String {
    let messages: Vec<_> = (0..drives)
        .flat_map(|drive| messages(drive, drives))
        .collect();
    let nodes: Vec<_> = (1..=drives).map(|drive| format!("Drive{drive}")).collect();
    let mut text = format!(
        "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: Master {}\n",
        nodes.join(" ")
    );
    for message in &messages {
        declaration(&mut text, message);
    }
    text.push('\n');
    for message in &messages {
        comments(&mut text, message);
    }
    text.push('\n');
    for message in &messages {
        value_names(&mut text, message);
    }
    text
}

fn messages(drive: u16, drives: u16) -> [DbcMessage; 2] {
    let node = format!("Drive{}", drive + 1);
    let prefix = if drives == 1 { "Drive" } else { &node };
    let mut sent = read_request();
    let written = |register: &&Register| is_written(register);
    sent.extend(REGISTERS.iter().filter(written).flat_map(of_register));
    let mut heard = vec![regid()];
    heard.extend(REGISTERS.iter().flat_map(of_register));
    [
        DbcMessage {
            id: DEFAULT_RX + drive,
            name: format!("{prefix}Rx"),
            length: 5,
            sender: "Master".to_owned(),
            receiver: node.clone(),
            signals: sent,
            comment: "To the drive: 3 bytes write 16 bits of a register, 5 bytes write 32 bits, REGID 3D reads one (4.1, 5.2)",
        },
        DbcMessage {
            id: DEFAULT_TX + drive,
            name: format!("{prefix}Tx"),
            length: 6,
            sender: node,
            receiver: "Master".to_owned(),
            signals: heard,
            comment: "From the drive: 4 bytes for a register of 16 bits, 6 bytes for one of 32 bits; the last byte means nothing. Let the tool accept shorter frames",
        },
    ]
}

fn regid() -> Signal {
    Signal::plain("REGID", Selection::Selector, 0, 8)
}

/// Whether a write does something: functions are started by a write, and 3D is a read.
fn is_written(register: &Register) -> bool {
    let written = matches!(register.access, Access::RW | Access::SP | Access::FN);
    written && register.number != frame::READ
}

/// The signals of a request to read: the register, and how often (5.2).
fn read_request() -> Vec<Signal> {
    let named = REGISTERS.iter();
    let named = named.map(|register| (register.number, name(register)));
    let interval = vec![(0, "once".to_owned()), (frame::STOP, "stop".to_owned())];
    vec![
        regid(),
        Signal {
            values: named.collect(),
            comment: "The register that the drive sends".to_owned(),
            ..Signal::plain("READ", Selection::By(frame::READ), 8, 8)
        },
        Signal {
            unit: "ms",
            values: interval,
            comment: "How often the drive sends the register: 0 once, 255 no longer".to_owned(),
            ..Signal::plain("INTERVAL", Selection::By(frame::READ), 16, 8)
        },
    ]
}

fn of_register(register: &Register) -> Vec<Signal> {
    let (factor, unit) = scale(register.unit);
    let signal = Signal {
        factor,
        unit,
        bits: match register.width {
            Width::Bits16 => 16,
            Width::Bits32 => 32,
        },
        signed: register.signed,
        comment: comment(register),
        ..Signal::plain(&name(register), Selection::By(register.number), 8, 16)
    };
    match register.unit {
        Unit::Ramp => ramp(&signal),
        Unit::Status => of_bits(&signal, words::STATUS),
        Unit::Errors => of_bits(&signal, words::ERRORS),
        Unit::Io => of_bits(&signal, words::IO),
        Unit::Mode => of_bits(&signal, words::MODE),
        Unit::Flag => vec![Signal {
            values: yes_or_no(),
            ..signal
        }],
        _ => vec![signal],
    }
}

/// What one count of a register is. How many counts of a current are an ampere depends on the drive (App 7).
const fn scale(unit: Unit) -> (f64, &'static str) {
    match unit {
        Unit::Speed => (100.0 / FULL_SPEED, "%"),
        Unit::Torque => (100.0 / FULL_TORQUE, "%"),
        Unit::Rpm => (1.0, "rpm"),
        Unit::Millis => (1.0, "ms"),
        Unit::Position => (1.0 / TURN, "turns"),
        Unit::DeciAmpere => (0.1, "A"),
        _ => (1.0, ""),
    }
}

fn yes_or_no() -> Vec<(u8, String)> {
    vec![(0, "no".to_owned()), (1, "yes".to_owned())]
}

/// Two times: to 100 % of speed in the lower half, to full torque in the upper half (ex 6, ex 11).
fn ramp(register: &Signal) -> Vec<Signal> {
    let halves = [("speed", 0), ("torque", 16)];
    let half = |(name, bits): (&str, u8)| Signal {
        unit: "ms",
        comment: register.comment.clone(),
        ..Signal::plain(
            &joined(&register.name, name),
            register.selected,
            register.start + bits,
            16,
        )
    };
    halves.into_iter().map(half).collect()
}

/// A signal for each bit that has a name.
fn of_bits(register: &Signal, bits: &[Bit]) -> Vec<Signal> {
    let inside = bits.iter().filter(|bit| bit.number < register.bits);
    let signal = |bit: &Bit| Signal {
        values: yes_or_no(),
        comment: bit.meaning.to_owned(),
        ..Signal::plain(
            &joined(&register.name, &identifier(bit.name)),
            register.selected,
            register.start + bit.number,
            1,
        )
    };
    inside.map(signal).collect()
}

/// The name of a part of a register, as long as a DBC allows.
fn joined(register: &str, part: &str) -> String {
    let room = MAX_NAME - part.len() - 1;
    format!("{}_{part}", &register[..register.len().min(room)])
}

/// The name of a register as an identifier: that of the dump. The number stands after it where it would be the name of several registers,
/// unless the dump prints it so for this one alone; and alone where the name has no letters.
fn name(register: &Register) -> String {
    let plain = identifier(register.name);
    let alike = || {
        REGISTERS
            .iter()
            .filter(|other| identifier(other.name).eq_ignore_ascii_case(&plain))
    };
    let printed = |name: &str| name.eq_ignore_ascii_case(&plain);
    let alone = printed(register.name) && alike().filter(|other| printed(other.name)).count() == 1;
    match (
        plain.starts_with(|c: char| c.is_ascii_alphabetic()),
        alike().count(),
    ) {
        (false, _) => format!("REG_{:02X}", register.number),
        (true, 1) => plain,
        (true, _) if alone => plain,
        (true, _) => format!("{plain}_{:02X}", register.number),
    }
}

/// Letters, digits and single underscores between them; a sign after a word is a word.
fn identifier(text: &str) -> String {
    let text = text.replace('+', " plus");
    let text = match text.strip_suffix('-') {
        Some(text) => format!("{text} minus"),
        None => text.replace('<', "below "),
    };
    let words = text.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<_> = words.filter(|word| !word.is_empty()).collect();
    words.join("_")
}

/// What the manual says of a register, in ASCII without quotation marks, which a DBC cannot hold.
fn comment(register: &Register) -> String {
    let said = match (register.label, register.meaning) {
        (label, "") => label.to_owned(),
        ("" | "??", meaning) => meaning.to_owned(),
        (label, meaning) if label == meaning => label.to_owned(),
        (label, meaning) => format!("{label}: {meaning}"),
    };
    let more = match register.unit {
        Unit::Current => "; as many counts as D9 holds are 200 % of the device current C6 (App 7)",
        _ => "",
    };
    let text = format!("{said}; {} ({}){more}", register.access, register.origin);
    let text = text.replace('ü', "ue").replace('"', "'");
    text.trim_start_matches("; ").to_owned()
}

fn declaration(text: &mut String, message: &DbcMessage) {
    put(
        text,
        format_args!(
            "\nBO_ {} {}: {} {}\n",
            message.id, message.name, message.length, message.sender
        ),
    );
    for signal in &message.signals {
        let selected = match signal.selected {
            Selection::Selector => "M".to_owned(),
            Selection::By(regid) => format!("m{regid}"),
        };
        let (least, greatest) = signal.range();
        put(
            text,
            format_args!(
                " SG_ {} {selected} : {}|{}@1{} ({},0) [{least}|{greatest}] \"{}\" {}\n",
                signal.name,
                signal.start,
                signal.bits,
                if signal.signed { '-' } else { '+' },
                signal.factor,
                signal.unit,
                message.receiver,
            ),
        );
    }
}

fn comments(text: &mut String, message: &DbcMessage) {
    let id = message.id;
    put(
        text,
        format_args!("CM_ BO_ {id} \"{}\";\n", message.comment),
    );
    let commented = |signal: &&Signal| !signal.comment.is_empty();
    for signal in message.signals.iter().filter(commented) {
        let (name, comment) = (&signal.name, &signal.comment);
        put(text, format_args!("CM_ SG_ {id} {name} \"{comment}\";\n"));
    }
}

fn value_names(text: &mut String, message: &DbcMessage) {
    let named = |signal: &&Signal| !signal.values.is_empty();
    for signal in message.signals.iter().filter(named) {
        put(text, format_args!("VAL_ {} {}", message.id, signal.name));
        for (value, name) in &signal.values {
            put(text, format_args!(" {value} \"{name}\""));
        }
        text.push_str(" ;\n");
    }
}

/// Writing to a String cannot fail.
fn put(text: &mut String, what: std::fmt::Arguments<'_>) {
    let _infallible = text.write_fmt(what);
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Names of signals are identifiers of at most 32 letters, each once in its message, and no two signals of a register share a bit.
    #[test]
    fn signals_have_names_and_bits_of_their_own() {
        for message in messages(0, 1) {
            let mut names = BTreeSet::new();
            let mut bits = BTreeSet::new();
            for signal in &message.signals {
                let first = signal.name.as_bytes()[0];
                let rest = signal.name.bytes();
                assert!(first.is_ascii_alphabetic(), "{}", signal.name);
                assert!(
                    rest.into_iter()
                        .all(|c| c.is_ascii_alphanumeric() || c == b'_'),
                    "{}",
                    signal.name
                );
                assert!(signal.name.len() <= MAX_NAME, "{}", signal.name);
                assert!(names.insert(&signal.name), "{} stands twice", signal.name);
                let selected = format!("{:?}", signal.selected);
                for bit in signal.start..signal.start + signal.bits {
                    assert!(bit < message.length * 8, "{}", signal.name);
                    assert!(bits.insert((selected.clone(), bit)), "{}", signal.name);
                }
            }
        }
    }

    #[test]
    fn a_comment_is_ascii() {
        let text = dbc(2);
        assert!(text.is_ascii());
        assert!(text.contains("BO_ 513 Drive1Rx: 5 Master\n"));
        assert!(text.contains("BO_ 386 Drive2Tx: 6 Drive2\n"));
    }
}
