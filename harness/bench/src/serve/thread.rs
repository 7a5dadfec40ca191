//! A bus served from a thread of this process.

use super::{EndRequest, ServeError, ServeHost, ServeOptions, ServedAt, ServedBus, serve_until};
use std::io;
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Sender, channel};
use std::thread::{JoinHandle, spawn};

/// It is served until this value is dropped.
#[derive(Debug)]
pub struct ServedThread {
    places: Vec<String>,
    handle: Option<UnixStream>,
    thread: Option<JoinHandle<Result<(), ServeError>>>,
}

impl ServedThread {
    /// Serves a bus, and returns once all its places can be connected to.
    ///
    /// # Errors
    /// A place cannot be used.
    ///
    /// # Panics
    /// The thread has ended without saying why.
    pub fn start(
        server: impl ServedBus + Send + 'static,
        options: ServeOptions<ServedAt>,
    ) -> Result<Self, ServeError> {
        let (handle, ending) = EndRequest::by_handle().map_err(ServeError::Wait)?;
        let (told, lines) = channel();
        // A place that is nowhere has no line.
        let told_of = options
            .places
            .iter()
            .filter(|place| **place != ServedAt::Nowhere);
        let count = told_of.count();
        let thread =
            spawn(move || serve_until(ending, server, &options, &mut Teller(told)).map(|_end| ()));
        let mut places = Vec::new();
        while places.len() < count {
            let Ok(place) = lines.recv() else {
                return match thread.join() {
                    Ok(Err(error)) => Err(error),
                    _ => unreachable!("it tells its places before it ends"),
                };
            };
            places.push(place);
        }
        Ok(Self {
            places,
            handle: Some(handle),
            thread: Some(thread),
        })
    }

    /// Where clients connect, in the order of the options: an address, or the path of a pseudo terminal.
    #[must_use]
    pub fn places(&self) -> &[String] {
        &self.places
    }
}

impl Drop for ServedThread {
    fn drop(&mut self) {
        drop(self.handle.take());
        if let Some(thread) = self.thread.take() {
            // A bus that has failed before leaves nothing to give back.
            let _ended = thread.join();
        }
    }
}

/// Passes on the first lines of a server, which end in ` at PLACE`.
struct Teller(Sender<String>);

impl ServeHost for Teller {
    fn tell(&mut self, line: &str) -> io::Result<()> {
        let place = line.rsplit(" at ").next().unwrap_or(line);
        // Nothing behind the places is waited for.
        let _not_awaited = self.0.send(place.to_owned());
        Ok(())
    }

    fn say(&mut self, _line: &str) {}
}
