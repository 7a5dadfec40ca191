//! The replies on the line, read along with what is sent.

use crate::decode::Decoded;
use crate::profibus::fdl::FcStatus;
use crate::profibus::{Buffer, Pdu, Telegram};

/// The reply to the last request, as far as it has come.
#[derive(Clone, Debug, Default)]
pub(super) struct Ear {
    asked: Option<Pdu>,
    came: Buffer,
}

impl Ear {
    /// An octet was sent, perhaps the last but one of a request. It ends what was received.
    pub(super) fn ask(&mut self, request: Option<&Pdu>) {
        if let Some(request) = request {
            self.asked = Some(*request).filter(|request| request.fc().is_request());
        }
        self.came.clear();
    }

    /// An octet was received. Gives the last request and what replies to it, data or RS, once it is whole.
    pub(super) fn hear(&mut self, octet: Option<u8>) -> Option<(Pdu, Pdu)> {
        let asked = self.asked?;
        if !octet.is_some_and(|octet| self.came.push(octet)) {
            self.asked = None;
            return None;
        }
        let reply = match Telegram::decode(&self.came) {
            Decoded::NeedMore => return None,
            Decoded::Value { value, .. } => value.pdu().copied(),
            Decoded::Bad { .. } => None,
        };
        // A request has one reply, which begins with the first octet.
        self.asked = None;
        let reply = reply?;
        let answers = (reply.sa(), reply.da()) == (asked.da(), asked.sa());
        let known = matches!(
            reply.fc().status(),
            Some(FcStatus::DataLow | FcStatus::DataHigh | FcStatus::Rs)
        );
        (answers && known).then_some((asked, reply))
    }
}
