//! A link that notes which parameters are written, what comes, and how late computer and adapter are.

use crate::link::{Capability, Lead, Line, Link, Moment, PlacedFault, Trouble};
use crate::medium::{Heard, Medium, Out};
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::nordac::{Image, Pkw, PpoType, Task};
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::{Buffer, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::any::Any;
use std::collections::BTreeSet;

/// A link to inverters, observed. Its notes follow from what the link shows, so that a record gives the same ones.
pub(super) struct Observed<'l> {
    link: &'l mut dyn Link,
    /// By how much a wait has ended late, at most.
    late: Span,
    /// The parameters that telegrams may have written: station, number and IND.
    written: BTreeSet<(u8, u16, u16)>,
    /// When the last telegram had left.
    asked: Option<Instant>,
    /// The octets that have come since.
    reply: Buffer,
    /// The longest time from the end of a request until the bench had read its whole reply, beside the reply's own time on the line.
    longest: Span,
    /// How the link is made worse; `None` for the link as it is.
    slow: Option<Slow>,
    /// How often something was sent.
    sent: u32,
    /// How many octets were received, and a checksum of them (FNV-1a).
    heard: (usize, u32),
}

/// What an adapter and a busy computer may do to telegrams.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slow {
    /// How late a telegram leaves.
    pub(super) by: Span,
    /// Which of two telegrams is late: 0 and 1 for one of them, 2 for both.
    pub(super) which: u32,
    /// How exact times are compared.
    pub(super) tolerance: Span,
}

impl<'l> Observed<'l> {
    pub(super) fn new(link: &'l mut dyn Link) -> Self {
        Self {
            link,
            late: Span::ZERO,
            written: BTreeSet::new(),
            asked: None,
            reply: Buffer::new(),
            longest: Span::ZERO,
            slow: None,
            sent: 0,
            heard: (0, 0x811C_9DC5),
        }
    }

    /// The link made worse, for a rehearsal.
    pub(super) const fn slowed(mut self, slow: Option<Slow>) -> Self {
        self.slow = slow;
        self
    }

    /// Sends a telegram later than it should be.
    fn send_late(&mut self, port: usize, what: Out<'_>, slow: Slow) -> Instant {
        self.sent += 1;
        if slow.which > 1 || self.sent % 2 == slow.which {
            let until = self.link.now() + slow.by;
            while self.link.now() < until && self.link.trouble().is_none() {
                self.link.wait(until);
            }
        }
        self.link.send(port, what)
    }

    /// By how much a wait has ended late since the last call, at most.
    pub(super) fn take_late(&mut self) -> Span {
        std::mem::take(&mut self.late)
    }

    /// The parameters that may have been written: station, number and IND.
    pub(super) fn written(&self) -> impl Iterator<Item = (u8, u16, u16)> {
        self.written.iter().copied()
    }

    /// The longest time that a reply took beside its own time on the line.
    pub(super) const fn longest(&self) -> Span {
        self.longest
    }

    /// What was received so far, in words: how many octets, and their checksum.
    pub(super) fn received(&self) -> String {
        let (octets, sum) = self.heard;
        format!("{octets} octets from the slaves, checksum {sum:08X}")
    }

    /// A telegram was sent. In every layout that its length fits, its parameter channel may write.
    fn note(&mut self, octets: &[u8], end: Instant) {
        self.asked = Some(end);
        self.reply.clear();
        let telegram = Telegram::decode(octets).value();
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

    fn hear(&mut self, octet: Received) {
        self.heard.0 += 1;
        let bits = u32::from(octet.byte) | u32::from(octet.error.is_some()) << 8;
        self.heard.1 = (self.heard.1 ^ bits).wrapping_mul(0x0100_0193);
        let Some(asked) = self.asked else { return };
        let _too_long = self.reply.push(octet.byte);
        if let Decoded::Value { used, .. } = Telegram::decode(&self.reply) {
            let own = self.link.medium(0).octet_time() * used as u64;
            let took = self.link.now().since(asked).saturating_sub(own);
            self.longest = self.longest.max(took);
            self.asked = None;
        }
    }
}

impl Line for Observed<'_> {
    fn medium(&self, port: usize) -> Medium {
        self.link.medium(port)
    }

    fn now(&self) -> Instant {
        self.link.now()
    }

    fn send(&mut self, port: usize, what: Out<'_>) -> Instant {
        let end = match self.slow {
            Some(slow) => self.send_late(port, what, slow),
            None => self.link.send(port, what),
        };
        self.note(what.octets(), end);
        end
    }

    fn permits(&self, port: usize, what: Out<'_>) -> bool {
        self.link.permits(port, what)
    }

    fn denied(&self, port: usize, what: Out<'_>) -> Option<String> {
        self.link.denied(port, what)
    }

    fn refused(&self) -> usize {
        self.link.refused()
    }

    fn receive(&mut self, port: usize) -> Option<(Instant, Heard)> {
        let (at, heard) = self.link.receive(port)?;
        if let Heard::Octet(octet) = heard {
            self.hear(octet);
        }
        Some((at, heard))
    }

    fn wait(&mut self, until: Instant) -> bool {
        let more = self.link.wait(until);
        self.late = self.late.max(self.link.now().since(until));
        more
    }

    fn trouble(&self) -> Option<&Trouble> {
        self.link.trouble()
    }

    fn pause_due(&self) -> Option<Instant> {
        self.link.pause_due()
    }

    fn pause(&mut self) {
        self.link.pause();
    }

    fn lead(&self) -> Lead {
        self.link.lead()
    }
}

impl Link for Observed<'_> {
    fn capabilities(&self) -> &[Capability] {
        self.link.capabilities()
    }

    fn begin(&mut self) {
        self.link.begin();
        self.asked = None;
        self.reply.clear();
    }

    fn step(&mut self, place: usize) {
        self.link.step(place);
    }

    fn busy(&self) -> bool {
        self.link.busy()
    }

    fn inject(&mut self, port: usize, fault: PlacedFault, moment: Moment) {
        self.link.inject(port, fault, moment);
    }

    fn reaches(&self, port: usize, link: usize) -> bool {
        self.link.reaches(port, link)
    }

    fn listens(&self, port: usize, link: usize) -> bool {
        self.link.listens(port, link)
    }

    fn tapped(&mut self, port: usize, link: usize) -> Option<Vec<Received>> {
        self.link.tapped(port, link)
    }

    fn time_tolerance(&self) -> Span {
        let slow = self.slow.map(|slow| slow.tolerance);
        slow.unwrap_or_else(|| self.link.time_tolerance())
    }

    fn beside(&self) -> Option<&dyn Any> {
        self.link.beside()
    }

    fn unused_faults(&self) -> Vec<String> {
        self.link.unused_faults()
    }

    fn carried(&self) -> u64 {
        self.link.carried()
    }

    fn drives(&self, port: usize) -> u8 {
        self.link.drives(port)
    }

    fn trace(&self, port: usize) -> Trace {
        self.link.trace(port)
    }
}
