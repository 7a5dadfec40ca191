//! Generates cases from random numbers: telegrams that are mostly correct and sometimes not, and reads of their effects.

use super::case::{Act, ActKind, Case, Damage, Harm, MOST_NET, OtherRing, Talk, To};
use super::idiom::Idiom;
use super::order::{CommandSent, RawCommand, Spoil};
use crate::explore::{Spice, Swarm};
use harness_bench::explore::Dice;
use harness_proto::nd21::bits::status;
use harness_proto::nd21::cells::{CellAccess, RAM};
use harness_proto::nd21::ram;
use harness_proto::novobus::guard::{Limits, Need};

/// What cases may have on a rig.
#[derive(Clone, Debug)]
pub(crate) struct CaseScope {
    pub first: RingScope,
    /// Its second ring, where it has two: a case is with one of them.
    pub second: Option<RingScope>,
    /// What the rig can be asked.
    pub spices: Vec<Spice>,
    /// What may be sent.
    pub limits: Limits,
    /// Whether no case writes to the EEPROM, even if writes are permitted: such writes are permanent (ND21 14.10.5).
    pub spare_eeprom: bool,
}

impl CaseScope {
    /// A ring of it, counted from 0.
    #[must_use]
    pub(crate) fn ring(&self, ring: usize) -> &RingScope {
        let second = self.second.as_ref().filter(|_| ring > 0);
        second.unwrap_or(&self.first)
    }
}

/// A ring that cases may be with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RingScope {
    pub drives: u8,
    /// The other ring of the bench, where there is one.
    pub beside: Option<OtherRing>,
    /// The links on which faults can be put.
    pub links: Vec<u8>,
}

impl RingScope {
    /// The rings of a bench of these sizes, with the links that `reaches` says of a ring and a link, both counted from 0. What is
    /// damaged behind the last drive no drive hears: that link is left out.
    #[must_use]
    pub(crate) fn both(
        first: u8,
        second: Option<u8>,
        reaches: impl Fn(usize, u8) -> bool,
    ) -> (Self, Option<Self>) {
        let ring = |ring, drives, beside| Self {
            drives,
            beside,
            links: (0..drives).filter(|link| reaches(ring, *link)).collect(),
        };
        (
            ring(0, first, second.map(OtherRing::Second)),
            second.map(|second| ring(1, second, Some(OtherRing::First(first)))),
        )
    }

    /// A case with this ring.
    #[must_use]
    pub(crate) const fn case(&self, acts: Vec<Act>) -> Case {
        Case {
            drives: self.drives,
            beside: self.beside,
            acts,
        }
    }
}

/// Maximum number of acts of a new case in front of its end.
const NEW_ACTS: usize = 6;

/// Cells that the bus itself works with, and some that are nothing but memory: (14.2.1).
const CELLS: [u16; 10] = [
    0xFE13,
    0xFE14,
    0xFF08,
    0xFF18,
    ram::DATA_IN,
    ram::DATA_OUT,
    ram::FLAGS2,
    ram::BUS_ADDR,
    0xFD80,
    0xFFB7,
];

/// The first and last addresses of the ranges of 10.1 and 10.2, and their neighbours.
const EDGES: [u16; 14] = [
    0x2EFF, 0x2F00, 0x2FBF, 0x2FC0, 0x2FDE, 0x2FDF, 0xFD7F, 0xFD80, 0xFF7C, 0xFF7E, 0xFF7F, 0xFF80,
    0xFFFE, 0xFFFF,
];

/// Bytes that mean something somewhere (9.2, 9.8, 14.4.3), and two that do not.
const BYTES: [u8; 12] = [
    0x00, 0x01, 0xFF, 0x80, 0x81, 0x04, 0x44, 0x18, 0x7F, 0x08, 0x5A, 0xC0,
];

/// Makes acts of a swarm's kind.
#[derive(Debug)]
pub(crate) struct Generator<'s> {
    scope: &'s CaseScope,
    ring: &'s RingScope,
    swarm: &'s Swarm,
    /// The cells of this case: written cells are read again.
    cells: Vec<u16>,
}

impl<'s> Generator<'s> {
    /// A generator for one of the scope's rings, with a few cells of its own.
    pub(crate) fn new(
        scope: &'s CaseScope,
        ring: &'s RingScope,
        swarm: &'s Swarm,
        dice: &mut Dice,
    ) -> Self {
        let mut cells = Vec::new();
        for _ in 0..1 + dice.below(3) {
            cells.push(any_cell(dice));
        }
        Self {
            scope,
            ring,
            swarm,
            cells,
        }
    }

    pub(crate) fn case(&self, dice: &mut Dice) -> Case {
        let mut acts = Vec::new();
        for _ in 0..1 + dice.below(NEW_ACTS) {
            self.add(&mut acts, dice);
        }
        self.damage(&mut acts, dice);
        self.end(&mut acts, dice);
        let mut case = self.ring.case(acts);
        self.keep_in_step(&mut case);
        // Growing beyond the bounds loses the end.
        while !case.is_bounded() && case.acts.pop().is_some() {}
        case
    }

    /// Adds an act, or some that belong together.
    pub(crate) fn add(&self, acts: &mut Vec<Act>, dice: &mut Dice) {
        let possible = Idiom::ALL
            .iter()
            .filter(|(_, spice)| self.swarm.has(*spice));
        let possible: Vec<Idiom> = possible.map(|(idiom, _)| *idiom).collect();
        match dice.pick(&possible) {
            Some(idiom) if dice.percent(40) => idiom.play(acts, self, dice),
            _ => acts.push(self.act(dice)),
        }
    }

    /// A drive of the ring.
    pub(crate) fn drive(&self, dice: &mut Dice) -> u8 {
        dice.below(usize::from(self.ring.drives)) as u8
    }

    pub(crate) fn drives(&self) -> std::ops::Range<u8> {
        0..self.ring.drives
    }

    /// The link in front of a drive, where faults can be put on it.
    pub(crate) fn link_before(&self, drive: u8) -> Option<u8> {
        let link = self.ring.drives.checked_sub(drive + 1)?;
        self.ring.links.contains(&link).then_some(link)
    }

    /// Whether the rig allows a command.
    pub(crate) fn allows(&self, command: RawCommand) -> bool {
        let act = command.act();
        let need = act.need();
        let eeprom = need.contains(Need::EEPROM) && !need.contains(Need::EVERYTHING);
        act.passes(&self.scope.limits) && !(eeprom && self.scope.spare_eeprom)
    }

    /// A command that changes something, where the rig allows one.
    pub(crate) fn change(&self, dice: &mut Dice) -> RawCommand {
        const CHANGES: [Spice; 5] = [
            Spice::WriteByte,
            Spice::WriteWord,
            Spice::And,
            Spice::Or,
            Spice::WriteIo,
        ];
        let changes = self.swarm.of(&CHANGES);
        for _ in 0..8 {
            if let Some(spice) = dice.pick(&changes) {
                let command = self.of_kind(*spice, dice);
                if self.allows(command) {
                    return command;
                }
            }
        }
        // Stop and block (ND21 14.10) are always allowed.
        RawCommand::WriteByte {
            cell: ram::STATUS,
            data: status::BLOCK | status::STOP,
        }
    }

    /// Any act.
    pub(crate) fn act(&self, dice: &mut Dice) -> Act {
        let has = |spice| self.swarm.has(spice);
        let what = match dice.below(100) {
            0..6 if has(Spice::Idle) => ActKind::Synco(1 + dice.below(4) as u8),
            6..10 if has(Spice::Idle) => ActKind::Pause(1 + dice.below(3) as u8),
            10..15 if has(Spice::Noise) => self.noise(dice),
            15..21 if has(Spice::Zeros) => ActKind::Zeros(1 + dice.below(20) as u8),
            21..23 if has(Spice::Zeros) => ActKind::Sequence,
            23..27 if has(Spice::Zeros) || has(Spice::Spoil) => ActKind::Recover,
            27..31 if has(Spice::Silence) => ActKind::Wait(1 + dice.below(45) as u16),
            31..34 if has(Spice::Silence) => ActKind::Talk(Talk::one(
                self.to(dice),
                // Time-outs are monitored from now on (14.4.3).
                RawCommand::Or {
                    low: ram::FLAGS2 as u8,
                    data: 0x04,
                },
            )),
            34..36 if has(Spice::Power) => ActKind::Power {
                drive: dice.below(usize::from(self.ring.drives)) as u8,
                on: dice.percent(60),
            },
            _ => ActKind::Talk(self.talk(dice)),
        };
        Act::sound(what)
    }

    fn noise(&self, dice: &mut Dice) -> ActKind {
        let length = 1 + dice.below(6);
        let byte = |dice: &mut Dice| match dice.percent(60) {
            true => BYTES[dice.below(BYTES.len())],
            false => dice.byte(),
        };
        ActKind::Bytes((0..length).map(|_| byte(dice)).collect())
    }

    /// Telegrams to a drive.
    pub(crate) fn talk(&self, dice: &mut Dice) -> Talk {
        let with_data = self.swarm.has(Spice::ProcessData) && dice.percent(35);
        let mut orders = Vec::new();
        while orders.len() < 3 && (orders.is_empty() && !with_data || dice.percent(30)) {
            orders.push(self.order(dice));
        }
        let cut = self.swarm.has(Spice::Cut) && dice.percent(35);
        Talk {
            to: self.to(dice),
            process_data: with_data.then(|| match dice.percent(50) {
                true => dice.word(),
                false => u16::from_be_bytes([dice.byte() & 1, BYTES[dice.below(BYTES.len())]]),
            }),
            orders,
            room: match cut {
                true => 2 + dice.below(5) as u8,
                false => MOST_NET,
            },
            between: Vec::new(),
        }
    }

    /// Chooses the addressee of a telegram.
    pub(crate) fn to(&self, dice: &mut Dice) -> To {
        let drive = dice.below(usize::from(self.ring.drives)) as u8;
        match dice.below(100) {
            0..20 if self.swarm.has(Spice::Same) => To::Same,
            20..40 if self.swarm.has(Spice::Next) => To::Next,
            40..45 if self.swarm.has(Spice::Nobody) => To::Nobody(self.nobody(dice)),
            _ => To::Drive(drive),
        }
    }

    /// An address byte, often one that is counted up through 80 or beyond 00 (ND21 9.3).
    fn nobody(&self, dice: &mut Dice) -> u8 {
        let on_the_way = dice.below(usize::from(self.ring.drives)) as u8;
        match dice.below(4) {
            0 => 0x7F - on_the_way.min(0x7F),
            1 => on_the_way,
            _ => dice.byte(),
        }
    }

    /// A command that the rig allows, now and then spoiled.
    pub(crate) fn order(&self, dice: &mut Dice) -> CommandSent {
        let command = self.command(dice);
        let spoiled = self.swarm.has(Spice::Spoil) && dice.percent(15);
        CommandSent {
            command,
            spoil: spoiled.then(|| {
                let length = command.head().len();
                Spoil {
                    // The checking byte as often as all others together.
                    at: match dice.percent(50) {
                        true => length as u8,
                        false => dice.below(length) as u8,
                    },
                    byte: match dice.percent(50) {
                        true => BYTES[dice.below(BYTES.len())],
                        false => dice.byte(),
                    },
                }
            }),
        }
    }

    fn command(&self, dice: &mut Dice) -> RawCommand {
        let commands = self.swarm.of(&Spice::COMMANDS);
        for _ in 0..8 {
            let command = match dice.pick(&commands) {
                Some(spice) => self.of_kind(*spice, dice),
                None => break,
            };
            if self.allows(command) {
                return command;
            }
        }
        // Reading is always allowed.
        RawCommand::ReadByte {
            cell: self.cell(dice),
        }
    }

    fn of_kind(&self, spice: Spice, dice: &mut Dice) -> RawCommand {
        let cell = self.cell(dice);
        let low = match dice.percent(15) && self.swarm.has(Spice::Forbidden) {
            true => cell as u8 | 0x80,
            false => cell as u8 & 0x7F,
        };
        let data = match dice.percent(60) {
            true => BYTES[dice.below(BYTES.len())],
            false => dice.byte(),
        };
        match spice {
            Spice::ReadWord => RawCommand::ReadWord { cell },
            Spice::ReadLong => RawCommand::ReadLong { cell },
            Spice::WriteByte => RawCommand::WriteByte { cell, data },
            Spice::WriteWord => RawCommand::WriteWord {
                cell,
                data: u16::from_be_bytes([dice.byte(), data]),
            },
            Spice::And => RawCommand::And { low, data },
            Spice::Or => RawCommand::Or { low, data },
            Spice::WriteIo => RawCommand::WriteIo {
                code: match dice.percent(15) && self.swarm.has(Spice::Forbidden) {
                    true => data,
                    false => data & 3,
                },
            },
            Spice::Reset if dice.percent(25) => RawCommand::Reset,
            _ => RawCommand::ReadByte { cell },
        }
    }

    pub(crate) fn cell(&self, dice: &mut Dice) -> u16 {
        match dice.below(100) {
            0..12 if self.swarm.has(Spice::Forbidden) => EDGES[dice.below(EDGES.len())],
            12..16 if self.swarm.has(Spice::Forbidden) => dice.word(),
            16..30 => any_cell(dice),
            _ => dice.pick(&self.cells).copied().unwrap_or(CELLS[0]),
        }
    }

    /// Puts faults on bytes, in a third of the cases.
    pub(crate) fn damage(&self, acts: &mut [Act], dice: &mut Dice) {
        let faults = self.swarm.of(&Spice::FAULTS);
        if faults.is_empty() || !dice.percent(35) {
            return;
        }
        for _ in 0..1 + dice.below(2) {
            let Some(damage) = self.one_damage(&faults, dice) else {
                return;
            };
            let at = dice.below(acts.len());
            if let Some(act) = acts.get_mut(at) {
                let length = act.length(self.ring.drives);
                let damage = Damage {
                    at: dice.below(length) as u16,
                    ..damage
                };
                // No rule says what two faults do to the same byte.
                let free = |other: &Damage| (other.link, other.at) != (damage.link, damage.at);
                if length > 0 && act.damages.iter().all(free) {
                    act.damages.push(damage);
                }
            }
        }
    }

    fn one_damage(&self, faults: &[Spice], dice: &mut Dice) -> Option<Damage> {
        let link = *dice.pick(&self.ring.links)?;
        let flip = |data, parity, stop| Harm::Flip { data, parity, stop };
        let harm = match (dice.pick(faults)?, dice.below(4)) {
            (Spice::Flip, 0) => flip(0, true, false),
            (Spice::Flip, 1) => flip(dice.byte(), dice.percent(50), false),
            (Spice::Flip, _) => flip(1 << dice.below(8), false, false),
            (Spice::Framing, 0 | 1) => flip(0, false, true),
            (Spice::Framing, 2) => flip(1 << dice.below(8), false, true),
            (Spice::Framing, _) => Harm::Overrun,
            (Spice::Slip, 0) => Harm::Drop,
            (Spice::Slip, 1) => Harm::Duplicate,
            (Spice::Slip, 2) => Harm::Insert(dice.byte()),
            (Spice::Slip, _) => Harm::Replace(BYTES[dice.below(BYTES.len())]),
            (_, 0) => Harm::Break(200),
            (_, _) => Harm::Delay(500 + 500 * dice.below(30) as u16),
        };
        Some(Damage { link, at: 0, harm })
    }

    /// How a case ends: what a drive has become is seen only in what it answers next.
    fn end(&self, acts: &mut Vec<Act>, dice: &mut Dice) {
        let kind = dice.below(10);
        if kind >= 7 {
            return;
        }
        // A ring in the error mode spells out its address (ND21 9.7).
        if kind < 4 {
            let synco = 24 + usize::from(self.ring.drives) + dice.below(8);
            acts.push(Act::sound(ActKind::Synco(synco.min(60) as u8)));
        }
        if !(2..4).contains(&kind) {
            let may_be_in_error = kind < 2 || dice.percent(30);
            if may_be_in_error {
                acts.push(Act::sound(ActKind::Recover));
            }
            let mut cells = self.cells.clone();
            cells.truncate(2);
            for cell in cells {
                let drive = dice.below(usize::from(self.ring.drives)) as u8;
                let read = RawCommand::ReadByte { cell };
                acts.push(Act::sound(ActKind::Talk(Talk::one(To::Drive(drive), read))));
            }
        }
    }

    /// Adds a recovery after each act that leaves the drives' state in doubt (ND21 9.8). On a rig that does not allow everything, the guard
    /// permits nothing else there.
    pub(crate) fn keep_in_step(&self, case: &mut Case) {
        if self.scope.limits.allow_everything() {
            return;
        }
        let acts = std::mem::take(&mut case.acts);
        let mut doubt = false;
        for act in acts {
            let recovers = matches!(
                act.what,
                ActKind::Recover | ActKind::Zeros(_) | ActKind::Wait(_)
            );
            if doubt && !recovers {
                case.acts.push(Act::sound(ActKind::Recover));
            }
            doubt = leaves_doubt(&act) || doubt && !matches!(act.what, ActKind::Recover);
            case.acts.push(act);
        }
    }
}

/// Whether the drives' position within a telegram is unknown after this act.
fn leaves_doubt(act: &Act) -> bool {
    let spoiled = |talk: &Talk| {
        talk.orders
            .iter()
            .any(|order| order.spoil.is_some() || order.command == RawCommand::Reset)
    };
    let spoils = match &act.what {
        ActKind::Talk(talk) => spoiled(talk),
        ActKind::Bytes(_) | ActKind::Zeros(_) | ActKind::Sequence | ActKind::Power { .. } => true,
        ActKind::Synco(_) | ActKind::Pause(_) | ActKind::Recover | ActKind::Wait(_) => false,
    };
    spoils || !act.damages.is_empty()
}

/// A cell of the bus, of the drive's table, or any.
fn any_cell(dice: &mut Dice) -> u16 {
    match dice.below(10) {
        0..5 => CELLS[dice.below(CELLS.len())],
        5..8 => {
            let named: Vec<u16> = RAM
                .iter()
                .filter(|cell| cell.access != CellAccess::Reserved)
                .map(|cell| cell.address)
                .collect();
            dice.pick(&named).copied().unwrap_or(CELLS[0])
        }
        8 => 0xFD80 + dice.below(0x200) as u16,
        _ => 0x2F00 + dice.below(0xC0) as u16,
    }
}
