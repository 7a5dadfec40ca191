//! Captures of adapters that give bytes in portions, late, and that end in the middle of a conversation.

use super::tests::run;
use crate::capture::judge::{CaptureVerdict, judge};
use harness_bench::capture::{Capture, CaptureSpan, JudgeOptions};
use harness_bench::scenario::verdict::Verdict;
use harness_proto::time::{Instant, Span};
use harness_sim::record::{Channel, LineByte};

/// An FTDI adapter gives what it has every 16 ms.
const PORTION: u64 = 16_000_000;

const READS: &str = "title reads\nring 3\n> 88 FD C0 13 FE D1\nwait 60ms\n> 88 FE C0 13 FE D1\nwait 60ms\n> 88 FF C0 13 FE D1\n\
     wait 60ms\n> 88 FF C0 13 FE D1\nwait 40ms\n";

/// What two adapters, at the master's own links, have given until a time, with moments of theirs.
fn given(capture: &Capture, moments: [u64; 2], until: u64) -> Capture {
    let octet = capture.rate.byte_time().as_nanos();
    let links = capture.traces[0].channels.iter();
    let links = links.filter(|link| link.from.is_none() || link.to.is_none());
    let channels = links.zip(moments).map(|(link, moment)| {
        let read = |byte: &LineByte| {
            let at = byte.at.since_start().as_nanos() + PORTION - moment;
            at.div_ceil(PORTION) * PORTION + moment
        };
        let bytes = link.octets().iter().filter(|byte| read(byte) <= until);
        let bytes: Vec<_> = bytes.collect();
        let dated = bytes.iter().enumerate().map(|(index, byte)| {
            let rest = bytes[index + 1..].iter();
            let behind = rest.take_while(|next| read(next) == read(byte)).count() as u64;
            let at = Instant::START + Span::from_nanos(read(byte) - behind * octet);
            LineByte { at, ..**byte }
        });
        Channel::of_octets(link.from, link.to, dated.collect())
    });
    let mut given = capture.clone();
    given.traces[0].channels = channels.collect();
    given
}

fn judged(capture: &Capture) -> CaptureVerdict {
    let options = JudgeOptions {
        title: "test",
        setup: None,
        tolerance: Some(Span::from_millis(50)),
        stations: &[],
    };
    judge(capture, &options).unwrap_or_else(|error| panic!("{error}"))
}

/// Right drives are blamed at no end of a capture.
#[test]
fn bytes_under_way_accuse_no_drive() {
    let whole = run(READS);
    let mut inconclusive = 0;
    for until in (40_000_000..230_000_000).step_by(7_000_000) {
        for moments in [[0, 5_000_000], [11_000_000, 2_000_000], [3_000_000; 2]] {
            let capture = given(&whole, moments, until);
            let judged = judged(&capture);
            let shown = judged.links.show("capture", "model").to_string();
            assert_ne!(
                judged.verdict,
                Verdict::Failed,
                "{moments:?} {until}: {shown}"
            );
            let why = judged.remarks.iter();
            inconclusive += why.filter(|remark| remark.contains("under way")).count();
        }
    }
    assert!(inconclusive > 5, "{inconclusive}");
}

/// A drive that swallows the end of its answer is found where the conversation went on behind it, and at the end of a capture whose times
/// are exact.
#[test]
fn a_short_answer_fails() {
    let shortened = |mut capture: Capture, at: usize| {
        let last = capture.traces[0].channels.iter_mut();
        let last = last.rev().find(|link| link.to.is_none());
        let octets = last.and_then(Channel::octets_mut).expect("a link");
        drop(octets.drain(at..at + 2));
        capture
    };
    let whole = run(READS);
    let in_portions = given(&whole, [3_000_000, 5_000_000], 230_000_000);
    assert_eq!(judged(&in_portions).verdict, Verdict::Passed);
    assert_eq!(judged(&shortened(whole, 22)).verdict, Verdict::Failed);
    let early = shortened(in_portions.clone(), 4);
    assert_eq!(judged(&early).verdict, Verdict::Failed);
    // The end of the last answer may be under way, unless the capture went on in silence.
    let late = shortened(in_portions, 22);
    assert_eq!(judged(&late).verdict, Verdict::Inconclusive);
    let went_on = Capture {
        listened: Some(CaptureSpan {
            before: Span::from_millis(100),
            until: Instant::START + Span::from_millis(500),
        }),
        ..late
    };
    assert_eq!(judged(&went_on).verdict, Verdict::Failed);
}

/// A capture that began in silence does not begin in mid-conversation, whatever its ports say of the time of its first bytes.
#[test]
fn silence_in_front_is_known() {
    let odd = given(&run(READS), [0, 10_000_000], 230_000_000);
    let mut short = odd.clone();
    let last = short.traces[0].channels.iter_mut();
    let last = last.rev().find(|link| link.to.is_none());
    drop(
        last.and_then(Channel::octets_mut)
            .expect("a link")
            .drain(4..6),
    );
    assert_eq!(judged(&short).verdict, Verdict::Inconclusive);
    let listened = Some(CaptureSpan {
        before: Span::from_millis(100),
        until: short.end(),
    });
    assert_eq!(
        judged(&Capture { listened, ..short }).verdict,
        Verdict::Failed
    );
    assert_eq!(
        judged(&Capture { listened, ..odd }).verdict,
        Verdict::Passed
    );
}
