//! Cases of one conversation that share what they have in common.
//!
//! The opening of a case, up to the point at which the master looks at what came back, goes through the ring place by place
//! ([`SharedRing`]). Up to the first damaged link it is that of the conversation without a fault, and between two damaged links that of
//! the case with the first fault alone. What the drive behind the last damaged link becomes, and what it sends on, decides all
//! that follows: a case in which both have been met before ends there, with the evidence of the earlier case.

use super::by_manual::{ByManual, Wire};
use super::class::CaseEvidence;
use super::sound::DrivesBeyondBus;
use crate::campaign::fault::{CaseFaults, InjectedFault};
use harness_proto::line::Received;
use harness_proto::novobus::bus_end::BusEnd;
use harness_sim::novobus::cells::Cells;
use harness_sim::novobus::shared::{
    MetSoFar, Passage, PlaceStep, SentStream, SharedRing, SharedState,
};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

/// Number of steps beyond which they are forgotten: some 300 MB. Cases go on from the start.
const MOST_STEPS: usize = 300_000;

/// How many outcomes are kept at most.
const MOST_OUTCOMES: usize = 200_000;

/// The opening with the faults of at most one link, by which it differs from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Front(usize);

/// What the faults of the last damaged link make of a front.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Fork {
    front: Front,
    link: usize,
    became: PlaceStep,
}

#[derive(Debug)]
struct FrontPassage {
    passage: Passage,
    lasts: usize,
}

/// Plays cases of a conversation one after another.
#[derive(Debug)]
pub(crate) struct Sharing<'a> {
    of: &'a ByManual,
    ring: SharedRing,
    start: SharedState,
    fronts: Vec<FrontPassage>,
    /// The front without a fault, by how long the faults of the case last.
    sound: HashMap<usize, Front>,
    /// Fronts by where they fork from the one without a fault.
    forks: HashMap<Fork, Front>,
    /// The same by the faults, for which nothing is to be worked out.
    damaged: BTreeMap<(usize, InjectedFault), Front>,
    outcomes: HashMap<Fork, Rc<CaseEvidence>>,
    /// Whether drives hold what they hold without a fault, by the numbers of their states.
    compared: RefCell<Vec<Option<bool>>>,
}

/// A ring of which the state is known.
struct KnownRing<'a> {
    ring: &'a mut SharedRing,
    state: SharedState,
    drives: u8,
    compared: &'a RefCell<Vec<Option<bool>>>,
}

impl Fork {
    /// The same place and state, of another front that brings the place the same bytes.
    pub(super) const fn of(self, front: Front) -> Self {
        Self { front, ..self }
    }
}

impl DrivesBeyondBus for KnownRing<'_> {
    fn count(&self) -> u8 {
        self.drives
    }

    fn cells(&self, drive: u8) -> Option<&Cells> {
        Some(self.ring.drive(&self.state, drive)?.memory())
    }

    fn bus_end(&self, drive: u8) -> Option<&BusEnd> {
        Some(self.ring.drive(&self.state, drive)?.bus_end())
    }

    fn compared(&self, drive: u8, compare: impl FnOnce(&Cells) -> bool) -> Option<bool> {
        let number = self.ring.drive_number(&self.state, drive)?;
        let mut all = self.compared.borrow_mut();
        if let Some(known) = all.get(number).copied().flatten() {
            return Some(known);
        }
        let compared = compare(self.cells(drive)?);
        if all.len() <= number {
            all.resize(number + 1, None);
        }
        all[number] = Some(compared);
        Some(compared)
    }
}

impl Wire for KnownRing<'_> {
    fn exchange(&mut self, bytes: &[u8]) -> Vec<Received> {
        let passage = self.ring.send(&self.state, bytes);
        self.state = passage.after().clone();
        self.ring.bytes(passage.heard())
    }
}

impl<'a> Sharing<'a> {
    /// `None` where the ring is not one whose cases can share.
    pub(crate) fn new(of: &'a ByManual) -> Option<Self> {
        let (ring, start) = SharedRing::new(of.ring()?)?;
        Some(Self {
            of,
            ring,
            start,
            fronts: Vec::new(),
            sound: HashMap::new(),
            forks: HashMap::new(),
            damaged: BTreeMap::new(),
            outcomes: HashMap::new(),
            compared: RefCell::default(),
        })
    }

    /// Forgets what was met if that has become too much.
    pub(super) fn forget(&mut self) {
        if self.outcomes.len() > MOST_OUTCOMES {
            self.outcomes.clear();
        }
        if self.ring.kept() > MOST_STEPS
            && let Some(new) = Self::new(self.of)
        {
            *self = new;
        }
    }

    /// How much has been met so far.
    pub(super) fn mark(&self) -> MetSoFar {
        self.ring.mark()
    }

    /// Forgets what comes of forks that were met since `mark`, if that has become too much; says whether it has. Fronts that were met
    /// since then must not be there.
    pub(super) fn forget_after(&mut self, mark: MetSoFar) -> bool {
        let much = self.ring.kept() > 2 * MOST_STEPS;
        if much {
            self.ring.forget_after(mark);
            self.compared.borrow_mut().clear();
        }
        much
    }

    fn keep(&mut self, passage: Passage, lasts: usize) -> Front {
        self.fronts.push(FrontPassage { passage, lasts });
        Front(self.fronts.len() - 1)
    }

    /// The opening without a fault, for faults that last for `lasts` byte times.
    pub(super) fn sound(&mut self, lasts: usize) -> Front {
        if let Some(front) = self.sound.get(&lasts) {
            return *front;
        }
        let passage = self.ring.send(&self.start, &self.of.opening(lasts));
        let front = self.keep(passage, lasts);
        self.sound.insert(lasts, front);
        front
    }

    /// Where a front forks by faults of this link. `None` where the ring has no such link.
    pub(super) fn fork<'f>(
        &mut self,
        front: Front,
        link: usize,
        faults: impl IntoIterator<Item = &'f InjectedFault>,
    ) -> Option<Fork> {
        let faults = faults.into_iter().flat_map(|fault| {
            let all = fault.what.on_link().into_iter();
            all.map(|(distance, what)| (fault.byte + distance, what))
        });
        let passage = &self.fronts[front.0].passage;
        let became = self.ring.disturb(&self.start, passage, link, faults)?;
        Some(Fork {
            front,
            link,
            became,
        })
    }

    /// For how many byte times one or two faults last.
    pub(super) fn lasts(&self, first: &InjectedFault, second: Option<&InjectedFault>) -> usize {
        self.of.lasts(&CaseFaults {
            first: *first,
            second: second.copied(),
        })
    }

    /// What is sent on a link in a front.
    pub(super) fn arriving(&self, front: Front, link: usize) -> Option<SentStream> {
        self.fronts[front.0].passage.sent_on(link)
    }

    fn passage(&mut self, fork: Fork) -> Passage {
        let front = &self.fronts[fork.front.0].passage;
        let (start, ring) = (&self.start, &mut self.ring);
        ring.follow(start, front, fork.link, fork.became)
    }

    /// The front in which one fault has happened.
    pub(super) fn damaged(&mut self, lasts: usize, fault: &InjectedFault) -> Option<Front> {
        if let Some(front) = self.damaged.get(&(lasts, *fault)) {
            return Some(*front);
        }
        let sound = self.sound(lasts);
        let fork = self.fork(sound, fault.link, [fault])?;
        let front = match self.forks.get(&fork) {
            Some(front) => *front,
            None => {
                let passage = self.passage(fork);
                let front = self.keep(passage, lasts);
                self.forks.insert(fork, front);
                front
            }
        };
        self.damaged.insert((lasts, *fault), front);
        Some(front)
    }

    /// What comes of a fork.
    pub(super) fn evidence(&mut self, fork: Fork) -> CaseEvidence {
        let passage = self.passage(fork);
        let heard = self.ring.bytes(passage.heard());
        let known = KnownRing {
            ring: &mut self.ring,
            state: passage.after().clone(),
            drives: self.of.answers().shape.drives,
            compared: &self.compared,
        };
        let lasts = self.fronts[fork.front.0].lasts;
        self.of.play_on(known, heard, lasts).0
    }

    /// Plays a case. `None` where the ring has not got its links.
    pub(crate) fn play(&mut self, case: &CaseFaults) -> Option<Rc<CaseEvidence>> {
        self.forget();
        let lasts = self.of.lasts(case);
        let fork = match case.second {
            Some(second) if second.link != case.first.link => {
                let mut both = [case.first, second];
                both.sort_by_key(|fault| fault.link);
                let [first, second] = both;
                let front = self.damaged(lasts, &first)?;
                self.fork(front, second.link, [&second])?
            }
            _ => {
                let front = self.sound(lasts);
                self.fork(front, case.first.link, case.faults())?
            }
        };
        if let Some(evidence) = self.outcomes.get(&fork) {
            return Some(evidence.clone());
        }
        let evidence = Rc::new(self.evidence(fork));
        self.outcomes.insert(fork, evidence.clone());
        Some(evidence)
    }
}
