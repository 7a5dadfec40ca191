//! How replies of slaves differ, and what of them the manual leaves open.

use super::hex;
use super::play::{Done, TelegramsSeen};
use crate::judge::{ReplySubject, Symptom};
use crate::simulate::Setup;
use harness_bench::capture::runs::HeardTelegram;
use harness_proto::nordac::properties::{Accepts, Description, PROPERTIES, Properties};
use harness_proto::profibus::Telegram;
use serde::{Deserialize, Serialize};

/// The open point that only the PosiCon option shows.
const POSICON: &str = "position-count";

/// The first reply that no model explains.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TelegramDifference {
    /// How it differs.
    pub(crate) what: Symptom,
    /// The service, and the part of its data.
    pub(crate) part: String,
    /// The section that says most about it, such as `3.2.2`, or `EN 2`.
    pub(crate) section: String,
    /// The slave.
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

/// Every property with every value.
fn values() -> impl Iterator<Item = (&'static Description, String)> {
    PROPERTIES.iter().flat_map(|property| {
        let words: Vec<String> = match property.accepts {
            Accepts::Words(words) => words.iter().map(|own| (*own).to_owned()).collect(),
            Accepts::Count { least, most, .. } => {
                (least..=most).map(|own| own.to_string()).collect()
            }
        };
        words.into_iter().map(move |word| (property, word))
    })
}

/// All properties that differ in one open point.
pub(super) fn neighbours(own: &Properties, posicon: bool) -> impl Iterator<Item = Properties> {
    let own = *own;
    let shown = values().filter(move |(property, _)| posicon || property.name != POSICON);
    shown.filter_map(move |(property, word)| {
        let mut new = own;
        (property.set(&mut new, &word) && new != own).then_some(new)
    })
}

/// The open points of an assignment as header lines, where they do not have their default.
pub(super) fn lines(under_test: &Setup, assignment: &[Properties]) -> Vec<String> {
    let mut lines = Vec::new();
    for (slave, own) in under_test.slaves.iter().zip(assignment) {
        let usual = Properties::default();
        for (property, word) in values() {
            let (mut same, mut other) = (*own, usual);
            let set = property.set(&mut same, &word) && property.set(&mut other, &word);
            if set && same == *own && other != usual {
                lines.push(format!(
                    "slave {} property {} = {word}",
                    slave.address, property.name
                ));
            }
        }
    }
    lines
}

/// How unlike two telegrams are.
pub(super) fn unlike(a: &HeardTelegram, b: &HeardTelegram) -> i64 {
    let sender = i64::from(a.from != b.from);
    let length = a.octets.len().abs_diff(b.octets.len()) as i64;
    let error = i64::from(a.error != b.error);
    // The sum at the end says the same again.
    let body = |own: &HeardTelegram| own.octets.len().saturating_sub(2);
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
    let request = asked(of, about_it).and_then(|own| of.done[own].sent.as_ref());
    let request = request.and_then(|own| Telegram::decode(&own.octets).value());
    let place = match (
        wanted.and_then(HeardTelegram::telegram),
        came.and_then(HeardTelegram::telegram),
    ) {
        (Some(Telegram::Pdu(a)), Some(Telegram::Pdu(b))) if what == Symptom::Value => {
            let slaves = &setup.slaves;
            let own = slaves.iter().find(|own| Some(own.address) == about_it.from);
            let ppo = own.map(|own| own.ppo).unwrap_or_default();
            ReplySubject::of_data(request.as_ref(), ppo, &a, &b)
        }
        _ => ReplySubject::of(request.as_ref()),
    };
    let said = |own: Option<&HeardTelegram>| {
        own.map_or("no telegram".to_owned(), |own| {
            let error = own.error.map_or(String::new(), |(octet, error)| {
                format!(" with a {error} error in octet {octet}")
            });
            format!("{}{error}, ended at {},", hex::written(&own.octets), own.at)
        })
    };
    let any = match under.is_empty() {
        true => "",
        false => " with the values of open points that explain most",
    };
    let asked_for = request.map_or("other octets".to_owned(), |own| hex::written(&own.encode()));
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

/// Behind which act a telegram was sent, counted as they happened.
fn asked(seen: &TelegramsSeen, own: &HeardTelegram) -> Option<usize> {
    let before = |done: &Done| done.sent.is_some() && done.at < own.at;
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
