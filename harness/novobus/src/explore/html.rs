//! What the page of a run says of rings: which transitions of a drive's end of the bus its cases have reached.

use super::KeptRun;
use super::case::Case;
use super::play::play;
use harness_bench::explore::{ExploreError, LogLine};
use harness_bench::html::Html;
use harness_bench::link::Link as _;
use harness_proto::line::Received;
use harness_sim::novobus::device::Device as _;
use harness_sim::novobus::transitions::{
    Event, Reached, State, Transition, Watched, why_unreachable,
};
use harness_sim::record::Channel;

/// The transitions that the kept cases of a run reach, with a heading.
///
/// # Errors
/// A case of the record is too large, or the model cannot be made.
pub(super) fn reached(kept: &KeptRun) -> Result<(String, Html), ExploreError> {
    let mut reached = Reached::default();
    for line in &kept.lines {
        if let LogLine::Kept { case, .. } = line {
            reach(kept, case, &mut reached)?;
        }
    }
    let mut html = Html::new();
    transitions(&mut html, &reached);
    Ok(("Transitions reached".to_owned(), html))
}

/// What the drives of the model go through in a case: each hears again what its link carried.
fn reach(kept: &KeptRun, case: &Case, reached: &mut Reached) -> Result<(), ExploreError> {
    if !case.is_bounded() {
        return Err(ExploreError::File(
            "a kept case in the record is larger than a case may be".to_owned(),
        ));
    }
    let mut link = kept.about.setup.model(&case.sizes())?;
    play(&mut link, case);
    for link in link
        .trace(case.ring())
        .channels
        .iter()
        .filter(|link| link.to.is_some())
    {
        reached.join(&heard(link));
    }
    Ok(())
}

fn heard(link: &Channel) -> Reached {
    let mut drive = Watched::<Reached>::default();
    for byte in link.octets() {
        if let Some(value) = byte.received {
            let received = Received {
                byte: value,
                error: byte.error,
            };
            drive.receive(byte.at, received);
        }
    }
    drive.reached().clone()
}

/// The matrix of a drive's end of the bus (ND21 9.1-9.9): a row a state, a column an event.
fn transitions(html: &mut Html, reached: &Reached) {
    let all = Transition::reachable().count();
    html.line(
        "p",
        &[],
        format_args!(
            "The kept cases reach {} of {all} reachable transitions of a drive's end of the bus on the model (ND21 9.1-9.9). \
             R is reached, - is not; where nothing stands, nothing can reach it. Silence is not played again: time-outs (9.9) are not counted.",
            reached.count()
        ),
    );
    html.scroll("Transitions", |html| {
        html.element("table", &[("class", &"heat")], |html| {
            html.line(
                "caption",
                &[],
                "Transitions: states down, events across by their numbers",
            );
            html.element("tr", &[], |html| {
                html.line("th", &[("scope", &"col")], "State");
                for event in Event::ALL {
                    html.line(
                        "th",
                        &[("scope", &"col"), ("title", &event.name())],
                        event.index() + 1,
                    );
                }
            });
            for state in State::ALL.iter().copied() {
                html.element("tr", &[], |html| {
                    html.line("th", &[("scope", &"row")], state.name());
                    for event in Event::ALL.iter().copied() {
                        let cell = Transition { state, event };
                        if why_unreachable(cell).is_some() {
                            html.line("td", &[], "");
                        } else if reached.contains(cell) {
                            html.line("td", &[("class", &"k1")], "R");
                        } else {
                            html.line("td", &[("class", &"k0")], "-");
                        }
                    }
                });
            }
        });
    });
    events(html);
}

fn events(html: &mut Html) {
    html.element("details", &[], |html| {
        html.line("summary", &[], "The events by their numbers");
        html.element("ol", &[], |html| {
            for event in Event::ALL {
                html.line(
                    "li",
                    &[],
                    format_args!("{} (ND21 {})", event.name(), event.section()),
                );
            }
        });
    });
}
