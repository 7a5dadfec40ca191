//! Campaigns: files with mistakes, the same bytes from every run, the figures of the small ones, the page with the figures of
//! all, and a judge that shares no code with the one under test.

mod judge;

use crate::campaign::class::{CaseClass, WrongValue};
use crate::campaign::find::{find, names};
use crate::campaign::html::by_place;
use crate::campaign::pairs::Apart;
use crate::campaign::{Campaign, CaseFaults, PlayedCampaign};
use crate::language::read::RingScenario;
use crate::link::BesideTheBus as _;
use crate::simulate::simulated;
use crate::tests::ROOT;
use harness_bench::campaign::PlayedCampaign as _;
use harness_bench::link::{Link, Octets};
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::run::{AtMismatch, play};
use harness_bench::scenario::source::Source;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(ROOT)
}

fn built_in(name: &str) -> Campaign {
    let found = find(Path::new(name)).expect("a built-in campaign");
    found.unwrap_or_else(|error| panic!("{name}: {error:?}"))
}

fn load(text: &str) -> Result<Campaign, Box<Problems>> {
    let source = Source {
        name: "a.toml".to_owned(),
        text: text.into(),
    };
    Campaign::load(&source, Path::new(""))
}

fn run(campaign: &Campaign) -> PlayedCampaign {
    campaign.run(2, &|_| {}).expect("every case fits a class")
}

fn snapshot(name: &str, page: &str) {
    insta::with_settings!({
        // As the list of snapshots that were used has it.
        snapshot_path => root().canonicalize().expect("a folder").join("snapshots/campaigns"),
        prepend_module_to_snapshot => false,
        omit_expression => true,
    }, {
        insta::assert_snapshot!(name, page);
    });
}

/// The campaigns that are small enough for a build without optimisation; `.ci/run` plays all of them.
const SMALL: [&str; 3] = ["9.6-single-bits", "9.6-lost-and-doubled", "9.9-silence"];

#[test]
fn small_campaigns_have_the_figures_that_they_pin() {
    for name in SMALL {
        let finished = run(&built_in(name));
        assert_eq!(finished.differs(), [], "{name}");
        snapshot(name, &finished.table());
    }
}

/// A campaign that pins nothing could not fail.
#[test]
fn every_campaign_pins_every_figure_and_the_page_shows_them() {
    let page = root().join("corpora/campaigns/README.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let names = names();
    assert!(names.len() >= 9, "{names:?}");
    for name in names {
        let text = std::fs::read_to_string(root().join(format!("corpora/campaigns/{name}.toml")));
        let file: crate::campaign::file::CampaignFile =
            toml::from_str(&text.expect("a file")).expect("a campaign");
        let cases = file.expect.cases.unwrap_or_else(|| panic!("{name}"));
        let mut row = format!("| `{name}` | {cases} |");
        let mut sum = 0;
        for class in CaseClass::ALL {
            let count = file
                .expect
                .of(class)
                .unwrap_or_else(|| panic!("{name}: {class}"));
            let _infallible = write!(row, " {count} |");
            sum += count;
        }
        assert_eq!(sum, cases, "{name}");
        assert_eq!(built_in(&name).cases.len() as u64, cases, "{name}");
        assert!(page.contains(&row), "the page has no row\n{row}");
    }
}

/// Cases that share what they have in common against the same cases, each from the start: a random sample of every campaign, and of
/// pairs of its faults anywhere.
#[test]
fn shared_cases_have_the_evidence_of_cases_from_the_start() {
    let seed = std::env::var("DRIVEBENCH_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok())
        .unwrap_or(9_700);
    let mut random = fastrand::Rng::with_seed(seed);
    let mut two_links = 0;
    for name in names() {
        let campaign = built_in(&name);
        let mut player = campaign.player();
        for _ in 0..25 {
            let any = |random: &mut fastrand::Rng| *random.choice(&campaign.cases).expect("cases");
            let mut case = any(&mut random);
            if case.second.is_none() && random.bool() {
                case.second = Some(any(&mut random).first);
                let second = case.second.map(|fault| fault.link);
                two_links += usize::from(second != Some(case.first.link));
            }
            let again = format!(
                "{name}: {}; repeat with: DRIVEBENCH_SEED={seed} cargo test -p harness-novobus shared_cases",
                case.name(campaign.shape.drives)
            );
            let (expected, _) = campaign.play(&case).unwrap_or_else(|_| panic!("{again}"));
            assert_eq!(player.play(&case), Ok(expected), "{again}");
        }
    }
    assert!(two_links > 20, "{two_links} cases with faults on two links");
}

/// The counts of all pairs of a small campaign against each of its pairs, played from the start.
#[test]
fn counted_pairs_are_what_each_pair_is_from_the_start() {
    let head = "schema = 1\ntitle = \"t\"\nscenario = \"9.6-every-write\"\n";
    for faults in [
        // Bytes of process data, in which two bits are a silent corruption.
        "links = [\"master->2\", \"1->0\"]\nbytes = \"34..36\"\nfaults = [\"bits\"]\nbits = [\"b\", \"0\", \"3\", \"p\", \"s\"]",
        "links = [\"2->1\", \"0->master\"]\nbytes = \"17..19\"\nfaults = [\"drop\", \"insert\", \"gap\", \"delay\", \"break\"]\n\
         inserted = [\"88\"]\ngaps = [6]\ndelays = [\"3ms\"]\nbreaks = [\"1ms\"]",
    ] {
        let campaign = load(&format!("{head}{faults}\n")).expect("a campaign");
        let counted = campaign.count_pairs(None, 1, &|_| {}).expect("counts");
        let in_threads = campaign.count_pairs(None, 3, &|_| {});
        assert_eq!(in_threads.as_ref(), Ok(&counted));
        let singles: Vec<_> = campaign.cases.iter().map(|case| case.first).collect();
        let mut expected = BTreeMap::new();
        let mut closer = 0;
        for (place, second) in singles.iter().enumerate() {
            for first in &singles[..place] {
                let case = CaseFaults {
                    first: *first,
                    second: Some(*second),
                };
                let (outcome, _) = campaign.play(&case).expect("a class");
                *expected
                    .entry((Apart::of(&case), outcome.class))
                    .or_insert(0) += 1;
                let named = outcome.evidence.named == Some(second.link);
                let across = Apart::of(&case) == Apart::Links;
                closer += u64::from(named && across && outcome.class == CaseClass::Located);
            }
        }
        for apart in [Apart::Byte, Apart::Link, Apart::Links] {
            for class in CaseClass::ALL {
                let count = expected.get(&(apart, class)).copied().unwrap_or(0);
                assert_eq!(
                    counted.counts[apart as usize][class as usize], count,
                    "{apart:?} {class}"
                );
            }
        }
        assert_eq!(counted.closer, closer);
        assert_eq!(
            counted.counts.iter().flatten().sum::<u64>(),
            counted.pairs()
        );
        assert!(expected.len() > 4, "{expected:?}");
    }
}

/// A sample is drawn without one pair twice, and a sample of all pairs has the counts of all.
#[test]
fn a_sample_of_all_pairs_has_their_counts() {
    let text = "schema = 1\ntitle = \"t\"\nscenario = \"9.6-every-write\"\nfaults = [\"bits\"]\nlinks = [\"master->2\", \"2->1\"]\n\
                bytes = \"35\"\n";
    let campaign = load(text).expect("a campaign");
    let counted = campaign.count_pairs(None, 1, &|_| {}).expect("counts");
    let sampled = campaign.sample_pairs(1_000, 7, 2, &|_| {}).expect("counts");
    assert_eq!(sampled.counts, counted.counts);
    assert_eq!((sampled.seed, counted.seed), (Some(7), None));
    let few = campaign.sample_pairs(20, 7, 2, &|_| {}).expect("counts");
    assert_eq!(few.counts.iter().flatten().sum::<u64>(), 20);
    snapshot("pairs", &format!("{}\n{}", counted.table(), few.table()));
}

#[test]
fn two_runs_give_the_same_bytes_on_any_number_of_threads() {
    let campaign = built_in("9.9-silence");
    let text = |threads| {
        let finished = campaign.run(threads, &|_| {}).expect("classes");
        let json = finished.json(None).to_string();
        finished.table() + &json
    };
    let one = text(1);
    assert_eq!(one, text(1));
    assert_eq!(one, text(3));
    assert_eq!(one, text(64));
}

/// Mistakes are shown with the place at which they stand.
#[test]
fn files_with_mistakes() {
    let good = "schema = 1\ntitle = \"t\"\nscenario = \"9.6-every-write\"\nfaults = [\"bits\"]\n";
    assert_eq!(load(good).expect("a campaign").cases.len(), 4 * 78 * 11);
    let changed = |from: &str, to: &str| good.replace(from, to);
    let added = |line: &str| format!("{good}{line}\n");
    let texts = [
        changed("schema = 1", "schema = 2"),
        changed("title", "titel"),
        changed("\"bits\"", "\"bit\""),
        changed("[\"bits\"]", "[\"bits\", \"bits\"]"),
        changed("[\"bits\"]", "[\"gap\"]"),
        changed("[\"bits\"]", "\"bits\""),
        changed("[\"bits\"]", "[]"),
        changed("9.6-every-write", "9.7-no-such"),
        changed("9.6-every-write", "13.1.1-referencing"),
        changed("9.6-every-write", "10.1-read-byte-wrong"),
        added("links = [\"3->2\"]"),
        added("links = [\"2-1\"]"),
        added("bytes = \"70..79\""),
        added("bytes = \"0..7\""),
        added("bits = [\"9\"]"),
        added("inserted = [\"80\"]"),
        added("drives = 251"),
        added("sample = 0"),
        added("seed = 7"),
        added("pairs = \"any\""),
        added("[expect]\nsilent = 0"),
        added("[expect]\nlocated = -1"),
        "schema = 1\nfaults = ".to_owned(),
        changed(
            "[\"bits\"]",
            "[\"insert\", \"delay\"]\ninserted = [\"8\"]\ndelays = [\"2s\"]",
        ),
    ];
    let mut page = String::new();
    for text in texts {
        let problems = load(&text).expect_err(&text);
        for problem in problems.all() {
            let in_campaign = problems.to_string().starts_with("a.toml");
            let before = text.get(..problem.span.start).filter(|_| in_campaign);
            let place = before.map_or("in its scenario".to_owned(), |before| {
                let line = before.matches('\n').count() + 1;
                let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
                format!("a.toml:{line}:{column}")
            });
            let _infallible = writeln!(
                page,
                "{place}: {}\n    {}",
                problem.message, problem.expected
            );
            if let Some(help) = &problem.help {
                let _infallible = writeln!(page, "    {help}");
            }
        }
        page.push('\n');
    }
    snapshot("mistakes", &page);
}

/// The text that replays a case gives the bytes that the campaign saw: what the master sent in it, and the same finding
/// of which drives hold what.
#[test]
fn a_replay_is_the_case() {
    for (name, case) in [
        ("9.6-single-bits", "2->1:18:b"),
        ("9.6-two-bits-a-byte", "master->2:35:0+master->2:35:1"),
        ("9.6-lost-and-doubled", "master->2:18:gap-6"),
        ("9.9-silence", "2->1:7:delay-25ms"),
        ("9.8-driver-single-bits", "1->0:30:4"),
    ] {
        let campaign = built_in(name);
        let case = CaseFaults::from_name(case, campaign.shape.drives).expect("a case");
        let (outcome, _) = campaign.play(&case).expect("a class");
        let text = crate::campaign::replay::scenario(&campaign, &case).expect("a text");
        let source = Source {
            name: "replay".to_owned(),
            text: text.clone().into(),
        };
        let entry =
            RingScenario::new(source, None).unwrap_or_else(|p| panic!("{text}\n{:#?}", p.all()));
        let plan = entry.plan;
        let mut link = simulated(&plan);
        let played = play(&plan, &mut link, AtMismatch::GoOn);
        assert!(played.remarks.is_empty(), "{name}: {:?}", played.remarks);
        for wrong in &outcome.evidence.wrong {
            let WrongValue::Cell {
                drive,
                address,
                value,
                ..
            } = wrong
            else {
                continue;
            };
            assert_eq!(
                link.peek(0, *drive, *address),
                Some(*value),
                "{name}\n{text}"
            );
        }
        let trace = link.trace(0);
        for fault in case.faults() {
            let bytes = trace.channels[fault.link].octets();
            let byte = bytes[usize::try_from(fault.byte - 1).expect("a byte")];
            let late = byte.at.since(bytes[0].at) > link.byte_time() * fault.byte;
            let damaged = byte.sent != byte.received || byte.error.is_some();
            assert!(damaged || late, "{name}: no fault in the trace\n{text}");
        }
    }
}

/// The figures of a map of links and bytes: each case at each of its places.
#[test]
fn cases_by_link_and_byte() {
    let finished = run(&built_in("9.9-silence"));
    let map = by_place(&finished);
    // Four links, 57 bytes, and eleven faults at each.
    assert_eq!(map.len(), 4 * 57);
    assert!(
        map.values()
            .all(|classes| classes.values().sum::<u64>() == 11)
    );
    let of = |class| {
        map.values()
            .filter_map(|classes| classes.get(&class))
            .sum::<u64>()
    };
    for class in CaseClass::ALL {
        assert_eq!(of(class), finished.count(class as usize), "{class}");
    }
}

/// Process data first go to FF08 and the second time to FF0A: what a repeated telegram does is not what it did.
#[test]
fn a_conversation_that_cannot_be_repeated_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = "title t\nsource nd21 9.4\nring 1\ndrive 0 memory DataIn = 08\n\
                    > 85 FF 12 34\n> 8A FF 82 0A 32 FF BD\n";
    std::fs::write(folder.path().join("twice.scn"), scenario).expect("a file");
    let path = folder.path().join("twice.toml");
    let text = "schema = 1\ntitle = \"t\"\nscenario = \"twice.scn\"\nfaults = [\"bits\"]\n";
    std::fs::write(&path, text).expect("a file");
    let error = find(&path).expect("a file").expect_err("a mistake");
    let harness_bench::campaign::CampaignError::Mistakes(problems) = error else {
        panic!("{error:?}");
    };
    let message = &problems.all()[0].message;
    assert_eq!(
        message,
        "played twice, the conversation leaves other cells than played once"
    );
}
