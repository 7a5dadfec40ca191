//! Where rings are served, and where lines of control come from.

use std::path::PathBuf;

/// Where a ring is served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ServedAt {
    /// On a socket that listens: `127.0.0.1:4000`, or port 0 for a free one.
    Tcp(String),
    /// On a pseudo terminal with a link at this path, which must not be there yet.
    Pty(PathBuf),
    /// Nowhere: no client comes. What happens is shown on the live page.
    Nowhere,
}

/// Where lines of control come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ControlPlace {
    /// Standard input; the answers go to standard output.
    Standard,
    /// A socket that listens.
    Tcp(String),
}

/// A link between two stations of a ring to which a client connects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inner {
    /// Which ring, counted from 0.
    pub ring: usize,
    /// Which link, counted from the master's outgoing one.
    pub link: usize,
    /// What the client does there.
    pub role: ClientRole,
}

/// What a client does at a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientRole {
    /// It hears what the link carries; what it sends is dropped.
    Tap,
    /// The link is cut open there: the client hears the drive in front and feeds the drive behind.
    Cut,
    /// The same, and this client only hears.
    Upstream,
    /// The same, and this client only feeds.
    Downstream,
}

impl ClientRole {
    pub fn hears(self) -> bool {
        self != Self::Downstream
    }

    pub fn feeds(self) -> bool {
        matches!(self, Self::Cut | Self::Downstream)
    }
}

/// How fast time passes on a served bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// As on the line: a byte takes its byte time.
    #[default]
    Line,
    /// As fast as possible while bytes of the master's are under way; as on the line while none are, so that time-outs (ND21
    /// 9.9) happen and motors turn.
    Free,
}
