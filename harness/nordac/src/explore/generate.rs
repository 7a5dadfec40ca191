//! Makes and changes cases: what a master does with a slave, and telegrams that a slave must not take.

use super::act::{Count, Harm, TelegramAct, TelegramActKind};
use super::idiom::{on, start};
use super::tasks::{change_and_read, changing, read, reading};
use super::wire::{OWN, Wire};
use harness_bench::explore::{Dice, Spiced};
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Pkw, PpoType};
use harness_proto::profibus::dp::{Service, SetPrm};
use harness_proto::profibus::fdl::{FcFunction, check_sum};

/// Something that a conversation of telegrams can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum TelegramSpice {
    /// Control words and setpoints that lead through the state machine (3.2, 3.3).
    Motion,
    /// Any control word and setpoint.
    Words,
    /// Tasks that read (3.4).
    Tasks,
    /// Tasks that change parameters.
    Changes,
    /// Parameters of the bus, factory settings, the bus time-out (2.5.1).
    Bus,
    /// Services that read (EN 2).
    Services,
    /// Set_Prm and Chk_Cfg, right and wrong, and the watchdog.
    Setup,
    Control,
    /// Other masters and other stations.
    Masters,
    /// Other functions, service access points and counts (EN 1).
    Functions,
    /// Damage on the line, and octets that are no telegram.
    Damage,
    /// Data of other lengths.
    Lengths,
    /// Faults, and the link between inverter and module (2.6).
    World,
    /// Power off and on.
    Power,
}

impl TelegramSpice {
    pub(crate) const NAMES: [(&'static str, Self); 14] = [
        ("motion", Self::Motion),
        ("words", Self::Words),
        ("tasks", Self::Tasks),
        ("changes", Self::Changes),
        ("bus", Self::Bus),
        ("services", Self::Services),
        ("setup", Self::Setup),
        ("control", Self::Control),
        ("masters", Self::Masters),
        ("functions", Self::Functions),
        ("damage", Self::Damage),
        ("lengths", Self::Lengths),
        ("world", Self::World),
        ("power", Self::Power),
    ];
}

impl Spiced for TelegramSpice {
    const ALL: &'static [(&'static str, Self)] = &Self::NAMES;
}

/// Control words of which each does something else in some state.
const WORDS: [u16; 20] = [
    0x047E, 0x047F, 0x047F, 0x047F, 0x047D, 0x047B, 0x0477, 0x0476, 0x04FE, 0x04FF, 0x046F, 0x045F,
    0x043F, 0x447F, 0x847F, 0x0C7F, 0x147F, 0x1C7F, 0x007F, 0x0000,
];

/// Setpoints at which something changes.
const SETPOINTS: [u16; 10] = [
    0, 0x2000, 0x4000, 0x4001, 0xC000, 0xE000, 0x7FFF, 0x8000, 0x0001, 0x1234,
];

const READING: [Service; 4] = [
    Service::SlaveDiag,
    Service::GetCfg,
    Service::RdInp,
    Service::RdOutp,
];

/// How a case begins: mostly with a start; and how many parts follow.
pub(super) fn begin(station: (u8, PpoType), dice: &mut Dice) -> (Vec<TelegramAct>, usize) {
    let wire = Wire::from(station);
    let acts = match dice.below(10) {
        0 => Vec::new(),
        1..=5 => start(wire),
        _ => [start(wire), on(wire, setpoint(dice))].concat(),
    };
    (acts, 2 + dice.below(10))
}

/// Requests for what shows the slave's state.
pub(super) fn close(wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let control = *dice.pick(&[stw::READY, stw::START]).unwrap_or(&stw::READY);
    let mut last = wire.exchange([control, 0x1000, 0, 0, 0, 0], Pkw::default());
    last.times = 2;
    vec![last, wire.reads(Service::SlaveDiag)]
}

/// Acts of a spice, mostly with a time after them.
pub(super) fn part(spice: TelegramSpice, wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    let mut acts = single(spice, wire, dice);
    if dice.percent(60)
        && let Some(last) = acts.last_mut()
    {
        last.wait_us = wait(dice);
    }
    acts
}

fn single(spice: TelegramSpice, wire: Wire, dice: &mut Dice) -> Vec<TelegramAct> {
    match spice {
        TelegramSpice::Motion => vec![exchange(wire, *dice.pick(&WORDS).unwrap_or(&0x047E), dice)],
        TelegramSpice::Words => {
            let word = if dice.percent(70) {
                dice.word() | stw::VALID
            } else {
                dice.word()
            };
            vec![exchange(wire, word, dice)]
        }
        TelegramSpice::Tasks => read(wire, reading(dice)).to_vec(),
        TelegramSpice::Changes => change_and_read(wire, changing(false, dice)),
        TelegramSpice::Bus => change_and_read(wire, changing(true, dice)),
        TelegramSpice::Services => vec![service(wire, dice)],
        TelegramSpice::Setup => vec![set_up(wire, dice)],
        TelegramSpice::Control => {
            let da = if dice.percent(50) { wire.slave } else { 127 };
            let group = *dice.pick(&[0, 0, 1, 2, 0xFF]).unwrap_or(&0);
            let bits = [0x02, 0x04, 0x08, 0x10, 0x20, 0x30, 0x0C, 0x2A];
            let mut act = wire.control(da, *dice.pick(&bits).unwrap_or(&2), group);
            if dice.percent(20) {
                by_srd(&mut act, wire.slave);
            }
            vec![act]
        }
        TelegramSpice::Masters => vec![other_station(wire, dice)],
        TelegramSpice::Functions => vec![other_function(wire, dice)],
        TelegramSpice::Damage => vec![damaged(wire, dice)],
        TelegramSpice::Lengths => vec![of_length(wire, dice)],
        TelegramSpice::World => {
            let slave = wire.slave;
            let what = match dice.below(4) {
                0 => TelegramActKind::Link {
                    slave,
                    found: false,
                },
                1 => TelegramActKind::Link { slave, found: true },
                choice => TelegramActKind::Fault {
                    slave,
                    number: 1 + dice.below(25) as u8,
                    on: choice == 2,
                },
            };
            vec![TelegramAct::new(what, 0)]
        }
        TelegramSpice::Power => {
            let slave = wire.slave;
            vec![TelegramAct::new(TelegramActKind::Restart { slave }, 0)]
        }
    }
}

/// Mostly nothing or little; sometimes as long as a ramp.
pub(super) fn wait(dice: &mut Dice) -> u64 {
    let micros = match dice.below(20) {
        0..=9 => 0,
        10..=13 => 1 + dice.below(3_000),
        14..=16 => 1_000 * dice.below(30),
        17..=18 => 1_000 * dice.below(200),
        _ => 1_000 * dice.below(2_000),
    };
    micros as u64
}

fn setpoint(dice: &mut Dice) -> u16 {
    match dice.percent(80) {
        true => *dice.pick(&SETPOINTS).unwrap_or(&0x2000),
        false => dice.word(),
    }
}

/// An exchange, several times in a row now and then.
fn exchange(wire: Wire, control: u16, dice: &mut Dice) -> TelegramAct {
    let second = if dice.percent(30) { setpoint(dice) } else { 0 };
    let position = if dice.percent(10) { dice.word() } else { 0 };
    let pkw = if dice.percent(15) {
        reading(dice)
    } else {
        Pkw::default()
    };
    let mut act = wire.exchange([control, setpoint(dice), position, second, 0, 0], pkw);
    act.times = *dice.pick(&[1, 1, 2, 2, 3, 10]).unwrap_or(&1);
    act
}

fn service(wire: Wire, dice: &mut Dice) -> TelegramAct {
    if dice.percent(20) {
        let mut status = wire.request(FcFunction::FdlStatus, Service::DataExchange, &[]);
        status.count = Count::Without;
        return TelegramAct::new(TelegramActKind::Ask(status), 0);
    }
    wire.reads(*dice.pick(&READING).unwrap_or(&Service::SlaveDiag))
}

fn set_up(wire: Wire, dice: &mut Dice) -> TelegramAct {
    match dice.below(8) {
        0 | 1 => wire.configuration(),
        2 => {
            let others: [&[u8]; 6] = [&[0xF3, 0xF1], &[0xF3, 0xF5], &[0xF1], &[0xF5], &[], &[0xF3]];
            let mut cfg = dice.pick(&others).map_or(Vec::new(), |cfg| cfg.to_vec());
            if dice.percent(40) {
                cfg = wire.ppo.cfg().to_vec();
                cfg.push(dice.byte());
            }
            wire.raw(Service::ChkCfg, &cfg)
        }
        3 => {
            let mut data = vec![0x80, 0, 0, 11, 0x75, 0x31, 0];
            match dice.below(6) {
                0 => data[4 + dice.below(2)] = dice.byte(),
                1 => data.push(dice.byte()),
                2 => data.truncate(*dice.pick(&[6, 6, 5, 1, 0]).unwrap_or(&6)),
                3 => data[0] = *dice.pick(&[0x40, 0xC0, 0x00, 0x88]).unwrap_or(&0x40),
                4 => (data[0], data[1 + dice.below(2)]) = (0x88, 1),
                _ => data[3] = dice.byte(),
            }
            wire.raw(Service::SetPrm, &data)
        }
        _ => {
            let bits = [0, 0, SetPrm::SYNC | SetPrm::FREEZE, SetPrm::WATCHDOG];
            let tsdr = *dice.pick(&[0, 0, 11, 5, 60, 255]).unwrap_or(&0);
            let factor = [1 + dice.below(3) as u8, 1 + dice.below(5) as u8];
            let bits = *dice.pick(&bits).unwrap_or(&0);
            wire.parameters(bits, factor, tsdr, dice.below(4) as u8)
        }
    }
}

/// Asks for a reply to Global_Control, which has none.
pub(super) const fn by_srd(act: &mut TelegramAct, slave: u8) {
    if let TelegramActKind::Ask(request) = &mut act.what {
        (request.da, request.function, request.count) =
            (slave, FcFunction::SrdHigh.code(), Count::Next);
    }
}

/// A request of another master, or to another station.
fn other_station(wire: Wire, dice: &mut Dice) -> TelegramAct {
    let mut act = match dice.below(4) {
        0 => exchange(wire, stw::READY, dice),
        1 => set_up(wire, dice),
        _ => service(wire, dice),
    };
    if let TelegramActKind::Ask(request) = &mut act.what {
        match dice.below(3) {
            0 => {
                request.da = *dice
                    .pick(&[wire.slave + 1, 127, 0, wire.slave ^ 0x40])
                    .unwrap_or(&127)
            }
            _ => request.sa = *dice.pick(&[3, 1, 0, 126]).unwrap_or(&3),
        }
    }
    act
}

/// A request with another function, other service access points, or another count.
fn other_function(wire: Wire, dice: &mut Dice) -> TelegramAct {
    let mut act = match dice.below(3) {
        0 => exchange(wire, stw::READY, dice),
        _ => service(wire, dice),
    };
    act.times = 1;
    if let TelegramActKind::Ask(request) = &mut act.what {
        match dice.below(4) {
            0 => request.function = dice.byte() & 0x0F,
            1 => request.saps = Some((*dice.pick(&[55, 58, 54, 63, 0, 59]).unwrap_or(&55), 62)),
            _ => {
                let counts = [Count::Again, Count::Again, Count::First, Count::Without];
                request.count = *dice.pick(&counts).unwrap_or(&Count::Again);
            }
        }
    }
    act
}

fn harm(length: usize, dice: &mut Dice) -> Harm {
    let place = dice.below(length.max(1)) as u8;
    match dice.below(8) {
        0 => Harm::Parity(place),
        1 => Harm::Stop(place),
        2 => Harm::Gap(
            place.max(1),
            *dice.pick(&[3, 8, 20, 50, 80, 200]).unwrap_or(&20),
        ),
        3 => Harm::Short(1 + dice.below(2) as u8),
        4 => Harm::Long(dice.byte()),
        // The last octets are the sum and the end; the first ones the start and the lengths.
        5 => Harm::Replace(
            (length.saturating_sub(1 + dice.below(2))) as u8,
            1 << dice.below(8),
        ),
        6 => Harm::Replace(dice.below(4) as u8, 1 << dice.below(8)),
        _ => Harm::Replace(place, dice.byte()),
    }
}

/// A damaged request, or octets that are none.
fn damaged(wire: Wire, dice: &mut Dice) -> TelegramAct {
    let mut act = match dice.below(3) {
        0 => exchange(wire, *dice.pick(&WORDS).unwrap_or(&0x047E), dice),
        1 => wire.configuration(),
        _ => service(wire, dice),
    };
    act.times = 1;
    if dice.percent(70) {
        if let TelegramActKind::Ask(request) = &mut act.what {
            request.harm = Some(harm(request.data.len() + 9, dice));
        }
        return act;
    }
    TelegramAct::new(octets(wire.slave, dice), 0)
}

/// Octets that a right request is not: a sum that is right where something else is wrong, two telegrams in a row, or any octets.
fn octets(slave: u8, dice: &mut Dice) -> TelegramActKind {
    let variable = |body: &[u8]| {
        let length = body.len() as u8;
        let mut telegram = vec![0x68, length, length, 0x68];
        telegram.extend(body);
        telegram.extend([check_sum(body), 0x16]);
        telegram
    };
    let plain = |fc: u8| vec![0x10, slave, OWN, fc, check_sum(&[slave, OWN, fc]), 0x16];
    let mut harm = None;
    let octets = match dice.below(8) {
        // Bits 7 and 6 of a service access point.
        0 => variable(&[
            slave | 0x80,
            OWN | 0x80,
            0x6D,
            0x3C | 0x40 << dice.below(2),
            0x3E,
        ]),
        // Bit 7 of FC; a reply.
        1 => plain(0xC9),
        2 => plain(*dice.pick(&[0x00, 0x03, 0x08]).unwrap_or(&0)),
        // Too little idle time in front of the second one.
        3 | 4 => {
            let first = *dice.pick(&[9, 15, 30, 60]).unwrap_or(&15);
            harm = Some(Harm::Gap(6, first));
            let second = if dice.percent(50) { slave } else { slave ^ 1 };
            [
                vec![
                    0x10,
                    second,
                    OWN,
                    0x49,
                    check_sum(&[second, OWN, 0x49]),
                    0x16,
                ],
                plain(0x49),
            ]
            .concat()
        }
        5 => vec![0xDC, slave, OWN],
        6 => vec![0xE5],
        _ => (0..=dice.below(20)).map(|_| dice.byte()).collect(),
    };
    TelegramActKind::Octets { octets, harm }
}

/// A request with data of another length.
fn of_length(wire: Wire, dice: &mut Dice) -> TelegramAct {
    let mut act = match dice.below(3) {
        0 => wire.reads(*dice.pick(&READING).unwrap_or(&Service::SlaveDiag)),
        _ => exchange(wire, stw::READY, dice),
    };
    act.times = 1;
    if let TelegramActKind::Ask(request) = &mut act.what {
        let length = *dice
            .pick(&[0, 1, 2, 4, 8, 11, 12, 13, 20, 28])
            .unwrap_or(&4);
        request.data.resize(length, 0);
    }
    act
}

/// Another data octet.
pub(super) fn change(what: &mut TelegramActKind, dice: &mut Dice) {
    match what {
        TelegramActKind::Ask(request) if !request.data.is_empty() => {
            let at = dice.below(request.data.len());
            request.data[at] = dice.byte();
        }
        TelegramActKind::Ask(request) => request.harm = Some(harm(9, dice)),
        TelegramActKind::Octets { octets, .. } => {
            let at = dice.below(octets.len());
            if let Some(octet) = octets.get_mut(at) {
                *octet = dice.byte();
            }
        }
        TelegramActKind::Fault { number, .. } => *number = 1 + dice.below(25) as u8,
        TelegramActKind::Link { .. } | TelegramActKind::Restart { .. } => {}
    }
}
