//! The two ends of a session: a thread reads requests, and a thread writes lines. Neither keeps the bus waiting.

use super::request::{SessionFault, SessionLine, SessionRequest, parse};
use crate::cli::exit::Exit;
use serde_json::Value;
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::spawn;
use std::time::Duration;

/// The longest line of input, in bytes. The rest of a longer one is skipped.
pub(crate) const LONGEST: usize = 1 << 20;

/// Maximum number of requests that wait.
const MOST_WAITING: usize = 64;

/// Maximum number of lines that wait to be written.
const MOST_UNREAD: usize = 1024;

/// What the session does next.
pub(crate) enum SessionItem {
    /// A request.
    Ask(Value, SessionRequest),
    /// A request that `cancel` or `stop` has taken back.
    Cancelled(Value),
    /// The input has ended.
    End,
}

#[derive(Default)]
struct Waiting {
    waiting: VecDeque<SessionItem>,
    under_way: Option<Value>,
    /// `cancel` or `stop` has ended the request under way.
    cancelled: bool,
}

/// Requests that wait.
#[derive(Clone)]
pub(crate) struct RequestReader {
    state: Arc<(Mutex<Waiting>, Condvar)>,
    /// Ends what is under way on the bus.
    interrupt: Arc<AtomicBool>,
}

impl RequestReader {
    /// Reads requests from an input in a thread of its own.
    pub(crate) fn read(&self, input: impl Read + Send + 'static, out: LineWriter) {
        let own = self.clone();
        spawn(move || {
            let mut input = BufReader::new(input);
            while let Ok(Some(line)) = next_line(&mut input) {
                own.take_line(line, &out);
            }
            own.push_end();
        });
    }

    /// One that nothing is read for yet. `interrupt` ends what is under way on the bus.
    pub(crate) fn new(interrupt: Arc<AtomicBool>) -> Self {
        Self {
            state: Arc::default(),
            interrupt,
        }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
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

    /// Lets a request wait for its turn; `false` where too many wait already. `stop` and `cancel` overtake.
    pub(crate) fn push(&self, id: Value, request: SessionRequest) -> bool {
        let mut state = self.lock();
        match &request {
            SessionRequest::Stop { .. } => {
                self.break_off(&mut state, None);
                state.waiting.push_front(SessionItem::Ask(id, request));
            }
            SessionRequest::Cancel { of } => {
                self.break_off(&mut state, of.as_ref());
                state.waiting.push_front(SessionItem::Ask(id, request));
            }
            _ if state.waiting.len() >= MOST_WAITING => return false,
            _ => state.waiting.push_back(SessionItem::Ask(id, request)),
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

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.lock().waiting.is_empty()
    }

    /// Ends the request under way and takes back those that wait, or one of them.
    fn break_off(&self, state: &mut Waiting, only: Option<&Value>) {
        let meant = |id: &Value| only.is_none_or(|only| only == id);
        if state.under_way.as_ref().is_some_and(meant) {
            state.cancelled = true;
            self.interrupt.store(true, Ordering::Relaxed);
        }
        for item in &mut state.waiting {
            if let SessionItem::Ask(id, request) = item
                && meant(id)
                && !matches!(
                    request,
                    SessionRequest::Stop { .. } | SessionRequest::Cancel { .. }
                )
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
            && !matches!(
                request,
                SessionRequest::Stop { .. } | SessionRequest::Cancel { .. }
            )
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
enum Unwritten {
    Text(String),
    /// All in front of it is written.
    Mark(SyncSender<()>),
}

/// Lines that wait to be written.
#[derive(Clone)]
pub(crate) struct LineWriter {
    lines: SyncSender<Unwritten>,
    stuck: Arc<AtomicBool>,
}

impl LineWriter {
    /// Writes lines to an output in a thread of its own. The second value is dropped by that thread when all is written.
    pub(crate) fn write(
        mut output: impl Write + Send + 'static,
    ) -> (Self, std::thread::JoinHandle<()>) {
        let (lines, waiting) = sync_channel(MOST_UNREAD);
        let stuck = Arc::<AtomicBool>::default();
        let broken = Arc::clone(&stuck);
        let thread = spawn(move || {
            for own in waiting {
                let written = match own {
                    Unwritten::Text(text) => output.write_all(text.as_bytes()),
                    Unwritten::Mark(done) => {
                        let _nobody_waits_any_more = done.send(());
                        continue;
                    }
                };
                if written.and_then(|()| output.flush()).is_err() {
                    broken.store(true, Ordering::Relaxed);
                    return;
                }
            }
        });
        (Self { lines, stuck }, thread)
    }

    /// Whether the client reads nothing any more.
    pub(crate) fn is_stuck(&self) -> bool {
        self.stuck.load(Ordering::Relaxed)
    }

    /// Writes a line of JSON.
    pub(crate) fn put(&self, line: &SessionLine) {
        if let Ok(text) = serde_json::to_string(line) {
            self.text(text + "\n");
        }
    }

    /// Writes a text.
    pub(crate) fn text(&self, text: impl Into<String>) {
        let lost = self.lines.try_send(Unwritten::Text(text.into())).is_err();
        self.stuck.fetch_or(lost, Ordering::Relaxed);
    }

    /// Waits until all is written, for at most a second.
    pub(crate) fn wait(&self) {
        let (done, written) = sync_channel(1);
        if self.lines.try_send(Unwritten::Mark(done)).is_ok() {
            let _too_late = written.recv_timeout(Duration::from_secs(1));
        }
    }

    /// Writes an error.
    pub(crate) fn error(&self, id: Value, exit: Exit, what: impl Into<String>) {
        self.put(&SessionLine::Error {
            id,
            error: SessionFault {
                code: exit as u8,
                what: what.into(),
            },
        });
    }
}
