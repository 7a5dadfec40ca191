//! One inverter as its master sees it: start, exchange, tasks of the parameter channel. It sends nothing and waits for nothing.
//!
//! A caller asks [`Startup`] or [`Exchange`] for a request, sends it, and hands over the reply.

use super::IDENT;
use super::parameter::ParameterRef;
use super::pkw::{Answer, Pkw, Task};
use super::ppo::{Image, PpoType};
use crate::counted::counted;
use crate::profibus::Pdu;
use crate::profibus::dp::{Diagnosis, Service, SetPrm};
use crate::profibus::fdl::BadTelegram;
use crate::profibus::master::{Requests, SlaveReply};
use core::fmt;

/// How often a start asks for the diagnosis until the slave is ready.
const READY_TRIES: u8 = 20;

/// The way of a slave into the exchange: Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Startup {
    ppo: PpoType,
    /// The two factors of the watchdog; `None` leaves it off.
    watchdog: Option<[u8; 2]>,
    step: StartStep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StartStep {
    Find,
    Parametrise,
    Configure,
    Ready(u8),
    Done,
}

impl Startup {
    /// A start with this PPO type; the watchdog is 10 ms x first x second factor.
    #[must_use]
    pub const fn new(ppo: PpoType, watchdog: Option<[u8; 2]>) -> Self {
        Self {
            ppo,
            watchdog,
            step: StartStep::Find,
        }
    }

    /// The next request; `None` when the slave exchanges data.
    ///
    /// # Errors
    /// [`BadTelegram`] never for the data of a start.
    pub fn next(&self, requests: &mut Requests) -> Result<Option<Pdu>, BadTelegram> {
        let pdu = match self.step {
            StartStep::Find => {
                requests.restart();
                requests.request(Service::SlaveDiag, &[])?
            }
            StartStep::Parametrise => {
                let mut prm = SetPrm::lock(IDENT);
                if let Some(factors) = self.watchdog {
                    prm.status |= SetPrm::WATCHDOG;
                    prm.watchdog = factors;
                }
                let data = prm.encode().unwrap_or_default();
                requests.request(Service::SetPrm, &data)?
            }
            StartStep::Configure => requests.request(Service::ChkCfg, self.ppo.cfg())?,
            StartStep::Ready(_) => requests.request(Service::SlaveDiag, &[])?,
            StartStep::Done => return Ok(None),
        };
        Ok(Some(pdu))
    }

    /// Takes the reply to the last request.
    ///
    /// # Errors
    /// [`StartError`]: the slave does not get into the exchange.
    pub fn take(&mut self, reply: Option<SlaveReply>) -> Result<(), StartError> {
        let service = match self.step {
            StartStep::Find | StartStep::Ready(_) => Service::SlaveDiag,
            StartStep::Parametrise => Service::SetPrm,
            StartStep::Configure => Service::ChkCfg,
            StartStep::Done => return Ok(()),
        };
        let reply = reply.ok_or(StartError::NoReply { service })?;
        self.step = match (self.step, reply) {
            (StartStep::Find, SlaveReply::Data { data, .. }) => {
                let found = Diagnosis::decode(&data).ok_or(StartError::Unexpected { service })?;
                if found.ident != IDENT {
                    return Err(StartError::OtherDevice { ident: found.ident });
                }
                StartStep::Parametrise
            }
            (StartStep::Parametrise, SlaveReply::Confirmed) => StartStep::Configure,
            (StartStep::Configure, SlaveReply::Confirmed) => StartStep::Ready(0),
            (StartStep::Ready(tries), SlaveReply::Data { data, .. }) => {
                let found = Diagnosis::decode(&data).ok_or(StartError::Unexpected { service })?;
                let refused = found.has(Diagnosis::PRM_FAULT)
                    || found.has(Diagnosis::CFG_FAULT)
                    || found.has_mode(Diagnosis::PRM_REQ);
                if refused || found.has(Diagnosis::NOT_READY) && tries >= READY_TRIES {
                    return Err(StartError::Refused(found));
                }
                match found.has(Diagnosis::NOT_READY) {
                    true => StartStep::Ready(tries + 1),
                    false => StartStep::Done,
                }
            }
            (_, SlaveReply::NotActivated) => return Err(StartError::NotActivated { service }),
            _ => return Err(StartError::Unexpected { service }),
        };
        Ok(())
    }
}

/// Why a slave does not get into the exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartError {
    /// No reply.
    NoReply {
        /// The service that was asked for.
        service: Service,
    },
    /// The slave replies RS.
    NotActivated {
        /// The service that was asked for.
        service: Service,
    },
    /// A reply that does not belong to the service.
    Unexpected {
        /// The service that was asked for.
        service: Service,
    },
    /// The ident number of another device.
    OtherDevice {
        /// Its ident number.
        ident: u16,
    },
    /// The slave refuses the parameters or the configuration, or does not get ready.
    Refused(Diagnosis),
}

impl fmt::Display for StartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReply { service } => write!(f, "no reply to {}", service.name()),
            Self::NotActivated { service } => {
                write!(
                    f,
                    "the slave replies to {} that the service is not activated",
                    service.name()
                )
            }
            Self::Unexpected { service } => write!(
                f,
                "the reply to {} is not one of this service",
                service.name()
            ),
            Self::OtherDevice { ident } => {
                write!(
                    f,
                    "the ident number of the slave is {ident:04X}, and that of a NORDAC vector {IDENT:04X}"
                )
            }
            Self::Refused(diagnosis) => {
                f.write_str("the slave refuses parameters or configuration; its diagnosis says")?;
                for (index, name) in diagnosis.names().enumerate() {
                    write!(f, "{} {name}", if index == 0 { "" } else { "," })?;
                }
                f.write_str(": compare the PPO type with 1622")
            }
        }
    }
}

impl core::error::Error for StartError {}

/// An inverter in the exchange: the outputs in force, the last inputs, and the task under way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exchange {
    ppo: PpoType,
    /// What goes out; the parameter channel is under the control of [`task`](Self::task).
    pub outputs: Image,
    inputs: Option<Image>,
    channel: Channel,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    /// No task, or one that is answered.
    Free,
    /// No task goes out until the answer to a former one is gone: it could be taken for the answer to this one.
    Clearing { then: Pkw, left: u8 },
    /// The task goes out, until its answer comes.
    Waiting { left: u8 },
}

/// How many exchanges a task may take before it is given up. The manual says 2; physical inverters may need more (`pkw-latency`).
const MOST_EXCHANGES: u8 = 40;

/// What an exchange brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchanged {
    /// The inputs.
    pub inputs: Image,
    /// A diagnosis waits.
    pub diagnosis: bool,
    /// The answer to the task, in the exchange that brings it.
    pub answer: Option<Answer>,
}

/// Why an exchange failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExchangeError {
    /// No reply.
    NoReply,
    /// The slave has left the exchange: RS.
    Left,
    /// The reply has another length than the PPO type.
    Length {
        /// The octets that came.
        octets: usize,
        /// The octets of the PPO type.
        expected: usize,
    },
    /// A reply that is none to a Data_Exchange.
    Unexpected,
    /// The task was not answered.
    NoAnswer {
        /// The task.
        task: Pkw,
    },
}

impl fmt::Display for ExchangeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReply => f.write_str("no reply to Data_Exchange"),
            Self::Left => f.write_str(
                "the slave replies that Data_Exchange is not activated: it has left the exchange, so start it again",
            ),
            Self::Length { octets, expected } => write!(
                f,
                "the reply to Data_Exchange has {}, and the PPO type has {expected}",
                counted(*octets, "octet")
            ),
            Self::Unexpected => f.write_str("the reply is not one to Data_Exchange"),
            Self::NoAnswer { task } => write!(
                f,
                "the parameter channel has not answered the task {task} within {MOST_EXCHANGES} exchanges"
            ),
        }
    }
}

impl core::error::Error for ExchangeError {}

impl Exchange {
    /// A slave that has just begun to exchange: all outputs are 0.
    #[must_use]
    pub fn new(ppo: PpoType) -> Self {
        Self {
            ppo,
            outputs: Image::default(),
            inputs: None,
            channel: Channel::Free,
        }
    }

    /// The layout.
    #[must_use]
    pub const fn ppo(&self) -> PpoType {
        self.ppo
    }

    /// The last inputs.
    #[must_use]
    pub const fn inputs(&self) -> Option<&Image> {
        self.inputs.as_ref()
    }

    /// Begins a task of the parameter channel; its answer comes with a later exchange.
    pub fn task(&mut self, task: Pkw) {
        let former = self.inputs.map(|inputs| inputs.pkw).unwrap_or_default();
        let under_way = self.is_waiting() && self.outputs.pkw.number() == task.number();
        let alike = under_way || former.ak() != 0 && former.number() == task.number();
        let none = task.task() == Task::None;
        self.channel = match (none, alike) {
            (true, _) => Channel::Free,
            (false, true) => Channel::Clearing {
                then: task,
                left: MOST_EXCHANGES,
            },
            (false, false) => Channel::Waiting {
                left: MOST_EXCHANGES,
            },
        };
        self.outputs.pkw = if alike { Pkw::default() } else { task };
    }

    /// The task that reads a parameter.
    pub fn read(&mut self, selected: &ParameterRef) {
        let ak = Task::read(selected.parameter).ak();
        self.task(Pkw::of(ak, selected.parameter.number, selected.ind(), 0));
    }

    /// The task that writes a parameter: 16 or 32 bits as the parameter has them.
    pub fn write(&mut self, selected: &ParameterRef, raw: u32) {
        let ak = Task::change(selected.parameter).ak();
        self.task(Pkw::of(ak, selected.parameter.number, selected.ind(), raw));
    }

    /// Whether a task waits for its answer.
    #[must_use]
    pub const fn is_waiting(&self) -> bool {
        !matches!(self.channel, Channel::Free)
    }

    /// The next Data_Exchange.
    ///
    /// # Errors
    /// [`BadTelegram`] never: the data fit a telegram.
    pub fn exchange(&self, requests: &mut Requests) -> Result<Pdu, BadTelegram> {
        requests.request(Service::DataExchange, &self.outputs.encode(self.ppo))
    }

    /// Takes the reply to the last Data_Exchange.
    ///
    /// # Errors
    /// [`ExchangeError`]; after [`NoAnswer`](ExchangeError::NoAnswer) the channel is free again.
    pub fn take(&mut self, reply: Option<SlaveReply>) -> Result<Exchanged, ExchangeError> {
        let (diagnosis, data) = match reply.ok_or(ExchangeError::NoReply)? {
            SlaveReply::Data { diagnosis, data } => (diagnosis, data),
            SlaveReply::NotActivated => return Err(ExchangeError::Left),
            _ => return Err(ExchangeError::Unexpected),
        };
        let inputs = Image::decode(self.ppo, &data).ok_or(ExchangeError::Length {
            octets: data.len(),
            expected: self.ppo.octets(),
        })?;
        self.inputs = Some(inputs);
        Ok(Exchanged {
            inputs,
            diagnosis,
            answer: self.answered(inputs.pkw)?,
        })
    }

    /// Moves the channel on by one exchange.
    fn answered(&mut self, answer: Pkw) -> Result<Option<Answer>, ExchangeError> {
        let task = self.outputs.pkw;
        match self.channel {
            Channel::Free => {}
            Channel::Clearing { then, .. } if answer.ak() == 0 => {
                self.outputs.pkw = then;
                self.channel = Channel::Waiting {
                    left: MOST_EXCHANGES,
                };
            }
            Channel::Waiting { .. } if answer.ak() != 0 && answer.number() == task.number() => {
                self.channel = Channel::Free;
                return Ok(answer.answer());
            }
            Channel::Clearing { left: 0, then } => return Err(self.give_up(then)),
            Channel::Waiting { left: 0 } => return Err(self.give_up(task)),
            Channel::Clearing { then, left } => {
                let left = left - 1;
                self.channel = Channel::Clearing { then, left };
            }
            Channel::Waiting { left } => self.channel = Channel::Waiting { left: left - 1 },
        }
        Ok(None)
    }

    fn give_up(&mut self, task: Pkw) -> ExchangeError {
        self.channel = Channel::Free;
        ExchangeError::NoAnswer { task }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profibus::{Buffer, Telegram};
    use std::string::ToString;
    use std::vec::Vec;

    fn data(octets: &[u8]) -> Option<SlaveReply> {
        let data = Buffer::of(octets).unwrap();
        let diagnosis = false;
        Some(SlaveReply::Data { diagnosis, data })
    }

    fn diagnosis(status: [u8; 2]) -> Option<SlaveReply> {
        data(&[status[0], status[1], 0, 0xFF, 0x75, 0x31])
    }

    /// The telegrams of a start are those of the standard (EN 2), and their replies lead on.
    #[test]
    fn a_start() {
        let mut requests = Requests::new(2, 8).unwrap();
        let mut startup = Startup::new(PpoType::One, None);
        let mut sent = Vec::new();
        let replies = [
            diagnosis([0x02, 0x05]),
            Some(SlaveReply::Confirmed),
            Some(SlaveReply::Confirmed),
            diagnosis([0x02, 0x04]),
            diagnosis([0x00, 0x04]),
        ];
        for reply in replies {
            let pdu = startup.next(&mut requests).unwrap().unwrap();
            sent.push(Telegram::Pdu(pdu).encode().to_string());
            startup.take(reply).unwrap();
        }
        assert_eq!(startup.next(&mut requests), Ok(None));
        assert_eq!(sent[0], "68 05 05 68 88 82 6C 3C 3E F0 16");
        assert_eq!(
            sent[1],
            "68 0C 0C 68 88 82 5C 3D 3E 80 00 00 0B 75 31 00 12 16"
        );
        assert_eq!(sent[2], "68 07 07 68 88 82 7C 3E 3E F3 F1 E6 16");
        assert_eq!(sent[4], "68 05 05 68 88 82 7C 3C 3E 00 16");
    }

    /// Each way in which a start fails.
    #[test]
    fn a_start_that_fails() {
        let failed = |replies: &[Option<SlaveReply>]| {
            let mut startup = Startup::new(PpoType::One, Some([1, 30]));
            let results: Vec<_> = replies.iter().map(|reply| startup.take(*reply)).collect();
            results
                .into_iter()
                .find_map(Result::err)
                .unwrap()
                .to_string()
        };
        let found = diagnosis([0x02, 0x05]);
        let ok = Some(SlaveReply::Confirmed);
        let refused = Some(SlaveReply::NotActivated);
        let other = data(&[0x02, 0x05, 0, 0xFF, 0x12, 0x34]);
        for (replies, expected) in [
            (&[None][..], "no reply to Slave_Diag"),
            (
                &[other],
                "the ident number of the slave is 1234, and that of a NORDAC vector 7531",
            ),
            (&[ok], "the reply to Slave_Diag is not one of this service"),
            (
                &[data(&[0; 3])],
                "the reply to Slave_Diag is not one of this service",
            ),
            (
                &[found, refused],
                "the slave replies to Set_Prm that the service is not activated",
            ),
            (
                &[found, ok, ok, diagnosis([0x06, 0x05])],
                "the slave refuses parameters or configuration; its diagnosis says Station_Not_Ready, Cfg_Fault, Prm_Req: compare the PPO type with 1622",
            ),
        ] {
            assert_eq!(failed(replies), expected);
        }
    }

    /// A reply counts if it comes from the slave, for the master, with the SAPs of the request.
    #[test]
    fn replies() {
        let decode = |text: &str| {
            let octets: Vec<u8> = text
                .split(' ')
                .map(|octet| u8::from_str_radix(octet, 16).unwrap())
                .collect();
            Telegram::decode(&octets).value().unwrap()
        };
        let mut requests = Requests::new(2, 8).unwrap();
        let rs = decode("10 02 08 03 0D 16");
        assert_eq!(requests.take(&rs), None, "nothing was asked");
        requests.request(Service::SlaveDiag, &[]).unwrap();
        assert_eq!(requests.take(&rs), Some(SlaveReply::NotActivated));
        let answer = decode("68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 75 31 38 16");
        assert!(
            matches!(requests.take(&answer), Some(SlaveReply::Data { data, .. }) if data.len() == 6)
        );
        for other in [
            "10 02 09 03 0E 16",
            "10 03 08 03 0E 16",
            "10 02 08 43 4D 16",
            "DC 02 08",
        ] {
            assert_eq!(requests.take(&decode(other)), None, "{other}");
        }
        // The answer to another service: its SSAP is another one.
        requests.request(Service::GetCfg, &[]).unwrap();
        assert_eq!(requests.take(&answer), None);
        let status = requests.status().unwrap();
        assert_eq!(
            Telegram::Pdu(status).encode().to_string(),
            "10 08 02 49 53 16"
        );
        assert_eq!(
            requests.take(&decode("10 02 08 00 0A 16")),
            Some(SlaveReply::Present)
        );
        assert_eq!(requests.repeat(), Some(status));
        assert!(Requests::new(127, 8).is_err() && Requests::new(2, 127).is_err());
    }

    /// An inverter whose answers come `latency` exchanges after their tasks.
    fn ask(station: &mut Exchange, line: &mut Vec<Pkw>, latency: usize) -> (usize, Answer) {
        let mut requests = Requests::new(2, 8).unwrap();
        for exchanges in 1..100 {
            let sent = station.exchange(&mut requests).unwrap();
            let outputs = Image::decode(station.ppo(), sent.data()).unwrap();
            line.push(outputs.pkw);
            let due = line.len().checked_sub(latency + 1).map(|place| line[place]);
            let pkw = due.map_or(Pkw::default(), |task| {
                let answer = match task.task() {
                    Task::None => Answer::None,
                    Task::Request => Answer::Word(100),
                    _ => Answer::Word(task.low_word()),
                };
                answer.to(task)
            });
            let inputs = Image {
                pkw,
                ..Image::default()
            };
            let done = station.take(data(&inputs.encode(station.ppo()))).unwrap();
            if let Some(answer) = done.answer {
                return (exchanges, answer);
            }
        }
        panic!("no answer");
    }

    /// NORDAC 3.4.1: the answer comes with the third exchange. A former answer with the same number is not taken for it, however late answers are.
    #[test]
    fn tasks_of_the_parameter_channel() {
        let accel = ParameterRef::parse("1202").unwrap();
        let maximum = ParameterRef::parse("1205.3").unwrap();
        for latency in 1..=10 {
            let mut station = Exchange::new(PpoType::One);
            let mut line = Vec::new();
            station.read(&accel);
            assert_eq!(
                ask(&mut station, &mut line, latency),
                (latency + 1, Answer::Word(100))
            );
            station.write(&maximum, 500);
            assert_eq!(station.outputs.pkw, Pkw::of(2, 1205, 0x0200, 500));
            assert_eq!(
                ask(&mut station, &mut line, latency),
                (latency + 1, Answer::Word(500))
            );
            station.write(&maximum, 600);
            assert_eq!(ask(&mut station, &mut line, latency).1, Answer::Word(600));
            station.read(&accel);
            station.read(&accel);
            assert_eq!(ask(&mut station, &mut line, latency).1, Answer::Word(100));
            assert!(!station.is_waiting());
        }
    }

    /// Each way in which an exchange fails.
    #[test]
    fn an_exchange_that_fails() {
        let mut station = Exchange::new(PpoType::Three);
        assert_eq!(station.take(None), Err(ExchangeError::NoReply));
        assert_eq!(
            station.take(Some(SlaveReply::NotActivated)),
            Err(ExchangeError::Left)
        );
        assert_eq!(
            station.take(Some(SlaveReply::Confirmed)),
            Err(ExchangeError::Unexpected)
        );
        let length = ExchangeError::Length {
            octets: 3,
            expected: 4,
        };
        assert_eq!(station.take(data(&[0; 3])), Err(length));
        let mut station = Exchange::new(PpoType::One);
        station.read(&ParameterRef::parse("1202").unwrap());
        let results: Vec<_> = (0..=MOST_EXCHANGES)
            .map(|_| station.take(data(&[0; 12])))
            .collect();
        let task = Pkw::of(1, 1202, 0, 0);
        assert_eq!(results.last(), Some(&Err(ExchangeError::NoAnswer { task })));
        assert!(results.iter().rev().skip(1).all(Result::is_ok) && !station.is_waiting());
    }
}
