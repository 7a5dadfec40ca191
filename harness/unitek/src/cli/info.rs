//! `drivebench info` on UNITEK drives: identity, state, errors, speed and position.

use super::control::how;
use super::read::RegisterReading;
use crate::live;
use crate::rig::{Axis, OfUnitek as _, Session, UnitekDrives};
use crate::value::hex;
use harness_bench::capture::Piece;
use harness_bench::command::drives::{CommandDrives as _, DriveInfo};
use harness_bench::command::failure::Failure;
use harness_bench::command::line_top::LineTop;
use harness_bench::top::{TopColumn, TopForm, TopRow};
use harness_proto::unitek::Register;
use harness_proto::unitek::words::{ERRORS_NOT_READY, MODE_LOCK};

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

/// The registers of `top`, in the order of its columns after the drive's number.
const OF_TOP: [u8; 7] = [0xE2, 0xE8, 0x51, 0x30, 0x6D, 0x40, 0x8F];

/// The table of `top`.
static FORM: TopForm = TopForm {
    drive: "drive",
    columns: &[
        TopColumn::words("drive", 5),
        TopColumn::words("ready", 5),
        TopColumn::words("enable", 6),
        TopColumn::words("mode", 8),
        TopColumn::words("speed", 15),
        TopColumn::words("position", 11),
        TopColumn::words("status", 7),
        TopColumn::words("errors", 0),
    ],
    give_way: &[5, 2, 1, 3],
    states: &[
        "not read",
        "error",
        "not ready",
        "locked",
        "not enabled",
        "released",
    ],
};

pub(super) fn info(session: &mut Session, drives: &[Axis]) -> Result<Vec<DriveInfo>, Failure> {
    let registers = SHOWN.map(|(_, register)| Register::of(register));
    let found = UnitekDrives::read(session, drives, &registers)?;
    let row = |(found, (name, register)): (&RegisterReading, (&str, u8))| {
        let place = format!("{register:02X} {}", found.register().name);
        [name.to_owned(), words(found), place]
    };
    let rows = found.chunks_exact(SHOWN.len());
    let rows = rows.map(|found| found.iter().zip(SHOWN).map(row).collect());
    Ok(drives.iter().map(|axis| axis.node).zip(rows).collect())
}

/// The table of all drives, a row each.
pub(super) fn top(session: &Session) -> LineTop<UnitekDrives> {
    let drives = session.axes().to_vec();
    let names = drives.iter().map(|axis| format!("drive {}", axis.node));
    LineTop {
        what: "drives on CAN",
        form: &FORM,
        traffic: &["from", "frames", "frames/s", "damaged"],
        picture: live::picture("bench", names),
        read: |session, drive| {
            let registers = OF_TOP.map(Register::of);
            Ok(row(&UnitekDrives::read(session, &[drive], &registers)?))
        },
        stop: |session, drive| Ok(how(session.driver().stop(drive)?).to_owned()),
        rows: Box::new(move |heard| {
            let row = |piece: &Piece| match piece {
                Piece::Frame(frame) => Some(live::at_port(frame, &drives)),
                _ => None,
            };
            heard.iter().filter_map(row).collect()
        }),
    }
}

/// The row of a drive of which the registers of `top` were read.
fn row(found: &[RegisterReading]) -> TopRow {
    let raw = |register: u8| {
        let found_register = found.iter().find(|found| found.reply.register == register);
        found_register.map_or(0, |found| found.reply.data.bits())
    };
    let errors = raw(0x8F) & ERRORS_NOT_READY;
    let state = if errors != 0 {
        "error"
    } else if raw(0xE2) & 1 == 0 {
        "not ready"
    } else if raw(0x51) & u32::from(MODE_LOCK) != 0 {
        "locked"
    } else if raw(0xE8) & 1 == 0 {
        "not enabled"
    } else {
        "released"
    };
    let node = found.first().map_or(0, |found| found.axis.node);
    let speed = found.iter().find(|found| found.reply.register == 0x30);
    TopRow {
        state: FORM.state(state),
        in_error: errors != 0,
        speed: speed.map(|found| found.reply.number() as f64),
        error: Some(errors).filter(|errors| *errors != 0),
        cells: std::iter::once(node.to_string())
            .chain(found.iter().map(words))
            .collect(),
    }
}

/// A value in words: of a flag `yes` or `no`, of a word the names of its bits, of a number with its unit.
fn words(found: &RegisterReading) -> String {
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
