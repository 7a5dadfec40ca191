//! New cases from old ones.

use super::case::{Act, ActKind, Case, To};
use super::generate::Generator;
use super::order::{CommandSent, RawCommand};
use harness_bench::explore::Dice;

/// A case made of one that is kept, and now and then of two.
pub(crate) fn mutate(
    case: &Case,
    other: Option<&Case>,
    maker: &Generator<'_>,
    dice: &mut Dice,
) -> Case {
    let mut new = case.clone();
    for _ in 0..1 + dice.below(3) {
        one(&mut new, other, maker, dice);
    }
    // Growing beyond the bounds loses the end.
    while !new.is_bounded() && new.acts.pop().is_some() {}
    if new.acts.is_empty() {
        new.acts.push(maker.act(dice));
    }
    maker.keep_in_step(&mut new);
    while !new.is_bounded() && new.acts.pop().is_some() {}
    new
}

fn one(case: &mut Case, other: Option<&Case>, maker: &Generator<'_>, dice: &mut Dice) {
    let place = dice.below(case.acts.len() + 1);
    let inside = dice.below(case.acts.len());
    match dice.below(9) {
        0 => {
            let mut new = Vec::new();
            maker.add(&mut new, dice);
            case.acts.splice(place..place, new);
        }
        1 if case.acts.len() > 1 => {
            case.acts.remove(inside);
        }
        2 => {
            if let Some(act) = case.acts.get(inside).cloned() {
                case.acts.insert(place, act);
            }
        }
        3 => {
            let next = dice.below(case.acts.len());
            if !case.acts.is_empty() {
                case.acts.swap(inside, next);
            }
        }
        4 => maker.damage(&mut case.acts, dice),
        5 => {
            if let Some(act) = case.acts.get_mut(inside) {
                act.damages.pop();
            }
        }
        6 => {
            if let Some(other) = other {
                let from = dice.below(other.acts.len());
                let tail = other.acts.iter().skip(from).cloned();
                case.acts.truncate(place);
                case.acts.extend(tail);
            }
        }
        _ => {
            if let Some(act) = case.acts.get_mut(inside) {
                vary(act, maker, dice);
            }
        }
    }
}

/// Changes something within an act.
fn vary(act: &mut Act, maker: &Generator<'_>, dice: &mut Dice) {
    match &mut act.what {
        ActKind::Synco(count) | ActKind::Pause(count) | ActKind::Zeros(count) => {
            *count = 1 + dice.below(30) as u8;
        }
        ActKind::Bytes(bytes) => {
            let at = dice.below(bytes.len());
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << dice.below(8);
            }
        }
        ActKind::Wait(ms) => *ms = 1 + dice.below(45) as u16,
        ActKind::Power { on, .. } => *on = !*on,
        ActKind::Talk(talk) => match dice.below(4) {
            0 => talk.to = maker.to(dice),
            1 => talk.orders.push(maker.order(dice)),
            2 if talk.orders.len() > 1 => {
                talk.orders.remove(dice.below(talk.orders.len()));
            }
            _ => {
                let at = dice.below(talk.orders.len());
                if let Some(order) = talk.orders.get_mut(at) {
                    *order = like(order, maker, dice);
                }
            }
        },
        ActKind::Recover | ActKind::Sequence => act.what = maker.act(dice).what,
    }
    if let ActKind::Talk(talk) = &mut act.what {
        talk.orders.truncate(4);
        // An address byte needs a net byte behind it (ND21 9.1), or the telegram is none.
        if talk.orders.is_empty() && talk.process_data.is_none() && matches!(talk.to, To::Drive(_))
        {
            talk.orders.push(maker.order(dice));
        }
    }
}

/// Another command to the same cell, or a spoiled one.
fn like(order: &CommandSent, maker: &Generator<'_>, dice: &mut Dice) -> CommandSent {
    let new = maker.order(dice);
    let cell = match (order.command.cell(), order.command) {
        (Some(cell), _) => cell,
        (None, RawCommand::And { low, .. } | RawCommand::Or { low, .. }) => 0xFF00 | u16::from(low),
        _ => return new,
    };
    let command = match new.command {
        RawCommand::ReadByte { .. } => RawCommand::ReadByte { cell },
        RawCommand::ReadWord { .. } => RawCommand::ReadWord { cell },
        RawCommand::ReadLong { .. } => RawCommand::ReadLong { cell },
        other if dice.percent(50) => other,
        _ => RawCommand::ReadByte { cell },
    };
    CommandSent {
        command,
        spoil: new.spoil.or(order.spoil),
    }
}
