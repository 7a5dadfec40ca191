//! Single requests to slaves, one after another: what looks at slaves, and takes them to their safe state.

use super::MASTER;
use harness_bench::counted::counted;
use harness_bench::link::{Line, Octets, Trouble};
use harness_proto::decode::Decoded;
use harness_proto::nordac::master::{ExchangeError, StartError, Startup};
use harness_proto::nordac::{IDENT, Image, PpoType};
use harness_proto::profibus::dp::{Diagnosis, GlobalControl, Service, SetPrm};
use harness_proto::profibus::master::{Requests, SlaveReply};
use harness_proto::profibus::{Buffer, Pdu, Telegram};
use harness_proto::time::{Instant, Span};
use std::collections::BTreeMap;

/// How often a request is sent that gets no reply. With the same frame count bit it is executed once.
const TRIES: u8 = 3;

/// Why a slave did not do as it was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum TalkError {
    #[error("{0}")]
    Line(Trouble),
    #[error("the adapter gives back what the bench sends: set `echo = true` in [port.1]")]
    Echo,
    #[error(
        "slave {slave} does not have {property} = {says}, as the profile of the rig's file says: the profile is of another slave; qualify this one, or take `profile` out of the file"
    )]
    OtherThanProfile {
        slave: u8,
        property: &'static str,
        says: String,
    },
    #[error("slave {slave} does not reply to {service}")]
    NoReply { slave: u8, service: &'static str },
    #[error("slave {slave} replies to {service} with {found}")]
    Unexpected {
        slave: u8,
        service: &'static str,
        found: String,
    },
    #[error("slave {slave}: {why}")]
    Start {
        slave: u8,
        /// Why not.
        why: StartError,
    },
    #[error("slave {slave}: {why}")]
    Exchange { slave: u8, why: ExchangeError },
    #[error(
        "slave {slave} has a fault (ZSW {zsw:04X}): remove its cause and `drivebench acknowledge {slave}`; with `allow_motion` in [limits] and --allow-motion the bench acknowledges it before each scenario"
    )]
    Fault {
        slave: u8,
        /// What it shows.
        zsw: u16,
    },
}

/// The bench's own master, which asks one slave at a time.
pub(crate) struct Talk<'l> {
    line: Box<dyn Line + 'l>,
    /// How long a reply may take, beside its own time on the line.
    patience: Span,
    requests: BTreeMap<u8, Requests>,
}

impl<'l> Talk<'l> {
    /// A master on a line.
    #[must_use]
    pub(crate) fn new(line: Box<dyn Line + 'l>, patience: Span) -> Self {
        Self {
            line,
            patience,
            requests: BTreeMap::new(),
        }
    }

    /// The time.
    #[must_use]
    pub(crate) fn now(&self) -> Instant {
        self.line.now()
    }

    /// Lets time pass. What comes meanwhile is dropped.
    ///
    /// # Errors
    /// [`TalkError::Line`].
    pub(crate) fn pass(&mut self, span: Span) -> Result<(), TalkError> {
        let end = self.now() + span;
        while self.now() < end {
            self.sound()?;
            let _more = self.line.wait(end);
            while self.line.receive(0).is_some() {}
        }
        self.sound()
    }

    fn sound(&self) -> Result<(), TalkError> {
        let trouble = self.line.trouble();
        trouble.map_or(Ok(()), |trouble| Err(TalkError::Line(trouble.clone())))
    }

    /// Sends octets, and waits until they have left.
    ///
    /// # Errors
    /// [`TalkError::Line`]: the gate denies them, among others.
    pub(crate) fn send(&mut self, octets: &[u8]) -> Result<Instant, TalkError> {
        while self.line.receive(0).is_some() {}
        let end = self.line.send_octets(0, octets);
        self.sound()?;
        Ok(end)
    }

    /// The telegram that comes within the time for a reply; `None` for none, and for a damaged one, after which the line is silent again.
    fn reply(&mut self, end: Instant) -> Result<Option<Telegram>, TalkError> {
        let mut octets = Buffer::new();
        let mut until = end + self.patience;
        let octet = self.line.byte_time();
        let mut spoiled = false;
        loop {
            while let Some((at, heard)) = self.line.receive_octet(0) {
                until = until.max(at + octet * 2 + self.patience);
                spoiled |= heard.error.is_some() || !octets.push(heard.byte);
                if spoiled {
                    continue;
                }
                match Telegram::decode(&octets) {
                    Decoded::Value { value, .. } => return Ok(Some(value)),
                    Decoded::NeedMore => {}
                    Decoded::Bad { .. } => spoiled = true,
                }
            }
            self.sound()?;
            if self.now() >= until {
                return Ok(None);
            }
            let _more = self.line.wait(until);
        }
    }

    /// Sends a request, again where no reply comes.
    fn ask(
        &mut self,
        slave: u8,
        service: Service,
        data: &[u8],
    ) -> Result<Option<SlaveReply>, TalkError> {
        let Ok(pdu) = self.requests(slave).request(service, data) else {
            return Ok(None);
        };
        self.ask_with(slave, pdu)
    }

    fn ask_with(&mut self, slave: u8, pdu: Pdu) -> Result<Option<SlaveReply>, TalkError> {
        let octets = Telegram::Pdu(pdu).encode();
        let mut other = None;
        for _ in 0..TRIES {
            let end = self.send(&octets)?;
            let telegram = self.reply(end)?;
            if telegram == Some(Telegram::Pdu(pdu)) {
                return Err(TalkError::Echo);
            }
            match telegram.and_then(|telegram| self.requests(slave).take(&telegram)) {
                None => {}
                // It may be a late reply to another request, such as that for the FDL status.
                Some(reply) if !fits(&pdu, &reply) => other = Some(reply),
                reply => return Ok(reply),
            }
            // A busy computer hands over a reply late, and then to a later request: what is under way passes first.
            self.pass(self.patience)?;
        }
        Ok(other)
    }

    fn requests(&mut self, slave: u8) -> &mut Requests {
        let fresh = || {
            // Addresses of a rig file that was checked.
            Requests::new(MASTER, slave).or_else(|_| Requests::new(MASTER, 0))
        };
        match self.requests.entry(slave) {
            std::collections::btree_map::Entry::Occupied(requests) => requests.into_mut(),
            std::collections::btree_map::Entry::Vacant(place) => {
                let Ok(fresh) = fresh() else {
                    unreachable!("both addresses are in range")
                };
                place.insert(fresh)
            }
        }
    }

    fn data(&mut self, slave: u8, service: Service) -> Result<Buffer, TalkError> {
        let name = service.name();
        match self.ask(slave, service, &[])? {
            Some(SlaveReply::Data { data, .. }) => Ok(data),
            Some(other) => Err(unexpected(slave, name, &other)),
            None => Err(TalkError::NoReply {
                slave,
                service: name,
            }),
        }
    }

    /// A request, and what the slave replies as text: `None` for nothing.
    ///
    /// # Errors
    /// [`TalkError::Line`].
    pub(crate) fn raw(
        &mut self,
        slave: u8,
        service: Service,
        data: &[u8],
    ) -> Result<String, TalkError> {
        let reply = self.ask(slave, service, data)?;
        Ok(format!("{reply:?}"))
    }

    /// Begins a new sequence of requests, as after the bench was opened.
    pub(crate) fn restart(&mut self, slave: u8) {
        self.requests(slave).restart();
    }

    /// Asks for the FDL status, and says whether the station replies.
    ///
    /// # Errors
    /// [`TalkError::Line`].
    pub(crate) fn status(&mut self, slave: u8) -> Result<bool, TalkError> {
        let Ok(pdu) = self.requests(slave).status() else {
            return Ok(false);
        };
        let end = self.send(&Telegram::Pdu(pdu).encode())?;
        Ok(self.reply(end)?.is_some())
    }

    /// The diagnosis.
    ///
    /// # Errors
    /// [`TalkError`].
    pub(crate) fn diagnose(&mut self, slave: u8) -> Result<Diagnosis, TalkError> {
        let data = self.data(slave, Service::SlaveDiag)?;
        Diagnosis::decode(&data).ok_or_else(|| TalkError::Unexpected {
            slave,
            service: Service::SlaveDiag.name(),
            found: counted(data.len(), "octet"),
        })
    }

    /// The PPO type that its configuration is of; `None` for a configuration of none.
    ///
    /// # Errors
    /// [`TalkError`].
    pub(crate) fn configuration(&mut self, slave: u8) -> Result<Option<PpoType>, TalkError> {
        let data = self.data(slave, Service::GetCfg)?;
        Ok(PpoType::from_cfg(&data))
    }

    /// Takes a slave into the exchange; the watchdog is 10 ms x first x second factor.
    ///
    /// # Errors
    /// [`TalkError`].
    pub(crate) fn start(
        &mut self,
        slave: u8,
        ppo: PpoType,
        watchdog: Option<[u8; 2]>,
    ) -> Result<(), TalkError> {
        let mut startup = Startup::new(ppo, watchdog);
        loop {
            let requests = self.requests(slave);
            let Ok(Some(pdu)) = startup.next(requests) else {
                return Ok(());
            };
            let reply = self.ask_with(slave, pdu)?;
            startup
                .take(reply)
                .map_err(|why| TalkError::Start { slave, why })?;
        }
    }

    /// Lets a slave forget its master at once (EN 2, Set_Prm with Unlock).
    ///
    /// # Errors
    /// [`TalkError`].
    pub(crate) fn unlock(&mut self, slave: u8) -> Result<(), TalkError> {
        let mut parameters = SetPrm::lock(IDENT);
        parameters.status = SetPrm::UNLOCK;
        let name = Service::SetPrm.name();
        let data = parameters.encode().unwrap_or_default();
        match self.ask(slave, Service::SetPrm, &data)? {
            Some(SlaveReply::Confirmed) => Ok(()),
            Some(other) => Err(unexpected(slave, name, &other)),
            None => Err(TalkError::NoReply {
                slave,
                service: name,
            }),
        }
    }

    /// One Data_Exchange.
    ///
    /// # Errors
    /// [`TalkError`]; [`ExchangeError::Left`] where the slave is not in the exchange.
    pub(crate) fn exchange(
        &mut self,
        slave: u8,
        ppo: PpoType,
        outputs: &Image,
    ) -> Result<Image, TalkError> {
        let failed = |why| TalkError::Exchange { slave, why };
        let octets = outputs.encode(ppo);
        match self.ask(slave, Service::DataExchange, &octets)? {
            Some(SlaveReply::Data { data, .. }) => {
                let length = ExchangeError::Length {
                    octets: data.len(),
                    expected: ppo.octets(),
                };
                Image::decode(ppo, &data).ok_or_else(|| failed(length))
            }
            Some(SlaveReply::NotActivated) => Err(failed(ExchangeError::Left)),
            Some(_) => Err(failed(ExchangeError::Unexpected)),
            None => Err(failed(ExchangeError::NoReply)),
        }
    }

    /// A command to one slave, which does not reply.
    ///
    /// # Errors
    /// [`TalkError::Line`].
    pub(crate) fn command(&mut self, slave: u8, command: u8) -> Result<(), TalkError> {
        let command = GlobalControl { command, group: 0 };
        let data = command.encode();
        if let Ok(pdu) = self.requests(slave).request(Service::GlobalControl, &data) {
            let end = self.send(&Telegram::Pdu(pdu).encode())?;
            let rest = end.since(self.now());
            self.pass(rest)?;
        }
        Ok(())
    }
}

/// Whether a reply is one to this request.
fn fits(request: &Pdu, reply: &SlaveReply) -> bool {
    match reply {
        SlaveReply::Confirmed => matches!(
            Service::of(request.dsap()),
            Some(Service::SetPrm | Service::ChkCfg)
        ),
        SlaveReply::NotActivated | SlaveReply::Data { .. } => true,
        SlaveReply::Present | SlaveReply::Other(_) => false,
    }
}

fn unexpected(slave: u8, service: &'static str, reply: &SlaveReply) -> TalkError {
    let found = match reply {
        SlaveReply::Confirmed => "E5".to_owned(),
        SlaveReply::Present => "OK and no data".to_owned(),
        SlaveReply::NotActivated => "RS, no service activated".to_owned(),
        SlaveReply::Data { data, .. } => counted(data.len(), "octet"),
        SlaveReply::Other(control) => format!("FC {:02X}", control.0),
    };
    TalkError::Unexpected {
        slave,
        service,
        found,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// EN 1, EN 2: OK without data answers a request for the FDL status, and E5 only what is confirmed.
    #[test]
    fn a_late_reply_to_another_request_is_none() {
        let mut requests = Requests::new(MASTER, 8).expect("addresses");
        let mut asks = |service| requests.request(service, &[]).expect("a request");
        let [diagnosis, parameters] = [Service::SlaveDiag, Service::SetPrm].map(&mut asks);
        assert!(!fits(&diagnosis, &SlaveReply::Present));
        assert!(!fits(&diagnosis, &SlaveReply::Confirmed));
        assert!(fits(&parameters, &SlaveReply::Confirmed));
        assert!(!fits(&parameters, &SlaveReply::Present));
        for reply in [diagnosis, parameters] {
            assert!(fits(&reply, &SlaveReply::NotActivated));
        }
    }
}
