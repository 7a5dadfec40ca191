//! The sums of a folder that is no evidence of scenarios, such as a run of `fuzz run`, and their signature.

use super::files::{SIGNATURE, SUMS, compare_sums, sums};
use super::folder::EvidenceError;
use super::signature::{self, Signer};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Whether a folder can be signed later with the key of this file.
///
/// # Errors
/// There is no such file, or no `ssh-keygen`.
pub fn can_sign(key: &Path) -> Result<(), EvidenceError> {
    signature::ready(key)
}

/// Writes the sums of a folder's files and signs them with a key of `ssh-keygen`; an earlier signature is replaced.
///
/// # Errors
/// [`EvidenceError`].
pub fn seal(path: &Path, key: &Path) -> Result<(), EvidenceError> {
    let failed = |file: &Path, error| EvidenceError::File {
        path: file.display().to_string(),
        error,
    };
    let earlier = path.join(SIGNATURE);
    match fs::remove_file(&earlier) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(&earlier, error)),
        _ => {}
    }
    let file = path.join(SUMS);
    fs::write(&file, sums(path)?).map_err(|error| failed(&file, error))?;
    signature::sign(path, key)
}

/// What is wrong with the files of a folder: sums that differ, files that are missing or were added, a signature that does not count. `None`
/// where the folder has no sums.
///
/// # Errors
/// It cannot be read, or a signature cannot be checked here.
pub fn sealed(
    path: &Path,
    signer: Option<Signer<'_>>,
) -> Result<Option<Vec<String>>, EvidenceError> {
    if !path.join(SUMS).exists() && signer.is_none() {
        return Ok(None);
    }
    let mut wrong = compare_sums(path)?;
    if let Some(signer) = signer {
        wrong.extend(signature::check(path, signer)?);
    }
    Ok(Some(wrong))
}
