//! A case as a scenario: every finding is one.

use super::case::{Act, ActKind, Case, Harm, Talk, To};
use super::oracle::sent;
use super::play::MasterView;
use crate::language::syntax::{
    FaultKind, FaultStep, Header, LinkEnds, LinkFaultKind, RingStep, Step,
};
use crate::language::write::Text;
use crate::twin::answering;
use harness_bench::scenario::expression::Located;
use harness_bench::scenario::pattern::{Expected as Byte, Pattern};
use harness_bench::scenario::problem::TextSpan;
use harness_bench::scenario::syntax::{Action, Citation, Scenario, When};
use harness_bench::scenario::times::Duration;
use harness_proto::novobus::address::RingSize;
use harness_proto::novobus::role::roles;
use harness_sim::fault::DriveFault;

/// Maximum number of bytes, and of runs of equal ones, on a line.
const ITEMS_A_LINE: usize = 24;

/// The shortest run of equal bytes that is written as one.
const RUN: usize = 4;

/// How long a comment may be.
const MOST_COMMENT: usize = 60;

/// What stands around the steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings<'a> {
    pub title: &'a str,
    /// The tables that it pins, such as `nd21 9.7`.
    pub sources: &'a [String],
    /// What drives are before anything is sent.
    pub header: &'a Header,
    /// Remarks in front of the steps.
    pub remarks: &'a [String],
    /// What the master must receive.
    pub seen: &'a MasterView,
    /// Indexes of bytes that may have any value: data that a drive measures, and their checking bytes.
    pub any: &'a [usize],
    /// The byte that must come at its time, by its index.
    pub timed: Option<usize>,
}

/// The text of a scenario.
#[must_use]
pub(crate) fn text(case: &Case, page: &Surroundings<'_>) -> String {
    let header = Header::of_rings(&case.sizes()).and(page.header);
    let source = |text: &String| Citation {
        text: text.clone(),
        span: TextSpan::default(),
    };
    let mut text: Text = Text::default();
    text.header(&Scenario {
        sources: page.sources.iter().map(source).collect(),
        // This is not possible with unasked zeros (9.9), which drives send without end.
        strict: page.seen.received.len() <= case.bytes().len(),
        ..Scenario::new(page.title, header)
    });
    text.empty_line();
    for remark in page.remarks {
        text.remark(remark);
    }
    let mut faults = case.faults().into_iter();
    for act in &case.acts {
        steps(&mut text, act, case);
        let harms = if act.length(case.drives) > 0 {
            act.damages.len()
        } else {
            0
        };
        for (link, byte, harm) in faults.by_ref().take(harms) {
            let ends = LinkEnds::of_place(case.drives, usize::from(link));
            let fault = FaultStep::on_link(case.ring(), ends, kind(harm), byte);
            text.step(&RingStep::Fault(fault).into(), "");
        }
    }
    answers(&mut text, case, page);
    text.into()
}

fn steps(text: &mut Text, act: &Act, case: &Case) {
    let ring = case.ring();
    match act.what {
        ActKind::Wait(ms) => {
            text.step(&Action::Wait(Duration::millis(ms.into())).into(), "");
        }
        ActKind::Power { drive, on } => {
            let power = if on { DriveFault::On } else { DriveFault::Off };
            let fault = FaultStep {
                ring,
                what: FaultKind::Drive(Located::number(drive.into()), power),
                byte: None,
                at: None,
            };
            text.step(&RingStep::Fault(fault).into(), "");
        }
        _ => {
            let words = words(&act.what);
            let parts = act.parts(case.drives);
            for (index, part) in parts.iter().enumerate() {
                let mut comment = if index == 0 { &words[..] } else { "its rest" };
                let known: Vec<_> = part.iter().copied().map(Byte::Byte).collect();
                for bytes in Pattern::of(&known, RUN).lines(ITEMS_A_LINE) {
                    text.step(
                        &Action::Send {
                            port: ring,
                            message: bytes,
                        }
                        .into(),
                        comment,
                    );
                    comment = "";
                }
            }
        }
    }
}

/// What an act is, in the manual's words.
fn words(what: &ActKind) -> String {
    let mut words = match what {
        ActKind::Synco(_) => "SYNCO".to_owned(),
        ActKind::Pause(_) => "PAUSE".to_owned(),
        ActKind::Recover => "17 zeros and the check sequence".to_owned(),
        ActKind::Sequence => "the check sequence alone".to_owned(),
        ActKind::Talk(talk) => of_talk(talk),
        ActKind::Zeros(_) | ActKind::Bytes(_) | ActKind::Wait(_) | ActKind::Power { .. } => {
            String::new()
        }
    };
    if words.chars().count() > MOST_COMMENT {
        words = words.chars().take(MOST_COMMENT - 3).collect::<String>() + "...";
    }
    words
}

fn of_talk(talk: &Talk) -> String {
    let whom = match talk.to {
        To::Drive(drive) => format!("drive {drive}"),
        To::Same => "same drive".to_owned(),
        To::Next => "next drive".to_owned(),
        To::Nobody(_) => "nobody".to_owned(),
    };
    let mut what = Vec::new();
    if let Some(data) = talk.process_data {
        what.push(format!("process data {data:04X}"));
    }
    for order in &talk.orders {
        let wrong = match order.spoil {
            Some(spoil) if usize::from(spoil.at) >= order.command.head().len() => {
                " with a wrong checking byte"
            }
            Some(_) => " with a wrong byte",
            None => "",
        };
        what.push(format!("{}{wrong}", order.command.words()));
    }
    if what.is_empty() {
        what.push("nothing".to_owned());
    }
    format!("{whom}: {}", what.join(", "))
}

fn kind(harm: Harm) -> LinkFaultKind {
    match harm {
        Harm::Delay(us) => LinkFaultKind::Delay(Duration::micros(us.into())),
        Harm::Break(us) => LinkFaultKind::Break(Duration::micros(us.into())),
        other => other.fault().into(),
    }
}

/// Lines with what must be received: act by act, where a byte comes for a byte.
fn answers(text: &mut Text, case: &Case, page: &Surroundings<'_>) {
    let received = &page.seen.received;
    let mut from = 0;
    let sent = sent(case);
    let roles = RingSize::new(u64::from(case.drives)).map(|size| roles(size, &sent));
    let roles = roles.unwrap_or_default();
    if received.len() == answering(&roles, &sent).count() {
        let mut rest = (&roles[..], &sent[..]);
        for part in case.acts.iter().flat_map(|act| act.parts(case.drives)) {
            let (roles, sent) = (rest.0.split_at(part.len()), rest.1.split_at(part.len()));
            let count = answering(roles.0, sent.0).count();
            answer(text, case, from..from + count, page);
            from += count;
            rest = (roles.1, sent.1);
        }
    }
    let step = 4 * ITEMS_A_LINE;
    while from < received.len() {
        let to = (from + step).min(received.len());
        answer(text, case, from..to, page);
        from = to;
    }
}

fn answer(text: &mut Text, case: &Case, range: std::ops::Range<usize>, page: &Surroundings<'_>) {
    let received = &page.seen.received;
    let word = |index: usize| match page.any.contains(&index) {
        true => Byte::Any,
        false => Byte::Byte(received[index].1.byte),
    };
    // A byte with a time in front begins a line.
    let timed = page.timed.filter(|timed| range.contains(timed));
    let middle = timed.unwrap_or(range.end);
    for (part, at) in [(range.start..middle, None), (middle..range.end, timed)] {
        let words: Vec<_> = part.map(word).collect();
        let mut at = at;
        for bytes in Pattern::of(&words, RUN).lines(ITEMS_A_LINE) {
            let ring = case.ring();
            let step: Step = Step::from(Action::Receive {
                port: ring,
                message: bytes,
            });
            match at.take() {
                None => text.step(&step, ""),
                Some(at) => {
                    let tenths = received[at].0.since_start().as_nanos() / 100;
                    let when = When::At(Duration::micros(tenths).tenth().into());
                    text.step(&Step { when, ..step }, "at this time");
                }
            }
        }
    }
}
