//! Locks of rigs and ports.
//!
//! A process holds a rig as long as it has the rig's lock file locked (flock). The kernel releases the lock when the process
//! ends, for whatever reason; the holder that is then left in the file is stale and ignored. A reservation is written to the same
//! file. It needs no running process and keeps out every other user until it is given back.

use super::check::Rig;
use super::state::{self, Holder};
use crate::port::{OtherProgram, is_exclusive};
use crate::regular::{self, Links};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions, Permissions};
use std::io::{self, Seek, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How often a busy lock is tried again.
const AGAIN: Duration = Duration::from_millis(50);
/// How long a lock is tried at least: looking at it (`rig list`) takes it for a moment.
const AT_LEAST: Duration = Duration::from_millis(100);

/// Why a rig cannot be locked.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another process holds it, or another user has reserved it.
    #[error("rig {rig} is {how} by {}", holder_text(.holder.as_deref()))]
    Busy {
        /// The rig's id.
        rig: String,
        /// `held` or `reserved`.
        how: &'static str,
        /// The holder; `None` if the file does not name one (yet).
        holder: Option<Box<Holder>>,
    },
    /// The lock file cannot be used.
    #[error(
        "failed to lock the rig {rig} by its file in {folder}: {error}; set DRIVEBENCH_STATE to another folder"
    )]
    Io {
        /// The rig's id.
        rig: String,
        /// The folder of the lock file.
        folder: String,
        /// The operating system's error.
        error: io::Error,
    },
}

fn holder_text(holder: Option<&Holder>) -> String {
    holder.map_or_else(|| "an unnamed user".to_owned(), Holder::to_string)
}

/// The content of a lock file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
struct Record {
    /// The process that has it locked; stale if the file is not locked.
    holder: Option<Holder>,
    /// The user who has reserved it.
    reserved: Option<Holder>,
}

/// Whether a rig is available.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It is neither held nor reserved.
    Free,
    /// A process holds it.
    Held(Option<Holder>),
    /// A user has reserved it.
    Reserved(Holder),
}

/// A rig that is held until this is dropped.
#[derive(Debug)]
pub struct RigLock {
    file: File,
    record: Record,
}

impl RigLock {
    /// Locks a rig. Waits for it for at most `wait` (at least 100 ms), or until `interrupt` is set. Simulated rigs need no lock:
    /// each process has its own copy.
    ///
    /// # Errors
    /// Another process or user has it, or its lock file cannot be used.
    pub fn acquire(
        rig: &Rig,
        purpose: &str,
        wait: Duration,
        interrupt: &AtomicBool,
    ) -> Result<Self, LockError> {
        let folder = state::folder()
            .map_err(|error| io_error(rig.id(), Path::new("the state folder"), error))?;
        Self::acquire_unless(interrupt, &folder, rig.id(), &Holder::me(purpose), wait)
    }

    /// The same in a given folder, for a given holder.
    ///
    /// # Errors
    /// As of [`RigLock::acquire`].
    pub fn acquire_in(
        folder: &Path,
        id: &str,
        me: &Holder,
        wait: Duration,
    ) -> Result<Self, LockError> {
        Self::acquire_unless(&AtomicBool::default(), folder, id, me, wait)
    }

    fn acquire_unless(
        interrupt: &AtomicBool,
        folder: &Path,
        id: &str,
        me: &Holder,
        wait: Duration,
    ) -> Result<Self, LockError> {
        let begun = Instant::now();
        let wait = wait.max(AT_LEAST);
        loop {
            match attempt(folder, id, me) {
                Err(LockError::Busy { .. })
                    if begun.elapsed() < wait && !interrupt.load(Ordering::Relaxed) =>
                {
                    std::thread::sleep(AGAIN.min(wait.saturating_sub(begun.elapsed())));
                }
                other => return other,
            }
        }
    }
}

impl Drop for RigLock {
    fn drop(&mut self) {
        self.record.holder = None;
        // The lock goes in any case when the file is closed; a name left behind is stale.
        let _stale = write(&mut self.file, &self.record);
        unlock(&self.file);
    }
}

fn io_error(id: &str, folder: &Path, error: io::Error) -> LockError {
    LockError::Io {
        rig: id.to_owned(),
        folder: folder.display().to_string(),
        error,
    }
}

fn open(folder: &Path, id: &str) -> io::Result<File> {
    let path = folder.join(format!("{id}.lock"));
    let mut options = OpenOptions::new();
    options.read(true).write(true).mode(0o666);
    // In a folder for all users a link could lead to a file that this user must not change.
    options.custom_flags(Links::Refuse.flags());
    // In a folder for all users the kernel may refuse O_CREAT on the file of another user.
    let file = match options.open(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let file = options.create(true).truncate(false).open(&path)?;
            // The umask has cleared permissions that other users need. If another user created the file, that process has set
            // them.
            let _not_ours = file.set_permissions(Permissions::from_mode(0o666));
            file
        }
        Err(error) => return Err(in_its_place(&path).unwrap_or(error)),
        Ok(file) => file,
    };
    in_its_place(&path).map_or(Ok(file), Err)
}

/// What stands in place of a lock file and is no regular file.
fn in_its_place(path: &Path) -> Option<io::Error> {
    let kind = path.symlink_metadata().ok()?.file_type();
    (!kind.is_file()).then(|| {
        let (name, kind) = (path.display(), regular::kind(kind));
        io::Error::other(format!("{name} is {kind} and no lock file; remove it"))
    })
}

/// The file's content; empty if the file is new or truncated.
fn record(file: &mut File) -> io::Result<Record> {
    file.rewind()?;
    Ok(serde_json::from_slice(&state::read(file)?).unwrap_or_default())
}

fn write(file: &mut File, record: &Record) -> io::Result<()> {
    let text = serde_json::to_vec(record)?;
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(&text)
}

/// Locks the file, if it is free; `false` if not.
fn lock(file: &File) -> io::Result<bool> {
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(true),
        Err(Errno::WOULDBLOCK) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

/// Unlocks the file. To close it is not enough while another thread starts a program: until that runs, it has the descriptor as well.
fn unlock(file: impl AsFd) {
    let _gone = flock(file, FlockOperation::Unlock);
}

fn attempt(folder: &Path, id: &str, me: &Holder) -> Result<RigLock, LockError> {
    let failed = |error| io_error(id, folder, error);
    let mut file = open(folder, id).map_err(failed)?;
    let locked = lock(&file).map_err(failed)?;
    let mut record = record(&mut file).map_err(failed)?;
    let busy = |how, holder| LockError::Busy {
        rig: id.to_owned(),
        how,
        holder: Option::map(holder, Box::new),
    };
    if !locked {
        return Err(busy("held", record.holder));
    }
    if let Some(other) = record.reserved.as_ref().filter(|other| !same(other, me)) {
        return Err(busy("reserved", Some(other.clone())));
    }
    record.holder = Some(me.clone());
    write(&mut file, &record).map_err(failed)?;
    Ok(RigLock { file, record })
}

fn same(one: &Holder, other: &Holder) -> bool {
    one.uid == other.uid && one.user == other.user
}

/// Whether a rig is available. A rig that was never locked is free, and no file is made for it.
///
/// # Errors
/// The lock file cannot be read.
pub fn standing(folder: &Path, id: &str) -> io::Result<Standing> {
    let mut file = match regular::open(&folder.join(format!("{id}.lock")), Links::Refuse) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Standing::Free),
        Err(error) => return Err(error),
    };
    let free = lock(&file)?;
    let record = record(&mut file);
    if free {
        unlock(&file);
    }
    let record = record?;
    Ok(match (free, record.reserved) {
        (false, _) => Standing::Held(record.holder),
        (true, Some(holder)) => Standing::Reserved(holder),
        (true, None) => Standing::Free,
    })
}

/// Reserves a rig for this user until [`unreserve`] gives it back.
///
/// # Errors
/// Another process or user has it, or its lock file cannot be used.
pub fn reserve(folder: &Path, id: &str, me: &Holder) -> Result<(), LockError> {
    let mut lock = RigLock::acquire_in(folder, id, me, Duration::ZERO)?;
    lock.record.reserved = Some(me.clone());
    lock.give_back(folder, id)
}

/// Gives a reserved rig back; with `force` also one that another user has reserved. A process that holds it is not disturbed.
/// Returns who had reserved it.
///
/// # Errors
/// Another user has reserved it, a process holds it, or its lock file cannot be used.
pub fn unreserve(
    folder: &Path,
    id: &str,
    me: &Holder,
    force: bool,
) -> Result<Option<Holder>, LockError> {
    let kept = match standing(folder, id).map_err(|error| io_error(id, folder, error))? {
        Standing::Reserved(holder) => holder,
        Standing::Free => return Ok(None),
        Standing::Held(holder) => {
            return Err(LockError::Busy {
                rig: id.to_owned(),
                how: "held",
                holder: holder.map(Box::new),
            });
        }
    };
    let who = if force { &kept } else { me };
    let mut lock = RigLock::acquire_in(folder, id, who, Duration::ZERO)?;
    let before = lock.record.reserved.take();
    lock.give_back(folder, id)?;
    Ok(before)
}

impl RigLock {
    /// Releases the lock and returns a failure to write the file. Dropping the lock ignores such a failure.
    fn give_back(mut self, folder: &Path, id: &str) -> Result<(), LockError> {
        self.record.holder = None;
        write(&mut self.file, &self.record).map_err(|error| io_error(id, folder, error))
    }
}

/// Why a port cannot be locked.
#[derive(Debug, thiserror::Error)]
pub enum PortLockError {
    /// Another program has it.
    #[error("the port is in use by another program ({how})")]
    Busy {
        /// How this was detected: `flock` or `TIOCEXCL`.
        how: &'static str,
    },
    /// Another process has its interface.
    #[error("the interface is in use by another program{}", .0.iter().map(|program| format!(": {program}")).collect::<String>())]
    Other(Option<OtherProgram>),
    /// The system refused.
    #[error("failed to lock the port: {0}")]
    Io(#[from] io::Error),
}

/// A port that is held until this is dropped, against programs that heed flock and, for a terminal, against
/// every later open (TIOCEXCL; root is let in all the same).
#[derive(Debug)]
pub struct PortLock {
    port: OwnedFd,
    exclusive: bool,
}

impl PortLock {
    /// Locks an open port. It calls flock first, so that a port in use by another program is not changed. A second open that
    /// fails with EBUSY shows that another program has made the port exclusive; for root it does not fail.
    ///
    /// # Errors
    /// Another program has it, or the system refused. Then nothing of it was changed.
    pub fn acquire(port: impl AsFd) -> Result<Self, PortLockError> {
        let port = port.as_fd().try_clone_to_owned()?;
        match flock(&port, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => return Err(PortLockError::Busy { how: "flock" }),
            Err(error) => return Err(PortLockError::Io(error.into())),
        }
        // From here on dropping it undoes what was done.
        let mut lock = Self {
            port,
            exclusive: false,
        };
        if !rustix::termios::isatty(&lock.port) {
            return Ok(lock);
        }
        if is_exclusive(&lock.port) {
            return Err(PortLockError::Busy { how: "TIOCEXCL" });
        }
        rustix::termios::ioctl_tiocexcl(&lock.port).map_err(io::Error::from)?;
        lock.exclusive = true;
        Ok(lock)
    }
}

impl PortLock {
    /// Locks a CAN interface, which is no file: by a name that the kernel keeps for this network namespace, as it does those of interfaces.
    ///
    /// # Errors
    /// Another program of ours has it, which is named where the kernel shows it; or the system refused.
    #[cfg(target_os = "linux")]
    pub fn of_interface(name: &str) -> Result<Self, PortLockError> {
        use std::os::linux::net::SocketAddrExt;
        use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
        let address = SocketAddr::from_abstract_name(format!("drivebench/{name}"))?;
        let port = match UnixListener::bind_addr(&address) {
            Err(error) if error.kind() == io::ErrorKind::AddrInUse => {
                let other = UnixStream::connect_addr(&address).ok();
                return Err(PortLockError::Other(other.and_then(OtherProgram::behind)));
            }
            other => other?.into(),
        };
        let exclusive = false;
        Ok(Self { port, exclusive })
    }

    /// Other systems have no CAN interfaces.
    #[cfg(not(target_os = "linux"))]
    pub fn of_interface(_name: &str) -> Result<Self, PortLockError> {
        Err(PortLockError::Io(io::ErrorKind::Unsupported.into()))
    }
}

impl Drop for PortLock {
    fn drop(&mut self) {
        if self.exclusive {
            // A port that was unplugged has nothing to undo.
            let _gone = rustix::termios::ioctl_tiocnxcl(&self.port);
        }
        // The description may live on in the caller's descriptor.
        unlock(&self.port);
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// As where another thread has started a program, which does not run yet.
    #[test]
    fn a_rig_is_free_at_once_though_another_descriptor_is_open() {
        let folder = tempfile::tempdir().expect("a folder");
        let me = Holder::me("run");
        let take = || RigLock::acquire_in(folder.path(), "lab", &me, Duration::ZERO);
        let lock = take().expect("free");
        let _other = lock.file.try_clone().expect("a descriptor");
        drop(lock);
        let free = standing(folder.path(), "lab").expect("read");
        assert_eq!(free, Standing::Free);
        drop(take().expect("free"));
    }

    #[test]
    fn an_interface_has_one_program_at_a_time() {
        let me = std::process::id().to_string();
        let name = format!("can-{me}");
        let first = PortLock::of_interface(&name).expect("a free interface");
        let busy = PortLock::of_interface(&name).expect_err("in use");
        let busy = busy.to_string();
        assert!(
            busy.contains("in use by another program") && busy.contains(&me),
            "{busy}"
        );
        drop(first);
        assert!(PortLock::of_interface(&name).is_ok());
    }
}
