//! The table of 8 registers that are sent cyclically (5.2, ex 9, App 8).

use harness_proto::unitek::frame::CYCLES;
use harness_proto::unitek::properties::{IntervalAccuracy, TableFull};

/// A register that is sent every so often.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cycle {
    /// The register.
    pub register: u8,
    /// 1 to 254 ms.
    pub every: u8,
    /// The millisecond of the next frame.
    pub due: u64,
    /// The next frame is sent 1 ms late (`interval-accuracy`).
    late: bool,
    /// Requests are counted; the smallest number was requested longest ago.
    order: u64,
}

/// The table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cycles {
    places: [Option<Cycle>; CYCLES],
    requests: u64,
}

impl Cycles {
    /// Begins a cycle in millisecond `now`, or begins it again with another interval; `false` if the table is full.
    pub fn start(&mut self, register: u8, every: u8, now: u64, full: TableFull) -> bool {
        let known = self.place_of(register);
        let free = || self.places.iter().position(Option::is_none);
        let Some(place) = known.or_else(free).or_else(|| self.to_give_up(full)) else {
            return false;
        };
        self.requests += 1;
        self.places[place] = Some(Cycle {
            register,
            every,
            due: now + u64::from(every),
            late: false,
            order: self.requests,
        });
        true
    }

    /// Ends the cycle of a register, if it has one.
    pub fn stop(&mut self, register: u8) {
        if let Some(place) = self.place_of(register) {
            self.places[place] = None;
        }
    }

    /// The millisecond of the next frame.
    #[must_use]
    pub fn next_due(&self) -> Option<u64> {
        self.running().map(|cycle| cycle.due).min()
    }

    /// The register of a place, if it is due in millisecond `now`; its next frame is one interval later.
    pub fn take_due(&mut self, place: usize, now: u64, accuracy: IntervalAccuracy) -> Option<u8> {
        let cycle = self.places[place]
            .as_mut()
            .filter(|cycle| cycle.due <= now)?;
        cycle.due = now + u64::from(cycle.every) - u64::from(cycle.late);
        cycle.late = accuracy == IntervalAccuracy::OneScan && cycle.every > 1 && !cycle.late;
        cycle.due += u64::from(cycle.late);
        Some(cycle.register)
    }

    /// The cycles in the order of their places.
    pub fn running(&self) -> impl Iterator<Item = &Cycle> {
        self.places.iter().flatten()
    }

    /// What decides the frames from millisecond `now` on: by place the register, the interval, the times until the next frame, and how many
    /// requests have come since.
    pub fn state(&self, now: u64) -> impl Iterator<Item = impl std::hash::Hash> {
        let places = self.places.iter().enumerate();
        places.filter_map(move |(place, cycle)| {
            let cycle = (*cycle)?;
            let times = (
                cycle.due.saturating_sub(now),
                cycle.late,
                self.requests - cycle.order,
            );
            Some((place, cycle.register, cycle.every, times))
        })
    }

    fn place_of(&self, register: u8) -> Option<usize> {
        self.places
            .iter()
            .position(|cycle| cycle.is_some_and(|cycle| cycle.register == register))
    }

    fn to_give_up(&self, full: TableFull) -> Option<usize> {
        let oldest = || (0..CYCLES).min_by_key(|&place| self.places[place].map(|c| c.order));
        match full {
            TableFull::Refuse => None,
            TableFull::Oldest => oldest(),
        }
    }
}
