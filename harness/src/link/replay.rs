//! A link that gives again what was recorded.
//!
//! The record's order decides: a byte comes where it came before, behind the same bytes sent. Who sends something
//! else than was sent then finds the link in trouble. Time is that of the record.

use super::{Capability, Event, Line, Link, Moment, PlacedFault, Trouble};
use harness_proto::line::{Rate, Received};
use harness_proto::time::{Instant, Span};
use harness_sim::trace::Trace;
use std::collections::VecDeque;

/// A record, played back.
#[derive(Clone, Debug)]
pub struct Replay {
    events: VecDeque<Event>,
    now: Instant,
    rate: Rate,
    tolerance: Span,
    drives: Vec<u8>,
    capabilities: Vec<Capability>,
    reaches: Vec<(usize, usize)>,
    trouble: Option<Trouble>,
}

impl Replay {
    /// What was recorded on rings of so many drives, on a link that could do so much.
    #[must_use]
    pub fn new(
        events: Vec<Event>,
        rate: Rate,
        tolerance: Span,
        drives: Vec<u8>,
        capabilities: Vec<Capability>,
    ) -> Self {
        let reached = events.iter().filter_map(|event| match event {
            Event::Fault(ring, _, PlacedFault::Link(link, _), _) => Some((*ring, *link)),
            _ => None,
        });
        Self {
            reaches: reached.collect(),
            // Which step came when is of no matter here.
            events: events
                .into_iter()
                .filter(|event| !matches!(event, Event::Step(_)))
                .collect(),
            now: Instant::START,
            rate,
            tolerance,
            drives,
            capabilities,
            trouble: None,
        }
    }

    /// The first thing that was recorded and not played back; `None` where all was. Bytes that nobody fetched and trouble that nobody
    /// ran into are no matter.
    #[must_use]
    pub fn left(&self) -> Option<String> {
        let words = |event: &Event| match event {
            Event::Received(..) | Event::Trouble(_) | Event::Step(_) => None,
            Event::Begin(_) => Some("another conversation".to_owned()),
            Event::Sent(_, at, bytes) => Some(format!("sending {} bytes until {at}", bytes.len())),
            Event::Fault(_, at, ..) => Some(format!("a fault at {at}")),
            Event::Probe(_, at, count, _) => Some(format!("{count} SYNCO from {at} on")),
        };
        match &self.trouble {
            // Behind trouble nothing is asked for.
            Some(_) => None,
            None => self.events.iter().find_map(words),
        }
    }

    fn otherwise(&mut self, what: &str) {
        let text = format!("the record holds something else than {what}: the scenario was changed");
        self.trouble.get_or_insert(Trouble::Garbled(text));
    }

    /// Whether the second event is a denial.
    fn denied_behind(&self) -> bool {
        let behind = self.events.get(1);
        matches!(behind, Some(Event::Trouble(Trouble::Denied(_))))
    }

    fn trouble_comes(&mut self) {
        if let Some(Event::Trouble(trouble)) = self.events.front() {
            self.trouble = Some(trouble.clone());
            self.events.pop_front();
        }
    }
}

impl Line for Replay {
    fn byte_time(&self) -> Span {
        self.rate.byte_time()
    }

    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, ring: usize, bytes: &[u8]) -> Instant {
        if self.trouble.is_some() {
            return self.now;
        }
        match self.events.front() {
            Some(Event::Sent(own, end, sent)) if *own == ring && sent == bytes => {
                let end = *end;
                self.events.pop_front();
                self.trouble_comes();
                end
            }
            // What was denied was not sent.
            Some(Event::Sent(own, end, sent))
                if *own == ring && bytes.starts_with(sent) && self.denied_behind() =>
            {
                let end = *end;
                self.events.pop_front();
                self.trouble_comes();
                end
            }
            Some(Event::Trouble(Trouble::Denied(_))) => {
                self.trouble_comes();
                self.now
            }
            _ => {
                self.otherwise("what is sent");
                self.now
            }
        }
    }

    fn receive(&mut self, ring: usize) -> Option<(Instant, Received)> {
        // In real time whoever wanted to wait until a time has waited longer, and fetched what came meanwhile.
        let late = self.tolerance > Span::ZERO;
        match self.events.front() {
            Some(Event::Received(own, at, byte)) if *own == ring && (late || *at <= self.now) => {
                let byte = (*at, *byte);
                self.events.pop_front();
                self.now = self.now.max(byte.0);
                Some(byte)
            }
            _ => None,
        }
    }

    fn wait(&mut self, until: Instant) -> bool {
        self.trouble_comes();
        if self.trouble.is_some() {
            return false;
        }
        // The next byte that comes, behind those that have come and that nobody has fetched.
        let mut bytes = self.events.iter().map_while(|event| match event {
            Event::Received(_, at, _) => Some(*at),
            _ => None,
        });
        let now = self.now;
        let next = bytes.find(|at| *at > now);
        self.now = next.map_or(until, |at| at.min(until)).max(now);
        !self.events.is_empty()
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.trouble.as_ref()
    }
}

impl Link for Replay {
    fn capabilities(&self) -> &[Capability] {
        &self.capabilities
    }

    fn begin(&mut self) {
        while matches!(self.events.front(), Some(Event::Received(..))) {
            self.events.pop_front();
        }
        match self.events.pop_front() {
            Some(Event::Begin(_)) => self.now = Instant::START,
            Some(other) => {
                self.events.push_front(other);
                self.otherwise("the beginning of a conversation");
            }
            None => self.otherwise("the beginning of a conversation"),
        }
    }

    fn busy(&self) -> bool {
        matches!(self.events.front(), Some(Event::Received(..)))
    }

    fn inject(&mut self, ring: usize, fault: PlacedFault, moment: Moment) {
        match self.events.front() {
            Some(Event::Fault(own, _, known, then))
                if (*own, *known, *then) == (ring, fault, moment) =>
            {
                self.events.pop_front();
            }
            _ => self.otherwise("the fault that is asked for"),
        }
    }

    fn reaches(&self, ring: usize, link: usize) -> bool {
        self.reaches.contains(&(ring, link))
    }

    fn time_tolerance(&self) -> Span {
        self.tolerance
    }

    fn probe(&mut self, ring: usize, count: usize) -> Vec<Received> {
        match self.events.pop_front() {
            Some(Event::Probe(own, at, known, bytes)) if (own, known) == (ring, count) => {
                self.now = self.now.max(at);
                bytes
            }
            other => {
                if let Some(other) = other {
                    self.events.push_front(other);
                }
                self.otherwise("SYNCO that let the ring spell out its address");
                Vec::new()
            }
        }
    }

    fn unused_faults(&self) -> Vec<String> {
        Vec::new()
    }

    fn carried(&self) -> u64 {
        0
    }

    fn drives(&self, ring: usize) -> u8 {
        self.drives.get(ring).copied().unwrap_or(0)
    }

    fn trace(&self, ring: usize) -> Trace {
        Trace {
            drives: self.drives(ring),
            links: Vec::new(),
            marks: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(at: u64) -> Instant {
        Instant::START + Span::from_millis(at)
    }

    /// A byte that comes long behind the time until which it was waited for, and one that is sent then.
    fn overslept(tolerance: Span) -> Replay {
        let byte = Received::good(0x80);
        let events = vec![
            Event::Begin(Instant::START),
            Event::Sent(0, ms(1), vec![0x80]),
            Event::Received(0, ms(300), byte),
            Event::Sent(0, ms(301), vec![0x81]),
        ];
        Replay::new(events, Rate::default(), tolerance, vec![1], Vec::new())
    }

    /// Sends, looks for an answer until a time as whoever listens does, and sends what comes next.
    fn play(replay: &mut Replay) -> Vec<Instant> {
        replay.begin();
        replay.send(0, &[0x80]);
        let mut came = Vec::new();
        while replay.now() < ms(50) {
            replay.wait(ms(50));
            while let Some((at, _)) = replay.receive(0) {
                came.push(at);
            }
        }
        replay.send(0, &[0x81]);
        came
    }

    #[test]
    fn whoever_slept_too_long_has_fetched_what_came_meanwhile() {
        let mut replay = overslept(Span::from_millis(20));
        assert_eq!(play(&mut replay), [ms(300)]);
        assert_eq!((replay.trouble(), replay.left()), (None, None));
    }

    #[test]
    fn nobody_sleeps_too_long_where_time_is_virtual() {
        let mut replay = overslept(Span::ZERO);
        assert_eq!(play(&mut replay), []);
        let trouble = replay.trouble().expect("trouble").to_string();
        assert!(
            trouble.contains("something else than what is sent"),
            "{trouble}"
        );
    }
}
