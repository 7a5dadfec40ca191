//! What octets may do to a physical inverter, decided octet by octet: the FCS of a denied telegram is kept back, and no station takes the
//! telegram without it.
//!
//! Any octet may be the start of a telegram for some station: a gap in the middle of what the bench sends is enough. So the [`OctetGate`] follows
//! every possible start, and keeps back the FCS of a denied telegram whatever stands before it. Where the manual leaves open how an inverter reads a
//! telegram, the more dangerous reading counts. Zeros do not stop a motor, so they are no way to a safe state: [`stw::SAFE`] is.

mod class;
mod denial;
mod hear;
mod known;
mod limits;

pub use class::{TaskClass, class};
pub use denial::{Act, Fast, FcsDenial, Missing, Supervision};
pub use limits::{Highest, Limits};

use super::pkw::Pkw;
use super::ppo::{Image, PpoType};
use super::words::stw;
use crate::decode::Decoded;
use crate::profibus::dp::{GlobalControl, Service, SetPrm};
use crate::profibus::fdl::{BROADCAST, ED, FcFunction, SD1, SD2, SD3};
use crate::profibus::rate::SYN_BITS;
use crate::profibus::{Buffer, BusRate, Pdu, Telegram};
use crate::time::Instant;
use alloc::vec::Vec;
use hear::Ear;
use known::KnownSlave;

/// A slave of the rig's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuardedSlave {
    /// Its address.
    pub address: u8,
    /// The PPO type that it is set to (1622); `None` where it is not known.
    pub ppo: Option<PpoType>,
}

/// Octets that may become a telegram.
#[derive(Clone, Debug)]
struct Candidate {
    octets: Buffer,
    /// Every station takes the first octet as the start of a telegram: there was a pause, or a telegram ended.
    sure: bool,
}

/// Judges every octet before it is sent.
#[derive(Clone, Debug)]
pub struct OctetGate {
    limits: Limits,
    rate: BusRate,
    slaves: Vec<KnownSlave>,
    candidates: Vec<Candidate>,
    /// When the line is free again.
    free: Instant,
    /// The last octet ended a telegram that began surely.
    ended: bool,
    writes: u32,
    ear: Ear,
}

impl OctetGate {
    /// A gate in front of a segment of this rate with these slaves.
    #[must_use]
    pub fn new(limits: Limits, rate: BusRate, slaves: &[GuardedSlave]) -> Self {
        Self {
            limits,
            rate,
            slaves: slaves.iter().map(|slave| KnownSlave::new(*slave)).collect(),
            candidates: Vec::new(),
            free: Instant::START,
            ended: true,
            writes: 0,
            ear: Ear::default(),
        }
    }

    /// Judges an octet that is about to be sent at `now`; an octet that is admitted counts as sent.
    ///
    /// # Errors
    /// [`FcsDenial`]: with this octet a telegram would be complete but for its end. It must not be sent, and the gate has not changed.
    pub fn admit(&mut self, now: Instant, octet: u8) -> Result<(), FcsDenial> {
        let idle = now >= self.free + self.rate.bit_time() * SYN_BITS;
        let completed: Vec<_> = self
            .candidates
            .iter()
            .filter_map(|candidate| Some((candidate.completed_by(octet)?, candidate.sure)))
            .collect();
        for (pdu, _) in &completed {
            self.judge(pdu)?;
        }
        for (pdu, sure) in &completed {
            self.follow(pdu, *sure);
        }
        self.ear.ask(completed.last().map(|(pdu, _)| pdu));
        self.take(octet, idle || self.ended);
        let begin = if now > self.free { now } else { self.free };
        self.free = begin + self.rate.octet_time();
        Ok(())
    }

    /// Appends an octet to every candidate, and begins a new one with it.
    fn take(&mut self, octet: u8, sure: bool) {
        self.ended = false;
        let ended = &mut self.ended;
        self.candidates.retain_mut(|candidate| {
            let fits = candidate.octets.push(octet);
            match Telegram::decode(&candidate.octets) {
                Decoded::NeedMore => fits,
                Decoded::Value { .. } => {
                    *ended |= candidate.sure;
                    false
                }
                Decoded::Bad { .. } => false,
            }
        });
        if let (SD1 | SD2 | SD3, Some(octets)) = (octet, Buffer::of(&[octet])) {
            self.candidates.push(Candidate { octets, sure });
        }
    }

    /// Takes notice of a parameter that was read: 1205 (of a set, 0 to 3), 1622, 1625.
    pub fn learn(&mut self, address: u8, number: u16, set: u8, raw: u32) {
        for slave in self.slaves.iter_mut().filter(|slave| slave.is(address)) {
            slave.learn(number, set, raw);
        }
    }

    /// Takes notice of an octet that another station sent; `None` for one that came damaged. What replies say of 1205, 1622 and 1625 is
    /// [learnt](Self::learn): answers of the parameter channel to a task that reads, and the configuration that Get_Cfg asks for.
    pub fn hear(&mut self, octet: Option<u8>) {
        if let Some((asked, reply)) = self.ear.hear(octet) {
            for slave in self.slaves.iter_mut().filter(|slave| slave.is(asked.da())) {
                slave.replied(&asked, &reply);
            }
        }
    }

    /// Forgets what is known of the slaves: they were restarted, or telegrams were lost. A motor that may be enabled stays so.
    pub fn doubt(&mut self) {
        for slave in &mut self.slaves {
            slave.doubt();
        }
    }

    /// What the rig's file permits.
    #[must_use]
    pub const fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Copies what another gate to the same slaves knows of them.
    pub fn know_as(&mut self, other: &Self) {
        self.slaves.clone_from(&other.slaves);
    }

    /// The slaves whose motors may be enabled by what was sent.
    pub fn enabled(&self) -> impl Iterator<Item = u8> {
        let enabled = self.slaves.iter().filter(|slave| slave.enabled);
        enabled.map(|slave| slave.address())
    }

    /// The addresses at which a slave of the rig's file may be: its own, and behind it those that tasks have given it (1624, 970, 1602).
    pub fn places(&self, address: u8) -> impl Iterator<Item = u8> {
        let mut slaves = self.slaves.iter();
        let slave = slaves.find(move |slave| slave.listed() == address);
        let others = slave
            .into_iter()
            .flat_map(move |slave| slave.others(address));
        core::iter::once(address).chain(others)
    }

    /// How many tasks that write parameters were sent; a task that is repeated without a change counts once.
    #[must_use]
    pub const fn writes(&self) -> u32 {
        self.writes
    }

    /// Whether no octet of a telegram that is not complete was sent.
    #[must_use]
    pub const fn at_rest(&self) -> bool {
        self.candidates.is_empty()
    }

    fn judge(&self, pdu: &Pdu) -> Result<(), FcsDenial> {
        let station = pdu.da();
        if !pdu.fc().is_request() || only_reads(pdu) {
            return Ok(());
        }
        let service = Service::of(pdu.dsap());
        let denied = |act, missing: Missing| match missing.held(&self.limits) {
            true => Ok(()),
            false => Err(FcsDenial::NotPermitted {
                station,
                act,
                missing,
            }),
        };
        let idle_command = service == Some(Service::GlobalControl)
            && GlobalControl::decode(pdu.data()).is_some_and(|control| control.command == 0);
        if idle_command {
            return Ok(());
        }
        let is_listed = self.slaves.iter().any(|slave| slave.is(station));
        if station == BROADCAST {
            denied(Act::Broadcast, Missing::BusSettings)?;
        } else if !is_listed
            && (service == Some(Service::SetSlaveAdd) || !self.limits.other_stations)
        {
            return Err(FcsDenial::OtherStation { station });
        }
        match service {
            Some(Service::DataExchange) => self.judge_exchange(pdu)?,
            Some(Service::GlobalControl) => {
                let command = pdu.data().first().copied().unwrap_or(u8::MAX);
                if command & (GlobalControl::SYNC | GlobalControl::UNSYNC) != 0 {
                    denied(Act::Sync, Missing::Motion)?;
                }
                if command & GlobalControl::CLEAR_DATA != 0 {
                    denied(Act::Clear, Missing::Motion)?;
                }
            }
            Some(Service::SetPrm) => {
                let status = pdu.data().first().copied().unwrap_or_default();
                if status & SetPrm::UNLOCK != 0 {
                    denied(Act::Unlock, Missing::BusSettings)?;
                }
            }
            Some(Service::ChkCfg) => {}
            Some(Service::SetSlaveAdd) => denied(Act::Service(service), Missing::BusSettings)?,
            _ => denied(Act::Service(service), Missing::Everything)?,
        }
        let mut meant = self.meant(station);
        if !self.limits.unsupervised && meant.any(|slave| slave.enabled && slave.ended_by(pdu)) {
            return Err(FcsDenial::StillEnabled { station });
        }
        Ok(())
    }

    /// The slaves that take a telegram to this address.
    fn meant(&self, station: u8) -> impl Iterator<Item = &KnownSlave> {
        let meant = move |slave: &&KnownSlave| station == BROADCAST || slave.is(station);
        self.slaves.iter().filter(meant)
    }

    /// A Data_Exchange, read in every way in which a slave may read it.
    fn judge_exchange(&self, pdu: &Pdu) -> Result<(), FcsDenial> {
        let station = pdu.da();
        let mut listed = false;
        for slave in self.meant(station) {
            listed = true;
            for ppo in slave.readings(pdu.data().len()) {
                self.judge_image(station, Some(slave), ppo, pdu.data())?;
            }
        }
        if !listed {
            for ppo in PpoType::ALL {
                self.judge_image(station, None, ppo, pdu.data())?;
            }
        }
        Ok(())
    }

    fn judge_image(
        &self,
        station: u8,
        slave: Option<&KnownSlave>,
        ppo: PpoType,
        data: &[u8],
    ) -> Result<(), FcsDenial> {
        let Some(image) = Image::decode(ppo, data) else {
            return Ok(());
        };
        if let Some(act) = moves(&image) {
            if !self.limits.motion {
                return Err(FcsDenial::NotPermitted {
                    station,
                    act,
                    missing: Missing::Motion,
                });
            }
            let unknown = KnownSlave::new(GuardedSlave {
                address: station,
                ppo: None,
            });
            let slave = slave.unwrap_or(&unknown);
            if enables(image.first()) && !self.limits.unsupervised {
                slave
                    .supervised()
                    .map_err(|watch| FcsDenial::Unsupervised { station, watch })?;
            }
            if let Some(fast) = self
                .limits
                .highest
                .and_then(|most| slave.too_fast(most, &image))
            {
                return Err(FcsDenial::Speed { station, fast });
            }
        }
        self.judge_task(station, slave, image.pkw)
    }

    fn judge_task(
        &self,
        station: u8,
        slave: Option<&KnownSlave>,
        pkw: Pkw,
    ) -> Result<(), FcsDenial> {
        let Some(class) = class::of_task(pkw) else {
            return Ok(());
        };
        let act = Act::Task {
            ak: pkw.ak(),
            number: pkw.number(),
        };
        if class == TaskClass::Never {
            return Err(FcsDenial::Never { station, act });
        }
        let mut need = class::need(class).iter().copied();
        if let Some(missing) = need.find(|missing| !missing.held(&self.limits)) {
            return Err(FcsDenial::NotPermitted {
                station,
                act,
                missing,
            });
        }
        if let (1205, Some(Highest::Frequency(most))) = (pkw.number(), self.limits.highest)
            && pkw.low_word() > most
        {
            let fast = Fast::Maximum;
            return Err(FcsDenial::Speed { station, fast });
        }
        let again = slave.is_some_and(|slave| slave.task == pkw);
        match self.limits.most_writes {
            Some(most) if self.writes >= most && !again => Err(FcsDenial::Wear { most }),
            _ => Ok(()),
        }
    }

    fn follow(&mut self, pdu: &Pdu, sure: bool) {
        let station = pdu.da();
        if !pdu.fc().is_request() || only_reads(pdu) {
            return;
        }
        for slave in &mut self.slaves {
            if station == BROADCAST || slave.is(station) {
                self.writes += slave.follow(pdu, sure);
            }
        }
    }
}

impl Candidate {
    /// The telegram that this octet completes but for its end.
    fn completed_by(&self, octet: u8) -> Option<Pdu> {
        let length = match *self.octets {
            [SD1, ..] => 6,
            [SD3, ..] => 14,
            [SD2, length, ..] => usize::from(length) + 6,
            _ => return None,
        };
        if self.octets.len() + 2 != length {
            return None;
        }
        let mut whole = self.octets;
        let _fits = whole.extend(&[octet, ED]);
        Telegram::decode(&whole).value()?.pdu().copied()
    }
}

/// Whether a request changes nothing in any slave.
fn only_reads(pdu: &Pdu) -> bool {
    let reads = matches!(
        Service::of(pdu.dsap()),
        Some(Service::RdInp | Service::RdOutp | Service::GetCfg | Service::SlaveDiag)
    );
    let asks = matches!(
        pdu.fc().function(),
        Some(FcFunction::FdlStatus | FcFunction::Ident | FcFunction::LsapStatus)
    );
    reads || asks
}

/// Whether a control word can switch the output on.
const fn enables(word: u16) -> bool {
    let needed = stw::VALID | stw::OPERATE;
    word & needed == needed
}

/// What process words do to a motor, if they may do anything but stop it. Words of which bit 10 says that they are invalid count for their setpoints
/// (`pzd-invalid`), and terminals may have enabled a motor that takes only its setpoint from the bus (interface 1 or 4).
fn moves(image: &Image) -> Option<Act> {
    let stw = image.first();
    let valid = stw & stw::VALID != 0;
    if enables(stw) {
        Some(Act::Enable { stw })
    } else if valid && stw >> stw::SET_SHIFT != 0 {
        Some(Act::Set { stw })
    } else if valid && stw & stw::ACKNOWLEDGE != 0 {
        Some(Act::Acknowledge { stw })
    } else if image.words[1..4].iter().any(|word| *word != 0) {
        Some(Act::Setpoint)
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
