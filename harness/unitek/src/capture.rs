//! Captures: judged, and made into a scenario, in which what hosts have sent is sent again at its time and what drives have sent is
//! expected.

use super::judge::{Breach, FrameSymptom, HeardFrames, judge, judge_guessed};
use super::language::{identifier, written};
use super::serve::bench;
use harness_bench::capture::JudgedFrames;
use harness_bench::report::pcapng_frames::rate_of;
use harness_bench::scenario::source::Source;
use harness_bench::scenario::verdict::Verdict;
use harness_proto::can::{BitRate, CanError, Frame};
use harness_proto::time::{Instant, Span};
use harness_proto::unitek::{DEFAULT_RX, DEFAULT_TX};
use harness_sim::record::{FrameEnd, LineFrame, Trace};
use std::collections::BTreeSet;
use std::fmt::Write as _;

const MOST_NODES: u16 = 127;

/// A scenario that replays a capture. `setup` describes the drives: its lines `drive` and `rate` become the header; without it, drives
/// are those of which identifiers are those of UNITEK 3.1.
///
/// # Errors
/// A drive has other identifiers, in a sentence with the remedy.
pub(crate) fn scenario(
    traces: &[Trace],
    title: &str,
    setup: Option<&Source>,
) -> Result<String, String> {
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let frames: Vec<&LineFrame> = channels.flat_map(|channel| channel.frames()).collect();
    let title: String = title.chars().filter(|c| !c.is_control()).collect();
    let mut text = format!("title   {title}\nsource  unitek 4.1\nbus     unitek\n");
    match setup {
        Some(setup) => {
            let header = |line: &&str| line.starts_with("drive ") || line.starts_with("rate ");
            for line in setup.text.lines().filter(header) {
                // Writing to a String cannot fail.
                let _infallible = writeln!(text, "{line}");
            }
        }
        None => {
            let rate = frames.iter().find_map(|frame| rate_of(frame));
            if let Some(rate) = rate.filter(|rate| *rate != BitRate::K500) {
                let _infallible = writeln!(text, "rate {}", rate.bits_per_second() / 1000);
            }
            for node in nodes(&frames)? {
                let _infallible = writeln!(text, "drive {node}");
            }
        }
    }
    text.push('\n');
    let (mut number, mut steps) = (0_u64, String::new());
    // The frame that an error has ended, at its first attempt.
    let mut attempt: Option<&LineFrame> = None;
    for sent in frames {
        // A frame that an error ended is repeated, which is no frame of its own.
        let fault = match sent.ended {
            FrameEnd::Good => None,
            FrameEnd::Lost => Some("lost"),
            FrameEnd::Error(CanError::ErrorFrame) => Some("corrupt"),
            FrameEnd::Error(CanError::NoAcknowledge) => Some("no-acknowledge"),
            FrameEnd::Error(CanError::BusOff) => continue,
        };
        if let Some(fault) = fault {
            let line = format!("! frame {}: {fault}\n", number + 1);
            if !text.ends_with(&line) {
                text.push_str(&line);
            }
        }
        if matches!(sent.ended, FrameEnd::Error(_)) {
            attempt.get_or_insert(sent);
            continue;
        }
        number += 1;
        let same = |first: &&LineFrame| (first.from, first.frame) == (sent.from, sent.frame);
        let first = attempt.take_if(|first| same(&&**first));
        step(sent, first.unwrap_or(sent).start, &mut steps);
    }
    Ok(text + &steps)
}

/// Judges a capture: what drives have sent is compared with the manual, with any value of what that leaves open. `named` are the drives that
/// are judged, where the user names some.
///
/// # Errors
/// A drive has other identifiers and there is no `setup`, in a sentence with the remedy; or the setup has mistakes.
pub(crate) fn judged(
    traces: &[Trace],
    setup: Option<&Source>,
    (named, tolerance): (&[u8], Span),
) -> Result<JudgedFrames, String> {
    let channels = traces.iter().flat_map(|trace| &trace.channels);
    let frames: Vec<LineFrame> = channels
        .flat_map(|channel| channel.frames().iter().copied())
        .collect();
    let heard = HeardFrames {
        frames: &frames,
        seams: traces.first().map_or(&[], |trace| &trace.seams),
        tolerance,
    };
    let wanted = |drive: &u8| named.is_empty() || named.contains(drive);
    let mut remarks = Vec::new();
    let mut note = |drive: u8| {
        if !wanted(&drive) {
            remarks.push(format!(
                "drive {drive} is not judged: `--judge` does not name it"
            ));
        }
        wanted(&drive)
    };
    let judged = match setup {
        Some(setup) => {
            let plan = bench(None, Some(setup)).map_err(|problems| problems.to_string())?;
            let drives = plan.setup.drives.iter();
            let drives = drives.map(|drive| (drive.node, drive.identifiers));
            let drives = drives.filter(|drive| note(drive.0));
            judge(heard, &drives.collect::<Vec<_>>())
        }
        None => {
            let all: Vec<&LineFrame> = frames.iter().collect();
            let numbered = |node: u16| {
                let number = u8::try_from(node).unwrap_or(u8::MAX);
                (number, (DEFAULT_RX - 1 + node, DEFAULT_TX - 1 + node))
            };
            let nodes = nodes(&all)?;
            let drives = nodes.into_iter().map(numbered);
            let drives = drives.filter(|drive| note(drive.0));
            judge_guessed(heard, &drives.collect::<Vec<_>>())
        }
    };
    let difference = |breach: &Breach| {
        format!(
            "frame {}, drive {} (UNITEK {}): {}",
            breach.frame, breach.drive, breach.section, breach.about
        )
    };
    remarks.extend(judged.remarks);
    let missing = named.iter().filter(|drive| !judged.heard.contains(drive));
    let missing: Vec<_> = missing
        .map(|drive| format!("drive {drive}: no frame of it was compared"))
        .collect();
    let in_doubt =
        !judged.doubts.is_empty() || !missing.is_empty() || judged.compared < judged.replies;
    remarks.extend(missing);
    remarks.extend(judged.doubts);
    let only_times = judged
        .breaches
        .iter()
        .all(|breach| breach.what == FrameSymptom::Time);
    if !judged.breaches.is_empty() && only_times && tolerance == Span::ZERO {
        remarks.push(
            "only times differ: where a computer stamps what an adapter gives it, --tolerance says how far they may be off, such as 16ms"
                .to_owned(),
        );
    }
    if judged.compared == 0 {
        remarks.push("nothing was compared: no frame of a drive is in it".to_owned());
    }
    Ok(JudgedFrames {
        verdict: match (judged.breaches.is_empty(), judged.compared) {
            (false, _) => Verdict::Failed,
            (true, 0) => Verdict::Inconclusive,
            (true, _) if in_doubt => Verdict::Inconclusive,
            (true, _) => Verdict::Passed,
        },
        compared: judged.compared,
        replies: judged.replies,
        differences: judged.breaches.iter().map(difference).collect(),
        remarks,
    })
}

/// A frame that began to be sent at `start`: what an error has ended its sender repeats.
fn step(line_frame: &LineFrame, start: Instant, steps: &mut String) {
    let frame = &line_frame.frame;
    let nanos = start.since_start().as_nanos();
    let _infallible = match line_frame.from {
        None => writeln!(
            steps,
            "@{}.{:06}ms > {}",
            nanos / 1_000_000,
            nanos % 1_000_000,
            written(frame)
        ),
        Some(_) if line_frame.ended == FrameEnd::Lost => Ok(()),
        Some(_) => writeln!(steps, "< {}", expected(frame)),
    };
}

/// A drive's frame, its stuff byte left open (UNITEK 4.1).
fn expected(frame: &Frame) -> String {
    let mut text = written(frame);
    if !frame.is_remote() && matches!(frame.dlc(), 4 | 6) {
        text.truncate(text.len() - 2);
        text.push_str("xx");
    }
    text
}

/// Whether a frame shows that its node is a drive, and no other device with an identifier of that range: a drive sends 4 or 6 bytes, and
/// hosts send it 3 or 5 (UNITEK 4.5).
fn is_telling(frame: &LineFrame) -> bool {
    let lengths = if frame.from.is_some() { [4, 6] } else { [3, 5] };
    !frame.frame.is_remote() && lengths.contains(&frame.frame.dlc())
}

/// The numbers of the drives, by the identifiers on which they send and receive.
fn nodes(frames: &[&LineFrame]) -> Result<BTreeSet<u16>, String> {
    let mut nodes = BTreeSet::new();
    for frame in frames {
        let id = frame.frame.id();
        let first = frame.from.map_or(DEFAULT_RX, |_| DEFAULT_TX);
        let base = u16::try_from(id.number())
            .ok()
            .filter(|_| !id.is_extended());
        let node = base.and_then(|number| number.checked_sub(first - 1));
        // Where the capture numbers its drives, the number must be that of the identifier.
        let fits = |node: &u16| frame.from.is_none_or(|drive| u16::from(drive) == *node);
        let node = node.filter(|node| (1..=MOST_NODES).contains(node) && fits(node));
        match (node, frame.from) {
            (Some(node), _) if is_telling(frame) => drop(nodes.insert(node)),
            (Some(_), _) => {}
            // A host may speak to others.
            (None, None) => {}
            (None, Some(drive)) => {
                return Err(format!(
                    "drive {drive} sends on {}, from which it does not follow on what it receives; --setup with a line such as `drive \
                     {drive} rx 210 tx {}` expected",
                    identifier(id),
                    identifier(id)
                ));
            }
        }
    }
    match nodes.is_empty() {
        true => Err(
            "no frame of it is to or from a drive; --setup with `drive` lines expected".to_owned(),
        ),
        false => Ok(nodes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use harness_proto::unitek::sender_of;
    use harness_sim::record::Channel;

    /// A trace of these frames, one each 100 ms.
    fn trace(frames: &[&str]) -> Trace {
        let frame = |(text, place): (&&str, u64)| {
            let frame: Frame = text.parse().expect("a frame");
            let start = Instant::START + Span::from_millis(100 * place);
            LineFrame {
                from: sender_of(&frame),
                start,
                at: start + Span::from_micros(90),
                frame,
                ended: FrameEnd::Good,
            }
        };
        Trace {
            channels: vec![Channel::of_frames(
                frames.iter().zip(0..).map(frame).collect(),
            )],
            ..Trace::empty(1)
        }
    }

    /// Only drives that are named are judged, and each of them must have sent something.
    #[test]
    fn the_drives_that_are_named_are_judged() {
        const BOTH: [&str; 8] = [
            "201#3DE200",
            "181#E2010000",
            "202#3DE200",
            "182#E2010000",
            "202#510400",
            "202#3D5100",
            "182#51000000",
            "203#3DE200",
        ];
        let trace = [trace(&BOTH)];
        for (named, verdict, compared) in [
            (&[][..], Verdict::Failed, 3),
            (&[1], Verdict::Passed, 1),
            (&[2], Verdict::Failed, 2),
            // One that sends nothing, one of which nothing is heard.
            (&[1, 3], Verdict::Inconclusive, 1),
            (&[1, 9], Verdict::Inconclusive, 1),
            (&[9], Verdict::Inconclusive, 0),
        ] {
            let judged = judged(&trace, None, (named, Span::ZERO)).expect("drives");
            let found = (judged.verdict, judged.compared, judged.replies);
            assert_eq!(found, (verdict, compared, compared), "{named:?} {judged:?}");
        }
        let setup = Source::from_bytes(
            "setup.scn".to_owned(),
            b"title t\nbus unitek\ndrive 1\ndrive 9\n".to_vec(),
        );
        let setup = setup.expect("a text");
        for (named, verdict) in [
            (&[1][..], Verdict::Passed),
            (&[1, 9], Verdict::Inconclusive),
        ] {
            let judged = judged(&trace, Some(&setup), (named, Span::ZERO)).expect("drives");
            assert_eq!(judged.verdict, verdict, "{judged:?}");
        }
    }

    /// A verdict says how many frames of drives could be compared, and nothing has passed where some were not.
    #[test]
    fn frames_that_are_not_compared_are_counted() {
        let setup = Source::from_bytes(
            "setup.scn".to_owned(),
            b"title t\nbus unitek\ndrive 1\ndrive 2 rx 202 tx 190\ndrive 3 rx 203 tx 190\n"
                .to_vec(),
        );
        let setup = setup.expect("a text");
        let frames = ["201#3DE200", "181#E2010000", "202#3DE200", "190#E2010000"];
        let judged = judged(&[trace(&frames)], Some(&setup), (&[], Span::ZERO)).expect("drives");
        let found = (judged.verdict, judged.compared, judged.replies);
        assert_eq!(found, (Verdict::Inconclusive, 1, 2), "{judged:?}");
    }

    /// A request that an error frame has ended, and its repetition: it is sent once, when it was first sent.
    #[test]
    fn a_repeated_frame_is_sent_at_its_first_attempt() {
        let at = |micros| Instant::START + Span::from_micros(micros);
        let frame = |from, start, text: &str, ended| LineFrame {
            from,
            start: at(start),
            at: at(start + 150),
            frame: text.parse().expect("a frame"),
            ended,
        };
        let corrupt = FrameEnd::Error(CanError::ErrorFrame);
        let frames = vec![
            frame(None, 1_000, "201#3D4000", corrupt),
            frame(None, 1_200, "201#3D4000", FrameEnd::Good),
            frame(Some(1), 1_400, "181#40810100", FrameEnd::Good),
            frame(None, 5_000, "201#3D4000", FrameEnd::Good),
        ];
        let trace = Trace {
            channels: vec![Channel::of_frames(frames)],
            ..Trace::empty(1)
        };
        let text = scenario(&[trace], "Repeated", None).expect("a scenario");
        let sent: Vec<_> = text.lines().filter(|line| line.contains(" > ")).collect();
        assert_eq!(sent.len(), 2, "{text}");
        assert!(sent[0].starts_with("@1.000000ms >"), "{text}");
        assert!(sent[1].starts_with("@5.000000ms >"), "{text}");
        assert!(text.contains("! frame 1: corrupt"), "{text}");
    }
}
