//! What the manual leaves open, settled as far as a conversation without any permission shows it.
//!
//! The same conversation is held with the slave and with models of it, one for every value of every open point. A value under which the model's
//! replies differ from those of the slave is excluded. Nothing that is sent enables the motor or writes a parameter.

use super::known::{Known, candidates};
use super::observed::{Agreement, WHOLE};
use super::talk::{Talk, TalkError};
use harness_proto::nordac::properties::{Description, Properties};
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

/// Lets a slave forget its master, whatever was before. It is off afterwards.
///
/// # Errors
/// The line is in trouble, or the slave does not get into the exchange.
pub(super) fn forget(known: &Known, talk: &mut Talk<'_>) -> Result<(), TalkError> {
    let (slave, ppo) = (known.slave.address, known.ppo());
    talk.restart(slave);
    talk.start(slave, ppo, Some(FORGET))?;
    talk.exchange(slave, ppo, &image(stw::SAFE))?;
    talk.pass(FORGOTTEN)
}

/// Holds the conversation with a slave that has forgotten its master. It is off afterwards.
///
/// # Errors
/// The line is in trouble, or the slave does not get into the exchange.
pub(super) fn converse(known: &Known, talk: &mut Talk<'_>) -> Result<(), TalkError> {
    let (slave, ppo) = (known.slave.address, known.ppo());
    let mut early = SetPrm::lock(IDENT);
    let user = [0x00];
    for (service, data) in [
        (Service::SlaveDiag, Vec::new()),
        (Service::ChkCfg, ppo.cfg().to_vec()),
        (Service::SlaveDiag, Vec::new()),
    ] {
        talk.raw(slave, service, &data)?;
    }
    early.user = &user;
    let early = early.encode().unwrap_or_default();
    talk.raw(slave, Service::SetPrm, &early)?;
    talk.raw(slave, Service::SlaveDiag, &[])?;
    talk.start(slave, ppo, None)?;
    for service in [
        Service::SlaveDiag,
        Service::GetCfg,
        Service::RdInp,
        Service::RdOutp,
    ] {
        talk.raw(slave, service, &[])?;
    }
    for word in WORDS {
        for _ in 0..TIMES {
            talk.exchange(slave, ppo, &image(word))?;
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
                    talk.exchange(slave, ppo, &outputs)?;
                }
            }
        }
    }
    Ok(())
}

fn image(word: u16) -> Image {
    Image {
        words: [word, 0, 0, 0, 0, 0],
        ..Image::default()
    }
}

/// The properties that explain what slaves did, slave by slave.
pub(super) type Assumed = Vec<Properties>;

/// Looks for properties that explain what slaves did: from `base` on, one point after the other that `may` differ of a slave is changed as long
/// as that explains more. All that were found to explain everything, each with the words of its last difference; none if there are no such.
pub(super) fn search(
    base: &Assumed,
    may: impl Fn(usize, &Description) -> bool,
    mut explains: impl FnMut(&Assumed) -> Agreement,
) -> Vec<(String, Assumed)> {
    let mut so_far = (explains(base), base.clone());
    if so_far.0 == WHOLE {
        return vec![(String::new(), base.clone())];
    }
    for _ in 0..MOST_DIFFERENCES {
        let mut best = Vec::new();
        let mut most = so_far.0;
        for place in 0..base.len() {
            for (words, own) in candidates(so_far.1[place], |property| may(place, property)) {
                let mut other = so_far.1.clone();
                other[place] = own;
                let agreed = explains(&other);
                if agreed > most {
                    most = agreed;
                    best.clear();
                }
                if agreed == most && agreed > so_far.0 {
                    best.push((words, other));
                }
            }
        }
        match best.first() {
            None => return Vec::new(),
            Some(_) if most == WHOLE => return best,
            Some((_, better)) => so_far = (most, better.clone()),
        }
    }
    Vec::new()
}

/// The properties that explain what a slave did, and those that do so as well: they differ from them in one point, or were found in their
/// place. Nothing where no properties explain it.
pub(super) fn settle(
    mut explains: impl FnMut(Properties) -> Agreement,
) -> Option<(Properties, Vec<(String, Properties)>)> {
    let default = vec![Properties::default()];
    let found = search(&default, |_, _| true, |all| explains(all[0]));
    let base = found.first()?.1[0];
    let others = found.into_iter().skip(1);
    let others = others.map(|(words, own)| (words, own[0]));
    let near = candidates(base, |_| true).into_iter();
    let mut open: Vec<_> = near.filter(|own| explains(own.1) == WHOLE).collect();
    open.extend(others);
    Some((base, open))
}
