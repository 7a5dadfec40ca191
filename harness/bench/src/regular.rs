//! Regular files, opened so that a FIFO, a device or a symbolic link in their place is refused and never waited for.

use rustix::fs::OFlags;
use std::fs::{File, FileType, OpenOptions};
use std::io::{self, BufWriter, Read, Write};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Names of a folder that are compared with one that is not there.
const MOST_NAMES: usize = 10_000;

/// What to do about a symbolic link as the last part of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Links {
    /// Open what it points to: for a path that the user has given.
    Follow,
    /// Refuse it: for a file at a place that another user or program may have prepared.
    Refuse,
}

impl Links {
    /// Flags for opening: nothing blocks, and no terminal becomes that of this process.
    pub fn flags(self) -> i32 {
        let flags = OFlags::NONBLOCK | OFlags::NOCTTY;
        let flags = match self {
            Self::Follow => flags,
            Self::Refuse => flags | OFlags::NOFOLLOW,
        };
        flags.bits().cast_signed()
    }
}

/// What a file is, in words.
pub fn kind(of: FileType) -> &'static str {
    if of.is_file() {
        "a regular file"
    } else if of.is_dir() {
        "a folder"
    } else if of.is_symlink() {
        "a symbolic link"
    } else if of.is_fifo() {
        "a FIFO"
    } else if of.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

/// Opens a regular file for reading.
///
/// # Errors
/// It cannot be opened, or is a folder, a FIFO, a device or the like.
pub fn open(path: &Path, links: Links) -> io::Result<File> {
    let failed = |error| in_words(path, error);
    if links == Links::Refuse && path.symlink_metadata().map_err(failed)?.is_symlink() {
        return Err(refused("it is a symbolic link, which could lead anywhere"));
    }
    let opened = OpenOptions::new()
        .read(true)
        .custom_flags(links.flags())
        .open(path);
    let file = opened.map_err(failed)?;
    match file.metadata()?.is_file() {
        true => Ok(file),
        false => Err(refused("it is not a regular file")),
    }
}

/// The remark about a missing file: the name that was probably meant, if its folder has one.
fn no_such_file(path: &Path) -> String {
    let folder = folder_of(path);
    match near_in_folder(path) {
        Some(near) => format!("no such file; did you mean `{near}`?"),
        None if !folder.is_dir() => {
            format!("no such file: there is no folder {}", folder.display())
        }
        None => "no such file, and no similar name is in its folder".to_owned(),
    }
}

/// Why a place cannot be used, and what to do, in place of the operating system's words. The kind of the error stays.
pub fn in_words(path: &Path, error: io::Error) -> io::Error {
    let words = match error.kind() {
        io::ErrorKind::NotFound => no_such_file(path),
        io::ErrorKind::NotADirectory => {
            "a part of this path is a file; name a folder in its place".to_owned()
        }
        io::ErrorKind::AlreadyExists => "there is a file of this name; name another one".to_owned(),
        io::ErrorKind::IsADirectory => "it is a folder; name a file in it".to_owned(),
        io::ErrorKind::PermissionDenied => {
            "this user is not permitted to; name another place, or change its permissions"
                .to_owned()
        }
        _ => return error,
    };
    io::Error::new(error.kind(), words)
}

/// Looks for a folder with the file in which a command keeps its run.
///
/// # Errors
/// Why there is no file, and what to name, in a sentence.
pub fn has_run(path: &Path, record: &str) -> Result<(), String> {
    let why = if let Err(error) = path.metadata() {
        match error.kind() {
            io::ErrorKind::NotFound => match near_in_folder(path) {
                Some(near) => {
                    return Err(format!("there is no such folder; did you mean `{near}`?"));
                }
                None => "there is no such folder".to_owned(),
            },
            _ => return Err(in_words(path, error).to_string()),
        }
    } else if path.is_file() {
        "it is a file".to_owned()
    } else if !path.join(record).exists() {
        format!("there is no {record} in it")
    } else {
        return Ok(());
    };
    Err(format!(
        "{why}; name the folder in which a command has kept its run"
    ))
}

fn folder_of(path: &Path) -> &Path {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    folder.unwrap_or(Path::new("."))
}

/// The most similar name in the folder of a file that is not there, if one is near.
pub(crate) fn near_in_folder(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_string_lossy().to_lowercase();
    let names = std::fs::read_dir(folder_of(path)).ok()?.flatten();
    let names = names.map(|file| file.file_name().to_string_lossy().into_owned());
    let names = names.take(MOST_NAMES).map(|name| {
        (
            strsim::damerau_levenshtein(&wanted, &name.to_lowercase()),
            name,
        )
    });
    let far = wanted.chars().count().max(3) / 3;
    let nearest = names.filter(|(distance, _)| *distance <= far).min();
    nearest.map(|(_, name)| name)
}

/// Opens a regular file, or the pipe of a shell substitution `<(...)`, which this process has open already.
///
/// # Errors
/// As of [`open`].
pub fn open_input(path: &Path) -> io::Result<File> {
    let pipe = |path: &Path| std::fs::metadata(path).is_ok_and(|file| file.file_type().is_fifo());
    match is_descriptor(path) && pipe(path) {
        true => File::open(path),
        false => open(path, Links::Follow),
    }
}

/// Whether a path names a file that this process has open already.
fn is_descriptor(path: &Path) -> bool {
    let folders = ["/dev/fd", "/proc/self/fd"].map(Path::new);
    let streams = ["/dev/stdin", "/dev/stdout", "/dev/stderr"].map(Path::new);
    let folder = path.parent();
    folder.is_some_and(|folder| folders.contains(&folder)) || streams.contains(&path)
}

/// Reads a regular file of at most this many bytes.
///
/// # Errors
/// As of [`open`]; it is longer, or reading it would block, as with some files of the kernel.
pub fn read(path: &Path, links: Links, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let done = open(path, links)?.take(most + 1).read_to_end(&mut bytes);
    match done {
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
            Err(refused("reading it would wait: it is not a regular file"))
        }
        Err(error) => Err(error),
        Ok(_) if bytes.len() as u64 > most => Err(io::Error::other(format!(
            "it has more than {} KiB",
            most >> 10
        ))),
        Ok(_) => Ok(bytes),
    }
}

/// Writes a file beside its place and renames it, so that it is complete or not there at all. A device such as `/dev/null`, or the pipe of a
/// shell substitution `>(...)`, is written to and stays.
///
/// # Errors
/// It cannot be written, or the path is no file.
pub fn write(
    path: &Path,
    write: impl FnOnce(BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    let kind = std::fs::metadata(path).map(|file| file.file_type()).ok();
    if kind.is_some_and(|kind| kind.is_char_device() || kind.is_fifo() && is_descriptor(path)) {
        let flags = OFlags::NOCTTY.bits().cast_signed();
        let file = OpenOptions::new()
            .write(true)
            .custom_flags(flags)
            .open(path)?;
        return write(BufWriter::new(&file));
    }
    if kind.is_some_and(|kind| !kind.is_file()) {
        let folder = kind.is_some_and(|kind| kind.is_dir());
        let why = if folder {
            "it is a folder; name a file in it"
        } else {
            "it is not a regular file"
        };
        return Err(refused(why));
    }
    // Not the link is replaced, but the file that it leads to.
    let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let mut beside = path.clone().into_os_string();
    beside.push(format!(".{}.part", std::process::id()));
    let beside = PathBuf::from(beside);
    let begun = File::create_new(&beside).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => {
            let folder = folder_of(&path).display();
            io::Error::new(
                error.kind(),
                format!("there is no folder {folder}; make it first"),
            )
        }
        _ => in_words(&path, error),
    });
    let written = begun
        .and_then(|file| write(BufWriter::new(&file)).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&beside, &path));
    written.inspect_err(|_| {
        // Where nothing was begun there is nothing to remove.
        let _gone = std::fs::remove_file(&beside);
    })
}

/// Writes a text like [`write()`].
///
/// # Errors
/// As of [`write()`].
pub fn write_text(path: &Path, text: impl AsRef<[u8]>) -> io::Result<()> {
    write(path, |mut out| {
        out.write_all(text.as_ref())?;
        out.flush()
    })
}

/// Whether the path that was given is wrong, or the rights to it, and not the disk.
pub fn is_wrong_path(error: &io::Error) -> bool {
    use io::ErrorKind::{
        AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory, NotFound,
        PermissionDenied, ReadOnlyFilesystem,
    };
    matches!(
        error.kind(),
        AlreadyExists
            | InvalidFilename
            | InvalidInput
            | IsADirectory
            | NotADirectory
            | NotFound
            | PermissionDenied
            | ReadOnlyFilesystem
    )
}

fn refused(why: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_there_is_named_with_a_similar_one() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("Drive1.log"), "text").expect("room");
        for (name, words) in [
            ("drive.log", "no such file; did you mean `Drive1.log`?"),
            (
                "other.txt",
                "no such file, and no similar name is in its folder",
            ),
            ("logs/drive.log", "no such file: there is no folder "),
        ] {
            let error = open_input(&folder.path().join(name)).expect_err(name);
            assert!(error.to_string().starts_with(words), "{error}");
            assert_eq!(error.kind(), io::ErrorKind::NotFound);
        }
    }

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("file"), "text").expect("room");
        std::os::unix::fs::symlink("file", path("link")).expect("a link");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, path("fifo"), mode).expect("a FIFO");
        let read = |name: &str, links, most| {
            read(&path(name), links, most).map_err(|error| error.to_string())
        };
        assert_eq!(read("file", Links::Refuse, 4), Ok(b"text".to_vec()));
        assert_eq!(read("link", Links::Follow, 4), Ok(b"text".to_vec()));
        // What a command writes replaces a file, or the file that a link leads to, and goes to a device.
        for name in ["file", "link", "new", "/dev/null"] {
            write_text(&path(name), "other").expect(name);
        }
        assert_eq!(std::fs::read(path("file")).expect("a file"), b"other");
        assert!(path("link").is_symlink());
        assert!(
            std::fs::metadata("/dev/null")
                .expect("it stays")
                .file_type()
                .is_char_device()
        );
        for (name, wrong_path) in [
            ("fifo", true),
            ("/dev/full", false),
            ("no/file", true),
            (".", true),
        ] {
            let error = write_text(&path(name), "other").expect_err(name);
            assert_eq!(is_wrong_path(&error), wrong_path, "{name}: {error}");
        }
        std::fs::write(path("file"), "text").expect("room");
        for (name, links, most, why) in [
            ("link", Links::Refuse, 4, "symbolic link"),
            ("fifo", Links::Refuse, 4, "not a regular file"),
            ("fifo", Links::Follow, 4, "not a regular file"),
            (".", Links::Follow, 4, "not a regular file"),
            ("/dev/zero", Links::Follow, 4, "not a regular file"),
            ("file", Links::Refuse, 3, "more than"),
        ] {
            let error = read(name, links, most).expect_err(name);
            assert!(error.contains(why), "{name}: {error}");
        }
    }
}
