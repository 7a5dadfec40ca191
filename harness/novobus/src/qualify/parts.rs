//! Parts of a qualification that was split: each has played the same conversations and probes, on drives of its own.
//!
//! What the first part has heard is noted as if it were alone. Of the others only what differs from it is noted as well, so that nothing is
//! counted twice and nothing is lost.

use super::settle::{ProbeAnswer, between};
use crate::language::syntax::Header;
use crate::rig::OnRings;
use crate::twin::{Conversation, Done};
use harness_bench::rig::PlayedScenario;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::line::Received;
use std::collections::BTreeMap;

/// What was sent and received in a conversation, each with its ring, without times.
#[derive(PartialEq, Eq)]
struct Bytes {
    sent: Vec<(usize, u8)>,
    received: Vec<(usize, Received)>,
}

impl Bytes {
    fn of(conversation: &Conversation) -> Self {
        let sent = conversation.done.iter().filter_map(|(ring, done)| {
            let Done::Sent(_, byte) = done else {
                return None;
            };
            Some((*ring, *byte))
        });
        let received = conversation.received.iter();
        Self {
            sent: sent.collect(),
            received: received.map(|(ring, _, byte)| (*ring, *byte)).collect(),
        }
    }

    fn all(conversations: &[Conversation]) -> Vec<Self> {
        conversations.iter().map(Self::of).collect()
    }
}

/// What the first part has heard, beside which the others are noted.
#[derive(Default)]
pub(super) struct Parts {
    /// Whether there are others.
    several: bool,
    /// Which other part is noted now.
    pub(super) other: Option<String>,
    /// The attempts at each conversation of the first part, and what came of it.
    conversations: BTreeMap<String, (Verdict, Vec<Vec<Bytes>>)>,
    /// The last probe of the first part.
    probe: Vec<Vec<Bytes>>,
}

impl Parts {
    /// What is played from now on is another part's.
    pub(super) fn follow(&mut self, other: Option<String>) {
        self.several |= other.is_some();
        self.other = other;
    }

    /// Keeps what the first part hears.
    pub(super) const fn keep(&mut self) {
        self.several = true;
    }

    /// Whether a conversation gave the same bytes and the same verdict in the first part.
    pub(super) fn repeats(&mut self, name: &str, played: &PlayedScenario) -> bool {
        if !self.several {
            return false;
        }
        let attempts = played.attempts.iter();
        let heard = attempts.map(|attempt| Bytes::all(&attempt.beside().conversations));
        let heard = (played.outcome.verdict, heard.collect());
        if self.other.is_some() {
            return self.conversations.get(name) == Some(&heard);
        }
        self.conversations.insert(name.to_owned(), heard);
        false
    }

    /// Whether the entries of a probe gave the same bytes in the first part.
    pub(super) fn repeats_probe(&mut self, conversations: &[Vec<Conversation>]) -> bool {
        if !self.several {
            return false;
        }
        let heard = conversations.iter().map(Vec::as_slice);
        let heard = heard.map(Bytes::all).collect();
        if self.other.is_some() {
            return self.probe == heard;
        }
        self.probe = heard;
        false
    }

    /// A name with the part, where it is not the first.
    pub(super) fn named(&self, name: &str) -> String {
        match &self.other {
            None => name.to_owned(),
            Some(part) => format!("{name} in part {part}"),
        }
    }
}

/// What came of asking a probe.
#[derive(Debug)]
pub(super) enum ProbeOutcome {
    /// A value, the header that makes it, and of a time the shortest and the longest that explain everything, in tenths of a millisecond.
    Settled {
        /// It, for people.
        value: String,
        /// What makes a simulated drive behave so.
        header: Header,
        /// The first and the last time.
        span: Option<(u64, u64)>,
    },
    /// The drive was not done when it was asked for the last time.
    NotDone(String),
    /// None, and why.
    Open(String),
}

impl ProbeOutcome {
    /// What several parts have shown of a property of the ring or of a drive. The error has their values, if they contradict each other.
    pub(super) fn agreed(
        property: &str,
        drive: Option<u8>,
        all: impl IntoIterator<Item = Self>,
    ) -> Result<Self, String> {
        let mut agreed = Self::Open("not asked".to_owned());
        for (place, asking) in all.into_iter().enumerate() {
            agreed = match place {
                0 => asking,
                _ => agreed.and(asking, property, drive)?,
            };
        }
        Ok(agreed)
    }

    fn and(self, other: Self, property: &str, drive: Option<u8>) -> Result<Self, String> {
        if self.text() == other.text() {
            return Ok(self);
        }
        match (&self, &other) {
            (_, Self::Open(_)) => Ok(self),
            (Self::Open(_), _) => Ok(other),
            (
                Self::Settled {
                    span: Some(this), ..
                },
                Self::Settled {
                    span: Some(other), ..
                },
            ) if this.0.max(other.0) <= this.1.min(other.1) => {
                let (from, to) = (this.0.max(other.0), this.1.min(other.1));
                match between(property, drive.unwrap_or(0), from, to) {
                    ProbeAnswer::Settled {
                        value,
                        header,
                        span,
                    } => Ok(Self::Settled {
                        value,
                        header,
                        span,
                    }),
                    _ => Ok(self),
                }
            }
            _ => Err(format!("{}, {}", self.text(), other.text())),
        }
    }

    /// It, for people.
    pub(super) fn text(&self) -> &str {
        match self {
            Self::Settled { value, .. } => value,
            Self::NotDone(why) | Self::Open(why) => why,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time(from: u64, to: u64) -> ProbeOutcome {
        ProbeOutcome::Settled {
            value: format!("{from} to {to}"),
            header: Header::default(),
            span: Some((from, to)),
        }
    }

    fn word(value: &str) -> ProbeOutcome {
        ProbeOutcome::Settled {
            value: value.to_owned(),
            header: Header::default(),
            span: None,
        }
    }

    fn agreed(all: impl IntoIterator<Item = ProbeOutcome>) -> Result<String, String> {
        let agreed = ProbeOutcome::agreed("eeprom-time", Some(1), all);
        agreed.map(|asking| asking.text().to_owned())
    }

    /// Parts that were played at other moments bracket the same time in another way.
    #[test]
    fn times_agree_where_they_overlap() {
        let both = agreed([time(100, 150), time(120, 170)]);
        assert_eq!(both, Ok("12ms to 15ms".to_owned()));
        let apart = agreed([time(100, 150), time(151, 170)]);
        assert_eq!(apart, Err("100 to 150, 151 to 170".to_owned()));
        let longer = ProbeOutcome::NotDone("longer than 200ms".to_owned());
        assert!(agreed([time(100, 150), longer]).is_err());
    }

    #[test]
    fn a_value_of_one_part_stands_until_another_contradicts_it() {
        let open = || ProbeOutcome::Open("not asked".to_owned());
        assert_eq!(agreed([open(), word("kept")]), Ok("kept".to_owned()));
        assert_eq!(agreed([word("kept"), open()]), Ok("kept".to_owned()));
        assert_eq!(agreed([word("kept"), word("kept")]), Ok("kept".to_owned()));
        assert!(agreed([word("kept"), open(), word("lost"), word("kept")]).is_err());
    }
}
