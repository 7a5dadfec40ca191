//! A conversation in bytes, read and repaired by the manual alone (ND21 9.7, 9.8). The master compares the bytes that come back with the
//! expected ones, continues with SYNCO, reads the number of the drive that the ring spells out, sends the check sequence and repeats the
//! incomplete telegrams.

use super::class::{CaseEvidence, WrongValue};
use super::conversation::Answers;
use super::sound::{DrivesBeyondBus, Sound};
use crate::campaign::fault::CaseFaults;
use crate::campaign::fault::link_index;
use crate::link::SimulatedLink;
use crate::locate::{MAX_ZEROS, locate};
use harness_bench::link::{Link, Moment, Octets, PlacedFault};
use harness_proto::line::Received;
use harness_proto::novobus::check_sequence::{CHECK_SEQUENCE, SEQUENCE};
use harness_proto::novobus::sync::SYNCO;
use harness_sim::novobus::drive::Drive;
use harness_sim::novobus::ring::Ring;

/// Byte times in which a ring spells out an address: a telegram is ended first, 25 zeros come at most, and the address
/// often enough to be believed (9.7).
const SPELLING: usize = 9 + MAX_ZEROS + 14;
/// The same after a time-out: 20 ms of silence twice, and a zero needs a byte time (9.9).
const SPELLING_AFTER_SILENCE: usize = SPELLING + 150;

/// What the master sent, and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MasterBytes {
    pub why: &'static str,
    pub bytes: Vec<u8>,
}

/// A conversation that is ready to be disturbed.
#[derive(Clone, Debug)]
pub(crate) struct ByManual {
    start: SimulatedLink,
    answers: Answers,
    sound: Sound,
    /// What comes back without a fault.
    first: Vec<Received>,
    spelling: usize,
}

/// What a master by the manual talks to.
pub(super) trait Wire: DrivesBeyondBus {
    /// Sends bytes without a gap; returns what came back until the last one had been sent.
    fn exchange(&mut self, bytes: &[u8]) -> Vec<Received>;
}

impl Wire for SimulatedLink {
    fn exchange(&mut self, bytes: &[u8]) -> Vec<Received> {
        let end = self.send_octets(0, bytes);
        self.run_until(end);
        std::iter::from_fn(|| self.receive_octet(0).map(|(_, byte)| byte)).collect()
    }
}

/// A ring under a master that goes by the manual.
struct Play<'a, W> {
    of: &'a ByManual,
    wire: W,
    said: Vec<MasterBytes>,
    evidence: CaseEvidence,
    /// For how many byte times the faults last.
    lasts: usize,
    /// What came back at first, as far as it was not repeated: without a fault the first time. What is repeated comes when
    /// all faults are over, and brings what the cell holds then.
    kept: Vec<Received>,
}

/// What came back for `sent`, without the SYNCO that were under way before it.
fn behind_synco<'a>(heard: &'a [Received], sent: &[u8]) -> &'a [Received] {
    let expected = sent.iter().take_while(|byte| **byte == SYNCO).count();
    let all = heard.iter().take_while(|byte| byte.is(SYNCO)).count();
    &heard[all.saturating_sub(expected)..]
}

impl ByManual {
    /// Plays the conversation twice without a fault. `None` where the second time leaves something else than the first: a
    /// master that repeats telegrams would do so too.
    #[must_use]
    pub(crate) fn new(start: SimulatedLink, bytes: Vec<u8>) -> Option<Self> {
        let drives = start.count();
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
                heard.extend(link.exchange(&[byte]));
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

    #[must_use]
    pub(crate) fn answers(&self) -> &Answers {
        &self.answers
    }

    /// Plays a case on a ring of its own, from the start.
    #[must_use]
    pub(crate) fn play(&self, case: &CaseFaults) -> (CaseEvidence, Vec<MasterBytes>) {
        let mut link = self.start.clone();
        for fault in case.faults() {
            for (distance, what) in fault.what.on_link() {
                let placed = PlacedFault::Link(fault.link, what);
                link.inject(0, placed, Moment::Byte(fault.byte + distance));
            }
        }
        let heard = link.exchange(&self.opening(self.lasts(case)));
        self.play_on(link, heard, self.lasts(case))
    }

    /// The ring before anything is sent.
    pub(super) fn ring(&self) -> Option<&Ring<Drive>> {
        self.start.ring(0)
    }

    /// For how many byte times the faults of a case last.
    pub(super) fn lasts(&self, case: &CaseFaults) -> usize {
        let byte_time = self.start.byte_time();
        let lasts = case.faults().map(|fault| fault.what.lasts(byte_time));
        usize::try_from(lasts.sum::<u64>()).unwrap_or(usize::MAX)
    }

    /// SYNCO until what was sent before has come back, if faults last for `lasts` byte times.
    fn fill(&self, lasts: usize) -> usize {
        usize::from(self.answers.shape.drives) + 2 + lasts
    }

    /// What the master sends before it looks at what came back.
    pub(super) fn opening(&self, lasts: usize) -> Vec<u8> {
        let mut bytes = self.answers.sent.clone();
        bytes.resize(bytes.len() + self.fill(lasts) + self.spelling, SYNCO);
        bytes
    }

    /// Reads what came back for the [opening](Self::opening), and repairs the ring.
    pub(super) fn play_on(
        &self,
        wire: impl Wire,
        heard: Vec<Received>,
        lasts: usize,
    ) -> (CaseEvidence, Vec<MasterBytes>) {
        let fill = vec![SYNCO; self.fill(lasts) + self.spelling];
        let mut play = Play {
            of: self,
            wire,
            said: vec![
                MasterBytes::new("the conversation", self.answers.sent.clone()),
                MasterBytes::new("SYNCO, while the ring spells out an address (9.7)", fill),
            ],
            evidence: CaseEvidence::default(),
            lasts,
            kept: Vec::new(),
        };
        play.all(heard);
        (play.evidence, play.said)
    }
}

impl MasterBytes {
    fn new(why: &'static str, bytes: Vec<u8>) -> Self {
        Self { why, bytes }
    }
}

impl<W: Wire> Play<'_, W> {
    /// Sends all of it without a gap.
    fn say(&mut self, said: impl IntoIterator<Item = MasterBytes>) -> Vec<Received> {
        let from = self.said.len();
        self.said.extend(said);
        let bytes: Vec<_> = self.said[from..]
            .iter()
            .flat_map(|said| said.bytes.iter().copied())
            .collect();
        self.wire.exchange(&bytes)
    }

    /// SYNCO until what was sent before has come back, however late, and some more.
    fn synco(&self, more: usize) -> MasterBytes {
        MasterBytes::new("SYNCO", vec![SYNCO; self.of.fill(self.lasts) + more])
    }

    /// Goes on behind the opening, for which this came back.
    fn all(&mut self, mut heard: Vec<Received>) {
        let answers = &self.of.answers;
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
        if !self.evidence.confirmed || self.of.sound.waits_as(&self.wire) {
            self.evidence.all_back = Sound::all_back(&self.wire);
            return;
        }
        // Something is left that only the next telegrams can show.
        let why = "the conversation once more, without a fault";
        let fill = self.synco(self.of.spelling);
        let heard = self.say([MasterBytes::new(why, answers.sent.clone()), fill]);
        let heard = behind_synco(&heard, &answers.sent);
        if let Some(wrong) = answers.wrong(heard, 0) {
            self.evidence.confirmed = false;
            if !self.evidence.noticed {
                self.name(heard, wrong);
            }
            self.repair(answers.restart(wrong));
        }
        self.evidence.all_back = Sound::all_back(&self.wire);
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
        let most = usize::from(self.of.answers.shape.drives) / 2 + 2;
        for _ in 0..most {
            self.evidence.sequences += 1;
            let repeated = self.of.answers.sent[restart..].to_vec();
            let heard = self.say([
                MasterBytes::new("the check sequence (9.8)", CHECK_SEQUENCE.to_vec()),
                MasterBytes::new("the telegrams that were not completed, repeated", repeated),
                self.synco(1),
            ]);
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
    fn wrong_values(&self) -> Vec<WrongValue> {
        let mut wrong = self.of.sound.wrong(&self.wire, self.evidence.confirmed);
        if !self.evidence.confirmed {
            return wrong;
        }
        for (place, drive) in self.of.answers.data() {
            let both = (self.kept.get(place), self.of.first.get(place));
            if let (Some(received), Some(expected)) = both
                && received != expected
            {
                wrong.push(WrongValue::Answer {
                    drive,
                    value: received.byte.into(),
                    expected: expected.byte.into(),
                });
            }
        }
        wrong
    }
}
