//! The files of a folder of evidence, and their sums.

use super::error::EvidenceError;
use crate::regular::{self, Links};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read as _};
use std::path::Path;

pub const SUMS: &str = "SHA256SUMS";
/// The signature of the sums.
pub const SIGNATURE: &str = "SHA256SUMS.sig";
/// The file of the record.
pub const RECORD: &str = "run.jsonl";
/// The file of the rig.
pub const RIG: &str = "rig.toml";
/// The profile that the rig's file names.
pub const KNOWN_PROFILE: &str = "known-profile.toml";
/// The file of program, system and date.
pub const VERSIONS: &str = "versions.json";
/// The file of verdicts for programs.
pub const JUNIT: &str = "junit.xml";
/// The file of verdicts for people.
pub const REPORT: &str = "report.txt";
/// The file of the page for people.
pub const PAGE: &str = "report.html";
pub const SCENARIOS: &str = "scenarios";
pub const CAPTURES: &str = "captures";

/// The file of a qualification with what the drives do where the manual leaves it open.
pub const PROFILE: &str = "profile.toml";
/// The file of a qualification that says what was compared and which deviations explain it.
pub const DEVIATIONS: &str = "deviations.txt";

/// The largest file of a folder that is read at once, in bytes.
const LARGEST: u64 = 1 << 31;

/// How much of a file is read at once for its sum, in bytes.
const PIECE: usize = 1 << 16;

/// The sum of some bytes, as `sha256sum` prints it.
pub fn sum(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The sum of a file, which is read in pieces: a record may be large.
fn sum_of(file: &Path) -> io::Result<String> {
    let mut file = regular::open(file, Links::Refuse)?;
    let mut digest = Sha256::new();
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece)? {
            0 => break,
            read => digest.update(&piece[..read]),
        }
    }
    let digest = digest.finalize();
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Reads a file of a folder, which must be a regular one.
pub fn read(path: &Path, file: &str) -> io::Result<Vec<u8>> {
    regular::read(&path.join(file), Links::Refuse, LARGEST)
}

/// Reads a text of a folder; why not, in a sentence.
pub fn read_text(path: &Path, file: &str) -> Result<String, String> {
    let text = read(path, file).map_err(|error| format!("{file}: {error}"))?;
    String::from_utf8(text).map_err(|error| format!("{file}: {error}"))
}

/// The sums of every file of a folder but that of sums, as `sha256sum` prints them.
pub fn sums(path: &Path) -> Result<String, EvidenceError> {
    let mut lines = String::new();
    let mut listing = Listing::of(path)?;
    for (file, sum) in listing.sums(path) {
        // Writing to a String cannot fail.
        let _infallible = writeln!(lines, "{sum}  {file}");
    }
    Ok(lines)
}

/// The names of the regular files of a folder, in order.
pub fn names(path: &Path) -> Vec<String> {
    let files = Listing::of(path).map(|listing| listing.files);
    files.unwrap_or_default().into_iter().collect()
}

/// How many bytes the files of a folder have together, and how many of them its captures have.
#[must_use]
pub fn size(path: &Path) -> (u64, u64) {
    let files = names(path).into_iter().chain([SUMS.to_owned()]);
    let size = |file: &String| path.join(file).metadata().map_or(0, |data| data.len());
    let (captures, others): (Vec<_>, Vec<_>) =
        files.partition(|file| Path::new(file).starts_with(CAPTURES));
    let captures = captures.iter().map(size).sum();
    (captures + others.iter().map(size).sum::<u64>(), captures)
}

/// What is wrong with the files of a folder. Without sums, as of a run that did not end, only that one is no regular file.
pub fn compare_sums(path: &Path) -> Result<Vec<String>, EvidenceError> {
    let mut listing = Listing::of(path)?;
    let sums = listing.sums(path);
    let mut wrong = listing.refused;
    let stated = match read(path, SUMS) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(wrong),
        Err(error) => {
            wrong.push(format!("{SUMS}: {error}"));
            return Ok(wrong);
        }
    };
    let lines = stated.lines().count();
    let pairs = stated.lines().filter_map(|line| line.split_once("  "));
    let stated: BTreeMap<_, _> = pairs.map(|(sum, file)| (file, sum)).collect();
    for (file, sum) in &stated {
        match sums.get(*file) {
            None => wrong.push(format!("{file} is missing")),
            Some(actual) if actual != sum => wrong.push(format!("{file} was changed")),
            Some(_) => {}
        }
    }
    if stated.len() != lines {
        wrong.push(format!(
            "{SUMS} has lines that are no sum of a file of its own"
        ));
    }
    let added = sums.keys();
    let added = added.filter(|file| !stated.contains_key(file.as_str()));
    wrong.extend(added.map(|file| format!("{file} was added")));
    Ok(wrong)
}

/// The files of a folder.
struct Listing {
    /// Each regular file but that of sums.
    files: BTreeSet<String>,
    /// What cannot be read, and folders and links that do not belong there; each in a sentence.
    refused: Vec<String>,
}

impl Listing {
    fn of(path: &Path) -> Result<Self, EvidenceError> {
        let mut listing = Self {
            files: BTreeSet::new(),
            refused: Vec::new(),
        };
        for folder in ["", SCENARIOS, CAPTURES] {
            listing.add(path, folder)?;
        }
        Ok(listing)
    }

    fn add(&mut self, path: &Path, folder: &str) -> Result<(), EvidenceError> {
        let whole = path.join(folder);
        let failed = |error| EvidenceError::file(&whole, error);
        if !folder.is_empty() {
            match whole.symlink_metadata() {
                Ok(metadata) if metadata.is_dir() => {}
                Ok(metadata) => {
                    self.refused.push(refused(folder, metadata.file_type()));
                    return Ok(());
                }
                Err(_) => return Ok(()),
            }
        }
        for entry in fs::read_dir(&whole).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let kind = entry.file_type().map_err(failed)?;
            let file = match folder {
                "" => name,
                folder => format!("{folder}/{name}"),
            };
            // The sums are read, and the two folders looked at, elsewhere.
            if [SUMS, SCENARIOS, CAPTURES].contains(&file.as_str()) {
                continue;
            }
            if !kind.is_file() {
                self.refused.push(refused(&file, kind));
                continue;
            }
            // A signature has no sum: it is of the sums.
            if file == SIGNATURE {
                continue;
            }
            self.files.insert(file);
        }
        Ok(())
    }

    /// The sum of each file that can be read.
    fn sums(&mut self, path: &Path) -> BTreeMap<String, String> {
        let mut sums = BTreeMap::new();
        for file in &self.files {
            match sum_of(&path.join(file)) {
                Ok(sum) => {
                    sums.insert(file.clone(), sum);
                }
                Err(error) => self.refused.push(format!("{file}: {error}")),
            }
        }
        sums
    }
}

/// Why something that is no regular file has no place in a folder of evidence.
fn refused(file: &str, kind: fs::FileType) -> String {
    let what = match (kind.is_symlink(), kind.is_dir()) {
        (true, _) => "a symbolic link",
        (_, true) => "a folder",
        _ => "not a regular file",
    };
    format!("{file} is {what}, which has no place in evidence")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_from_the_sums_is_said() {
        let folder = tempfile::tempdir().expect("room");
        let path = folder.path();
        let scenario = "scenarios/a.scn";
        fs::create_dir(path.join(SCENARIOS)).expect("room");
        let put = |name: &str, text: &str| fs::write(path.join(name), text).expect("room");
        let remove = |name: &str| fs::remove_file(path.join(name)).expect("a file");
        let wrong = || compare_sums(path).expect("a folder");
        put(VERSIONS, "{}");
        put(scenario, "title a\n");
        let stated = sums(path).expect("a folder");
        put(SUMS, &stated);
        assert_eq!(wrong(), [""; 0]);
        // A file of the same length.
        put(VERSIONS, "[]");
        put("notes", "");
        remove(scenario);
        assert_eq!(
            wrong(),
            [
                "scenarios/a.scn is missing",
                "versions.json was changed",
                "notes was added"
            ]
        );
        put(VERSIONS, "{}");
        put(scenario, "title a\n");
        remove("notes");
        for more in ["x\n", stated.as_str()] {
            put(SUMS, &(stated.clone() + more));
            let words = "SHA256SUMS has lines that are no sum of a file of its own";
            assert_eq!(wrong(), [words], "{more}");
        }
        fs::create_dir(path.join("parts")).expect("room");
        put(SUMS, &stated);
        assert_eq!(
            wrong(),
            ["parts is a folder, which has no place in evidence"]
        );
    }
}
