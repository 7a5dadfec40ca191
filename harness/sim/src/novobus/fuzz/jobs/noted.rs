//! The features of the target `jobs`: events at a master, its reactions, and the states of its drives.

use super::super::words;
use super::work::{JobOrder, Work};
use crate::fault::LinkFault;
use crate::fuzz::{Feature, Notebook};
use crate::novobus::counted::Counted;
use crate::novobus::ring::Ring;
use crate::novobus::transitions::Transition;
use harness_proto::line::Received;
use harness_proto::novobus::command::Kind;
use harness_proto::novobus::master::{Event, JobId, Phase};
use std::collections::BTreeMap;

/// An observer.
pub(super) struct Watch<'a, 'n> {
    work: &'a Work,
    notes: &'a mut Notebook<'n>,
    given: BTreeMap<JobId, (Kind, Phase)>,
    disturbed: bool,
    steps: words::Steps,
}

impl<'a, 'n> Watch<'a, 'n> {
    pub(super) fn new(work: &'a Work, notes: &'a mut Notebook<'n>) -> Self {
        Self {
            work,
            notes,
            given: BTreeMap::new(),
            disturbed: false,
            steps: words::Steps::default(),
        }
    }

    pub(super) fn given(&mut self, id: JobId, order: &JobOrder, phase: Phase) {
        if self.notes.wanted() {
            self.given.insert(id, (order.job.command.kind(), phase));
        }
    }

    pub(super) fn step(&mut self, before: Phase, last: Option<Received>, behind: Phase) {
        let heard = words::heard(last, None);
        self.steps.note(self.notes, before, heard, behind);
    }

    pub(super) fn told(&mut self, event: &Event) {
        let job = match event {
            Event::Ended { id, .. } => self.given.remove(id),
            _ => None,
        };
        words::told(self.notes, event, job);
        if let Event::Disturbed { fault, .. } = event
            && !std::mem::replace(&mut self.disturbed, true)
        {
            self.first(words::fault(*fault));
        }
    }

    /// How the master reports a single fault.
    fn first(&mut self, told: &'static str) {
        let [fault] = self.work.faults.as_slice() else {
            return;
        };
        let link = match fault.link {
            0 => "the first link",
            last if last == usize::from(self.work.drives) => "the last link",
            _ => "a link between drives",
        };
        let what = match fault.what {
            LinkFault::Flip(_) => "a bit inverted",
            LinkFault::Replace(_) => "another byte",
            LinkFault::Drop => "a byte lost",
            LinkFault::Duplicate => "a byte doubled",
            LinkFault::Delay(_) => "a byte late",
            LinkFault::Cut => "a cut",
            _ => "another fault",
        };
        let place = format!("{what} on {link}");
        self.notes
            .note(|| Feature::new("9.7", place, format!("told as {told}")));
    }

    /// The states of the drives' ends of the bus; what happens in each is for the targets that feed drives raw bytes.
    pub(super) fn drives(&mut self, ring: &Ring<Counted>) {
        for drive in (0..self.work.drives).filter_map(|k| ring.drive(k)) {
            let Some(reached) = drive.reached() else {
                continue;
            };
            let cells = Transition::reachable().filter(|cell| reached.contains(*cell));
            for state in cells.map(|cell| cell.state) {
                self.notes
                    .note(|| Feature::new(state.section(), "a drive", state.name()));
            }
        }
    }
}
