//! The live view of a bench: drives, their states and errors, the traffic and what was disturbed.
//!
//! [`Top`] is what is known and what the user wants to see of it, [`keys`] what a key does to it, [`view`] makes a page of it.
//! None of the three knows a terminal, a drive or the time: what was read comes as a [`Snapshot`], and the same
//! readings and keys give the same page. [`screen`] is the terminal, which is left as it was.

pub mod keys;
pub mod screen;
pub mod view;

pub use crate::buses::rings::top::{
    Disturbance, DriveReading, Heading, RingReading, Snapshot, Top,
};
pub(crate) use crate::buses::rings::top::{KeyTarget, TopRow};
pub use keys::{Key, Press};
pub use screen::Screen;
