//! How replies of slaves differ, and what of them the manual leaves open.

use super::hex;
use super::play::{PlayedAct, TelegramsSeen};
use crate::judge::{ReplySubject, Symptom};
use crate::simulate::Setup;
use harness_bench::capture::runs::HeardTelegram;
use harness_proto::nordac::properties::{Choices, NordacProperty, PROPERTIES, Properties};
use harness_proto::profibus::Telegram;
use serde::{Deserialize, Serialize};

/// The open point that only the PosiCon option shows.
const POSICON: &str = "position-count";

/// The first reply that no model explains.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TelegramDifference {
    pub(crate) what: Symptom,
    /// The service, and the part of its data.
    pub(crate) part: String,
    /// The section that says most about it, such as `3.2.2`, or `EN 2`.
    pub(crate) section: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) slave: Option<u8>,
    /// The number of the telegram among those of the slaves, counted from 1.
    pub(crate) telegram: usize,
    /// The values of open points with which the model explains most, as header lines; defaults are not listed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) under: Vec<String>,
    /// The whole difference, as a sentence.
    pub(crate) about: String,
}

/// Every property with each of its values.
fn values() -> impl Iterator<Item = (&'static NordacProperty, String)> {
    PROPERTIES.iter().flat_map(|property| {
        let words: Vec<String> = match property.accepts {
            Choices::Words(words) => words.iter().map(|word| (*word).to_owned()).collect(),
            Choices::Count { least, most, .. } => {
                (least..=most).map(|count| count.to_string()).collect()
            }
        };
        words.into_iter().map(move |word| (property, word))
    })
}

/// All properties that differ in one open point.
pub(super) fn neighbours(base: &Properties, posicon: bool) -> impl Iterator<Item = Properties> {
    let base = *base;
    let shown = values().filter(move |(property, _)| posicon || property.name != POSICON);
    shown.filter_map(move |(property, word)| {
        let mut new = base;
        (property.set(&mut new, &word) && new != base).then_some(new)
    })
}

/// The open points of an assignment as header lines, where they do not have their default.
pub(super) fn lines(under_test: &Setup, assignment: &[Properties]) -> Vec<String> {
    let mut lines = Vec::new();
    for (slave, properties) in under_test.slaves.iter().zip(assignment) {
        let usual = Properties::default();
        for (property, word) in values() {
            let (mut same, mut other) = (*properties, usual);
            let set = property.set(&mut same, &word) && property.set(&mut other, &word);
            if set && same == *properties && other != usual {
                lines.push(format!(
                    "slave {} property {} = {word}",
                    slave.address, property.name
                ));
            }
        }
    }
    lines
}

/// The distance of two telegrams: 0 if they are equal.
pub(super) fn unlike(a: &HeardTelegram, b: &HeardTelegram) -> i64 {
    let sender = i64::from(a.from != b.from);
    let length = a.octets.len().abs_diff(b.octets.len()) as i64;
    let error = i64::from(a.error != b.error);
    // The sum at the end says the same again.
    let body = |telegram: &HeardTelegram| telegram.octets.len().saturating_sub(2);
    let octets = a.octets[..body(a)].iter().zip(&b.octets[..body(b)]);
    let bits: u32 = octets.map(|(a, b)| (a ^ b).count_ones()).sum();
    let time = i64::from(a.at != b.at);
    10_000 * sender + 1_000 * length + 1_000 * error + 2 * i64::from(bits) + time
}

/// The difference at a place, in words.
pub(super) fn difference(
    setup: &Setup,
    index: usize,
    (expected, seen): (&TelegramsSeen, &TelegramsSeen),
    under: Vec<String>,
) -> Option<TelegramDifference> {
    let (wanted, came) = (expected.said.get(index), seen.said.get(index));
    let what = match (wanted, came) {
        (Some(_), None) => Symptom::Missing,
        (None, _) => Symptom::Unasked,
        (Some(a), Some(b)) if asked(expected, a) < asked(seen, b) => Symptom::Missing,
        (Some(a), Some(b)) if asked(expected, a) > asked(seen, b) => Symptom::Unasked,
        (Some(a), Some(b)) => symptom(a, b),
    };
    let (about_it, of) = match what {
        Symptom::Unasked => (came, seen),
        _ => (wanted, expected),
    };
    let about_it = about_it?;
    let request = asked(of, about_it).and_then(|act| of.done[act].sent.as_ref());
    let request = request.and_then(|sent| Telegram::decode(&sent.octets).value());
    let place = match (
        wanted.and_then(HeardTelegram::telegram),
        came.and_then(HeardTelegram::telegram),
    ) {
        (Some(Telegram::Pdu(a)), Some(Telegram::Pdu(b))) if what == Symptom::Value => {
            let mut slaves = setup.slaves.iter();
            let slave = slaves.find(|slave| Some(slave.address) == about_it.from);
            let ppo = slave.map(|slave| slave.ppo).unwrap_or_default();
            ReplySubject::of_data(request.as_ref(), ppo, &a, &b)
        }
        _ => ReplySubject::of(request.as_ref()),
    };
    let said = |telegram: Option<&HeardTelegram>| {
        telegram.map_or("no telegram".to_owned(), |telegram| {
            let error = telegram.error.map_or(String::new(), |(octet, error)| {
                format!(" with a {error} error in octet {octet}")
            });
            let octets = hex::written(&telegram.octets);
            format!("{octets}{error}, ended at {},", telegram.at)
        })
    };
    let any = match under.is_empty() {
        true => "",
        false => " with the values of open points that explain most",
    };
    let asked_for = request.map(|request| hex::written(&request.encode()));
    let asked_for = asked_for.unwrap_or("other octets".to_owned());
    Some(TelegramDifference {
        what,
        part: place.part,
        section: place.section.to_owned(),
        slave: about_it.from,
        telegram: index + 1,
        under,
        about: format!(
            "telegram {} of the slaves, behind {asked_for}: {} is expected{any}, and {} has come",
            index + 1,
            said(wanted),
            said(came)
        ),
    })
}

/// The number of the act after which a telegram was sent.
fn asked(seen: &TelegramsSeen, telegram: &HeardTelegram) -> Option<usize> {
    let before = |done: &PlayedAct| done.sent.is_some() && done.at < telegram.at;
    seen.done.iter().rposition(before)
}

fn symptom(wanted: &HeardTelegram, came: &HeardTelegram) -> Symptom {
    if wanted.error != came.error {
        Symptom::Damaged
    } else if wanted.octets == came.octets {
        match wanted.from == came.from {
            true => Symptom::Time,
            false => Symptom::Sender,
        }
    } else {
        let decoded = [wanted, came].map(HeardTelegram::telegram);
        match decoded {
            [Some(Telegram::Pdu(a)), Some(Telegram::Pdu(b))]
                if (a.da(), a.sa(), a.fc(), a.dsap(), a.ssap(), a.data().len())
                    == (b.da(), b.sa(), b.fc(), b.dsap(), b.ssap(), b.data().len()) =>
            {
                Symptom::Value
            }
            [Some(_), Some(_)] => Symptom::Form,
            _ => Symptom::NoTelegram,
        }
    }
}
