//! A set of worlds: what came over a bus is right if some right drive could have sent it just then.
//!
//! Each world is a right drive with values for what is not known: what the manual leaves open, and when each piece reached it. Its
//! clock stands anywhere against that of the computer, so a world keeps an interval for the difference. Each piece that came removes the
//! worlds that could not have sent it then. If none is left, no right drive has sent this.
//!
//! Worlds that do the same from now on are merged. There are at most `MOST_WORLDS`: where that is not enough, nothing is accused.

use harness_proto::time::{Instant, Span};
use std::collections::{BTreeMap, HashMap, VecDeque};
use std::hash::Hash;

/// Maximum number of worlds at one time.
pub(crate) const MOST_WORLDS: usize = 4_096;

/// Number of scans around a step of its own within which a drive with shorter scans might act differently.
const SOON: i64 = 4;

/// A right drive on its own clock. It runs in scans: when a piece arrives within a scan makes no difference.
pub trait RightDrive: Clone {
    /// A frame or a telegram.
    type Piece: Clone + Eq + Hash;

    /// How long a scan lasts.
    const SCAN: Span;

    /// The reciprocal of its clock's tolerance: 50 is 2 % (UNITEK 5.2).
    const DRIFT: i64 = 50;

    /// When it next does something by itself; `None` while it only waits for pieces.
    fn due(&self) -> Option<Instant>;

    /// Whether the time that passes before [`Self::due`] makes no difference to it.
    fn rests(&self) -> bool {
        false
    }

    /// Runs up to and including this time.
    fn advance(&mut self, to: Instant);

    /// Takes a piece. The drive has been run up to this time.
    fn hear(&mut self, at: Instant, piece: &Self::Piece);

    /// The drive after a piece that arrived in parts; `None` where a stream does not part it.
    fn hear_parted(&self, _at: Instant, _piece: &Self::Piece) -> Option<Self> {
        None
    }

    /// Returns the next piece that it sends at the present time.
    fn say(&mut self) -> Option<Self::Piece>;

    /// Whether the last piece that it said may leave later than pieces that it says by itself after it.
    fn may_wait(&self) -> bool {
        false
    }

    /// Whether what came can be what it said: equal except for bits without a meaning, and within the band of a value that moves.
    fn is(&self, said: &Self::Piece, came: &Self::Piece) -> bool;

    /// Whether what came is the rest of a piece that the line has damaged.
    fn is_damaged(_came: &Self::Piece) -> bool {
        false
    }

    /// Whether its further behaviour is known. If it is not, the drive may send anything.
    fn knows(&self) -> bool {
        true
    }

    /// A checksum of all that decides its further behaviour. Times in it count from the present.
    fn state(&self) -> u64;
}

/// A piece and the interval in which it was on the bus, on the computer's clock.
#[derive(Clone, Debug)]
pub struct TimedPiece<P> {
    pub earliest: Instant,
    pub latest: Instant,
    pub piece: P,
}

/// The judgement of a set of worlds on a conversation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WorldsVerdict<P> {
    /// A right drive could have sent this.
    Right,
    /// No right drive could: the place of the first piece that none would have sent, one past the end where a piece is missing; and the
    /// piece that the last world would have sent.
    Wrong(usize, Option<P>),
    /// There are more worlds or steps than the limits allow.
    TooMany,
    /// The further behaviour of a world that is left is not known.
    Unknown,
}

/// A conversation with one drive, as the computer has seen it.
#[derive(Clone, Debug)]
pub struct Dialogue<P> {
    /// What was sent to it, in order.
    pub sent: Vec<TimedPiece<P>>,
    /// What came from it, in order.
    pub came: Vec<TimedPiece<P>>,
    /// Number of pieces sent before each one that came was read: it answers no later one. Empty if not known.
    pub asked: Vec<usize>,
    /// The time up to which everything that came was read.
    pub end: Instant,
    /// Longest time between a right drive saying a piece and the piece on the bus.
    pub lag: Span,
    /// Whether a later piece may overtake one that may wait.
    pub overtakes: bool,
    /// Whether all that was said has come, and nothing is still on its way.
    pub complete: bool,
    /// Maximum number of the drive's pieces that an adapter has lost.
    pub most_lost: usize,
    /// Whether pieces to the drive may be lost as well.
    pub loses_sent: bool,
    /// Maximum number of steps of all worlds together.
    pub most_steps: usize,
}

/// One right drive, and what it would have sent.
#[derive(Clone, Debug)]
struct World<M: RightDrive> {
    model: M,
    /// The drive's clock, in units of a [`Span`].
    at: i64,
    /// The least and the most by which the computer's clock is ahead of it.
    ahead: (i64, i64),
    /// Number of sent pieces that have reached it.
    heard: usize,
    /// When it last did something by itself.
    stirred: i64,
    /// Pieces that it has said and that have not come yet.
    said: VecDeque<DrivePiece<M::Piece>>,
    /// The places, in what was sent, of the pieces that were lost or whose answers were.
    lost: Vec<usize>,
}

/// A piece that a world has said.
#[derive(Clone, Debug)]
struct DrivePiece<P> {
    /// On the drive's clock.
    at: i64,
    /// Number of pieces that it had heard.
    heard: usize,
    piece: P,
    may_wait: bool,
}

/// Numbers of pieces heard and lost, state, and what was said how long ago: worlds with equal keys behave the same from now on.
type MergeKey<P> = (usize, usize, u64, Vec<(i64, P)>);

impl<M: RightDrive> World<M> {
    fn same(&self) -> MergeKey<M::Piece> {
        let said = self.said.iter();
        let said = said.map(|said| (self.at - said.at, said.piece.clone()));
        let lost = self.lost.len();
        (self.heard, lost, self.model.state(), said.collect())
    }

    /// The world in which the next piece to come is lost; `None` if nothing was said, or if `most` are lost.
    fn losing(&self, most: usize) -> Option<Self> {
        let said = self.said.front().filter(|_| self.lost.len() < most)?;
        let lost = said.heard.saturating_sub(1);
        let mut world = self.clone();
        world.said.pop_front();
        world.lost.push(lost);
        Some(world)
    }

    /// The world after something that the line itself has added: the answer to the last piece counts as lost.
    fn adding(&self) -> Self {
        let mut world = self.clone();
        world.lost.push(world.heard.saturating_sub(1));
        world
    }

    /// The world with the difference of the clocks narrowed to `least..=most`; `None` if none is left.
    fn within(mut self, least: i64, most: i64) -> Option<Self> {
        self.ahead = (self.ahead.0.max(least), self.ahead.1.min(most));
        (self.ahead.0 <= self.ahead.1).then_some(self)
    }

    /// The world that has waited for a piece that can reach it between these times of the computer's clock.
    fn waiting(&self, earliest: i64, latest: i64) -> Option<Self> {
        let (scan, begun) = (units_of(M::SCAN), earliest.max(self.at + self.ahead.0));
        let mut world = self.clone();
        world.at += (begun - self.at).max(0) / scan * scan;
        world.ahead = (begun - world.at, latest - world.at);
        world.model.advance(instant(world.at));
        world.within(i64::MIN, i64::MAX)
    }

    /// Merges another world that behaves the same into this one. Returns false, and changes nothing, if the intervals of both are apart and the
    /// drive waits for a time.
    fn merge(&mut self, other: &Self) -> bool {
        let moved = other.at - self.at;
        let (least, most) = (other.ahead.0 + moved, other.ahead.1 + moved);
        let apart = least > self.ahead.1 || most < self.ahead.0;
        if apart && self.model.due().is_some() {
            return false;
        }
        self.ahead = (self.ahead.0.min(least), self.ahead.1.max(most));
        self.stirred = self.stirred.max(other.stirred.saturating_sub(moved));
        true
    }

    /// Whether a step of its own is at most [`SOON`] scans away, or it moves.
    fn stirs(&self) -> bool {
        let near = units_of(M::SCAN) * SOON;
        let due = self.model.due().map(units);
        let soon = due.is_some_and(|due| due <= self.at + near);
        soon || self.at <= self.stirred.saturating_add(near) || due.is_some() && !self.model.rests()
    }

    fn listen(&mut self) {
        while let Some(piece) = self.model.say() {
            self.said.push_back(DrivePiece {
                at: self.at,
                heard: self.heard,
                may_wait: self.model.may_wait(),
                piece,
            });
        }
    }

    fn advance(&mut self, to: i64) {
        let drift = (to - self.at) / M::DRIFT;
        self.ahead = (self.ahead.0 - drift, self.ahead.1 + drift);
        self.at = to;
        if self.model.due().is_some_and(|due| units(due) <= to) {
            self.stirred = to;
        }
        self.model.advance(instant(to));
        self.listen();
    }
}

const fn units(at: Instant) -> i64 {
    at.since_start().units().cast_signed()
}

fn instant(at: i64) -> Instant {
    Instant::START + Span::from_units(at.unsigned_abs())
}

/// The place of a world: number of pieces heard, the drive's clock, and a serial number.
type WorldPlace = (usize, i64, usize);

/// Worlds of which no two behave the same, in order of their places. What follows from a world has a later place.
struct Worlds<M: RightDrive> {
    all: BTreeMap<WorldPlace, World<M>>,
    /// The places of worlds that behave the same. The place of a world that was taken out stays.
    same: HashMap<MergeKey<M::Piece>, Vec<WorldPlace>>,
    numbers: usize,
}

impl<M: RightDrive> Worlds<M> {
    fn new() -> Self {
        Self {
            all: BTreeMap::new(),
            same: HashMap::new(),
            numbers: 0,
        }
    }

    fn insert(&mut self, world: World<M>) {
        let same = self.same.entry(world.same()).or_default();
        let all = &mut self.all;
        let merges = |place| all.get_mut(place).is_some_and(|kept| kept.merge(&world));
        if !same.iter().any(merges) {
            let place = (world.heard, world.at, self.numbers);
            self.numbers += 1;
            same.push(place);
            self.all.insert(place, world);
        }
    }

    fn pop_first(&mut self) -> Option<World<M>> {
        self.all.pop_first().map(|(_, world)| world)
    }
}

/// Whether one of these right drives could have sent what came. They are fresh, and their clocks begin with that of the conversation. If none
/// could, the judgement is that on the first one.
pub fn judge<M: RightDrive>(drives: Vec<M>, talk: &Dialogue<M::Piece>) -> WorldsVerdict<M::Piece> {
    judge_alive(drives, talk, &|| ())
}

/// As [`judge`]; calls `alive` again and again, since it may take seconds.
pub fn judge_alive<M: RightDrive>(
    drives: Vec<M>,
    talk: &Dialogue<M::Piece>,
    alive: &dyn Fn(),
) -> WorldsVerdict<M::Piece> {
    judge_kinds(drives, |drive| match lost(drive, talk, alive) {
        Ok(_) => WorldsVerdict::Right,
        Err((verdict, _)) => verdict,
    })
}

/// Judges worlds of several kinds, which are never merged, each by itself: what came is right if one of them could have sent it, and not decided
/// if one of them is not. Else the judgement is that on the first one.
pub fn judge_kinds<W, P>(
    worlds: impl IntoIterator<Item = W>,
    mut judged: impl FnMut(W) -> WorldsVerdict<P>,
) -> WorldsVerdict<P> {
    let mut first = None;
    for world in worlds {
        match judged(world) {
            WorldsVerdict::Wrong(place, expected) => {
                first.get_or_insert(WorldsVerdict::Wrong(place, expected));
            }
            decided => return decided,
        }
    }
    first.unwrap_or(WorldsVerdict::Unknown)
}

/// The places, in what was sent, of the pieces that were lost or whose answers were: the fewest with which a right drive could have sent what
/// came.
///
/// # Errors
/// The judgement if no right drive could, and whether a world was near a step of its own: with shorter scans it might have acted differently.
pub fn lost<M: RightDrive>(
    model: M,
    talk: &Dialogue<M::Piece>,
    alive: &dyn Fn(),
) -> Result<Vec<usize>, (WorldsVerdict<M::Piece>, bool)> {
    // When a piece has reached a drive seldom matters: a few worlds may explain what came.
    for heard in [
        HearingTime::AtOnce,
        HearingTime::BeforeItsStep,
        HearingTime::RepeatsBeforeItsStep,
    ] {
        match lost_in(model.clone(), talk, heard, alive) {
            Err((WorldsVerdict::Wrong(..) | WorldsVerdict::TooMany, _)) => {}
            found => return found,
        }
    }
    lost_in(model, talk, HearingTime::AtAnyTime, alive)
}

/// The times at which the worlds that are tried hear a piece.
#[derive(Clone, Copy, PartialEq, Eq)]
enum HearingTime {
    /// At one time.
    AtOnce,
    /// At one time before it next does something by itself, or after that.
    BeforeItsStep,
    /// The same for a piece that repeats the one before it; any other at any time.
    RepeatsBeforeItsStep,
    AtAnyTime,
}

impl HearingTime {
    /// Whether a piece is heard at one time before a step; `repeats` says whether it repeats the one before it.
    fn is_once(self, repeats: impl Fn() -> bool) -> bool {
        match self {
            Self::AtOnce | Self::BeforeItsStep => true,
            Self::RepeatsBeforeItsStep => repeats(),
            Self::AtAnyTime => false,
        }
    }
}

/// As [`lost`], in worlds that hear pieces at these times.
fn lost_in<M: RightDrive>(
    model: M,
    talk: &Dialogue<M::Piece>,
    heard: HearingTime,
    alive: &dyn Fn(),
) -> Result<Vec<usize>, (WorldsVerdict<M::Piece>, bool)> {
    let mut steps = 0;
    let mut worlds = Worlds::new();
    worlds.insert(World {
        model,
        at: 0,
        ahead: (0, 0),
        heard: 0,
        stirred: i64::MIN,
        said: VecDeque::new(),
        lost: Vec::new(),
    });
    for place in 0..=talk.came.len() {
        let mut explained = Worlds::new();
        let (mut expected, mut stirs) = (None, false);
        while let Some(world) = worlds.pop_first() {
            alive();
            if steps > talk.most_steps || worlds.all.len() + explained.all.len() > MOST_WORLDS {
                return Err((WorldsVerdict::TooMany, true));
            }
            let refuted = talk.refutes(&world, place);
            if !refuted && !world.model.knows() {
                return Err((WorldsVerdict::Unknown, true));
            }
            stirs |= world.stirs();
            if let Some(said) = world.said.front() {
                expected = Some(said.piece.clone());
            }
            if refuted {
                continue;
            }
            let came = talk.came.get(place);
            let damaged = came.is_some_and(|came| M::is_damaged(&came.piece));
            if damaged && world.lost.len() < talk.most_lost {
                explained.insert(world.adding());
            }
            if let Some(losing) = world.losing(talk.most_lost) {
                steps += 1;
                if damaged {
                    explained.insert(losing.clone());
                }
                worlds.insert(losing);
            }
            let mut explains = |world| explained.insert(world);
            let last = talk.say(&world, place, &mut explains);
            if last {
                continue;
            }
            for next in talk.next(world, place, heard, &mut explains) {
                steps += 1;
                worlds.insert(next);
            }
        }
        if explained.all.is_empty() {
            return Err((WorldsVerdict::Wrong(place, expected), stirs));
        }
        worlds = explained;
    }
    let lost = worlds.all.into_values().map(|world| world.lost);
    Ok(lost.min_by_key(Vec::len).unwrap_or_default())
}

impl<P: Clone + Eq + Hash> Dialogue<P> {
    /// Whether the piece that was sent at a place is the same as the one before.
    fn repeats(&self, place: usize) -> bool {
        let before = place.checked_sub(1).and_then(|place| self.sent.get(place));
        let sent = self.sent.get(place);
        before
            .zip(sent)
            .is_some_and(|(before, sent)| before.piece == sent.piece)
    }

    /// Whether a world cannot have sent what came at a place, whatever it does from now on: what it has said before would have come first.
    fn refutes<M: RightDrive<Piece = P>>(&self, world: &World<M>, place: usize) -> bool {
        let Some(came) = self.came.get(place).filter(|_| self.most_lost == 0) else {
            return false;
        };
        for said in &world.said {
            if world.model.is(&said.piece, &came.piece) {
                return false;
            }
            if !(said.may_wait && self.overtakes) {
                return true;
            }
        }
        false
    }

    /// Gives `explained` the world after what came at a place, if the world has said it. Returns whether the world can do nothing else first.
    fn say<M: RightDrive<Piece = P>>(
        &self,
        world: &World<M>,
        place: usize,
        explained: &mut impl FnMut(World<M>),
    ) -> bool {
        let (lag, scan) = (units_of(self.lag), units_of(M::SCAN));
        let Some(first) = world.said.front() else {
            return false;
        };
        let Some(came) = self.came.get(place) else {
            // It may come later than the computer has listened.
            let late = world.clone();
            let late = late.within(units(self.end) - lag - first.at, i64::MAX);
            let late = late.filter(|_| !self.complete);
            late.into_iter().for_each(explained);
            return true;
        };
        let earliest = units(came.earliest) - lag - scan;
        for (number, said) in world.said.iter().enumerate() {
            if world.model.is(&said.piece, &came.piece) {
                let mut after = world.clone();
                after.said.remove(number);
                let latest = units(came.latest) + scan;
                let after = after.within(earliest - said.at, latest - said.at);
                after.into_iter().for_each(&mut *explained);
            }
            let late = first.at + world.ahead.1 < earliest;
            if !(said.may_wait && self.overtakes) || late {
                return true;
            }
        }
        false
    }

    /// The worlds that can come next: those that hear the next piece, at each time at which it can reach the drive, and the one that does its
    /// next step. `ended` gets the world if it may have done its last one.
    fn next<M: RightDrive<Piece = P>>(
        &self,
        world: World<M>,
        place: usize,
        heard: HearingTime,
        ended: &mut impl FnMut(World<M>),
    ) -> Vec<World<M>> {
        let mut all = Vec::new();
        let mut hears = false;
        let scan = units_of(M::SCAN);
        let came = self.came.get(place);
        let end = came.map_or(self.end, |came| came.latest);
        let end = units(end) + scan;
        let due = world.model.due().map(units);
        let asked = self.asked.get(place).copied().unwrap_or(usize::MAX);
        let sent = self.sent.get(world.heard).filter(|_| world.heard < asked);
        if let Some(sent) = sent {
            let (earliest, latest) = (units(sent.earliest), units(sent.latest).min(end));
            let rests = |due| due > latest + scan - world.ahead.0 && world.model.rests();
            match due {
                // How long it has waited makes no difference to it.
                None => {
                    let begun = earliest.max(world.at + world.ahead.0);
                    let mut waited = world.clone();
                    waited.ahead = (begun - world.at, latest + scan - world.at);
                    all.extend(waited.within(i64::MIN, i64::MAX));
                }
                // It makes none before its next step.
                Some(due) if rests(due) => {
                    let waited = world.waiting(earliest - scan, latest + scan);
                    all.extend(waited.map(|waited| World {
                        ahead: (
                            waited.ahead.0.min(world.ahead.0),
                            waited.ahead.1.max(world.ahead.1),
                        ),
                        ..waited
                    }));
                }
                Some(due) => {
                    let scans = |span: i64| (span.max(0) + scan - 1) / scan * scan;
                    let of = |ahead: i64| world.at + scans(earliest - scan - ahead - world.at);
                    let mut first = of(world.ahead.1);
                    let mut last = (due - 1).min(latest + scan - world.ahead.0);
                    if heard.is_once(|| self.repeats(world.heard)) {
                        // It reaches the drive then, whichever clock of the world's is right.
                        first += (of(world.ahead.0).min(last) - first).max(0) / scan * scan;
                        last = last.min(first);
                    }
                    for at in (first..=last).step_by(M::SCAN.units() as usize) {
                        let hearing = world.clone();
                        let hearing = hearing.within(earliest - scan - at, latest + scan - at);
                        if let Some(mut hearing) = hearing {
                            hearing.advance(at);
                            all.push(hearing);
                        }
                    }
                }
            }
            let mut parted = Vec::new();
            for hearing in &mut all {
                let model = hearing.model.hear_parted(instant(hearing.at), &sent.piece);
                parted.extend(model.map(|model| World {
                    model,
                    ..hearing.clone()
                }));
                hearing.model.hear(instant(hearing.at), &sent.piece);
            }
            all.extend(parted);
            hears = !all.is_empty();
            for hearing in &mut all {
                hearing.heard += 1;
                hearing.listen();
            }
            if self.loses_sent && world.lost.len() < self.most_lost {
                let mut losing = world.clone();
                losing.lost.push(losing.heard);
                losing.heard += 1;
                all.push(losing);
            }
        }
        let unheard = sent.map_or(i64::MAX, |sent| units(sent.latest) + scan);
        let may_end = came.is_none() && !(self.complete && sent.is_some());
        if may_end && unheard.min(due.map_or(i64::MAX, |due| due + world.ahead.1)) >= end {
            ended(world.clone());
        }
        let waits = heard != HearingTime::AtOnce || !hears;
        if let Some(due) = due.filter(|_| waits)
            && let Some(mut stepping) = world.within(i64::MIN, unheard.min(end) - due)
        {
            stepping.advance(due);
            // Nothing can happen to it in between.
            let until = sent.map_or(end, |sent| units(sent.earliest).min(end)) - scan;
            while stepping.said.is_empty()
                && let Some(due) = stepping.model.due().map(units)
                && due + (due - stepping.at) / M::DRIFT + stepping.ahead.1 < until
            {
                stepping.advance(due);
            }
            all.push(stepping);
        }
        all
    }
}

const fn units_of(span: Span) -> i64 {
    span.units().cast_signed()
}

#[cfg(test)]
mod tests;
