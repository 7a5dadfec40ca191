//! A pseudo terminal with a link to it at a path of its own.
//!
//! It carries no parity, rate or break; a client's settings of them have no effect. The server keeps the client's end open, so
//! that a client that closes it does no harm, and detects with inotify when clients come and go. A pseudo terminal cannot turn a
//! second program away: each program that opens it reads a share of the bytes.

use super::shell::ServeError;
use rustix::event::{PollFd, PollFlags};
use rustix::fs::inotify::{CreateFlags, ReadFlags, Reader, WatchFlags, add_watch, init};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use std::ffi::OsStr;
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// Openings and closings read at a time.
const EVENTS: usize = 64;

/// A pseudo terminal; the link goes with it.
#[derive(Debug)]
pub(super) struct Pty {
    master: OwnedFd,
    slave: OwnedFd,
    watch: OwnedFd,
    link: PathBuf,
    device: PathBuf,
    /// How many have opened it and not closed it yet.
    open: usize,
    here: bool,
}

/// What has happened to the client's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    Came,
    Gone,
}

impl Pty {
    pub(super) fn open(link: &Path) -> Result<Self, ServeError> {
        let failed = |error: rustix::io::Errno| ServeError::Pty {
            path: link.to_owned(),
            error: error.into(),
        };
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).map_err(failed)?;
        grantpt(&master).map_err(failed)?;
        unlockpt(&master).map_err(failed)?;
        let name = ptsname(&master, Vec::new()).map_err(failed)?;
        let device = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave = rustix::fs::open(&device, flags, Mode::empty()).map_err(failed)?;
        let mut line = tcgetattr(&slave).map_err(failed)?;
        line.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &line).map_err(failed)?;
        rustix::io::ioctl_fionbio(&master, true).map_err(failed)?;
        let watch = init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK).map_err(failed)?;
        let events = WatchFlags::OPEN | WatchFlags::CLOSE;
        add_watch(&watch, &device, events).map_err(failed)?;
        std::os::unix::fs::symlink(&device, link).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => ServeError::Exists {
                path: link.to_owned(),
            },
            _ => ServeError::Pty {
                path: link.to_owned(),
                error,
            },
        })?;
        Ok(Self {
            master,
            slave,
            watch,
            link: link.to_owned(),
            device,
            open: 0,
            here: false,
        })
    }

    pub(super) fn link(&self) -> &Path {
        &self.link
    }

    /// Returns whether clients have come or gone. The kernel may report several openings in a row as one, so a byte read counts
    /// as a client's arrival too.
    pub(super) fn changes(&mut self) -> Vec<Change> {
        let mut changes = Vec::new();
        let mut here = self.here;
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut reader = Reader::new(&self.watch, &mut buffer);
        for _ in 0..EVENTS {
            let Ok(event) = reader.next() else {
                break;
            };
            let events = event.events();
            if events.contains(ReadFlags::OPEN) {
                self.open += 1;
                changes.extend((!here).then_some(Change::Came));
                here = true;
            }
            if events.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
                self.open = self.open.saturating_sub(1);
                if self.open == 0 {
                    changes.extend(here.then_some(Change::Gone));
                    here = false;
                }
            }
        }
        // A client that has closed stays here until `gone` is called: its bytes may still have to be read.
        self.here |= !changes.is_empty();
        changes
    }

    /// Notes that a client is there, because bytes have come; returns whether it was not known before.
    pub(super) fn heard(&mut self) -> bool {
        !std::mem::replace(&mut self.here, true)
    }

    pub(super) fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        Ok(rustix::io::read(&self.master, buffer)?)
    }

    pub(super) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        Ok(rustix::io::write(&self.master, bytes)?)
    }

    /// The client has gone, and all that it sent has been read: what it did not read is dropped.
    pub(super) fn gone(&mut self) {
        self.here = self.open > 0;
        // Where it fails, the next client reads it.
        let _unflushed = tcflush(&self.slave, QueueSelector::IFlush);
    }

    /// What to wait for: the stream, and openings and closings where it is read.
    pub(super) fn polls(&self, stream: PollFlags) -> (PollFd<'_>, Option<PollFd<'_>>) {
        let read = stream.contains(PollFlags::IN);
        let watch = read.then(|| PollFd::new(&self.watch, PollFlags::IN));
        (PollFd::new(&self.master, stream), watch)
    }
}

impl Drop for Pty {
    /// Removes the link, unless it has been removed or replaced.
    fn drop(&mut self) {
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.device) {
            let _gone = std::fs::remove_file(&self.link);
        }
    }
}
