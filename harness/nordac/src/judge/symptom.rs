//! How replies can differ, and where.

use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::fdl::{FcFunction, Pdu};
use serde::{Deserialize, Serialize};

/// How slaves differ from the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Symptom {
    Value,
    /// A reply is of another kind, or has other addresses, SAPs or length.
    Form,
    /// A reply is no telegram.
    NoTelegram,
    /// Octets of a reply have a line error.
    Damaged,
    Sender,
    Missing,
    Unasked,
    Time,
}

impl Symptom {
    #[must_use]
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::Value => "other data",
            Self::Form => "another reply",
            Self::NoTelegram => "no telegram",
            Self::Damaged => "a line error",
            Self::Sender => "another slave",
            Self::Missing => "no reply",
            Self::Unasked => "a telegram that nothing asks for",
            Self::Time => "another time",
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ReplySubject {
    /// The service, and the part of its data.
    pub(crate) part: String,
    /// The section that says most about it.
    pub(crate) section: &'static str,
}

impl ReplySubject {
    /// The service of a request.
    #[must_use]
    pub(crate) fn of(request: Option<&Telegram>) -> Self {
        let pdu = request.and_then(Telegram::pdu);
        let function = pdu.and_then(|pdu| pdu.fc().function());
        let (part, section) = match (pdu, function) {
            (None, _) => ("octets that are no request", "EN 1"),
            (Some(_), Some(FcFunction::FdlStatus)) => ("FDL status", "EN 1"),
            (Some(pdu), Some(function)) if function.is_srd() => match Service::of(pdu.dsap()) {
                Some(service) => (service.name(), section_of(service)),
                None => ("another service access point", "EN 2"),
            },
            (Some(_), Some(function)) => (function.name(), "EN 1"),
            (Some(_), None) => ("another function", "EN 1"),
        };
        Self {
            part: part.to_owned(),
            section,
        }
    }

    /// The part of a reply's data that differs.
    #[must_use]
    pub(crate) fn of_data(
        request: Option<&Telegram>,
        ppo: PpoType,
        wanted: &Pdu,
        came: &Pdu,
    ) -> Self {
        let whole = Self::of(request);
        let exchange = wanted.dsap().is_none() && whole.part == Service::DataExchange.name();
        let both = [wanted, came].map(|pdu| Image::decode(ppo, pdu.data()));
        let [Some(a), Some(b)] = both else {
            return whole;
        };
        if !exchange {
            return whole;
        }
        let (word, section) = match (0..6).find(|word| a.words[*word] != b.words[*word]) {
            _ if a.pkw != b.pkw => ("PKW", "3.4.1"),
            Some(0) => return Self::of_bits(a.words[0] ^ b.words[0]),
            Some(1) => ("HIW", "3.2.5"),
            Some(3) => ("PZD4", "3.2.6"),
            _ => ("PZD", "3.1"),
        };
        Self {
            part: format!("{}: {word}", whole.part),
            section,
        }
    }

    /// The lowest bit of the status word that differs.
    fn of_bits(bits: u16) -> Self {
        Self {
            part: format!("Data_Exchange: ZSW bit {}", bits.trailing_zeros()),
            section: "3.2.2",
        }
    }
}

const fn section_of(service: Service) -> &'static str {
    match service {
        Service::DataExchange => "3.1",
        _ => "EN 2",
    }
}
