//! What slaves held before a fuzz run, and what its conversations may have written: put back after each of them.

use super::known::{KnownInverters, PPO_TYPE};
use super::observed::{changes, moves_to};
use super::player::Player;
use super::rate;
use super::session::{OfNordac as _, Session};
use super::talk::TalkError;
use crate::gate::GuardsSlaves as _;
use harness_proto::nordac::guard::Limits;
use harness_proto::nordac::{Pkw, PpoType};
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
        let limits = gate.map_or_else(Limits::default, |gate| *gate.limits());
        let (patience, all) = (session.patience(), slaves.clone());
        let mut player = Player::of(all, rate, patience, limits, Vec::new(), false);
        let mut talk = session.talk();
        let mut all = Vec::new();
        for slave in slaves {
            let mut known = KnownInverters::new(slave);
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

    /// Notes telegrams that are about to be sent. Returns why they are not sent: after them a slave may have no parameter channel, by which
    /// alone it can be put back, or the address of another station. Every such address is asked for its status.
    ///
    /// # Errors
    /// The link is in trouble.
    pub(crate) fn sends<'t>(
        &mut self,
        session: &mut Session,
        telegrams: impl Iterator<Item = &'t [u8]>,
    ) -> Result<Option<String>, TalkError> {
        let all: Vec<_> = telegrams.flat_map(changes).collect();
        let mut types = all.iter().filter(|change| change.1.number() == PPO_TYPE);
        if let Some((slave, task)) = types.find(|change| !has_channel(change.1)) {
            let value = task.low_word();
            return Ok(Some(format!(
                "with {PPO_TYPE} = {value} slave {slave} may have no parameter channel, by which it is put back"
            )));
        }
        let moved = all
            .iter()
            .filter_map(|(slave, task)| Some((*slave, moves_to(*task)?)));
        let moved: BTreeSet<_> = moved.filter(|(slave, to)| slave != to).collect();
        let mut talk = session.talk();
        for (slave, to) in moved {
            if talk.status(to)? {
                return Ok(Some(format!(
                    "it gives slave {slave} the address {to}, at which a station answers"
                )));
            }
        }
        let written = all
            .iter()
            .map(|(slave, task)| (*slave, task.number(), task.ind));
        self.0.written.extend(written);
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

/// Whether a slave has a parameter channel after a task that changes its PPO type, which is numbered from 0 there (NORDAC 5.5).
fn has_channel(task: Pkw) -> bool {
    let number = u8::try_from(task.low_word().saturating_add(1)).ok();
    let ppo = number.and_then(PpoType::from_number);
    ppo.is_none_or(PpoType::has_pkw)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1622 is numbered from 0: PPO types 1 and 2 have a parameter channel, and what is no type is refused (NORDAC 3.1, 5.5).
    #[test]
    fn types_without_a_parameter_channel_are_not_written() {
        let has = [true, true, false, false, true];
        for (value, has) in (0..).zip(has) {
            assert_eq!(has_channel(Pkw::of(2, PPO_TYPE, 0, value)), has, "{value}");
        }
    }

    /// Another address (1624), and the factory setting, after which it is 126 (NORDAC 4.1.3, 5.5).
    #[test]
    fn addresses_are_read_out_of_tasks() {
        let moved = |number, value| moves_to(Pkw::of(2, number, 0, value));
        assert_eq!(moved(1624, 9), Some(9));
        assert_eq!(moved(1624, 200), None);
        assert_eq!(moved(970, 1), Some(126));
        assert_eq!(moved(1625, 9), None);
    }
}
