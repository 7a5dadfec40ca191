//! The shell around a [`FrameServer`]: one thread that waits for sockets, pseudo terminals, signals and the next deadline.

use super::{FrameServer, MOST_CLIENTS, Protocol, SharedBus};
use crate::counted::counted;
use crate::port::wake_on_time;
use crate::serve::ServedAt;
use crate::serve::arrival::ClientStream;
use crate::serve::clock::Clock;
use crate::serve::control_stream::ControlStream;
use crate::serve::pty::{Pty, PtyEvent};
use crate::serve::shell::{EndRequest, ServeEnd, ServeError, ServeHost, ServeOptions};
use crate::serve::stage::Stage;
use crate::serve::tcp::Listener;
use harness_proto::time::{Instant, Span};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io;

/// Bytes read at a time.
const CHUNK: usize = 4096;

/// Where a bus is served, and in which language.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePlace {
    pub protocol: Protocol,
    /// A socket for several clients, or a pseudo terminal for one.
    pub at: ServedAt,
}

/// Serves a bus until its options end it. Links to pseudo terminals are removed on every way out.
///
/// # Errors
/// A place cannot be opened, or the system fails. Nothing is left behind then.
pub fn serve_frames<B: SharedBus>(
    mut bus: B,
    options: &ServeOptions<FramePlace>,
    host: &mut dyn ServeHost,
) -> Result<ServeEnd, ServeError> {
    let ending = EndRequest::by_signals().map_err(ServeError::Wait)?;
    let mut doors = Vec::new();
    let mut seats = Vec::new();
    for FramePlace { protocol, at } in &options.places {
        match at {
            ServedAt::Tcp(address) => {
                doors.push((*protocol, Listener::open(address, options.allow_remote)?));
            }
            ServedAt::Pty(path) => seats.push(Seat {
                protocol: *protocol,
                end: SeatStream::Pty(Pty::open(path)?),
                client: None,
                name: String::new(),
                wrong: false,
                losing: false,
            }),
            ServedAt::Nowhere => {}
        }
    }
    let control = options.control.as_ref();
    let control = control
        .map(|place| ControlStream::open(place, options.allow_remote))
        .transpose()?;
    let page = options.page.as_ref();
    let stage = page
        .map(|place| Stage::open(place, options.allow_remote, bus.live()))
        .transpose()?;
    let started = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    let mut shell = FrameShell {
        clock: Clock::start(),
        server: FrameServer::new(bus, started),
        doors,
        seats,
        control,
        stage,
        host,
        ending,
        here: 0,
        gone: false,
    };
    shell.announce()?;
    shell.run(options)
}

/// A place for a client: a pseudo terminal, or an accepted connection.
struct Seat {
    protocol: Protocol,
    end: SeatStream,
    /// Its number with the server, while a client is here.
    client: Option<usize>,
    /// What the client is called.
    name: String,
    /// Whether it has sent something wrong; reported once per client.
    wrong: bool,
    /// Whether it has lost frames; reported once per client.
    losing: bool,
}

enum SeatStream {
    Tcp(ClientStream),
    Pty(Pty),
}

struct FrameShell<'a, B> {
    server: FrameServer<B>,
    doors: Vec<(Protocol, Listener)>,
    seats: Vec<Seat>,
    control: Option<ControlStream>,
    stage: Option<Stage>,
    host: &'a mut dyn ServeHost,
    ending: EndRequest,
    clock: Clock,
    here: usize,
    /// Whether clients were connected and all have disconnected.
    gone: bool,
}

impl<B: SharedBus> FrameShell<'_, B> {
    /// One line for each place, once all of them are ready.
    fn announce(&mut self) -> Result<(), ServeError> {
        let about = self.server.about();
        let mut lines = Vec::new();
        for (protocol, door) in &self.doors {
            self.host.listens(door.address());
            let address = door.address();
            lines.push(format!("{}: {about} at {address}", protocol.name()));
        }
        for seat in &self.seats {
            if let SeatStream::Pty(pty) = &seat.end {
                let place = pty.link().display();
                lines.push(format!("{}: {about} at {place}", seat.protocol.name()));
            }
        }
        let control = self.control.as_ref().and_then(ControlStream::address);
        lines.extend(control.map(|address| format!("control at {address}")));
        lines.extend(self.stage.iter().map(Stage::line));
        for line in lines {
            self.host.tell(&line).map_err(ServeError::Output)?;
        }
        Ok(())
    }

    fn run(&mut self, options: &ServeOptions<FramePlace>) -> Result<ServeEnd, ServeError> {
        wake_on_time();
        let end = options.length.map(|length| Instant::START + length);
        loop {
            if end.is_some_and(|end| end <= self.clock.now()) {
                return Ok(ServeEnd::TimeOver);
            }
            let news = self.stage.as_ref().map_or(Instant::NEVER, Stage::deadline);
            let until = self.server.deadline().min(end.unwrap_or(Instant::NEVER));
            let until = until.min(news);
            let ready = self.wait(until).map_err(ServeError::Wait)?;
            if ready && self.ending.has_come() {
                return Ok(ServeEnd::Interrupted);
            }
            if ready {
                self.accept();
                (0..self.seats.len()).for_each(|seat| self.attend(seat));
            }
            self.server.advance(self.clock.now());
            for seat in 0..self.seats.len() {
                if let Err(error) = self.speak(seat) {
                    self.fail(seat, &error);
                }
            }
            // A connection that has ended leaves its place.
            let stays =
                |seat: &Seat| seat.client.is_some() || matches!(seat.end, SeatStream::Pty(_));
            self.seats.retain(stays);
            if ready && let Some(control) = &mut self.control {
                let bus = self.server.bus();
                let obeyed = control.obey(self.host, &mut |line| bus.control(line));
                obeyed.map_err(ServeError::Output)?;
            }
            let now = self.clock.now();
            if let Some(stage) = &mut self.stage
                && (ready || stage.deadline() <= now)
            {
                stage.work(self.server.bus().live(), now);
            }
            if options.once && self.gone {
                return Ok(ServeEnd::ClientsGone);
            }
        }
    }

    /// Waits until something can be read or written, at most until `until`, and returns whether something can.
    fn wait(&mut self, until: Instant) -> io::Result<bool> {
        let mut fds = vec![self.ending.poll()];
        fds.extend(self.doors.iter().map(|(_, door)| door.poll()));
        for seat in &self.seats {
            let mut stream = PollFlags::empty();
            // A pseudo terminal without a client is read: that shows when one comes.
            let client = seat.client;
            let room = client.is_none_or(|client| self.server.room(client) > 0);
            let waits = client.is_some_and(|client| !self.server.transmit(client).is_empty());
            stream.set(PollFlags::IN, room);
            stream.set(PollFlags::OUT, waits);
            match &seat.end {
                SeatStream::Tcp(client) => fds.push(PollFd::new(client, stream)),
                SeatStream::Pty(pty) => fds.extend(pty.polls(stream).into_iter().flatten()),
            }
        }
        fds.extend(self.control.iter().flat_map(ControlStream::polls));
        fds.extend(self.stage.iter().map(Stage::poll));
        let nanos = until.since(self.clock.now()).as_nanos();
        let longest = Timespec {
            tv_sec: i64::try_from(nanos / 1_000_000_000).unwrap_or(i64::MAX),
            tv_nsec: i64::try_from(nanos % 1_000_000_000).unwrap_or(0),
        };
        match poll(&mut fds, Some(&longest)) {
            Ok(ready) => Ok(ready > 0),
            Err(rustix::io::Errno::INTR) => Ok(true),
            Err(error) => Err(error.into()),
        }
    }

    fn accept(&mut self) {
        for door in 0..self.doors.len() {
            let (protocol, listener) = &self.doors[door];
            let protocol = *protocol;
            let came: Vec<_> = listener.accept().collect();
            for (client, address) in came {
                self.seats.push(Seat {
                    protocol,
                    end: SeatStream::Tcp(client),
                    client: None,
                    name: format!("client {address}"),
                    wrong: false,
                    losing: false,
                });
                self.come(self.seats.len() - 1);
            }
        }
    }

    /// Gives a client its place on the bus; without one, a connection is closed.
    fn come(&mut self, seat: usize) {
        let taken = &mut self.seats[seat];
        taken.wrong = false;
        taken.losing = false;
        taken.client = self.server.come(taken.protocol);
        let text = match taken.client {
            Some(_) => {
                self.here += 1;
                self.gone = false;
                "came".to_owned()
            }
            None => format!("was turned away: {MOST_CLIENTS} clients are there, the most"),
        };
        self.say(seat, &text);
    }

    fn say(&mut self, seat: usize, text: &str) {
        let Seat { protocol, name, .. } = &self.seats[seat];
        self.host
            .say(&format!("{}: {name} {text}", protocol.name()));
    }

    /// Lets a client speak and go.
    fn attend(&mut self, seat: usize) {
        match (self.hear(seat), &mut self.seats[seat].end) {
            (Err(error), _) => self.fail(seat, &error),
            // Keeps the client's place until its input is drained.
            (Ok(true), SeatStream::Pty(pty)) => {
                if let Some(change) = pty.change() {
                    self.change(seat, change);
                }
            }
            (Ok(_), _) => {}
        }
    }

    /// Handles a failed stream. A connection has ended. At a pseudo terminal no client is left, which its hang-up shows.
    fn fail(&mut self, seat: usize, error: &io::Error) {
        if matches!(self.seats[seat].end, SeatStream::Tcp(_)) {
            let why = match error.kind() {
                io::ErrorKind::UnexpectedEof => String::new(),
                _ => format!(" ({error})"),
            };
            self.go(seat, &format!("has gone{why}"));
        }
    }

    /// Handles a client that opens or closes a pseudo terminal.
    fn change(&mut self, seat: usize, change: PtyEvent) {
        match change {
            PtyEvent::Came => self.come_to_terminal(seat),
            PtyEvent::Gone => {
                // Reads what the client sent last. An error only means that no client is left.
                let _read = self.hear(seat);
                let another = match &mut self.seats[seat].end {
                    SeatStream::Pty(pty) => pty.gone(),
                    SeatStream::Tcp(_) => false,
                };
                self.go(seat, "has gone");
                if another {
                    self.come_to_terminal(seat);
                }
            }
        }
    }

    fn come_to_terminal(&mut self, seat: usize) {
        if let SeatStream::Pty(pty) = &self.seats[seat].end {
            self.seats[seat].name = format!("client at {}", pty.link().display());
        }
        self.come(seat);
    }

    fn go(&mut self, seat: usize, text: &str) {
        let Some(client) = self.seats[seat].client.take() else {
            return;
        };
        self.here = self.here.saturating_sub(1);
        self.gone = self.here == 0;
        let lost = match self.server.lost(client) {
            0 => String::new(),
            lost => format!("; {} lost", counted(lost, "frame")),
        };
        self.server.go(client);
        self.say(seat, &format!("{text}{lost}"));
    }

    /// Reads what a client has sent, as far as there is room. Returns whether that was all. What the system has had for a while came
    /// then, and not now.
    fn hear(&mut self, seat: usize) -> io::Result<bool> {
        let mut buffer = [0; CHUNK];
        loop {
            let client = self.seats[seat].client;
            let room = client.map_or(CHUNK, |client| self.server.room(client).min(CHUNK));
            if room == 0 {
                return Ok(false);
            }
            let read = match &mut self.seats[seat].end {
                SeatStream::Tcp(client) => client.read(&mut buffer[..room]),
                SeatStream::Pty(pty) => {
                    pty.read(&mut buffer[..room]).map(|read| (read, Span::ZERO))
                }
            };
            let (read, ago) = match read {
                Ok((0, _)) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(true),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            let news = match &mut self.seats[seat].end {
                SeatStream::Pty(pty) => pty.heard(),
                SeatStream::Tcp(_) => false,
            };
            if news {
                self.come_to_terminal(seat);
            }
            let Some(client) = self.seats[seat].client else {
                continue;
            };
            self.server.advance(self.clock.left(ago));
            for wrong in self.server.receive(client, &buffer[..read]) {
                if !std::mem::replace(&mut self.seats[seat].wrong, true) {
                    self.say(seat, &format!("said something wrong: {wrong}"));
                }
            }
        }
    }

    /// Sends a client its output, as far as it takes it.
    fn speak(&mut self, seat: usize) -> io::Result<()> {
        let Some(client) = self.seats[seat].client else {
            return Ok(());
        };
        if self.server.lost(client) > 0 && !std::mem::replace(&mut self.seats[seat].losing, true) {
            self.say(seat, "loses frames: it does not read");
        }
        loop {
            let bytes = self.server.transmit(client);
            if bytes.is_empty() {
                return Ok(());
            }
            let before = std::time::Instant::now();
            let written = match &mut self.seats[seat].end {
                SeatStream::Tcp(client) => client.write(bytes),
                SeatStream::Pty(pty) => pty.write(bytes),
            };
            match written {
                Ok(written) => {
                    self.clock.handed_over(before.elapsed());
                    self.server.transmitted(client, written);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}
