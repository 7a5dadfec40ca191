//! The physical layer of the master: a [`Line`] as profirust sees it.
//!
//! The bench is the only master of its segment. So requests for other masters (FDL status of unused addresses, EN 1) stay off the line, and
//! their slot time passes at once. A telegram reaches the master only if it is whole and replies to the last
//! request; the standard's own checks are done here, by the codec of this bench.

use super::error::Error;
use harness_bench::link::Line;
use harness_bench::medium::{HeardPiece, Out};
use harness_proto::decode::Decoded;
use harness_proto::line::Received;
use harness_proto::profibus::dp::{Diagnosis, Service};
use harness_proto::profibus::fdl::{FcFunction, FcStatus, MAX_TELEGRAM};
use harness_proto::profibus::rate::{OCTET_BITS, SYN_BITS};
use harness_proto::profibus::{BusRate, Pdu, Telegram};
use harness_proto::time::{Instant, Span};
use profirust::phy::ProfibusPhy;
use profirust::time;

/// What a driver needs to know of its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Timing {
    pub(crate) rate: BusRate,
    /// How long a reply may take until it is whole, from the end of its request: what the line and the bench need, the adapter among it.
    pub(crate) patience: Span,
    /// How much later a reply may still come. So long passes after a request without a reply, or the next one would be given that reply.
    pub(crate) late: Span,
    /// How often the master looks at the line while nothing arrives; a line in virtual time needs no more than the default.
    pub(crate) step: Span,
}

impl Timing {
    /// The longest slot time that the master counts. Where the patience is longer, its clock runs slower while it waits for a reply.
    pub(crate) const MOST_BITS: u16 = u16::MAX;

    /// That of a line in virtual time: the slave's longest delay and its longest reply.
    #[must_use]
    pub(crate) fn simulated(rate: BusRate) -> Self {
        let longest = rate.max_tsdr_bits() + SYN_BITS + OCTET_BITS * LONGEST_REPLY;
        Self {
            rate,
            patience: rate.bit_time() * longest,
            late: Span::ZERO,
            step: Span::ZERO,
        }
    }

    pub(super) fn slot_bits(self) -> u16 {
        let bits = self.patience.units() / self.rate.bit_time().units().max(1);
        // The master takes no shorter slot at the highest rate.
        u16::try_from(bits).unwrap_or(Self::MOST_BITS).max(400)
    }

    pub(super) fn slot_time(self) -> Span {
        self.rate.bit_time() * u64::from(self.slot_bits())
    }

    /// How much of the time for which a reply is awaited the clock of the master leaves out: it counts no more than its slot time.
    fn left_out(self, waited: Span) -> Span {
        let (slot, patience) = (self.slot_time().units(), self.patience.units());
        if patience <= slot {
            return Span::ZERO;
        }
        let counted = u128::from(waited.units()) * u128::from(slot) / u128::from(patience);
        waited.saturating_sub(Span::from_units(u64::try_from(counted).unwrap_or(u64::MAX)))
    }

    /// The time between two looks: a little more than the idle time in front of a request.
    fn grain(self) -> Span {
        let idle = self.rate.bit_time() * (SYN_BITS + 2);
        idle.max(self.step).max(Span::from_micros(1))
    }
}

/// Octets of the longest reply: 20 octets of data in an SD2 telegram with SAPs.
const LONGEST_REPLY: u64 = 32;

/// A line, and what the master has under way on it.
pub(super) struct MasterLine<'l> {
    line: Box<dyn Line + 'l>,
    timing: Timing,
    master: u8,
    /// When the last octet that was sent will have left.
    left: Instant,
    /// The request that waits for a reply.
    asked: Option<Pdu>,
    /// Octets received that are no whole telegram yet.
    begun: Vec<u8>,
    reply: Vec<u8>,
    /// How far the master's clock is ahead of the line's.
    ahead: Span,
    /// What it has left out while it waited for replies that are there.
    behind: Span,
    /// What cannot go on: the line does not carry a telegram, or belongs to another master.
    failed: Option<Error>,
    /// The last diagnosis, and the last service that its slave has answered with RS.
    pub(super) diagnosis: Option<Diagnosis>,
    pub(super) not_activated: Option<Service>,
}

impl<'l> MasterLine<'l> {
    pub(super) fn new(line: Box<dyn Line + 'l>, timing: Timing, master: u8) -> Self {
        let left = line.now();
        Self {
            line,
            timing,
            master,
            left,
            asked: None,
            begun: Vec::new(),
            reply: Vec::new(),
            ahead: Span::ZERO,
            behind: Span::ZERO,
            failed: None,
            diagnosis: None,
            not_activated: None,
        }
    }

    pub(super) fn line_mut(&mut self) -> &mut dyn Line {
        self.line.as_mut()
    }

    pub(super) fn line(&self) -> &dyn Line {
        &*self.line
    }

    /// The wire over another handle of the line.
    pub(super) fn onto<'b>(self, line: Box<dyn Line + 'b>) -> MasterLine<'b> {
        MasterLine {
            line,
            timing: self.timing,
            master: self.master,
            left: self.left,
            asked: self.asked,
            begun: self.begun,
            reply: self.reply,
            ahead: self.ahead,
            behind: self.behind,
            failed: self.failed,
            diagnosis: self.diagnosis,
            not_activated: self.not_activated,
        }
    }

    pub(super) fn clock(&self) -> time::Instant {
        let now = self.line.now();
        let left_out = self.behind + self.left_out(now);
        let time = (now.since_start() + self.ahead).saturating_sub(left_out);
        let micros = time.as_nanos() / 1000;
        time::Instant::from_micros(i64::try_from(micros).unwrap_or(i64::MAX))
    }

    /// What the master's clock leaves out of the time since the present request.
    fn left_out(&self, now: Instant) -> Span {
        match self.asked {
            Some(_) if now > self.left => self.timing.left_out(now.since(self.left)),
            _ => Span::ZERO,
        }
    }

    /// The reply that is awaited is there, or no longer awaited.
    fn answered(&mut self) {
        self.behind = self.behind + self.left_out(self.line.now());
        self.asked = None;
    }

    /// The station whose reply is awaited.
    pub(super) fn awaits(&self) -> Option<u8> {
        self.asked.map(|asked| asked.da())
    }

    /// Forgets the request that waits.
    pub(super) fn forget(&mut self) {
        self.answered();
        self.begun.clear();
        self.reply.clear();
    }

    /// Why nothing more can be done on this line.
    pub(super) fn check(&mut self) -> Result<(), Error> {
        match (self.failed.take(), self.line.trouble()) {
            (_, Some(trouble)) => Err(Error::Link(trouble.clone())),
            (Some(error), None) => Err(error),
            (None, None) => Ok(()),
        }
    }

    /// Lets time pass until something is received, the master is to look again, or `end`.
    pub(super) fn wait(&mut self, end: Instant) {
        let now = self.line.now();
        let next = if now < self.left {
            self.left
        } else if self.reply.is_empty() {
            now + self.timing.grain()
        } else {
            // The master takes the reply, at the latest one of its microseconds later.
            now + Span::from_micros(1)
        };
        let _nothing_comes = self.line.wait(next.min(end));
        self.receive();
    }

    /// Asks a slave once beside the master, and returns its reply; `None` if there is none. The master has nothing under way.
    pub(super) fn ask(&mut self, request: Pdu) -> Result<Option<Telegram>, Error> {
        let idle = self.timing.rate.bit_time() * SYN_BITS;
        let ready = self.left.max(self.line.now()) + idle;
        while self.line.now() < ready && self.line.trouble().is_none() {
            let _nothing_comes = self.line.wait(ready);
            self.receive();
        }
        self.send(&Telegram::Pdu(request).encode());
        let end = self.left + self.timing.slot_time().max(self.timing.patience);
        while self.reply.is_empty() && self.line.now() < end {
            self.check()?;
            let _nothing_comes = self.line.wait(end);
            self.receive();
        }
        self.check()?;
        self.answered();
        let reply = std::mem::take(&mut self.reply);
        Ok(Telegram::decode(&reply).value())
    }

    fn send(&mut self, octets: &[u8]) {
        // What was received before a request is no reply to it.
        self.receive();
        self.begun.clear();
        self.reply.clear();
        let request = Telegram::decode(octets).value();
        let pdu = request.as_ref().and_then(Telegram::pdu).copied();
        let function = pdu.and_then(|pdu| pdu.fc().function());
        if function == Some(FcFunction::FdlStatus) {
            let sent = self.timing.rate.octet_time() * octets.len() as u64;
            // A microsecond more for each time that the master rounds.
            self.ahead = self.ahead + sent + self.timing.slot_time() + Span::from_micros(4);
            return;
        }
        self.let_pass_what_is_late();
        self.asked = pdu.filter(|_| function.is_some_and(FcFunction::is_srd));
        self.left = self.line.send(0, Out::Octets(octets));
        if self.line.refused() > 0 && self.line.trouble().is_none() {
            self.failed = Some(Error::NotSent);
        }
    }

    /// Lets the time pass in which the reply that is still awaited may come. The master's clock leaves it out.
    fn let_pass_what_is_late(&mut self) {
        let unanswered = self.asked.is_some();
        self.answered();
        let begin = self.line.now();
        let end = begin + self.timing.late;
        while unanswered && self.line.now() < end && self.line.trouble().is_none() {
            let _nothing_comes = self.line.wait(end);
            self.receive();
        }
        self.begun.clear();
        self.behind = self.behind + self.line.now().since(begin);
    }

    pub(super) fn receive(&mut self) {
        while let Some((_, heard)) = self.line.receive(0) {
            if let HeardPiece::Octet(octet) = heard {
                self.hear(octet);
            }
        }
    }

    fn hear(&mut self, octet: Received) {
        if octet.error.is_some() {
            self.begun.clear();
            return;
        }
        self.begun.push(octet.byte);
        match Telegram::decode(&self.begun) {
            Decoded::NeedMore if self.begun.len() <= MAX_TELEGRAM => {}
            Decoded::NeedMore | Decoded::Bad { .. } => self.begun.clear(),
            Decoded::Value { value, .. } => {
                let octets = std::mem::take(&mut self.begun);
                self.take(&value, octets);
            }
        }
    }

    fn take(&mut self, telegram: &Telegram, octets: Vec<u8>) {
        let other = match telegram {
            Telegram::Token { sa, .. } => Some(*sa),
            Telegram::Pdu(pdu) if pdu.fc().is_request() => Some(pdu.sa()),
            Telegram::Pdu(_) | Telegram::Confirmation => None,
        };
        if let Some(station) = other {
            self.failed = Some(Error::OtherMaster { station });
        } else if let Some(asked) = self.asked.filter(|asked| self.replies(asked, telegram)) {
            self.note(&asked, telegram);
            self.answered();
            self.reply = octets;
        }
    }

    /// Keeps what a failed start is explained by.
    fn note(&mut self, asked: &Pdu, telegram: &Telegram) {
        let Some(pdu) = telegram.pdu() else {
            return;
        };
        let service = Service::of(asked.dsap());
        if pdu.fc().status() == Some(FcStatus::Rs) {
            self.not_activated = service;
        } else if service == Some(Service::SlaveDiag) {
            self.diagnosis = Diagnosis::decode(pdu.data());
        }
    }

    fn replies(&self, asked: &Pdu, telegram: &Telegram) -> bool {
        let Some(pdu) = telegram.pdu() else {
            return true;
        };
        let saps = pdu.dsap() == asked.ssap() && pdu.ssap() == asked.dsap();
        // Only a reply without data leaves out the SAPs of its request.
        let bare = pdu.dsap().is_none() && pdu.ssap().is_none() && pdu.data().is_empty();
        pdu.sa() == asked.da() && pdu.da() == self.master && (saps || bare)
    }
}

impl ProfibusPhy for MasterLine<'_> {
    fn poll_transmission(&mut self, _now: time::Instant) -> bool {
        self.line.now() < self.left
    }

    fn transmit_data<F, R>(&mut self, _now: time::Instant, f: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        let (length, result) = f(&mut buffer);
        if length > 0 {
            self.send(&buffer[..length]);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _now: time::Instant, f: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let (used, result) = f(&self.reply);
        self.reply.drain(..used);
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_bench::medium::Medium;
    use harness_proto::profibus::fdl::FrameControl;
    use harness_proto::profibus::master::Requests;
    use std::collections::VecDeque;

    /// The master counts 65,535 bits at most: 131 ms at 500 kbit/s. The patience of a rig may be longer.
    #[test]
    fn a_reply_is_awaited_as_long_as_the_patience_says() {
        let mut timing = Timing::simulated(BusRate::K500);
        assert_eq!(timing.left_out(Span::from_millis(100)), Span::ZERO);
        timing.patience = Span::from_millis(1_000);
        let counted = |ms| {
            let waited = Span::from_millis(ms);
            waited.saturating_sub(timing.left_out(waited))
        };
        assert_eq!(counted(1_000), timing.slot_time());
        assert!(counted(999) < timing.slot_time());
        assert_eq!(counted(0), Span::ZERO);
    }

    /// A slave behind an adapter that keeps every reply back for 300 ms.
    struct SlowAdapter {
        now: Instant,
        asked: u8,
        kept: VecDeque<(Instant, u8)>,
    }

    impl Line for SlowAdapter {
        fn medium(&self, _port: usize) -> Medium {
            harness_proto::line::Rate::default().into()
        }

        fn now(&self) -> Instant {
            self.now
        }

        fn send(&mut self, _port: usize, _what: Out<'_>) -> Instant {
            self.asked += 1;
            let fc = FrameControl::reply(FcStatus::DataLow);
            let reply = Pdu::new(2, 8, fc, &[self.asked]).expect("a reply");
            let at = self.now + Span::from_millis(300);
            let octets = Telegram::Pdu(reply).encode();
            self.kept.extend(octets.iter().map(|octet| (at, *octet)));
            self.now + Span::from_micros(100)
        }

        fn receive(&mut self, _port: usize) -> Option<(Instant, HeardPiece)> {
            let (at, octet) = self.kept.pop_front_if(|(at, _)| *at <= self.now)?;
            Some((at, HeardPiece::Octet(Received::good(octet))))
        }

        fn wait(&mut self, until: Instant) -> bool {
            let next = self.kept.front().map_or(until, |(at, _)| *at);
            self.now = self.now.max(next.min(until));
            true
        }
    }

    /// The next request is not given the reply to the one before it, which came too late.
    #[test]
    fn a_late_reply_is_no_reply_to_the_next_request() {
        let mut timing = Timing::simulated(BusRate::K500);
        timing.patience = Span::from_millis(200);
        timing.late = Span::from_millis(200);
        let slow = SlowAdapter {
            now: Instant::START,
            asked: 0,
            kept: VecDeque::new(),
        };
        let mut wire = MasterLine::new(Box::new(slow), timing, 2);
        let request = Requests::new(2, 8)
            .and_then(|mut requests| requests.request(Service::DataExchange, &[0]));
        let octets = Telegram::Pdu(request.expect("a request")).encode();
        for wait in [200, 400] {
            wire.send(&octets);
            let end = wire.left + Span::from_millis(wait);
            while wire.reply.is_empty() && wire.line.now() < end {
                wire.wait(end);
            }
        }
        let reply = Telegram::decode(&wire.reply).value();
        let reply = reply.as_ref().and_then(Telegram::pdu).expect("a reply");
        assert_eq!(reply.data(), [2]);
        // The master's clock has not counted the time in which the late reply came.
        let counted = wire.clock() - time::Instant::ZERO;
        assert!(counted < time::Duration::from_millis(520), "{counted}");
    }
}
