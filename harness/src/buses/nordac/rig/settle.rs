//! What the manual leaves open, settled as far as a conversation without any permission shows it.
//!
//! The same conversation is held with the slave and with models of it, one for every value of every open point. A value under which the model's
//! replies differ from those of the slave is excluded. Nothing that is sent enables the motor or writes a parameter.

use super::known::{Known, candidates};
use super::talk::{Talk, TalkError};
use harness_proto::nordac::properties::Properties;
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{IDENT, Image, Pkw};
use harness_proto::profibus::dp::{Service, SetPrm};
use harness_proto::time::Span;

/// A watchdog by which the slave forgets its master: 100 ms.
const FORGET: [u8; 2] = [1, 10];

/// How long that takes, at most.
const FORGOTTEN: Span = Span::from_millis(150);

/// Words that are valid and enable nothing: OFF2, ON without enabling, ready, ON, OFF3, OFF2.
const WORDS: [u16; 6] = [
    stw::SAFE,
    0x0477,
    stw::READY,
    0x0477,
    stw::QUICK_STOP,
    stw::SAFE,
];

/// How often each word is sent: what replies show may lag behind (`pzd-latency`).
const TIMES: usize = 5;

/// Tasks that read: a value, its sub-index, an array, the number of its elements, what is not there, a description, the low octet of
/// IND, PWE beside a word, an element of 1801, bit 7 of IND, double words.
const TASKS: [Pkw; 13] = [
    Pkw::of(1, 1202, 0, 0),
    Pkw::of(1, 1801, 0x0600, 0),
    Pkw::of(6, 1801, 0x0600, 0),
    Pkw::of(9, 1801, 0, 0),
    Pkw::of(1, 1001, 0, 0),
    Pkw::of(4, 1202, 0, 0),
    Pkw::of(4, 1001, 0, 0),
    Pkw::of(1, 1202, 0x0001, 0),
    Pkw::of(1, 1203, 0, 1),
    Pkw::of(6, 1806, 0x0480, 0),
    Pkw::of(6, 1806, 0x0900, 0),
    Pkw::of(1, 1415, 0, 0),
    Pkw::of(6, 947, 0x0100, 0),
];

/// In how many points a slave may differ from the default at once.
const MOST_DIFFERENCES: usize = 12;

/// How many exchanges a task is given: its answer comes with the third (`pkw-latency`).
const ANSWERED: usize = 6;

/// What a slave replied, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Replies(Vec<String>);

impl Replies {
    /// How many of them, from the first on, are those of another conversation.
    fn agrees(&self, other: &Self) -> usize {
        let pairs = self.0.iter().zip(&other.0);
        pairs.take_while(|(own, other)| own == other).count()
    }
}

/// Holds the conversation with a slave. It is off afterwards.
///
/// # Errors
/// The line is in trouble, or the slave does not get into the exchange.
pub(super) fn converse(known: &Known, talk: &mut Talk<'_>) -> Result<Replies, TalkError> {
    let (slave, ppo) = (known.slave.address, known.ppo());
    let mut all = Replies::default();
    talk.restart(slave);
    // Without a master, whatever was before.
    talk.start(slave, ppo, Some(FORGET))?;
    talk.exchange(slave, ppo, &image(stw::SAFE))?;
    talk.pass(FORGOTTEN)?;
    let mut early = SetPrm::lock(IDENT);
    let user = [0x00];
    for (service, data) in [
        (Service::SlaveDiag, Vec::new()),
        (Service::ChkCfg, ppo.cfg().to_vec()),
        (Service::SlaveDiag, Vec::new()),
    ] {
        all.0.push(talk.raw(slave, service, &data)?);
    }
    early.user = &user;
    let early = early.encode().unwrap_or_default();
    all.0.push(talk.raw(slave, Service::SetPrm, &early)?);
    all.0.push(talk.raw(slave, Service::SlaveDiag, &[])?);
    talk.start(slave, ppo, None)?;
    all.0.push(talk.raw(slave, Service::SlaveDiag, &[])?);
    for word in WORDS {
        for _ in 0..TIMES {
            let reply = talk.exchange(slave, ppo, &image(word))?;
            all.0
                .push(format!("{:04X} {:04X}", reply.first(), reply.main()));
        }
    }
    if ppo.has_pkw() {
        for task in TASKS {
            for pkw in [task, Pkw::default()] {
                let outputs = Image {
                    pkw,
                    ..Image::default()
                };
                for _ in 0..ANSWERED {
                    let reply = talk.exchange(slave, ppo, &outputs)?;
                    all.0.push(reply.pkw.to_string());
                }
            }
        }
    }
    Ok(all)
}

fn image(word: u16) -> Image {
    Image {
        words: [word, 0, 0, 0, 0, 0],
        ..Image::default()
    }
}

/// The properties that explain what a slave replied, and those that differ from them in one point and explain it as well. `model` holds the
/// conversation with a model. One point after the other is changed as long as that explains more; where nothing explains all, every value of every
/// point stays open.
pub(super) fn settle(
    seen: &Replies,
    mut model: impl FnMut(Properties) -> Option<Replies>,
) -> (Properties, Vec<(String, Properties)>) {
    let mut explained = |own: Properties| model(own).map_or(0, |replies| replies.agrees(seen));
    let all = seen.0.len();
    let mut base = Properties::default();
    let mut so_far = explained(base);
    for _ in 0..MOST_DIFFERENCES {
        if so_far == all {
            let open = candidates(base).into_iter();
            return (base, open.filter(|own| explained(own.1) == all).collect());
        }
        let others = candidates(base).into_iter();
        let others = others.map(|(_, own)| (explained(own), own));
        match others.max_by_key(|(agreed, _)| *agreed) {
            Some((agreed, better)) if agreed > so_far => (so_far, base) = (agreed, better),
            _ => break,
        }
    }
    let default = Properties::default();
    (default, candidates(default))
}
