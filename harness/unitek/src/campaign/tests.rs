//! The built-in campaigns have the figures that they pin, and mistakes in files are named.

use super::*;
use crate::language::Unitek;
use harness_bench::campaign::line::trials::{self, built_in};

fn text(steps: &str, faults: &str, more: &str) -> String {
    format!(
        "schema = 1\nbus = \"unitek\"\ntitle = \"\"\nsteps = [{steps}]\nfaults = [{faults}]\n{more}"
    )
}

#[test]
fn built_in_campaigns_have_the_figures_that_they_pin() {
    trials::have_the_figures_that_they_pin::<Frames>(&built_in());
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
    trials::cases_are_scenarios::<Frames, Unitek>(
        step,
        Some("unnoticed"),
        |text, trace, played| {
            let frames = trace.channels[0].frames().iter();
            let frames: Vec<_> = frames.map(|line| line.frame).collect();
            assert_eq!(frames, played.carried, "{text}");
        },
    );
}

/// A case of each class.
#[test]
fn classes() {
    let class = |steps, more, case| {
        let faults = "\"lost\", \"doubled\", \"corrupt\"";
        trials::class::<Frames>(&text(steps, faults, more), case)
    };
    let write = "\"write SPEED_CMD = 0\", \"write SPEED_CMD = 0CCD\"";
    // A damaged frame is repeated by the controller.
    let read = "\"read SPEED_CMD\"";
    assert_eq!(class(read, "", "1:corrupt"), "answered");
    assert_eq!(class(read, "", "1:lost"), "retried");
    assert_eq!(class(read, "", "2:lost"), "retried");
    assert_eq!(class(read, "repeats = 0", "2:lost"), "noticed");
    assert_eq!(class(read, "", "2:doubled"), "noticed");
    // The second write is the fourth frame; its read-back shows that it is lost.
    assert_eq!(class(write, "", "4:lost"), "noticed");
    assert_eq!(class(write, "read-back = false", "2:lost"), "unnoticed");
}

#[test]
fn mistakes_are_named() {
    let text = |steps, more| text(steps, "\"lost\"", more);
    trials::mistakes_are_named::<Frames>(&[
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
    ]);
}
