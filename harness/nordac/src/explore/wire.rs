//! Requests of a master to one slave, as acts.

use super::act::{Count, Request, TelegramAct, TelegramActKind};
use harness_proto::nordac::{IDENT, Image, Pkw, PpoType};
use harness_proto::profibus::dp::{GlobalControl, Service, SetPrm};
use harness_proto::profibus::fdl::FcFunction;

/// The master that starts the slave.
pub(super) const OWN: u8 = 2;

/// A master and a slave.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wire {
    pub(super) slave: u8,
    pub(super) ppo: PpoType,
    pub(super) master: u8,
}

impl From<(u8, PpoType)> for Wire {
    fn from((slave, ppo): (u8, PpoType)) -> Self {
        Self {
            slave,
            ppo,
            master: OWN,
        }
    }
}

impl Wire {
    /// Any request, with its data.
    pub(super) fn request(self, function: FcFunction, service: Service, data: &[u8]) -> Request {
        let sap = service.sap();
        Request {
            da: self.slave,
            sa: self.master,
            function: function.code(),
            count: Count::Next,
            saps: sap.zip(service.master_sap()),
            data: data.to_vec(),
            harm: None,
        }
    }

    fn act(self, service: Service, data: &[u8]) -> TelegramAct {
        let function = match service {
            Service::DataExchange => FcFunction::SrdHigh,
            _ => FcFunction::SrdLow,
        };
        TelegramAct::new(
            TelegramActKind::Ask(self.request(function, service, data)),
            0,
        )
    }

    /// A service that only reads.
    pub(super) fn reads(self, service: Service) -> TelegramAct {
        self.act(service, &[])
    }

    /// Set_Prm with these bits of its status besides Lock, and with these watchdog factors.
    pub(super) fn parameters(
        self,
        bits: u8,
        watchdog: [u8; 2],
        min_tsdr: u8,
        group: u8,
    ) -> TelegramAct {
        let mut parameters = SetPrm::lock(IDENT);
        parameters.status |= bits;
        parameters.watchdog = watchdog;
        parameters.min_tsdr = min_tsdr;
        parameters.group = group;
        self.act(Service::SetPrm, &parameters.encode().unwrap_or_default())
    }

    /// Chk_Cfg with the slave's own configuration.
    pub(super) fn configuration(self) -> TelegramAct {
        self.act(Service::ChkCfg, self.ppo.cfg())
    }

    /// Any octets to a service.
    pub(super) fn raw(self, service: Service, data: &[u8]) -> TelegramAct {
        self.act(service, data)
    }

    /// Global_Control to this station.
    pub(super) fn control(self, da: u8, command: u8, group: u8) -> TelegramAct {
        let mut request = self.request(
            FcFunction::SdnHigh,
            Service::GlobalControl,
            &GlobalControl { command, group }.encode(),
        );
        request.da = da;
        request.count = Count::Without;
        TelegramAct::new(TelegramActKind::Ask(request), 0)
    }

    /// A Data_Exchange.
    pub(super) fn exchange(self, words: [u16; 6], pkw: Pkw) -> TelegramAct {
        self.act(
            Service::DataExchange,
            &Image { pkw, words }.encode(self.ppo),
        )
    }
}
