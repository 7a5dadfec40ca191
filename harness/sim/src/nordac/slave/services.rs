//! The services that set a slave up: Set_Prm, Chk_Cfg, Slave_Diag (EN 2).

use super::{Agreement, Outcome, Refusal, Slave, Watchdog, default_tsdr};
use harness_proto::nordac::properties::{
    CfgFollowsPpoType, ChkCfgEarly, ExtDiag, ForeignPrm, UserPrm,
};
use harness_proto::nordac::{IDENT, PpoType};
use harness_proto::profibus::dp::{Diagnosis, DpState, SetPrm};
use harness_proto::time::{Instant, Span};

/// Device block of the diagnosis: Unit_Diag_Bit(2), "Actual value is not updated" (NORDAC 2.6).
const ACTUAL_VALUE_STANDS: u8 = 0x04;

impl Slave {
    pub(super) fn set_parameters(&mut self, at: Instant, sa: u8, data: &[u8]) -> Outcome {
        if self.state != DpState::WaitPrm && !self.is_own_master(sa) {
            self.refuse_master(sa, false);
            return match self.properties.foreign_prm {
                ForeignPrm::Sc => Outcome::Confirmed,
                ForeignPrm::Rs => Outcome::Refused,
            };
        }
        let Some(prm) = SetPrm::decode(data) else {
            self.refuse_parameters(Refusal::Short(data.len()));
            return Outcome::Confirmed;
        };
        self.prm_fault = false;
        self.refusal = None;
        if prm.has(SetPrm::UNLOCK) {
            self.wait_for_parameters();
        } else if !prm.has(SetPrm::LOCK) {
            self.take_tsdr(prm.min_tsdr);
        } else if let Some(why) = Refusal::of(&prm, self.properties.user_prm == UserPrm::Ignore) {
            self.refuse_parameters(why);
        } else {
            self.take_tsdr(prm.min_tsdr);
            self.agree(at, sa, &prm);
        }
        Outcome::Confirmed
    }

    fn refuse_parameters(&mut self, why: Refusal) {
        self.wait_for_parameters();
        self.prm_fault = true;
        self.refusal = Some(why);
    }

    fn refuse_master(&mut self, asks: u8, checks: bool) {
        let refused = |owner| Refusal::Locked {
            asks,
            owner,
            checks,
        };
        self.refusal = self.agreed.master.map(refused);
    }

    fn take_tsdr(&mut self, bits: u8) {
        if bits != 0 {
            self.min_tsdr = bits.max(default_tsdr());
        }
    }

    fn agree(&mut self, at: Instant, sa: u8, prm: &SetPrm<'_>) {
        self.state = DpState::WaitCfg;
        self.agreed = Agreement {
            master: Some(sa),
            watchdog: prm.watchdog_tens_of_ms().map(|tens| {
                let time = Span::from_millis(10) * u64::from(tens);
                Watchdog {
                    time,
                    expires: at + time,
                }
            }),
            group: prm.group,
            sync: prm.has(SetPrm::SYNC),
            freeze: prm.has(SetPrm::FREEZE),
        };
    }

    pub(super) fn check_configuration(&mut self, sa: u8, data: &[u8]) -> Outcome {
        if self.state == DpState::WaitPrm {
            if !self.prm_fault && !self.cfg_fault {
                self.refusal = Some(Refusal::Early);
            }
            return match self.properties.chk_cfg_early {
                ChkCfgEarly::Rs => Outcome::Refused,
                ChkCfgEarly::Sc => Outcome::Confirmed,
            };
        }
        if !self.is_own_master(sa) {
            self.refuse_master(sa, true);
            return Outcome::Refused;
        }
        self.refusal = None;
        match self.configuration(data) {
            Some(ppo) if self.state == DpState::DataExch && ppo == self.ppo => {
                self.cfg_fault = false;
            }
            Some(ppo) => {
                self.cfg_fault = false;
                self.ppo = ppo;
                self.state = DpState::DataExch;
                self.data.start();
            }
            None => {
                self.wait_for_parameters();
                self.cfg_fault = true;
                self.refusal = Some(Refusal::configuration(data, self.settings.ppo));
            }
        }
        Outcome::Confirmed
    }

    /// The PPO type of a configuration that the slave accepts.
    fn configuration(&self, data: &[u8]) -> Option<PpoType> {
        let any = self.properties.cfg_follows_ppo_type == CfgFollowsPpoType::AnyPpo;
        PpoType::ALL
            .into_iter()
            .find(|ppo| ppo.cfg() == data && (any || *ppo == self.settings.ppo))
    }

    /// The diagnosis as it is now.
    #[must_use]
    pub fn diagnosis(&self) -> Diagnosis {
        let bits = |bits: &[(u8, bool)]| {
            let set = bits.iter().filter(|(_, is)| *is);
            set.fold(0, |all, (bit, _)| all | bit)
        };
        let one = bits(&[
            (Diagnosis::NOT_READY, self.state != DpState::DataExch),
            (Diagnosis::CFG_FAULT, self.cfg_fault),
            (Diagnosis::EXT_DIAG, self.apart.is_some()),
            (Diagnosis::PRM_FAULT, self.prm_fault),
        ]);
        let two = bits(&[
            (Diagnosis::ALWAYS, true),
            (Diagnosis::PRM_REQ, self.state == DpState::WaitPrm),
            (Diagnosis::WD_ON, self.agreed.watchdog.is_some()),
            (Diagnosis::FREEZE, self.data.is_frozen()),
            (Diagnosis::SYNC, self.data.is_synchronised()),
        ]);
        let extension = match (self.apart, self.properties.ext_diag) {
            (Some(_), _) => Some(ACTUAL_VALUE_STANDS),
            (None, ExtDiag::Always) => Some(0),
            (None, ExtDiag::WhenPresent) => None,
        };
        Diagnosis {
            status: [one, two, 0],
            master: self.agreed.master,
            ident: IDENT,
            extension,
        }
    }
}
