//! Bytes that another thread sends to a wire when the wire's owner hangs.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// How long a wire may take them.
const PATIENCE: Duration = Duration::from_secs(2);

/// Coded bytes with their own descriptor of the wire.
#[derive(Debug)]
pub struct LastWords {
    pub(super) fd: OwnedFd,
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
    /// How long the wire is left alone before them.
    pub(super) gap: Duration,
}

/// The bytes could not be sent.
#[derive(Debug, thiserror::Error)]
#[error("{name}: {error}")]
pub struct Unsaid {
    /// The wire.
    name: String,
    /// The operating system's error.
    error: std::io::Error,
}

impl LastWords {
    /// Bytes as they are, for a descriptor that is no wire.
    pub(crate) const fn raw(fd: OwnedFd, name: String, bytes: Vec<u8>) -> Self {
        let gap = Duration::ZERO;
        Self {
            fd,
            name,
            bytes,
            gap,
        }
    }

    /// The same, with the wire left alone for this time before them: for stations that tell telegrams apart by pauses.
    pub(crate) fn after(self, gap: Duration) -> Self {
        Self { gap, ..self }
    }

    /// Sends them, behind whatever the operating system has taken before; at most for two seconds.
    ///
    /// # Errors
    /// The port does not take them.
    pub fn say(&self) -> Result<(), Unsaid> {
        self.write().map_err(|error| Unsaid {
            name: self.name.clone(),
            error,
        })
    }

    fn write(&self) -> std::io::Result<()> {
        std::thread::sleep(self.gap);
        let end = Instant::now() + PATIENCE;
        let mut rest = &self.bytes[..];
        while !rest.is_empty() {
            match rustix::io::write(&self.fd, rest) {
                Ok(taken) => rest = rest.get(taken..).unwrap_or_default(),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) if Instant::now() < end => {
                    let mut fds = [PollFd::new(&self.fd, PollFlags::OUT)];
                    let nap = Timespec {
                        tv_sec: 0,
                        tv_nsec: 50_000_000,
                    };
                    poll(&mut fds, Some(&nap))?;
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}
