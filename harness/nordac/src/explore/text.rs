//! The steps of a finding's scenario: it passes if every telegram is as the model predicts, and fails if one is not.

use super::act::{TelegramActKind, TelegramTalk};
use super::hex;
use super::play::{PlayedAct, TelegramsSeen};
use harness_bench::capture::runs::HeardTelegram;
use harness_proto::line::LineError;
use harness_proto::time::{Instant, Span};
use harness_sim::fault::LinkFault;
use std::fmt::Write as _;

/// How far a reply may be off whose time is what differs.
const EXACT: Span = Span::from_nanos(100);

/// The steps; the telegram `timed`, counted from 1, must come exactly at its time.
pub(super) fn steps(
    case: &TelegramTalk,
    seen: &TelegramsSeen,
    timed: Option<usize>,
    octet: Span,
    text: &mut String,
) {
    let mut replies = (1..).zip(&seen.said).peekable();
    let ends = seen.done.iter().skip(1).map(|done| done.at);
    let ends = ends.chain([Instant::NEVER]);
    for (done, end) in seen.done.iter().zip(ends) {
        act(case, done, text);
        while let Some((number, telegram)) = replies.next_if(|(_, telegram)| telegram.at <= end) {
            reply(telegram, (timed == Some(number)).then_some(octet), text);
        }
    }
    // As long as the case: what is not asked for shows.
    let ends = seen.done.iter().map(|done| done.at);
    let last = ends.chain(seen.said.iter().map(|reply| reply.at)).max();
    let rest = (Instant::START + seen.took).since(last.unwrap_or(Instant::START));
    let _infallible = writeln!(text, "wait {}", time(Instant::START + rest));
}

fn act(case: &TelegramTalk, done: &PlayedAct, text: &mut String) {
    let at = time(done.at);
    let _infallible = match (&done.sent, case.acts.get(done.act).map(|act| &act.what)) {
        (Some(sent), _) => {
            let bad = sent.bad.map_or(String::new(), |(place, fault)| {
                format!(" bad {}{}", place + 1, harm(fault))
            });
            writeln!(text, "@{at} > {}{bad}", hex::written(&sent.octets))
        }
        (None, Some(TelegramActKind::Link { slave, found })) => {
            let what = if *found { "found" } else { "lost" };
            writeln!(text, "@{at} slave {slave} link {what}")
        }
        (None, Some(TelegramActKind::Fault { slave, number, on })) => {
            let what = if *on { "on" } else { "off" };
            writeln!(text, "@{at} slave {slave} fault {number} {what}")
        }
        (None, Some(TelegramActKind::Restart { slave })) => {
            writeln!(text, "@{at} slave {slave} restart")
        }
        (None, _) => Ok(()),
    };
}

/// What happens to an octet, behind `bad` and its place.
fn harm(fault: LinkFault) -> String {
    match fault {
        LinkFault::Flip(flips) if flips.stop => " stop".to_owned(),
        LinkFault::Delay(gap) => format!(" gap {}us", gap.as_nanos() / 1_000),
        _ => String::new(),
    }
}

/// A reply; `timed` where it must come exactly at its time.
fn reply(telegram: &HeardTelegram, timed: Option<Span>, text: &mut String) {
    let when = timed.map_or(String::new(), |octet| {
        // Where its first octet ends.
        let first = telegram.at - octet * (telegram.octets.len() as u64 - 1);
        format!("@{}..{} ", time(first - EXACT), time(first + EXACT))
    });
    let bad = telegram
        .error
        .map_or(String::new(), |(place, error)| match error {
            LineError::Parity => format!(" bad {place}"),
            _ => format!(" bad {place} stop"),
        });
    let _infallible = writeln!(text, "{when}< {}{bad}", hex::written(&telegram.octets));
}

/// A time in milliseconds.
fn time(at: Instant) -> String {
    let nanos = at.since_start().as_nanos();
    match nanos % 1_000_000 {
        0 => format!("{}ms", nanos / 1_000_000),
        rest => format!("{}.{rest:06}ms", nanos / 1_000_000),
    }
}
