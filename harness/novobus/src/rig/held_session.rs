//! A rig in use, which a run holds for as long as it takes, or for a while of a longer use.

use super::session::Session;
use std::ops::{Deref, DerefMut};

pub(super) enum HeldSession<'s> {
    Own(Box<Session>),
    Lent(&'s mut Session),
}

impl Deref for HeldSession<'_> {
    type Target = Session;

    fn deref(&self) -> &Session {
        match self {
            Self::Own(session) => session,
            Self::Lent(session) => session,
        }
    }
}

impl DerefMut for HeldSession<'_> {
    fn deref_mut(&mut self) -> &mut Session {
        match self {
            Self::Own(session) => session,
            Self::Lent(session) => session,
        }
    }
}
