//! `drivebench params` on UNITEK drives: the registers that the drive keeps in its EEPROM (RW), in a file and back.
//!
//! ```toml
//! [unitek]
//! 0x2C = "000A"     # SPEED_KP
//! 0xC8 = "0E10"     # SPEED_RPMMAX  3600 rpm
//! ```

use super::read::RegisterReading;
use super::write::{Order, refuse_denied};
use crate::rig::OfUnitek as _;
use crate::rig::{Axis, Session, UnitekDrives};
use crate::value::{hex, is_parameter, register};
use harness_bench::command::drives::CommandDrives as _;
use harness_bench::command::failure::Failure;
use harness_bench::command::params::{EntryMistake, ParameterFile};
use harness_proto::unitek::guard::{Class, class};
use harness_proto::unitek::{Data, REGISTERS, Register};
use toml::de::DeValue;

/// Identifiers and bit rate: two drives with those of one file could not be told apart.
const REACHED: [u8; 5] = [0x68, 0x69, 0x73, 0x88, 0x89];

/// The register that stores all parameters, and the level that is loaded at power-up (ex 7).
const STORE: (u8, u16) = (0x84, 0);

/// A register and what it is to read.
pub(crate) type RegisterValue = (&'static Register, Data);

pub(super) const PARAMETERS: ParameterFile<UnitekDrives, RegisterValue> = ParameterFile {
    table: "unitek",
    about: ": the registers that it keeps in its EEPROM (RW), as hexadecimal digits",
    expected: [
        "a parameter (RW) expected here",
        "hexadecimal digits in quotes expected here",
    ],
    entry,
    no_table: |key| format!("`{key}` is no table"),
    read: |session, axis| Ok(parameters(session, axis)?.iter().map(line).collect()),
    compare: |session, axis, wanted| Ok(differing(wanted, &parameters(session, axis)?)),
    is_loaded: |(register, _)| {
        class(register.number) != Class::Never && !REACHED.contains(&register.number)
    },
    never_loaded: "identify the device, or say how it is reached, and are never loaded (5A, 62, 67, 68, 69, 73, 88, 89)",
    write,
    written: "written and read back",
    stores_nothing: None,
};

/// The parameters of a drive, read.
fn parameters(session: &mut Session, axis: Axis) -> Result<Vec<RegisterReading>, Failure> {
    let all: Vec<_> = REGISTERS.iter().filter(|row| is_parameter(row)).collect();
    UnitekDrives::read(session, &[axis], &all)
}

fn line(found: &RegisterReading) -> String {
    let register = found.register();
    let value = format!("\"{}\"", hex(found.reply.data));
    format!(
        "0x{:02X} = {value:10} # {:14} {}",
        register.number,
        register.name,
        found.words()
    )
}

/// The registers that read differently from a file.
fn differing(wanted: &[RegisterValue], found: &[RegisterReading]) -> Vec<(RegisterValue, String)> {
    let of = |&(register, wanted): &RegisterValue| {
        let found = found
            .iter()
            .find(|found| found.reply.register == register.number)?;
        let reads = Data::of(register, found.reply.data.bits());
        let line = format!(
            "{:02X} {:14} file {}  drive {}\n",
            register.number,
            register.name,
            hex(wanted),
            hex(reads)
        );
        (reads != wanted).then_some(((register, wanted), line))
    };
    wanted.iter().filter_map(of).collect()
}

fn write(
    session: &mut Session,
    axis: Axis,
    values: &[RegisterValue],
    stores: bool,
) -> Result<(), Failure> {
    let (register, level) = STORE;
    let store = stores.then(|| (Register::of(register), Data::Short(level)));
    let values = values.iter().copied().chain(store);
    let orders: Vec<Order> = values
        .map(|(register, data)| (axis, register, data))
        .collect();
    let mut driver = session.driver();
    refuse_denied(&mut driver, &orders)?;
    for (axis, register, data) in orders {
        driver.write(axis, register.number, data)?;
    }
    Ok(())
}

/// A line of a file.
fn entry(key: &str, value: &DeValue<'_>) -> Result<RegisterValue, EntryMistake> {
    let register = register(key).map_err(EntryMistake::Key)?;
    if !is_parameter(register) {
        let message = format!(
            "register {:02X} ({}) is no parameter ({})",
            register.number, register.name, register.access
        );
        return Err(EntryMistake::Key(message));
    }
    let digits = register.width.bits() as usize / 4;
    let wrong = || EntryMistake::Value(format!("{key} needs {digits} digits"));
    let text = value.as_str().ok_or_else(wrong)?;
    let plain = text.len() == digits && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let raw = u32::from_str_radix(text, 16).ok().filter(|_| plain);
    raw.map(|raw| (register, Data::of(register, raw)))
        .ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_bench::scenario::source::Source;

    fn read(text: &str) -> Result<Vec<RegisterValue>, Vec<String>> {
        let source = Source::from_bytes("p.toml".to_owned(), text.into()).expect("a text");
        PARAMETERS.parse(&source).map_err(|problems| {
            let all = problems.all().iter();
            all.map(|problem| format!("{}: {}", problem.span.start, problem.message))
                .collect()
        })
    }

    #[test]
    fn files_and_their_mistakes() {
        let good = read("[unitek]\n0x2C = \"000A\"\n0x35 = \"00010064\"\n").expect("good");
        assert_eq!(good.len(), 2);
        assert_eq!(good[1].1, Data::Long(0x0001_0064));
        for (text, part) in [
            ("[nd21]\n", "1: there is no table `nd21`"),
            ("[unitek]\n", "0: the file has no parameters"),
            (
                "[unitek]\n0x30 = \"0000\"\n",
                "9: register 30 (SPEED_ACTUAL) is no parameter (RO)",
            ),
            ("[unitek]\n0x2C = \"A\"\n", "16: 0x2C needs 4 digits"),
            ("[unitek]\n0x2C = 10\n", "16: 0x2C needs 4 digits"),
            (
                "[unitek]\nSPEED_KPP = \"000A\"\n",
                "did you mean `SPEED_KP`?",
            ),
            ("[unitek\n", "unclosed table"),
        ] {
            let problems = read(text).expect_err(text);
            assert!(problems[0].contains(part), "{text}: {problems:?}");
        }
    }
}
