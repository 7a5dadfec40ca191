//! What the manual leaves open, settled as far as a conversation without any permission shows it.
//!
//! The same conversation is held with the slave and with models of it, one for every value of every open point. A value under which the model's
//! replies differ from those of the slave is excluded. Nothing that is sent enables the motor or writes a parameter.

use super::known::{KnownInverters, candidates};
use super::observed::{Agreement, WHOLE};
use super::talk::{Talk, TalkError};
use harness_bench::qualify::search::{JudgedValues, SearchOutcome, SearchWay, explain};
use harness_proto::nordac::properties::{NordacProperty, Properties};
use harness_proto::nordac::words::stw;
use harness_proto::nordac::{IDENT, Image, Pkw};
use harness_proto::profibus::dp::{Service, SetPrm};
use harness_proto::time::Span;
use std::collections::BTreeSet;

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

/// The fault memory (4.1.3, 5.7).
const FAULT_MEMORY: [u16; 3] = [947, 1801, 1806];

/// In how many points a slave may differ from the default at once, and that all best explanations count.
const WAY: SearchWay = SearchWay {
    most_changed: 12,
    followed: 1,
    all: true,
};

/// How many exchanges a task is given: its answer comes with the third (`pkw-latency`).
const ANSWERED: usize = 6;

/// Lets a slave forget its master, whatever was before; it is off afterwards. Returns its last status word.
///
/// # Errors
/// The line is in trouble, or the slave does not get into the exchange.
pub(super) fn forget(known: &KnownInverters, talk: &mut Talk<'_>) -> Result<u16, TalkError> {
    let (slave, ppo) = (known.slave.address, known.ppo());
    talk.restart(slave);
    talk.start(slave, ppo, Some(FORGET))?;
    let shown = talk.exchange(slave, ppo, &Image::of_words(stw::SAFE, 0))?;
    talk.pass(FORGOTTEN)?;
    Ok(shown.words[0])
}

/// Holds the conversation with a slave that has forgotten its master. It is off afterwards.
///
/// # Errors
/// The line is in trouble, or the slave does not get into the exchange.
pub(super) fn converse(known: &KnownInverters, talk: &mut Talk<'_>) -> Result<(), TalkError> {
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
            talk.exchange(slave, ppo, &Image::of_words(word, 0))?;
        }
    }
    if ppo.has_pkw() {
        // What the fault memory holds of earlier faults is not known.
        let remembers = !known.history.faults.is_empty();
        for task in TASKS
            .iter()
            .filter(|task| !remembers || !FAULT_MEMORY.contains(&task.number()))
        {
            for pkw in [*task, Pkw::default()] {
                let outputs = Image::from(pkw);
                for _ in 0..ANSWERED {
                    talk.exchange(slave, ppo, &outputs)?;
                }
            }
        }
    }
    Ok(())
}

/// The properties that explain what slaves did, slave by slave.
pub(super) type Assumptions = Vec<Properties>;

/// Looks for properties that explain what slaves did: from `base` on, one point after the other that `may` differ of a slave is changed as long
/// as that explains more, and two at once where no single one does. All that were found to explain everything, each with the words of its last
/// difference; none if there are no such.
pub(super) fn search(
    base: &Assumptions,
    may: impl Fn(usize, &NordacProperty) -> bool,
    mut explains: impl FnMut(&Assumptions) -> Agreement,
) -> Vec<(String, Assumptions)> {
    let agreement = |(_, slaves): &_| Some(explains(slaves)).filter(|agreed| *agreed != WHOLE);
    let neighbours = |(_, slaves): &(String, Assumptions)| steps(slaves, &may);
    let pairs = |so_far, one: &[JudgedValues<(String, Assumptions), Agreement>]| {
        // Two points that each show nothing up to the first difference do not explain it.
        let seen = one.iter().filter(|(agreed, _)| *agreed != Some(so_far));
        let seen: BTreeSet<_> = seen.map(|(_, (words, _))| name_of(words)).collect();
        one.iter()
            .filter(|(_, (words, _))| seen.contains(name_of(words)))
            .flat_map(|(_, (words, slaves))| {
                // Each pair in one order, and no property twice.
                let later = |place: usize, property: &NordacProperty| {
                    let name = name_of(words);
                    let done = seen.contains(property.name) && property.name <= name;
                    property.name != name && !done && may(place, property)
                };
                let both = move |(second, slaves)| (format!("{words}, {second}"), slaves);
                steps(slaves, later).into_iter().map(both)
            })
            .collect()
    };
    let begin = (String::new(), base.clone());
    match explain([begin], WAY, agreement, neighbours, pairs) {
        SearchOutcome::By(found) => found,
        SearchOutcome::Not(_) | SearchOutcome::Undecided => Vec::new(),
    }
}

/// The property of the words of a difference.
fn name_of(words: &str) -> &str {
    words.split(' ').next().unwrap_or_default()
}

/// What differs in one point from these slaves.
fn steps(
    from: &Assumptions,
    may: impl Fn(usize, &NordacProperty) -> bool,
) -> Vec<(String, Assumptions)> {
    let of = |place: usize| {
        let near = candidates(from[place], |property| may(place, property));
        near.into_iter().map(move |(words, properties)| {
            let mut other = from.clone();
            other[place] = properties;
            (words, other)
        })
    };
    (0..from.len()).flat_map(of).collect()
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
    let others = others.map(|(words, slaves)| (words, slaves[0]));
    let near = candidates(base, |_| true).into_iter();
    let mut open: Vec<_> = near.filter(|point| explains(point.1) == WHOLE).collect();
    open.extend(others);
    Some((base, open))
}

#[cfg(test)]
mod tests {
    use super::super::known::value_of;
    use super::{Assumptions, WHOLE, search};
    use harness_proto::nordac::properties::{NordacProperty, PROPERTIES, Properties};

    /// What a slave does may follow from two points together, of which neither alone explains more than the default.
    #[test]
    fn two_points_are_changed_at_once() {
        let holds = |all: &Assumptions, name: &str, value: &str| {
            let mut named = PROPERTIES.iter().filter(|property| property.name == name);
            named.any(|property| value_of(property, &all[0]) == value)
        };
        let explains = |all: &Assumptions| match (
            holds(all, "subindex-bits", "7..15"),
            holds(all, "plain-task-subindex", "ignored"),
        ) {
            (true, true) => WHOLE,
            (true, false) => 90,
            (false, _) => 100,
        };
        let base = vec![Properties::default()];
        let found = search(&base, |_, _| true, explains);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(explains(&found[0].1), WHOLE);
        let fixed = |_: usize, property: &NordacProperty| property.name != "subindex-bits";
        assert!(search(&base, fixed, explains).is_empty());
    }
}
