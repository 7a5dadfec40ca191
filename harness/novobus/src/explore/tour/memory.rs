//! What a drive's memory must do: each cell, each value, each mask, and the ends of what commands may touch (ND21 9.4, 10.1 to 10.3).

use super::super::case::{Act, ActKind};
use super::super::order::RawCommand;
use super::{Tour, exchange, page_cell, recover, shuffled, spare, talk};
use harness_bench::explore::Dice;
use harness_proto::nd21::{own, ram};
use harness_proto::novobus::command::Kind;
use harness_proto::novobus::memory::{ROM_BYTES, ROM_WORDS, in_range};

/// Marches through all spare RAM with a different value for each cell, upwards and downwards, by bytes and by words, and reads each cell
/// before it is written again. Finds stuck bits, aliased cells and lost writes (ND21 10.1, 10.2).
pub(crate) fn march(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let words: Vec<u16> = own::SPARE.step_by(2).collect();
    let content: Vec<u16> = words.iter().map(|_| dice.word()).collect();
    let all = || words.iter().copied().zip(content.iter().copied());
    let mut groups = Vec::new();
    for (cell, data) in all() {
        groups.push(vec![talk(drive, &[RawCommand::WriteWord { cell, data }])]);
    }
    for (cell, data) in all() {
        let [high, low] = (!data).to_be_bytes();
        let next = cell + 1;
        groups.push(vec![
            talk(drive, &[RawCommand::ReadWord { cell }]),
            talk(drive, &[RawCommand::WriteByte { cell, data: high }]),
            talk(
                drive,
                &[RawCommand::WriteByte {
                    cell: next,
                    data: low,
                }],
            ),
        ]);
    }
    for (cell, data) in all().collect::<Vec<_>>().into_iter().rev() {
        groups.push(vec![
            talk(drive, &[RawCommand::ReadByte { cell }]),
            talk(drive, &[RawCommand::ReadByte { cell: cell + 1 }]),
            talk(drive, &[RawCommand::WriteWord { cell, data }]),
        ]);
    }
    for cell in own::SPARE.step_by(4) {
        groups.push(vec![talk(drive, &[RawCommand::ReadLong { cell }])]);
    }
    tour.packed(groups)
}

/// The ROM: what it holds is the drive's choice, but it holds it, whichever command reads (10.1).
pub(crate) fn rom(tour: &Tour<'_>, drive: u8, _: &mut Dice) -> Vec<Vec<Act>> {
    let word = |cell| vec![talk(drive, &[RawCommand::ReadWord { cell }])];
    let byte = |cell| vec![talk(drive, &[RawCommand::ReadByte { cell }])];
    let words = ROM_WORDS.step_by(2).map(word);
    tour.packed(words.chain(ROM_BYTES.map(byte)).collect())
}

/// Every value of a byte, written and read (10.1, 10.2).
pub(crate) fn values(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let all = shuffled((0..=u8::MAX).collect(), dice);
    let groups = all.into_iter().map(|data| {
        let cell = spare(dice) + dice.below(2) as u16;
        vec![talk(
            drive,
            &[
                RawCommand::WriteByte { cell, data },
                RawCommand::ReadByte { cell },
            ],
        )]
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Every mask of both bit commands over bits of each kind (10.3).
pub(crate) fn masks(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let all = shuffled((0..=u8::MAX).collect(), dice);
    let groups = all.into_iter().map(|data| {
        let cell = page_cell(dice);
        let low = cell as u8;
        let other = dice.byte();
        let read = RawCommand::ReadByte { cell };
        let held = match dice.below(4) {
            0 => 0,
            1 => 0xFF,
            _ => dice.byte(),
        };
        vec![talk(
            drive,
            &[
                RawCommand::WriteByte { cell, data: held },
                RawCommand::And { low, data },
                read,
                RawCommand::Or { low, data: other },
                read,
            ],
        )]
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Process data with and without commands, in and out of the same cells and of others, of telegrams after one another (9.4, 14.10.3).
pub(crate) fn process_data(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut cases = Vec::new();
    for round in 0..24_u16 {
        let first = ram::NKP + (round & 1);
        let other = ram::NKP + 2 * (round >> 1 & 1);
        let pointer = |cell: u16, data: u16| RawCommand::WriteByte {
            cell,
            data: data as u8,
        };
        let mut acts = vec![
            talk(drive, &[pointer(ram::DATA_IN, first)]),
            talk(drive, &[pointer(ram::DATA_OUT, other)]),
            talk(
                drive,
                &[RawCommand::WriteWord {
                    cell: ram::NKP,
                    data: dice.word(),
                }],
            ),
            talk(
                drive,
                &[RawCommand::WriteWord {
                    cell: ram::LKP,
                    data: dice.word(),
                }],
            ),
        ];
        for _ in 0..6 {
            let data = dice.word();
            let cell = other + dice.below(2) as u16;
            acts.push(match dice.below(6) {
                0 => exchange(
                    drive,
                    data,
                    &[RawCommand::WriteByte {
                        cell,
                        data: dice.byte(),
                    }],
                ),
                1 => exchange(drive, data, &[RawCommand::ReadByte { cell }]),
                2 => exchange(
                    drive,
                    data,
                    &[RawCommand::WriteWord {
                        cell: ram::NKP,
                        data: dice.word(),
                    }],
                ),
                _ => exchange(drive, data, &[]),
            });
            if dice.percent(30) {
                let next = (drive + 1) % tour.ring.drives;
                acts.push(talk(next, &[RawCommand::ReadByte { cell: spare(dice) }]));
            }
        }
        acts.push(talk(drive, &[RawCommand::ReadWord { cell: ram::NKP }]));
        acts.push(talk(drive, &[RawCommand::ReadWord { cell: ram::LKP }]));
        acts.push(exchange(drive, dice.word(), &[]));
        cases.push(acts);
    }
    cases
}

/// Every kind of command at the first and last addresses that it may touch, and beside them (10.1 to 10.3). What was refused has changed
/// nothing.
pub(crate) fn edges(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    const PLACES: [u16; 24] = [
        0x2EFE, 0x2EFF, 0x2F00, 0x2FBC, 0x2FBE, 0x2FBF, 0x2FC0, 0x2FDC, 0x2FDE, 0x2FDF, 0x2FE0,
        0xFD7C, 0xFD7E, 0xFD7F, 0xFD80, 0xFF7A, 0xFF7C, 0xFF7D, 0xFF7E, 0xFF7F, 0xFF80, 0xFF81,
        0xFFFE, 0xFFFF,
    ];
    let mut groups = Vec::new();
    for cell in PLACES {
        let data = dice.word();
        let commands = [
            RawCommand::ReadByte { cell },
            RawCommand::ReadWord { cell },
            RawCommand::ReadLong { cell },
            RawCommand::WriteByte {
                cell,
                data: data as u8,
            },
            RawCommand::WriteWord { cell, data },
        ];
        groups.extend(commands.map(|command| beside(tour, drive, command, dice)));
    }
    for low in [0x7F, 0x80, 0x81, 0xF0, 0xFF] {
        let data = dice.byte();
        let commands = [RawCommand::And { low, data }, RawCommand::Or { low, data }];
        groups.extend(commands.map(|command| beside(tour, drive, command, dice)));
    }
    let groups = shuffled(groups, dice);
    tour.packed(groups)
}

fn beside(tour: &Tour<'_>, drive: u8, command: RawCommand, dice: &mut Dice) -> Vec<Act> {
    let known = [0xFD80, 0xFF7E, 0xFF7F];
    let near = command
        .cell()
        .map(|cell| cell.saturating_sub(1)..=cell.saturating_add(4));
    let known = known
        .into_iter()
        .filter(|cell| near.as_ref().is_some_and(|near| near.contains(cell)));
    let known: Vec<u16> = known.collect();
    let write = |cell: u16, data| talk(drive, &[RawCommand::WriteByte { cell, data }]);
    let mut acts: Vec<Act> = known.iter().map(|cell| write(*cell, dice.byte())).collect();
    let (kind, address) = kind_of(command);
    acts.push(talk(drive, &[command]));
    if !in_range(kind, address) {
        acts.push(match dice.percent(30) {
            true => tour.spell(),
            false => Act::sound(ActKind::Synco(2)),
        });
        acts.push(recover());
    }
    let read = |cell: &u16| talk(drive, &[RawCommand::ReadByte { cell: *cell }]);
    acts.extend(known.iter().map(read));
    acts
}

fn kind_of(command: RawCommand) -> (Kind, u16) {
    let kind = match command {
        RawCommand::ReadByte { .. } => Kind::ReadByte,
        RawCommand::ReadWord { .. } => Kind::ReadWord,
        RawCommand::ReadLong { .. } => Kind::ReadLong,
        RawCommand::WriteByte { .. } => Kind::WriteByte,
        RawCommand::WriteWord { .. } => Kind::WriteWord,
        RawCommand::And { low, .. } => return (Kind::And, 0xFF00 | u16::from(low)),
        RawCommand::Or { low, .. } => return (Kind::Or, 0xFF00 | u16::from(low)),
        RawCommand::WriteIo { .. } => Kind::WriteIo,
        RawCommand::Reset => Kind::ResetH8,
    };
    (kind, command.cell().unwrap_or(0))
}
