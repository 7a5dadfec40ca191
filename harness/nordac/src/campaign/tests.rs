//! The built-in campaigns have the figures that they pin, and mistakes in files are named.

use super::*;
use crate::language::Nordac;
use harness_bench::campaign::line::trials::{self, built_in};

fn text(steps: &str, faults: &str, more: &str) -> String {
    format!(
        "schema = 1\nbus = \"nordac\"\ntitle = \"\"\nsteps = [{steps}]\nfaults = [{faults}]\n{more}"
    )
}

#[test]
fn a_built_in_campaign_has_the_figures_that_it_pins() {
    trials::have_the_figures_that_they_pin::<Telegrams>(&built_in()[..1]);
}

/// `drivebench campaign` does the same.
#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn built_in_campaigns_have_the_figures_that_they_pin() {
    trials::have_the_figures_that_they_pin::<Telegrams>(&built_in());
}

/// One in 37 cases of each built-in campaign as a scenario: a right inverter meets it, and the line carries the same telegrams.
#[test]
fn cases_are_scenarios_that_show_the_same() {
    cases_are_scenarios(37);
}

#[test]
#[ignore = "takes minutes; .ci/nightly runs it"]
fn more_cases_are_scenarios_that_show_the_same() {
    cases_are_scenarios(3);
}

fn cases_are_scenarios(step: usize) {
    trials::cases_are_scenarios::<Telegrams, Nordac>(step, None, |text, _, played| {
        let sent = played.carried.iter().filter(|(replies, _)| !replies);
        let lines = text.lines().filter(|line| line.contains(" > "));
        assert_eq!(lines.count(), sent.count(), "{text}");
    });
}

/// A case of each class. Telegrams 1 to 8 are the start; 9 is the first exchange, and 10 its reply.
#[test]
fn classes() {
    let class =
        |steps, faults, more, case| trials::class::<Telegrams>(&text(steps, faults, more), case);
    let two = "\"start\", \"exchange 047E 2000\", \"exchange 047F 2000\"";
    assert_eq!(class(two, "\"doubled\"", "", "10:doubled"), "unharmed");
    assert_eq!(class(two, "\"bits\"", "", "9:byte 5 flip 0"), "repeated");
    assert_eq!(class(two, "\"lost\"", "repeats = 0", "9:lost"), "fell-back");
    // The reply to the first exchange once more, in place of that to the second one.
    assert_eq!(class(two, "\"former\"", "", "12:former"), "wrong-word");
}

#[test]
fn mistakes_are_named() {
    let read = "\"start\", \"read 1202\"";
    trials::mistakes_are_named::<Telegrams>(&[
        (
            text("\"start\", \"read 1\"", "\"lost\"", ""),
            "step 2 (`read 1`): there is no parameter with this number",
        ),
        (
            text("\"exchange 47E 0\"", "\"lost\"", ""),
            "four hexadecimal digits",
        ),
        (
            text("\"write 1202 = 70000\"", "\"lost\"", ""),
            "no value of 1202",
        ),
        (
            text(read, "\"lost\"", "ppo = 3"),
            "PPO3 has no parameter channel",
        ),
        (text(read, "\"lost\"", "ppo = 5"), "1 to 4 are expected"),
        (text("\"dance\"", "\"lost\"", ""), "this is no step"),
        (text("", "\"lost\"", ""), "1 to 100 are expected"),
        (
            text(read, "\"late\"", ""),
            "`late` in `faults` needs `delays`",
        ),
        (text(read, "\"lost\"", "odd = 1"), "unknown field `odd`"),
        (
            text(read, "\"lost\"", "[expect]\nlocated = 1"),
            "`located` in [expect] is no class",
        ),
        (text("\"read 1202\"", "\"lost\"", ""), "begins with `start`"),
    ]);
}
