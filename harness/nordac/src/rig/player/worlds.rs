//! Whether slaves could have sent what came behind an adapter.
//!
//! When a telegram has reached them is not known exactly: not before it had left the bench, and not after the time at which its reply was read.
//! Slaves could have sent what came if for every telegram there is such a time with which they send these very octets. So nothing is excused
//! because it is late, and where a motor moves the reply says itself when it was asked.

mod line;

use crate::rig::known::KnownInverters;
use crate::rig::observed::{Agreement, Turn, WHOLE};
use crate::rig::settle::{Assumptions, search};
use crate::simulate::SlaveSetup;
use harness_bench::qualify::worlds::{Dialogue, RightDrive as _, TimedPiece, WorldsVerdict, lost};
use harness_bench::rig::playing::observed::Beats;
use harness_proto::nordac::properties::NordacProperty;
use harness_proto::profibus::BusRate;
use harness_proto::time::{Instant, Span};
use line::{Line, Piece, narrow, pieces, telegram};
use std::collections::HashMap;

/// How exact the times of a right inverter are: one may look at its words and move its ramp in a cycle (our choice).
const CYCLE: u64 = 20;

/// The scans in which slaves are played: in long ones first, since they are few. What a right slave does within one is not seen, such as a
/// quick stop that ends before the next telegram, and then in short ones.
const LONG: u64 = 10;
const SHORT: u64 = 1;

/// How many telegrams and replies a line loses in one attempt at most.
pub(super) const MOST_LOST: usize = 3;

/// The most steps of all worlds of a conversation; and of those of a deviation, of which there are many.
const STEPS: usize = 200_000;
const STEPS_OF_A_NAME: usize = 30_000;

/// Why slaves that differ are not accused.
const TORN: &str = "a stream has parted a telegram, and the next one met the reply";
pub(super) const TOO_MANY: &str = "what came has more worlds than are kept";

/// Where the slaves differ from what came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Divergence {
    /// Behind which telegram, counted from 0.
    pub(super) turn: usize,
    /// What right ones would have sent.
    pub(super) wanted: Vec<u8>,
    /// How many octets of it came.
    agreed: usize,
    /// Why this accuses no slave, if it does not.
    pub(super) open: Option<&'static str>,
}

/// Whether right slaves of which this is `known`, with some values of the points that are not settled of them, could have sent what came over a
/// line that has lost this many telegrams or replies at most; returns after which telegrams.
///
/// # Errors
/// Where the slaves as they are known differ.
pub(super) fn right_slaves_send(
    known: &[KnownInverters],
    rate: BusRate,
    most_lost: usize,
    turns: &[Turn],
    beats: &Beats,
) -> Result<Vec<usize>, Divergence> {
    let talk = WorldsDialogue::new(rate, turns, most_lost);
    let slaves = |all: &Assumptions| -> Vec<SlaveSetup> {
        let slaves = known.iter().zip(all.iter().copied());
        slaves.map(|(known, open)| known.model(open)).collect()
    };
    let send = |slaves: &[SlaveSetup]| talk.sent_by(slaves, &|| beats.beat());
    let base: Assumptions = known.iter().map(|known| known.properties).collect();
    let first = send(&slaves(&base));
    if first.is_ok() {
        return first;
    }
    let may = |place: usize, property: &NordacProperty| !known[place].is_settled(property);
    // Many slaves say the same, and what one of them explains all of them do.
    let mut explained: HashMap<Vec<(usize, Piece)>, Agreement> = HashMap::new();
    let found = search(&base, may, |all| {
        beats.beat();
        let slaves = slaves(all);
        let latest = talk.talk.sent.iter().map(|request| request.latest);
        let agreed = explained.entry(talk.said(Line::new(&slaves), latest));
        *agreed.or_insert_with(|| agreement(&send(&slaves)))
    });
    match found.first() {
        None => first,
        Some((_, all)) => send(&slaves(all)),
    }
}

/// How far slaves send what came.
fn agreement(found: &Result<Vec<usize>, Divergence>) -> Agreement {
    match found {
        Ok(_) => WHOLE,
        Err(differs) => differs.turn * 1024 + differs.agreed.min(1023),
    }
}

/// Plays slaves that were just switched on with the telegrams of the bench. What came before the scenario is not compared.
///
/// # Errors
/// The first reply that they cannot have sent.
pub(super) fn could_send(
    slaves: &[SlaveSetup],
    rate: BusRate,
    turns: &[Turn],
) -> Result<(), Divergence> {
    let mut talk = WorldsDialogue::new(rate, turns, 0);
    (talk.talk.most_steps, talk.closely) = (STEPS_OF_A_NAME, false);
    talk.sent_by(slaves, &|| ()).map(|_| ())
}

struct WorldsDialogue {
    /// Times without what the inverters do not keep.
    talk: Dialogue<Piece>,
    /// Whether short scans are tried: what a line has lost excuses, and many deviations are tried for a name.
    closely: bool,
    /// Behind which telegram each piece came.
    turns: Vec<usize>,
    /// When each telegram had left.
    left: Vec<Instant>,
}

impl WorldsDialogue {
    fn new(rate: BusRate, turns: &[Turn], most_lost: usize) -> Self {
        let sent = turns.iter().enumerate().map(|(number, turn)| TimedPiece {
            // A stream is not as slow as a line.
            earliest: turn.left - rate.octet_time() * turn.octets.len() as u64,
            latest: read_by(turns, number),
            piece: Piece::request(wide(&turn.octets), turn.step.is_none()),
        });
        let sent: Vec<_> = sent.collect();
        let (came, places) = came(turns, most_lost > 0);
        let end = sent.iter().map(|request| request.latest).max();
        Self {
            talk: Dialogue {
                sent,
                came,
                asked: places.iter().map(|turn| turn + 1).collect(),
                end: end.unwrap_or_default(),
                lag: Span::ZERO,
                overtakes: false,
                complete: true,
                most_lost,
                loses_sent: true,
                most_steps: STEPS,
            },
            closely: most_lost == 0,
            turns: places,
            left: turns.iter().map(|turn| turn.left).collect(),
        }
    }

    /// The dialogue where times may be off by some milliseconds and a scan.
    fn within(&self, millis: u64) -> Dialogue<Piece> {
        let mut talk = self.talk.clone();
        let more = Span::from_millis(millis);
        for piece in talk.sent.iter_mut().chain(&mut talk.came) {
            piece.earliest = piece.earliest - more;
            piece.latest += more;
        }
        talk.end += more;
        talk
    }

    /// What slaves say where telegrams reach them at these times, and to which ones.
    fn said(&self, mut line: Line<LONG>, at: impl Iterator<Item = Instant>) -> Vec<(usize, Piece)> {
        let mut all = Vec::new();
        for ((number, sent), at) in self.talk.sent.iter().enumerate().zip(at) {
            line.advance(at);
            line.hear(at, &sent.piece);
            all.extend(std::iter::from_fn(|| Some((number, line.say()?))));
        }
        all
    }

    /// Whether slaves that were just switched on could have sent what came; after which telegrams something was lost.
    fn sent_by(&self, slaves: &[SlaveSetup], alive: &dyn Fn()) -> Result<Vec<usize>, Divergence> {
        let line = Line::<LONG>::new(slaves);
        let came = &self.talk.came;
        // Where nothing is late, that is seen at once, and to the octet: whole scans do not show each value of a motor.
        let said = self.said(line.clone(), self.left.iter().copied());
        let mut pairs = said.iter().zip(came).zip(&self.turns);
        let alike = |((said, came), turn): ((&(usize, Piece), &TimedPiece<Piece>), &usize)| {
            said.0 <= *turn && line.is(&said.1, &came.piece)
        };
        if said.len() == came.len() && pairs.all(alike) {
            return Ok(Vec::new());
        }
        let mut found = lost(line, &self.within(CYCLE - LONG), alive);
        if matches!(found, Err((WorldsVerdict::Wrong(..), true))) && self.closely {
            let line = Line::<SHORT>::new(slaves);
            found = lost(line, &self.within(CYCLE - SHORT), alive);
        }
        let (place, expected) = match found {
            Ok(lost) => return Ok(lost),
            Err((WorldsVerdict::Wrong(place, expected), _)) => (Some(place), expected),
            Err(_) => (None, None),
        };
        let before = &came[..place.map_or(0, |place| came.len().min(place + 1))];
        let torn = before.iter().any(|reply| reply.piece.begun);
        let wanted = expected.map_or(Vec::new(), |piece| piece.octets);
        let octets = place.and_then(|place| Some(&came.get(place)?.piece.octets));
        let octets = octets.into_iter().flatten();
        let last = self.talk.sent.len().saturating_sub(1);
        Err(Divergence {
            turn: place.map_or(0, |place| self.turns.get(place).copied().unwrap_or(last)),
            agreed: wanted
                .iter()
                .zip(octets)
                .take_while(|pair| pair.0 == pair.1)
                .count(),
            wanted: narrow(&wanted),
            open: match place {
                None => Some(TOO_MANY),
                Some(_) => torn.then_some(TORN),
            },
        })
    }
}

/// By when a telegram has reached the slaves: before its reply was read, which may be read after the next telegram, or else before that one left.
fn read_by(turns: &[Turn], number: usize) -> Instant {
    let turn = &turns[number];
    let asks = || {
        let (telegram, used) = telegram(&wide(&turn.octets))?;
        let function = telegram.pdu()?.fc().function()?;
        Some(used == turn.octets.len() && !function.is_sdn())
    };
    let from_here = turns[number..].iter();
    let silent = from_here.take_while(|turn| turn.came.is_empty());
    let silent = silent.count();
    let late = asks() == Some(true) && silent <= MOST_LOST;
    let reply = turns.get(number + if late { silent } else { 0 });
    let read = reply.and_then(|turn| turn.read);
    let next = turns.get(number + 1).map(|turn| turn.left);
    read.or(next).unwrap_or_default().max(turn.left)
}

/// What came in the scenario, piece by piece, and after which telegram each has begun. What a `lossy` line has left of replies is one piece.
fn came(turns: &[Turn], lossy: bool) -> (Vec<TimedPiece<Piece>>, Vec<usize>) {
    let mut octets = Vec::new();
    let mut ends = Vec::new();
    for turn in turns {
        let played = turn.step.map_or(&[][..], |_| &turn.came);
        octets.extend_from_slice(played);
        ends.push(octets.len());
    }
    let mut all: Vec<TimedPiece<Piece>> = Vec::new();
    let mut places = Vec::new();
    for range in pieces(&octets, &ends) {
        let place = ends.partition_point(|end| *end <= range.start);
        let turn = &turns[place];
        let mut piece = Piece::of(&octets[range]);
        let first = telegram(&wide(&turn.octets));
        let parted = first.is_some_and(|(_, length)| length < turn.octets.len());
        piece.begun = parted && piece.damaged;
        let latest = turn.read.unwrap_or(turn.left);
        match all.last_mut() {
            Some(last) if lossy && piece.damaged && last.piece.damaged => {
                last.piece.octets.extend(piece.octets);
                last.latest = latest;
            }
            _ => {
                all.push(TimedPiece {
                    earliest: Instant::START,
                    latest,
                    piece,
                });
                places.push(place);
            }
        }
    }
    (all, places)
}

/// Octets as they come without a line error.
fn wide(octets: &[u8]) -> Vec<u16> {
    octets.iter().map(|octet| u16::from(*octet)).collect()
}

#[cfg(test)]
mod tests;
