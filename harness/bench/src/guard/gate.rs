//! What one port may send.

use crate::link::{Line, Moment, PlacedFault};
use crate::medium::{HeardPiece, Out};
use harness_proto::limit::LimitSetting;
use harness_proto::time::Instant;
use std::any::Any;
use std::fmt;

/// Restores what a query has changed; it sends over the guarded line.
pub type Restore = Box<dyn FnOnce(&mut dyn Line)>;

/// Why something is not sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Denied {
    /// What is not sent and why, in a sentence.
    pub why: String,
    /// The settings of the rig's `[limits]` that deny it; empty where no setting permits it.
    pub settings: Vec<LimitSetting>,
}

impl Denied {
    /// A denial that no setting lifts.
    pub const fn never(why: String) -> Self {
        Self {
            why,
            settings: Vec::new(),
        }
    }
}

/// The rules of one port. Decides piece by piece what may be sent, by how a drive would read it.
///
/// Times are those of the guard, which are never set back.
pub trait Gate: Any + Send + fmt::Debug {
    /// Judges pieces in the order in which they will be sent, up to the first denied one. Returns how many are admitted, and why the
    /// next one is not. Admitted pieces count as sent.
    fn admit(&mut self, now: Instant, what: Out<'_>) -> (usize, Option<Denied>);

    /// Whether all of this would be admitted now.
    fn permits(&self, now: Instant, what: Out<'_>) -> bool {
        self.denies(now, what).is_none()
    }

    /// Why not all of this would be admitted now; `None` if it would.
    fn denies(&self, now: Instant, what: Out<'_>) -> Option<Denied>;

    /// Judges octets of a [probe](crate::link::Link::probe). With `copy` they go to a copy of the drives and do not count as sent.
    ///
    /// # Errors
    /// [`Denied`]; none of them must be sent.
    fn probe(&mut self, now: Instant, octets: &[u8], copy: bool) -> Result<(), Denied>;

    /// Judges a fault that is about to be made. `settled`: it happens now, and nothing is under way.
    ///
    /// # Errors
    /// [`Denied`]: what drives would read after it cannot be judged.
    fn fault(&mut self, fault: PlacedFault, moment: Moment, settled: bool) -> Result<(), Denied>;

    /// Takes notice of what stations have sent.
    fn hear(&mut self, heard: &HeardPiece) {
        let _of_no_interest = heard;
    }

    /// Begins a conversation: numbers of pieces count from here.
    fn begin(&mut self);

    /// Whether, by what was sent, no drive is in the middle of a message.
    fn at_rest(&self) -> bool;

    /// Whether drives can be asked something now so that nothing is changed by it; only called [at rest](Self::at_rest).
    fn can_pause(&self) -> bool;

    /// The station that the next piece can mean without naming it, if there is one.
    fn addressed(&self) -> Option<u8> {
        None
    }

    /// What addresses the station again that was [addressed](Self::addressed) before; `None` if it still is.
    fn restore(&self, before: Option<u8>) -> Option<Restore> {
        let _unaddressed = before;
        None
    }

    /// Assumes that the drives have just been made and have heard nothing. This holds for newly made simulated drives and for no
    /// physical bench.
    fn assume_fresh(&mut self);

    /// After a denial: lets permitted pieces pass again, with nothing known of what drives do.
    fn reset_after_denial(&mut self);

    /// Lets any number of pieces pass, for the way to the safe state.
    fn lift_caps(&mut self) {}

    /// Copies what another gate to the same drives knows of them.
    fn know_as(&mut self, other: &dyn Gate);

    /// Until when this must wait; `None` where it need not.
    fn waits_until(&self, now: Instant, what: Out<'_>) -> Option<Instant> {
        let _at_once = (now, what);
        None
    }

    /// What was sent last leaves the line at this time.
    fn ends(&mut self, at: Instant) {
        let _unknown = at;
    }

    /// A drive has shown that it monitors time-outs.
    fn expect_time_outs(&mut self) {}

    /// Whether a line may be filled at all.
    fn may_keep(&self) -> bool {
        false
    }

    /// The octet with which a line is filled now without changing anything; `None` where none may be sent.
    fn filler(&self) -> Option<u8> {
        None
    }
}
