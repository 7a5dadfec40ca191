//! What the gate knows of a slave, from what was sent and what was read.

use super::denial::{Fast, Supervision};
use super::limits::Highest;
use super::{GuardedSlave, enables};
use crate::nordac::pkw::{Answer, Pkw, Task};
use crate::nordac::ppo::{Image, PpoType};
use crate::nordac::words::{FULL, set_of, stw};
use crate::profibus::Pdu;
use crate::profibus::dp::{GlobalControl, Service, SetPrm};
use crate::profibus::fdl::FcStatus;
use alloc::vec::Vec;

/// What the gate knows of a slave.
#[derive(Clone, Debug)]
pub(super) struct KnownSlave {
    /// Where it may be: after a write to 1624 at the old address and at the new one.
    addresses: Vec<u8>,
    /// Its address in the rig's file.
    listed: u8,
    ppo: Option<PpoType>,
    /// A word that enables the motor was sent, and none after it that stops it.
    pub(super) enabled: bool,
    /// Sync is in force: words wait, those that stop a motor too.
    waits: bool,
    /// The last Set_Prm switched the watchdog on.
    watchdog: bool,
    /// 1625 was read and is not 0.
    timeout: bool,
    /// 1205 of each set in 0.1 Hz; the larger one where it may have changed.
    maximum: [Option<u16>; 4],
    /// The last task of the parameter channel.
    pub(super) task: Pkw,
    /// The number that was written last, until the channel answers for another one: a former answer may still show the value before.
    stale: Option<u16>,
    /// It replied that it is not in the exchange: no telegram ends that.
    left: bool,
}

impl KnownSlave {
    pub(super) fn new(slave: GuardedSlave) -> Self {
        Self {
            addresses: [slave.address].to_vec(),
            listed: slave.address,
            ppo: slave.ppo,
            enabled: false,
            waits: false,
            watchdog: false,
            timeout: false,
            maximum: [None; 4],
            task: Pkw::default(),
            stale: None,
            left: false,
        }
    }

    pub(super) fn is(&self, address: u8) -> bool {
        self.addresses.contains(&address)
    }

    /// Its address in the rig's file.
    pub(super) const fn listed(&self) -> u8 {
        self.listed
    }

    /// Where it may be but at this address, the last one first.
    pub(super) fn others(&self, address: u8) -> impl Iterator<Item = u8> {
        let all = self.addresses.iter().rev().copied();
        all.filter(move |other| *other != address)
    }

    /// Where it was last.
    pub(super) fn address(&self) -> u8 {
        self.addresses.last().copied().unwrap_or_default()
    }

    /// The layouts in which it may read this number of octets.
    pub(super) fn readings(&self, octets: usize) -> impl Iterator<Item = PpoType> {
        let known = self.ppo.filter(|ppo| ppo.octets() == octets);
        let fits =
            move |ppo: &PpoType| ppo.octets() == octets && known.is_none_or(|known| known == *ppo);
        PpoType::ALL.into_iter().filter(fits)
    }

    pub(super) fn learn(&mut self, number: u16, set: u8, raw: u32) {
        let word = (raw & 0xFFFF) as u16;
        match number {
            1205 => {
                if let Some(maximum) = self.maximum.get_mut(usize::from(set)) {
                    *maximum = Some(word);
                }
            }
            1622 => self.ppo = u8::try_from(word).ok().and_then(PpoType::from_raw),
            1625 => self.timeout = word != 0,
            _ => {}
        }
    }

    pub(super) fn doubt(&mut self) {
        self.watchdog = false;
        self.timeout = false;
        self.maximum = [None; 4];
        self.task = Pkw::default();
    }

    /// What stops the motor if the bench fails.
    pub(super) fn supervised(&self) -> Result<(), Supervision> {
        match (self.timeout, self.watchdog) {
            (false, _) => Err(Supervision::Timeout),
            (true, false) => Err(Supervision::Watchdog),
            (true, true) => Ok(()),
        }
    }

    /// Why these words may turn the motor too fast. A setpoint above 100 % counts as it is (`over-100`).
    pub(super) fn too_fast(&self, highest: Highest, image: &Image) -> Option<Fast> {
        let set = set_of(image.first());
        let setpoint = image.main().cast_signed().unsigned_abs();
        let most = match highest {
            Highest::Setpoint(most) => most,
            Highest::Frequency(most) => match self.maximum[usize::from(set)] {
                None => return Some(Fast::MaximumUnknown { set }),
                Some(maximum) if maximum <= most => return None,
                // Below 4000h, since `most` is below the maximum.
                Some(maximum) => (i64::from(most) * i64::from(FULL) / i64::from(maximum)) as u16,
            },
        };
        if setpoint > most {
            return Some(Fast::Above { most });
        }
        (image.third() != 0 || image.fourth() != 0).then_some(Fast::Second)
    }

    /// Whether a telegram ends the exchange, or may end it.
    pub(super) fn ended_by(&self, pdu: &Pdu) -> bool {
        if self.left {
            return false;
        }
        match Service::of(pdu.dsap()) {
            Some(Service::SetPrm) => true,
            Some(Service::ChkCfg) => self.ppo.is_none_or(|ppo| ppo.cfg() != pdu.data()),
            Some(Service::DataExchange) => {
                let octets = pdu.data().len();
                self.ppo.map_or_else(
                    || PpoType::ALL.iter().all(|ppo| ppo.octets() != octets),
                    |ppo| ppo.octets() != octets,
                )
            }
            _ => false,
        }
    }

    /// Keeps the state that an admitted telegram leads to, and returns how many parameters it writes. `sure`: every station reads it so.
    pub(super) fn follow(&mut self, pdu: &Pdu, sure: bool) -> u32 {
        match Service::of(pdu.dsap()) {
            Some(Service::SetPrm) => {
                let prm = SetPrm::decode(pdu.data());
                let on = prm
                    .filter(|prm| prm.has(SetPrm::LOCK) && !prm.has(SetPrm::UNLOCK))
                    .and_then(|prm| prm.watchdog_tens_of_ms());
                self.watchdog = on.is_some_and(|time| time > 0) && (sure || self.watchdog);
                self.task = Pkw::default();
                0
            }
            Some(Service::ChkCfg) => {
                self.left = false;
                // A slave may take a configuration that its PPO type is not (`cfg-follows-ppo-type`).
                self.ppo = self.ppo.filter(|ppo| ppo.cfg() == pdu.data());
                0
            }
            Some(Service::GlobalControl) => {
                let command = pdu.data().first().copied().unwrap_or_default();
                if command & GlobalControl::UNSYNC != 0 && sure {
                    self.waits = false;
                } else if command & GlobalControl::SYNC != 0 {
                    self.waits = true;
                }
                0
            }
            Some(Service::DataExchange) => {
                let readings: Vec<_> = self.readings(pdu.data().len()).collect();
                let images = readings
                    .iter()
                    .filter_map(|ppo| Image::decode(*ppo, pdu.data()));
                let images: Vec<_> = images.collect();
                if images.iter().any(|image| enables(image.first())) {
                    self.enabled = true;
                } else if sure && !self.waits && !images.is_empty() {
                    let valid = |image: &Image| image.first() & stw::VALID != 0;
                    self.enabled &= !images.iter().all(valid);
                }
                images.iter().map(|image| self.tasked(image.pkw)).sum()
            }
            _ => 0,
        }
    }

    /// Takes notice of a task; 1 if it writes and is new.
    fn tasked(&mut self, pkw: Pkw) -> u32 {
        if pkw == self.task {
            return 0;
        }
        self.task = pkw;
        if super::class::of_task(pkw).is_none() {
            return 0;
        }
        self.written(pkw);
        self.stale = Some(pkw.number());
        1
    }

    /// Takes notice of a reply to a request.
    pub(super) fn replied(&mut self, asked: &Pdu, reply: &Pdu) {
        let service = Service::of(asked.dsap());
        if reply.fc().status() == Some(FcStatus::Rs) {
            self.left |= service == Some(Service::DataExchange);
            return;
        }
        match service {
            Some(Service::GetCfg) if reply.ssap() == asked.dsap() => {
                if let Some(ppo) = PpoType::from_cfg(reply.data()) {
                    self.ppo = Some(ppo);
                }
            }
            Some(Service::DataExchange) => {
                self.left = false;
                let image = self.ppo.and_then(|ppo| Image::decode(ppo, reply.data()));
                if let Some(image) = image {
                    self.answered(image.pkw);
                }
            }
            _ => {}
        }
    }

    /// Takes notice of what the parameter channel shows.
    fn answered(&mut self, shown: Pkw) {
        let none = shown.ak() == 0;
        if none || self.stale.is_some_and(|number| number != shown.number()) {
            self.stale = None;
        }
        let task = self.task;
        let reads = matches!(task.task(), Task::Request | Task::RequestArray);
        let same = (task.number(), task.ind) == (shown.number(), shown.ind);
        let value = matches!(shown.answer(), Some(Answer::Word(_) | Answer::ArrayWord(_)));
        if reads && same && value && self.stale.is_none() {
            self.learn(shown.number(), (shown.ind >> 8 & 3) as u8, shown.pwe);
        }
    }

    /// What a write leaves behind; it may also have been refused.
    fn written(&mut self, pkw: Pkw) {
        let word = pkw.low_word();
        let set = usize::from(pkw.ind >> 8 & 3);
        match pkw.number() {
            1205 => self.maximum[set] = self.maximum[set].map(|old| old.max(word)),
            1625 => self.timeout = self.timeout && word != 0,
            1624 => self.moved_to((word & 0xFF) as u8),
            1619 | 1622 => self.ppo = None,
            970 | 1602 => {
                self.moved_to(super::super::DEFAULT_ADDRESS);
                self.ppo = None;
                self.timeout = false;
                self.maximum = [None; 4];
            }
            _ => {}
        }
    }

    fn moved_to(&mut self, address: u8) {
        self.addresses.retain(|known| *known != address);
        self.addresses.push(address);
    }
}
