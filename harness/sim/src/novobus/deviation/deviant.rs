//! A drive that deviates.

use super::how::{Deviation, How, Moment};
use super::proxy::{Counts, Proxy, monitors, seen};
use crate::novobus::device::Device;
use crate::novobus::drive::Drive;
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::{BusEnd, Deadline, Place, Reaction};
use harness_proto::novobus::check_sequence::{SEQUENCE, SequenceProgress, SequenceWatch};
use harness_proto::novobus::command::Field;
use harness_proto::novobus::error::BusError;
use harness_proto::novobus::error_mode::Marks;
use harness_proto::time::{Instant, Span};
use std::collections::VecDeque;

/// Maximum number of bytes that a drive holds back; further bytes are lost.
const MOST_HELD: usize = 64;

/// A drive with deviations around it.
#[derive(Clone, Debug)]
pub struct Deviant {
    drive: Drive,
    deviations: Vec<&'static Deviation>,
    /// Bytes that go out by themselves, and when.
    held: VecDeque<(Deadline, u8)>,
    nth: u64,
    zeros: u8,
    watch: SequenceWatch,
    /// How many bytes of a check sequence have come in their order since the drive went into the error mode.
    in_order: usize,
    counts: Counts,
    /// The bus end as it was before the byte for which it went into the error mode.
    before_the_error: Option<Box<BusEnd>>,
}

impl Deviant {
    /// A drive as it is after power-up, with these deviations.
    #[must_use]
    pub fn new(drive: Drive, deviations: Vec<&'static Deviation>) -> Self {
        let mut deviant = Self {
            drive,
            deviations,
            held: VecDeque::new(),
            nth: 0,
            zeros: 0,
            watch: SequenceWatch::default(),
            in_order: 0,
            counts: Counts::default(),
            before_the_error: None,
        };
        deviant.amend();
        deviant
    }

    /// The drive inside.
    #[must_use]
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The drive inside.
    pub fn drive_mut(&mut self) -> &mut Drive {
        &mut self.drive
    }

    /// The contents of a cell as an outside reader sees it.
    #[must_use]
    pub fn peek(&self, address: u16) -> u8 {
        let cells = self.drive.cells();
        seen(&self.deviations, &mut |a| cells.peek(a), address)
    }

    fn amend(&mut self) {
        let (bus_end, _) = self.drive.parts();
        for deviation in &self.deviations {
            if let How::Amends(amend) = deviation.injection.how {
                bus_end.amend(amend);
            }
        }
    }

    /// Runs the bus end on the memory as the deviations show it.
    fn with<T>(&mut self, place: Place, work: impl FnOnce(&mut BusEnd, &mut Proxy<'_>) -> T) -> T {
        let (bus_end, memory) = self.drive.parts();
        let left = bus_end.remaining().map_or(0, |left| left.net_bytes);
        let mut proxy = Proxy {
            memory,
            deviations: &self.deviations,
            place,
            last: left <= 1,
            counts: self.counts,
        };
        let done = work(bus_end, &mut proxy);
        self.drive.bus_has_worked();
        done
    }

    fn place(&mut self) -> Place {
        self.drive.parts().0.place()
    }

    /// What it hears.
    fn heard(&self, moment: &Moment) -> Received {
        let mut moment = *moment;
        for deviation in &self.deviations {
            if let How::Hears(hears) | How::Mistakes(hears, _) = deviation.injection.how {
                moment.received = hears(&moment);
            }
        }
        moment.received
    }

    /// What it says, and whether twice.
    fn said(&self, moment: &Moment) -> (Option<u8>, bool) {
        let mut twice = false;
        let mut byte = moment.step.byte;
        for deviation in &self.deviations {
            byte = match (&deviation.injection.how, byte) {
                (How::Says(says) | How::Mistakes(_, says), Some(byte)) => says(moment, byte),
                _ => byte,
            };
            if let How::Repeats(repeats) = deviation.injection.how {
                twice |= repeats(moment);
            }
        }
        (byte, twice)
    }

    fn act(&mut self, moment: &Moment) {
        for i in 0..self.deviations.len() {
            match self.deviations[i].injection.how {
                How::Acts(acts) => {
                    acts(moment, self.drive.parts().1);
                    self.drive.bus_has_worked();
                }
                How::Leaves(leaves) => {
                    let (bus_end, _) = self.drive.parts();
                    if bus_end.in_error() && leaves(moment) {
                        bus_end.recover();
                    }
                }
                How::Forgets(forgets) if forgets(moment) => self.drive.parts().0.forget_command(),
                How::Keeps if moment.step.marks.contains(Marks::RECOVERED) => {
                    if let Some(before) = self.before_the_error.take() {
                        self.drive.parts().0.keep_command_of(&before);
                    }
                }
                _ => {}
            }
        }
    }

    /// Counts a command that has been executed.
    fn count(&mut self, moment: &Moment) {
        let Some(command) = moment.parameter() else {
            return;
        };
        let executed =
            command.field == Field::Check && !moment.step.marks.contains(Marks::DETECTED);
        self.counts.reads += u64::from(executed && command.kind.reads());
        self.counts.writes +=
            u64::from(executed && !command.kind.reads() && command.kind.width() > 0);
    }

    /// What it says after a look at its cells.
    fn told(&mut self, moment: &Moment, mut byte: Option<u8>) -> Option<u8> {
        for deviation in &self.deviations {
            if let (How::Tells(tells), Some(said)) = (&deviation.injection.how, byte) {
                byte = Some(tells(moment, self.drive.parts().1, said));
            }
        }
        byte
    }

    /// Puts a byte behind those that are held back, or lets it go where there is nothing to wait for.
    fn send(
        &mut self,
        now: Instant,
        byte: Option<u8>,
        twice: bool,
        moment: Option<&Moment>,
    ) -> Option<u8> {
        let late = self.deviations.iter().find_map(|d| match d.injection.how {
            How::Late(late) => Some(late),
            How::LateAt(late) => moment.and_then(late),
            _ => None,
        });
        let due = late.map_or(Deadline::LineFree(now), |late| Deadline::At(now + late));
        let copies = if twice { 2 } else { 1 };
        let room = MOST_HELD.saturating_sub(self.held.len());
        if let Some(byte) = byte {
            self.held
                .extend(std::iter::repeat_n((due, byte), room.min(copies)));
        }
        let waits = |held: &(Deadline, u8)| matches!(held.0, Deadline::At(at) if at > now);
        if late.is_some() || self.held.front().is_some_and(waits) {
            return None;
        }
        self.held.pop_front().map(|(_, byte)| byte)
    }

    /// Replaces values in cells before the program reads them, and returns what must be restored: the address,
    /// whether it is a word, the old value and the new value.
    fn hold(&mut self) -> Vec<(u16, bool, u16, u16)> {
        let mut kept = Vec::new();
        for deviation in &self.deviations {
            let How::Holds(held) = deviation.injection.how else {
                continue;
            };
            let cells = self.drive.cells_mut();
            for cell in held {
                let there = read(cells, cell.address, cell.word);
                let found = (cell.value)(there);
                write(cells, cell.address, cell.word, found);
                kept.push((cell.address, cell.word, there, found));
            }
        }
        kept
    }
}

fn read(cells: &crate::novobus::cells::Cells, address: u16, word: bool) -> u16 {
    if word {
        cells.word(address)
    } else {
        u16::from(cells.byte(address))
    }
}

fn write(cells: &mut crate::novobus::cells::Cells, address: u16, word: bool, value: u16) {
    let [_, low] = value.to_be_bytes();
    if word {
        cells.put_word(address, value);
    } else {
        cells.put(address, low);
    }
}

impl Device for Deviant {
    fn receive(&mut self, now: Instant, received: Received) -> Reaction {
        self.nth += 1;
        let zeros_before = self.zeros;
        self.zeros = if received.is(0) {
            self.zeros.saturating_add(1)
        } else {
            0
        };
        let matched = self.watch.matched();
        let progress = self.watch.see(received.byte, received.error.is_none());
        let begun = self.in_order;
        if !self.drive.in_error() {
            self.in_order = 0;
        } else if SEQUENCE.get(begun).is_some_and(|due| received.is(*due)) {
            self.in_order += 1;
        }
        let mut moment = Moment {
            place: self.place(),
            received,
            increments: self.drive.parts().0.increments(),
            nth: self.nth,
            zeros: self.zeros,
            zeros_before,
            matched,
            in_order: begun < self.in_order && self.in_order == SEQUENCE.len(),
            sequence: progress == SequenceProgress::Complete,
            step: Reaction::default(),
        };
        let heard = self.heard(&moment);
        let keeps = self
            .deviations
            .iter()
            .any(|d| matches!(d.injection.how, How::Keeps));
        let before = keeps.then(|| Box::new(self.drive.parts().0.clone()));
        moment.step = self.with(moment.place, |bus_end, memory| {
            bus_end.receive(now, heard, memory)
        });
        if moment.step.marks.contains(Marks::DETECTED) {
            self.before_the_error = before;
        }
        self.act(&moment);
        self.count(&moment);
        let (byte, twice) = self.said(&moment);
        let byte = self.told(&moment, byte);
        Reaction {
            byte: self.send(now, byte, twice, Some(&moment)),
            marks: moment.step.marks,
        }
    }

    fn deadline(&self) -> Option<Deadline> {
        let waits = |due: &Deadline| {
            !self
                .deviations
                .iter()
                .any(|d| matches!(d.injection.how, How::Waits(waits) if waits(*due)))
        };
        let (bus_end, memory) = self.drive.inside();
        let monitored = || monitors(&self.deviations).unwrap_or_else(|| memory.monitors_time_out());
        let due = bus_end.due(monitored).filter(waits);
        let held = self.held.front().map(|&(due, _)| due);
        match (due, held) {
            (Some(Deadline::At(due)), Some(Deadline::At(held))) => {
                Some(Deadline::At(due.min(held)))
            }
            (due, None) => due,
            (_, held) => held,
        }
    }

    fn handle_deadline(&mut self, now: Instant) -> Reaction {
        let due = match self.held.front() {
            Some((Deadline::At(at), _)) => *at <= now,
            Some((Deadline::LineFree(_), _)) => true,
            None => false,
        };
        if due {
            return Reaction {
                byte: self.held.pop_front().map(|(_, byte)| byte),
                ..Reaction::default()
            };
        }
        let place = self.place();
        let step = self.with(place, |bus_end, memory| {
            bus_end.handle_deadline(now, memory)
        });
        Reaction {
            byte: self.send(now, step.byte, false, None),
            marks: step.marks,
        }
    }

    fn advance(&mut self, now: Instant) {
        let kept = self.hold();
        self.drive.advance(now);
        if kept.is_empty() {
            return;
        }
        let cells = self.drive.cells_mut();
        for (address, word, there, found) in kept {
            // What the program itself has changed stays.
            if read(cells, address, word) == found {
                write(cells, address, word, there);
            }
        }
    }

    fn power_on(&mut self, now: Instant) {
        self.drive.power_on(now);
        self.amend();
        self.held.clear();
        self.nth = 0;
        self.zeros = 0;
        self.watch = SequenceWatch::default();
        self.in_order = 0;
        self.counts = Counts::default();
        self.before_the_error = None;
    }

    fn in_error(&self) -> bool {
        self.drive.in_error()
    }

    fn cause(&self) -> Option<BusError> {
        self.drive.cause()
    }

    fn head_start(&self) -> Span {
        let early = self.deviations.iter().find_map(|d| match d.injection.how {
            How::Early(early) => Some(early),
            _ => None,
        });
        early.unwrap_or(Span::ZERO)
    }
}
