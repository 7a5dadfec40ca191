//! Makes and changes cases: requests, writes and inputs that mean something to a drive, and frames that it must not take.

use super::act::{FrameAct, FrameActKind};
use harness_bench::explore::{Dice, Spiced};
use harness_proto::can::{Frame, Id};
use harness_proto::unitek::frame::STOP;
use harness_proto::unitek::words::{MODE_EVENT, MODE_LOCK, status};
use harness_proto::unitek::{Access, Data, REGISTERS, Register, Request, Width};
use harness_sim::unitek::Inputs;

/// The longest time after an act, in microseconds.
pub(super) const LONGEST_WAIT: u64 = 2_000_000;

/// Something that a conversation of frames can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FrameSpice {
    /// Single requests (UNITEK 5.2 item 1).
    Read,
    /// Writes of variables and ramps.
    Write,
    /// Writes of any register (chapter 3).
    WriteAny,
    /// MODE: lock, release and event sending (ex 2, 10).
    Mode,
    /// Speed, torque and position (ex 3 to 5).
    Motion,
    /// Homing (ex 12).
    Homing,
    /// Cyclic requests (5.2 item 2).
    Cycles,
    /// Identifiers, width of replies, time-out (3.1, App 3).
    Settings,
    /// The EEPROM (ex 7).
    Eeprom,
    /// Other lengths than 3 and 5 (App 1).
    Lengths,
    /// Remote frames, other identifiers, 29 bits (4.1, 4.4).
    Foreign,
    /// Inputs and sensors.
    Inputs,
    /// Power off and on.
    Power,
}

impl FrameSpice {
    pub(crate) const NAMES: [(&'static str, Self); 13] = [
        ("read", Self::Read),
        ("write", Self::Write),
        ("write-any", Self::WriteAny),
        ("mode", Self::Mode),
        ("motion", Self::Motion),
        ("homing", Self::Homing),
        ("cycles", Self::Cycles),
        ("settings", Self::Settings),
        ("eeprom", Self::Eeprom),
        ("lengths", Self::Lengths),
        ("foreign", Self::Foreign),
        ("inputs", Self::Inputs),
        ("power", Self::Power),
    ];
}

impl Spiced for FrameSpice {
    const ALL: &'static [(&'static str, Self)] = &Self::NAMES;
}

/// Registers that show what a drive does, of which every case reads some.
const TELLING: [u8; 18] = [
    0x40, 0x51, 0x52, 0x30, 0x6D, 0x8F, 0xE2, 0xE3, 0xE8, 0xF4, 0xD8, 0x31, 0x6E, 0x90, 0x20, 0xCE,
    0xF5, 0x1B,
];

/// Variables and ramps: they change nothing, or only how a motor turns.
const VARIABLES: [u8; 8] = [0xD1, 0xD2, 0xD3, 0xD4, 0x35, 0xED, 0x34, 0x79];

pub(super) fn part(spice: FrameSpice, (node, rx): (u8, u16), dice: &mut Dice) -> Vec<FrameAct> {
    let what = match spice {
        FrameSpice::Inputs => outside(node, dice),
        FrameSpice::Power if dice.percent(25) => FrameActKind::Restart { drive: node },
        FrameSpice::Foreign => FrameActKind::Send(foreign(rx, dice)),
        FrameSpice::Lengths => FrameActKind::Send(of_length(rx, dice)),
        spice => match request(spice, dice).encode(rx) {
            Ok(frame) => FrameActKind::Send(frame),
            Err(_) => FrameActKind::Restart { drive: node },
        },
    };
    vec![FrameAct::new(what, wait(dice))]
}

/// Requests for some of what was written, and for what shows the drive's state.
pub(super) fn close(
    acts: &[FrameAct],
    (_, rx): (u8, u16),
    drives: &[(u8, u16)],
    dice: &mut Dice,
) -> Vec<FrameAct> {
    let mut asked: Vec<_> = acts.iter().filter_map(|act| written(act, drives)).collect();
    asked.dedup();
    let shown: Vec<_> = asked
        .iter()
        .filter_map(|(rx, register)| Some((*rx, shown_by(*register)?)))
        .collect();
    asked.extend(shown);
    asked.extend((0..2).filter_map(|_| Some((rx, *dice.pick(&TELLING)?))));
    let last = asked.split_off(asked.len().saturating_sub(6)).into_iter();
    let read = |(rx, register)| {
        let frame = Request::Read { register }.encode(rx).ok()?;
        Some(FrameAct::new(FrameActKind::Send(frame), 1_500))
    };
    last.filter_map(read).collect()
}

/// The drive and the register that an act writes.
fn written(act: &FrameAct, drives: &[(u8, u16)]) -> Option<(u16, u8)> {
    let FrameActKind::Send(frame) = &act.what else {
        return None;
    };
    let mut receivers = drives.iter().map(|(_, rx)| *rx);
    let rx = receivers.find(|rx| u32::from(*rx) == frame.id().number())?;
    let register = *frame.data().first()?;
    (register != harness_proto::unitek::frame::READ).then_some((rx, register))
}

/// Mostly long enough for a reply; sometimes nothing, sometimes many scans.
pub(super) fn wait(dice: &mut Dice) -> u64 {
    let micros = match dice.below(10) {
        0 => 0,
        1..=5 => 400 + dice.below(2_000),
        6..=8 => 1_000 * dice.below(20),
        _ => 1_000 * dice.below(700),
    };
    (micros as u64).min(LONGEST_WAIT)
}

/// The register that shows what a write to another one does.
const fn shown_by(register: u8) -> Option<u8> {
    Some(match register {
        0xC8 => 0xCE,
        0x31 | 0x90 => 0x30,
        0x7A => 0x6D,
        0x8E | 0xD0 => 0x8F,
        0x78 => 0x40,
        _ => return None,
    })
}

fn any_register(dice: &mut Dice) -> u8 {
    match dice.percent(50) {
        true => *dice.pick(&TELLING).unwrap_or(&0x40),
        false => dice.byte(),
    }
}

/// A value that is a limit, a small one or any.
fn value(dice: &mut Dice) -> u32 {
    const LIMITS: [u32; 10] = [
        0,
        1,
        0xFFFF,
        0x7FFF,
        0x8000,
        0x8001,
        0x7FFF_FFFF,
        0x8000_0000,
        0xFFFF_FFFF,
        0x0001_0000,
    ];
    match dice.below(3) {
        0 => *dice.pick(&LIMITS).unwrap_or(&0),
        1 => u32::from(dice.byte()),
        _ => u32::from(dice.word()) << 16 | u32::from(dice.word()),
    }
}

/// A write of the register's own width; sometimes of the other one.
fn write(register: u8, raw: u32, dice: &mut Dice) -> Request {
    let wide = Register::of(register).width == Width::Bits32;
    let data = match wide != dice.percent(12) {
        true => Data::Long(raw),
        false => Data::Short((raw & 0xFFFF) as u16),
    };
    Request::Write { register, data }
}

fn request(spice: FrameSpice, dice: &mut Dice) -> Request {
    match spice {
        FrameSpice::Write => {
            let register = *dice.pick(&VARIABLES).unwrap_or(&0xD4);
            let raw = value(dice);
            write(register, raw, dice)
        }
        FrameSpice::WriteAny => {
            let writable: Vec<_> = REGISTERS
                .iter()
                .filter(|row| row.access != Access::FN && !matches!(row.number, 0x68 | 0x69))
                .collect();
            let register = dice.pick(&writable).map_or(0xD4, |row| row.number);
            let raw = value(dice);
            write(register, raw, dice)
        }
        FrameSpice::Mode => mode(dice),
        FrameSpice::Motion => {
            let register = *dice.pick(&[0x31, 0x31, 0x90, 0x6E, 0x7A]).unwrap_or(&0x31);
            let raw = value(dice);
            write(register, raw, dice)
        }
        FrameSpice::Homing => {
            let register = *dice.pick(&[0x78, 0x78, 0x72]).unwrap_or(&0x78);
            let raw = dice.below(3) as u32;
            write(register, raw, dice)
        }
        FrameSpice::Cycles => cycle(dice),
        FrameSpice::Settings => settings(dice),
        FrameSpice::Eeprom => {
            let register = *dice.pick(&[0x83, 0x84]).unwrap_or(&0x84);
            let raw = dice.below(3) as u32;
            write(register, raw, dice)
        }
        _ => Request::Read {
            register: any_register(dice),
        },
    }
}

fn mode(dice: &mut Dice) -> Request {
    let (lock, event) = (u32::from(MODE_LOCK), u32::from(MODE_EVENT));
    if dice.percent(30) {
        let masks = [status::ENABLED, 0x3000, 0x000C, 0x0001, 0xFFFF, 0xF811];
        let raw = *dice.pick(&masks).unwrap_or(&0);
        return write(0x52, raw, dice);
    }
    let raw = *dice.pick(&[0, lock, event, lock | event]).unwrap_or(&0);
    write(0x51, raw, dice)
}

fn cycle(dice: &mut Dice) -> Request {
    let register = any_register(dice);
    match dice.below(10) {
        0 | 1 => Request::Stop { register },
        choice => Request::Cycle {
            register,
            every: match choice {
                2..=7 => 2 + dice.below(30) as u8,
                _ => dice.byte().clamp(1, STOP - 1),
            },
        },
    }
}

fn settings(dice: &mut Dice) -> Request {
    let (register, raw) = match dice.below(6) {
        0 => (0x68, 0x200 + dice.below(0x100) as u32),
        1 => (0x69, 0x180 + dice.below(0x100) as u32),
        2 => (0xDC, if dice.percent(60) { 0x0130 } else { 0x0030 }),
        3 => (0x8E, 0x4D44),
        4 => (if dice.percent(50) { 0x88 } else { 0x89 }, 0x202),
        _ => (0xD0, dice.below(60) as u32),
    };
    write(register, raw, dice)
}

/// A frame of another length than the protocol has.
fn of_length(rx: u16, dice: &mut Dice) -> Frame {
    let length = *dice.pick(&[0, 1, 2, 4, 6, 7, 8]).unwrap_or(&4);
    let first = match dice.percent(60) {
        true => *dice.pick(&VARIABLES).unwrap_or(&0xD4),
        false => harness_proto::unitek::frame::READ,
    };
    let mut bytes = [0; 8];
    bytes.fill_with(|| dice.byte());
    bytes[0] = first;
    if first == harness_proto::unitek::frame::READ {
        (bytes[1], bytes[2]) = (any_register(dice), 0);
    }
    frame(rx, &bytes[..length])
}

/// A frame that no drive takes: remote, another identifier, 29 bits.
fn foreign(rx: u16, dice: &mut Dice) -> Frame {
    let request = request(FrameSpice::Read, dice).encode(rx);
    let usual = request.unwrap_or_else(|_| frame(rx, &[]));
    let other = match dice.below(4) {
        0 => Frame::remote(usual.id(), dice.below(9)),
        1 => Frame::base(rx + 1 + dice.below(3) as u16, usual.data()),
        2 => Frame::base(0x201, usual.data()),
        _ => match Id::extended(rx.into()) {
            Some(id) => Frame::new(id, usual.data()),
            None => Ok(usual),
        },
    };
    other.unwrap_or(usual)
}

/// A frame; one with no data where the identifier is none of 11 bits.
fn frame(rx: u16, bytes: &[u8]) -> Frame {
    let frame = Frame::base(rx, bytes).or_else(|_| Frame::base(0x7FF, bytes));
    frame.unwrap_or_else(|_| unreachable!("7FF and at most 8 bytes fit"))
}

fn outside(drive: u8, dice: &mut Dice) -> FrameActKind {
    if dice.percent(70) {
        let name = *dice.pick(&Inputs::SWITCHES).unwrap_or(&"run");
        return FrameActKind::Input {
            drive,
            name: name.to_owned(),
            on: dice.percent(50),
        };
    }
    let name = *dice.pick(&Inputs::FORCED).unwrap_or(&"tol");
    let raw = match name {
        "tol" | "cal" => dice.below(2) as u32,
        "errors" => 1 << dice.below(20),
        _ => dice.word().into(),
    };
    FrameActKind::Force {
        drive,
        name: name.to_owned(),
        raw: dice.percent(70).then_some(raw),
    }
}

pub(super) fn change(what: &mut FrameActKind, dice: &mut Dice) {
    let FrameActKind::Send(frame) = what else {
        return;
    };
    if frame.dlc() > 0 && !frame.is_remote() {
        let mut bytes = frame.data().to_vec();
        let at = dice.below(bytes.len());
        bytes[at] = dice.byte();
        if let Ok(changed) = Frame::new(frame.id(), &bytes) {
            *frame = changed;
        }
    }
}
