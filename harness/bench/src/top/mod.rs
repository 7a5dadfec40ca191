//! The live view of a bench: drives, their states and errors, the traffic and what was disturbed.
//!
//! [`Top`] is the known state and the view that the user has chosen, [`keys`] what a key does to it, [`view`] makes a page of it.
//! None of the three knows a terminal, a bus or the time: a bus says by a [`TopForm`] how its drives are shown, what was read comes as a
//! [`Snapshot`], and the same readings and keys give the same page. [`screen`] is the terminal, which is restored.

pub mod keys;
pub mod reading;
pub mod screen;
pub mod state;
pub mod view;

pub use keys::{Key, Press};
pub use reading::{HeadLine, Heading, Snapshot, TopColumn, TopEvent, TopForm, TopRow};
pub use screen::Screen;
pub use state::Top;
