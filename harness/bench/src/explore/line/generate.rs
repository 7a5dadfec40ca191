//! Makes and changes conversations within a swarm's subset of what they can have.

use super::{LineAct, LineBus, LineTalk};
use crate::explore::{Dice, Spiced, Swarm};

/// Acts reserved for queries of the state at the end.
const ROOM: usize = 8;

/// What conversations may have, and with which drives.
#[derive(Clone, Debug)]
pub struct LineScope<B: LineBus> {
    /// The drives, at least one.
    pub drives: Vec<B::Station>,
    /// What conversations may have.
    pub spices: Vec<B::Spice>,
}

/// Makes conversations.
#[derive(Debug)]
pub(crate) struct Maker<'s, B: LineBus> {
    scope: &'s LineScope<B>,
    swarm: &'s Swarm<B::Spice>,
}

impl<'s, B: LineBus> Maker<'s, B> {
    /// Makes conversations of this scope with what the swarm has.
    pub(crate) const fn new(scope: &'s LineScope<B>, swarm: &'s Swarm<B::Spice>) -> Self {
        Self { scope, swarm }
    }

    pub(crate) fn case(&self, dice: &mut Dice) -> LineTalk<B> {
        let mut acts = Vec::new();
        if let Some(station) = self.station(dice) {
            let (begin, parts) = B::begin(station, dice);
            acts = begin;
            for _ in 0..parts {
                acts.extend(self.acts(dice));
            }
        }
        self.closed(LineTalk { acts }, dice)
    }

    /// A conversation made of another one.
    pub(crate) fn mutated(
        &self,
        old: &LineTalk<B>,
        other: Option<&LineTalk<B>>,
        dice: &mut Dice,
    ) -> LineTalk<B> {
        let mut acts = old.acts.clone();
        for _ in 0..=dice.below(4) {
            let at = dice.below(acts.len() + 1);
            match (dice.below(5), other) {
                (0, _) if at < acts.len() => drop(acts.remove(at)),
                (1, Some(other)) => {
                    let from = dice.below(other.acts.len());
                    let some = other.acts[from..].iter().take(1 + dice.below(6)).cloned();
                    acts.splice(at..at, some);
                }
                (2, _) if at < acts.len() => acts[at].wait_us = B::wait(dice),
                (3, _) if at < acts.len() => B::change(&mut acts[at].what, dice),
                _ => drop(acts.splice(at..at, self.acts(dice))),
            }
        }
        self.closed(LineTalk { acts }, dice)
    }

    /// Within its bounds, and with requests for what shows the state of the drives.
    fn closed(&self, mut talk: LineTalk<B>, dice: &mut Dice) -> LineTalk<B> {
        talk.cut(ROOM);
        if let Some(station) = self.station(dice) {
            let last = B::close(&talk.acts, (station, &self.scope.drives), dice);
            talk.acts.extend(last);
        }
        talk.cut(0);
        talk
    }

    fn station(&self, dice: &mut Dice) -> Option<B::Station> {
        dice.pick(&self.scope.drives).copied()
    }

    /// A part of a conversation, or all acts of an idiom.
    fn acts(&self, dice: &mut Dice) -> Vec<LineAct<B::What>> {
        let all: Vec<_> = B::Spice::ALL.iter().map(|(_, spice)| *spice).collect();
        let spice = dice.pick(&self.swarm.of(&all)).copied();
        let (Some(spice), Some(station)) = (spice, self.station(dice)) else {
            return Vec::new();
        };
        if dice.percent(30) {
            let whole = B::idiom(spice, station, dice);
            if !whole.is_empty() {
                return whole;
            }
        }
        B::part(spice, station, dice)
    }
}
