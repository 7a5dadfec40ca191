//! Short plots: acts that belong together, as a master would do them. Single acts in any order come to them too seldom.

use super::case::{Act, ActKind, Damage, Harm, MOST_NET, Talk, To};
use super::generate::Generator;
use super::order::{CommandSent, RawCommand, Spoil};
use crate::explore::Spice;
use harness_bench::explore::Dice;
use harness_proto::nd21::bits::{flags2, ps_status, status};
use harness_proto::nd21::{CONFIRM_ERROR, ram};
use harness_proto::novobus::checksum::Checksum;

/// A short plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Idiom {
    /// A cell is changed and read again (ND21 10).
    WriteAndRead,
    /// Process data go out of one cell and into another (9.4).
    Exchange,
    /// A command whose checking byte comes out as 00, or with a code beside a known one (9.5, 9.6).
    EdgeOfCommand,
    /// A drive is brought into the error mode, and perhaps out of it too soon (9.7, 9.8).
    ErrorMode,
    /// Something goes wrong, and the drive is asked what it was (14.10.1).
    AskForError,
    /// Time-outs are monitored, and silence follows (9.9).
    TimeOut,
    /// What a reset leaves (10.5).
    Reset,
    /// A byte of the EEPROM, there and back (14.10.5).
    Eeprom,
    /// A motor turns (14.10, 14.5.3.1).
    Turn,
    /// A positioning (13.2).
    Position,
}

impl Idiom {
    /// Each with what a swarm must have for it.
    pub(crate) const ALL: [(Self, Spice); 12] = [
        (Self::WriteAndRead, Spice::WriteByte),
        (Self::WriteAndRead, Spice::Or),
        (Self::WriteAndRead, Spice::WriteIo),
        (Self::Exchange, Spice::ProcessData),
        (Self::EdgeOfCommand, Spice::Spoil),
        (Self::ErrorMode, Spice::Zeros),
        (Self::AskForError, Spice::Noise),
        (Self::TimeOut, Spice::Silence),
        (Self::Reset, Spice::Reset),
        (Self::Eeprom, Spice::Eeprom),
        (Self::Turn, Spice::Motion),
        (Self::Position, Spice::Motion),
    ];

    /// Adds its acts.
    pub(crate) fn play(self, acts: &mut Vec<Act>, maker: &Generator<'_>, dice: &mut Dice) {
        let drive = maker.drive(dice);
        match self {
            Self::WriteAndRead => write_and_read(acts, drive, maker, dice),
            Self::Exchange => exchange(acts, drive, dice),
            Self::EdgeOfCommand => edge_of_command(acts, drive, maker, dice),
            Self::ErrorMode => error_mode(acts, drive, maker, dice),
            Self::AskForError => ask_for_error(acts, drive, maker, dice),
            Self::TimeOut => time_out(acts, maker, dice),
            Self::Reset => reset(acts, drive, maker, dice),
            Self::Eeprom => eeprom(acts, drive, dice),
            Self::Turn => turn(acts, drive, dice),
            Self::Position => position(acts, drive, dice),
        }
    }
}

fn talk(drive: u8, command: RawCommand) -> Act {
    Act::sound(ActKind::Talk(Talk::one(To::Drive(drive), command)))
}

fn reset(acts: &mut Vec<Act>, drive: u8, maker: &Generator<'_>, dice: &mut Dice) {
    let cell = maker.cell(dice);
    let data = dice.byte() | 1;
    acts.push(talk(drive, RawCommand::WriteByte { cell, data }));
    acts.push(talk(drive, RawCommand::Reset));
    // The drive tests itself (11.8).
    acts.push(Act::sound(ActKind::Wait(120)));
    acts.push(talk(drive, RawCommand::ReadByte { cell }));
}

fn eeprom(acts: &mut Vec<Act>, drive: u8, dice: &mut Dice) {
    let address = u16::from(dice.byte()) << 8;
    let buffer = |data| RawCommand::WriteWord {
        cell: ram::EEPROM_BUFFER,
        data,
    };
    let control = |data| RawCommand::WriteByte {
        cell: ram::EEPROM_CONTROL,
        data,
    };
    let buffer_of = |byte| buffer(address | u16::from(byte));
    acts.push(talk(drive, buffer_of(dice.byte())));
    acts.push(talk(drive, control(0x82)));
    acts.push(Act::sound(ActKind::Wait(15)));
    acts.push(talk(
        drive,
        RawCommand::ReadByte {
            cell: ram::EEPROM_CONTROL,
        },
    ));
    acts.push(talk(drive, buffer_of(0)));
    acts.push(talk(drive, control(0x81)));
    acts.push(Act::sound(ActKind::Wait(5)));
    acts.push(talk(
        drive,
        RawCommand::ReadWord {
            cell: ram::EEPROM_BUFFER,
        },
    ));
}

fn write_and_read(acts: &mut Vec<Act>, drive: u8, maker: &Generator<'_>, dice: &mut Dice) {
    const PORT: u16 = 0xFFB7;
    let change = maker.change(dice);
    let cell = match change {
        RawCommand::And { low, .. } | RawCommand::Or { low, .. } => 0xFF00 | u16::from(low),
        other => other.cell().unwrap_or(PORT),
    };
    // Something is there before it, that the change can be told from.
    if dice.percent(40) && !matches!(change, RawCommand::WriteIo { .. }) {
        let first = RawCommand::WriteByte {
            cell,
            data: dice.byte(),
        };
        if maker.allows(first) {
            acts.push(talk(drive, first));
        }
    }
    acts.push(talk(drive, change));
    let read = match dice.below(3) {
        0 => RawCommand::ReadWord { cell },
        1 => RawCommand::ReadLong { cell },
        _ => RawCommand::ReadByte { cell },
    };
    // What cannot be read as a word is an error (10.1), and that is worth a look too.
    acts.push(talk(
        drive,
        if cell == PORT {
            RawCommand::ReadByte { cell }
        } else {
            read
        },
    ));
}

fn exchange(acts: &mut Vec<Act>, drive: u8, dice: &mut Dice) {
    let low = 0x10 + 2 * dice.below(4) as u8;
    if dice.percent(40) {
        acts.push(talk(
            drive,
            RawCommand::WriteByte {
                cell: ram::DATA_IN,
                data: low,
            },
        ));
        acts.push(talk(
            drive,
            RawCommand::WriteByte {
                cell: ram::DATA_OUT,
                data: low,
            },
        ));
    }
    for _ in 0..1 + dice.below(2) {
        let mut one = Talk::one(To::Drive(drive), RawCommand::ReadByte { cell: 0xFF08 });
        one.orders.clear();
        one.process_data = Some(dice.word());
        acts.push(Act::sound(ActKind::Talk(one)));
    }
}

fn edge_of_command(acts: &mut Vec<Act>, drive: u8, maker: &Generator<'_>, dice: &mut Dice) {
    let mut order = CommandSent::sound(maker.change(dice));
    if dice.percent(50) {
        // Data with which the sum is 0, so that 01 must be sent (9.6) and 00 is wrong.
        let rest = |data| sum(order.command.with_data(data));
        let data = (0..=u8::MAX).find(|data| rest(*data) == Checksum::EMPTY);
        order.command = order.command.with_data(data.unwrap_or(0));
        order.spoil = dice.percent(60).then_some(Spoil { at: 9, byte: 0 });
    } else {
        order.command = match dice.below(3) {
            0 => RawCommand::ReadByte {
                cell: maker.cell(dice),
            },
            1 => RawCommand::ReadWord {
                cell: maker.cell(dice),
            },
            _ => order.command,
        };
        let at = match dice.percent(60) {
            true => 0,
            false => dice.below(6) as u8,
        };
        let mut bytes = order.bytes();
        let place = usize::from(at).min(bytes.len() - 1);
        bytes[place] ^= 1 << dice.below(8);
        order.spoil = Some(Spoil {
            at,
            byte: bytes[place],
        });
    }
    let cell = order.command.cell();
    let one = Talk {
        to: To::Drive(drive),
        process_data: None,
        orders: vec![order],
        room: MOST_NET,
        between: Vec::new(),
    };
    acts.push(Act::sound(ActKind::Talk(one)));
    match cell.filter(|_| dice.percent(50)) {
        None => acts.push(Act::sound(ActKind::Synco(1 + dice.below(8) as u8))),
        Some(cell) => {
            // Whether it was done all the same (9.6).
            acts.push(Act::sound(ActKind::Recover));
            acts.push(talk(drive, RawCommand::ReadByte { cell }));
        }
    }
}

fn sum(command: RawCommand) -> Checksum {
    Checksum::over(&command.head())
}

fn error_mode(acts: &mut Vec<Act>, drive: u8, maker: &Generator<'_>, dice: &mut Dice) {
    let bad = match dice.percent(50) {
        true => 0,
        false => dice.byte() & 0x7F,
    };
    acts.push(Act::sound(ActKind::Bytes(vec![bad])));
    acts.push(Act::sound(ActKind::Zeros(1 + dice.below(20) as u8)));
    match dice.below(4) {
        0 => acts.push(Act::sound(ActKind::Synco(4 + dice.below(28) as u8))),
        1 => acts.push(Act::sound(ActKind::Recover)),
        _ => acts.push(Act::sound(ActKind::Sequence)),
    }
    acts.push(talk(
        drive,
        RawCommand::ReadByte {
            cell: maker.cell(dice),
        },
    ));
}

/// Something that a drive takes for an error.
fn wrong(drive: u8, maker: &Generator<'_>, dice: &mut Dice) -> Act {
    let mut wrong = match dice.below(4) {
        0 => Act::sound(ActKind::Bytes(vec![dice.byte() & 0x7F])),
        1 => talk(
            drive,
            RawCommand::WriteByte {
                cell: 0x1234,
                data: 0,
            },
        ),
        2 => {
            let mut order = CommandSent::sound(RawCommand::ReadByte { cell: 0xFE13 });
            order.spoil = Some(Spoil {
                at: 9,
                byte: dice.byte(),
            });
            let mut one = Talk::one(To::Drive(drive), order.command);
            one.orders = vec![order];
            Act::sound(ActKind::Talk(one))
        }
        _ => Act::sound(ActKind::Synco(2)),
    };
    if matches!(wrong.what, ActKind::Synco(_)) {
        let (parity, stop) = (dice.percent(50), dice.percent(50));
        let harm = Harm::Flip {
            data: 0,
            parity: parity || !stop,
            stop,
        };
        let at = 0;
        wrong.damages.extend(
            maker
                .link_before(drive)
                .map(|link| Damage { link, at, harm }),
        );
    }
    wrong
}

fn ask_for_error(acts: &mut Vec<Act>, drive: u8, maker: &Generator<'_>, dice: &mut Dice) {
    acts.push(wrong(drive, maker, dice));
    acts.push(Act::sound(ActKind::Recover));
    // The drive's own cycle sees it (11.8).
    acts.push(Act::sound(ActKind::Wait(1 + dice.below(3) as u16)));
    acts.push(talk(
        drive,
        RawCommand::ReadWord {
            cell: ram::ERRORCODE,
        },
    ));
    acts.push(talk(drive, RawCommand::ReadByte { cell: ram::STATUS }));
    if dice.percent(50) {
        let confirm = RawCommand::WriteByte {
            cell: ram::ERRORCODE,
            data: CONFIRM_ERROR,
        };
        if maker.allows(confirm) {
            acts.push(talk(drive, confirm));
            acts.push(Act::sound(ActKind::Wait(2)));
            acts.push(talk(
                drive,
                RawCommand::ReadWord {
                    cell: ram::ERRORCODE,
                },
            ));
            acts.push(talk(drive, RawCommand::ReadByte { cell: ram::STATUS }));
        }
    }
}

fn time_out(acts: &mut Vec<Act>, maker: &Generator<'_>, dice: &mut Dice) {
    let monitor = RawCommand::Or {
        low: ram::FLAGS2 as u8,
        data: flags2::MONITORING,
    };
    let drive = maker.drive(dice);
    if dice.percent(40) {
        maker
            .drives()
            .for_each(|drive| acts.push(talk(drive, monitor)));
    } else {
        acts.push(talk(drive, monitor));
    }
    acts.push(Act::sound(ActKind::Synco(1)));
    acts.push(Act::sound(ActKind::Wait(
        [5, 9, 11, 15, 22, 27, 33, 42][dice.below(8)],
    )));
    acts.push(Act::sound(ActKind::Synco(1 + dice.below(30) as u8)));
    acts.push(Act::sound(ActKind::Recover));
    acts.push(talk(
        drive,
        RawCommand::ReadWord {
            cell: ram::ERRORCODE,
        },
    ));
    acts.push(talk(drive, RawCommand::ReadByte { cell: ram::FLAGS2 }));
    let flags = ram::FLAGS2 as u8;
    acts.push(talk(
        drive,
        RawCommand::And {
            low: flags,
            data: !flags2::MONITORING,
        },
    ));
}

/// Block and stop off, a nominal speed, and what the motor does of it.
fn turn(acts: &mut Vec<Act>, drive: u8, dice: &mut Dice) {
    if dice.percent(30) {
        let data = 1 << (9 + dice.below(5));
        acts.push(talk(
            drive,
            RawCommand::WriteWord {
                cell: ram::N_MAX,
                data,
            },
        ));
    }
    let low = ram::STATUS as u8;
    acts.push(talk(
        drive,
        RawCommand::And {
            low,
            data: !(status::BLOCK | status::STOP),
        },
    ));
    let data = (1 << (8 + dice.below(6))) ^ if dice.percent(50) { 0xFFFF } else { 0 };
    acts.push(talk(
        drive,
        RawCommand::WriteWord {
            cell: ram::NSOLL,
            data,
        },
    ));
    for _ in 0..1 + dice.below(3) {
        acts.push(Act::sound(ActKind::Wait(20 + dice.below(80) as u16)));
        let seen = [
            ram::NIST,
            ram::UMDRIST,
            ram::LAGEIST,
            ram::MSOLL,
            ram::IASOLL,
            ram::FLAGS,
            ram::TEMP_KK,
        ];
        for _ in 0..2 {
            let cell = seen[dice.below(seen.len())];
            acts.push(talk(drive, RawCommand::ReadWord { cell }));
        }
    }
    if dice.percent(50) {
        let data = [status::STOP, status::BLOCK][dice.below(2)];
        acts.push(talk(drive, RawCommand::Or { low, data }));
        acts.push(Act::sound(ActKind::Wait(30)));
        acts.push(talk(drive, RawCommand::ReadWord { cell: ram::NIST }));
    }
}

/// The positioning controller is initialised, a target is written and started (13.2).
fn position(acts: &mut Vec<Act>, drive: u8, dice: &mut Dice) {
    let low = ram::STATUS as u8;
    acts.push(talk(
        drive,
        RawCommand::And {
            low,
            data: !(status::BLOCK | status::STOP),
        },
    ));
    // The rotor's present place is where it is (13.2.1.3).
    acts.push(talk(
        drive,
        RawCommand::WriteByte {
            cell: ram::PS_STATUS,
            data: ps_status::FINISHED,
        },
    ));
    let turns = u16::from(dice.byte() & 3);
    acts.push(talk(
        drive,
        RawCommand::WriteWord {
            cell: ram::PS_POSITION_H,
            data: turns,
        },
    ));
    acts.push(talk(
        drive,
        RawCommand::WriteWord {
            cell: ram::PS_POSITION_L,
            data: dice.word(),
        },
    ));
    acts.push(talk(
        drive,
        RawCommand::Or {
            low: ram::FLAGS2 as u8,
            data: flags2::CALCULATE,
        },
    ));
    acts.push(Act::sound(ActKind::Wait(60)));
    acts.push(talk(
        drive,
        RawCommand::Or {
            low: ram::PS_STATUS as u8,
            data: ps_status::START,
        },
    ));
    acts.push(Act::sound(ActKind::Wait(200 + dice.below(400) as u16)));
    acts.push(talk(
        drive,
        RawCommand::ReadByte {
            cell: ram::PS_STATUS,
        },
    ));
    acts.push(talk(drive, RawCommand::ReadLong { cell: ram::UMDRIST }));
}
