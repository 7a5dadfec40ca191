//! Conversations of telegrams as the engine explores them.

use super::act::{Harm, TelegramAct, TelegramActKind, TelegramTalk};
use super::generate::{Maker, TelegramScope, TelegramSpice};
use super::on_sim::OnLine;
use super::oracle::TelegramDifference;
use super::play::TelegramsSeen;
use super::setup::TelegramSetup;
use super::text::text;
use crate::buses::Bus;
use crate::explore::smaller::Acts;
use crate::explore::{
    Confirmation, Dice, Differing, ExploreError, Finding, FuzzCase, FuzzSettings, JudgedAgain,
    Pool, Rehearsal, Swarm, Target,
};
use harness_proto::profibus::Telegram;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

impl Differing for TelegramDifference {
    fn is_like(&self, other: &Self) -> bool {
        (self.what, &self.part) == (other.what, &other.part)
    }
    fn key(&self) -> String {
        self.signature()
    }
    fn signature(&self) -> String {
        let slave = self
            .slave
            .map_or(String::new(), |slave| format!("slave {slave}: "));
        format!(
            "{slave}{}, {} (NORDAC {})",
            self.part,
            self.what.words(),
            self.section
        )
    }
    fn about(&self) -> &str {
        &self.about
    }
    fn place(&self) -> Option<usize> {
        Some(self.telegram)
    }
    fn is_time(&self) -> bool {
        // Virtual time is the same in every attempt.
        false
    }
}

/// Nothing: simulated slaves do the same again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoAttempt {}

impl FuzzCase for TelegramTalk {
    type Scope = TelegramScope;
    type Setup = TelegramSetup;
    type Spice = TelegramSpice;
    type Seen = TelegramsSeen;
    type Difference = TelegramDifference;
    type Attempt = NoAttempt;
    type Act = TelegramAct;

    fn swarm(seed: u64, round: u64, scope: &TelegramScope) -> Swarm<TelegramSpice> {
        let needed = [
            TelegramSpice::Motion,
            TelegramSpice::Tasks,
            TelegramSpice::Services,
        ];
        Swarm::drawn(seed, round, &scope.spices, (&needed, TelegramSpice::Motion))
    }

    fn tour(_: &TelegramScope, _: &FuzzSettings<Self>) -> Vec<Self> {
        Vec::new()
    }

    fn made(
        scope: &TelegramScope,
        swarm: &Swarm<TelegramSpice>,
        _: (&[Self], u64),
        pool: &Pool<Self>,
        dice: &mut Dice,
    ) -> Self {
        let maker = Maker::new(scope, swarm);
        let old = dice.percent(40).then(|| pool.pick(0, dice)).flatten();
        let other = pool.pick(0, dice);
        match old {
            Some(old) => maker.mutated(old, other, dice),
            None => maker.case(dice),
        }
    }

    fn lane(&self) -> usize {
        0
    }

    fn text(finding: &Finding<Self>) -> Result<String, ExploreError> {
        let title = format!("Found by fuzzing: {}", finding.difference.signature());
        text(finding, &title)
    }

    fn again(
        finding: &Finding<Self>,
        about: &FuzzSettings<Self>,
        _: &BTreeMap<String, u8>,
    ) -> Result<JudgedAgain, ExploreError> {
        if about.ports {
            return Ok(JudgedAgain::Unknown);
        }
        let mut target = OnLine::new(finding.setup.under_test()?);
        let rehearsal = target.rehearse(&finding.case)?;
        let found = target.attempt(&finding.case, &rehearsal)?.difference;
        Ok(match found == Some(finding.difference.clone()) {
            true => JudgedAgain::Same,
            false => JudgedAgain::Differs(
                "its conversation does not differ as the finding says".to_owned(),
            ),
        })
    }

    fn is_sound(finding: &Finding<Self>) -> bool {
        finding.case.is_bounded() && finding.setup.bus == Bus::Nordac.name()
    }

    fn confirm(
        confirmation: &mut Confirmation<'_>,
        finding: &mut Finding<Self>,
        rehearsal: &Rehearsal<Self>,
        _: Option<&[TelegramAct]>,
        target: &mut dyn Target<Self>,
    ) -> Result<(), ExploreError> {
        confirmation.again(finding, rehearsal, target)?;
        if !finding.confirmed {
            confirmation.by_others(finding);
        }
        Ok(())
    }
}

impl Acts for TelegramTalk {
    fn acts(&mut self) -> &mut Vec<TelegramAct> {
        &mut self.acts
    }

    fn wait(act: &mut TelegramAct) -> &mut u64 {
        &mut act.wait_us
    }

    fn simpler(act: &TelegramAct) -> Vec<TelegramAct> {
        let mut all: Vec<_> = [1, act.times / 2, act.times - 1]
            .into_iter()
            .filter(|times| (1..act.times).contains(times))
            .map(|times| TelegramAct {
                times,
                ..act.clone()
            })
            .collect();
        let with = |what| TelegramAct {
            what,
            ..act.clone()
        };
        match &act.what {
            TelegramActKind::Ask(own) => {
                let mut plain = own.clone();
                plain.harm = None;
                plain.count = super::act::Count::Next;
                all.push(with(TelegramActKind::Ask(plain)));
                for at in 0..own.data.len() {
                    let mut lower = own.clone();
                    lower.data[at] = 0;
                    all.push(with(TelegramActKind::Ask(lower)));
                }
            }
            TelegramActKind::Octets { octets, harm } => {
                let shorter = |harm: Option<Harm>, octets: &[u8]| TelegramActKind::Octets {
                    octets: octets.to_vec(),
                    harm,
                };
                all.push(with(shorter(None, octets)));
                if octets.len() > 1 {
                    all.push(with(shorter(*harm, &octets[..octets.len() / 2])));
                    all.push(with(shorter(*harm, &octets[..octets.len() - 1])));
                }
            }
            TelegramActKind::Link { .. }
            | TelegramActKind::Fault { .. }
            | TelegramActKind::Restart { .. } => {}
        }
        all
    }

    fn measure(&self) -> (usize, u64, u64) {
        Self::measure(self)
    }
}

/// What a case shows: which reply followed which act and which reply before it, and what the replies say.
pub(super) fn features(seen: &TelegramsSeen) -> BTreeSet<u32> {
    let mut found = BTreeSet::new();
    let mut before = 0;
    let mut replies = seen.said.iter().peekable();
    let ends = seen.done.iter().skip(1).map(|own| own.at);
    let ends = ends.chain([harness_proto::time::Instant::NEVER]);
    for (done, end) in seen.done.iter().zip(ends) {
        let request = done.sent.as_ref().map_or(1, |own| kind(&own.octets));
        let mut reply = 0;
        while let Some(own) = replies.next_if(|own| own.at <= end) {
            reply = hash(&[reply, kind(&own.octets), u32::from(own.error.is_some())]);
        }
        found.insert(hash(&[1, request, reply]));
        found.insert(hash(&[2, before, reply]));
        before = reply;
    }
    found
}

/// A number for what a telegram is: of an exchange its control or status word and its parameter channel's task and number, of other
/// services their data.
fn kind(octets: &[u8]) -> u32 {
    let Some(Telegram::Pdu(pdu)) = Telegram::decode(octets).value() else {
        return hash(&[3, octets.first().copied().unwrap_or(0).into()]);
    };
    let data = pdu.data();
    let sap = pdu.dsap().map_or(0, |own| 1 + u32::from(own));
    let head = hash(&[sap, u32::from(pdu.fc().0 & 0x4F), data.len() as u32]);
    let word = |at: usize| {
        data.get(at..at + 2)
            .map_or(0, |own| u32::from(own[0]) << 8 | u32::from(own[1]))
    };
    match (pdu.dsap(), data.len()) {
        (None, 20 | 12) => hash(&[head, word(0), word(8)]),
        (None, _) => hash(&[head, word(0)]),
        (Some(_), _) => {
            let all: Vec<_> = data.iter().take(8).map(|own| u32::from(*own)).collect();
            hash(&[&[head][..], &all].concat())
        }
    }
}

/// FNV-1a.
fn hash(words: &[u32]) -> u32 {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.fold(0x811C_9DC5, |hash: u32, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}
