//! Exchanges with a ring behind a port, one after the other since its drives were made ready, beside the models that it may be.

use super::case::{Act, ActKind, Case, Harm, OtherRing, Talk, To};
use super::expect::{Both, Must, RingModel};
use super::oracle::{Difference, sent};
use super::order::RawCommand;
use crate::section::SentBytes;
use crate::twin;
use harness_proto::line::Received;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::properties::{
    BrokenSequence, EmptyShortTelegram, Properties, ReadLongAnswer, ShortAddress,
};
use harness_proto::novobus::role::{Role, roles_with};
use std::collections::BTreeMap;

/// The first conversation with drives that were made ready: a telegram that addresses no drive, after which every drive knows its
/// address (ND21 9.3).
pub(crate) fn prologue(drives: u8, beside: Option<OtherRing>) -> Case {
    let read = RawCommand::ReadByte { cell: 0xFE13 };
    Case {
        drives,
        beside,
        acts: vec![Act::sound(ActKind::Talk(Talk::one(To::Nobody(0), read)))],
    }
}

/// The bytes that the master sent, the faults on links, and the bytes that came back.
#[derive(Clone, Debug, Default)]
pub(crate) struct BytesExchanged {
    /// Bytes, and whether each went round whole.
    sent: Vec<(u8, bool)>,
    /// What happens on links: which link, which byte on it counted from 1.
    harms: BTreeMap<(usize, u64), Vec<Harm>>,
    received: Vec<Received>,
}

impl BytesExchanged {
    /// A case that was played.
    pub(crate) fn of(case: &Case, received: Vec<Received>) -> Self {
        let mut harms: BTreeMap<_, Vec<Harm>> = BTreeMap::new();
        for (link, byte, harm) in case.faults() {
            let place = (usize::from(link), byte);
            harms.entry(place).or_default().push(harm);
        }
        Self {
            sent: sent(case),
            harms,
            received,
        }
    }
}

/// The first byte that no model explains.
#[derive(Clone, Debug)]
struct Mismatch {
    index: usize,
    what: twin::Symptom,
    must: Option<Must>,
    /// The section of the manual with the rule, and the rule in a few words.
    rule: (&'static str, &'static str),
    /// The drive that the telegram of the byte addresses. `None` after an error: drives in the error mode read no telegrams (ND21 9.7).
    meant: Option<u8>,
}

/// What a ring has done since its drives were made ready.
#[derive(Clone, Debug)]
pub(crate) struct Judge {
    ring: usize,
    size: RingSize,
    /// Whether the link shows line errors at their bytes.
    line_errors: bool,
    /// What of the manual's open properties the ring can still have; that of the model first.
    possible: Vec<Properties>,
    model: RingModel,
    log: Vec<BytesExchanged>,
    /// All bytes of the log.
    sent: Vec<(u8, bool)>,
}

impl Judge {
    /// Starts with a ring, counted from 0, of which only the size is known.
    pub(crate) fn new(ring: usize, size: RingSize, line_errors: bool) -> Self {
        let possible = all_properties();
        Self {
            ring,
            size,
            line_errors,
            model: RingModel::new(size, Properties::default()),
            possible,
            log: Vec::new(),
            sent: Vec::new(),
        }
    }

    /// Notes that the drives were made ready: the contents of their cells are unknown again. Their kind stays known.
    pub(crate) fn begin(&mut self) {
        self.log.clear();
        self.sent.clear();
        let properties = self.possible.first().copied().unwrap_or_default();
        self.model = RingModel::new(self.size, properties);
    }

    /// Whether the link shows line errors at their bytes.
    pub(crate) const fn line_errors(&self) -> bool {
        self.line_errors
    }

    /// What of the open properties the ring can still have, as places among all that it could have.
    pub(crate) fn possible(&self) -> Vec<u8> {
        let all = (0..).zip(all_properties());
        let possible = all.filter(|(_, properties)| self.possible.contains(properties));
        possible.map(|(place, _)| place).collect()
    }

    /// Limits them to these places.
    pub(crate) fn set_possible(&mut self, places: &[u8]) {
        let all = (0..).zip(all_properties());
        let possible = all.filter(|(place, _)| places.contains(place));
        self.possible = possible.map(|(_, properties)| properties).collect();
        self.begin();
    }

    /// Mismatch of a ring with every drive that the manual permits. Call [`Self::begin`] after it.
    pub(crate) fn see(&mut self, exchange: BytesExchanged) -> Option<Difference> {
        let before = self.possible.clone();
        let mut best: Option<Mismatch> = None;
        loop {
            match self.follow(&exchange) {
                Ok(()) => {
                    self.sent.extend(&exchange.sent);
                    self.log.push(exchange);
                    return None;
                }
                // The model that explains most bytes gives the best description of the fault.
                Err(found) if best.as_ref().is_none_or(|best| found.index > best.index) => {
                    best = Some(found);
                }
                Err(_) => {}
            }
            if !self.next_model() {
                self.possible = before;
                return best.map(|found| self.difference(&found, &exchange));
            }
        }
    }

    /// The next model that explains everything so far.
    fn next_model(&mut self) -> bool {
        let log = std::mem::take(&mut self.log);
        while self.possible.len() > 1 {
            self.possible.remove(0);
            self.begin();
            let mut again = log.iter();
            if again.all(|exchange| {
                let explained = self.follow(exchange).is_ok();
                self.sent.extend(&exchange.sent);
                explained
            }) {
                self.log = log;
                return true;
            }
        }
        false
    }

    /// Lets the model live through an exchange.
    fn follow(&mut self, exchange: &BytesExchanged) -> Result<(), Mismatch> {
        let all = [&self.sent[..], &exchange.sent[..]].concat();
        let roles = roles_with(self.size, &all, &self.model.properties);
        let mut counts = vec![0; usize::from(self.size.drives()) + 1];
        let mut index = 0;
        for (place, (byte, _)) in (self.sent.len()..).zip(&exchange.sent) {
            let role = &roles[place];
            let meant = role.answering().filter(|_| !self.model.any_in_error());
            for out in around(&mut self.model, *byte, &mut counts, &exchange.harms) {
                let Some(must) = self.model.must(out, *role) else {
                    continue;
                };
                let Some(what) = self.compare(out, must, exchange.received.get(index)) else {
                    let received = exchange.received.get(index).map_or(0, |byte| byte.byte);
                    self.model.take(*byte, *role, must, received);
                    index += 1;
                    continue;
                };
                if !must.may_be_missing {
                    let what = match what {
                        twin::Symptom::Value if self.is_shifted(exchange) => twin::Symptom::Surplus,
                        other => other,
                    };
                    let sent = SentBytes {
                        bytes: &all,
                        roles: &roles,
                    };
                    return Err(Mismatch {
                        index,
                        what,
                        must: Some(must),
                        rule: sent.broken(place, what),
                        meant,
                    });
                }
            }
            if self.model.was_reset() {
                return Ok(());
            }
        }
        match index < exchange.received.len() {
            true => Err(Mismatch {
                index,
                what: twin::Symptom::Surplus,
                must: None,
                rule: Role::Foreign.rule(),
                meant: None,
            }),
            false => Ok(()),
        }
    }

    /// Whether more bytes came than were sent.
    fn is_shifted(&self, exchange: &BytesExchanged) -> bool {
        exchange.harms.is_empty() && exchange.received.len() > exchange.sent.len()
    }

    fn compare(&self, out: Both, must: Must, received: Option<&Received>) -> Option<twin::Symptom> {
        let Some(received) = received else {
            return Some(twin::Symptom::Missing);
        };
        let noticed = out[0].is_some_and(|byte| byte.error.is_some());
        if (received.byte ^ must.byte) & !must.open != 0 {
            Some(twin::Symptom::Value)
        } else if self.line_errors && received.error.is_some() != noticed {
            Some(twin::Symptom::LineStatus)
        } else {
            None
        }
    }

    fn difference(&self, found: &Mismatch, exchange: &BytesExchanged) -> Difference {
        let (section, rule) = found.rule;
        let received = match exchange.received.get(found.index) {
            None => "nothing".to_owned(),
            Some(Received { byte, error: None }) => format!("{byte:02X}"),
            Some(Received {
                byte,
                error: Some(error),
            }) => format!("{byte:02X} ({error})"),
        };
        let must = match found.must {
            None => "nothing".to_owned(),
            Some(Must { byte, open: 0, .. }) => format!("{byte:02X}"),
            Some(Must { byte, open, .. }) => {
                format!("{:02X} in the bits {:02X}", byte & !open, !open)
            }
        };
        let ring = if self.ring == 0 { "" } else { " of ring 2" };
        let (what, number) = (found.what.words(), found.index + 1);
        Difference {
            what: found.what,
            section: section.to_owned(),
            rule: rule.to_owned(),
            ring: self.ring,
            drive: None,
            meant: found.meant,
            byte: Some(number),
            time: false,
            about: format!(
                "byte {number}{ring}: {what}: received {received}, the manual says {must} (ND21 {section}, {rule})"
            ),
        }
    }

    /// Predicts the effects of a case on the drives, as far as the model knows.
    pub(crate) fn foresee(&self, case: &Case) -> Foreseen {
        let mut model = self.model.clone();
        let mut seen = Foreseen::default();
        let case = BytesExchanged::of(case, Vec::new());
        let all = [&self.sent[..], &case.sent[..]].concat();
        let roles = roles_with(self.size, &all, &model.properties);
        let mut counts = vec![0; usize::from(self.size.drives()) + 1];
        for ((byte, _), role) in case.sent.iter().zip(&roles[self.sent.len()..]) {
            for out in around(&mut model, *byte, &mut counts, &case.harms) {
                let Some(must) = model.must(out, *role) else {
                    continue;
                };
                let check = matches!(role, Role::Check { .. }) && model.awaits_open(*role);
                if must.open != 0 || check || model.was_reset() {
                    seen.open.push(seen.count);
                }
                model.take(*byte, *role, must, must.byte);
                seen.count += 1;
            }
            seen.is_harmful |= model.writes_what_drives_use();
        }
        // A fault may or may not turn a byte that is the drive's choice into a sync byte.
        seen.is_harmful |= !case.harms.is_empty() && !seen.open.is_empty();
        seen
    }
}

/// The predicted effects of a case.
#[derive(Clone, Debug, Default)]
pub(crate) struct Foreseen {
    /// How many bytes come back.
    pub(crate) count: usize,
    /// Indexes of those that drives may answer in more than one way.
    pub(crate) open: Vec<usize>,
    /// Whether the case writes unknown cells or cells that a drive's program uses, or a fault hits a byte that is the drive's choice. No
    /// model predicts the result.
    pub(crate) is_harmful: bool,
}

/// A byte of the master's on its way round.
fn around(
    model: &mut RingModel,
    byte: u8,
    counts: &mut [u64],
    harms: &BTreeMap<(usize, u64), Vec<Harm>>,
) -> Vec<Both> {
    let mut bytes: Vec<Both> = vec![[Some(Received::good(byte)); 2]];
    for (place, count) in counts.iter_mut().enumerate() {
        let mut next = Vec::with_capacity(bytes.len());
        for byte in bytes {
            *count += 1;
            match harms.get(&(place, *count)) {
                None => next.push(byte),
                Some(harms) => next.extend(harmed(byte, harms)),
            }
        }
        bytes = next
            .into_iter()
            .map(|byte| model.pass(place, byte))
            .filter(|byte| *byte != [None; 2])
            .collect();
    }
    bytes
}

/// What arrives of a byte.
fn harmed(byte: Both, harms: &[Harm]) -> Vec<Both> {
    let mut changed = byte;
    let (mut before, mut again, mut lost) = (Vec::new(), false, false);
    for harm in harms {
        match *harm {
            Harm::Flip { data, .. } => {
                let harness_bench::link::LinkFault::Flip(flips) = harm.fault() else {
                    continue;
                };
                changed = changed.map(|byte| {
                    byte.map(|byte| Received {
                        byte: byte.byte ^ data,
                        error: byte.error.or(flips.noticed()),
                    })
                });
            }
            Harm::Replace(new) => changed = changed.map(|byte| byte.map(|_| Received::good(new))),
            Harm::Insert(new) => before.push([Some(Received::good(new)); 2]),
            Harm::Duplicate => again = true,
            Harm::Drop => lost = true,
            // `OnRig` has none of these.
            Harm::Delay(_) | Harm::Break(_) | Harm::Overrun => {}
        }
    }
    if !lost {
        before.push(changed);
        before.extend(again.then_some(changed));
    }
    before
}

/// What the manual leaves open of the bus, the default first. Times of 9.9 are not among it: cases on ports have no time-outs.
pub(super) fn all_properties() -> Vec<Properties> {
    let mut all = Vec::new();
    for empty_short_telegram in [EmptyShortTelegram::Accepted, EmptyShortTelegram::Error] {
        for short_address in [ShortAddress::NotAddressed, ShortAddress::KeptSum] {
            for read_long in [ReadLongAnswer::FourData, ReadLongAnswer::AsPrinted] {
                for broken_sequence in [BrokenSequence::Answered, BrokenSequence::Forwarded] {
                    all.push(Properties {
                        empty_short_telegram,
                        short_address,
                        read_long,
                        broken_sequence,
                        ..Properties::default()
                    });
                }
            }
        }
    }
    all
}

#[cfg(test)]
mod tests;
