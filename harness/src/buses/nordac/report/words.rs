//! What telegrams say, in words: service, diagnosis, process words, parameter channel.

use super::telegrams::Said;
use harness_proto::decode::Decoded;
use harness_proto::nordac::words::{STW, WordBit, ZSW};
use harness_proto::nordac::{Answer, Image, Parameter, Pkw, PpoType, Task};
use harness_proto::profibus::dp::{Diagnosis, GlobalControl, Service, SetPrm};
use harness_proto::profibus::fdl::Status;
use harness_proto::profibus::{Buffer, Pdu, Telegram};
use std::collections::BTreeMap;

/// Reads telegrams one after another: a reply has the service of its request, and the PPO type is that of the last Chk_Cfg.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    /// The PPO types, by the slave's address.
    types: BTreeMap<u8, PpoType>,
    /// The service of the last request, and the slave that was asked.
    asked: Option<(u8, Service)>,
}

/// A telegram in words.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Words {
    /// The station that it is for.
    pub to: Option<u8>,
    /// The service, or the kind of telegram.
    pub service: String,
    /// What it says.
    pub meaning: String,
}

impl Reader {
    /// Reads the next telegram.
    pub fn read(&mut self, said: &Said) -> Words {
        if let Some((place, error)) = said.error {
            return Words {
                service: "damaged".to_owned(),
                meaning: format!("byte {place} has a {error} error"),
                ..Words::default()
            };
        }
        match said.telegram() {
            Some(Telegram::Confirmation) => Words {
                service: self.asked.map_or("SC", |(_, own)| own.name()).to_owned(),
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

    fn pdu(&mut self, pdu: &Pdu) -> Words {
        let to = Some(pdu.da());
        if let Some(function) = pdu.fc().function() {
            let service = Service::of(pdu.dsap());
            let known = service.filter(|_| function.is_srd() || function.is_sdn());
            self.asked = known.map(|own| (pdu.da(), own));
            return Words {
                to,
                service: known.map_or(function.name(), Service::name).to_owned(),
                meaning: known.map_or(String::new(), |own| self.request(own, pdu)),
            };
        }
        let asked = self.asked.filter(|(slave, _)| *slave == pdu.sa());
        let service = asked.map(|(_, own)| own);
        let name = service.map_or("FDL status", Service::name).to_owned();
        let meaning = match (pdu.fc().status(), service) {
            (Some(Status::Ok), _) => "OK".to_owned(),
            (Some(Status::Rs), _) => "RS: no service activated".to_owned(),
            (Some(status), Some(service)) => {
                let diagnosis = match status {
                    Status::DataHigh => "diagnosis waits; ",
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
                SetPrm::decode(data).map_or_else(|| hex(data), |own| parameters(&own))
            }
            Service::ChkCfg => match PpoType::from_cfg(data) {
                Some(ppo) => {
                    self.types.insert(slave, ppo);
                    ppo.to_string()
                }
                None => hex(data),
            },
            Service::GlobalControl => {
                GlobalControl::decode(data).map_or_else(|| hex(data), |own| commands(&own))
            }
            Service::DataExchange => match self.image(slave, data) {
                Some((ppo, image)) => {
                    let words = words(ppo, &image, ("STW", "HSW"), &STW);
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
                Diagnosis::decode(data).map_or_else(|| hex(data), |own| diagnosis(&own))
            }
            Service::GetCfg => {
                PpoType::from_cfg(data).map_or_else(|| hex(data), |ppo| ppo.to_string())
            }
            Service::DataExchange | Service::RdInp => match self.image(pdu.sa(), data) {
                Some((ppo, image)) => {
                    let words = words(ppo, &image, ("ZSW", "HIW"), &ZSW);
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
            .find(|own| own.octets() == data.len());
        let ppo = known.filter(|own| own.octets() == data.len()).or(fits)?;
        Some((ppo, Image::decode(ppo, data)?))
    }
}

fn hex(data: &[u8]) -> String {
    Buffer::of(data).map_or(String::new(), |own| own.to_string())
}

fn joined(words: String, pkw: Option<String>) -> String {
    pkw.map_or(words.clone(), |pkw| format!("{words}  {pkw}"))
}

/// The process words, and what the bits of the first mean.
fn words(
    ppo: PpoType,
    image: &Image,
    (first, main): (&str, &str),
    bits: &'static [WordBit; 16],
) -> String {
    let word = image.first();
    let names = bits.iter().filter(|bit| word >> bit.number & 1 == 1);
    let names: Vec<_> = names.map(|bit| bit.name).collect();
    let mut text = format!("{first} {word:04X} ({})", names.join(" "));
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

/// A parameter with its name and its index.
fn named(pkw: Pkw) -> String {
    let number = pkw.number();
    let name = Parameter::of(number).map_or("", |own| own.name);
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

fn parameters(own: &SetPrm<'_>) -> String {
    let bits = [
        (SetPrm::LOCK, "lock"),
        (SetPrm::UNLOCK, "unlock"),
        (SetPrm::SYNC, "sync"),
        (SetPrm::FREEZE, "freeze"),
    ];
    let set = bits.into_iter().filter(|(bit, _)| own.has(*bit));
    let mut words: Vec<_> = set.map(|(_, name)| name.to_owned()).collect();
    if let Some(tens) = own.watchdog_tens_of_ms() {
        words.push(format!("watchdog {} ms", u32::from(tens) * 10));
    }
    words.push(format!(
        "min T_SDR {}, ident {:04X}",
        own.min_tsdr, own.ident
    ));
    if own.group != 0 {
        words.push(format!("groups {:02X}", own.group));
    }
    if !own.user.is_empty() {
        words.push(format!("user data {}", hex(own.user)));
    }
    words.join(", ")
}

fn commands(own: &GlobalControl) -> String {
    let bits = [
        (GlobalControl::CLEAR_DATA, "clear data"),
        (GlobalControl::UNFREEZE, "unfreeze"),
        (GlobalControl::FREEZE, "freeze"),
        (GlobalControl::UNSYNC, "unsync"),
        (GlobalControl::SYNC, "sync"),
    ];
    let set = bits.into_iter().filter(|(bit, _)| own.has(*bit));
    let names: Vec<_> = set.map(|(_, name)| name).collect();
    let names = if names.is_empty() {
        "operate".to_owned()
    } else {
        names.join(" ")
    };
    match own.group {
        0 => names,
        group => format!("{names}, groups {group:02X}"),
    }
}

fn diagnosis(own: &Diagnosis) -> String {
    let mut words: Vec<_> = own.names().map(str::to_owned).collect();
    words.push(match own.master {
        Some(master) => format!("master {master}"),
        None => "no master".to_owned(),
    });
    words.push(format!("ident {:04X}", own.ident));
    if let Some(bits) = own.extension {
        words.push(format!("device block {bits:02X}"));
    }
    words.join(", ")
}
