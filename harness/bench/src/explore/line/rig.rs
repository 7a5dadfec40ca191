//! Conversations with drives behind an adapter, in real time.

use super::{LineBus, LineTalk, Seen};
use crate::explore::{ExploreError, Rehearsal, Target, Tried};
use crate::guard::OVERDUE;
use crate::link::{Line as _, Link as _, Trouble};
use crate::rig::Rig;
use crate::rig::session::{RigDrives, RigSession};
use harness_proto::time::Span;

/// How long a line is listened to behind a conversation at least.
const REST: Span = Span::from_millis(60);

/// The same at most, while a reply is missing.
const LONGEST_REST: Span = Span::from_millis(1_000);

/// What only a simulated drive can do.
pub const ONLY_SIMULATED: &str = "only on simulated drives";

/// A rig in use, of the drives of a bus.
pub(crate) type SessionOf<B> = RigSession<<B as LineRig>::Drives>;

/// A bus whose drives are explored behind adapters.
///
/// What came is judged from nothing but itself, as a capture is: with any value of every open point, and without what a motor or an input
/// decides. Times are not judged, since a busy computer delays what it reads.
pub trait LineRig: LineBus {
    /// The drives of a session.
    type Drives: RigDrives;
    /// What is known while a rig is explored.
    type Kept: std::fmt::Debug;

    /// The drives of a rig as conversations address them; as they were found, where the rig is in use.
    fn stations(rig: &Rig, session: Option<&SessionOf<Self>>) -> Vec<Self::Station>;
    /// The limit that keeps this out of conversations on a rig, or [`ONLY_SIMULATED`]; `None` where they have it, and what it changes is put
    /// back.
    fn lacks(rig: &Rig, allow_motion: bool, spice: Self::Spice) -> Option<&'static str>;
    /// Reads what conversations write.
    ///
    /// # Errors
    /// A drive does not answer.
    fn keep(session: &mut SessionOf<Self>) -> Result<Self::Kept, ExploreError>;
    /// Ends what conversations have left running.
    fn tidy(session: &mut SessionOf<Self>, kept: &mut Self::Kept);
    /// Writes back what the drives held before. Returns what could not be restored, in sentences.
    fn restore(session: &mut SessionOf<Self>, kept: &mut Self::Kept) -> Vec<String>;
    /// Why the gate would not let a conversation pass, of which the model makes this.
    fn denied(
        session: &SessionOf<Self>,
        talk: &LineTalk<Self>,
        seen: &Seen<Self>,
    ) -> Option<String>;
    /// Plays a conversation. Returns why it shows nothing of the drives, if the computer or the adapter was too late.
    fn converse(
        session: &mut SessionOf<Self>,
        kept: &mut Self::Kept,
        talk: &LineTalk<Self>,
    ) -> Option<String>;
    /// What no right drive does, and whether a reply may still come.
    fn judged(session: &SessionOf<Self>, kept: &Self::Kept) -> (Option<Self::Difference>, bool);
}

/// Plays conversations on the drives of a rig. The drives are in their safe state before each of them.
#[derive(Debug)]
pub(crate) struct OnAdapter<'s, B: LineRig> {
    session: &'s mut SessionOf<B>,
    model: B::Setup,
    kept: B::Kept,
}

impl<'s, B: LineRig> OnAdapter<'s, B> {
    /// Drives of a session; `model` are simulated ones with the same addresses.
    ///
    /// # Errors
    /// A drive does not answer.
    pub(crate) fn new(
        session: &'s mut SessionOf<B>,
        model: B::Setup,
    ) -> Result<Self, ExploreError> {
        Ok(Self {
            kept: B::keep(session)?,
            session,
            model,
        })
    }

    /// Leaves the drives as they were before, as far as the rig's file permits that. Returns what could not be restored, in sentences.
    pub(crate) fn restore(&mut self) -> Vec<String> {
        self.session.link().reset_after_denial();
        B::tidy(self.session, &mut self.kept);
        // A command of the last case may still move a motor; the end of the session confirms that none does.
        let _as_far_as_they_do = self.session.make_safe();
        B::restore(self.session, &mut self.kept)
    }

    fn sound(&mut self) -> Result<(), ExploreError> {
        match self.session.link().trouble() {
            Some(trouble) if trouble.is_of_the_bench() => {
                Err(ExploreError::Lost(trouble.to_string()))
            }
            _ => Ok(()),
        }
    }
}

/// Lets time pass on a line.
pub fn pass<D: RigDrives>(session: &mut RigSession<D>, time: Span) {
    let link = session.link();
    let until = link.now() + time;
    while link.now() < until && link.trouble().is_none() {
        link.wait(until);
        while link.receive(0).is_some() {}
    }
}

impl<B: LineRig> Target<LineTalk<B>> for OnAdapter<'_, B> {
    fn rehearse(&mut self, talk: &LineTalk<B>) -> Result<Rehearsal<LineTalk<B>>, ExploreError> {
        let seen = B::play(&self.model, talk);
        Ok(Rehearsal {
            took: seen.took + REST + REST,
            features: B::features(talk, &seen),
            denied: B::denied(self.session, talk, &seen),
            seen,
            of_model: None,
        })
    }

    fn attempt(
        &mut self,
        talk: &LineTalk<B>,
        _: &Rehearsal<LineTalk<B>>,
    ) -> Result<Tried<LineTalk<B>>, ExploreError> {
        let began = self.session.link().now();
        B::tidy(self.session, &mut self.kept);
        // Whether the drives stand is confirmed at the end of the run: a wrong drive may not.
        let _as_far_as_they_do = self.session.make_safe();
        pass(self.session, REST);
        self.session.look_at_interlocks();
        self.sound()?;
        self.session.link().begin();
        let unknown = B::converse(self.session, &mut self.kept, talk);
        let end = self.session.link().now() + LONGEST_REST;
        let (mut found, mut waits) = B::judged(self.session, &self.kept);
        while waits && self.session.link().now() < end && self.session.link().trouble().is_none() {
            pass(self.session, REST);
            (found, waits) = B::judged(self.session, &self.kept);
        }
        self.sound()?;
        let trouble = self.session.link().trouble().map(ToString::to_string);
        let not_played = trouble.or(unknown);
        if self.over().is_none() {
            self.session.link().reset_after_denial();
        }
        Ok(Tried {
            took: self.session.link().now().since(began),
            difference: found.filter(|_| not_played.is_none()),
            before: None,
            not_played,
        })
    }

    fn over(&mut self) -> Option<String> {
        if self.session.link().trouble() == Some(&Trouble::Interrupted) {
            return Some("the run was interrupted".to_owned());
        }
        self.session.overdue().then(|| OVERDUE.to_owned())
    }

    fn end_between_cases(&mut self) {
        self.session.link().set_deadline(None);
    }
}
