//! What a telegram was to the drive, by its reply.

use super::cells::Event;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{Answer, PpoType, Task};
use harness_proto::profibus::dp::DpState;

/// A telegram, and what came of it.
pub(super) struct TelegramEffect<'a> {
    pub(super) octets: &'a [u8],
    /// It is the last one again.
    pub(super) repeated: bool,
    /// The master of the slave before the telegram.
    pub(super) master: Option<u8>,
    /// The state of the module before.
    pub(super) before: DpState,
    /// The state of the module behind it.
    pub(super) after: DpState,
    pub(super) ppo: PpoType,
    /// The answer to its task.
    pub(super) executed: Option<Answer>,
}

impl TelegramEffect<'_> {
    /// What the telegram was to the drive.
    pub(super) fn events(&self, reply: Option<&[u8]>) -> impl Iterator<Item = Event> {
        let (event, task) = self.event(reply);
        std::iter::once(event).chain(task)
    }

    /// The event of a telegram, and the one of its task.
    fn event(&self, reply: Option<&[u8]>) -> (Event, Option<Event>) {
        let octets = self.octets;
        let data = octets.first() == Some(&0x68);
        let of_master = octets.len() > 6 && self.master == Some(octets[5] & 0x7F);
        let sap = octets.get(7).copied().unwrap_or(0);
        let exchange = data && octets.len() > 6 && (octets[4] | octets[5]) & 0x80 == 0;
        let event = match reply {
            None if of_master && data && octets[4] & 0x80 != 0 && sap == 58 => Event::Control,
            None => Event::Silence,
            Some(_) if self.repeated => Event::Repeated,
            Some([0x10, _, _, 0, ..]) => Event::Status,
            Some([0x10, ..])
                if exchange
                    && of_master
                    && self.before == DpState::DataExch
                    && octets[6] & 0x0C == 0x0C =>
            {
                Event::WrongLength
            }
            Some([0xE5]) if sap == 61 => self.parameters(of_master),
            Some([0xE5]) if self.before == DpState::WaitPrm => Event::Refused,
            Some([0xE5]) if self.after == DpState::DataExch => Event::Configuration,
            Some([0xE5]) => Event::CfgFault,
            Some([0x10, ..]) => Event::Refused,
            Some(_) if exchange => return self.exchange(),
            Some(_) if sap == 60 => Event::Diagnosis,
            Some(_) => Event::Read,
        };
        (event, None)
    }

    fn parameters(&self, of_master: bool) -> Event {
        let data = &self.octets[9..self.octets.len() - 2];
        match data {
            _ if self.master.is_some() && !of_master => Event::Refused,
            [status, _, _, _, _, _, _, ..] if status & 0xC0 != 0x80 => Event::Unlock,
            [_, _, _, _, _, _, _, ..] if self.after == DpState::WaitCfg => Event::Parameters,
            _ => Event::PrmFault,
        }
    }

    /// What the words of an exchange are, and its task.
    fn exchange(&self) -> (Event, Option<Event>) {
        let words = 7 + self.ppo.words_begin();
        let word = u16::from_be_bytes([self.octets[words], self.octets[words + 1]]);
        let clear = |mask: u16| word & mask == 0;
        let event = match word {
            _ if clear(stw::VALID) => Event::Invalid,
            _ if !clear(stw::ACKNOWLEDGE) => Event::Acknowledge,
            _ if clear(stw::NO_OFF2) => Event::Off2,
            _ if clear(stw::NO_OFF3) => Event::Off3,
            _ if clear(stw::ON) => Event::Off1,
            _ if clear(stw::ENABLE) => Event::Disable,
            _ => Event::Enable,
        };
        let changes = Task::of(self.octets[7] >> 4).is_change();
        let task = match self.executed {
            Some(Answer::Error(_)) => Some(Event::TaskError),
            Some(Answer::None) | None => None,
            Some(_) if changes => Some(Event::Changed),
            Some(_) => Some(Event::Requested),
        };
        (event, task)
    }
}
