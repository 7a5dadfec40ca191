//! Whether another program has a port, and which one, before anything of the port is changed.

use super::open::OpenError;
use rustix::fd::AsFd;
use rustix::fs::{FlockOperation, Mode, OFlags, flock};
use rustix::io::Errno;
use std::fmt;
use std::os::fd::AsRawFd;
use std::path::Path;

/// A process that has a port open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherProgram {
    pid: u32,
    program: String,
}

impl OtherProgram {
    fn of(pid: u32) -> Option<Self> {
        let program = std::fs::read_to_string(format!("/proc/{pid}/comm")).ok()?;
        let program = program.trim_end().to_owned();
        Some(Self { pid, program })
    }

    /// The process that listens at the other end.
    #[cfg(target_os = "linux")]
    pub fn behind(end: impl AsFd) -> Option<Self> {
        let peer = rustix::net::sockopt::socket_peercred(end).ok()?;
        Self::of(peer.pid.as_raw_nonzero().get().try_into().ok()?)
    }
}

impl fmt::Display for OtherProgram {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, process {}", self.program, self.pid)
    }
}

/// The first other process that has this file open. The kernel shows only root the files of other users.
pub(super) fn holder(path: &Path) -> Option<OtherProgram> {
    let path = std::fs::canonicalize(path).ok()?;
    let mut pids: Vec<u32> = std::fs::read_dir("/proc")
        .ok()?
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
        .filter(|pid| *pid != std::process::id())
        .collect();
    pids.sort_unstable();
    let has_it = |pid: &u32| {
        let files = std::fs::read_dir(format!("/proc/{pid}/fd"));
        let mut files = files.into_iter().flatten().filter_map(Result::ok);
        files.any(|file| std::fs::read_link(file.path()).is_ok_and(|to| to == path))
    };
    OtherProgram::of(pids.into_iter().find(has_it)?)
}

/// Refuses a port that another program has locked (flock, as pyserial's `exclusive`; TIOCEXCL, which lets root in all the same), or that
/// another process has open and the kernel shows it.
///
/// # Errors
/// [`OpenError::InUse`].
pub(super) fn refuse_used(path: &Path, fd: impl AsFd) -> Result<(), OpenError> {
    let holder = holder(path);
    let locked = flock(&fd, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK);
    if holder.is_none() && !locked && !is_exclusive(&fd) {
        return Ok(());
    }
    Err(OpenError::InUse {
        port: path.display().to_string(),
        holder,
    })
}

/// Whether a terminal is exclusive (TIOCEXCL): a second open is refused, but not to root.
pub(crate) fn is_exclusive(fd: impl AsFd) -> bool {
    let again = format!("/proc/self/fd/{}", fd.as_fd().as_raw_fd());
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    matches!(
        rustix::fs::open(again, flags, Mode::empty()),
        Err(Errno::BUSY)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;
    use std::process::{Command, Stdio};

    #[test]
    fn the_program_that_has_a_port_is_named() {
        let folder = tempfile::tempdir().expect("room");
        let path = folder.path().join("port");
        let file = File::create(&path).expect("room");
        assert_eq!(refuse_used(&path, &file).ok(), Some(()));
        let input = File::open(&path).expect("a file");
        let mut other = Command::new("sleep");
        let other = other.arg("600").stdin(Stdio::from(input)).spawn();
        let mut other = other.expect("a process");
        let refused = refuse_used(&path, &file).expect_err("in use").to_string();
        other.kill().expect("a process");
        other.wait().expect("a process");
        let words = format!(
            "is in use by another program: sleep, process {}",
            other.id()
        );
        assert!(refused.contains(&words), "{refused}");
    }

    /// As pyserial's `exclusive` does; a lock belongs to one open file, of this process too.
    #[test]
    fn a_locked_port_is_in_use() {
        let folder = tempfile::tempdir().expect("room");
        let path = folder.path().join("port");
        let file = File::create(&path).expect("room");
        let other = File::open(&path).expect("a file");
        flock(&other, FlockOperation::LockExclusive).expect("a lock");
        assert!(matches!(
            refuse_used(&path, &file),
            Err(OpenError::InUse { holder: None, .. })
        ));
    }
}
