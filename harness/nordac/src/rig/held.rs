//! What slaves held before a fuzz run, and what its conversations may have written: put back behind each of them.

use super::known::Known;
use super::observed::writes;
use super::player::Player;
use super::rate;
use super::session::{OfNordac as _, Session};
use super::talk::TalkError;
use crate::gate::GuardsSlaves as _;
use harness_proto::nordac::guard::Limits;
use std::collections::BTreeSet;

/// Slaves of a session, as they were.
#[derive(Debug)]
pub(crate) struct HeldBefore(Player);

impl HeldBefore {
    /// Reads what the slaves of a session hold.
    ///
    /// # Errors
    /// A slave does not reply, or does not get into the exchange.
    pub(crate) fn read(session: &mut Session) -> Result<Self, TalkError> {
        let slaves = session.slaves().to_vec();
        let rate = session.rig().port().map(rate).unwrap_or_default();
        let gate = session.guarded().slaves();
        let limits = gate.map_or_else(Limits::default, |own| *own.limits());
        let nothing = (Vec::new(), false);
        let mut player = Player::of(slaves.clone(), rate, session.patience(), limits, nothing);
        let mut talk = session.talk();
        let mut all = Vec::new();
        for slave in slaves {
            let mut known = Known::new(slave);
            known.read_all(&mut talk)?;
            all.push(known);
        }
        player.known = Some(all);
        Ok(Self(player))
    }

    /// Whether something may be written that is not put back.
    pub(crate) fn has_written(&self) -> bool {
        !self.0.written.is_empty()
    }

    /// Notes telegrams that are about to be sent. Every address that one of them gives to a slave is asked for its status: returns why they are
    /// not sent, where another station answers there.
    ///
    /// # Errors
    /// The link is in trouble.
    pub(crate) fn sends<'t>(
        &mut self,
        session: &mut Session,
        telegrams: impl Iterator<Item = &'t [u8]>,
    ) -> Result<Option<String>, TalkError> {
        let all: Vec<_> = telegrams.flat_map(writes).collect();
        let moved = all
            .iter()
            .filter_map(|((slave, ..), to)| Some((*slave, (*to)?)));
        let moved: BTreeSet<_> = moved.filter(|(slave, to)| slave != to).collect();
        let mut talk = session.talk();
        for (slave, to) in moved {
            if talk.status(to)? {
                return Ok(Some(format!(
                    "it gives slave {slave} the address {to}, at which a station answers"
                )));
            }
        }
        self.0.written.extend(all.into_iter().map(|own| own.0));
        Ok(None)
    }

    /// Puts back what was written, on slaves in their safe state. Returns what is left to say.
    pub(crate) fn put_back(&mut self, session: &mut Session) -> Vec<String> {
        if !self.has_written() {
            return Vec::new();
        }
        let origin = session.rig().origin.clone();
        let notes = self.0.put_back(session.link(), &origin);
        if notes.is_empty() {
            self.0.written.clear();
        }
        notes
    }
}
