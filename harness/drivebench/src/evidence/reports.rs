//! Files of a folder that follow from its record: made again and compared byte for byte.

use super::attempt::Recorded;
use super::derive::{Derived, Settled, plain};
use super::files::{
    self, CAPTURES, DEVIATIONS, JUNIT, KNOWN_PROFILE, PAGE, PROFILE, RECORD, REPORT, RIG,
    SCENARIOS, SUMS, VERSIONS,
};
use super::folder::capture;
use super::record::RecordLine;
use super::verify::{JudgedAttempt, OpenedFolder};
use crate::capture::read;
use crate::link::{LinkEvent, PlacedFault};
use crate::medium::HeardPiece;
use harness_proto::can;
use harness_proto::line::Received;
use harness_proto::time::Instant;
use harness_sim::record::{Channel, FrameEnd, LineFrame, Trace};
use std::collections::BTreeSet;
use std::path::Path;

/// What a mark of an attachment begins with in JUnit's output.
const ATTACHMENT: &str = "[[ATTACHMENT|";

/// What of the derived files does not follow from the record.
pub(super) fn differences(
    path: &Path,
    opened: &OpenedFolder,
    judged: &[JudgedAttempt<'_>],
    made: &Derived,
) -> Vec<String> {
    let settled: Vec<_> = opened.lines.iter().filter_map(Settled::of).collect();
    let mut wrong = Vec::new();
    wrong.extend(file(path, REPORT, |_| plain(opened.rig.id(), &settled)));
    wrong.extend(file(path, JUNIT, |stated| {
        moved(&made.junit, path, stated, SCENARIOS)
    }));
    wrong.extend(versions(path, opened));
    for attempt in judged {
        wrong.extend(of_attempt(path, opened, attempt));
    }
    wrong.extend(foreign(path, opened, judged));
    wrong
}

/// The page, which shows what the files of a qualification say: these are compared before it.
pub(super) fn page(path: &Path, made: &Derived) -> Option<String> {
    file(path, PAGE, |_| made.html.clone())
}

/// Compares a file with what is made of its own text; `None` where they are the same.
pub(super) fn file(path: &Path, name: &str, made: impl FnOnce(&str) -> String) -> Option<String> {
    let stated = match files::read_text(path, name) {
        Ok(stated) => stated,
        Err(why) => return Some(why),
    };
    let made = made(&stated);
    if stated == made {
        return None;
    }
    let lines = stated.lines().zip(made.lines());
    let same = lines.take_while(|(stated, made)| stated == made).count();
    Some(format!(
        "{name}, line {}: the record gives another text",
        same + 1
    ))
}

/// JUnit's output names files by the path that the folder had during the run; everything else follows from the record.
/// `inner` is the folder in it that each such path leads through.
pub(super) fn moved(made: &str, path: &Path, stated: &str, inner: &str) -> String {
    let folder = |text: &str| {
        let from = text.find(ATTACHMENT)? + ATTACHMENT.len();
        let end = from + text[from..].find(&format!("/{inner}/"))?;
        Some(text[from..end].to_owned())
    };
    match (folder(made), folder(stated)) {
        (Some(here), Some(there)) => made.replace(
            &format!("{ATTACHMENT}{here}/"),
            &format!("{ATTACHMENT}{there}/"),
        ),
        // A path that no mark can hold is left out.
        _ if path.to_string_lossy().contains([']', '\n']) || !stated.contains(ATTACHMENT) => {
            let marks = made.split(ATTACHMENT).skip(1);
            let marks: Vec<_> = marks.filter_map(|mark| mark.split("]]").next()).collect();
            let without =
                |text: String, mark: &&str| text.replace(&format!("{ATTACHMENT}{mark}]]\n"), "");
            marks.iter().fold(made.to_owned(), without)
        }
        _ => made.to_owned(),
    }
}

/// Version and date are those of the first line.
fn versions(path: &Path, opened: &OpenedFolder) -> Option<String> {
    let text = match files::read_text(path, VERSIONS) {
        Ok(text) => text,
        Err(why) => return Some(why),
    };
    let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let header = &opened.header;
    let same = value["drivebench"] == header.program.as_str()
        && value["started"] == header.started.as_str()
        && value["schema"] == 1
        && format!("{value:#}\n") == text;
    (!same).then(|| format!("{VERSIONS} does not say what the first line of {RECORD} says"))
}

/// The capture of an attempt.
fn of_attempt(path: &Path, opened: &OpenedFolder, attempt: &JudgedAttempt<'_>) -> Option<String> {
    let (_, again) = attempt.again.as_ref().ok()?;
    let name = format!(
        "{CAPTURES}/{}.{}.json",
        attempt.recorded.name, attempt.recorded.attempt
    );
    if opened.left_out.contains(&name) {
        return None;
    }
    if let Some(made) = &again.capture {
        return file(path, &name, |_| made.clone());
    }
    let text = match files::read_text(path, &name) {
        Ok(text) => text,
        Err(why) => return Some(why),
    };
    let capture_read = match read(text.as_bytes(), Some(opened.rate())) {
        Ok(read) => read,
        Err(error) => return Some(format!("{name}: {error}")),
    };
    if !opened.header.of_rings {
        // An adapter may stamp a frame before the conversation began, where a capture has no place for its first bit.
        let looks = !opened.rig.file.interlock.is_empty();
        let differs = frames_differ(attempt.recorded, &capture_read.traces, looks)?;
        return Some(format!("{name}: {differs}"));
    }
    if capture(&capture_read.traces, &again.attempt.outcome) != text {
        return Some(format!(
            "{name} is not in the form in which this program writes it"
        ));
    }
    if opened.header.simulated || !opened.rig.file.interlock.is_empty() {
        return None;
    }
    let ends = Ends::of(attempt.recorded, opened);
    let differs = ends.differ(&capture_read.traces)?;
    Some(format!("{name}: {differs}"))
}

/// The conversation of an attempt that is captured: that of the scenario, or the last one.
fn played(recorded: &Recorded) -> &[LinkEvent] {
    let conversations = recorded
        .events
        .split(|event| matches!(event, LinkEvent::Begin(_)));
    let conversations: Vec<_> = conversations.collect();
    let is_step = |event: &LinkEvent| matches!(event, LinkEvent::Step(_));
    let has_steps = |conversation: &&&[LinkEvent]| conversation.iter().any(is_step);
    let played = conversations
        .iter()
        .find(has_steps)
        .or(conversations.last());
    played.copied().unwrap_or_default()
}

/// How a capture differs from the record of a bus of frames. Frames that were still to be sent are not in the capture, and those that were
/// not fetched any more are not in the record. Where interlocks are looked at, the capture has these frames as well.
fn frames_differ(recorded: &Recorded, traces: &[Trace], looks: bool) -> Option<String> {
    let [trace] = traces else {
        return Some("it has more than one bus".to_owned());
    };
    let carried = trace.channels.iter().flat_map(Channel::frames);
    let (bench_frames, others): (Vec<&LineFrame>, Vec<&LineFrame>) =
        carried.partition(|frame| frame.from.is_none());
    let mut sent = Vec::new();
    let mut received = Vec::new();
    for event in played(recorded) {
        match event {
            LinkEvent::Sent(_, _, pieces) => sent.extend(pieces.as_out().frames().iter().copied()),
            LinkEvent::Received(_, at, HeardPiece::Frame(can::CanEvent::Frame(frame))) => {
                received.push((at.since_start().as_nanos(), *frame));
            }
            _ => {}
        }
    }
    let bench_frames: Vec<_> = bench_frames.iter().map(|frame| frame.frame).collect();
    let others: Vec<_> = others
        .iter()
        .filter(|frame| frame.ended == FrameEnd::Good)
        .map(|frame| (frame.at.since_start().as_nanos(), frame.frame))
        .collect();
    if looks {
        let mut others = others.iter();
        let shown = |frame| others.any(|other| other == frame);
        return (!received.iter().all(shown))
            .then(|| "the frames of the drives are not those of the record".to_owned());
    }
    if !sent.starts_with(&bench_frames) {
        return Some("the frames of the bench are not those of the record".to_owned());
    }
    (!others.starts_with(&received))
        .then(|| "the frames of the drives are not those of the record".to_owned())
}

/// What the record says of the links at the bench's ends in the conversation of a scenario.
struct Ends {
    /// Outgoing and incoming bytes ring by ring; `None` where a fault or a probe changed them.
    rings: Vec<[Option<Vec<Carried>>; 2]>,
}

/// A byte as it arrived, and when, in nanoseconds.
type Carried = (u64, Received);

impl Ends {
    fn of(recorded: &Recorded, opened: &OpenedFolder) -> Self {
        let byte_time = opened.rate().byte_time();
        let mut ends = Self::new(opened);
        for event in played(recorded) {
            match event {
                LinkEvent::Sent(ring, end, sent) => {
                    let bytes = sent.as_out().octets();
                    for (left, byte) in (0..bytes.len() as u64).rev().zip(bytes) {
                        let at = *end - byte_time * left;
                        ends.carry(*ring, 0, at, Received::good(*byte));
                    }
                }
                LinkEvent::Received(ring, at, heard) => {
                    if let Some(byte) = heard.octet() {
                        ends.carry(*ring, 1, *at, byte);
                    }
                }
                LinkEvent::Fault(ring, _, PlacedFault::Link(link, _), _) => {
                    let last = opened.header.drives.get(*ring).copied().unwrap_or(0);
                    match *link {
                        0 => ends.forget(*ring, 0),
                        link if link == usize::from(last) => ends.forget(*ring, 1),
                        _ => {}
                    }
                }
                LinkEvent::Probe(ring, ..) => {
                    ends.forget(*ring, 0);
                    ends.forget(*ring, 1);
                }
                _ => {}
            }
        }
        ends
    }

    fn new(opened: &OpenedFolder) -> Self {
        let empty = || [Some(Vec::new()), Some(Vec::new())];
        Self {
            rings: opened.header.drives.iter().map(|_| empty()).collect(),
        }
    }

    fn carry(&mut self, ring: usize, end: usize, at: Instant, byte: Received) {
        let at = at.since_start().as_nanos();
        let link = self.rings.get_mut(ring).and_then(|ends| ends[end].as_mut());
        link.into_iter().for_each(|bytes| bytes.push((at, byte)));
    }

    fn forget(&mut self, ring: usize, end: usize) {
        if let Some(ends) = self.rings.get_mut(ring) {
            ends[end] = None;
        }
    }

    fn differ(&self, traces: &[Trace]) -> Option<String> {
        if traces.len() != self.rings.len() {
            return Some("it has another number of rings than the rig".to_owned());
        }
        for (ends, trace) in self.rings.iter().zip(traces) {
            let links = [trace.channels.first(), trace.channels.last()];
            for ((expected, link), name) in ends.iter().zip(links).zip(["outgoing", "incoming"]) {
                let carried = |link: &Channel| -> Vec<Carried> {
                    let arrived = link.octets().iter().filter_map(|byte| {
                        Some((byte.at.since_start().as_nanos(), byte.arrival()?))
                    });
                    arrived.collect()
                };
                let carried = link.map(carried).unwrap_or_default();
                if expected
                    .as_ref()
                    .is_some_and(|expected| *expected != carried)
                {
                    return Some(format!(
                        "the bytes of the bench's {name} link are not those of the record"
                    ));
                }
            }
        }
        None
    }
}

/// Files that no run leaves.
fn foreign(path: &Path, opened: &OpenedFolder, judged: &[JudgedAttempt<'_>]) -> Vec<String> {
    let fixed = [RECORD, RIG, JUNIT, REPORT, PAGE, VERSIONS, SUMS];
    let mut known: BTreeSet<String> = fixed.iter().map(|name| (*name).to_owned()).collect();
    known.extend(
        opened
            .rig
            .profile
            .is_some()
            .then(|| KNOWN_PROFILE.to_owned()),
    );
    if opened.header.qualified {
        known.extend([PROFILE, DEVIATIONS].map(str::to_owned));
    }
    for judged_attempt in judged {
        let Recorded { name, attempt, .. } = &judged_attempt.recorded;
        known.insert(format!("{CAPTURES}/{name}.{attempt}.json"));
    }
    for line in &opened.lines {
        if let RecordLine::Case { name, .. } = line {
            known.insert(format!("{SCENARIOS}/{name}.scn"));
        }
    }
    for file in &opened.left_out {
        known.remove(file);
    }
    let there = files::names(path);
    let foreign = there.iter().filter(|file| !known.contains(*file));
    foreign
        .map(|file| format!("{file} is not a file of this run"))
        .collect()
}
