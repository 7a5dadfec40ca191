//! Telegrams taken apart, to be changed and put together again.

use harness_proto::nordac::{Image, Pkw, PpoType};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::fdl::{FrameControl, check_sum};
use harness_proto::profibus::{Pdu, Telegram};

/// A telegram with addresses and FC.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    pub(super) da: u8,
    pub(super) sa: u8,
    pub(super) fc: u8,
    pub(super) dsap: Option<u8>,
    pub(super) ssap: Option<u8>,
    pub(super) data: Vec<u8>,
    /// How many times the drive hears it.
    pub(super) times: usize,
    /// Telegrams that the drive hears before it.
    pub(super) before: Vec<Parts>,
}

impl Parts {
    pub(super) fn of(pdu: &Pdu) -> Self {
        Self {
            da: pdu.da(),
            sa: pdu.sa(),
            fc: pdu.fc().0,
            dsap: pdu.dsap(),
            ssap: pdu.ssap(),
            data: pdu.data().to_vec(),
            times: 1,
            before: Vec::new(),
        }
    }

    pub(super) fn telegram(&self) -> Option<Telegram> {
        let control = FrameControl(self.fc);
        let pdu = Pdu::with_saps(self.da, self.sa, control, self.dsap, self.ssap, &self.data);
        pdu.ok().map(Telegram::Pdu)
    }

    /// The service that SRD or SDN asks for.
    pub(super) fn service(&self) -> Option<Service> {
        let function = FrameControl(self.fc).function()?;
        (function.is_srd() || function.is_sdn())
            .then(|| Service::of(self.dsap))
            .flatten()
    }

    pub(super) fn is(&self, service: Service) -> bool {
        self.service() == Some(service)
    }

    /// The process data of a Data_Exchange.
    pub(super) fn image(&self, ppo: PpoType) -> Option<Image> {
        let exchanges = self.is(Service::DataExchange) && self.ssap.is_none();
        exchanges.then(|| Image::decode(ppo, &self.data)).flatten()
    }

    /// Changes the process data of a Data_Exchange.
    pub(super) fn outputs(&mut self, ppo: PpoType, change: impl FnOnce(&mut Image)) {
        if let Some(mut image) = self.image(ppo) {
            change(&mut image);
            self.data = image.encode(ppo).to_vec();
        }
    }

    /// Changes the control word of a Data_Exchange that is valid.
    pub(super) fn control_word(&mut self, ppo: PpoType, change: impl FnOnce(u16) -> u16) {
        self.outputs(ppo, |image| image.words[0] = change(image.words[0]));
    }

    /// Changes the task of a Data_Exchange.
    pub(super) fn task(&mut self, ppo: PpoType, change: impl FnOnce(&mut Pkw)) {
        self.outputs(ppo, |image| change(&mut image.pkw));
    }

    /// Changes the data of Set_Prm, if there are 7 octets at least.
    pub(super) fn prm(&mut self, change: impl FnOnce(&mut Vec<u8>)) {
        if self.is(Service::SetPrm) && self.data.len() >= 7 {
            change(&mut self.data);
        }
    }

    /// Changes the command and the group of Global_Control.
    pub(super) fn control(&mut self, change: impl FnOnce(&mut u8, &mut u8)) {
        if self.is(Service::GlobalControl)
            && let [command, group] = &mut self.data[..]
        {
            change(command, group);
        }
    }

    /// Makes it a request that is new in any case.
    pub(super) fn as_new(&mut self) {
        self.fc = self.fc & 0x4F | 0x20;
    }
}

#[derive(Clone, Debug)]
pub(super) struct Reply {
    /// Its octets; none for no reply.
    pub(super) octets: Vec<u8>,
    /// How many bits it begins after the request.
    pub(super) delay: u64,
    /// How many times it is sent.
    pub(super) times: u64,
}

impl Reply {
    fn parts(&self) -> Option<Parts> {
        let telegram = Telegram::decode(&self.octets).value()?;
        telegram.pdu().map(Parts::of)
    }

    /// Changes it, if it has addresses and FC.
    pub(super) fn edit(&mut self, change: impl FnOnce(&mut Parts)) {
        if let Some(mut parts) = self.parts() {
            change(&mut parts);
            if let Some(telegram) = parts.telegram() {
                self.octets = telegram.encode().to_vec();
            }
        }
    }

    /// Changes its data, if it has any.
    pub(super) fn data(&mut self, change: impl FnOnce(&mut Vec<u8>)) {
        self.edit(|parts| {
            if !parts.data.is_empty() {
                change(&mut parts.data);
            }
        });
    }

    /// Changes a diagnosis, if that was asked for.
    pub(super) fn diagnosis(&mut self, request: &Parts, change: impl FnOnce(&mut Vec<u8>)) {
        if request.is(Service::SlaveDiag) {
            self.data(|data| {
                if data.len() >= 6 {
                    change(data);
                }
            });
        }
    }

    /// Changes its octets as they are, FCS included.
    pub(super) fn raw(&mut self, change: impl FnOnce(&mut Vec<u8>)) {
        if !self.octets.is_empty() {
            change(&mut self.octets);
        }
    }

    /// Replaces it by SD1 with this FC, from and to these stations.
    pub(super) fn plain(&mut self, da: u8, sa: u8, fc: u8) {
        self.octets = vec![0x10, da, sa, fc, check_sum(&[da, sa, fc]), 0x16];
    }

    /// Whether it is "no service activated".
    pub(super) fn is_refused(&self) -> bool {
        matches!(*self.octets, [0x10, _, _, 3, ..])
    }

    /// The inputs, if it is the reply to a Data_Exchange.
    pub(super) fn image(&self, ppo: PpoType) -> Option<Image> {
        let parts = self.parts()?;
        let exchanges = parts.dsap.is_none() && !parts.data.is_empty();
        exchanges.then(|| Image::decode(ppo, &parts.data)).flatten()
    }

    /// Changes the inputs, if it is the reply to a Data_Exchange.
    pub(super) fn inputs(&mut self, ppo: PpoType, change: impl FnOnce(&mut Image)) {
        if let Some(mut image) = self.image(ppo) {
            change(&mut image);
            self.data(|data| *data = image.encode(ppo).to_vec());
        }
    }

    /// Changes the status word.
    pub(super) fn status_word(&mut self, ppo: PpoType, change: impl FnOnce(u16) -> u16) {
        self.inputs(ppo, |image| image.words[0] = change(image.words[0]));
    }

    /// Changes the answer of the parameter channel, if there is one.
    pub(super) fn answer(&mut self, ppo: PpoType, change: impl FnOnce(&mut Pkw)) {
        self.inputs(ppo, |image| {
            if image.pkw.ak() != 0 {
                change(&mut image.pkw);
            }
        });
    }
}
