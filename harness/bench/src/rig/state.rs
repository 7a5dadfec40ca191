//! The state of rigs that the program keeps on this machine, and the folder it is kept in.
//!
//! The folder is `$DRIVEBENCH_STATE`, else `/run/lock/drivebench`, which all users of a machine share, else
//! `$XDG_RUNTIME_DIR/drivebench`, else `drivebench-UID` in the folder for temporary files. Of each rig it has
//! `ID.lock`, which is never removed, `ID.quarantine` while the rig must not be used, `ID.rest` where it was left at rest,
//! and `ID.left` while a scenario has changed what is not put back yet.

use super::check::Rig;
use super::file::Quarantine;
use crate::regular::{self, Links};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::{DirBuilder, File, Permissions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The folder, where the environment names one.
pub(crate) const FOLDER_VARIABLE: &str = "DRIVEBENCH_STATE";

/// The folder for all users: its parent and its name.
const SHARED: [&str; 2] = ["/run/lock", "drivebench"];

/// The most bytes that are read of one of these files.
const MAX_SIZE: u64 = 1 << 16;

/// Who uses a rig, and since when.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Holder {
    /// The process.
    pub pid: u32,
    /// The user's name, or number where it has none.
    pub user: String,
    /// The user's number.
    pub uid: u32,
    /// The machine.
    pub host: String,
    /// Since when, in UTC: `2026-03-14T14:02:11Z`.
    pub since: String,
    /// What for.
    pub purpose: String,
}

impl Holder {
    /// This process, now.
    #[must_use]
    pub fn me(purpose: &str) -> Self {
        let uid = rustix::process::getuid().as_raw();
        let name = |key| std::env::var(key).ok().filter(|name| !name.is_empty());
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname");
        Self {
            pid: std::process::id(),
            user: name("USER")
                .or_else(|| name("LOGNAME"))
                .or_else(|| account(uid))
                .unwrap_or_else(|| uid.to_string()),
            uid,
            host: host.map_or_else(|_| "this machine".to_owned(), |host| host.trim().to_owned()),
            since: utc(SystemTime::now()),
            purpose: purpose.to_owned(),
        }
    }
}

/// The name of a user of this machine.
fn account(uid: u32) -> Option<String> {
    let text = std::fs::read_to_string("/etc/passwd").ok()?;
    text.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == uid.to_string()).then(|| name.to_owned())
    })
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            pid,
            user,
            host,
            since,
            purpose,
            ..
        } = self;
        write!(
            f,
            "{user} (pid {pid} on {host}) since {since}, purpose `{purpose}`"
        )
    }
}

/// A time in UTC, to the second: `2026-03-14T14:02:11Z`. Times before 1970 are 1970.
#[must_use]
pub fn utc(time: SystemTime) -> String {
    let seconds = time
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default()
        .as_secs();
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    // Years begin in March, so that the day that comes and goes is the last one.
    let shifted = days + 719_468;
    let (era, day) = (shifted / 146_097, shifted % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let date = day - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 {
        (month + 3, 0)
    } else {
        (month - 9, 1)
    };
    let year = year + era * 400 + carry;
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{year:04}-{month:02}-{date:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// The folder, made where it is not there yet: for this user alone, but for the shared one.
///
/// # Errors
/// It cannot be made.
pub fn folder() -> io::Result<PathBuf> {
    let named = |key: &str| {
        std::env::var_os(key)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    if let Some(folder) = named(FOLDER_VARIABLE) {
        return make(folder, 0o700);
    }
    let shared = Path::new(SHARED[0]);
    if shared.is_dir() {
        // Where this user may not write there, the user's own folder has to do.
        if let Ok(folder) = make(shared.join(SHARED[1]), 0o1777) {
            return Ok(folder);
        }
    }
    let uid = rustix::process::getuid().as_raw();
    let of_session = named("XDG_RUNTIME_DIR").map(|folder| folder.join(SHARED[1]));
    make(
        of_session.unwrap_or_else(|| std::env::temp_dir().join(format!("drivebench-{uid}"))),
        0o700,
    )
}

fn make(folder: PathBuf, mode: u32) -> io::Result<PathBuf> {
    if !folder.is_dir() {
        DirBuilder::new()
            .recursive(true)
            .mode(mode)
            .create(&folder)?;
        // The umask took bits away.
        std::fs::set_permissions(&folder, Permissions::from_mode(mode))?;
    }
    Ok(folder)
}

/// Reads at most 64 KiB of one of these files.
pub fn read(file: &File) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(MAX_SIZE).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The id of the current boot; empty if it cannot be read.
fn boot() -> String {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id");
    boot.map_or_else(|_| String::new(), |boot| boot.trim().to_owned())
}

fn rest_file(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{id}.rest"))
}

/// Notes that a rig was left at rest: every drive waits for a sync byte, and none is in the middle of a command.
///
/// # Errors
/// The file cannot be written.
pub fn left_at_rest(folder: &Path, id: &str) -> io::Result<()> {
    create(&rest_file(folder, id))?.write_all(boot().as_bytes())
}

/// Makes one of these files, empty.
pub fn create(path: &Path) -> io::Result<File> {
    let mut options = std::fs::OpenOptions::new();
    options.write(true).create(true).truncate(true);
    options.custom_flags(Links::Refuse.flags());
    options.open(path)
}

/// Whether a rig was left at rest since the last boot. Asking removes the note, because the caller is about to send something.
pub fn take_rest(folder: &Path, id: &str) -> bool {
    let path = rest_file(folder, id);
    let kept = regular::read(&path, Links::Refuse, MAX_SIZE);
    // A note that cannot be removed would be trusted again later.
    let taken = std::fs::remove_file(path).is_ok();
    let boot = boot();
    taken && !boot.is_empty() && kept.is_ok_and(|kept| kept == boot.as_bytes())
}

fn quarantine_file(folder: &Path, id: &str) -> PathBuf {
    folder.join(format!("{id}.quarantine"))
}

impl Rig {
    /// Why it must not be used: by its own file, or by a quarantine file in the folder.
    ///
    /// # Errors
    /// As of [`quarantine`].
    pub fn quarantine(&self, folder: &Path) -> io::Result<Option<Quarantine>> {
        match &self.file.quarantine {
            Some(quarantine) => Ok(Some(quarantine.clone())),
            None => quarantine(folder, self.id()),
        }
    }
}

/// Why a rig must not be used, if [`set_quarantine`] has put it in quarantine.
///
/// # Errors
/// The file cannot be read, or is not ours.
pub fn quarantine(folder: &Path, id: &str) -> io::Result<Option<Quarantine>> {
    let file = match regular::open(&quarantine_file(folder, id), Links::Refuse) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    Ok(Some(serde_json::from_slice(&read(&file)?)?))
}

/// Puts a rig in quarantine, or, with `None`, takes it out of it.
///
/// # Errors
/// The file cannot be written or removed.
pub fn set_quarantine(folder: &Path, id: &str, reason: Option<&str>) -> io::Result<()> {
    let path = quarantine_file(folder, id);
    let Some(reason) = reason else {
        return match std::fs::remove_file(path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        };
    };
    let quarantine = Quarantine {
        since: utc(SystemTime::now()),
        reason: reason.to_owned(),
    };
    // Written beside it first and renamed, so that readers never see half a file.
    let new = path.with_extension(format!("quarantine.{}", std::process::id()));
    File::create_new(&new)?.write_all(&serde_json::to_vec(&quarantine)?)?;
    std::fs::rename(new, path)
}
