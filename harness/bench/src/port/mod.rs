//! Streams of bytes that the operating system gives: serial ports, pseudo terminals, sockets.
//!
//! A [`Wire`] is one of them with its coding: bytes with their line errors come out of it, and bytes,
//! deliberate line errors among them, go into it. It never blocks but where a byte with a wrong parity bit is sent
//! on a serial port, which has to be drained before and after it.
//!
//! What each carries:
//!
//! | transport | line errors received | wrong parity sent | breaks sent |
//! |---|---|---|---|
//! | `serial` | each at its byte (`INPCK` and `PARMRK`) | yes, between drained bytes | yes |
//! | `pty`, `tcp` with in-band marks | each at its byte | yes | yes |
//! | `pty`, `tcp` with plain bytes | none | no | no |
//! | `rfc2217` | that there was one, not at which byte | no | no |

pub mod holder;
pub mod last_words;
pub mod ledger;
pub mod open;
pub mod rfc2217;
pub mod serial;
pub mod tap;
pub mod wire;

pub use harness_uart::Counts;
pub use holder::OtherProgram;
pub(crate) use holder::is_exclusive;
pub use last_words::WireParts;
pub use last_words::{LastWords, LastWordsError};
pub(crate) use open::open_adapter;
pub use open::{OpenError, PortAddress, PortSettings, open};
pub use serial::Switch;
pub use tap::{SilentTap, TapState};
pub use wire::{Abilities, Outgoing, Wire};

use rustix::thread::set_current_timer_slack;
use std::num::NonZeroU64;

/// The warning about a port that may not make the rate of its line.
pub const UNPROVEN_RATE: &str = "the driver of the port does not say whether its chip makes this rate: the guide's page on wiring tells which do";

/// Lets the sleeps of this thread and of those that it starts end when they are due. By itself the system lets them take up to 50 us
/// longer, a sixth of a byte at 38400 bit/s, to wake up less often.
pub(crate) fn wake_on_time() {
    // A system that cannot do it wakes as it always has.
    let _unsupported = set_current_timer_slack(NonZeroU64::new(1));
}
