//! Clients of a simulated CAN bus, without I/O: bytes and the time are arguments, the deadline is a return value.

use super::SharedBus;
use super::session::{Act, Protocol, Session};
use harness_proto::can::CanEvent;
use harness_proto::time::{Instant, Span};
use harness_sim::segment::Host;
use std::collections::VecDeque;
use std::time::Duration;

/// How many clients there can be at a time.
pub const MOST_CLIENTS: usize = 16;

/// Frames of a client that wait for the bus; while there are more, nothing is read of the client.
const WAITING: usize = 64;

/// Maximum number of bytes that wait for a client. Frames that do not fit are lost, as in an adapter that is not read.
const UNREAD: usize = 64 << 10;

/// The most time that is made up for at once. A program that was stopped for longer resumes where it was.
const CATCH_UP: Span = Span::from_millis(1_000);

/// The longest wait for something that happens by itself.
const IDLE: Span = Span::from_millis(1_000);

/// How long the station of a disconnected client may continue to send its queue.
const AFTERWARDS: Span = Span::from_millis(1_000);

/// A simulated bus and its clients.
#[derive(Debug)]
pub struct FrameServer<B> {
    bus: B,
    seats: Vec<StationSeat>,
    /// The bus's time `base.1` is the clock's time `base.0`.
    base: (Instant, Instant),
    clock: Instant,
    /// When the bus's time began, since 1970.
    started: Duration,
}

#[derive(Debug, Default)]
struct StationSeat {
    client: Option<Client>,
    /// Whether it is a station of the bus.
    joined: bool,
    /// When it stops being one, at the latest.
    leaves: Option<Instant>,
}

#[derive(Debug)]
struct Client {
    session: Session,
    /// What its station has heard of which the end is to come.
    heard: VecDeque<(Instant, CanEvent)>,
    /// For the client.
    outbox: VecDeque<u8>,
    /// What was heard last: an error that repeats is reported once.
    last: Option<CanEvent>,
    lost: u64,
}

impl<B: SharedBus> FrameServer<B> {
    /// Serves a bus, without clients at first. The clock starts at [`Instant::START`]; `started` is that moment, since 1970.
    #[must_use]
    pub fn new(mut bus: B, started: Duration) -> Self {
        for client in 0..MOST_CLIENTS {
            bus.put(client, Host::listener());
        }
        Self {
            base: (Instant::START, bus.now()),
            seats: (0..MOST_CLIENTS).map(|_| StationSeat::default()).collect(),
            clock: Instant::START,
            started,
            bus,
        }
    }

    pub const fn bus(&mut self) -> &mut B {
        &mut self.bus
    }

    /// The stations of the bus besides the clients.
    #[must_use]
    pub fn about(&self) -> String {
        self.bus.about()
    }

    /// A client comes, and gets a number; `None` while there is no place for it.
    pub fn come(&mut self, protocol: Protocol) -> Option<usize> {
        let free = |seat: &StationSeat| seat.client.is_none() && !seat.joined;
        let number = self.seats.iter().position(free)?;
        let session = Session::new(protocol, self.bus.rate(), self.started);
        let mut greeting = Vec::new();
        session.greet(&mut greeting);
        self.seats[number].client = Some(Client {
            session,
            heard: VecDeque::new(),
            outbox: greeting.into(),
            last: None,
            lost: 0,
        });
        Some(number)
    }

    /// The client has disconnected: its unread output is dropped, and what it has sent is still transmitted.
    pub fn go(&mut self, client: usize) {
        self.leave(client);
        if let Some(seat) = self.seats.get_mut(client) {
            seat.client = None;
        }
    }

    /// How many bytes of the client's stream are taken now.
    #[must_use]
    pub fn room(&mut self, client: usize) -> usize {
        let waiting = self.bus.host(client).map_or(0, |host| host.waiting());
        match self.seats.get(client).and_then(|seat| seat.client.as_ref()) {
            Some(served) if waiting < WAITING => UNREAD.saturating_sub(served.outbox.len()),
            _ => 0,
        }
    }

    /// Takes bytes of the client's stream. Gives what is wrong with them, for people.
    pub fn receive(&mut self, client: usize, bytes: &[u8]) -> Vec<String> {
        let mut said = Vec::new();
        let mut answers = Vec::new();
        let seat = self.seats.get_mut(client);
        let Some(served) = seat.and_then(|seat| seat.client.as_mut()) else {
            return said;
        };
        let now = self.bus.now();
        let acts = served.session.receive(now, bytes, &mut answers);
        served.outbox.extend(answers);
        for act in acts {
            match act {
                Act::Say(text) => said.push(text),
                Act::Leave => self.leave(client),
                Act::Join { listen_only } => self.join(client, listen_only),
                Act::Send(frame) => {
                    if let Some(host) = self.bus.host(client) {
                        host.send(now, frame);
                    }
                }
            }
        }
        said
    }

    fn join(&mut self, client: usize, listen_only: bool) {
        let host = match listen_only {
            true => Host::listener(),
            false => Host::default(),
        };
        self.bus.put(client, host);
        if let Some(seat) = self.seats.get_mut(client) {
            seat.joined = true;
            seat.leaves = None;
        }
    }

    fn leave(&mut self, client: usize) {
        let latest = self.bus.now() + AFTERWARDS;
        if let Some(seat) = self.seats.get_mut(client).filter(|seat| seat.joined) {
            seat.leaves = Some(latest);
        }
    }

    /// Lets time pass up to the clock's time `clock`.
    pub fn advance(&mut self, clock: Instant) {
        self.clock = self.clock.max(clock);
        let (from, to) = self.base;
        let due = to + self.clock.since(from);
        let most = self.bus.now() + CATCH_UP;
        self.bus.advance(due.min(most));
        self.fetch();
        if due > most {
            self.base = (self.clock, self.bus.now());
        }
    }

    /// Hands over what the clients' stations have heard by now.
    fn fetch(&mut self) {
        let (now, base) = (self.bus.now(), self.base);
        for (number, seat) in self.seats.iter_mut().enumerate() {
            let Some(host) = self.bus.host(number) else {
                continue;
            };
            if let Some(client) = &mut seat.client {
                client.heard.extend(std::iter::from_fn(|| host.receive()));
                client.deliver(now, base);
            }
            host.forget();
            if seat
                .leaves
                .is_some_and(|latest| host.waiting() == 0 || latest <= now)
            {
                seat.joined = false;
                seat.leaves = None;
                self.bus.put(number, Host::listener());
            }
        }
    }

    /// What there is for a client.
    pub fn transmit(&mut self, client: usize) -> &[u8] {
        let seat = self.seats.get_mut(client);
        seat.and_then(|seat| seat.client.as_mut())
            .map_or(&[], |served| served.outbox.make_contiguous())
    }

    /// The first `count` bytes of that have been passed on.
    pub fn transmitted(&mut self, client: usize, count: usize) {
        let seat = self.seats.get_mut(client);
        if let Some(served) = seat.and_then(|seat| seat.client.as_mut()) {
            served.outbox.drain(..count.min(served.outbox.len()));
        }
    }

    /// How many frames the client has lost because it did not read.
    #[must_use]
    pub fn lost(&self, client: usize) -> u64 {
        let seat = self.seats.get(client);
        seat.and_then(|seat| seat.client.as_ref())
            .map_or(0, |served| served.lost)
    }

    /// When, by the clock, [`Self::advance`] is to be called again if nothing comes before.
    #[must_use]
    pub fn deadline(&self) -> Instant {
        let (from, to) = self.base;
        let clients = self.seats.iter().filter_map(|seat| seat.client.as_ref());
        let heard = clients.filter_map(|client| {
            let (at, _) = client.heard.front()?;
            Some(client.session.holds_until().max(*at))
        });
        let leaves = self.seats.iter().filter_map(|seat| seat.leaves);
        let next = heard.chain(leaves).chain(self.bus.next_event()).min();
        let idle = self.clock + IDLE;
        next.map_or(idle, |next| (from + next.since(to)).min(idle))
            .max(self.clock)
    }
}

impl Client {
    /// Tells the client what has ended by `now`. An adapter stamps by a clock of its own, which goes on where the bus stood still because the
    /// computer did: `base` is a time of the clock, and that of the bus then.
    fn deliver(&mut self, now: Instant, base: (Instant, Instant)) {
        while let Some(&(at, heard)) = self.heard.front()
            && self.session.holds_until().max(at) <= now
        {
            self.heard.pop_front();
            let repeats = matches!(heard, CanEvent::Error(_)) && self.last == Some(heard);
            self.last = Some(heard);
            if repeats {
                continue;
            }
            let mut bytes = Vec::new();
            let stamped = base.0 + at.since(base.1);
            self.session.hear(stamped, heard, &mut bytes);
            if self.outbox.len() + bytes.len() > UNREAD {
                self.lost += 1;
            } else {
                self.outbox.extend(bytes);
            }
        }
    }
}
