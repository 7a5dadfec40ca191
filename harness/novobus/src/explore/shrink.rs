//! Shrinks a finding: removes what is not needed to reproduce it and simplifies the rest.
//!
//! Every accepted step removes or lowers something, so [`Case::measure`] falls strictly and shrinking ends. The order of the steps is
//! fixed, so the result is reproducible. On hardware the runs dominate the cost, so the steps that remove most come first: everything
//! after the differing byte, then acts, parts of acts, faults, drives, silence and values.

use super::case::{Act, ActKind, Case, Harm, MOST_NET, OtherRing, Talk, To};
use super::oracle::Difference;
use super::order::{CommandSent, RawCommand};
use super::setup::RingSetup;
use harness_bench::explore::ExploreError;
use harness_proto::novobus::memory::RAM;
use std::collections::BTreeSet;

/// What is shrunk: a conversation with a ring.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Subject {
    /// The conversation.
    pub case: Case,
    /// What its rings are made of.
    pub setup: RingSetup,
}

/// The result of shrinking.
#[derive(Clone, Debug)]
pub(crate) struct Shrunk {
    /// The smallest subject found.
    pub subject: Subject,
    /// How its ring differs from the expected behaviour.
    pub difference: Difference,
    /// Number of runs.
    pub runs: u32,
    /// Whether nothing more could be removed; false if the limit of runs was reached first.
    pub complete: bool,
}

/// Runs a subject on a ring and returns how the ring differs from the expected behaviour, or `None` if it does not.
pub(crate) type Asking<'a> = dyn FnMut(&Subject) -> Result<Option<Difference>, ExploreError> + 'a;

/// Shrinks a subject in at most `most_runs` runs. The result is a finding of the same kind as `difference`.
///
/// # Errors
/// A run is not possible.
pub(crate) fn shrink(
    subject: Subject,
    difference: Difference,
    most_runs: u32,
    ask: &mut Asking<'_>,
) -> Result<Shrunk, ExploreError> {
    let mut shrinker = Shrinker {
        best: subject,
        first: difference.clone(),
        difference,
        tried: BTreeSet::new(),
        runs: 0,
        most_runs,
        ask,
    };
    let mut complete = false;
    while !shrinker.is_spent() {
        let before = shrinker.best.case.measure();
        shrinker.pass()?;
        if shrinker.best.case.measure() == before {
            complete = !shrinker.is_spent();
            break;
        }
    }
    Ok(Shrunk {
        subject: shrinker.best,
        difference: shrinker.difference,
        runs: shrinker.runs,
        complete,
    })
}

/// The first cell of the RAM.
const FIRST_CELL: u16 = *RAM.start();

struct Shrinker<'a, 'b> {
    best: Subject,
    first: Difference,
    difference: Difference,
    /// Subjects already run.
    tried: BTreeSet<String>,
    runs: u32,
    most_runs: u32,
    ask: &'a mut Asking<'b>,
}

impl Shrinker<'_, '_> {
    fn is_spent(&self) -> bool {
        self.runs >= self.most_runs
    }

    /// Runs a smaller candidate and accepts it if it is a finding of the same kind.
    fn offer(&mut self, candidate: Subject) -> Result<bool, ExploreError> {
        let smaller = candidate.case.measure() < self.best.case.measure();
        if !smaller || candidate.case.acts.is_empty() || self.is_spent() {
            return Ok(false);
        }
        if !self.tried.insert(format!("{candidate:?}")) {
            return Ok(false);
        }
        self.runs += 1;
        match (self.ask)(&candidate)? {
            Some(difference) if difference.is_like(&self.first) => {
                self.difference = difference;
                self.best = candidate;
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Offers the best one with a change of its case.
    fn change(&mut self, change: impl FnOnce(&mut Case)) -> Result<bool, ExploreError> {
        let mut candidate = self.best.clone();
        change(&mut candidate.case);
        self.offer(candidate)
    }

    /// Offers it with a change of an act.
    fn change_act(
        &mut self,
        at: usize,
        change: impl FnOnce(&mut Act),
    ) -> Result<bool, ExploreError> {
        self.change(|case| {
            if let Some(act) = case.acts.get_mut(at) {
                change(act);
            }
        })
    }

    /// Offers it with a change of a talk.
    fn change_talk(
        &mut self,
        at: usize,
        change: impl FnOnce(&mut Talk),
    ) -> Result<bool, ExploreError> {
        self.change_act(at, |act| {
            if let ActKind::Talk(talk) = &mut act.what {
                change(talk);
            }
        })
    }

    fn pass(&mut self) -> Result<(), ExploreError> {
        self.cut_behind()?;
        self.drop_acts()?;
        self.one_ring()?;
        self.smaller_ring()?;
        self.lower_cells()?;
        let mut at = 0;
        while at < self.best.case.acts.len() {
            self.damages(at)?;
            self.parts(at)?;
            self.values(at)?;
            at += 1;
        }
        Ok(())
    }

    /// Cuts the case after the differing byte, or, if the finding is lost by that, behind the act of this byte.
    fn cut_behind(&mut self) -> Result<(), ExploreError> {
        let Some(byte) = self.difference.byte else {
            return Ok(());
        };
        let drives = self.best.case.drives;
        let mut before = 0;
        let mut found = None;
        for (at, act) in self.best.case.acts.iter().enumerate() {
            let length = act.length(drives);
            if before + length >= byte {
                found = Some((at, byte - before));
                break;
            }
            before += length;
        }
        let Some((at, inside)) = found else {
            return Ok(());
        };
        // The act may have more commands behind the one that is answered.
        let shortened = self.change(|case| {
            case.acts.truncate(at + 1);
            if let Some(act) = case.acts.last_mut() {
                shorten(&mut act.what, inside);
            }
        })?;
        if !shortened {
            self.change(|case| case.acts.truncate(at + 1))?;
        }
        Ok(())
    }

    /// Leaves out acts: long runs of them first.
    fn drop_acts(&mut self) -> Result<(), ExploreError> {
        let mut length = self.best.case.acts.len().saturating_sub(1);
        while length > 0 {
            let mut from = 0;
            while from < self.best.case.acts.len() {
                let to = (from + length).min(self.best.case.acts.len());
                let dropped = self.change(|case| {
                    case.acts.drain(from..to);
                })?;
                if !dropped {
                    from += length;
                }
            }
            length = (length / 2).min(self.best.case.acts.len());
        }
        Ok(())
    }

    /// Without the other ring of the bench, or with the smallest there is.
    fn one_ring(&mut self) -> Result<(), ExploreError> {
        let ring = self.best.case.ring();
        let smallest = match self.best.case.beside {
            None => return Ok(()),
            Some(OtherRing::First(_)) => OtherRing::First(1),
            Some(OtherRing::Second(_)) => OtherRing::Second(1),
        };
        let mut alone = self.best.clone();
        alone.case.beside = None;
        alone.setup = alone.setup.of_ring(ring);
        if !self.offer(alone)? {
            self.change(|case| case.beside = Some(smallest))?;
        }
        Ok(())
    }

    /// Tries smaller rings, the smallest first.
    fn smaller_ring(&mut self) -> Result<(), ExploreError> {
        for drives in 1..self.best.case.drives {
            if self.offer(on_ring(&self.best, drives))? {
                break;
            }
        }
        Ok(())
    }

    /// Puts the first cell of the RAM (ND21 10.1) in place of another, in all commands: what is written is read again.
    fn lower_cells(&mut self) -> Result<(), ExploreError> {
        let cells: BTreeSet<u16> = self
            .best
            .case
            .orders()
            .filter_map(|o| o.command.cell())
            .collect();
        for cell in cells.into_iter().filter(|cell| *cell > FIRST_CELL) {
            self.change(|case| {
                for act in &mut case.acts {
                    if let ActKind::Talk(talk) = &mut act.what {
                        let orders = talk.orders.iter_mut();
                        orders.for_each(|order| order.command = order.command.at(cell, FIRST_CELL));
                    }
                }
            })?;
        }
        Ok(())
    }

    /// Leaves out faults, and makes them single bits.
    fn damages(&mut self, at: usize) -> Result<(), ExploreError> {
        let mut index = 0;
        while let Some(damage) = self
            .best
            .case
            .acts
            .get(at)
            .and_then(|a| a.damages.get(index))
        {
            let damage = *damage;
            let dropped = self.change_act(at, |act| {
                act.damages.remove(index);
            })?;
            if dropped {
                continue;
            }
            let flip = |data, parity, stop| Harm::Flip { data, parity, stop };
            let mut simpler = vec![flip(0, true, false), flip(1, false, false)];
            match damage.harm {
                Harm::Flip { stop: true, .. } => simpler.push(flip(0, false, true)),
                Harm::Delay(us) => simpler.extend([Harm::Drop, Harm::Delay(us / 2)]),
                Harm::Break(_) => simpler.push(Harm::Break(200)),
                Harm::Replace(_) => simpler.extend([Harm::Drop, Harm::Replace(0)]),
                Harm::Insert(_) => simpler.extend([Harm::Duplicate, Harm::Insert(0)]),
                _ => {}
            }
            for harm in simpler {
                let weight = self.best.case.acts[at].damages[index].harm.weight();
                if harm.weight() < weight
                    && self.change_act(at, |act| act.damages[index].harm = harm)?
                {
                    break;
                }
            }
            index += 1;
        }
        Ok(())
    }

    /// Leaves out parts of an act.
    fn parts(&mut self, at: usize) -> Result<(), ExploreError> {
        let Some(act) = self.best.case.acts.get(at).cloned() else {
            return Ok(());
        };
        match act.what {
            ActKind::Synco(count) | ActKind::Pause(count) | ActKind::Zeros(count) => {
                self.lowest(at, usize::from(count))
            }
            ActKind::Wait(ms) => {
                // Just beyond the times of ND21 9.9.
                let shorter = [1, 11, 21, ms / 2].into_iter();
                for ms in shorter.filter(|shorter| *shorter < ms) {
                    if self.change_act(at, |act| act.what = ActKind::Wait(ms))? {
                        break;
                    }
                }
                Ok(())
            }
            ActKind::Bytes(bytes) => self.bytes(at, bytes.len()),
            ActKind::Recover => {
                self.change_act(at, |act| act.what = ActKind::Sequence)?;
                Ok(())
            }
            ActKind::Talk(talk) => self.talk(at, &talk),
            ActKind::Sequence | ActKind::Power { .. } => Ok(()),
        }
    }

    /// Lowers a number of equal bytes.
    fn lowest(&mut self, at: usize, count: usize) -> Result<(), ExploreError> {
        let (mut too_few, mut enough) = (0, count);
        // One less first: after a cut, usually no more than that can be removed.
        let mut next = count.saturating_sub(1);
        while enough - too_few > 1 {
            if self.change_act(at, |act| shorten(&mut act.what, next))? {
                enough = next;
            } else {
                too_few = next;
            }
            next = (too_few + enough) / 2;
        }
        Ok(())
    }

    fn bytes(&mut self, at: usize, count: usize) -> Result<(), ExploreError> {
        let mut length = count / 2;
        while length > 0 {
            let mut from = 0;
            loop {
                let now = self
                    .best
                    .case
                    .acts
                    .get(at)
                    .map_or(0, |act| act.length(self.best.case.drives));
                if from + length > now || now <= length {
                    break;
                }
                let dropped = self.change_act(at, |act| {
                    if let ActKind::Bytes(bytes) = &mut act.what {
                        bytes.drain(from..from + length);
                    }
                })?;
                if !dropped {
                    from += length;
                }
            }
            length /= 2;
        }
        Ok(())
    }

    fn talk(&mut self, at: usize, talk: &Talk) -> Result<(), ExploreError> {
        if talk.process_data.is_some() {
            self.change_talk(at, |talk| talk.process_data = None)?;
        }
        if talk.room < MOST_NET {
            self.change_talk(at, |talk| talk.room = MOST_NET)?;
        }
        let mut index = 0;
        while let Some(order) = self.order(at, index) {
            let dropped = self.change_talk(at, |talk| {
                talk.orders.remove(index);
            })?;
            if dropped {
                continue;
            }
            if order.spoil.is_some() {
                self.change_talk(at, |talk| talk.orders[index].spoil = None)?;
            }
            for command in shorter(order.command) {
                if self.change_talk(at, |talk| talk.orders[index].command = command)? {
                    break;
                }
            }
            index += 1;
        }
        Ok(())
    }

    fn order(&self, at: usize, index: usize) -> Option<CommandSent> {
        match &self.best.case.acts.get(at)?.what {
            ActKind::Talk(talk) => talk.orders.get(index).cloned(),
            _ => None,
        }
    }

    /// Lowers values toward zero.
    fn values(&mut self, at: usize) -> Result<(), ExploreError> {
        let Some(ActKind::Talk(talk)) = self.best.case.acts.get(at).map(|act| act.what.clone())
        else {
            return Ok(());
        };
        if talk.process_data.is_some_and(|data| data > 1) {
            for data in [0, 1] {
                if self.change_talk(at, |talk| talk.process_data = Some(data))? {
                    break;
                }
            }
        }
        for index in 0..talk.orders.len() {
            let Some(order) = self.order(at, index) else {
                break;
            };
            for command in lower(order.command) {
                if self.change_talk(at, |talk| talk.orders[index].command = command)? {
                    break;
                }
            }
            if order.spoil.is_some_and(|spoil| spoil.byte > 0) {
                self.change_talk(at, |talk| {
                    if let Some(spoil) = &mut talk.orders[index].spoil {
                        spoil.byte = 0;
                    }
                })?;
            }
        }
        Ok(())
    }
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
        RawCommand::ReadWord { cell } => vec![RawCommand::ReadByte { cell }],
        RawCommand::ReadLong { cell } => {
            vec![RawCommand::ReadByte { cell }, RawCommand::ReadWord { cell }]
        }
        RawCommand::WriteByte { cell, .. } => vec![RawCommand::ReadByte { cell }],
        RawCommand::WriteWord { cell, data } => vec![
            RawCommand::ReadByte { cell },
            RawCommand::WriteByte {
                cell,
                data: data as u8,
            },
        ],
        _ => Vec::new(),
    }
}

/// The same command with lower values: the data 0 or 1.
fn lower(command: RawCommand) -> Vec<RawCommand> {
    match command {
        RawCommand::WriteByte { cell, data } => {
            let data = [0, 1].into_iter().filter(|new| *new < data);
            data.map(|data| RawCommand::WriteByte { cell, data })
                .collect()
        }
        RawCommand::WriteWord { cell, data } => {
            let data = [0, 1, 0x0100].into_iter().filter(|new| *new < data);
            data.map(|data| RawCommand::WriteWord { cell, data })
                .collect()
        }
        RawCommand::And { low, data } if data > 0 => vec![RawCommand::And { low, data: 0 }],
        RawCommand::Or { low, data } if data > 1 => vec![RawCommand::Or { low, data: 1 }],
        RawCommand::WriteIo { code } if code > 0 => vec![RawCommand::WriteIo { code: 0 }],
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
