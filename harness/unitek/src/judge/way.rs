//! A move to a position: between which places and speeds the axis of a right drive is.
//!
//! The manual does not say how a drive gets to a position. The fastest drive is the model, whose axis has the speed of the limit (34) at
//! once. The slowest one reacts late, and uses the ramps (35, ED) up to that speed and down from it.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

/// Speed at 100 %, and counts of a turn (6.1, App 7).
const FULL: i64 = 32_767;
const TURN: i64 = 65_536;

/// Parts of a count.
const PART: i64 = 1_024;

/// How long the slowest drive takes to react, in ms (our choice).
const REACTS: u32 = 50;

/// How much slower than the limit it is: this part of it (UNITEK 5.2; our choice for speeds).
const SLOWER: i64 = 50;

/// A move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Way {
    destination: i64,
    /// Where the slowest drive is, in parts of a count.
    place: i64,
    /// Its speed, in parts of a count each ms; and its highest one.
    speed: i64,
    most: i64,
    /// How much faster and slower it becomes each ms.
    ramps: [i64; 2],
    /// The limit of the speed, with the sign of the way.
    limit: i64,
    /// How many ms pass before it reacts.
    waits: u32,
}

impl Way {
    /// A move from one place to another, with this speed in rpm at 100 %, limit and ramps.
    pub(super) fn new([from, to]: [i64; 2], rpm: u32, limit: i64, ramps: [u32; 2]) -> Self {
        let full = i64::from(rpm) * TURN * PART / 60_000;
        let most = (full * limit / FULL - full * limit / FULL / SLOWER).max(1);
        let ramp = |millis: u32| (full / i64::from(millis.max(1))).max(1);
        Self {
            destination: to,
            place: from * PART,
            speed: 0,
            most,
            ramps: ramps.map(ramp),
            limit: limit * (to - from).signum(),
            waits: REACTS,
        }
    }

    pub(super) const fn destination(&self) -> i64 {
        self.destination
    }

    /// Where the slowest drive is.
    pub(super) const fn place(&self) -> i64 {
        self.place.div_euclid(PART)
    }

    /// Between which speeds a drive is: it may stand, and have the speed of the limit.
    pub(super) fn speeds(&self) -> (i64, i64) {
        (self.limit.min(0), self.limit.max(0))
    }

    /// One ms.
    pub(super) fn step(&mut self) {
        if self.waits > 0 {
            self.waits -= 1;
            return;
        }
        let away = self.destination * PART - self.place;
        let [up, down] = self.ramps;
        // From this speed on it must become slower, to stand at the destination.
        let brakes = (i128::from(away.abs()) * 2 * i128::from(down)).isqrt();
        let brakes = i64::try_from(brakes).unwrap_or(i64::MAX).max(PART);
        self.speed = (self.speed + up).min(self.most).min(brakes);
        self.place += away.signum() * self.speed.min(away.abs());
    }

    /// A checksum.
    pub(super) fn state(&self) -> u64 {
        let mut state = DefaultHasher::new();
        self.hash(&mut state);
        state.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 turns at 20 % of 3600 rpm: the model takes 333 ms.
    fn way(ramps: [u32; 2]) -> Way {
        Way::new([-2 * TURN, 2 * TURN], 3_600, 6_553, ramps)
    }

    fn arrives(mut way: Way) -> u32 {
        let mut millis = 0;
        while way.place() != way.destination() {
            way.step();
            millis += 1;
        }
        millis
    }

    /// Ex 11: the ramps are times for 100 %, of which a fifth is used up and down.
    #[test]
    fn the_slowest_drive_uses_its_ramps() {
        assert!(
            (388..=394).contains(&arrives(way([10, 10]))),
            "{}",
            arrives(way([10, 10]))
        );
        let slow = arrives(way([500, 500]));
        assert!((480..=500).contains(&slow), "{slow}");
    }

    #[test]
    fn it_stands_until_it_reacts_and_never_turns_back() {
        let mut way = way([100, 100]);
        for _ in 0..REACTS {
            way.step();
        }
        assert_eq!(way.place(), -2 * TURN);
        let mut last = way.place();
        while last != way.destination() {
            way.step();
            assert!(last < way.place());
            last = way.place();
        }
        assert_eq!(way.speeds(), (0, 6_553));
    }
}
