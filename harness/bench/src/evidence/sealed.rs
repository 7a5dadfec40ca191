//! The sums of a folder that is no evidence of scenarios, such as a run of `fuzz run`, and their signature.

use super::error::EvidenceError;
use super::files::{SIGNATURE, SUMS, compare_sums, sums};
use super::signature::{self, Signer};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// Whether a folder can be signed later with the key of this file.
///
/// # Errors
/// There is no such file, or no `ssh-keygen`.
pub(crate) fn can_sign(key: &Path) -> Result<(), EvidenceError> {
    signature::ready(key)
}

/// Writes the sums of a folder's files, and signs them where there is a key of `ssh-keygen`.
///
/// # Errors
/// [`EvidenceError`].
pub(crate) fn seal(path: &Path, key: Option<&Path>) -> Result<(), EvidenceError> {
    unseal(path)?;
    let file = path.join(SUMS);
    fs::write(&file, sums(path)?).map_err(|error| failed(&file, error))?;
    key.map_or(Ok(()), |key| signature::sign(path, key))
}

/// Removes the sums and the signature of a folder: without them the run in it has not ended.
///
/// # Errors
/// [`EvidenceError`].
pub(crate) fn unseal(path: &Path) -> Result<(), EvidenceError> {
    for file in [SIGNATURE, SUMS].map(|name| path.join(name)) {
        match fs::remove_file(&file) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(&file, error)),
            _ => {}
        }
    }
    Ok(())
}

fn failed(file: &Path, error: std::io::Error) -> EvidenceError {
    EvidenceError::file(file, error)
}

/// What a folder does not prove whose signature is not checked.
pub fn unsigned(path: &Path) -> &'static str {
    match path.join(SIGNATURE).exists() {
        true => "its signature: --allowed-signers FILE --identity ID checks it",
        false => {
            "who made this folder: it has no signature (`--sign` makes one), and anyone who can edit it can invent a run"
        }
    }
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
