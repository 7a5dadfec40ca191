//! `drivebench info` on UNITEK drives: identity, state, errors, speed and position.

use super::read::{Found, find};
use crate::buses::commands::{InfoArguments, OutputForm, TopArguments, Use, columns};
use crate::buses::unitek::live;
use crate::buses::unitek::rig::UnitekDrives;
use crate::buses::unitek::value::hex;
use crate::capture::Piece;
use crate::cli::exit::Exit;
use crate::cli::failure::Failure;
use crate::cli::output::Output;
use crate::cli::port_bench::{PortBench, on, select};
use crate::cli::top_line::{self, LineTop};
use harness_proto::unitek::Register;
use serde_json::{Map, Value, json};

/// What is shown of a drive: the heading, and the register.
const SHOWN: [(&str, u8); 11] = [
    ("firmware", 0x1B),
    ("serial", 0x62),
    ("ready", 0xE2),
    ("enable", 0xE8),
    ("mode", 0x51),
    ("status", 0x40),
    ("errors", 0x8F),
    ("speed", 0x30),
    ("position", 0x6D),
    ("current", 0x20),
    ("bus voltage", 0xEB),
];

/// The heads of the columns of `top`.
const HEADING: [&str; 8] = [
    "drive", "ready", "enable", "mode", "speed", "position", "status", "errors",
];

/// Lists drives.
pub(super) fn info(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &InfoArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    on(
        bench,
        &arguments.rig,
        Use::look("info"),
        output,
        |session, output| {
            let drives = select(std::slice::from_ref(&arguments.drives), session)?;
            let registers = SHOWN.map(|(_, register)| Register::of(register));
            let found = find(session, &drives, &registers)?;
            let drives: Vec<_> = found.chunks_exact(SHOWN.len()).collect();
            match arguments.format {
                OutputForm::Text => output.result(&output.fitted(&text(&drives)))?,
                OutputForm::Json => {
                    let drives: Vec<_> = drives.into_iter().map(object).collect();
                    let whole = json!({"schema": 1, "drives": drives});
                    output.result(&format!("{whole}\n"))?;
                }
            }
            Ok(Exit::Passed)
        },
    )
}

/// Shows all drives, a row each; with `--once` one page, and without it again and again until the program is interrupted.
pub(super) fn top(
    bench: PortBench<'_, UnitekDrives>,
    arguments: &TopArguments,
    output: &mut Output,
) -> Result<Exit, Failure> {
    top_line::check(arguments, output)?;
    let look = Use::look("top");
    on(bench, &arguments.rig, look, output, |session, output| {
        let registers = SHOWN.map(|(_, register)| Register::of(register));
        let title = format!("{}: drives on CAN", session.rig().id());
        let drives = session.axes().to_vec();
        let names = drives.iter().map(|own| format!("drive {}", own.node));
        let view = LineTop {
            title,
            heading: HEADING,
            carried: ["frames", "frames/s"],
            picture: live::picture("bench", names),
            read: &mut |session| Ok(rows(&find(session, &drives, &registers)?)),
            rows: &mut |heard| {
                let row = |piece: &Piece| match piece {
                    Piece::Frame(own) => Some(live::at_port(own, &drives)),
                    _ => None,
                };
                heard.iter().filter_map(row).collect()
            },
        };
        view.show(session, arguments, output)
    })
}

/// A row a drive.
fn rows(found: &[Found]) -> Vec<[String; HEADING.len()]> {
    let row = |drive: &[Found]| {
        let of = |register: u8| {
            let found = drive.iter().find(|found| found.reply.register == register);
            found.map_or_else(String::new, words)
        };
        let node = drive.first().map_or(0, |found| found.axis.node);
        [
            node.to_string(),
            of(0xE2),
            of(0xE8),
            of(0x51),
            of(0x30),
            of(0x6D),
            of(0x40),
            of(0x8F),
        ]
    };
    found.chunks_exact(SHOWN.len()).map(row).collect()
}

/// A value in words: of a flag `yes` or `no`, of a word the names of its bits, of a number with its unit.
fn words(found: &Found) -> String {
    let raw = found.reply.data.bits();
    match found.reply.register {
        0x1B | 0x62 | 0xEB => found.reply.number().to_string(),
        0xE2 | 0xE8 => if raw & 1 == 1 { "yes" } else { "no" }.to_owned(),
        0x51 if raw & 4 == 0 => "released".to_owned(),
        0x8F if raw == 0 => "none".to_owned(),
        _ => match found.words() {
            words if words.is_empty() => hex(found.reply.data),
            words => words,
        },
    }
}

fn text(drives: &[&[Found]]) -> String {
    let rows: Vec<_> = drives
        .iter()
        .flat_map(|drive| {
            drive.iter().zip(SHOWN).map(|(found, (name, register))| {
                [
                    found.axis.node.to_string(),
                    name.to_owned(),
                    words(found),
                    format!("{register:02X} {}", found.register().name),
                ]
            })
        })
        .collect();
    columns(&["drive", "what", "value", "register"], &rows)
}

fn object(drive: &[Found]) -> Value {
    let mut object = Map::new();
    for (found, (name, _)) in drive.iter().zip(SHOWN) {
        object.insert("drive".to_owned(), json!(found.axis.node));
        object.insert(name.replace(' ', "_"), json!(words(found)));
    }
    Value::Object(object)
}
