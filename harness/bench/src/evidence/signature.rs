//! A detached signature of a folder's sums, made and checked by OpenSSH's `ssh-keygen`.

use super::error::EvidenceError;
use super::files::{self, SIGNATURE, SUMS};
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::{Command, Stdio};

const TOOL: &str = "ssh-keygen";

/// What a signature is for: one made for something else does not count.
const NAMESPACE: &str = "drivebench";

/// Whose signature a folder is to have.
#[derive(Clone, Copy, Debug)]
pub struct Signer<'s> {
    /// The file of allowed signers, in the form of `ssh-keygen(1)`.
    pub allowed: &'s Path,
    /// The identity that the file lists.
    pub identity: &'s str,
}

/// Whether a folder can be signed later with the key of this file.
///
/// # Errors
/// There is no such file, or no `ssh-keygen`.
pub fn ready(key: &Path) -> Result<(), EvidenceError> {
    if !key.is_file() {
        let key = key.display();
        return Err(EvidenceError::Signature(format!(
            "{key} is not a file of a key; `ssh-keygen -t ed25519 -f FILE` makes one"
        )));
    }
    let mut command = Command::new(TOOL);
    command.arg("-?").stdin(Stdio::null());
    let found = command.output();
    found.map(|_| ()).map_err(|error| missing(&error))
}

/// Signs the sums of a folder.
///
/// # Errors
/// What the program says.
pub fn sign(path: &Path, key: &Path) -> Result<(), EvidenceError> {
    let mut command = Command::new(TOOL);
    command.args(["-q", "-Y", "sign", "-n", NAMESPACE, "-f"]);
    command.arg(key).arg(path.join(SUMS)).stdin(Stdio::null());
    let output = command.output().map_err(|error| missing(&error))?;
    match output.status.success() {
        true => Ok(()),
        false => Err(failed("sign", &output.stderr)),
    }
}

/// Checks the signature of a folder; why it does not count, in a sentence.
///
/// # Errors
/// There is no `ssh-keygen`.
pub fn check(path: &Path, signer: Signer<'_>) -> Result<Option<String>, EvidenceError> {
    for file in [SUMS, SIGNATURE] {
        if let Err(error) = files::read(path, file) {
            let why = match error.kind() {
                ErrorKind::NotFound => "it is missing".to_owned(),
                _ => error.to_string(),
            };
            return Ok(Some(format!("{file}: {why}")));
        }
    }
    let sums = files::read(path, SUMS).unwrap_or_default();
    let mut command = Command::new(TOOL);
    command.args(["-Y", "verify", "-n", NAMESPACE, "-f"]);
    command
        .arg(signer.allowed)
        .args(["-I", signer.identity, "-s"]);
    command.arg(path.join(SIGNATURE));
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| missing(&error))?;
    if let Some(mut stdin) = child.stdin.take() {
        // Where the program has ended already, its exit code says why.
        let _unread = stdin.write_all(&sums);
    }
    let output = child.wait_with_output().map_err(|error| missing(&error))?;
    Ok((!output.status.success()).then(|| {
        let said = [&output.stdout[..], &output.stderr[..]].concat();
        let said = String::from_utf8_lossy(&said).trim().replace('\n', "; ");
        format!(
            "{SIGNATURE} is not a signature of {} by {}: {said}",
            signer.identity,
            signer.allowed.display()
        )
    }))
}

fn missing(error: &std::io::Error) -> EvidenceError {
    EvidenceError::Signature(format!(
        "failed to run {TOOL}: {error}; it is part of OpenSSH's client"
    ))
}

fn failed(what: &str, said: &[u8]) -> EvidenceError {
    let said = String::from_utf8_lossy(said).trim().replace('\n', "; ");
    EvidenceError::Signature(format!("{TOOL} failed to {what}: {said}"))
}
