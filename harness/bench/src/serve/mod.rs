//! Simulated rings served to anyone's master, over a pseudo terminal or a socket, in real time.
//!
//! `Server` is the whole of it without I/O: bytes of a client in, bytes of the ring out, the time an argument. Each bus has its own
//! [`ServedBus`]. [`serve`] is the shell around it: one thread that waits for pseudo terminals, sockets, signals and lines of control.

pub mod arrival;
pub mod clock;
pub mod control;
pub mod control_stream;
pub mod frames;
pub mod lines;
pub mod place;
pub mod pty;
pub mod served;
pub mod shell;
pub mod stage;
pub mod tcp;
mod thread;

pub use control::{ControlAnswer, first, step_at_once};
pub use place::{ClientRole, ControlPlace, Inner, Pace, ServedAt};
pub use served::ServedBus;
pub use shell::{EndRequest, serve_until};
pub use shell::{ServeEnd, ServeError, ServeHost, ServeOptions, serve};
pub use thread::ServedThread;
