//! A pseudo terminal with a link to it at a path of its own.
//!
//! It carries no parity, rate or break; a client's settings of them have no effect. The server's end hangs up while no program has the
//! client's end open; inotify wakes the server when one opens it. The events of inotify are not counted, because the kernel merges equal
//! ones. A pseudo terminal cannot turn a second program away: each program that opens it reads a share of the bytes.

use super::shell::ServeError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{CreateFlags, Reader, WatchFlags, add_watch, init};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
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
    watch: OwnedFd,
    link: PathBuf,
    device: PathBuf,
    here: bool,
}

/// What has happened to the client's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PtyEvent {
    Came,
    Gone,
}

impl Pty {
    pub(super) fn open(link: &Path) -> Result<Self, ServeError> {
        let failed = |error: Errno| ServeError::Pty {
            path: link.to_owned(),
            error: error.into(),
        };
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).map_err(failed)?;
        grantpt(&master).map_err(failed)?;
        unlockpt(&master).map_err(failed)?;
        let name = ptsname(&master, Vec::new()).map_err(failed)?;
        let device = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let slave = client_end(&device).map_err(failed)?;
        let mut line = tcgetattr(&slave).map_err(failed)?;
        line.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &line).map_err(failed)?;
        drop(slave);
        rustix::io::ioctl_fionbio(&master, true).map_err(failed)?;
        let watch = init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK).map_err(failed)?;
        let events = WatchFlags::OPEN;
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
            watch,
            link: link.to_owned(),
            device,
            here: false,
        })
    }

    pub(super) fn link(&self) -> &Path {
        &self.link
    }

    /// Returns whether a client has come or gone; call it after reading what the client sent. A client that has come and gone since the
    /// last call shows in two calls.
    pub(super) fn change(&mut self) -> Option<PtyEvent> {
        let opened = self.was_opened();
        match (self.here, self.is_open()) {
            (false, open) if open || opened => {
                self.here = true;
                Some(PtyEvent::Came)
            }
            // It stays here until `gone` is called: its bytes may still have to be read.
            (true, false) => Some(PtyEvent::Gone),
            _ => None,
        }
    }

    /// Whether the client's end was opened since the last call.
    fn was_opened(&self) -> bool {
        let mut buffer = [MaybeUninit::uninit(); 1024];
        let mut reader = Reader::new(&self.watch, &mut buffer);
        (0..EVENTS).take_while(|_| reader.next().is_ok()).count() > 0
    }

    /// Whether a program has the client's end open.
    fn is_open(&self) -> bool {
        let mut fds = [PollFd::new(&self.master, PollFlags::empty())];
        let now = Timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        let polled = poll(&mut fds, Some(&now));
        polled.is_ok() && !fds[0].revents().contains(PollFlags::HUP)
    }

    /// Notes that a client is connected, because bytes were received. Returns whether that was unknown before.
    pub(super) fn heard(&mut self) -> bool {
        !std::mem::replace(&mut self.here, true)
    }

    pub(super) fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        rustix::io::read(&self.master, buffer).map_err(|error| match error {
            // No client is there, and all that the last one sent has been read.
            Errno::IO => io::ErrorKind::WouldBlock.into(),
            error => error.into(),
        })
    }

    pub(super) fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        Ok(rustix::io::write(&self.master, bytes)?)
    }

    /// The client has disconnected and all its input was read: its unread output is dropped. Returns whether another client is connected.
    pub(super) fn gone(&mut self) -> bool {
        // Where it fails, the next client reads it.
        let _unflushed =
            client_end(&self.device).and_then(|slave| tcflush(&slave, QueueSelector::IFlush));
        // That opening is the server's own.
        let _own = self.was_opened();
        self.here = self.is_open();
        self.here
    }

    /// What to wait for: the stream while a client is there, and openings where it is read.
    pub(super) fn polls(&self, stream: PollFlags) -> [Option<PollFd<'_>>; 2] {
        let read = stream.contains(PollFlags::IN);
        let waits = self.here && !stream.is_empty();
        [
            waits.then(|| PollFd::new(&self.master, stream)),
            read.then(|| PollFd::new(&self.watch, PollFlags::IN)),
        ]
    }
}

fn client_end(device: &Path) -> Result<OwnedFd, Errno> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    rustix::fs::open(device, flags, Mode::empty())
}

impl Drop for Pty {
    /// Removes the link, unless it has been removed or replaced.
    fn drop(&mut self) {
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.device) {
            let _gone = std::fs::remove_file(&self.link);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{File, OpenOptions};
    use std::io::Read as _;

    /// Two openings that the server sees late look like one, and the first closing does not leave the other client alone.
    #[test]
    fn a_client_is_there_until_the_last_one_has_closed() {
        let folder = tempfile::tempdir().expect("a folder");
        let link = folder.path().join("tap");
        let mut pty = Pty::open(&link).expect("a pseudo terminal");
        let open = || -> File {
            let mut options = OpenOptions::new();
            options
                .read(true)
                .write(true)
                .open(&link)
                .expect("it opens")
        };
        for _ in 0..3 {
            assert_eq!(pty.change(), None);
            let client = open();
            drop(open());
            assert_eq!(pty.change(), Some(PtyEvent::Came));
            drop(open());
            assert_eq!(pty.change(), None);
            assert_eq!(pty.write(b"\x80\x81").expect("room"), 2);
            let mut bytes = [0; 2];
            (&client).read_exact(&mut bytes).expect("its bytes");
            assert_eq!(bytes, *b"\x80\x81");
            // What it leaves unread is not the next client's.
            assert_eq!(pty.write(b"\x82").expect("room"), 1);
            drop(client);
            assert_eq!(pty.change(), Some(PtyEvent::Gone));
            assert!(!pty.gone());
            // One that is gone before the server looks.
            drop(open());
            assert_eq!(pty.change(), Some(PtyEvent::Came));
            assert_eq!(pty.change(), Some(PtyEvent::Gone));
            assert!(!pty.gone());
        }
    }
}
