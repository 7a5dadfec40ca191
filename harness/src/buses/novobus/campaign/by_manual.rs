//! A conversation in bytes, read and repaired by the manual alone (ND21 9.7, 9.8). The master compares the bytes that come back with the
//! expected ones, continues with SYNCO, reads the number of the drive that the ring spells out, sends the check sequence and repeats the
//! incomplete telegrams.

use super::class::{CaseEvidence, Wrong};
use super::conversation::Answers;
use super::sound::{Sound, all_back};
use crate::buses::SimulatedLink;
use crate::buses::novobus::locate::{MAX_ZEROS, locate};
use crate::campaign::fault::{CaseFaults, link_index};
use crate::link::{Link, Moment, Octets, PlacedFault};
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::sync::SYNCO;

/// Byte times in which a ring spells out an address: a telegram is ended first, 25 zeros come at most, and the address
/// often enough to be believed (9.7).
const SPELLING: usize = 9 + MAX_ZEROS + 14;
/// The same behind a time-out: 20 ms of silence twice, and a zero needs a byte time (9.9).
const SPELLING_AFTER_SILENCE: usize = SPELLING + 150;

/// What the master sent, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// Why.
    pub why: &'static str,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A conversation that is ready to be disturbed.
#[derive(Clone, Debug)]
pub struct ByManual {
    start: SimulatedLink,
    answers: Answers,
    sound: Sound,
    /// What comes back without a fault.
    first: Vec<Received>,
    spelling: usize,
}

/// A ring under a master that goes by the manual.
struct Play<'a> {
    of: &'a ByManual,
    link: SimulatedLink,
    said: Vec<Said>,
    evidence: CaseEvidence,
    /// For how many byte times the faults last.
    lasts: usize,
    /// What came back at first, as far as it was not repeated: without a fault the first time. What is repeated comes when
    /// all faults are over, and brings what the cell holds then.
    kept: Vec<Received>,
}

fn send(link: &mut SimulatedLink, bytes: &[u8]) -> Vec<Received> {
    let end = link.send_octets(0, bytes);
    link.run_until(end);
    std::iter::from_fn(|| link.receive_octet(0).map(|(_, byte)| byte)).collect()
}

/// What came back for `sent`, without the SYNCO that were under way before it.
fn behind_synco<'a>(heard: &'a [Received], sent: &[u8]) -> &'a [Received] {
    let own = sent.iter().take_while(|byte| **byte == SYNCO).count();
    let all = heard.iter().take_while(|byte| byte.is(SYNCO)).count();
    &heard[all.saturating_sub(own)..]
}

impl ByManual {
    /// Plays the conversation twice without a fault. `None` where the second time leaves something else than the first: a
    /// master that repeats telegrams would do so too.
    #[must_use]
    pub fn new(start: SimulatedLink, bytes: Vec<u8>) -> Option<Self> {
        let drives = start.drives(0);
        let spelling = if Sound::any_monitors(&start) {
            SPELLING_AFTER_SILENCE
        } else {
            SPELLING
        };
        let mut sound = Sound::new(start.clone());
        let mut link = start.clone();
        let mut round = |link: &mut SimulatedLink| {
            let mut heard = Vec::new();
            let fill = std::iter::repeat_n(SYNCO, usize::from(drives) + 2);
            for byte in bytes.iter().copied().chain(fill) {
                heard.extend(send(link, &[byte]));
                sound.note(link);
            }
            heard
        };
        let first = round(&mut link);
        let once = link.clone();
        round(&mut link);
        if !sound.wrong(&once, true).is_empty() {
            return None;
        }
        let answers = Answers::new(bytes, drives, &first);
        Some(Self {
            start,
            answers,
            sound,
            first,
            spelling,
        })
    }

    /// The conversation.
    #[must_use]
    pub fn answers(&self) -> &Answers {
        &self.answers
    }

    /// Plays a case.
    #[must_use]
    pub fn play(&self, case: &CaseFaults) -> (CaseEvidence, Vec<Said>) {
        let mut link = self.start.clone();
        let byte_time = link.byte_time();
        let mut lasts = 0;
        for fault in case.faults() {
            for (distance, what) in fault.what.on_link() {
                let placed = PlacedFault::Link(fault.link, what);
                link.inject(0, placed, Moment::Byte(fault.byte + distance));
            }
            lasts += fault.what.lasts(byte_time);
        }
        let mut play = Play {
            of: self,
            link,
            said: Vec::new(),
            evidence: CaseEvidence::default(),
            lasts: usize::try_from(lasts).unwrap_or(usize::MAX),
            kept: Vec::new(),
        };
        play.all();
        (play.evidence, play.said)
    }
}

impl Play<'_> {
    fn say(&mut self, why: &'static str, bytes: Vec<u8>) -> Vec<Received> {
        let heard = send(&mut self.link, &bytes);
        self.said.push(Said { why, bytes });
        heard
    }

    fn drives(&self) -> usize {
        usize::from(self.of.answers.shape.drives)
    }

    /// SYNCO until what was sent before has come back, however late, and some more.
    fn synco(&self, more: usize) -> Vec<u8> {
        vec![SYNCO; self.drives() + 2 + self.lasts + more]
    }

    fn all(&mut self) {
        let answers = &self.of.answers;
        let mut heard = self.say("the conversation", answers.sent.clone());
        let fill = self.synco(self.of.spelling);
        heard.extend(self.say("SYNCO, while the ring spells out an address (9.7)", fill));
        let wrong = answers.wrong(&heard, 0);
        self.evidence.confirmed = wrong.is_none();
        let restart = wrong.map(|wrong| answers.restart(wrong));
        if let (Some(wrong), Some(restart)) = (wrong, restart) {
            self.name(&heard, wrong);
            self.repair(restart);
        }
        heard.truncate(restart.unwrap_or(answers.sent.len()));
        self.kept = heard;
        self.evidence.wrong = self.wrong_values();
        if !self.evidence.confirmed || self.of.sound.waits_as(&self.link) {
            self.evidence.all_back = all_back(&self.link);
            return;
        }
        // Something is left that only the next telegrams can show.
        let why = "the conversation once more, without a fault";
        let mut heard = self.say(why, answers.sent.clone());
        heard.extend(self.say("SYNCO", self.synco(self.of.spelling)));
        let heard = behind_synco(&heard, &answers.sent);
        if let Some(wrong) = answers.wrong(heard, 0) {
            self.evidence.confirmed = false;
            if !self.evidence.noticed {
                self.name(heard, wrong);
            }
            self.repair(answers.restart(wrong));
        }
        self.evidence.all_back = all_back(&self.link);
    }

    /// Notes the link that the master blames for a wrong byte.
    fn name(&mut self, heard: &[Received], wrong: usize) {
        self.evidence.noticed = true;
        let drives = self.of.answers.shape.drives;
        // No drive passes a damaged byte on: a line error at the master happened on the last link.
        let damaged = heard.get(wrong).is_some_and(|byte| byte.error.is_some());
        self.evidence.named = if damaged {
            Some(usize::from(drives))
        } else {
            locate(heard, drives).and_then(|location| link_index(drives, location.drive))
        };
    }

    /// Check sequences, each with the telegrams from `restart` on behind it, until all have been answered. Half as many as
    /// there are drives and one more suffice; one more still, for faults that last.
    fn repair(&mut self, restart: usize) {
        let most = self.drives() / 2 + 2;
        for _ in 0..most {
            self.evidence.sequences += 1;
            let mut heard = self.say("the check sequence (9.8)", CHECK_SEQUENCE.to_vec());
            let repeated = self.of.answers.sent[restart..].to_vec();
            heard.extend(self.say("the telegrams that were not completed, repeated", repeated));
            heard.extend(self.say("SYNCO", self.synco(1)));
            let is_sequence = |bytes: &[Received]| {
                let mut pairs = bytes.iter().zip(SEQUENCE);
                pairs.all(|(received, byte)| received.is(byte))
            };
            let whole = heard.windows(SEQUENCE.len()).rposition(is_sequence);
            let Some(place) = whole else { continue };
            let behind = &heard[place + SEQUENCE.len()..];
            let wrong = self.of.answers.wrong(behind, restart);
            if wrong.is_none() {
                self.evidence.confirmed = true;
                return;
            }
        }
    }

    /// Cells with wrong contents, and data that differed.
    fn wrong_values(&self) -> Vec<Wrong> {
        let mut wrong = self.of.sound.wrong(&self.link, self.evidence.confirmed);
        if !self.evidence.confirmed {
            return wrong;
        }
        for (place, drive) in self.of.answers.data() {
            let both = (self.kept.get(place), self.of.first.get(place));
            if let (Some(received), Some(expected)) = both
                && received != expected
            {
                wrong.push(Wrong::Answer {
                    drive,
                    value: received.byte.into(),
                    expected: expected.byte.into(),
                });
            }
        }
        wrong
    }
}
