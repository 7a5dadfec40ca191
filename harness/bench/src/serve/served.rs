//! What a bus behind streams of octets offers the shell: octets and the time are arguments, deadlines are return values.

use super::control::ControlAnswer;
use crate::web::LiveView;
use harness_proto::marks::BadMark;
use harness_proto::time::Instant;

/// A simulated bus with seats for clients, without I/O. First come the seats of masters.
pub trait ServedBus {
    /// How many seats there are.
    fn seats(&self) -> usize;
    /// How many of them are masters' places.
    fn masters(&self) -> usize;
    /// What a seat is called in messages: `ring 1`.
    fn name(&self, seat: usize) -> String;
    /// The same with what is behind it: `ring 1: 3 drives`.
    fn title(&self, seat: usize) -> String;
    /// A client takes a seat.
    fn come(&mut self, seat: usize);
    /// The client has disconnected; its unread output is dropped.
    fn go(&mut self, seat: usize);
    /// How many octets of its client's stream a seat takes now.
    fn room(&self, seat: usize) -> usize;
    /// Takes octets of a client's stream.
    ///
    /// # Errors
    /// The first octet that is no mark where one is required; it is dropped, and the others are taken.
    fn receive(&mut self, seat: usize, octets: &[u8]) -> Result<(), BadMark>;
    /// Lets time pass up to the clock's time `clock`.
    fn advance(&mut self, clock: Instant);
    /// What a seat has for its client.
    fn transmit(&mut self, seat: usize) -> &[u8];
    /// The first `count` octets of that have been passed on.
    fn transmitted(&mut self, seat: usize, count: usize);
    /// How many octets the client has lost because it did not read.
    fn lost(&self, seat: usize) -> u64;
    /// When, by the clock, the next octet arrives at a client that may be waiting for it.
    fn awaited(&self) -> Option<Instant>;
    /// When, by the clock, [`advance`](Self::advance) is to be called again if nothing comes before.
    fn deadline(&self) -> Instant;
    /// Does a line of control at once; `None` for an empty line or a comment.
    fn control(&mut self, line: &str) -> Option<ControlAnswer>;
    /// What its stations have done since the last call that a master cannot see, a sentence each.
    fn remarks(&mut self) -> Vec<String> {
        Vec::new()
    }
    /// What it shows on a live page.
    fn live(&mut self) -> &mut dyn LiveView;
}
