//! Acts that only together show what a slave does: chance alone seldom puts them in a row.

use super::act::{Count, TelegramAct, TelegramActKind};
use super::generate::{TelegramSpice, by_srd};
use super::tasks::{change_and_read, read};
use super::wire::Wire;
use harness_bench::explore::Dice;
use harness_proto::nordac::Pkw;
use harness_proto::nordac::words::stw;
use harness_proto::profibus::dp::{GlobalControl, Service, SetPrm};

/// An exchange in which nothing is asked of the parameter channel.
fn words(wire: Wire, control: u16, setpoint: u16) -> TelegramAct {
    wire.exchange([control, setpoint, 0, 0, 0, 0], Pkw::default())
}

/// The same, this often, and with this number of milliseconds after each.
fn often(mut act: TelegramAct, times: u8, millis: u64) -> TelegramAct {
    (act.times, act.wait_us) = (times, millis * 1_000);
    act
}

/// A start of a master: parameters and configuration.
pub(super) fn start(wire: Wire) -> Vec<TelegramAct> {
    vec![wire.parameters(0, [0, 0], 0, 0), wire.configuration()]
}

/// Operation is enabled.
pub(super) fn on(wire: Wire, setpoint: u16) -> Vec<TelegramAct> {
    vec![
        words(wire, stw::READY, setpoint),
        often(words(wire, stw::START, setpoint), 2, 20),
    ]
}

/// The motor runs, and a control word stops it or changes its course.
fn turns(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    const COURSES: [u16; 14] = [
        0x047E, 0x047D, 0x047B, 0x0477, 0x0476, 0x046F, 0x045F, 0x043F, 0x147F, 0x1C7F, 0x447F,
        0x847F, 0x007F, 0x0000,
    ];
    let setpoint = *dice
        .pick(&[0x4000, 0x2000, 0xE000, 0xC000, 0x7FFF, 0x0012])
        .unwrap_or(&0x2000);
    let course = *dice.pick(&COURSES).unwrap_or(&0x047E);
    let mut acts = on(wire, setpoint);
    acts.push(often(words(wire, stw::START, setpoint), 1, 300));
    acts.push(often(words(wire, course, setpoint), 3, 15));
    acts.push(often(words(wire, stw::READY, 0), 2, 0));
    acts
}

/// The watchdog is set, and the master is silent.
fn watchdog(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let factors = [[2, 1], [1, 2], [3, 1], [1, 3], [2, 2]];
    let factors = *dice.pick(&factors).unwrap_or(&[2, 1]);
    let silence = 5 * (1 + dice.below(10)) as u64;
    let mut acts = vec![
        wire.parameters(SetPrm::WATCHDOG, factors, 0, 0),
        wire.configuration(),
    ];
    acts.extend(on(wire, 0x2000));
    acts.push(often(words(wire, stw::START, 0x2000), 1, silence));
    acts.push(wire.reads(Service::SlaveDiag));
    acts.push(words(wire, stw::START, 0x2000));
    acts
}

/// Sync and Freeze, asked for or not, for a group.
fn groups(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    const COMMANDS: [u8; 8] = [
        GlobalControl::SYNC,
        GlobalControl::FREEZE,
        GlobalControl::SYNC | GlobalControl::UNSYNC,
        GlobalControl::FREEZE | GlobalControl::UNFREEZE,
        GlobalControl::UNSYNC,
        GlobalControl::UNFREEZE,
        GlobalControl::CLEAR_DATA,
        GlobalControl::SYNC | GlobalControl::FREEZE,
    ];
    let asked = *dice
        .pick(&[
            SetPrm::SYNC | SetPrm::FREEZE,
            SetPrm::SYNC,
            SetPrm::FREEZE,
            0,
        ])
        .unwrap_or(&0);
    let group = 1 << dice.below(3);
    let to = *dice.pick(&[0, group, 2]).unwrap_or(&0);
    let da = if dice.percent(50) { wire.slave } else { 127 };
    let srd = dice.percent(15);
    let mut command = || *dice.pick(&COMMANDS).unwrap_or(&COMMANDS[0]);
    let mut acts = vec![
        wire.parameters(asked, [0, 0], 0, group),
        wire.configuration(),
    ];
    acts.extend(on(wire, 0x2000));
    let mut first = wire.control(da, command(), to);
    if srd {
        by_srd(&mut first, wire.slave);
    }
    acts.push(first);
    acts.push(wire.reads(Service::SlaveDiag));
    acts.push(often(words(wire, stw::START, 0xE000), 3, 10));
    acts.push(wire.reads(Service::RdInp));
    acts.push(wire.reads(Service::RdOutp));
    acts.push(wire.control(da, command(), to));
    acts.push(often(words(wire, stw::READY, 0x1000), 2, 10));
    acts
}

/// Inverter and module lose each other, or a fault comes, and is acknowledged.
fn world(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let slave = wire.slave;
    let happens = |what, millis: u64| TelegramAct::new(what, 1_000 * millis);
    let mut acts = on(wire, 0x2000);
    if dice.percent(50) {
        let time = *dice.pick(&[10, 150]).unwrap_or(&10);
        acts.push(happens(
            TelegramActKind::Link {
                slave,
                found: false,
            },
            time,
        ));
        acts.push(often(words(wire, stw::START, 0x2000), 2, 0));
        acts.push(wire.reads(Service::SlaveDiag));
        acts.push(often(words(wire, stw::START, 0x2000), 2, 0));
        acts.push(happens(TelegramActKind::Link { slave, found: true }, 0));
        acts.push(often(words(wire, stw::START, 0x2000), 1, 0));
        acts.push(wire.reads(Service::SlaveDiag));
    } else {
        let number = 1 + dice.below(25) as u8;
        let fault = |on| TelegramActKind::Fault { slave, number, on };
        acts.push(happens(fault(true), 0));
        acts.push(often(words(wire, stw::READY, 0), 2, 0));
        acts.push(happens(fault(false), 0));
    }
    acts.push(words(wire, stw::READY | stw::ACKNOWLEDGE, 0));
    acts.push(often(words(wire, stw::READY, 0), 2, 0));
    acts.extend(read(
        wire,
        Pkw::of(
            6,
            *dice.pick(&[1801, 947, 1800, 1806]).unwrap_or(&1801),
            dice.word() & 0x0F00,
            0,
        ),
    ));
    acts
}

/// The bus time-out (1625) with a master that is silent, or sends words that are not valid.
fn time_out(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let mut acts = change_and_read(wire, Pkw::of(2, 1625, 0, 1));
    acts.extend(on(wire, 0x2000));
    let control = if dice.percent(50) { stw::START } else { 0 };
    let silence = *dice.pick(&[40, 99, 100, 101, 150]).unwrap_or(&150);
    acts.push(often(words(wire, control, 0x2000), 2, silence));
    acts.push(often(words(wire, stw::START, 0x2000), 2, 0));
    acts
}

/// Another master than the one that has started the slave.
fn masters(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let other = Wire {
        master: *dice.pick(&[3, 1, 126]).unwrap_or(&3),
        ..wire
    };
    let mut acts = start(wire);
    acts.push(words(wire, stw::READY, 0x1000));
    let services = [
        Service::SlaveDiag,
        Service::GetCfg,
        Service::RdInp,
        Service::RdOutp,
    ];
    acts.push(match dice.below(6) {
        0 => words(other, stw::START, 0x2000),
        1 => other.parameters(0, [0, 0], 0, 0),
        2 => other.configuration(),
        3 => other.control(wire.slave, GlobalControl::CLEAR_DATA, 0),
        _ => other.reads(*dice.pick(&services).unwrap_or(&Service::SlaveDiag)),
    });
    // A count of its own that is the same as that of the other one.
    if dice.percent(50) {
        let mut last = wire.reads(Service::SlaveDiag);
        let mut again = other.reads(Service::SlaveDiag);
        for act in [&mut last, &mut again] {
            if let TelegramActKind::Ask(request) = &mut act.what {
                request.count = Count::First;
            }
        }
        acts.extend([last, again, other.reads(Service::SlaveDiag)]);
    }
    acts.push(wire.reads(Service::SlaveDiag));
    acts.push(often(words(wire, stw::READY, 0x1000), 2, 0));
    acts
}

/// The acts of an idiom; none where the spice has no idiom.
pub(super) fn idiom(spice: TelegramSpice, wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    match spice {
        TelegramSpice::Motion => turns(wire, dice),
        TelegramSpice::Setup => watchdog(wire, dice),
        TelegramSpice::Control => groups(wire, dice),
        TelegramSpice::World => world(wire, dice),
        TelegramSpice::Bus => time_out(wire, dice),
        TelegramSpice::Masters => masters(wire, dice),
        TelegramSpice::Power => {
            let slave = wire.slave;
            let mut acts = vec![TelegramAct::new(TelegramActKind::Restart { slave }, 0)];
            acts.push(wire.reads(Service::SlaveDiag));
            acts.push(wire.reads(Service::SlaveDiag));
            acts.extend(start(wire));
            acts.push(often(words(wire, stw::READY, 0), 2, 0));
            acts
        }
        _ => Vec::new(),
    }
}
