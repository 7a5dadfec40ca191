//! What the telegrams of a line show of one slave.

use super::channel::Tasks;
use super::diagnosis::{wrong, wrong_status};
use super::symptom::Symptom::{self, Form, Value};
use harness_proto::nordac::{IDENT, Image, PpoType};
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::{Diagnosis, Service, SetPrm};
use harness_proto::profibus::fdl::{BROADCAST, FcFunction, FcStatus, Form as Shape, Pdu};
use harness_proto::time::Instant;

/// The way of a slave into the exchange, as far as it was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Unknown,
    /// It was switched on, and Set_Prm has not come since then.
    Waits,
    /// Set_Prm of this master with Unlock was confirmed.
    Freed(u8),
    /// Set_Prm of this master was confirmed; whether the slave must take it, and whether it has the watchdog on.
    Parametrised {
        master: u8,
        right: bool,
        watchdog: bool,
    },
    /// Chk_Cfg of the same master was confirmed after it.
    Configured {
        master: u8,
        ppo: Option<PpoType>,
        watchdog: bool,
    },
}

/// What a slave remembers of the last counted request (EN 1), as far as it was heard.
#[derive(Clone, Debug)]
pub(super) enum Record {
    Unknown,
    /// The last request was not counted.
    Nothing,
    /// Its master and frame count bit, and the reply to it; `None` where the module may have restarted since.
    Counted(u8, bool, Option<Vec<u8>>),
}

/// What the telegrams show of one slave.
#[derive(Clone, Debug)]
pub(super) struct Follower {
    address: u8,
    pub(super) way: Way,
    pub(super) record: Record,
    pub(super) tasks: Tasks,
    /// The number of a task after which the module may restart, until it is answered.
    restarts: Option<u16>,
    /// The configuration that the slave has shown since it was last set up.
    shown: Option<PpoType>,
    /// A request without a reply: it is missing if the slave turns out to have gone on exchanging.
    pub(super) unanswered: Option<(usize, String)>,
    /// Whether the slave was exchanging when it last replied.
    pub(super) exchanging: bool,
    /// Whether the last telegram to the slave was the one before.
    pub(super) fresh: bool,
    /// Whether its last reply may have been one to a repetition of a request that is not known: it was not compared.
    pub(super) may_repeat: bool,
    /// When its last reply had ended.
    pub(super) sent: Option<Instant>,
}

/// What differs, the section, and what was expected.
pub(super) type Mismatch = Option<(Symptom, &'static str, String)>;

fn form(why: &str) -> Mismatch {
    Some((Form, "EN 1", why.to_owned()))
}

impl Follower {
    pub(super) fn new(address: u8) -> Self {
        Self {
            address,
            way: Way::Unknown,
            record: Record::Unknown,
            tasks: Tasks::default(),
            restarts: None,
            shown: None,
            unanswered: None,
            exchanging: false,
            fresh: false,
            may_repeat: false,
            sent: None,
        }
    }

    /// A follower of the slave after its power was off and on.
    pub(super) fn restarted(&self) -> Self {
        Self {
            way: Way::Waits,
            record: Record::Nothing,
            sent: self.sent,
            ..Self::new(self.address)
        }
    }

    /// What sets the slave up may have been lost, or not.
    pub(super) fn may_be_set_up(&mut self) {
        self.way = Way::Unknown;
        self.shown = None;
        self.unanswered = None;
        self.exchanging = false;
    }

    /// A request whose missing reply is proven.
    pub(super) fn shown(&mut self) -> Option<(usize, String)> {
        match self.exchanging {
            true => self.unanswered.take(),
            false => None,
        }
    }

    /// Compares a reply with what the request allows.
    pub(super) fn judge(&mut self, request: &Pdu, reply: &Telegram, octets: &[u8]) -> Mismatch {
        self.may_repeat = false;
        if request.da() == BROADCAST {
            return form("a request to all stations is answered");
        }
        let Some(function) = request.fc().function() else {
            return form("an unknown function is answered");
        };
        let counts = function != FcFunction::FdlStatus && !function.is_sdn();
        if counts && let Some(found) = self.repetition(request, octets) {
            return found;
        }
        if let Some(found) = self.head(function, request, reply) {
            return Some(found);
        }
        if function == FcFunction::FdlStatus {
            let right = matches!(reply, Telegram::Pdu(pdu) if pdu.fc().0 == 0);
            return (!right).then(|| (Form, "EN 1", "FC 00 is expected".to_owned()));
        }
        if !function.is_srd() {
            return (!is_refusal(reply)).then(|| (Form, "EN 1", "RS is expected".to_owned()));
        }
        let found = self.service(request, reply);
        self.fresh = true;
        if let Some(number) = may_restart(request) {
            self.may_be_set_up();
            self.restarts = Some(number).filter(|number| self.tasks.answered() != Some(*number));
            if let Record::Counted(_, _, reply) = &mut self.record {
                *reply = None;
            }
        }
        found
    }

    /// Who may reply, to whom, and with which service access points.
    fn head(&self, function: FcFunction, request: &Pdu, reply: &Telegram) -> Mismatch {
        if function.is_sdn() {
            return form("a telegram without acknowledgement is answered");
        }
        let reply_pdu = match reply {
            Telegram::Token { .. } => return form("a slave passes no token"),
            Telegram::Confirmation => return None,
            Telegram::Pdu(pdu) => pdu,
        };
        if reply_pdu.sa() != self.address || reply_pdu.da() != request.sa() {
            return form("DA or SA is another one than that of the request asks for");
        }
        if reply_pdu.fc().is_request() || reply_pdu.fc().0 & 0x30 != 0 {
            return form("its FC is none of a slave's reply");
        }
        let saps = (reply_pdu.dsap(), reply_pdu.ssap()) == (request.ssap(), request.dsap());
        match reply_pdu.fc().status() {
            None => form("its FC is none of a slave's reply"),
            Some(FcStatus::DataLow | FcStatus::DataHigh) if !saps => {
                form("its service access points are not those of the request in the other order")
            }
            Some(FcStatus::DataHigh) if request.dsap().is_some() => {
                form("only Data_Exchange reports that a diagnosis waits")
            }
            Some(FcStatus::Ok) if function != FcFunction::FdlStatus => {
                form("FC 00 replies to FDL status only")
            }
            Some(FcStatus::Ok | FcStatus::Rs) if reply_pdu.form() != Shape::Plain => {
                form("a reply without data is an SD1 without service access points")
            }
            _ => None,
        }
    }

    /// Takes note of the count of a request. A repetition gets the last reply again, and what may be one is not compared: `Some`.
    fn repetition(&mut self, request: &Pdu, octets: &[u8]) -> Option<Mismatch> {
        let control = request.fc();
        let (master, bit) = (request.sa(), control.fcb());
        let now = match control.fcv() || bit {
            true => Record::Counted(master, bit, Some(octets.to_vec())),
            false => Record::Nothing,
        };
        let unknown = |follower: &mut Self| {
            (follower.way, follower.fresh, follower.may_repeat) = (Way::Unknown, false, true);
            Some(None)
        };
        match std::mem::replace(&mut self.record, now) {
            _ if !control.fcv() => None,
            Record::Unknown => unknown(self),
            Record::Counted(before, count, former) if (before, count) == (master, bit) => {
                let Some(former) = former else {
                    return unknown(self);
                };
                let same = former == octets;
                let why = "the reply to a repeated request is another one";
                Some((!same).then(|| (Value, "EN 1", why.to_owned())))
            }
            Record::Nothing | Record::Counted(..) => None,
        }
    }

    fn service(&mut self, request: &Pdu, reply: &Telegram) -> Mismatch {
        let both = request.dsap().is_some() == request.ssap().is_some();
        let service = Service::of(request.dsap()).filter(|_| both);
        let confirmed = *reply == Telegram::Confirmation;
        let data = match reply {
            Telegram::Pdu(pdu) if !is_refusal(reply) => Some(pdu.data()),
            _ => None,
        };
        let refused = is_refusal(reply);
        let only_refused =
            |section| (!refused).then(|| (Form, section, "RS is expected".to_owned()));
        match service {
            Some(Service::SetPrm) => self.set_up(request, confirmed, refused),
            Some(Service::ChkCfg) => self.configured(request, confirmed, refused),
            Some(Service::DataExchange) => self.exchanged(request, data, confirmed),
            Some(Service::SlaveDiag | Service::GetCfg | Service::RdInp | Service::RdOutp)
                if !request.data().is_empty() =>
            {
                only_refused("EN 2")
            }
            Some(Service::SlaveDiag) => match data {
                None => Some((Form, "EN 2", "a diagnosis is expected".to_owned())),
                Some(data) => self.diagnosis(data),
            },
            Some(Service::GetCfg) => {
                let cfg = data.and_then(PpoType::from_cfg);
                let other = matches!(self.way, Way::Configured { ppo: Some(ppo), .. } if self.exchanging && cfg != Some(ppo))
                    || self.shown.is_some_and(|shown| cfg != Some(shown));
                self.shown = cfg.filter(|_| self.restarts.is_none());
                (cfg.is_none() || other).then(|| {
                    (
                        Value,
                        "3.1",
                        "the configuration of its PPO type is expected".to_owned(),
                    )
                })
            }
            Some(Service::RdInp | Service::RdOutp) => match data {
                None if refused => None,
                Some(data) if PpoType::ALL.iter().any(|ppo| ppo.octets() == data.len()) => None,
                _ => Some((
                    Form,
                    "EN 2",
                    "RS or the process data are expected".to_owned(),
                )),
            },
            _ => only_refused("EN 2"),
        }
    }

    fn set_up(&mut self, request: &Pdu, confirmed: bool, refused: bool) -> Mismatch {
        (self.exchanging, self.unanswered, self.shown) = (false, None, None);
        let prm = SetPrm::decode(request.data());
        let locks = prm
            .as_ref()
            .is_some_and(|prm| prm.has(SetPrm::LOCK) && !prm.has(SetPrm::UNLOCK));
        self.way = match (&prm, confirmed) {
            (Some(prm), true) if locks => Way::Parametrised {
                master: request.sa(),
                right: prm.ident == IDENT
                    && prm.watchdog_tens_of_ms() != Some(0)
                    && prm.user.is_empty(),
                watchdog: prm.has(SetPrm::WATCHDOG),
            },
            (Some(prm), true) if prm.has(SetPrm::UNLOCK) => Way::Freed(request.sa()),
            // Too short.
            (None, true) => Way::Parametrised {
                master: request.sa(),
                right: false,
                watchdog: false,
            },
            _ => Way::Unknown,
        };
        // Parameters that a slave may take or not (`user-prm`).
        if prm.is_some_and(|prm| !prm.user.is_empty()) {
            self.way = Way::Unknown;
        }
        (!confirmed && !refused).then(|| (Form, "EN 2", "a confirmation is expected".to_owned()))
    }

    fn configured(&mut self, request: &Pdu, confirmed: bool, refused: bool) -> Mismatch {
        let was_exchanging = std::mem::replace(&mut self.exchanging, false);
        (self.unanswered, self.shown) = (None, None);
        let ppo = PpoType::from_cfg(request.data());
        self.way = match self.way {
            Way::Parametrised {
                master,
                right: true,
                watchdog,
            } if confirmed && master == request.sa() => {
                self.tasks = Tasks::begun();
                Way::Configured {
                    master,
                    ppo,
                    watchdog,
                }
            }
            // The same again leaves the slave where it is.
            same @ Way::Configured { ppo: known, .. }
                if confirmed && was_exchanging && known == ppo && ppo.is_some() =>
            {
                same
            }
            Way::Waits => Way::Waits,
            _ => Way::Unknown,
        };
        (!confirmed && !refused)
            .then(|| (Form, "EN 2", "a confirmation or RS is expected".to_owned()))
    }

    fn exchanged(&mut self, request: &Pdu, data: Option<&[u8]>, confirmed: bool) -> Mismatch {
        if confirmed {
            return Some((Form, "EN 2", "RS or the inputs are expected".to_owned()));
        }
        let Some(data) = data else {
            (self.exchanging, self.unanswered, self.shown) = (false, None, None);
            if matches!(self.way, Way::Configured { .. }) {
                self.way = Way::Unknown;
            }
            return None;
        };
        if self.way == Way::Waits {
            return Some((Form, "EN 2", "RS is expected before Set_Prm".to_owned()));
        }
        let early = matches!(self.way, Way::Parametrised { master, .. } | Way::Freed(master) if master == request.sa() && self.fresh);
        if early {
            return Some((Form, "EN 2", "RS is expected before Chk_Cfg".to_owned()));
        }
        if request.data().len() != data.len()
            || !PpoType::ALL.iter().any(|ppo| ppo.octets() == data.len())
        {
            return Some((
                Form,
                "3.1",
                "as many octets as the request has are expected, or RS".to_owned(),
            ));
        }
        let way = match self.way {
            Way::Configured { master, ppo, .. } => Some((master, ppo)),
            _ => None,
        };
        if way.is_some_and(|(master, _)| master != request.sa() && self.exchanging) {
            return Some((
                Form,
                "EN 2",
                "RS is expected: another master has locked the slave".to_owned(),
            ));
        }
        self.exchanging = true;
        let ppo = way.and_then(|(_, ppo)| ppo).or_else(|| shown_by(data))?;
        self.inputs(&Image::decode(ppo, data)?, ppo.has_pkw())
    }

    fn inputs(&mut self, image: &Image, tasks: bool) -> Mismatch {
        let [zsw, actual, third, _, rest @ ..] = image.words;
        if let Some((section, rule)) = wrong_status(zsw, actual) {
            return Some((
                Value,
                section,
                format!("ZSW {zsw:04X}, HIW {actual:04X}: {rule}"),
            ));
        }
        if third != 0 || rest != [0, 0] {
            return Some((Value, "3.1", "PZD3, PZD5 and PZD6 are 0".to_owned()));
        }
        let wrong = tasks.then(|| self.tasks.wrong(image.pkw)).flatten();
        self.restarts = self
            .restarts
            .filter(|number| self.tasks.answered() != Some(*number));
        wrong.map(|(section, why)| (Value, section, why))
    }

    fn diagnosis(&mut self, data: &[u8]) -> Mismatch {
        let value = |why: String| Some((Value, "EN 2", why));
        if let Some(why) = wrong(data) {
            return value(why);
        }
        let diagnosis = Diagnosis::decode(data)?;
        let waits = diagnosis.has_mode(Diagnosis::PRM_REQ);
        if waits {
            (self.exchanging, self.unanswered, self.shown) = (false, None, None);
        }
        let of = |master: u8| diagnosis.master == Some(master);
        match self.way {
            Way::Waits if !waits => value("Prm_Req is expected before Set_Prm".to_owned()),
            // One that another master has locked takes none of it.
            Way::Freed(master)
            | Way::Parametrised {
                right: false,
                master,
                ..
            }
            | Way::Configured {
                ppo: None, master, ..
            } if self.fresh && !waits && of(master) => {
                value("Prm_Req is expected behind what the slave must refuse, or Unlock".to_owned())
            }
            Way::Parametrised { right: false, .. }
                if self.fresh && waits && !diagnosis.has(Diagnosis::PRM_FAULT) =>
            {
                value("Prm_Fault is expected behind wrong parameters".to_owned())
            }
            Way::Configured { ppo: None, .. }
                if self.fresh && waits && !diagnosis.has(Diagnosis::CFG_FAULT) =>
            {
                value("Cfg_Fault is expected behind a wrong configuration".to_owned())
            }
            Way::Parametrised {
                right: true,
                master,
                ..
            } if of(master) && !diagnosis.has(Diagnosis::NOT_READY) && self.fresh => {
                value("Station_Not_Ready is expected before Chk_Cfg".to_owned())
            }
            Way::Parametrised {
                right: true,
                master,
                watchdog,
            }
            | Way::Configured {
                master, watchdog, ..
            } if of(master) && diagnosis.has_mode(Diagnosis::WD_ON) != watchdog => {
                value("WD_On is not what Set_Prm has asked for".to_owned())
            }
            _ => None,
        }
    }
}

/// The number of a task after which the module restarts (2.6): another bus mode, PPO type or address, or the factory settings.
fn may_restart(request: &Pdu) -> Option<u16> {
    let exchanges = Service::of(request.dsap()) == Some(Service::DataExchange);
    let task = outputs(request.data()).filter(|_| exchanges)?.pkw;
    let number = Some(task.number()).filter(|_| task.task().is_change());
    number.filter(|number| [970, 1602, 1619, 1622, 1624].contains(number))
}

/// The outputs of a Data_Exchange as those of a PPO type that has a parameter channel.
pub(super) fn outputs(data: &[u8]) -> Option<Image> {
    let mut all = [PpoType::One, PpoType::Two].into_iter();
    Image::decode(all.find(|ppo| ppo.octets() == data.len())?, data)
}

/// The PPO type of inputs, where its Chk_Cfg was not heard: a status word is never 0 (3.3), so PZD5 and PZD6 tell PPO 4 from PPO 1.
fn shown_by(inputs: &[u8]) -> Option<PpoType> {
    match (inputs.len(), inputs) {
        (4, _) => Some(PpoType::Three),
        (12, [.., 0, 0, 0, 0]) => Some(PpoType::Four),
        (12, _) => Some(PpoType::One),
        (20, _) => Some(PpoType::Two),
        _ => None,
    }
}

/// Whether a telegram is RS.
fn is_refusal(telegram: &Telegram) -> bool {
    matches!(telegram, Telegram::Pdu(pdu) if pdu.fc().status() == Some(FcStatus::Rs))
}
