//! What telegrams say, in words: service, diagnosis, process words, parameter channel.

use crate::value::hex;
use harness_bench::capture::runs::HeardTelegram;
use harness_proto::decode::Decoded;
use harness_proto::nordac::words::{State, ZSW, stw, zsw};
use harness_proto::nordac::{Answer, Image, Parameter, Pkw, PpoType, Task};
use harness_proto::profibus::dp::{Diagnosis, GlobalControl, Service, SetPrm};
use harness_proto::profibus::fdl::FcStatus;
use harness_proto::profibus::{Pdu, Telegram};
use std::collections::BTreeMap;

/// Bits of the status of Set_Prm by name; the watchdog is shown with its time.
pub(crate) const PRM: [(u8, &str); 4] = [
    (SetPrm::LOCK, "lock"),
    (SetPrm::UNLOCK, "unlock"),
    (SetPrm::SYNC, "sync"),
    (SetPrm::FREEZE, "freeze"),
];

/// Bits of the command of Global_Control by name.
pub(crate) const CONTROL: [(u8, &str); 5] = [
    (GlobalControl::CLEAR_DATA, "clear data"),
    (GlobalControl::UNFREEZE, "unfreeze"),
    (GlobalControl::FREEZE, "freeze"),
    (GlobalControl::UNSYNC, "unsync"),
    (GlobalControl::SYNC, "sync"),
];

/// Reads telegrams one after another: a reply has the service of its request, and the PPO type is that of the last Chk_Cfg.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reader {
    /// The PPO types, by the slave's address.
    types: BTreeMap<u8, PpoType>,
    /// The service of the last request, and the slave that was asked.
    asked: Option<(u8, Service)>,
}

/// The process data of a Data_Exchange, in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ProcessImage {
    pub(crate) slave: u8,
    /// Whether they are the slave's inputs, rather than what the master sent.
    pub(crate) of_slave: bool,
    pub(crate) image: Image,
}

/// A telegram in words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Words {
    /// The station that it is for.
    pub(crate) to: Option<u8>,
    /// The service, or the kind of telegram.
    pub(crate) service: String,
    pub(crate) meaning: String,
}

impl Reader {
    /// Reads the next telegram.
    pub(crate) fn read(&mut self, said: &HeardTelegram) -> Words {
        if let Some((place, error)) = said.error {
            return Words {
                service: "damaged".to_owned(),
                meaning: format!("byte {place} has a {error} error"),
                ..Words::default()
            };
        }
        match said.telegram() {
            Some(Telegram::Confirmation) => Words {
                service: self
                    .asked
                    .map_or("SC", |(_, asked)| asked.name())
                    .to_owned(),
                meaning: "confirmed".to_owned(),
                ..Words::default()
            },
            Some(Telegram::Token { da, sa }) => Words {
                to: Some(da),
                service: "token".to_owned(),
                meaning: format!("{sa} gives it to {da}"),
            },
            Some(Telegram::Pdu(pdu)) => self.pdu(&pdu),
            None => Words {
                service: "no telegram".to_owned(),
                meaning: match Telegram::decode(&said.octets) {
                    Decoded::Bad { reason, .. } => reason.to_string(),
                    Decoded::NeedMore => "it is not complete".to_owned(),
                    Decoded::Value { used, .. } => format!("more than {used} bytes"),
                },
                ..Words::default()
            },
        }
    }

    /// The process data of the telegram that was read last, if it was one of a Data_Exchange.
    #[must_use]
    pub(crate) fn exchanged(&self, said: &HeardTelegram) -> Option<ProcessImage> {
        let telegram = said.telegram()?;
        let pdu = telegram.pdu()?;
        let (asked, service) = self.asked?;
        let of_slave = !pdu.fc().is_request();
        let slave = if of_slave { pdu.sa() } else { pdu.da() };
        let fits = service == Service::DataExchange && asked == slave && pdu.dsap().is_none();
        let (_, image) = self.image(slave, pdu.data()).filter(|_| fits)?;
        Some(ProcessImage {
            slave,
            of_slave,
            image,
        })
    }

    fn pdu(&mut self, pdu: &Pdu) -> Words {
        let to = Some(pdu.da());
        if let Some(function) = pdu.fc().function() {
            let service = Service::of(pdu.dsap());
            let known = service.filter(|_| function.is_srd() || function.is_sdn());
            self.asked = known.map(|service| (pdu.da(), service));
            return Words {
                to,
                service: known.map_or(function.name(), Service::name).to_owned(),
                meaning: known.map_or(String::new(), |service| self.request(service, pdu)),
            };
        }
        let asked = self.asked.filter(|(slave, _)| *slave == pdu.sa());
        let service = asked.map(|(_, service)| service);
        let name = service.map_or("FDL status", Service::name).to_owned();
        let meaning = match (pdu.fc().status(), service) {
            (Some(FcStatus::Ok), _) => "OK".to_owned(),
            (Some(FcStatus::Rs), _) => "RS: no service activated".to_owned(),
            (Some(status), Some(service)) => {
                let diagnosis = match status {
                    FcStatus::DataHigh => "diagnosis waits; ",
                    _ => "",
                };
                format!("{diagnosis}{}", self.answer(service, pdu))
            }
            (Some(status), None) => status.name().to_owned(),
            (None, _) => format!("FC {:02X}", pdu.fc().0),
        };
        Words {
            to,
            service: name,
            meaning,
        }
    }

    fn request(&mut self, service: Service, pdu: &Pdu) -> String {
        let slave = pdu.da();
        let data = pdu.data();
        match service {
            Service::SetPrm => {
                SetPrm::decode(data).map_or_else(|| hex(data), |prm| parameters(&prm))
            }
            Service::ChkCfg => match PpoType::from_cfg(data) {
                Some(ppo) => {
                    self.types.insert(slave, ppo);
                    ppo.to_string()
                }
                None => hex(data),
            },
            Service::GlobalControl => {
                GlobalControl::decode(data).map_or_else(|| hex(data), |control| commands(&control))
            }
            Service::DataExchange => match self.image(slave, data) {
                Some((ppo, image)) => {
                    let words = words(ppo, &image, "STW", "HSW", control);
                    let task = image.pkw.task();
                    let pkw = (task != Task::None).then(|| asks(image.pkw));
                    joined(words, pkw)
                }
                None => hex(data),
            },
            _ => hex(data),
        }
    }

    fn answer(&self, service: Service, pdu: &Pdu) -> String {
        let data = pdu.data();
        match service {
            Service::SlaveDiag => {
                Diagnosis::decode(data).map_or_else(|| hex(data), |answer| diagnosis(&answer))
            }
            Service::GetCfg => {
                PpoType::from_cfg(data).map_or_else(|| hex(data), |ppo| ppo.to_string())
            }
            Service::DataExchange | Service::RdInp => match self.image(pdu.sa(), data) {
                Some((ppo, image)) => {
                    let words = words(ppo, &image, "ZSW", "HIW", status);
                    let pkw = (image.pkw != Pkw::default()).then(|| says(image.pkw));
                    joined(words, pkw)
                }
                None => hex(data),
            },
            _ => hex(data),
        }
    }

    /// The process data by the PPO type of a slave; where it is not known, by their length.
    fn image(&self, slave: u8, data: &[u8]) -> Option<(PpoType, Image)> {
        let known = self.types.get(&slave).copied();
        let fits = PpoType::ALL
            .into_iter()
            .find(|ppo| ppo.octets() == data.len());
        let ppo = known.filter(|ppo| ppo.octets() == data.len()).or(fits)?;
        Some((ppo, Image::decode(ppo, data)?))
    }
}

fn joined(words: String, pkw: Option<String>) -> String {
    pkw.map_or(words.clone(), |pkw| format!("{words}  {pkw}"))
}

/// The process words, and what the first says.
fn words(ppo: PpoType, image: &Image, first: &str, main: &str, says: fn(u16) -> String) -> String {
    let word = image.first();
    let mut text = format!("{first} {word:04X} ({})", says(word));
    let percent = f64::from(image.main().cast_signed()) * 100.0 / 16384.0;
    text.push_str(&format!(", {main} {:04X} ({percent:.1} %)", image.main()));
    if ppo.words() > 2 {
        text.push_str(&format!(
            ", PZD3 {:04X}, PZD4 {:04X}",
            image.third(),
            image.fourth()
        ));
    }
    text
}

/// What a control word commands: by the priority of its bits, and what else is not as in normal operation (3.2.1, 3.3).
fn control(word: u16) -> String {
    let is = |bit: u16| word & bit != 0;
    let mut words = vec![if !is(stw::NO_OFF2) {
        "OFF2"
    } else if !is(stw::NO_OFF3) {
        "OFF3"
    } else if !is(stw::ON) {
        "OFF1"
    } else if is(stw::ENABLE) {
        "enable"
    } else {
        "ON"
    }];
    let more = [
        (!is(stw::VALID), "not valid"),
        (!is(stw::RAMP), "ramp to zero"),
        (!is(stw::RUN), "ramp stopped"),
        (!is(stw::SETPOINT), "setpoint 0"),
        (is(stw::ACKNOWLEDGE), "acknowledge"),
        (is(stw::CLOCKWISE), "clockwise"),
        (is(stw::ANTICLOCKWISE), "anticlockwise"),
    ];
    words.extend(more.into_iter().filter(|(so, _)| *so).map(|(_, word)| word));
    in_set(words.join(", "), word)
}

/// The state that a status word shows, and its other bits (3.2.2).
fn status(word: u16) -> String {
    let state = State::of_zsw(word).map_or("no state", State::short);
    let states = State::ALL.into_iter();
    let shown = states.fold(0, |all, state| all | state.bits());
    let others = ZSW.iter().filter(|bit| {
        let set = word & !shown & !(zsw::NO_OFF2 | zsw::NO_OFF3) & 0x3FFF;
        set >> bit.number & 1 == 1
    });
    let mut words = vec![state];
    words.extend(others.map(|bit| bit.name));
    if word & zsw::NO_OFF2 == 0 {
        words.push("OFF2 active");
    }
    if word & zsw::NO_OFF3 == 0 {
        words.push("OFF3 active");
    }
    in_set(words.join(", "), word)
}

/// Adds the parameter set of bits 15 and 14, where it is not the first.
fn in_set(text: String, word: u16) -> String {
    match word >> 14 {
        0 => text,
        set => format!("{text}, set {}", set + 1),
    }
}

/// A parameter with its name and its index.
fn named(pkw: Pkw) -> String {
    let number = pkw.number();
    let name = Parameter::of(number).map_or("", |parameter| parameter.name);
    let index = match pkw.ind {
        0 => String::new(),
        ind => format!(" IND {ind:04X}"),
    };
    format!("{number} {name}{index}")
}

/// A task.
fn asks(pkw: Pkw) -> String {
    let task = pkw.task();
    let value = match task.is_change() {
        true => format!(" = {}", value(pkw, pkw.pwe)),
        false => String::new(),
    };
    format!("{}: {}{value}", task.name(), named(pkw))
}

/// An answer.
fn says(pkw: Pkw) -> String {
    match Answer::of(pkw) {
        None => format!("no answer that the manual knows: {pkw}"),
        Some(Answer::Error(error)) => {
            format!(
                "{} refused: error {} ({})",
                named(pkw),
                error.code(),
                error.about()
            )
        }
        Some(Answer::Elements(count)) => format!("{} has {count} elements", named(pkw)),
        Some(answer) => format!("{} = {}", named(pkw), value(pkw, answer.pwe())),
    }
}

/// A raw value, and what it means.
fn value(pkw: Pkw, raw: u32) -> String {
    let Some(known) = Parameter::of(pkw.number()) else {
        return raw.to_string();
    };
    let element = pkw.ind >> 8;
    let number = known.number_of(raw);
    match known.unit_of(element).is_plain() {
        true => number.to_string(),
        false => format!("{number} ({})", known.show(element, number)),
    }
}

fn parameters(prm: &SetPrm<'_>) -> String {
    let set = PRM.into_iter().filter(|(bit, _)| prm.has(*bit));
    let mut words: Vec<_> = set.map(|(_, name)| name.to_owned()).collect();
    if let Some(tens) = prm.watchdog_tens_of_ms() {
        words.push(format!("watchdog {} ms", u32::from(tens) * 10));
    }
    words.push(format!(
        "min T_SDR {}, ident {:04X}",
        prm.min_tsdr, prm.ident
    ));
    if prm.group != 0 {
        words.push(format!("groups {:02X}", prm.group));
    }
    if !prm.user.is_empty() {
        words.push(format!("user data {}", hex(prm.user)));
    }
    words.join(", ")
}

fn commands(control: &GlobalControl) -> String {
    let set = CONTROL.into_iter().filter(|(bit, _)| control.has(*bit));
    let names: Vec<_> = set.map(|(_, name)| name).collect();
    let names = if names.is_empty() {
        "operate".to_owned()
    } else {
        names.join(" ")
    };
    match control.group {
        0 => names,
        group => format!("{names}, groups {group:02X}"),
    }
}

fn diagnosis(answer: &Diagnosis) -> String {
    let mut words: Vec<_> = answer.names().map(str::to_owned).collect();
    words.push(match answer.master {
        Some(master) => format!("master {master}"),
        None => "no master".to_owned(),
    });
    words.push(format!("ident {:04X}", answer.ident));
    if let Some(bits) = answer.extension {
        words.push(format!("device block {bits:02X}"));
    }
    words.join(", ")
}
