//! The shell around a [`ServedBus`]: one thread that waits for sockets, pseudo terminals, signals and the next deadline.

use super::clock::Clock;
use super::control_stream::ControlStream;
use super::place::{ControlPlace, ServedAt};
use super::pty::{Pty, PtyEvent};
use super::served::ServedBus;
use super::stage::Stage;
use super::tcp::Tcp;
use crate::counted::counted;
use crate::listen::ListenError;
use crate::port::wake_on_time;
use crate::signals;
use harness_proto::time::{Instant, Span};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::io::{self, Read};
use std::net::SocketAddr;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

/// Bytes read at a time.
const CHUNK: usize = 4096;

/// How long before an awaited byte is due the server stops sleeping and polls: waking up takes longer than handing the byte over.
const AWAKE: Span = Span::from_micros(60);

/// What is served where, and for how long.
#[derive(Clone, Debug)]
pub struct ServeOptions<P> {
    /// Where: each seat of a server of octets in order, its rings, then its inner links; or a bus of frames.
    pub places: Vec<P>,
    /// Where lines of control come from, if there are any.
    pub control: Option<ControlPlace>,
    /// Where the live page is served, if it is.
    pub page: Option<String>,
    /// Whether sockets may listen at addresses that other machines reach.
    pub allow_remote: bool,
    /// Whether serving ends when the clients have disconnected.
    pub once: bool,
    /// How long to serve; `None` until a signal arrives.
    pub length: Option<Span>,
}

impl<P> Default for ServeOptions<P> {
    /// Nowhere, without a page, until a signal comes.
    fn default() -> Self {
        Self {
            places: Vec::new(),
            control: None,
            page: None,
            allow_remote: false,
            once: false,
            length: None,
        }
    }
}

/// Why serving has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServeEnd {
    /// A signal that ends programs, such as SIGINT, SIGTERM or SIGHUP; or the drop of the handle.
    Interrupted,
    TimeOver,
    /// The clients have disconnected, and serving was to end with them.
    ClientsGone,
}

/// Why rings cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// As many places as rings are needed.
    #[error("--tcp or --pty is expected once for each ring: {given} given, {rings} needed")]
    Places {
        /// How many there are.
        given: usize,
        /// How many rings there are.
        rings: usize,
    },
    /// The bus has another medium than this way of serving.
    #[error("this bus is not served in this way; see the help of sim")]
    Medium,
    /// A socket does not listen.
    #[error(transparent)]
    Listen(#[from] ListenError),
    #[error("{} exists already; name another path, or remove it if no program serves there", path.display())]
    Exists { path: PathBuf },
    /// The pseudo terminal cannot be made.
    #[error("failed to open a pseudo terminal at {}: {error}", path.display())]
    Pty {
        /// The path of the link.
        path: PathBuf,
        error: io::Error,
    },
    /// Waiting for events or setting up signals failed.
    #[error("failed to wait for clients: {0}")]
    Wait(io::Error),
    /// Results cannot be written.
    #[error("failed to write: {0}")]
    Output(io::Error),
}

/// Receives the server's output.
pub trait ServeHost {
    /// A line for tools, without its end: a ring is ready, or the answer to a line of control.
    ///
    /// # Errors
    /// It cannot be written; serving ends.
    fn tell(&mut self, line: &str) -> io::Result<()>;

    /// A line for people, without its end.
    fn say(&mut self, line: &str);

    fn listens(&mut self, at: SocketAddr) {
        let _told_by_a_line = at;
    }
}

/// Serves rings until its options end it. Links to pseudo terminals are removed on every way out.
///
/// # Errors
/// A place cannot be opened, or the system fails. Nothing is left behind then.
pub fn serve(
    server: impl ServedBus,
    options: &ServeOptions<ServedAt>,
    host: &mut dyn ServeHost,
) -> Result<ServeEnd, ServeError> {
    let ending = EndRequest::by_signals().map_err(ServeError::Wait)?;
    serve_until(ending, server, options, host)
}

/// The same, until `ending`.
///
/// # Errors
/// As [`serve`].
pub fn serve_until(
    ending: EndRequest,
    mut server: impl ServedBus,
    options: &ServeOptions<ServedAt>,
    host: &mut dyn ServeHost,
) -> Result<ServeEnd, ServeError> {
    if options.places.len() != server.seats() {
        let inner = server.seats() - server.masters();
        return Err(ServeError::Places {
            given: options.places.len().saturating_sub(inner),
            rings: server.masters(),
        });
    }
    let mut ends = Vec::new();
    for place in &options.places {
        ends.push(match place {
            ServedAt::Tcp(address) => ClientEnd::Tcp(Tcp::listen(address, options.allow_remote)?),
            ServedAt::Pty(path) => ClientEnd::Pty(Pty::open(path)?),
            ServedAt::Nowhere => ClientEnd::Nowhere,
        });
    }
    let control = options.control.as_ref();
    let control = control
        .map(|place| ControlStream::open(place, options.allow_remote))
        .transpose()?;
    let page = options.page.as_ref();
    let stage = page
        .map(|place| Stage::open(place, options.allow_remote, server.live()))
        .transpose()?;
    let mut shell = Shell {
        stage,
        garbled: vec![false; ends.len()],
        losing: vec![false; ends.len()],
        server: &mut server,
        ends,
        control,
        host,
        ending,
        clock: Clock::start(),
        here: 0,
        gone: false,
    };
    shell.announce()?;
    shell.run(options)
}

/// What ends serving from outside, as a stream that is readable then.
#[derive(Debug)]
pub struct EndRequest {
    read: UnixStream,
    ids: Vec<signal_hook::SigId>,
}

impl EndRequest {
    /// The signals that end the program.
    pub(super) fn by_signals() -> io::Result<Self> {
        let (read, write) = UnixStream::pair()?;
        read.set_nonblocking(true)?;
        let mut ids = Vec::new();
        for signal in signals::ending() {
            let write = write.try_clone()?;
            ids.push(signal_hook::low_level::pipe::register(signal, write)?);
        }
        Ok(Self { read, ids })
    }

    /// The drop of a handle.
    ///
    /// # Errors
    /// The system has no sockets left.
    pub fn by_handle() -> io::Result<(UnixStream, Self)> {
        let (read, write) = UnixStream::pair()?;
        read.set_nonblocking(true)?;
        let ids = Vec::new();
        Ok((write, Self { read, ids }))
    }

    /// What to wait for.
    pub(super) fn poll(&self) -> PollFd<'_> {
        PollFd::new(&self.read, PollFlags::IN)
    }

    /// Whether it has come. A handle that was dropped reads as the end of the stream.
    pub(super) fn has_come(&mut self) -> bool {
        self.read.read(&mut [0]).is_ok()
    }
}

impl Drop for EndRequest {
    fn drop(&mut self) {
        for id in &self.ids {
            signal_hook::low_level::unregister(*id);
        }
    }
}

/// Where a client's stream comes from.
enum ClientEnd {
    Tcp(Tcp),
    Pty(Pty),
    Nowhere,
}

struct Shell<'a> {
    server: &'a mut dyn ServedBus,
    ends: Vec<ClientEnd>,
    control: Option<ControlStream>,
    stage: Option<Stage>,
    host: &'a mut dyn ServeHost,
    ending: EndRequest,
    clock: Clock,
    here: usize,
    /// Whether clients were connected and all have disconnected.
    gone: bool,
    /// Whether each seat's client has sent wrong marks; reported once per client.
    garbled: Vec<bool>,
    /// Whether each seat's client has lost bytes; reported once per client.
    losing: Vec<bool>,
}

impl Shell<'_> {
    /// One line for each place, once all of them are ready.
    fn announce(&mut self) -> Result<(), ServeError> {
        let mut lines = Vec::new();
        for (seat, end) in self.ends.iter().enumerate() {
            let place = match end {
                ClientEnd::Tcp(tcp) => {
                    self.host.listens(tcp.address());
                    tcp.address().to_string()
                }
                ClientEnd::Pty(pty) => pty.link().display().to_string(),
                ClientEnd::Nowhere => continue,
            };
            lines.push(format!("{} at {place}", self.server.title(seat)));
        }
        let control = self.control.as_ref().and_then(ControlStream::address);
        lines.extend(control.map(|address| format!("control at {address}")));
        lines.extend(self.stage.iter().map(Stage::line));
        for line in lines {
            self.host.tell(&line).map_err(ServeError::Output)?;
        }
        Ok(())
    }

    fn run(&mut self, options: &ServeOptions<ServedAt>) -> Result<ServeEnd, ServeError> {
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
            let seats = 0..self.ends.len();
            for seat in seats.clone().filter(|_| ready) {
                self.attend(seat);
            }
            self.server.advance(self.clock.now());
            for line in self.server.remarks() {
                self.host.say(&line);
            }
            for seat in seats {
                if let Err(error) = self.speak(seat) {
                    self.fail(seat, &error);
                }
            }
            if ready && let Some(control) = &mut self.control {
                let server = &mut *self.server;
                let obeyed = control.obey(self.host, &mut |line| server.control(line));
                obeyed.map_err(ServeError::Output)?;
            }
            let now = self.clock.now();
            if let Some(stage) = &mut self.stage
                && (ready || stage.deadline() <= now)
            {
                stage.work(self.server.live(), now);
            }
            if options.once && self.gone {
                return Ok(ServeEnd::ClientsGone);
            }
        }
    }

    /// Waits until something can be read or written, at most until `until`, and returns whether something can. In the last
    /// [`AWAKE`] before an awaited byte is due it polls without sleeping, so that the byte is handed over on time.
    fn wait(&mut self, until: Instant) -> io::Result<bool> {
        let awaited = self.server.awaited();
        let mut fds = vec![self.ending.poll()];
        for (seat, end) in self.ends.iter().enumerate() {
            let mut stream = PollFlags::empty();
            stream.set(PollFlags::IN, self.server.room(seat) > 0);
            stream.set(PollFlags::OUT, !self.server.transmit(seat).is_empty());
            match end {
                ClientEnd::Tcp(tcp) => {
                    let (door, client) = tcp.polls(stream);
                    fds.push(door);
                    fds.extend(client);
                }
                ClientEnd::Pty(pty) => fds.extend(pty.polls(stream).into_iter().flatten()),
                ClientEnd::Nowhere => {}
            }
        }
        fds.extend(self.control.iter().flat_map(ControlStream::polls));
        fds.extend(self.stage.iter().map(Stage::poll));
        loop {
            let now = self.clock.now();
            let wake = awaited.map_or(until, |home| until.min(home - AWAKE));
            let nanos = wake.since(now).as_nanos();
            let longest = Timespec {
                tv_sec: i64::try_from(nanos / 1_000_000_000).unwrap_or(i64::MAX),
                tv_nsec: i64::try_from(nanos % 1_000_000_000).unwrap_or(0),
            };
            match poll(&mut fds, Some(&longest)) {
                Ok(0) if self.clock.now() < until => {}
                Ok(ready) => return Ok(ready > 0),
                Err(rustix::io::Errno::INTR) => return Ok(true),
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Lets clients come, speak and go.
    fn attend(&mut self, seat: usize) {
        let visitors = match &mut self.ends[seat] {
            ClientEnd::Tcp(tcp) => tcp.accept(),
            ClientEnd::Pty(_) | ClientEnd::Nowhere => Vec::new(),
        };
        for (client, address) in visitors {
            // Who closes a connection and opens the next one has gone before it comes.
            if let Err(error) = self.hear(seat) {
                self.fail(seat, &error);
            }
            match &mut self.ends[seat] {
                ClientEnd::Tcp(tcp) if !tcp.taken() => {
                    tcp.seat(client);
                    self.come(seat, &format!("client {address} came"));
                }
                _ => self.say(
                    seat,
                    &format!("client {address} was turned away: another one is there"),
                ),
            }
        }
        match (self.hear(seat), &mut self.ends[seat]) {
            (Err(error), _) => self.fail(seat, &error),
            // Keeps the client's seat until its input is drained.
            (Ok(true), ClientEnd::Pty(pty)) => {
                if let Some(change) = pty.change() {
                    self.change(seat, change);
                }
            }
            (Ok(_), _) => {}
        }
    }

    /// Handles a failed stream. A socket's client has disconnected. At a pseudo terminal no client is left, which its hang-up shows.
    fn fail(&mut self, seat: usize, error: &io::Error) {
        if let ClientEnd::Tcp(tcp) = &mut self.ends[seat]
            && tcp.taken()
        {
            tcp.close();
            let why = match error.kind() {
                io::ErrorKind::UnexpectedEof => String::new(),
                _ => format!(" ({error})"),
            };
            self.go(seat, &format!("the client has gone{why}"));
        }
    }

    /// Handles a client that opens or closes a pseudo terminal.
    fn change(&mut self, seat: usize, change: PtyEvent) {
        match change {
            PtyEvent::Came => self.come(seat, "a client came"),
            PtyEvent::Gone => {
                // Reads what the client sent last. An error only means that no client is left.
                let _read = self.hear(seat);
                let another = match &mut self.ends[seat] {
                    ClientEnd::Pty(pty) => pty.gone(),
                    ClientEnd::Tcp(_) | ClientEnd::Nowhere => false,
                };
                self.go(seat, "the client has gone");
                if another {
                    self.come(seat, "a client came");
                }
            }
        }
    }

    fn come(&mut self, seat: usize, text: &str) {
        self.here += 1;
        self.gone = false;
        self.garbled[seat] = false;
        self.losing[seat] = false;
        self.server.come(seat);
        self.say(seat, text);
    }

    fn go(&mut self, seat: usize, text: &str) {
        self.here = self.here.saturating_sub(1);
        self.gone = self.here == 0;
        let lost = match self.server.lost(seat) {
            0 => String::new(),
            lost => format!("; {} lost", counted(lost, "byte")),
        };
        self.server.go(seat);
        self.say(seat, &format!("{text}{lost}"));
    }

    fn say(&mut self, seat: usize, text: &str) {
        self.host
            .say(&format!("{}: {text}", self.server.name(seat)));
    }

    /// Reads what a client has sent, as far as there is room. Returns whether that was all. What the system has had for a while came
    /// then, and not now.
    fn hear(&mut self, seat: usize) -> io::Result<bool> {
        let mut buffer = [0; CHUNK];
        loop {
            let room = self.server.room(seat).min(CHUNK);
            if room == 0 {
                return Ok(false);
            }
            let read = match &mut self.ends[seat] {
                ClientEnd::Tcp(tcp) => tcp.read(&mut buffer[..room]),
                ClientEnd::Pty(pty) => pty.read(&mut buffer[..room]).map(|read| (read, Span::ZERO)),
                ClientEnd::Nowhere => return Ok(true),
            };
            let (read, ago) = match read {
                Ok((0, _)) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(true),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            let news = match &mut self.ends[seat] {
                ClientEnd::Pty(pty) => pty.heard(),
                ClientEnd::Tcp(_) | ClientEnd::Nowhere => false,
            };
            if news {
                self.come(seat, "a client came");
            }
            self.server.advance(self.clock.left(ago));
            if let Err(bad) = self.server.receive(seat, &buffer[..read])
                && !std::mem::replace(&mut self.garbled[seat], true)
            {
                self.say(seat, &bad.to_string());
            }
        }
    }

    /// Sends a client its output, as far as it takes it.
    fn speak(&mut self, seat: usize) -> io::Result<()> {
        if self.server.lost(seat) > 0 && !std::mem::replace(&mut self.losing[seat], true) {
            self.say(seat, "bytes are lost: the client does not read");
        }
        loop {
            let bytes = self.server.transmit(seat);
            if bytes.is_empty() {
                return Ok(());
            }
            let before = std::time::Instant::now();
            let written = match &mut self.ends[seat] {
                ClientEnd::Tcp(tcp) => tcp.write(bytes),
                ClientEnd::Pty(pty) => pty.write(bytes),
                ClientEnd::Nowhere => return Ok(()),
            };
            match written {
                Ok(written) => {
                    self.clock.handed_over(before.elapsed());
                    self.server.transmitted(seat, written);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }
}
