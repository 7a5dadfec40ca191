//! What is noted of a link to NORDAC inverters: which parameters are written, and how late replies come.

use crate::medium::{Heard, Medium, Out};
use crate::rig::segment::observed::{LinkNotes, ReceivedSum};
use harness_proto::decode::Decoded;
use harness_proto::nordac::{Image, Pkw, PpoType, Task};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::{Buffer, Telegram};
use harness_proto::time::{Instant, Span};
use std::collections::BTreeSet;

/// A link to inverters, observed.
pub(super) type Observed<'l> = crate::rig::segment::observed::Observed<'l, TelegramNotes>;

/// What was noted.
#[derive(Default)]
pub(super) struct TelegramNotes {
    /// The parameters that telegrams may have written: station, number and IND.
    pub(super) written: BTreeSet<(u8, u16, u16)>,
    /// When the last telegram had left.
    asked: Option<Instant>,
    /// The octets that have come since.
    reply: Buffer,
    /// The longest time from the end of a request until the bench had read its whole reply, beside the reply's own time on the line.
    pub(super) longest: Span,
    /// How many octets were received, and their checksum.
    heard: ReceivedSum,
}

impl TelegramNotes {
    /// What was received so far, in words.
    pub(super) fn received(&self) -> String {
        let ReceivedSum { pieces, sum } = self.heard;
        format!("{pieces} octets from the slaves, checksum {sum:08X}")
    }
}

impl LinkNotes for TelegramNotes {
    /// A telegram was sent. In every layout that its length fits, its parameter channel may write.
    fn sent(&mut self, what: Out<'_>, end: Instant) {
        self.asked = Some(end);
        self.reply.clear();
        let telegram = Telegram::decode(what.octets()).value();
        let Some(pdu) = telegram.as_ref().and_then(Telegram::pdu) else {
            return;
        };
        if Service::of(pdu.dsap()) != Some(Service::DataExchange) {
            return;
        }
        let images = PpoType::ALL.into_iter().filter(|own| own.has_pkw());
        for image in images.filter_map(|ppo| Image::decode(ppo, pdu.data())) {
            let Pkw { ind, .. } = image.pkw;
            let changes = image.pkw.task().is_change();
            if changes && image.pkw.task() != Task::ChangeDescription {
                self.written.insert((pdu.da(), image.pkw.number(), ind));
            }
        }
    }

    fn heard(&mut self, medium: Medium, _: Instant, now: Instant, heard: Heard) {
        let Heard::Octet(octet) = heard else { return };
        self.heard.pieces += 1;
        let bits = u32::from(octet.byte) | u32::from(octet.error.is_some()) << 8;
        self.heard.add(bits);
        let Some(asked) = self.asked else { return };
        let _too_long = self.reply.push(octet.byte);
        if let Decoded::Value { used, .. } = Telegram::decode(&self.reply) {
            let own = medium.octet_time() * used as u64;
            let took = now.since(asked).saturating_sub(own);
            self.longest = self.longest.max(took);
            self.asked = None;
        }
    }

    fn begin(&mut self) {
        self.asked = None;
        self.reply.clear();
    }
}
