//! The PROFIBUS module of the drive: data link layer, DP slave and parameter channel (EN 1, EN 2, NORDAC 3.4.1).
//!
//! The module is asked telegram by telegram; [`super::Drive`] puts it on a line. What a request does to the inverter it does at once, and
//! the reply to a request shows the inverter as it was before.

mod channel;
mod image;
mod receiver;
mod refusal;
mod services;

pub(in crate::nordac) use receiver::{Receiver, expected};
pub use refusal::Refusal;

use super::inverter::{Inverter, Settings};
use harness_proto::nordac::properties::{
    Autobaud, DiagFlagClearedBy, Properties, Reinit, SdaIdentLsap, WatchdogAction,
};
use harness_proto::nordac::{Image, PpoType};
use harness_proto::profibus::dp::{DpState, GlobalControl, Service};
use harness_proto::profibus::fdl::{BROADCAST, FcFunction, FcStatus, Fcb, Form, FrameControl, Pdu};
use harness_proto::profibus::rate::MIN_TSDR_BITS;
use harness_proto::profibus::{Buffer, Telegram};
use harness_proto::time::{Instant, Span};
use image::ProcessData;
use std::hash::{Hash as _, Hasher};

/// What a slave does with a request.
enum Outcome {
    /// A reply with data.
    Data(Buffer),
    /// A reply with the inputs: "data" or "data, and a diagnosis waits".
    Inputs(Buffer),
    /// A short confirmation.
    Confirmed,
    /// No service activated.
    Refused,
}

/// The watchdog of a slave.
#[derive(Clone, Copy, Debug)]
struct Watchdog {
    time: Span,
    expires: Instant,
}

/// What Set_Prm has agreed with the own master; forgotten in Wait_Prm.
#[derive(Clone, Debug, Default)]
struct Agreement {
    master: Option<u8>,
    watchdog: Option<Watchdog>,
    group: u8,
    sync: bool,
    freeze: bool,
}

/// The module.
#[derive(Clone, Debug)]
pub struct Slave {
    properties: Properties,
    /// The settings of the inverter that are in use.
    settings: Settings,
    /// The PPO type that is exchanged.
    ppo: PpoType,
    state: DpState,
    agreed: Agreement,
    fcb: Fcb,
    /// The reply to the last request that counts; `None` if there was none.
    last_reply: Option<Buffer>,
    min_tsdr: u8,
    prm_fault: bool,
    cfg_fault: bool,
    /// Why the last Set_Prm or Chk_Cfg was refused; `None` where it was not.
    refusal: Option<Refusal>,
    data: ProcessData,
    /// The device block of the diagnosis has come or gone, and no diagnosis was fetched since.
    diagnosis_waits: bool,
    /// While module and inverter have lost each other: the inputs of the moment at which they did.
    apart: Option<Image>,
    /// Whether the bit rate is found.
    in_step: bool,
}

impl Slave {
    /// The module after power-up.
    #[must_use]
    pub fn new(properties: Properties, settings: Settings) -> Self {
        Self {
            state: DpState::WaitPrm,
            agreed: Agreement::default(),
            fcb: Fcb::default(),
            last_reply: None,
            min_tsdr: default_tsdr(),
            prm_fault: false,
            cfg_fault: false,
            refusal: None,
            data: ProcessData::default(),
            diagnosis_waits: false,
            apart: None,
            in_step: properties.autobaud == Autobaud::AtOnce,
            ppo: settings.ppo,
            settings,
            properties,
        }
    }

    /// The state of the DP slave.
    #[must_use]
    pub const fn state(&self) -> DpState {
        self.state
    }

    /// Why the last Set_Prm or Chk_Cfg was refused; `None` where it was not.
    #[must_use]
    pub const fn refusal(&self) -> Option<Refusal> {
        self.refusal
    }

    /// The address to which it answers.
    #[must_use]
    pub const fn address(&self) -> u8 {
        self.settings.address
    }

    /// The PPO type that it exchanges.
    #[must_use]
    pub const fn ppo(&self) -> PpoType {
        self.ppo
    }

    /// The master that has locked it.
    #[must_use]
    pub const fn master(&self) -> Option<u8> {
        self.agreed.master
    }

    /// Bits between the end of a request and the begin of the reply.
    #[must_use]
    pub const fn reply_delay_bits(&self) -> u64 {
        self.min_tsdr as u64
    }

    /// When the watchdog expires; `None` while it does not run.
    #[must_use]
    pub fn next_action(&self) -> Option<Instant> {
        self.agreed.watchdog.map(|watchdog| watchdog.expires)
    }

    /// Does what is due at `to`: the watchdog.
    pub fn advance(&mut self, to: Instant, inverter: &mut Inverter) {
        if self.next_action().is_some_and(|expires| expires <= to) {
            self.wait_for_parameters();
            if self.properties.watchdog_action == WatchdogAction::Stop {
                inverter.watchdog_expired(to);
            }
        }
    }

    /// Feeds all that decides what it does from `at` on, but its properties, to a checksum.
    pub fn hash_state(&self, at: Instant, sum: &mut impl Hasher) {
        let agreed = &self.agreed;
        let watchdog = agreed.watchdog.as_ref();
        let watchdog = watchdog.map(|watchdog| (watchdog.time, watchdog.expires.since(at)));
        (self.settings, self.ppo, self.state, self.min_tsdr).hash(sum);
        (agreed.master, agreed.group, agreed.sync, agreed.freeze).hash(sum);
        (watchdog, self.fcb, self.last_reply.as_deref()).hash(sum);
        (self.prm_fault, self.cfg_fault, self.diagnosis_waits).hash(sum);
        (&self.data, self.apart, self.in_step).hash(sum);
    }

    /// Module and inverter lose each other, or find each other again (NORDAC 2.6).
    pub fn link(&mut self, at: Instant, lost: bool, inverter: &mut Inverter) {
        if lost == self.apart.is_some() {
            return;
        }
        self.diagnosis_waits = true;
        if lost {
            self.apart = Some(self.inputs(at, inverter));
            inverter.link_lost(at);
        } else {
            self.apart = None;
            inverter.link_found(at);
        }
    }

    /// Takes a telegram that has ended at `at`; gives the octets of the reply, if there is one.
    pub fn hear(
        &mut self,
        at: Instant,
        telegram: &Telegram,
        inverter: &mut Inverter,
    ) -> Option<Buffer> {
        if !std::mem::replace(&mut self.in_step, true) {
            return None;
        }
        let pdu = telegram.pdu()?;
        let reply = self.request(at, pdu, inverter);
        self.follow(inverter);
        reply
    }

    fn request(&mut self, at: Instant, pdu: &Pdu, inverter: &mut Inverter) -> Option<Buffer> {
        let function = pdu.fc().function()?;
        let addressed = pdu.da() == self.address();
        if function.is_sdn() && (addressed || pdu.da() == BROADCAST) {
            self.command(at, pdu, inverter);
            return None;
        }
        if !addressed {
            return None;
        }
        if function == FcFunction::FdlStatus {
            let plain = pdu.form() == Form::Plain;
            return plain.then(|| self.plain(pdu, FcStatus::Ok)).flatten();
        }
        if function.is_srd() && self.is_own_master(pdu.sa()) {
            self.restart_watchdog(at);
        }
        if self.fcb.repeats(pdu.sa(), pdu.fc()) {
            return self.last_reply;
        }
        self.last_reply = if function.is_srd() {
            let outcome = self.serve(at, pdu, inverter);
            self.reply(pdu, outcome)
        } else if self.properties.sda_ident_lsap == SdaIdentLsap::Rs {
            self.plain(pdu, FcStatus::Rs)
        } else {
            None
        };
        self.last_reply
    }

    fn is_own_master(&self, sa: u8) -> bool {
        self.agreed.master == Some(sa)
    }

    fn restart_watchdog(&mut self, at: Instant) {
        if let Some(watchdog) = &mut self.agreed.watchdog {
            watchdog.expires = at + watchdog.time;
        }
    }

    /// SRD: by service access point.
    fn serve(&mut self, at: Instant, pdu: &Pdu, inverter: &mut Inverter) -> Outcome {
        let sa = pdu.sa();
        let service = match (pdu.dsap(), pdu.ssap()) {
            (None, None) => Service::DataExchange,
            (Some(dsap), Some(_)) => match Service::of(Some(dsap)) {
                Some(service) => service,
                None => return Outcome::Refused,
            },
            _ => return Outcome::Refused,
        };
        let data = pdu.data();
        let exchanges = self.state == DpState::DataExch;
        match service {
            Service::DataExchange => self.exchange(at, sa, data, inverter),
            Service::SetPrm => self.set_parameters(at, sa, data),
            Service::ChkCfg => self.check_configuration(sa, data),
            Service::RdInp if exchanges && data.is_empty() => {
                Outcome::Data(self.read_inputs(at, inverter))
            }
            Service::RdOutp if exchanges && data.is_empty() => Outcome::Data(self.read_outputs()),
            Service::GetCfg if data.is_empty() => {
                Outcome::Data(Buffer::of(self.ppo.cfg()).unwrap_or_default())
            }
            Service::SlaveDiag if data.is_empty() => {
                let clears = self.properties.diag_flag_cleared_by == DiagFlagClearedBy::AnyMaster;
                if clears || self.is_own_master(sa) {
                    self.diagnosis_waits = false;
                }
                Outcome::Data(self.diagnosis().encode())
            }
            _ => Outcome::Refused,
        }
    }

    /// SDN: Global_Control, and nothing else.
    fn command(&mut self, at: Instant, pdu: &Pdu, inverter: &mut Inverter) {
        let saps = (pdu.dsap(), pdu.ssap());
        let (Some(dsap), Some(_)) = saps else {
            return;
        };
        if Some(dsap) != Service::GlobalControl.sap()
            || self.state != DpState::DataExch
            || !self.is_own_master(pdu.sa())
        {
            return;
        }
        if let Some(command) = GlobalControl::decode(pdu.data()) {
            self.restart_watchdog(at);
            if command.is_for(self.agreed.group) {
                self.control(at, command, inverter);
            }
        }
    }

    fn reply(&self, request: &Pdu, outcome: Outcome) -> Option<Buffer> {
        let (status, data) = match outcome {
            Outcome::Confirmed => return Some(Telegram::Confirmation.encode()),
            Outcome::Refused => return self.plain(request, FcStatus::Rs),
            Outcome::Data(data) => (FcStatus::DataLow, data),
            Outcome::Inputs(data) if self.diagnosis_waits => (FcStatus::DataHigh, data),
            Outcome::Inputs(data) => (FcStatus::DataLow, data),
        };
        let pdu = Pdu::with_saps(
            request.sa(),
            self.address(),
            FrameControl::reply(status),
            request.ssap(),
            request.dsap(),
            &data,
        );
        pdu.ok().as_ref().map(Pdu::encode)
    }

    /// A reply without data.
    fn plain(&self, request: &Pdu, status: FcStatus) -> Option<Buffer> {
        let control = FrameControl::reply(status);
        let pdu = Pdu::new(request.sa(), self.address(), control, &[]);
        pdu.ok().as_ref().map(Pdu::encode)
    }

    /// Enters Wait_Prm.
    fn wait_for_parameters(&mut self) {
        self.state = DpState::WaitPrm;
        self.agreed = Agreement::default();
        self.data = ProcessData::default();
    }

    /// Restarts if the inverter has other settings of the bus than before.
    fn follow(&mut self, inverter: &Inverter) {
        let settings = inverter.settings();
        if settings != self.settings && self.properties.reinit == Reinit::AtOnce {
            let apart = self.apart;
            *self = Self::new(self.properties, settings);
            self.apart = apart;
        }
    }
}

/// The reply delay before Set_Prm changes it.
fn default_tsdr() -> u8 {
    u8::try_from(MIN_TSDR_BITS).unwrap_or(u8::MAX)
}
