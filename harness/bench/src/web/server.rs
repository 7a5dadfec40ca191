//! The server: a thread that accepts, and a thread a connection, each with time-outs and bounds.

use super::feed::{Feed, FeedPiece};
use super::gate::{Route, admit, hosts, order};
use super::page::{page, policy};
use super::request::{MAX_HEAD, Read, Refusal, RequestHead, read};
use super::view::{LiveOrder, LiveScene};
use crate::listen::{ListenError, listen};
use rustix::event::{PollFd, PollFlags, poll};
use std::fmt::Write as _;
use std::io::{self, Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The most connections at a time. A page needs two.
const MAX_CONNECTIONS: usize = 64;
/// The most orders that wait for the bench.
const MAX_ORDERS: usize = 16;
/// The patience with clients.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often an idle stream sends a comment, by which a disconnected client is noticed.
const ALIVE: Duration = Duration::from_secs(3);
/// How long the bench may take for an order.
const ORDER: Duration = Duration::from_secs(5);
/// What of a refused request is still read, so that the client reads the answer before the connection ends.
const DRAINED: usize = 256 << 10;
const DRAIN: Duration = Duration::from_millis(500);
/// The stack of a connection's thread.
const STACK: usize = 256 << 10;

/// An order of a page, and where its answer goes.
#[derive(Debug)]
pub(crate) struct PendingOrder {
    pub order: LiveOrder,
    reply: SyncSender<Result<String, String>>,
}

impl PendingOrder {
    /// Answers: what was done, or why not.
    pub(crate) fn answer(self, answer: Result<String, String>) {
        // A client that has gone needs no answer.
        let _gone = self.reply.try_send(answer);
    }
}

/// What the threads of connections share.
struct PageState {
    name: String,
    token: String,
    scene: String,
    read_only: Option<String>,
    feed: Arc<Feed>,
    orders: SyncSender<PendingOrder>,
    wake: UnixStream,
    connections: AtomicUsize,
    /// How long a request may take to come, and how long a client may take nothing.
    patience: Duration,
}

impl PageState {
    /// Wakes the bench: a page was opened or has sent an order.
    fn wake(&self) {
        // A bench that has not read the last byte is awake.
        let _awake = (&self.wake).write(&[0]);
    }
}

/// A page that is served, until it is dropped.
#[derive(Debug)]
pub(crate) struct LivePage {
    address: SocketAddr,
    token: String,
    feed: Arc<Feed>,
    orders: Receiver<PendingOrder>,
    wake: UnixStream,
    /// Its end ends the thread that accepts.
    stop: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl LivePage {
    /// Serves a page at `HOST:PORT`.
    ///
    /// # Errors
    /// [`ListenError`].
    pub(crate) fn open(
        place: &str,
        allow_remote: bool,
        scene: &LiveScene,
    ) -> Result<Self, ListenError> {
        Self::open_patiently(place, allow_remote, scene, PATIENCE)
    }

    /// The same with another patience for clients.
    fn open_patiently(
        place: &str,
        allow_remote: bool,
        scene: &LiveScene,
        patience: Duration,
    ) -> Result<Self, ListenError> {
        let failed = |error| ListenError::Failed {
            address: place.to_owned(),
            error,
        };
        let (listener, address) = listen(place, allow_remote)?;
        let token = token().map_err(failed)?;
        let (wake, wakes) = pair().map_err(failed)?;
        let (stop, stopped) = pair().map_err(failed)?;
        let (orders, taken) = sync_channel(MAX_ORDERS);
        let feed = Arc::new(Feed::default());
        let shared = Arc::new(PageState {
            name: place.to_owned(),
            token: token.clone(),
            scene: serde_json::to_string(scene).unwrap_or_default(),
            read_only: scene.read_only.clone(),
            feed: Arc::clone(&feed),
            orders,
            wake: wakes,
            connections: AtomicUsize::new(0),
            patience,
        });
        let accepts = std::thread::Builder::new().stack_size(STACK);
        let accepts = accepts.spawn(move || accept(&listener, &stopped, &shared));
        Ok(Self {
            address,
            token,
            feed,
            orders: taken,
            wake,
            stop: Some(stop),
            thread: Some(accepts.map_err(failed)?),
        })
    }

    /// The address to open, with the token after its `#`, which no browser sends to a server.
    #[must_use]
    pub(crate) fn url(&self) -> String {
        format!("http://{}/#{}", self.address, self.token)
    }

    /// Where the events go.
    #[must_use]
    pub(crate) fn feed(&self) -> &Feed {
        &self.feed
    }

    /// What to wait for: readable when a page was opened or has sent an order.
    #[must_use]
    pub(crate) fn poll(&self) -> PollFd<'_> {
        PollFd::new(&self.wake, PollFlags::IN)
    }

    /// The orders of pages since the last call.
    pub(crate) fn orders(&mut self) -> Vec<PendingOrder> {
        let mut bytes = [0; 64];
        while matches!(self.wake.read(&mut bytes), Ok(1..)) {}
        self.orders.try_iter().collect()
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        self.feed.end();
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // It has nothing to tell, and a panic in it has ended no bench.
            let _ended = thread.join();
        }
    }
}

/// Two ends of a stream that never block.
fn pair() -> io::Result<(UnixStream, UnixStream)> {
    let (one, other) = UnixStream::pair()?;
    one.set_nonblocking(true)?;
    other.set_nonblocking(true)?;
    Ok((one, other))
}

/// 128 random bits of the system's, in hexadecimal digits.
fn token() -> io::Result<String> {
    let mut bytes = [0; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    let mut token = String::new();
    for byte in bytes {
        let _infallible = write!(token, "{byte:02x}");
    }
    Ok(token)
}

/// Accepts connections until `stop` ends.
fn accept(listener: &TcpListener, stop: &UnixStream, shared: &Arc<PageState>) {
    loop {
        let mut fds = [
            PollFd::new(listener, PollFlags::IN),
            PollFd::new(stop, PollFlags::IN),
        ];
        match poll(&mut fds, None) {
            Err(rustix::io::Errno::INTR) => continue,
            Ok(_) if fds[1].revents().is_empty() => {}
            Ok(_) | Err(_) => return,
        }
        match listener.accept() {
            Ok((stream, _)) => take(stream, shared),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            // The system has no more descriptors: some may be free soon.
            Err(_) => std::thread::sleep(Duration::from_millis(50)),
        }
    }
}

/// Serves a connection on a thread of its own, or refuses one too many.
fn take(stream: TcpStream, shared: &Arc<PageState>) {
    // A stream that cannot be set up is closed.
    let set = stream
        .set_nonblocking(false)
        .and_then(|()| stream.set_nodelay(true))
        .and_then(|()| stream.set_write_timeout(Some(shared.patience)));
    if set.is_err() {
        return;
    }
    if shared.connections.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS {
        shared.connections.fetch_sub(1, Ordering::Relaxed);
        let refusal = Refusal::new(
            503,
            format_args!("{MAX_CONNECTIONS} connections are open, the most; close some pages"),
        );
        // The answer has room in the system's buffer, so this does not wait.
        let _gone = send(&stream, &refused(&refusal));
        let _gone = stream.shutdown(Shutdown::Write);
        return;
    }
    let counted = Arc::clone(shared);
    let thread = std::thread::Builder::new()
        .stack_size(STACK)
        .spawn(move || {
            let _counted = ConnectionSlot(&counted.connections);
            // A client that has gone, or takes nothing, has its connection closed.
            let _gone = answer(&stream, &counted);
        });
    if thread.is_err() {
        shared.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Gives a connection's place back.
struct ConnectionSlot<'c>(&'c AtomicUsize);

impl Drop for ConnectionSlot<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Answers the one request of a connection.
fn answer(stream: &TcpStream, shared: &PageState) -> io::Result<()> {
    let end = Instant::now() + shared.patience;
    match routed(stream, shared, end) {
        Ok(Reply::Page) => {
            let policy = format!("Content-Security-Policy: {}\r\n", policy());
            send(stream, &whole(200, "text/html", &policy, &page()))
        }
        Ok(Reply::Done(text)) => send(stream, &whole(200, "text/plain", "", &text)),
        Ok(Reply::Events(after)) => events(stream, shared, after),
        Err(Some(refusal)) => {
            send(stream, &refused(&refusal))?;
            drain(stream)
        }
        // Nothing was asked.
        Err(None) => Ok(()),
    }
}

/// What a request gets.
enum Reply {
    Page,
    Events(Option<u64>),
    Done(String),
}

/// Reads a request and serves it. `None` for a connection that ends without one.
fn routed(stream: &TcpStream, shared: &PageState, end: Instant) -> Result<Reply, Option<Refusal>> {
    let mut bytes = Vec::new();
    let (head, used) = loop {
        match read(&bytes) {
            Read::Head(head, used) => break (head, used),
            Read::Bad(refusal) => return Err(Some(refusal)),
            Read::More => more(stream, &mut bytes, MAX_HEAD + 1, end)?,
        }
    };
    let local = stream.local_addr().map_err(|_| None)?;
    let route = admit(&head, &hosts(local, &shared.name), &shared.token)?;
    let path = match route {
        Route::Page => return Ok(Reply::Page),
        Route::Events(after) => return Ok(Reply::Events(after)),
        Route::Order(path) => path,
    };
    if let Some(why) = &shared.read_only {
        return Err(Some(Refusal::new(403, why)));
    }
    let body = body(stream, &head, bytes.split_off(used), end)?;
    let order = order(path, &body)?;
    let (reply, answer) = sync_channel(1);
    let asked = PendingOrder { order, reply };
    shared.orders.try_send(asked).map_err(|error| {
        Refusal::new(
            503,
            match error {
                TrySendError::Full(_) => "too many orders wait for the bench; try again",
                TrySendError::Disconnected(_) => "the bench has ended",
            },
        )
    })?;
    shared.wake();
    match answer.recv_timeout(ORDER) {
        Ok(Ok(done)) => Ok(Reply::Done(done)),
        Ok(Err(why)) => Err(Some(Refusal::new(409, why))),
        Err(_) => Err(Some(Refusal::new(503, "the bench does not answer"))),
    }
}

/// Reads the body after a head; `bytes` of it were received.
fn body(
    stream: &TcpStream,
    head: &RequestHead,
    mut bytes: Vec<u8>,
    end: Instant,
) -> Result<Vec<u8>, Option<Refusal>> {
    let length = head.length()?;
    while bytes.len() < length {
        more(stream, &mut bytes, length, end)?;
    }
    bytes.truncate(length);
    Ok(bytes)
}

/// Reads some more bytes, up to `most` of them, until `end`.
fn more(
    mut stream: &TcpStream,
    bytes: &mut Vec<u8>,
    most: usize,
    end: Instant,
) -> Result<(), Option<Refusal>> {
    let late = || {
        Some(Refusal::new(
            408,
            "the whole request expected within some seconds",
        ))
    };
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
        return Err(late());
    }
    let mut buffer = [0; 2048];
    let room = most.saturating_sub(bytes.len()).min(buffer.len());
    match stream.read(&mut buffer[..room]) {
        Ok(0) => Err(None),
        Ok(read) => {
            bytes.extend_from_slice(&buffer[..read]);
            Ok(())
        }
        Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(()),
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut
            ) =>
        {
            Err(late())
        }
        Err(_) => Err(None),
    }
}

/// Streams the scene and the events until the client leaves.
fn events(stream: &TcpStream, shared: &PageState, after: Option<u64>) -> io::Result<()> {
    let mut reader = shared.feed.watch(after);
    shared.wake();
    let mut text = head(200, "text/event-stream", "");
    let _infallible = write!(text, "\r\nevent: scene\ndata: {}\n\n", shared.scene);
    send(stream, &text)?;
    while let Some(pieces) = reader.wait(ALIVE) {
        let mut text = String::new();
        for piece in &pieces {
            let _infallible = match piece {
                FeedPiece::Event(number, news) => {
                    write!(text, "id: {number}\nevent: news\ndata: {news}\n\n")
                }
                FeedPiece::LeftOut(count) => {
                    write!(text, "event: left-out\ndata: {count}\n\n")
                }
            };
        }
        if pieces.is_empty() {
            text.push_str(": no news\n\n");
        }
        send(stream, &text)?;
    }
    Ok(())
}

fn send(mut stream: &TcpStream, text: &str) -> io::Result<()> {
    stream.write_all(text.as_bytes())
}

/// A connection that is closed while bytes of its client wait is reset, and the client may lose the answer.
fn drain(mut stream: &TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    stream.set_read_timeout(Some(DRAIN))?;
    let end = Instant::now() + DRAIN;
    let (mut buffer, mut drained) = ([0; 4096], 0);
    while drained < DRAINED && Instant::now() < end {
        match stream.read(&mut buffer)? {
            0 => break,
            read => drained += read,
        }
    }
    Ok(())
}

/// The head of an answer, but for the empty line after it.
fn head(status: u16, kind: &str, more: &str) -> String {
    let reason = match status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        409 => "Conflict",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        421 => "Misdirected Request",
        431 => "Request Header Fields Too Large",
        _ => "Service Unavailable",
    };
    format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: {kind}; charset=utf-8\r\nCache-Control: no-store\r\nConnection: close\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n{more}"
    )
}

/// A whole answer.
fn whole(status: u16, kind: &str, more: &str, body: &str) -> String {
    let length = body.len();
    let head = head(status, kind, more);
    format!("{head}Content-Length: {length}\r\n\r\n{body}")
}

fn refused(refusal: &Refusal) -> String {
    let body = format!("{}\n", refusal.why);
    let allow = refusal.allow;
    let allow = allow.map_or(String::new(), |allow| format!("Allow: {allow}\r\n"));
    whole(refusal.status, "text/plain", &allow, &body)
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
