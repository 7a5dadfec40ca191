//! What takes part in a bus whose stations share one line: hosts and drives.

/// A host or a drive.
#[derive(Clone, Debug)]
pub enum Participant<H, D> {
    /// A host: a bench, a client, a tap.
    Host(H),
    /// A drive.
    Drive(D),
}

impl<H, D> Participant<H, D> {
    /// The host, if it is one.
    pub const fn host_mut(&mut self) -> Option<&mut H> {
        match self {
            Self::Host(host) => Some(host),
            Self::Drive(_) => None,
        }
    }

    /// The host, if it is one.
    #[must_use]
    pub const fn host(&self) -> Option<&H> {
        match self {
            Self::Host(host) => Some(host),
            Self::Drive(_) => None,
        }
    }

    /// The drive, if it is one.
    pub const fn drive_mut(&mut self) -> Option<&mut D> {
        match self {
            Self::Host(_) => None,
            Self::Drive(drive) => Some(drive),
        }
    }

    /// The drive, if it is one.
    #[must_use]
    pub const fn drive(&self) -> Option<&D> {
        match self {
            Self::Host(_) => None,
            Self::Drive(drive) => Some(drive),
        }
    }
}
