//! What of a conversation with rings may be left out or simplified when a finding is shrunk.

use super::case::{Act, ActKind, Case, Harm, MOST_NET, OtherRing, Talk, To};
use super::oracle::Difference;
use super::order::{CommandSent, RawCommand, Spoil};
use harness_bench::explore::smaller::{self, Shrinkable, fewer};
use harness_proto::novobus::memory::RAM;
use std::collections::BTreeSet;

/// What is shrunk: a conversation with a ring.
pub(crate) type Subject = smaller::Subject<Case>;

/// The first cell of the RAM.
const FIRST_CELL: u16 = *RAM.start();

impl Shrinkable for Case {
    /// In order of weight: bytes on the wire, faults, acts, drives, milliseconds of silence, and the values themselves.
    type Measure = [u64; 6];

    /// After a cut, the last act often shows the difference alone.
    const FIRST_LEFT: usize = 1;

    fn measure(&self) -> [u64; 6] {
        let damages = self.acts.iter().flat_map(|act| &act.damages);
        let values = self.acts.iter().map(|act| values(&act.what)).sum();
        let waits = self.acts.iter().map(|act| match act.what {
            ActKind::Wait(ms) => u64::from(ms),
            _ => 0,
        });
        [
            self.length() as u64,
            damages.map(|damage| damage.harm.weight()).sum(),
            self.acts.len() as u64,
            self.sizes().into_iter().map(u64::from).sum(),
            waits.sum(),
            values,
        ]
    }

    fn acts(&mut self) -> &mut Vec<Act> {
        &mut self.acts
    }

    fn simpler(act: &Act) -> Vec<Act> {
        let mut all = Vec::new();
        for (index, damage) in act.damages.iter().enumerate() {
            let mut dropped = act.clone();
            dropped.damages.remove(index);
            all.push(dropped);
            for harm in simpler_harms(damage.harm) {
                let mut other = act.clone();
                other.damages[index].harm = harm;
                all.push(other);
            }
        }
        let others = simpler_kinds(&act.what).into_iter();
        all.extend(others.map(|what| Act {
            what,
            damages: act.damages.clone(),
        }));
        all
    }

    /// Up to the differing byte, or to the end of its act.
    fn up_to(&self, difference: &Difference) -> Vec<Self> {
        let mut before = 0;
        for (at, act) in self.acts.iter().enumerate() {
            let inside = difference.byte.and_then(|byte| byte.checked_sub(before));
            let length = act.length(self.drives);
            if inside.is_some_and(|inside| inside <= length) {
                let mut whole = self.clone();
                whole.acts.truncate(at + 1);
                // The act may have more commands behind the one that is answered.
                let mut shortened = whole.clone();
                shorten(&mut shortened.acts[at].what, inside.unwrap_or(length));
                return vec![shortened, whole];
            }
            before += length;
        }
        Vec::new()
    }

    /// Without the other ring of the bench or with the smallest there is, on smaller rings, and with the first cell of the RAM (ND21 10.1) in
    /// place of another in all commands: what is written is read again.
    fn reduced(subject: &Subject) -> Vec<Subject> {
        let mut all = Vec::new();
        if let Some(other) = subject.case.beside {
            let mut alone = subject.clone();
            alone.case.beside = None;
            alone.setup = alone.setup.of_ring(subject.case.ring());
            let mut smallest = subject.clone();
            smallest.case.beside = Some(match other {
                OtherRing::First(_) => OtherRing::First(1),
                OtherRing::Second(_) => OtherRing::Second(1),
            });
            all.extend([alone, smallest]);
        }
        all.extend((1..subject.case.drives).map(|drives| on_ring(subject, drives)));
        let cells = subject
            .case
            .orders()
            .filter_map(|order| order.command.cell());
        let cells: BTreeSet<u16> = cells.filter(|cell| *cell > FIRST_CELL).collect();
        for cell in cells {
            let mut lower = subject.clone();
            for act in &mut lower.case.acts {
                if let ActKind::Talk(talk) = &mut act.what {
                    let orders = talk.orders.iter_mut();
                    orders.for_each(|order| order.command = order.command.at(cell, FIRST_CELL));
                }
            }
            all.push(lower);
        }
        all
    }
}

/// The sum of the values of an act.
fn values(what: &ActKind) -> u64 {
    let of_bytes = |bytes: &[u8]| bytes.iter().map(|byte| u64::from(*byte)).sum::<u64>();
    match what {
        ActKind::Bytes(bytes) => of_bytes(bytes),
        ActKind::Power { drive, .. } => u64::from(*drive),
        ActKind::Talk(talk) => {
            let to = match talk.to {
                To::Drive(drive) => u64::from(drive),
                To::Nobody(byte) => u64::from(byte),
                To::Same | To::Next => 0,
            };
            let orders = talk.orders.iter().map(|order| {
                let spoil = order.spoil.map_or(0, |spoil| 1 + u64::from(spoil.byte));
                of_bytes(&order.command.head()) + spoil
            });
            to + talk.process_data.map_or(0, u64::from) + orders.sum::<u64>()
        }
        _ => 0,
    }
}

/// Simpler faults: single bits first.
fn simpler_harms(harm: Harm) -> Vec<Harm> {
    let flip = |data, parity, stop| Harm::Flip { data, parity, stop };
    let mut simpler = vec![flip(0, true, false), flip(1, false, false)];
    match harm {
        Harm::Flip { stop: true, .. } => simpler.push(flip(0, false, true)),
        Harm::Delay(us) => simpler.extend([Harm::Drop, Harm::Delay(us / 2)]),
        Harm::Break(_) => simpler.push(Harm::Break(200)),
        Harm::Replace(_) => simpler.extend([Harm::Drop, Harm::Replace(0)]),
        Harm::Insert(_) => simpler.extend([Harm::Duplicate, Harm::Insert(0)]),
        _ => {}
    }
    simpler
}

/// The parts of an act, with some left out.
fn simpler_kinds(what: &ActKind) -> Vec<ActKind> {
    match what {
        ActKind::Synco(count) => fewer(*count).map(ActKind::Synco).collect(),
        ActKind::Pause(count) => fewer(*count).map(ActKind::Pause).collect(),
        ActKind::Zeros(count) => fewer(*count).map(ActKind::Zeros).collect(),
        // Just beyond the times of ND21 9.9.
        ActKind::Wait(ms) => [1, 11, 21, ms / 2].map(ActKind::Wait).to_vec(),
        ActKind::Bytes(bytes) => {
            let mut all = Vec::new();
            let mut length = bytes.len() / 2;
            while length > 0 {
                for from in (0..=bytes.len() - length).step_by(length) {
                    let rest = [&bytes[..from], &bytes[from + length..]].concat();
                    all.push(ActKind::Bytes(rest));
                }
                length /= 2;
            }
            all
        }
        ActKind::Recover => vec![ActKind::Sequence],
        ActKind::Talk(talk) => simpler_talks(talk).into_iter().map(ActKind::Talk).collect(),
        ActKind::Sequence | ActKind::Power { .. } => Vec::new(),
    }
}

/// With commands left out or shortened, then with lower values.
fn simpler_talks(talk: &Talk) -> Vec<Talk> {
    let with_data = |process_data| Talk {
        process_data,
        ..talk.clone()
    };
    let mut all = vec![with_data(None)];
    all.push(Talk {
        room: MOST_NET,
        ..talk.clone()
    });
    let with = |index: usize, order: CommandSent| {
        let mut other = talk.clone();
        other.orders[index] = order;
        other
    };
    for (index, order) in talk.orders.iter().enumerate() {
        let mut dropped = talk.clone();
        dropped.orders.remove(index);
        all.extend([dropped, with(index, CommandSent::sound(order.command))]);
        let CommandSent { spoil, .. } = *order;
        let shorter = shorter(order.command).into_iter();
        all.extend(shorter.map(|command| with(index, CommandSent { command, spoil })));
    }
    all.extend([0, 1].map(|data| with_data(Some(data))));
    for (index, order) in talk.orders.iter().enumerate() {
        let CommandSent { command, spoil } = *order;
        let lower = lower(command).into_iter();
        all.extend(lower.map(|command| with(index, CommandSent { command, spoil })));
        let spoil = spoil.map(|spoil| Spoil { byte: 0, ..spoil });
        all.push(with(index, CommandSent { command, spoil }));
    }
    all
}

/// Shortens an act to `length` bytes if it can be cut at any byte.
fn shorten(what: &mut ActKind, length: usize) {
    let count = u8::try_from(length).unwrap_or(u8::MAX);
    match what {
        ActKind::Synco(old) | ActKind::Pause(old) | ActKind::Zeros(old) => *old = count.min(*old),
        ActKind::Bytes(bytes) => bytes.truncate(length),
        _ => {}
    }
}

/// Commands with fewer bytes to the same cell.
fn shorter(command: RawCommand) -> Vec<RawCommand> {
    match command {
        RawCommand::ReadWord { cell } | RawCommand::WriteByte { cell, .. } => {
            vec![RawCommand::ReadByte { cell }]
        }
        RawCommand::ReadLong { cell } => {
            vec![RawCommand::ReadByte { cell }, RawCommand::ReadWord { cell }]
        }
        RawCommand::WriteWord { cell, data } => {
            let data = data as u8;
            vec![
                RawCommand::ReadByte { cell },
                RawCommand::WriteByte { cell, data },
            ]
        }
        _ => Vec::new(),
    }
}

/// The same command with lower values: the data 0 or 1.
fn lower(command: RawCommand) -> Vec<RawCommand> {
    match command {
        RawCommand::WriteByte { cell, .. } => [0, 1]
            .map(|data| RawCommand::WriteByte { cell, data })
            .to_vec(),
        RawCommand::WriteWord { cell, .. } => [0, 1, 0x0100]
            .map(|data| RawCommand::WriteWord { cell, data })
            .to_vec(),
        RawCommand::And { low, .. } => vec![RawCommand::And { low, data: 0 }],
        RawCommand::Or { low, .. } => vec![RawCommand::Or { low, data: 1 }],
        RawCommand::WriteIo { .. } => vec![RawCommand::WriteIo { code: 0 }],
        _ => Vec::new(),
    }
}

/// The same conversation on a smaller ring: commands to removed drives go to the last drive.
fn on_ring(subject: &Subject, drives: u8) -> Subject {
    let old = subject.case.drives;
    let ring = subject.case.ring();
    let map = |drive: u8| drive.min(drives - 1);
    let mut new = subject.clone();
    new.case.drives = drives;
    for act in &mut new.case.acts {
        match &mut act.what {
            ActKind::Power { drive, .. } => *drive = map(*drive),
            ActKind::Talk(talk) => {
                if let To::Drive(drive) = &mut talk.to {
                    *drive = map(*drive);
                }
            }
            _ => {}
        }
        for damage in &mut act.damages {
            // The link in front of the same drive.
            damage.link = match old.checked_sub(1 + damage.link) {
                Some(drive) => drives - 1 - map(drive),
                None => drives,
            };
        }
    }
    let planted = new.setup.deviates.iter_mut();
    for planted in planted.filter(|planted| planted.ring == ring) {
        planted.drive = map(planted.drive);
    }
    new
}
