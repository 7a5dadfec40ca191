//! The process image of a slave: inputs and outputs, Sync and Freeze (EN 2, NORDAC 3.1).

use super::super::inverter::{Inverter, InverterInputs, Outputs};
use super::channel::PkwChannel;
use super::{Outcome, Slave};
use harness_proto::nordac::Image;
use harness_proto::nordac::properties::{LeaveDxWrongLength, RdInpUnderFreeze, SyncWithoutRequest};
use harness_proto::profibus::Buffer;
use harness_proto::profibus::dp::{DpState, GlobalControl};
use harness_proto::time::Instant;

/// Inputs and outputs, and what Sync and Freeze keep of them.
#[derive(Clone, Debug, Default, Hash)]
pub(super) struct ProcessData {
    channel: PkwChannel,
    /// The outputs that are effective.
    outputs: Image,
    /// The outputs that wait for the next Sync or Unsync.
    stored: Option<Image>,
    synchronised: bool,
    /// The inputs of the last Freeze.
    frozen: Option<Image>,
    /// Process words of former exchanges, the oldest first, where replies show these.
    former: Vec<InverterInputs>,
}

impl ProcessData {
    /// Data_Exch begins: task and answer are zero.
    pub(super) fn start(&mut self) {
        self.channel = PkwChannel::default();
        self.outputs = Image::default();
        self.stored = None;
        self.former.clear();
    }

    pub(super) const fn is_frozen(&self) -> bool {
        self.frozen.is_some()
    }

    pub(super) const fn is_synchronised(&self) -> bool {
        self.synchronised
    }
}

impl Slave {
    /// Data_Exchange: the reply shows the inputs as they were before the outputs of the request.
    pub(super) fn exchange(
        &mut self,
        at: Instant,
        sa: u8,
        data: &[u8],
        inverter: &mut Inverter,
    ) -> Outcome {
        if self.state != DpState::DataExch || !self.is_own_master(sa) {
            return Outcome::Refused;
        }
        let Some(outputs) = Image::decode(self.ppo, data) else {
            if self.properties.leave_dx_wrong_length == LeaveDxWrongLength::RsAndWaitPrm {
                self.wait_for_parameters();
            }
            return Outcome::Refused;
        };
        let inputs = self.next_inputs(at, inverter);
        if self.data.synchronised {
            self.data.stored = Some(outputs);
        } else {
            self.deliver(at, outputs, inverter);
        }
        Outcome::Inputs(inputs.encode(self.ppo))
    }

    /// The inputs for the reply to an exchange.
    fn next_inputs(&mut self, at: Instant, inverter: &Inverter) -> Image {
        if let Some(kept) = self.apart {
            return self.data.frozen.unwrap_or(kept);
        }
        self.data.channel.turn();
        let mut inputs = self.inputs(at, inverter);
        let former = usize::from(self.properties.pzd_latency).saturating_sub(1);
        if former > 0 {
            let now = inverter.inputs(at);
            self.data.former.push(now);
            if self.data.former.len() > former + 1 {
                self.data.former.remove(0);
            }
            inputs.words = words(self.data.former.first().copied().unwrap_or(now));
        }
        self.data.frozen.unwrap_or(inputs)
    }

    /// The inputs at this moment.
    pub(super) fn inputs(&self, at: Instant, inverter: &Inverter) -> Image {
        self.apart.unwrap_or_else(|| Image {
            pkw: self.data.channel.answer(at, inverter, self.ppo),
            words: words(inverter.inputs(at)),
        })
    }

    /// RD_Inp.
    pub(super) fn read_inputs(&self, at: Instant, inverter: &Inverter) -> Buffer {
        let live = self.properties.rd_inp_under_freeze == RdInpUnderFreeze::Live;
        let frozen = self.data.frozen.filter(|_| !live);
        frozen
            .unwrap_or_else(|| self.inputs(at, inverter))
            .encode(self.ppo)
    }

    /// RD_Outp.
    pub(super) fn read_outputs(&self) -> Buffer {
        self.data.outputs.encode(self.ppo)
    }

    /// Outputs become effective. The inverter gets nothing while it and the module are apart.
    fn deliver(&mut self, at: Instant, outputs: Image, inverter: &mut Inverter) {
        self.data.outputs = outputs;
        if self.apart.is_some() {
            return;
        }
        if self.ppo.has_pkw() {
            self.data
                .channel
                .take(at, outputs.pkw, inverter, self.ppo, &self.properties);
        }
        let [stw, hsw, pzd3, pzd4, ..] = outputs.words;
        let outputs = Outputs {
            stw,
            hsw,
            pzd3,
            pzd4,
        };
        inverter.take(at, &outputs);
    }

    /// Global_Control of the own master to the own group.
    pub(super) fn control(&mut self, at: Instant, command: GlobalControl, inverter: &mut Inverter) {
        let unasked = self.properties.sync_without_request == SyncWithoutRequest::Obeyed;
        if command.has(GlobalControl::CLEAR_DATA) {
            self.data.stored = None;
            self.deliver(at, Image::default(), inverter);
        }
        if command.has(GlobalControl::UNFREEZE) {
            self.data.frozen = None;
        } else if command.has(GlobalControl::FREEZE) && (self.agreed.freeze || unasked) {
            self.data.frozen = Some(self.inputs(at, inverter));
        }
        let released = if command.has(GlobalControl::UNSYNC) {
            self.data.synchronised = false;
            true
        } else {
            let sync = command.has(GlobalControl::SYNC) && (self.agreed.sync || unasked);
            self.data.synchronised |= sync;
            sync
        };
        if released && let Some(stored) = self.data.stored.take() {
            self.deliver(at, stored, inverter);
        }
    }
}

/// The process words of a reply: PZD5 and PZD6 are 0.
const fn words(inputs: InverterInputs) -> [u16; 6] {
    [inputs.zsw, inputs.hiw, inputs.pzd3, inputs.pzd4, 0, 0]
}
