//! The two ends of a session: a thread reads requests, and a thread writes lines. Neither keeps the bus waiting.

use super::request::{SessionFault, SessionLine, SessionRequest, parse};
use crate::command::exit::Exit;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::spawn;
use std::time::{Duration, Instant};

/// The longest line of input, in bytes. The rest of a longer one is skipped.
pub(crate) const LONGEST: usize = 1 << 20;

/// Maximum number of requests that wait, and of those that overtake.
const MOST_WAITING: usize = 64;

/// Maximum number of lines that wait to be written.
const MOST_UNREAD: usize = 1024;

/// Maximum number of bytes of these lines; a single line may be longer.
const MOST_UNREAD_BYTES: usize = 16 << 20;

/// The longest text of an error, in bytes.
const LONGEST_ERROR: usize = 64 << 10;

/// What the session does next.
pub(crate) enum SessionItem {
    /// A request.
    Ask(Value, SessionRequest),
    /// A request that `cancel` or `stop` has taken back.
    Cancelled(Value),
    /// The input has ended.
    End,
}

impl SessionItem {
    const fn overtakes(&self) -> bool {
        matches!(self, Self::Ask(_, request) if request.overtakes())
    }
}

#[derive(Default)]
struct RequestQueue {
    waiting: VecDeque<SessionItem>,
    under_way: Option<Value>,
    /// `cancel` or `stop` has ended the request under way.
    cancelled: bool,
}

/// Requests that wait.
#[derive(Clone)]
pub(crate) struct RequestReader {
    state: Arc<(Mutex<RequestQueue>, Condvar)>,
    /// Ends what is under way on the bus.
    interrupt: Arc<AtomicBool>,
}

impl RequestReader {
    /// Reads requests from an input in a thread of its own.
    pub(crate) fn read(&self, input: impl Read + Send + 'static, out: LineWriter) {
        let reader = self.clone();
        spawn(move || {
            let mut input = BufReader::new(input);
            while let Ok(Some(line)) = next_line(&mut input) {
                reader.take_line(line, &out);
            }
            reader.push_end();
        });
    }

    /// One that nothing is read for yet. `interrupt` ends what is under way on the bus.
    pub(crate) fn new(interrupt: Arc<AtomicBool>) -> Self {
        Self {
            state: Arc::default(),
            interrupt,
        }
    }

    fn lock(&self) -> MutexGuard<'_, RequestQueue> {
        self.state.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take_line(&self, line: Option<Vec<u8>>, out: &LineWriter) {
        let Some(line) = line else {
            let what = format!("a line of more than {LONGEST} bytes was skipped");
            return out.error(Value::Null, Exit::Usage, what);
        };
        if line.trim_ascii().is_empty() {
            return;
        }
        let (id, request) = parse(&line);
        let request = match request {
            Ok(request) => request,
            Err(what) => return out.error(id, Exit::Usage, what),
        };
        if !self.push(id.clone(), request) {
            let what = format!("{MOST_WAITING} requests wait already: wait for answers");
            out.error(id, Exit::Usage, what);
        }
    }

    /// Lets a request wait for its turn; `false` where too many wait already. `stop` and `cancel` overtake, and break off even then.
    pub(crate) fn push(&self, id: Value, request: SessionRequest) -> bool {
        let mut state = self.lock();
        match &request {
            SessionRequest::Stop { .. } => self.break_off(&mut state, None),
            SessionRequest::Cancel { of } => self.break_off(&mut state, of.as_ref()),
            _ => {}
        }
        let overtakes = request.overtakes();
        let alike = |request: &&SessionItem| request.overtakes() == overtakes;
        if state.waiting.iter().filter(alike).count() >= MOST_WAITING {
            return false;
        }
        let item = SessionItem::Ask(id, request);
        match overtakes {
            true => state.waiting.push_front(item),
            false => state.waiting.push_back(item),
        }
        self.state.1.notify_one();
        true
    }

    /// The input has ended: so does the session, when it has done what waits.
    pub(crate) fn push_end(&self) {
        self.lock().waiting.push_back(SessionItem::End);
        self.state.1.notify_one();
    }

    /// What is under way from now on ends like a request.
    pub(crate) fn begin(&self) {
        self.lock().under_way = Some(Value::Null);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.lock().waiting.is_empty()
    }

    /// Ends the request under way and takes back those that wait, or one of them.
    fn break_off(&self, state: &mut RequestQueue, only: Option<&Value>) {
        let meant = |id: &Value| only.is_none_or(|only| only == id);
        if state.under_way.as_ref().is_some_and(meant) {
            state.cancelled = true;
            self.interrupt.store(true, Ordering::Relaxed);
        }
        for item in &mut state.waiting {
            if let SessionItem::Ask(id, request) = item
                && meant(id)
                && !request.overtakes()
            {
                *item = SessionItem::Cancelled(id.clone());
            }
        }
    }

    /// The next thing to do, waited for at most this long. A request is under way from now on.
    pub(crate) fn next(&self, patience: Duration) -> Option<SessionItem> {
        let (_, news) = &*self.state;
        let mut state = self.lock();
        if state.waiting.is_empty() && patience > Duration::ZERO {
            let waited = news.wait_timeout(state, patience);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let item = state.waiting.pop_front();
        if let Some(SessionItem::Ask(id, request)) = &item
            && !request.overtakes()
        {
            state.under_way = Some(id.clone());
        }
        item
    }

    /// The request under way is done. Returns whether it was broken off.
    pub(crate) fn done(&self) -> bool {
        let mut state = self.lock();
        state.under_way = None;
        std::mem::take(&mut state.cancelled)
    }
}

/// The next line without its end; `None` for one that is too long, and at the end of the input. A line without an end is read too: a JSON
/// object is whole or it is none.
pub(super) fn next_line(input: &mut impl BufRead) -> std::io::Result<Option<Option<Vec<u8>>>> {
    let mut line = Vec::new();
    let most = LONGEST as u64 + 1;
    if input.take(most).read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    if line.ends_with(b"\n") {
        line.pop();
        return Ok(Some(Some(line)));
    }
    if line.len() <= LONGEST {
        return Ok(Some(Some(line)));
    }
    input.skip_until(b'\n')?;
    Ok(Some(None))
}

/// What waits to be written.
enum OutputItem {
    Text(String),
    /// Reports that everything queued before it has been written.
    Mark(SyncSender<()>),
}

/// What is known of the client that reads.
struct Client {
    /// Bytes that it has not read yet, but for those that the operating system holds.
    unread: AtomicUsize,
    /// It reads nothing any more.
    gone: AtomicBool,
    /// Ends what is under way on the bus.
    interrupt: Arc<AtomicBool>,
}

impl Client {
    /// It reads nothing any more: motors must not turn on for it.
    fn is_lost(&self) {
        self.gone.store(true, Ordering::Relaxed);
        self.interrupt.store(true, Ordering::Relaxed);
    }
}

/// Lines that wait to be written.
#[derive(Clone)]
pub(crate) struct LineWriter {
    lines: SyncSender<OutputItem>,
    client: Arc<Client>,
}

impl LineWriter {
    /// Writes lines to an output in a thread of its own. The second value is dropped by that thread when all is written. `interrupt` is set
    /// when the client reads nothing any more.
    pub(crate) fn write(
        mut output: impl Write + Send + 'static,
        interrupt: Arc<AtomicBool>,
    ) -> (Self, std::thread::JoinHandle<()>) {
        let (lines, waiting) = sync_channel(MOST_UNREAD);
        let client = Arc::new(Client {
            unread: AtomicUsize::new(0),
            gone: AtomicBool::new(false),
            interrupt,
        });
        let lost_client = Arc::clone(&client);
        let thread = spawn(move || {
            for next in waiting {
                let text: String = match next {
                    OutputItem::Text(text) => text,
                    OutputItem::Mark(done) => {
                        let _nobody_waits_any_more = done.send(());
                        continue;
                    }
                };
                let written = output.write_all(text.as_bytes());
                if written.and_then(|()| output.flush()).is_err() {
                    return lost_client.is_lost();
                }
                lost_client.unread.fetch_sub(text.len(), Ordering::Relaxed);
            }
        });
        (Self { lines, client }, thread)
    }

    /// Notices in a thread of its own that nothing reads the other end of a pipe or a socket any more.
    pub(crate) fn watch(&self, output: impl AsFd + Send + 'static) {
        let client = Arc::clone(&self.client);
        spawn(move || {
            // No event is asked for: errors and the end of the reader are always reported.
            let mut watched = [PollFd::new(&output, PollFlags::empty())];
            while let Err(Errno::INTR) = poll(&mut watched, None) {}
            if watched[0]
                .revents()
                .intersects(PollFlags::ERR | PollFlags::HUP)
            {
                client.is_lost();
            }
        });
    }

    /// Whether the client reads nothing any more.
    pub(crate) fn is_stuck(&self) -> bool {
        self.client.gone.load(Ordering::Relaxed)
    }

    /// Writes a line of JSON.
    pub(crate) fn put(&self, line: &SessionLine) {
        if let Ok(text) = serde_json::to_string(line) {
            self.text(text + "\n");
        }
    }

    /// Writes a text. A client that leaves too much unread is lost.
    pub(crate) fn text(&self, text: impl Into<String>) {
        let text = text.into();
        let length = text.len();
        let unread = self.client.unread.fetch_add(length, Ordering::Relaxed);
        let fits = unread == 0 || unread + length <= MOST_UNREAD_BYTES;
        if !fits || self.lines.try_send(OutputItem::Text(text)).is_err() {
            self.client.is_lost();
        }
    }

    /// Waits until all is written, for at most a second.
    pub(crate) fn wait(&self) {
        self.wait_while(|| std::thread::sleep(Duration::from_millis(1)));
    }

    /// The same, and does something meanwhile, again and again: a bus must not stand still because a terminal does.
    pub(crate) fn wait_while(&self, mut meanwhile: impl FnMut()) {
        let (done, written) = sync_channel(1);
        if self.lines.try_send(OutputItem::Mark(done)).is_err() {
            return;
        }
        let end = Instant::now() + Duration::from_secs(1);
        while written.try_recv() == Err(TryRecvError::Empty) && Instant::now() < end {
            meanwhile();
        }
    }

    /// Writes an error.
    pub(crate) fn error(&self, id: Value, exit: Exit, what: impl Into<String>) {
        let what = shortened(what.into());
        self.put(&SessionLine::Error {
            id,
            error: SessionFault {
                code: exit as u8,
                what,
            },
        });
    }
}

/// A text of an error, which may repeat what the client has sent.
fn shortened(mut text: String) -> String {
    if text.len() > LONGEST_ERROR {
        let mut ends = (0..=LONGEST_ERROR).rev();
        text.truncate(ends.find(|at| text.is_char_boundary(*at)).unwrap_or(0));
        text.push_str(" ... (shortened)");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::sync::mpsc::channel;

    /// Requests that overtake have a bound of their own: an ordinary one always finds room behind them, and the first of them is done.
    #[test]
    fn what_overtakes_is_bounded() {
        let interrupt = Arc::<AtomicBool>::default();
        let inbox = RequestReader::new(Arc::clone(&interrupt));
        inbox.begin();
        let stops =
            (0..10_000).map(|id| inbox.push(json!(id), SessionRequest::Stop { drive: None }));
        assert_eq!(stops.filter(|done| *done).count(), MOST_WAITING);
        assert!(interrupt.load(Ordering::Relaxed));
        let asked = (0..10_000).map(|id| inbox.push(json!(id), SessionRequest::Info {}));
        assert_eq!(asked.filter(|done| *done).count(), MOST_WAITING);
        // One that is refused breaks off all the same.
        assert!(!inbox.push(json!(0), SessionRequest::Cancel { of: None }));
        let mut next = std::iter::from_fn(|| inbox.next(Duration::ZERO));
        let mut first = next.by_ref().take(MOST_WAITING);
        assert!(first.all(|request| request.overtakes()));
        let rest: Vec<_> = next.collect();
        let cancelled = |request: &SessionItem| matches!(request, SessionItem::Cancelled(_));
        assert_eq!(
            (rest.len(), rest.iter().all(cancelled)),
            (MOST_WAITING, true)
        );
    }

    /// An output that takes nothing until its other end is dropped.
    struct BlockedOutput(std::sync::mpsc::Receiver<()>);

    impl Write for BlockedOutput {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let _until_the_test_ends = self.0.recv();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_is_unread_is_bounded() {
        // In lines, in bytes, and a single line of any length.
        for (length, most) in [(10, MOST_UNREAD + 1), (1 << 20, 16), (40 << 20, 1)] {
            let (held, blocked) = channel();
            let interrupt = Arc::<AtomicBool>::default();
            let (out, _) = LineWriter::write(BlockedOutput(blocked), Arc::clone(&interrupt));
            let line = "x".repeat(length);
            let taken = std::iter::repeat_with(|| out.text(line.as_str()));
            let taken = taken.take_while(|()| !out.is_stuck()).count();
            // The thread that writes may have taken one from the queue.
            assert!((most - 1..=most).contains(&taken), "{length}: {taken}");
            assert!(interrupt.load(Ordering::Relaxed), "{length}");
            drop(held);
        }
    }

    #[test]
    fn a_long_error_is_shortened() {
        assert_eq!(shortened("a".repeat(LONGEST_ERROR)).len(), LONGEST_ERROR);
        let long = shortened("\u{e9}".repeat(LONGEST_ERROR));
        assert!(long.ends_with("\u{e9} ... (shortened)"));
        assert!(long.len() <= LONGEST_ERROR + 20);
    }
}
