//! What the master sends in a campaign, taken from a scenario, and what must come back (ND21 9.1-9.6).

use crate::campaign::plan::Shape;
use crate::language::plan::{Plan, PlannedCall, RingAct};
use harness_bench::scenario::plan::{PlannedAction, PlannedWhen};
use harness_bench::scenario::problem::{Problem, TextSpan};
use harness_proto::line::Received;
use harness_proto::novobus::checksum::Checksum;
use harness_proto::novobus::command::{LAYOUTS, Layout, Reply};
use harness_proto::novobus::sync::{Addressing, SyncByte};
use harness_sim::novobus::drive::Model;
use std::collections::BTreeMap;

/// Maximum number of bytes, or calls, of a conversation: it is played again for every case.
const MAX_LENGTH: usize = 4096;

/// What the master sends.
#[derive(Clone, Debug)]
pub(crate) enum MasterTalk {
    /// These bytes, without a gap; a master by the manual alone reads what comes back (9.7, 9.8).
    Bytes(Vec<u8>),
    /// These calls, one step of the scenario after the other; the driver plays them.
    Calls(Vec<Vec<(u8, PlannedCall)>>),
}

/// Extracts the conversation of a scenario: its `>` lines and jobs, or its `master` lines. Faults, checks and expectations are left
/// out, because a campaign has its own.
///
/// # Errors
/// A step that a campaign does not play, or drives whose cells change by themselves.
pub(crate) fn talk(plan: &Plan) -> Result<MasterTalk, Problem> {
    let start = TextSpan::default();
    let refused = |span, message: &str| {
        let expected =
            "`>` lines and jobs alone, or `master` lines alone, expected in a campaign's scenario";
        Err(Problem::new(span, message, expected))
    };
    let [ring] = &plan.rings[..] else {
        return refused(start, "a campaign plays on one ring");
    };
    if (0..ring.drives()).any(|drive| plan.model(0, drive) != Model::Plain) {
        let message = "a campaign compares every cell of every drive, and those of the model nd21 change by themselves";
        return refused(start, message);
    }
    let mut bytes = Vec::new();
    let mut calls = Vec::new();
    for step in &plan.steps {
        match &step.action {
            PlannedAction::Own(RingAct::Fault(..) | RingAct::Check(_))
            | PlannedAction::Receive(..) => {
                continue;
            }
            _ if step.when != PlannedWhen::Now => {
                return refused(
                    step.span,
                    "a campaign keeps the line without a gap: no line has a time",
                );
            }
            PlannedAction::Send(_, sent) | PlannedAction::Own(RingAct::Telegram(_, sent, ..)) => {
                bytes.extend_from_slice(sent);
            }
            PlannedAction::Own(RingAct::Master(_, all, false)) => calls.push(all.clone()),
            _ => return refused(step.span, "a campaign does not play this"),
        }
        if bytes.len().max(calls.iter().map(Vec::len).sum()) > MAX_LENGTH {
            let message = format!(
                "more than {MAX_LENGTH} bytes or calls in a conversation that is played for every case"
            );
            return refused(step.span, &message);
        }
        if !bytes.is_empty() && !calls.is_empty() {
            return refused(
                step.span,
                "bytes and calls of the driver in one conversation",
            );
        }
    }
    match (bytes.is_empty(), calls.is_empty()) {
        (false, _) => Ok(MasterTalk::Bytes(bytes)),
        (_, false) => Ok(MasterTalk::Calls(calls)),
        _ => refused(start, "the scenario says nothing that could be disturbed"),
    }
}

/// What must come back for one byte of a conversation.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Back {
    /// This byte.
    Exact(u8),
    /// Any byte: data requested from this drive.
    Data(u8),
    /// The negated sum of what came back at these places (9.6).
    Check(Vec<usize>),
}

/// A conversation in bytes, taken apart.
#[derive(Clone, Debug)]
pub(crate) struct Answers {
    /// The bytes.
    pub sent: Vec<u8>,
    /// What the plan of cases depends on.
    pub shape: Shape,
    back: Vec<Back>,
    /// Where a master may begin again: at a telegram with an address byte, with no command half sent.
    restarts: Vec<usize>,
}

/// Where telegrams begin, counted from 1, and the byte after the last one.
#[must_use]
pub(crate) fn telegrams(bytes: &[u8]) -> Vec<u64> {
    let mut starts = Vec::new();
    let mut place = 0;
    while let Some(&byte) = bytes.get(place) {
        starts.push(place as u64 + 1);
        place += match SyncByte::decode(byte) {
            Ok(SyncByte::Telegram(header)) => header.telegram_length(),
            _ => 1,
        };
    }
    starts.push(bytes.len() as u64 + 1);
    starts
}

/// A command that has not been sent whole.
struct Half {
    layout: &'static Layout,
    places: Vec<usize>,
}

impl Answers {
    /// Analyses a conversation for a ring with this number of drives; `sound` is what comes back without a fault.
    #[must_use]
    pub(crate) fn new(sent: Vec<u8>, drives: u8, sound: &[Received]) -> Self {
        let telegrams = telegrams(&sent);
        let mut back: Vec<Back> = sent.iter().map(|byte| Back::Exact(*byte)).collect();
        let mut restarts = Vec::new();
        let mut halves: BTreeMap<u8, Half> = BTreeMap::new();
        let mut drive = None;
        for pair in telegrams.windows(2) {
            let place = |number: u64| usize::try_from(number - 1).unwrap_or(usize::MAX);
            let (start, end) = (place(pair[0]), place(pair[1]));
            let Ok(SyncByte::Telegram(header)) = SyncByte::decode(sent[start]) else {
                continue;
            };
            let mut next = start + 1;
            match header.addressing() {
                Addressing::AddressFollows => {
                    if halves.is_empty() {
                        restarts.push(start);
                    }
                    let address = sent.get(next).copied().unwrap_or_default();
                    if let Some(byte) = back.get_mut(next) {
                        *byte = Back::Exact(address.wrapping_add(drives));
                    }
                    drive = Some(address.wrapping_add(drives)).filter(|drive| *drive < drives);
                    next += 1;
                }
                Addressing::SameDrive => {}
                Addressing::NextDrive => drive = drive.map(|drive| drive + 1),
            }
            let Some(drive) = drive.filter(|drive| *drive < drives) else {
                continue;
            };
            if header.process_data() {
                back.iter_mut()
                    .take(end)
                    .skip(next)
                    .take(2)
                    .for_each(|byte| *byte = Back::Data(drive));
                next += 2;
            }
            for place in next..end.min(sent.len()) {
                parameter(place, drive, &sent, &mut back, &mut halves);
            }
        }
        let mut answers = Self {
            sent,
            shape: Shape { drives, telegrams },
            back,
            restarts,
        };
        answers.believe(sound);
        answers
    }

    /// Corrects the expected bytes to those that come back without a fault: these differ for a telegram that addresses no drive, or for a
    /// refused command.
    fn believe(&mut self, sound: &[Received]) {
        while let Some(place) = self
            .wrong(sound, 0)
            .filter(|place| *place < self.back.len())
        {
            let Some(byte) = sound.get(place) else { return };
            if self.back[place] == Back::Exact(byte.byte) {
                return;
            }
            self.back[place] = Back::Exact(byte.byte);
        }
    }

    /// The place of the first wrong byte among those that came back for the bytes from `from` on and for SYNCO behind them; `None` if a
    /// master finds nothing wrong. A missing byte is wrong too.
    #[must_use]
    pub(crate) fn wrong(&self, heard: &[Received], from: usize) -> Option<usize> {
        for (index, byte) in heard.iter().enumerate() {
            let right = match self.back.get(from + index) {
                Some(Back::Exact(expected)) => byte.is(*expected),
                Some(Back::Data(_)) => byte.error.is_none(),
                Some(Back::Check(places)) => {
                    let sum = places.iter().fold(Checksum::EMPTY, |sum, place| {
                        // A command does not begin in front of where a master begins again.
                        let answer = heard.get(place.saturating_sub(from));
                        sum.with(answer.map_or(0, |byte| byte.byte))
                    });
                    byte.is(sum.minus())
                }
                None => byte.is(harness_proto::novobus::sync::SYNCO),
            };
            if !right {
                return Some(from + index);
            }
        }
        (from + heard.len() < self.back.len()).then(|| from + heard.len())
    }

    /// Where a master begins again that has found the byte at `wrong` wrong: with the telegram of the byte before it, since
    /// process data and `ReadLong` have no check of their own, or with an earlier one.
    #[must_use]
    pub(crate) fn restart(&self, wrong: usize) -> usize {
        let before = wrong.saturating_sub(1);
        let mut earlier = self.restarts.iter().rev();
        earlier
            .find(|start| **start <= before)
            .copied()
            .unwrap_or(0)
    }

    /// The places of data, with the drive that was asked.
    pub(crate) fn data(&self) -> impl Iterator<Item = (usize, u8)> + '_ {
        self.back
            .iter()
            .enumerate()
            .filter_map(|(place, back)| match back {
                Back::Data(drive) => Some((place, *drive)),
                _ => None,
            })
    }
}

/// A byte of the parameter channel for a drive (9.5).
fn parameter(
    place: usize,
    drive: u8,
    sent: &[u8],
    back: &mut [Back],
    halves: &mut BTreeMap<u8, Half>,
) {
    let Some(half) = halves.get_mut(&drive) else {
        if let Some(layout) = LAYOUTS.iter().find(|layout| layout.code == sent[place]) {
            let places = vec![place];
            halves.insert(drive, Half { layout, places });
        }
        return;
    };
    back[place] = match half.layout.answer.get(half.places.len() - 1) {
        Some(Reply::Data(_)) => Back::Data(drive),
        Some(Reply::Check) => Back::Check(half.places.clone()),
        _ => Back::Exact(sent[place]),
    };
    half.places.push(place);
    if half.places.len() == half.layout.length() {
        halves.remove(&drive);
    }
}
