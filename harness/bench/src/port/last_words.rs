//! What another thread sends to a wire when the wire's owner hangs.

use crate::medium::Pieces;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// How long a wire may take a part.
const PATIENCE: Duration = Duration::from_secs(2);

/// How pieces are written on a wire: parts that are sent one after another.
pub type WireParts = fn(&Pieces) -> Vec<Vec<u8>>;

/// A way to a wire with its own descriptor.
#[derive(Debug)]
pub struct LastWords {
    fd: OwnedFd,
    name: String,
    parts: WireParts,
    /// How the wire codes a byte.
    code: fn(u8) -> Vec<u8>,
    /// How long the wire is idle before each part.
    gap: Duration,
}

/// They could not be sent.
#[derive(Debug, thiserror::Error)]
#[error("{name}: {error}")]
pub struct LastWordsError {
    name: String,
    error: std::io::Error,
}

impl LastWords {
    /// For a descriptor that takes bytes as they are.
    pub const fn plain(fd: OwnedFd, name: String, parts: WireParts) -> Self {
        let gap = Duration::ZERO;
        Self {
            fd,
            name,
            parts,
            code: |byte| vec![byte],
            gap,
        }
    }

    /// The same for a wire that codes each byte in this way.
    pub(super) fn coded(self, code: fn(u8) -> Vec<u8>) -> Self {
        Self { code, ..self }
    }

    /// The same, with the wire idle for this time before each part: for stations that separate telegrams by pauses.
    pub fn after(self, gap: Duration) -> Self {
        Self { gap, ..self }
    }

    /// Sends pieces, after whatever the operating system has taken before; at most two seconds for each part.
    ///
    /// # Errors
    /// The port does not take them.
    pub fn say(&self, pieces: &Pieces) -> Result<(), LastWordsError> {
        let parts = (self.parts)(pieces);
        let said = parts.iter().try_for_each(|part| self.write(part));
        said.map_err(|error| LastWordsError {
            name: self.name.clone(),
            error,
        })
    }

    fn write(&self, part: &[u8]) -> std::io::Result<()> {
        std::thread::sleep(self.gap);
        let end = Instant::now() + PATIENCE;
        let coded: Vec<_> = part.iter().copied().flat_map(self.code).collect();
        let mut rest = &coded[..];
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
