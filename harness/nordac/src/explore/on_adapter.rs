//! Conversations with NORDAC slaves behind an adapter.
//!
//! The telegrams of a conversation are what was sent, and what came between one request and the next. A reply that the computer or the adapter
//! brings only after the next request would be taken for the reply to that one. So a request without a reply is waited for twice as long as
//! the rig's file grants, and a conversation in which something comes unasked after such a request is not judged.

use super::act::{Counts, OutgoingTelegram, TelegramAct, TelegramActKind};
use super::generate::TelegramSpice;
use super::oracle::TelegramDifference;
use super::{TelegramTalk, TelegramsSeen};
use crate::gate::GuardsSlaves as _;
use crate::judge::{Breach, judge_runs};
use crate::language::Nordac;
use crate::rig::OfNordac as _;
use crate::rig::{HeldBefore, Inverters, Session, limits, slaves};
use harness_bench::capture::runs::TelegramRun;
use harness_bench::explore::ExploreError;
use harness_bench::explore::line::{LineRig, ONLY_SIMULATED};
use harness_bench::guard::Guarded;
use harness_bench::link::{Line as _, Octets as _};
use harness_bench::rig::{Ends, Rig};
use harness_proto::decode::Decoded;
use harness_proto::nordac::PpoType;
use harness_proto::profibus::fdl::{BROADCAST, FcFunction, Pdu};
use harness_proto::profibus::{Buffer, Telegram};
use harness_proto::time::{Instant, Span};
use harness_sim::record::LineByte;

/// The idle time after a telegram that has no reply.
const UNANSWERED: Span = Span::from_millis(2);

/// The idle time at the end of a conversation.
const REST: Span = Span::from_millis(20);

/// The state of a run's slaves, as the bench knows it.
#[derive(Debug)]
pub(crate) struct SlaveLog {
    /// The telegrams of the last conversation.
    heard: Vec<TelegramRun>,
    /// What the slaves held before; nothing where no conversation may write.
    before: Option<HeldBefore>,
}

impl LineRig for Nordac {
    type Drives = Inverters;
    type Kept = SlaveLog;

    fn stations(rig: &Rig, session: Option<&Session>) -> Vec<(u8, PpoType)> {
        let listed = || rig.port().map(slaves).unwrap_or_default();
        let slaves = session.map_or_else(listed, |session| session.slaves().to_vec());
        slaves
            .iter()
            .map(|slave| (slave.address, slave.ppo.unwrap_or_default()))
            .collect()
    }

    fn lacks(rig: &Rig, allow_motion: bool, spice: TelegramSpice) -> Option<&'static str> {
        use TelegramSpice as Spice;
        let limits = limits(rig, allow_motion);
        let motion = (limits.motion, "allow_motion");
        let eeprom = (limits.eeprom, "allow_eeprom");
        let bus_settings = (limits.bus_settings, "allow_bus_settings");
        let motor_data = (limits.motor_data, "allow_motor_data");
        let needed: &[_] = match spice {
            Spice::Tasks | Spice::Services | Spice::Setup | Spice::Control => &[],
            Spice::Functions | Spice::Lengths => &[],
            Spice::Motion | Spice::Words => &[motion],
            Spice::Masters => &[(limits.other_stations, "allow_other_stations")],
            Spice::Damage => &[motion, eeprom, motor_data, bus_settings],
            // Every write is permanent (NORDAC 5).
            Spice::Changes => &[eeprom],
            Spice::Bus => &[eeprom, bus_settings],
            Spice::World | Spice::Power => return Some(ONLY_SIMULATED),
        };
        needed.iter().find(|limit| !limit.0).map(|limit| limit.1)
    }

    fn keep(session: &mut Session) -> Result<SlaveLog, ExploreError> {
        let gate = session.guarded().slaves();
        let before = match gate.is_some_and(|gate| gate.limits().eeprom) {
            true => {
                let read = HeldBefore::read(session);
                Some(read.map_err(|error| ExploreError::Lost(error.to_string()))?)
            }
            false => None,
        };
        let heard = Vec::new();
        Ok(SlaveLog { heard, before })
    }

    fn tidy(session: &mut Session, kept: &mut SlaveLog) {
        if let Some(before) = kept.before.as_mut().filter(|before| before.has_written()) {
            // What is not put back is said at the end of the run.
            let _as_far_as_they_do = session.make_safe();
            let _said_later = before.put_back(session);
        }
    }

    fn restore(session: &mut Session, kept: &mut SlaveLog) -> Vec<String> {
        let before = kept.before.as_mut();
        before.map_or_else(Vec::new, |before| before.put_back(session))
    }

    fn denied(session: &Session, talk: &TelegramTalk, seen: &TelegramsSeen) -> Option<String> {
        let only_simulated = |what: &TelegramActKind| {
            !matches!(
                what,
                TelegramActKind::Ask(_) | TelegramActKind::Octets { .. }
            )
        };
        if talk.acts.iter().any(|act| only_simulated(&act.what)) {
            return Some("only a simulated slave can be switched".to_owned());
        }
        let mut gate = session.guarded().slaves()?.clone();
        let began = session.guarded().now();
        let mut replies = seen.said.iter().peekable();
        for done in &seen.done {
            while let Some(reply) = replies.next_if(|reply| reply.at <= done.at) {
                for octet in &reply.octets {
                    gate.hear(Some(*octet));
                }
            }
            let Some(sent) = &done.sent else { continue };
            if sent.bad.is_some() {
                return Some("only a simulated line can be disturbed".to_owned());
            }
            if is_followed(&sent.octets) {
                return Some(
                    "an adapter may part octets that follow a telegram from it".to_owned(),
                );
            }
            let now = began + done.at.since_start();
            let mut octets = sent.octets.iter();
            if let Some(why) = octets.find_map(|octet| gate.admit(now, *octet).err()) {
                return Some(format!("a telegram is not sent: {why}"));
            }
        }
        None
    }

    fn converse(session: &mut Session, kept: &mut SlaveLog, talk: &TelegramTalk) -> Option<String> {
        kept.heard.clear();
        let telegrams = telegrams(talk);
        if let Some(before) = &mut kept.before {
            let sent = telegrams.iter().flatten().flatten();
            let sent = sent.map(|telegram| telegram.octets.as_slice());
            match before.sends(session, sent) {
                Ok(None) => {}
                Ok(Some(why)) => return Some(why),
                // The link is in trouble.
                Err(_) => return None,
            }
        }
        let patience = session.patience();
        let mut line = Conversation {
            link: session.link(),
            patience,
            heard: &mut kept.heard,
            asked: None,
            silent: false,
            late: false,
        };
        for (act, telegrams) in talk.acts.iter().zip(&telegrams) {
            for sent in telegrams {
                if let Some(sent) = sent {
                    line.ask(&sent.octets);
                }
                line.pass(act.wait());
                if line.link.trouble().is_some() {
                    return None;
                }
            }
        }
        let rest = if line.silent { patience } else { REST };
        line.pass(rest);
        line.late.then(|| {
            "a reply came later than `patience` grants: the computer or the line was late"
                .to_owned()
        })
    }

    fn judged(_: &Session, kept: &SlaveLog) -> (Option<TelegramDifference>, bool) {
        let judged = judge_runs(kept.heard.iter().cloned());
        let first = judged.breaches.into_iter().next();
        (first.map(TelegramDifference::from), false)
    }
}

/// Whether these octets are a telegram and more. A slave takes such a telegram or not, depending on the gap.
fn is_followed(octets: &[u8]) -> bool {
    matches!(Telegram::decode(octets), Decoded::Value { used, .. } if used < octets.len())
}

/// The telegrams of each act of a conversation, one for each time; `None` if it sends nothing.
fn telegrams(talk: &TelegramTalk) -> Vec<Vec<Option<OutgoingTelegram>>> {
    let mut counts = Counts::default();
    let mut of = |act: &TelegramAct| {
        let times = (0..act.times).map(|_| counts.outgoing(&act.what));
        times.collect()
    };
    talk.acts.iter().map(&mut of).collect()
}

impl From<Breach> for TelegramDifference {
    fn from(breach: Breach) -> Self {
        Self {
            what: breach.what,
            part: breach.part,
            section: breach.section.to_owned(),
            slave: Some(breach.slave),
            telegram: breach.telegram,
            under: Vec::new(),
            about: breach.about,
        }
    }
}

/// A conversation while it is played.
struct Conversation<'s> {
    link: &'s mut Guarded<Ends>,
    /// How long a reply may take.
    patience: Span,
    heard: &'s mut Vec<TelegramRun>,
    /// The station that was asked last.
    asked: Option<u8>,
    /// Whether a request was not answered.
    silent: bool,
    /// Whether something came that may be the reply to an earlier request.
    late: bool,
}

impl Conversation<'_> {
    /// Sends a telegram, and waits for the reply.
    fn ask(&mut self, octets: &[u8]) {
        self.pass(Span::ZERO);
        let end = self.link.send_octets(0, octets);
        if self.link.trouble().is_some() {
            return;
        }
        let sent = octets
            .iter()
            .map(|octet| LineByte::seen(end, Some(*octet), Some(*octet), None));
        self.heard.push(TelegramRun {
            from: None,
            octets: sent.collect(),
        });
        let owed = match Telegram::decode(octets) {
            Decoded::Value { value, used } if used == octets.len() => {
                let pdu = value.pdu();
                self.asked = pdu.map(|pdu| pdu.da());
                let sends_only = |pdu: &Pdu| pdu.fc().function().is_some_and(FcFunction::is_sdn);
                pdu.is_some_and(|pdu| pdu.da() != BROADCAST && !sends_only(pdu))
            }
            // Somebody may read a request out of it.
            _ => true,
        };
        if !owed {
            self.reply(end + UNANSWERED);
        } else if !self.reply(end + self.patience) {
            self.silent = true;
            self.late |= self.reply(self.link.now() + self.patience);
        }
    }

    /// Takes octets until they are a whole telegram or the time is over. Returns whether any came.
    fn reply(&mut self, until: Instant) -> bool {
        let (mut until, last) = (until, until + self.patience);
        let mut octets = Vec::new();
        let mut telegram = Buffer::new();
        'heard: loop {
            while let Some((at, octet)) = self.link.receive_octet(0) {
                octets.push(LineByte::seen(
                    at,
                    Some(octet.byte),
                    Some(octet.byte),
                    octet.error,
                ));
                let fits = telegram.push(octet.byte) && octet.error.is_none();
                if fits && matches!(Telegram::decode(&telegram), Decoded::Value { .. }) {
                    break 'heard;
                }
                until = until.max(at + self.patience).min(last);
            }
            if self.link.trouble().is_some() || self.link.now() >= until {
                break;
            }
            self.link.wait(until);
        }
        let came = !octets.is_empty();
        if came {
            let from = self.asked;
            self.heard.push(TelegramRun {
                from: from.or(Some(0)),
                octets,
            });
        }
        came
    }

    /// Lets time pass. What comes is unasked.
    fn pass(&mut self, time: Span) {
        let until = self.link.now() + time;
        let last = until + self.patience;
        while self.reply(until) {
            self.late |= self.silent;
            if self.link.now() > last {
                break;
            }
        }
    }
}
