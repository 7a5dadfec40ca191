//! The built-in campaigns have the figures that they pin, and mistakes in files are named.

use super::*;
use crate::language::Nordac;
use harness_bench::campaign::line::replayed;

/// The page with the figures.
const PAGE: &str = include_str!("../../../../corpora/campaigns/README.md");

fn text(steps: &str, faults: &str, more: &str) -> String {
    format!(
        "schema = 1\nbus = \"nordac\"\ntitle = \"\"\nsteps = [{steps}]\nfaults = [{faults}]\n{more}"
    )
}

#[test]
fn a_built_in_campaign_has_the_figures_that_it_pins() {
    let names = names();
    assert!(names.len() >= 2, "{names:?}");
    let cases = |name: &String| {
        let campaign = find(Path::new(name)).expect("it is there");
        campaign.expect("it can be read").cases.len()
    };
    have_the_figures_that_they_pin(names.iter().min_by_key(|name| cases(name)));
}

/// `drivebench campaign` does the same.
#[test]
#[ignore = "takes seconds; .ci/nightly runs it"]
fn built_in_campaigns_have_the_figures_that_they_pin() {
    have_the_figures_that_they_pin(&names());
}

fn have_the_figures_that_they_pin<'n>(names: impl IntoIterator<Item = &'n String>) {
    let mut wrong = String::new();
    for name in names {
        let campaign = find(Path::new(name))
            .expect("it is there")
            .expect("it can be read");
        let expect = &campaign.file.expect;
        let pinned = CLASSES.map(|class| *expect.get(class.name).expect("every class is pinned"));
        assert_eq!(expect.get("cases"), Some(&pinned.iter().sum()), "{name}");
        let played = campaign.played(&|_| {}).expect("every case");
        if !played.differs().is_empty() {
            wrong.push_str(&played.table());
        }
        let figures = pinned.map(|figure| figure.to_string()).join(" | ");
        let row = format!("| `{name}` | {} | {figures} |", pinned.iter().sum::<u64>());
        if !PAGE.contains(&row) {
            wrong.push_str(&format!("corpora/campaigns/README.md: {row}\n"));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
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
    for name in names() {
        let campaign = find(Path::new(&name))
            .expect("it is there")
            .expect("it can be read");
        for case in campaign.cases.iter().step_by(step) {
            let (class, conversation) = campaign.play(*case).expect("played");
            let (text, _) = replayed::<Nordac>(&campaign, &case.name(), CLASSES[class]);
            let sent = conversation
                .telegrams
                .iter()
                .filter(|(replies, _)| !replies);
            let lines = text.lines().filter(|line| line.contains(" > "));
            assert_eq!(lines.count(), sent.count(), "{text}");
        }
        assert!(campaign.scenario("0:lost").is_err());
    }
}

/// The class of the only case that has this name.
fn class(steps: &str, faults: &str, more: &str, name: &str) -> &'static str {
    let campaign = TelegramCampaign::new("a", &text(steps, faults, more)).expect("a campaign");
    let played = campaign.played(&|_| {}).expect("every case");
    let mut found = played.outcomes.iter().filter(|own| own.case == name);
    CLASSES[found.next().expect("a case of this name").class].name
}

/// A case of each class. Telegrams 1 to 8 are the start; 9 is the first exchange, and 10 its reply.
#[test]
fn classes() {
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
    for (text, says) in [
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
    ] {
        let error = TelegramCampaign::new("a.toml", &text).expect_err(says);
        assert!(
            error.starts_with("a.toml: ") && error.contains(says),
            "{error}"
        );
    }
}
