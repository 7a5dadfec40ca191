//! Where rings are served, and where lines of control come from.

use std::path::PathBuf;

/// Where a ring is served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// On a socket that listens: `127.0.0.1:4000`, or port 0 for a free one.
    Tcp(String),
    /// On a pseudo terminal with a link at this path, which must not be there yet.
    Pty(PathBuf),
}

/// Where lines of control come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlPlace {
    /// Standard input; the answers go to standard output.
    Standard,
    /// A socket that listens.
    Tcp(String),
}
