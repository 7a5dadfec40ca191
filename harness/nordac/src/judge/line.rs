//! Follows the telegrams of a line, and judges those of its slaves.

use super::channel::Tasks;
use super::doubt::ReplySender;
use super::follower::{Follower, Record, Way, outputs};
use super::standing::{Standing, standings};
use super::symptom::ReplySubject;
use super::symptom::Symptom::{self, Missing, NoTelegram, Unasked};
use harness_bench::capture::gap;
use harness_bench::capture::runs::{HeardTelegram, TelegramRun, runs};
use harness_bench::counted::counted;
use harness_proto::decode::Decoded;
use harness_proto::profibus::Telegram;
use harness_proto::profibus::dp::Service;
use harness_proto::profibus::fdl::{
    BROADCAST, ED, FcFunction, Form as Shape, Malformed, Pdu, SD1, SD2, SD3, check_sum,
};
use harness_proto::time::{Instant, Span};
use harness_sim::record::Trace;
use std::collections::{BTreeMap, BTreeSet};

const MOST_BREACHES: usize = 50;

/// In this time a slave can be switched off and be back.
const RESTART: Span = Span::from_millis(300);

/// What a reply to no request is about.
const NO_REQUEST: &str = "octets that are no request";

/// Something that a slave does, and that no value of what the manual leaves open explains.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Breach {
    pub(crate) what: Symptom,
    /// The number of the telegram where it shows, counted from 1 over all stations.
    pub(crate) telegram: usize,
    pub(crate) slave: u8,
    /// The service, or what it was that asked for the reply.
    pub(crate) part: String,
    /// The section, such as `EN 2` or `3.4.1`.
    pub(crate) section: &'static str,
    /// What was expected and what has come.
    pub(crate) about: String,
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct JudgedSlaves {
    /// What differs, in order.
    pub(crate) breaches: Vec<Breach>,
    /// Replies of slaves that were compared.
    pub(crate) compared: usize,
    /// Replies that could be compared: those, and those that are damaged or that follow octets which are no single request.
    pub(crate) replies: usize,
    /// What was not compared, in sentences.
    pub(crate) remarks: Vec<String>,
    /// What differs and may have another cause than a wrong slave, in sentences with their places: it accuses no slave, and nothing has
    /// passed.
    pub(crate) doubts: Vec<String>,
}

/// A request that was understood, and its number.
#[derive(Debug)]
struct HeardRequest {
    number: usize,
    /// `None` for octets to which no slave may reply.
    pdu: Option<Pdu>,
    /// Whether a slave may have read something else: two telegrams in a row.
    doubtful: bool,
}

/// Judges what the slaves of a line sent, in a capture that may begin in mid-conversation: its first octets may be the end of a telegram,
/// or the reply to a request that was not heard.
///
/// `named` are the slaves that are judged; where there are none, those that are no other device's. Times may be off by
/// `tolerance`.
#[must_use]
pub(crate) fn judge(trace: &Trace, named: &[u8], tolerance: Span) -> JudgedSlaves {
    let mut runs = runs(trace);
    let senders = ReplySender::of_all(&runs);
    // A telegram that the end of the capture has cut.
    let cut = runs.pop_if(|run| run.from.is_some() && is_begun(run));
    let mut judge = Judge {
        midway: true,
        recorded: Some(tolerance),
        standings: standings(&runs, named),
        ..Judge::default()
    };
    let gaps = gap::gaps(runs.iter().map(|run| (run.begin(), run.at())));
    judge.judged.remarks.extend(gap::note(&gaps, "telegram"));
    judge.gaps = gaps.iter().map(|gap| gap.piece + 1).collect();
    if cut.is_some() {
        let about = "the capture ends in the middle of a reply, which was not compared";
        judge.judged.remarks.push(about.to_owned());
    }
    judge.all_of(runs.into_iter().zip(senders))
}

/// Whether octets are a telegram, or as many as one has: a wrong check sum or end is in them and not one octet too few.
fn is_complete(said: &HeardTelegram) -> bool {
    let left = match Telegram::decode(&said.octets) {
        Decoded::Value { .. } => return true,
        Decoded::NeedMore => return false,
        Decoded::Bad { reason, offset } => (reason, said.octets.len() - 1 - offset),
    };
    [(Malformed::CheckSum, 1), (Malformed::End, 0)].contains(&left)
}

/// Whether octets are as their sender sent them, though they are no telegram: all checks of a tap hold, and an address or a control octet is
/// one that no slave may answer.
fn is_undamaged(said: &HeardTelegram) -> bool {
    let reasons = [
        Malformed::Source,
        Malformed::Control,
        Malformed::Sap,
        Malformed::SapMissing,
    ];
    let Decoded::Bad { reason, .. } = Telegram::decode(&said.octets) else {
        return false;
    };
    let body = match said.octets.as_slice() {
        [SD1, body @ .., fcs, ED] if body.len() == 3 => Some((body, fcs)),
        [SD2, le, ler, SD2, body @ .., fcs, ED] if le == ler && body.len() == usize::from(*le) => {
            Some((body, fcs))
        }
        [SD3, body @ .., fcs, ED] if body.len() == 11 => Some((body, fcs)),
        _ => None,
    };
    reasons.contains(&reason) && body.is_some_and(|(body, fcs)| check_sum(body) == *fcs)
}

fn is_begun(run: &TelegramRun) -> bool {
    let said = run.said().filter(|said| said.error.is_none());
    said.is_some_and(|said| matches!(Telegram::decode(&said.octets), Decoded::NeedMore))
}

/// Judges octets that stations sent without a pause, from the first telegram of the line on.
pub(crate) fn judge_runs(runs: impl IntoIterator<Item = TelegramRun>) -> JudgedSlaves {
    Judge::default().all_of(runs.into_iter().map(|run| (run, ReplySender::Known)))
}

#[derive(Debug, Default)]
struct Judge {
    /// Whether something was sent that was not heard, right before the next telegram.
    midway: bool,
    /// Of telegrams of a capture, which does not show a supply and says of a telegram no more than its octets: how far times may be off.
    recorded: Option<Span>,
    /// The telegrams in front of which the log has gaps.
    gaps: BTreeSet<usize>,
    /// Whether the station that a telegram seems to be of has sent it.
    sender: ReplySender,
    followers: BTreeMap<u8, Follower>,
    /// What the telegrams show of each slave if it was switched off and on in its last silence in which a restart fits, and when that
    /// began; until the slave shows that it was not.
    restarted: BTreeMap<u8, (Instant, Follower)>,
    asked: Option<HeardRequest>,
    /// Whether a slave is judged; one that is not in it is.
    standings: BTreeMap<u8, Standing>,
    /// Replies of slaves that are not judged.
    left_out: BTreeMap<u8, usize>,
    /// The slaves of which a reply was compared.
    heard: BTreeSet<u8>,
    /// Replies that may repeat one to a request from before the capture, or to one that was damaged or not answered.
    may_repeat: usize,
    judged: JudgedSlaves,
}

impl Judge {
    fn all_of(
        mut self,
        runs: impl IntoIterator<Item = (TelegramRun, ReplySender)>,
    ) -> JudgedSlaves {
        for (number, (run, sender)) in (1..).zip(runs) {
            self.sender = sender;
            if self.gaps.contains(&number) {
                self.begins_again();
            }
            match run.from {
                None => self.asks(number, &run),
                Some(_) => self.replies(number, &run),
            }
            self.midway = false;
        }
        self.finished();
        self.judged
    }

    /// Behind a gap of the log nothing is known of what was said in it: replies, and requests that set a slave up, may be missing.
    fn begins_again(&mut self) {
        (self.midway, self.asked) = (true, None);
        self.restarted.clear();
        for (address, follower) in &mut self.followers {
            *follower = Follower::new(*address);
        }
    }

    fn standing(&self, slave: u8) -> Standing {
        let standing = self.standings.get(&slave);
        standing.copied().unwrap_or_default()
    }

    fn breach(
        &mut self,
        telegram: usize,
        slave: u8,
        what: Symptom,
        section: &'static str,
        part: &str,
        about: String,
    ) {
        let standing = self.standing(slave);
        if !standing.is_judged() {
            return;
        }
        let lost = "a tap does not show whether the request has reached the slave";
        let why = self.sender.doubt().or(standing.doubt());
        if let Some(why) = why.or((what == Missing && self.recorded.is_some()).then_some(lost)) {
            self.doubt(format!(
                "telegram {telegram}, slave {slave}: {about}; {why}"
            ));
        } else if self.judged.breaches.len() < MOST_BREACHES {
            self.judged.breaches.push(Breach {
                what,
                telegram,
                slave,
                part: part.to_owned(),
                section,
                about,
            });
        }
    }

    fn doubt(&mut self, about: String) {
        if self.judged.doubts.len() < MOST_BREACHES {
            self.judged.doubts.push(about);
        }
    }

    fn all(&mut self) -> impl Iterator<Item = &mut Follower> {
        let restarted = self.restarted.values_mut().map(|(_, follower)| follower);
        self.followers.values_mut().chain(restarted)
    }

    /// The followers of one slave, if it was heard.
    fn of(&mut self, address: u8) -> impl Iterator<Item = &mut Follower> {
        let restarted = self.restarted.get_mut(&address);
        let follower = self.followers.get_mut(&address);
        let restarted = restarted.map(|(_, follower)| follower);
        follower.into_iter().chain(restarted)
    }

    fn follower(&mut self, address: u8) -> &mut Follower {
        self.followers
            .entry(address)
            .or_insert_with(|| Follower::new(address))
    }

    fn asks(&mut self, number: usize, run: &TelegramRun) {
        self.silent();
        let said = run.said();
        let decoded = said.as_ref().map(|said| Telegram::decode(&said.octets));
        let whole = |used: usize| said.as_ref().is_some_and(|said| used == said.octets.len());
        let sound = said.as_ref().is_some_and(|said| said.error.is_none());
        let (pdu, doubtful) = match decoded {
            Some(Decoded::Value { value, used }) if sound && whole(used) => {
                (value.pdu().copied(), false)
            }
            // A tap may lose an octet, or damage one that the slave has read.
            _ if self.recorded.is_some() && !(sound && said.as_ref().is_some_and(is_undamaged)) => {
                (None, true)
            }
            Some(Decoded::Value { used, .. }) => (None, !whole(used)),
            _ => (None, false),
        };
        let torn = doubtful && self.recorded.is_some();
        if let Some(pdu) = &pdu {
            self.sent(pdu);
        } else {
            // What was damaged may have been heard by some, and what a tap damages by all.
            self.all().for_each(|follower| {
                follower.fresh = false;
                if torn {
                    follower.record = Record::Unknown;
                    follower.tasks = Tasks::default();
                    follower.may_be_set_up();
                }
            });
        }
        self.asked = Some(HeardRequest {
            number,
            pdu,
            doubtful,
        });
    }

    /// A right request: what it does before it is answered.
    fn sent(&mut self, pdu: &Pdu) {
        let service = Service::of(pdu.dsap());
        if pdu.da() == BROADCAST {
            self.all().for_each(|follower| follower.fresh = false);
            return;
        }
        let exchanges = pdu.dsap().is_none() && service == Some(Service::DataExchange);
        self.follower(pdu.da());
        if let Some(image) = outputs(pdu.data()).filter(|_| exchanges) {
            let followers = self.of(pdu.da());
            followers.for_each(|follower| follower.tasks.push(image.pkw));
        }
    }

    /// The last request has found no reply.
    fn silent(&mut self) {
        let Some(HeardRequest {
            number,
            pdu: Some(pdu),
            ..
        }) = self.asked.take()
        else {
            return;
        };
        let answered = match pdu.fc().function() {
            Some(FcFunction::FdlStatus) => pdu.form() == Shape::Plain,
            Some(function) => function.is_srd(),
            None => false,
        };
        if !answered || pdu.da() == BROADCAST {
            let function = pdu.fc().function();
            let counts = function.is_some_and(|function| !function.is_sdn());
            for follower in self.of(pdu.da()) {
                follower.fresh = false;
                if counts {
                    follower.record = Record::Unknown;
                }
            }
            return;
        }
        let name = ReplySubject::of(Some(&Telegram::Pdu(pdu))).part;
        let sets_up = matches!(
            Service::of(pdu.dsap()),
            Some(Service::SetPrm | Service::ChkCfg)
        );
        self.follower(pdu.da());
        for follower in self.of(pdu.da()) {
            follower.record = Record::Unknown;
            follower.fresh = false;
            if sets_up {
                follower.may_be_set_up();
            } else if follower.exchanging && follower.unanswered.is_none() {
                follower.unanswered = Some((number, name.clone()));
            }
        }
    }

    fn finished(&mut self) {
        self.asked = None;
        let remarks = &mut self.judged.remarks;
        for (slave, standing) in &self.standings {
            let left_out = self.left_out.get(slave).copied().unwrap_or(0);
            let named = *standing == Standing::Named && !self.heard.contains(slave);
            if let Some(why) = standing.why_not() {
                let count = counted(left_out, "reply");
                remarks.push(format!("slave {slave} is not judged ({count}): {why}"));
            } else if named && self.judged.doubts.len() < MOST_BREACHES {
                let about = format!("slave {slave}: no reply of it was compared");
                self.judged.doubts.push(about);
            }
        }
        if self.may_repeat > 0 {
            let count = counted(self.may_repeat, "reply");
            remarks.push(format!(
                "{count} not compared: the request may repeat one that was not heard or not answered"
            ));
        }
        if let unread @ 1.. = self.judged.replies - self.judged.compared {
            let count = counted(unread, "reply");
            remarks.push(format!(
                "{count} not compared: the reply or its request could not be read"
            ));
        }
        if self.judged.compared == 0 {
            self.judged
                .remarks
                .push("no reply of a slave was compared".to_owned());
        }
    }

    fn replies(&mut self, number: usize, run: &TelegramRun) {
        let asked = self.asked.take();
        let Some(said) = run.said() else {
            return;
        };
        let mut octets = run.octets.iter();
        let damaged = octets.any(|octet| octet.sent != octet.received || octet.error.is_some());
        // A tap may lose an octet.
        let damaged = damaged || self.recorded.is_some() && !is_complete(&said);
        let from = said.from.unwrap_or(0);
        let Some(asked) = asked else {
            if self.midway {
                return;
            }
            let about = "it sends again without a request in between".to_owned();
            return self.breach(number, from, Unasked, "EN 1", NO_REQUEST, about);
        };
        let address = asked.pdu.as_ref().map_or(from, Pdu::da);
        let is_judged = self.standing(address).is_judged();
        if !is_judged {
            *self.left_out.entry(address).or_default() += 1;
        }
        if damaged {
            self.judged.replies += usize::from(is_judged);
            // On the way to the master: nothing is known of it.
            if let Some(pdu) = &asked.pdu {
                for follower in self.of(pdu.da()) {
                    follower.record = Record::Unknown;
                    (follower.way, follower.fresh) = (Way::Unknown, false);
                }
            }
            return;
        }
        let Some(request) = asked.pdu else {
            if !asked.doubtful {
                self.judged.compared += usize::from(is_judged);
                let about = format!(
                    "it replies to telegram {}, which is no request",
                    asked.number
                );
                self.breach(number, from, Unasked, "EN 1", NO_REQUEST, about);
            }
            // What the capture begins in the middle of was not heard; two telegrams in a row were, and hide the request.
            let hidden = !(asked.doubtful && asked.number == 1);
            self.judged.replies += usize::from(is_judged && hidden);
            return;
        };
        self.comes(address, said.at);
        let reply = said.telegram();
        let follower = self.follower(address);
        let found = match &reply {
            None => Some((NoTelegram, "EN 1", "its reply is no telegram".to_owned())),
            Some(reply) => follower.judge(&request, reply, &said.octets),
        };
        let shown = follower.shown();
        let may_repeat = follower.may_repeat;
        if is_judged {
            self.may_repeat += usize::from(may_repeat);
            self.judged.compared += usize::from(!may_repeat);
            self.judged.replies += usize::from(!may_repeat);
            self.heard.insert(address);
        }
        let why = found.as_ref().map(|found| &found.2);
        let why = why.or(shown.as_ref().map(|shown| &shown.1));
        if let Some((silent, restarted)) = self.explained(&request, &said) {
            let Some(why) = why else {
                self.restarted.insert(address, (silent, restarted));
                return;
            };
            if !is_judged {
                return;
            }
            self.doubt(format!(
                "telegram {number}, slave {address}: {why}; its supply may have been switched off and on in the silence from {} on, which explains it",
                silent.since_start()
            ));
            self.followers.insert(address, restarted);
            return;
        }
        if let Some((earlier, what)) = shown {
            let about = format!("{what} is not answered, and the slave goes on exchanging");
            self.breach(earlier, address, Missing, "EN 1", &what, about);
        }
        if let Some((what, section, why)) = found {
            let place = ReplySubject::of(Some(&Telegram::Pdu(request))).part;
            let about = format!("{place}: {why}");
            self.breach(number, from, what, section, &place, about);
        }
    }

    /// A slave replies at `at`: in a capture, a long silence after its last reply may have been one without supply.
    fn comes(&mut self, address: u8, at: Instant) {
        let recorded = self.recorded;
        let follower = self.follower(address);
        let last = follower.sent.replace(at);
        let silent = last.filter(|last| {
            recorded.is_some_and(|tolerance| at.since(*last) + tolerance >= RESTART)
        });
        if let Some(silent) = silent {
            let restarted = follower.restarted();
            self.restarted.insert(address, (silent, restarted));
        }
    }

    /// The slave that replies, switched off and on in its last silence, if it can have sent this; it was not switched off if it cannot.
    fn explained(&mut self, request: &Pdu, said: &HeardTelegram) -> Option<(Instant, Follower)> {
        let (silent, mut restarted) = self.restarted.remove(&request.da())?;
        let reply = said.telegram()?;
        let found = restarted.judge(request, &reply, &said.octets);
        (found.is_none() && restarted.shown().is_none()).then_some((silent, restarted))
    }
}
