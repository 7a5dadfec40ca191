//! The jobs that a master holds: a fixed number of slots in two linked lists, one of all jobs and one for each
//! drive, both in order of submission. Submitting and sending need no search, and the number of slots is bounded.

use super::super::address::RingSize;
use super::super::checksum::Checksum;
use super::super::command::{Kind, Layout, Reply};
use super::super::properties::ReadLongAnswer;
use super::in_flight::JobSlot;
use super::job::{Job, JobId, ReadData};
use alloc::vec;
use alloc::vec::Vec;

/// The longest command (ND21 9.5).
const MOST_BYTES: usize = 6;

/// A job with all that is known about it.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) id: JobId,
    pub(super) drive: u8,
    pub(super) kind: Kind,
    pub(super) may_repeat: bool,
    layout: &'static Layout,
    bytes: [u8; MOST_BYTES],
    /// How many bytes of the command have been composed; all of them will be sent.
    sent: u8,
    /// How many bytes of the answer have come back right.
    returned: u8,
    answer_sum: Checksum,
    pub(super) data: ReadData,
    /// All of the command was sent before, and its answer was lost.
    pub(super) perhaps_run: bool,
    before: Option<JobSlot>,
    behind: Option<JobSlot>,
    behind_in_drive: Option<JobSlot>,
}

impl Entry {
    fn new(id: JobId, job: &Job, read_long: ReadLongAnswer) -> Self {
        let layout = job.command.layout(read_long);
        let mut bytes = [0; MOST_BYTES];
        for (place, byte) in bytes.iter_mut().zip(job.command.encode()) {
            *place = byte;
        }
        Self {
            id,
            drive: job.drive,
            kind: layout.kind,
            may_repeat: job.may_repeat(),
            layout,
            bytes,
            sent: 0,
            returned: 0,
            answer_sum: Checksum::EMPTY,
            data: ReadData::default(),
            perhaps_run: false,
            before: None,
            behind: None,
            behind_in_drive: None,
        }
    }

    /// How many bytes of the command are still to be composed.
    pub(super) fn left(&self) -> usize {
        self.layout.length() - usize::from(self.sent)
    }

    /// The next job in the order in which all came.
    pub(super) fn behind(&self) -> Option<JobSlot> {
        self.behind
    }

    /// The next job of the same drive.
    pub(super) fn behind_in_drive(&self) -> Option<JobSlot> {
        self.behind_in_drive
    }

    /// Whether a byte of it has been sent.
    pub(super) fn is_begun(&self) -> bool {
        self.sent > 0
    }

    /// Composes the next byte: what goes out, and what must come back where that is known beforehand.
    pub(super) fn compose(&mut self) -> Option<(u8, Option<u8>)> {
        let index = usize::from(self.sent);
        let byte = *self.bytes.get(index).filter(|_| self.left() > 0)?;
        self.sent += 1;
        let back = match self.reply(index) {
            Reply::Echo => Some(byte),
            Reply::Check if !self.kind.reads() => {
                Some(Checksum::over(&self.bytes[..index]).minus())
            }
            Reply::Check | Reply::Data(_) => None,
        };
        Some((byte, back))
    }

    fn reply(&self, index: usize) -> Reply {
        let answer = self.layout.answer;
        index
            .checked_sub(1)
            .and_then(|i| answer.get(i).copied())
            .unwrap_or(Reply::Echo)
    }

    /// Takes the next byte of the answer; false where it is wrong. Echoes have been compared already.
    pub(super) fn take(&mut self, byte: u8) -> bool {
        let right = match self.reply(usize::from(self.returned)) {
            Reply::Echo => true,
            Reply::Check => byte == self.answer_sum.minus(),
            Reply::Data(i) => {
                self.data.bytes[usize::from(i)] = byte;
                self.data.known |= 1 << i;
                true
            }
        };
        self.returned += 1;
        self.answer_sum = self.answer_sum.with(byte);
        right
    }

    /// Whether all of the answer is there.
    pub(super) fn is_answered(&self) -> bool {
        usize::from(self.returned) == self.layout.length()
    }

    /// Whether the answer ends with the drive's checking byte.
    pub(super) fn is_checked(&self) -> bool {
        self.layout.answer.last() == Some(&Reply::Check)
    }

    pub(super) fn read(&self) -> ReadData {
        ReadData {
            width: self.kind.width(),
            ..self.data
        }
    }

    /// Begins from the beginning.
    fn rewind(&mut self) {
        self.perhaps_run |= self.left() == 0;
        self.sent = 0;
        self.returned = 0;
        self.answer_sum = Checksum::EMPTY;
        self.data = ReadData::default();
    }
}

/// A list of jobs by its two ends.
#[derive(Clone, Copy, Debug, Default)]
struct List {
    first: Option<JobSlot>,
    last: Option<JobSlot>,
}

/// The jobs.
#[derive(Clone, Debug)]
pub(super) struct Store {
    /// Grows up to `capacity` with the number of jobs held at once: most masters hold few.
    entries: Vec<Option<Entry>>,
    capacity: u16,
    /// Which of them are empty.
    free: Vec<JobSlot>,
    next_id: u64,
    all: List,
    drives: Vec<List>,
}

impl Store {
    pub(super) fn new(ring: RingSize, capacity: u16) -> Self {
        Self {
            entries: Vec::new(),
            capacity,
            free: Vec::new(),
            next_id: 0,
            all: List::default(),
            drives: vec![List::default(); usize::from(ring.drives())],
        }
    }

    /// How many jobs are held.
    pub(super) fn len(&self) -> usize {
        self.entries.len() - self.free.len()
    }

    /// Adds a job after the others; `None` where there is no room.
    pub(super) fn add(&mut self, job: &Job, read_long: ReadLongAnswer) -> Option<JobId> {
        if self.free.is_empty() && self.entries.len() < usize::from(self.capacity) {
            self.free.push(JobSlot::try_from(self.entries.len()).ok()?);
            self.entries.push(None);
        }
        let slot = self.free.pop()?;
        let id = JobId(self.next_id);
        self.next_id += 1;
        self.entries[usize::from(slot)] = Some(Entry::new(id, job, read_long));
        self.link(slot);
        Some(id)
    }

    pub(super) fn get(&self, slot: JobSlot) -> Option<&Entry> {
        self.entries.get(usize::from(slot))?.as_ref()
    }

    pub(super) fn get_mut(&mut self, slot: JobSlot) -> Option<&mut Entry> {
        self.entries.get_mut(usize::from(slot))?.as_mut()
    }

    /// The first job that has bytes to be composed.
    pub(super) fn first(&self) -> Option<JobSlot> {
        self.all.first
    }

    /// The first such job of a drive.
    pub(super) fn first_of(&self, drive: u8) -> Option<JobSlot> {
        self.drives.get(usize::from(drive))?.first
    }

    fn link(&mut self, slot: JobSlot) {
        let before = self.all.last.replace(slot);
        match before.and_then(|before| self.get_mut(before)) {
            Some(before) => before.behind = Some(slot),
            None => self.all.first = Some(slot),
        }
        let Some(entry) = self.get_mut(slot) else {
            return;
        };
        entry.before = before;
        entry.behind = None;
        entry.behind_in_drive = None;
        let drive = usize::from(entry.drive);
        let before = self.drives[drive].last.replace(slot);
        match before.and_then(|before| self.get_mut(before)) {
            Some(before) => before.behind_in_drive = Some(slot),
            None => self.drives[drive].first = Some(slot),
        }
    }

    /// Takes a job that is composed whole out of both orders; it is the first one of its drive.
    pub(super) fn unlink(&mut self, slot: JobSlot) {
        let Some(entry) = self.get(slot) else { return };
        let (before, behind) = (entry.before, entry.behind);
        let (drive, behind_in_drive) = (usize::from(entry.drive), entry.behind_in_drive);
        match before.and_then(|before| self.get_mut(before)) {
            Some(before) => before.behind = behind,
            None => self.all.first = behind,
        }
        match behind.and_then(|behind| self.get_mut(behind)) {
            Some(behind) => behind.before = before,
            None => self.all.last = before,
        }
        let list = &mut self.drives[drive];
        list.first = behind_in_drive;
        if behind_in_drive.is_none() {
            list.last = None;
        }
    }

    /// Removes a job that is in neither list any more.
    pub(super) fn remove(&mut self, slot: JobSlot) -> Option<Entry> {
        let entry = self.entries.get_mut(usize::from(slot))?.take()?;
        self.free.push(slot);
        Some(entry)
    }

    /// Removes all jobs, oldest first, and adds those again, from their beginning, for which `keep` returns
    /// true. Returns how many of these had been begun.
    pub(super) fn restart(&mut self, mut keep: impl FnMut(&Entry) -> bool) -> u64 {
        let mut slots: Vec<(JobId, JobSlot)> = (0..)
            .zip(&self.entries)
            .filter_map(|(slot, entry)| Some((entry.as_ref()?.id, slot)))
            .collect();
        slots.sort_unstable();
        self.all = List::default();
        self.drives.fill(List::default());
        let mut begun = 0;
        for (_, slot) in slots {
            let Some(entry) = self.get_mut(slot) else {
                continue;
            };
            if keep(entry) {
                begun += u64::from(entry.is_begun());
                entry.rewind();
                self.link(slot);
            } else {
                self.remove(slot);
            }
        }
        begun
    }
}
