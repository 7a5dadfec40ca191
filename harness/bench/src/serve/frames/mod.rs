//! A simulated CAN bus served to several clients at a time, in real time, by SLCAN and socketcand.
//!
//! [`FrameServer`] is the whole of it without I/O: bytes of clients in, bytes for them out, the time an argument.
//! [`serve_frames`] is the shell around it: one thread that waits for sockets, pseudo terminals, signals and lines of control.

pub mod server;
pub mod session;
pub mod shell;

pub use server::{FrameServer, MOST_CLIENTS};
pub use session::Protocol;
pub use shell::{FramePlace, serve_frames};

use super::ControlAnswer;
use crate::web::LiveView;
use harness_proto::can::BitRate;
use harness_proto::time::Instant;
use harness_sim::segment::Host;

/// A simulated bus with places for clients.
pub trait SharedBus {
    /// The bit rate of the bus.
    fn rate(&self) -> BitRate;

    /// The stations of the bus besides the clients: `2 drives`.
    fn about(&self) -> String;

    fn now(&self) -> Instant;

    /// Lets everything happen up to `to`. A frame that has begun by then is carried to its end.
    fn advance(&mut self, to: Instant);

    /// When something happens next by itself; `None` while all stations wait.
    fn next_event(&self) -> Option<Instant>;

    /// The station of a client; `None` for a place that the bus does not have.
    fn host(&mut self, client: usize) -> Option<&mut Host>;

    /// Puts a station at a client's place, as it is when it is switched on.
    fn put(&mut self, client: usize, host: Host);

    /// Does a line of control. `None` for an empty line or a comment.
    fn control(&mut self, line: &str) -> Option<ControlAnswer>;

    /// What it shows on a live page.
    fn live(&mut self) -> &mut dyn LiveView;
}
