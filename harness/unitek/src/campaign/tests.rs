//! The built-in campaigns have the figures that they pin, and mistakes in files are named.

use super::*;
use crate::language::Unitek;
use harness_bench::campaign::line::replayed;

/// The page with the figures.
const PAGE: &str = include_str!("../../../../corpora/campaigns/README.md");

fn text(steps: &str, more: &str) -> String {
    format!(
        "schema = 1\nbus = \"unitek\"\ntitle = \"\"\nsteps = [{steps}]\nfaults = [\"lost\"]\n{more}"
    )
}

fn class(steps: &str, more: &str, frame: u64, fault: FrameFault) -> FrameClass {
    let campaign = FrameCampaign::new("a", &text(steps, more)).expect("a campaign");
    campaign.play(FrameCase { frame, fault }).class
}

#[test]
fn built_in_campaigns_have_the_figures_that_they_pin() {
    let names = names();
    assert!(names.len() >= 2, "{names:?}");
    for name in names {
        let campaign = find(Path::new(&name))
            .expect("it is there")
            .expect("it can be read");
        let expect = campaign.file.expect;
        let pinned = FrameClass::ALL.map(|class| expect.of(class).expect("every class is pinned"));
        assert_eq!(expect.cases, Some(pinned.iter().sum()), "{name}");
        let played = campaign.played(&|_| {});
        assert_eq!(played.differs(), [], "{}", played.table());
        let figures = pinned.map(|figure| figure.to_string()).join(" | ");
        let row = format!("| `{name}` | {} | {figures} |", expect.cases.unwrap_or(0));
        assert!(PAGE.contains(&row), "corpora/campaigns/README.md: {row}");
    }
}

/// One in seven cases of each built-in campaign as a scenario, and every case in which something was not noticed: a right drive meets it,
/// and the bus carries the same frames.
#[test]
fn cases_are_scenarios_that_show_the_same() {
    cases_are_scenarios(7);
}

#[test]
#[ignore = "takes half a minute; .ci/nightly runs it"]
fn every_case_is_a_scenario_that_shows_the_same() {
    cases_are_scenarios(1);
}

fn cases_are_scenarios(step: usize) {
    for name in names() {
        let campaign = find(Path::new(&name))
            .expect("it is there")
            .expect("it can be read");
        for (place, case) in campaign.cases.iter().enumerate() {
            let outcome = campaign.play(*case);
            if place % step > 0 && outcome.class != FrameClass::Unnoticed {
                continue;
            }
            let class = CLASSES[outcome.class as usize];
            let (text, trace) = replayed::<Unitek>(&campaign, &case.to_string(), class);
            let frames: Vec<_> = trace.channels[0]
                .frames()
                .iter()
                .map(|own| own.frame)
                .collect();
            assert_eq!(frames, outcome.conversation.frames, "{text}");
        }
        assert!(
            campaign
                .scenario("0:lost")
                .is_err_and(|why| format!("{why:?}").contains("such as `1:lost`"))
        );
    }
}

/// A case of each class.
#[test]
fn classes() {
    let write = "\"write SPEED_CMD = 0\", \"write SPEED_CMD = 0CCD\"";
    // A damaged frame is repeated by the controller.
    let read = "\"read SPEED_CMD\"";
    assert_eq!(
        class(read, "", 1, FrameFault::Corrupt),
        FrameClass::Answered
    );
    assert_eq!(class(read, "", 1, FrameFault::Lost), FrameClass::Retried);
    assert_eq!(class(read, "", 2, FrameFault::Lost), FrameClass::Retried);
    assert_eq!(
        class(read, "repeats = 0", 2, FrameFault::Lost),
        FrameClass::Noticed
    );
    assert_eq!(class(read, "", 2, FrameFault::Doubled), FrameClass::Noticed);
    // The second write is the fourth frame; its read-back shows that it is lost.
    assert_eq!(class(write, "", 4, FrameFault::Lost), FrameClass::Noticed);
    assert_eq!(
        class(write, "read-back = false", 2, FrameFault::Lost),
        FrameClass::Unnoticed
    );
}

#[test]
fn mistakes_are_named() {
    for (text, says) in [
        (
            text("\"read NOWHERE\"", ""),
            "step 1 (`read NOWHERE`): no register has this name",
        ),
        (
            text("\"write SPEED_CMD = 12345\"", ""),
            "at most 4 hexadecimal digits",
        ),
        (text("\"cycle SPEED_ACTUAL 255ms\"", ""), "1ms to 254ms"),
        (text("\"dance\"", ""), "this is no step"),
        (text("", ""), "1 to 200 are expected"),
        (
            text("\"read SPEED_CMD\"", "delays = [\"5ms\"]"),
            "`delays` needs `late`",
        ),
        (text("\"read SPEED_CMD\"", "odd = 1"), "unknown field `odd`"),
        (
            text("\"read SPEED_CMD\"", "[expect]\nlocated = 1"),
            "unknown field `located`",
        ),
    ] {
        let error = FrameCampaign::new("a.toml", &text).expect_err(says);
        assert!(
            error.starts_with("a.toml: ") && error.contains(says),
            "{error}"
        );
    }
}
