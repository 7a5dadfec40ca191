//! What a drive must not take, and what it does then: wrong bytes at each place, and the way back (ND21 9.2 to 9.8, 10.4, 10.5).

use super::super::case::{Act, ActKind, Damage, Harm, Talk, To};
use super::super::order::{CommandSent, RawCommand};
use super::{Tour, page_cell, recover, shuffled, spare, spoiled, talk};
use harness_bench::explore::Dice;
use harness_proto::novobus::check_sequence::SEQUENCE;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::layout;
use harness_proto::novobus::properties::ReadLongAnswer;
use harness_proto::novobus::sync::{PAUSE, SYNCO, SyncByte};

/// Commands with a wrong byte at each place: what they would have done is not done, and the ring says which drive it was (9.6, 9.7).
pub(crate) fn refused(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut groups = Vec::new();
    for round in 0..3_u8 {
        for kind in 0..7 {
            let cell = match kind {
                2 | 3 => page_cell(dice),
                _ => spare(dice),
            };
            let (low, data) = (cell as u8, dice.byte());
            let command = match kind {
                0 => RawCommand::WriteByte { cell, data },
                1 => RawCommand::WriteWord {
                    cell,
                    data: dice.word(),
                },
                2 => RawCommand::And {
                    low,
                    data: data & 0x0F,
                },
                3 => RawCommand::Or {
                    low,
                    data: data | 0xF0,
                },
                4 => RawCommand::ReadByte { cell },
                5 => RawCommand::ReadWord { cell },
                _ => RawCommand::ReadLong { cell },
            };
            let bytes = CommandSent::sound(command).bytes();
            let last = bytes.len() - 1;
            // The checking byte as often as all others together.
            for at in (1..=last).chain(vec![last; last - 1]) {
                let wrong = wrong_byte(bytes[at], round, at == last, dice);
                let held = [RawCommand::WriteWord {
                    cell: cell & !1,
                    data: dice.word(),
                }];
                let mut acts = vec![talk(drive, &held), spoiled(drive, command, at as u8, wrong)];
                acts.extend(between_error_and_recovery(tour, dice));
                acts.push(talk(drive, &[RawCommand::ReadWord { cell: cell & !1 }]));
                groups.push(acts);
            }
        }
    }
    tour.packed(shuffled(groups, dice))
}

fn wrong_byte(right: u8, round: u8, check: bool, dice: &mut Dice) -> u8 {
    let wrong = match (round, check) {
        (0, true) => right.wrapping_add(1),
        (1, true) => right.wrapping_neg(),
        _ => match dice.below(6) {
            0 => 0,
            1 => right ^ 1 << dice.below(8),
            2 => !right,
            3 => right.wrapping_sub(1),
            4 => 0xFF,
            _ => dice.byte(),
        },
    };
    match wrong == right {
        true => right ^ 0x10,
        false => wrong,
    }
}

/// What a ring hears until it is brought back: zeros that count or not, and SYNCO long enough to see which drive it names.
fn between_error_and_recovery(tour: &Tour<'_>, dice: &mut Dice) -> Vec<Act> {
    let zeros = |count: usize| Act::sound(ActKind::Zeros(count as u8));
    match dice.below(6) {
        0 => vec![tour.spell(), recover()],
        1 => vec![
            zeros(1 + dice.below(12)),
            Act::sound(ActKind::Sequence),
            tour.spell(),
            recover(),
        ],
        2 => vec![
            zeros(1 + dice.below(9)),
            Act::sound(ActKind::Synco(1)),
            zeros(1 + dice.below(9)),
            tour.spell(),
            recover(),
        ],
        3 => vec![Act::sound(ActKind::Sequence), recover()],
        _ => vec![recover()],
    }
}

/// Every byte that is no command (9.5), with what would be right after commands of each form.
pub(crate) fn codes(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let unknown = (0..=u8::MAX).filter(|code| layout(*code, ReadLongAnswer::FourData).is_none());
    let forms = unknown.flat_map(|code| [(code, 0), (code, 1), (code, 2)]);
    let codes = tour.share(drive, shuffled(forms.collect(), &mut Dice::new(1)));
    let groups = codes.into_iter().map(|(code, form)| {
        let (cell, data) = (spare(dice), dice.byte());
        let (low, page) = (cell as u8, page_cell(dice) as u8);
        let mut command = vec![code];
        match form {
            0 => command.extend([low, 0xFE]),
            1 => command.extend([data, low, 0xFE]),
            _ => command.extend([data, page]),
        }
        command.push(Checksum::over(&command).plus());
        let length = command.len() as u8;
        let mut bytes = vec![0x80 | length << 1, drive.wrapping_sub(tour.ring.drives)];
        bytes.extend(command);
        let mut acts = vec![Act::sound(ActKind::Bytes(bytes))];
        acts.extend(between_error_and_recovery(tour, dice));
        if form > 0 {
            let cell = if form == 1 {
                cell
            } else {
                0xFF00 | u16::from(page)
            };
            acts.push(talk(drive, &[RawCommand::ReadByte { cell }]));
        }
        acts
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Every code of the outputs, proper or not (10.4).
pub(crate) fn outputs(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let wrong = tour.share(drive, (4..=u8::MAX).collect());
    let all = (0..4).chain(wrong).collect();
    let groups = shuffled(all, dice).into_iter().map(|code| {
        let mut acts = vec![talk(drive, &[RawCommand::WriteIo { code }])];
        if code > 3 {
            acts.extend([Act::sound(ActKind::Synco(2)), recover()]);
        }
        acts
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Commands whose sum is 0, for which 01 stands, and answers of which the same is true (9.6).
pub(crate) fn sums_of_zero(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut groups = Vec::new();
    for round in 0..12 {
        let cell = spare(dice);
        let write = RawCommand::WriteByte { cell, data: 0 };
        let sum = |data| Checksum::over(&write.with_data(data).head());
        let data = (0..=u8::MAX).find(|data| sum(*data) == Checksum::EMPTY);
        let zero = write.with_data(data.unwrap_or(0));
        let read = RawCommand::ReadByte { cell };
        let held = [0xC0, cell as u8]
            .iter()
            .fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        let answer = RawCommand::WriteByte {
            cell,
            data: held.wrapping_neg(),
        };
        let other = RawCommand::WriteByte {
            cell,
            data: dice.byte(),
        };
        groups.push(vec![
            talk(drive, &[zero, read]),
            talk(drive, &[answer, read]),
        ]);
        let wrong = if round % 2 == 0 { 0 } else { 2 };
        groups.push(vec![
            talk(drive, &[other]),
            spoiled(drive, zero, 9, wrong),
            Act::sound(ActKind::Synco(1)),
            recover(),
            talk(drive, &[read]),
        ]);
    }
    tour.packed(groups)
}

/// Every byte that is no sync byte, and what stands behind it (9.2, 9.7).
pub(crate) fn sync_bytes(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let bad = (0..=u8::MAX).filter(|byte| SyncByte::decode(*byte).is_err());
    let bytes = tour.share(drive, bad.collect());
    let groups = shuffled(bytes, dice).into_iter().map(|byte| {
        let mut acts = vec![
            talk(drive, &[RawCommand::ReadByte { cell: spare(dice) }]),
            Act::sound(ActKind::Bytes(vec![byte])),
        ];
        acts.extend(between_error_and_recovery(tour, dice));
        acts
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Check sequences that break off at each place, by each kind of byte, and begin again; with too few zeros and enough (9.8).
pub(crate) fn broken_sequences(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut all = Vec::new();
    for (broken, due) in SEQUENCE.into_iter().enumerate().skip(1) {
        for breaker in [0xFF, 0x00, SYNCO, 0x44, 0x41, due ^ 0x20] {
            for zeros in [7, 8, 17] {
                all.push((broken, breaker, zeros));
            }
        }
    }
    let sequences = tour.share(drive, shuffled(all, &mut Dice::new(0)));
    let groups = sequences.into_iter().map(|(broken, breaker, zeros)| {
        let mut bytes = SEQUENCE[..broken].to_vec();
        bytes.push(breaker);
        // What broke it may be its first byte again.
        let from = usize::from(breaker == SEQUENCE[0] && dice.percent(50));
        bytes.extend(&SEQUENCE[from..]);
        let read = talk(drive, &[RawCommand::ReadByte { cell: spare(dice) }]);
        vec![
            Act::sound(ActKind::Bytes(vec![dice.byte() & 0x7F])),
            Act::sound(ActKind::Zeros(zeros)),
            Act::sound(ActKind::Bytes(bytes)),
            read.clone(),
            Act::sound(ActKind::Synco(6)),
            recover(),
            read,
        ]
    });
    let groups = groups.collect();
    tour.packed(groups)
}

/// Commands that are cut at each place, with nothing, idle bytes or other telegrams between their parts (9.2, 9.5).
pub(crate) fn cuts(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut groups = Vec::new();
    for kind in 0..7 {
        for room in 2..=5 {
            for gap in 0..6 {
                let cell = match kind {
                    2 | 3 => page_cell(dice) & !1,
                    _ => spare(dice),
                };
                let (low, data) = (cell as u8, dice.byte());
                let command = match kind {
                    0 => RawCommand::WriteByte { cell, data },
                    1 => RawCommand::WriteWord {
                        cell,
                        data: dice.word(),
                    },
                    2 => RawCommand::And { low, data },
                    3 => RawCommand::Or { low, data },
                    4 => RawCommand::ReadByte { cell },
                    5 => RawCommand::ReadWord { cell },
                    _ => RawCommand::ReadLong { cell },
                };
                let cut = Talk {
                    room,
                    between: between(tour, drive, gap, dice),
                    ..Talk::one(To::Drive(drive), command)
                };
                groups.push(vec![
                    talk(
                        drive,
                        &[RawCommand::WriteWord {
                            cell,
                            data: dice.word(),
                        }],
                    ),
                    Act::sound(ActKind::Talk(cut)),
                    talk(drive, &[RawCommand::ReadWord { cell }]),
                ]);
            }
        }
    }
    tour.packed(shuffled(groups, dice))
}

/// What stands between the parts of a command.
fn between(tour: &Tour<'_>, drive: u8, gap: u8, dice: &mut Dice) -> Vec<u8> {
    let drives = tour.ring.drives;
    let other =
        (drive + 1 + dice.below(usize::from(drives.saturating_sub(1)).max(1)) as u8) % drives;
    let telegrams = |talk: Talk| talk.telegrams(drives).concat();
    match gap {
        0 => Vec::new(),
        1 => vec![SYNCO; 1 + dice.below(4)],
        2 => vec![PAUSE; 1 + dice.below(3)],
        3 if other != drive => telegrams(Talk::one(
            To::Drive(other),
            RawCommand::ReadByte { cell: spare(dice) },
        )),
        4 => telegrams(Talk::one(
            To::Nobody(dice.byte() & 0x7F),
            RawCommand::ReadByte { cell: spare(dice) },
        )),
        _ => vec![SYNCO, PAUSE, SYNCO],
    }
}

/// Bytes of telegrams that arrive with a line error, at each place: a good zero counts, a bad one does not (9.7).
pub(crate) fn damaged(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let Some(link) = tour.ring.links.first().copied() else {
        return Vec::new();
    };
    let mut groups = Vec::new();
    for at in 0..8_u16 {
        for kind in 0..3 {
            let cell = spare(dice);
            let mut act = talk(drive, &[RawCommand::WriteByte { cell, data: 0 }]);
            let harm = match kind {
                0 => Harm::Flip {
                    data: 0,
                    parity: true,
                    stop: false,
                },
                1 => Harm::Flip {
                    data: 1 << dice.below(8),
                    parity: false,
                    stop: false,
                },
                _ => Harm::Flip {
                    data: 0,
                    parity: false,
                    stop: true,
                },
            };
            if at < 7 {
                act.damages.push(Damage { link, at, harm });
            }
            let mut acts = vec![
                talk(
                    drive,
                    &[RawCommand::WriteByte {
                        cell,
                        data: dice.byte() | 1,
                    }],
                ),
                act,
            ];
            if at == 7 {
                // A bad zero among those that are counted.
                let mut zeros = Act::sound(ActKind::Zeros(12));
                let place = dice.below(9) as u16;
                zeros.damages.push(Damage {
                    link,
                    at: place,
                    harm,
                });
                acts.extend([
                    Act::sound(ActKind::Bytes(vec![4])),
                    zeros,
                    Act::sound(ActKind::Sequence),
                ]);
            }
            acts.extend(between_error_and_recovery(tour, dice));
            acts.push(talk(drive, &[RawCommand::ReadByte { cell }]));
            groups.push(acts);
        }
    }
    tour.packed(groups)
}

/// A reset that is refused keeps what the cells hold; one that is carried out is answered (10.5).
pub(crate) fn resets(tour: &Tour<'_>, drive: u8, dice: &mut Dice) -> Vec<Vec<Act>> {
    let mut cases = Vec::new();
    for at in [1, 2, 2] {
        let cell = spare(dice);
        let data = dice.byte() | 1;
        let wrong = dice.byte() & 0x1F;
        cases.push(vec![
            talk(drive, &[RawCommand::WriteByte { cell, data }]),
            spoiled(drive, RawCommand::Reset, at, wrong),
            recover(),
            talk(drive, &[RawCommand::ReadByte { cell }]),
        ]);
    }
    if tour.resets {
        cases.push(vec![talk(drive, &[RawCommand::Reset])]);
    }
    cases
}
