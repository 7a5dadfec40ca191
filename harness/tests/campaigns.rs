//! Campaigns: files with mistakes, the same bytes from every run, the figures of the small ones, the page with the figures of
//! all, and a judge that shares no code with the one under test.

use harness::campaign::find::{find, names};
use harness::campaign::report::{json, table};
use harness::campaign::{Campaign, Case, Class, Finished, Wrong};
use harness::library::Entry;
use harness::link::{Line, Link};
use harness::scenario::problem::Problems;
use harness::scenario::run::{AtFinding, play};
use harness::scenario::simulate::simulated;
use harness::scenario::source::Source;
use harness_sim::reference;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn built_in(name: &str) -> Campaign {
    find(Path::new(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn load(text: &str) -> Result<Campaign, Box<Problems>> {
    let source = Source {
        name: "a.toml".to_owned(),
        text: text.into(),
    };
    Campaign::load(&source, Path::new(""))
}

fn run(campaign: &Campaign) -> Finished {
    campaign.run(2, &|_| {}).expect("every case fits a class")
}

fn snapshot(name: &str, page: &str) {
    insta::with_settings!({
        snapshot_path => root().join("snapshots/campaigns"),
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
        snapshot(name, &table(&finished));
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
        let file: harness::campaign::file::CampaignFile =
            toml::from_str(&text.expect("a file")).expect("a campaign");
        let cases = file.expect.cases.unwrap_or_else(|| panic!("{name}"));
        let mut row = format!("| `{name}` | {cases} |");
        let mut sum = 0;
        for class in Class::ALL {
            let count = file
                .expect
                .of(class)
                .unwrap_or_else(|| panic!("{name}: {class}"));
            let _infallible = write!(row, " {count} |");
            sum += count;
        }
        assert_eq!(sum, cases, "{name}");
        assert!(page.contains(&row), "the page has no row\n{row}");
    }
}

#[test]
fn two_runs_give_the_same_bytes_on_any_number_of_threads() {
    let campaign = built_in("9.9-silence");
    let text = |threads| {
        let finished = campaign.run(threads, &|_| {}).expect("classes");
        let json = json(std::slice::from_ref(&finished), None).to_string();
        table(&finished) + &json
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
            let own = problems.to_string().starts_with("a.toml");
            let before = text.get(..problem.span.start).filter(|_| own);
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

/// What a case is, by the reference model alone: no code of the simulator, the master or the campaign. It knows no
/// time, so that it judges bits but the start bit.
struct Judge {
    sent: Vec<u8>,
    drives: Vec<reference::Drive>,
    heard: Vec<u8>,
}

/// What the judge can say.
#[derive(Debug, PartialEq, Eq)]
enum Verdict {
    /// The master hears what it hears without a fault, and every drive holds the same.
    Harmless,
    /// The master hears the same, and this cell of this drive is different.
    Silent(Vec<(u8, u16)>),
    /// The master hears something else; the drive that the ring spells out, if it does.
    Noticed(Option<u8>),
}

impl Judge {
    fn new() -> Self {
        let text = [
            "8A FE 82 55 13 FE E8", // drive 0 of 2 would be FE; here drive 0
            "8C FF 63 34 12 08 FF B0",
            "85 FE 12 34",
            "88 FE C0 13 FE D1",
        ];
        let byte = |word| u8::from_str_radix(word, 16).expect("a byte");
        let sent: Vec<u8> = text.join(" ").split(' ').map(byte).collect();
        let mut drive = reference::Drive::new();
        drive.poke(0xFF32, 0x6A);
        drive.poke(0xFF34, 0x28);
        let mut judge = Self {
            sent,
            drives: vec![drive.clone(), drive],
            heard: Vec::new(),
        };
        judge.heard = judge.listen(&[]).0.iter().map(|(byte, _)| *byte).collect();
        judge
    }

    fn listen(
        &self,
        faults: &[(usize, usize, reference::Fault)],
    ) -> (Vec<(u8, bool)>, Vec<reference::Drive>) {
        let mut drives = self.drives.clone();
        let mut sent = self.sent.clone();
        sent.extend([0x80; 60]);
        let links = reference::run(&mut drives, &sent, faults);
        let last = links.last().expect("a link");
        (
            last.iter().map(|cell| (cell.byte, cell.error)).collect(),
            drives,
        )
    }

    fn verdict(&self, faults: &[(usize, usize, reference::Fault)]) -> Verdict {
        let (heard, drives) = self.listen(faults);
        let same = heard
            .iter()
            .map(|(byte, error)| (*byte, *error))
            .eq(self.heard.iter().map(|b| (*b, false)));
        if !same {
            let (last, _) = *heard.last().expect("bytes");
            let spelled = heard
                .iter()
                .rev()
                .take_while(|(byte, error)| *byte == last && !error)
                .count()
                >= 20;
            return Verdict::Noticed(Some(last).filter(|last| spelled && *last < 2));
        }
        let sound = self.listen(&[]).1;
        let mut wrong = Vec::new();
        for (place, (drive, sound)) in drives.iter().zip(&sound).enumerate() {
            let differs = |address: &u16| drive.peek(*address) != sound.peek(*address);
            let addresses = (0xFD80..=0xFFFF).filter(differs);
            wrong.extend(addresses.map(|address| (1 - place as u8, address)));
        }
        if wrong.is_empty() {
            Verdict::Harmless
        } else {
            Verdict::Silent(wrong)
        }
    }
}

fn as_reference(case: &Case) -> Option<Vec<(usize, usize, reference::Fault)>> {
    use harness::campaign::fault::{Bit, What};
    let fault = |what| {
        Some(match what {
            What::Bit(Bit::Data(bit)) => reference::Fault::Flip(1 << bit, false, false),
            What::Bit(Bit::Parity) => reference::Fault::Flip(0, true, false),
            What::Bit(Bit::Stop) => reference::Fault::Flip(0, false, true),
            What::Drop => reference::Fault::Drop,
            What::Duplicate => reference::Fault::Duplicate,
            What::Insert(byte) => reference::Fault::Insert(byte),
            _ => return None,
        })
    };
    let all = case.faults().map(|injected| {
        let byte = usize::try_from(injected.byte).ok()?;
        Some((injected.link, byte, fault(injected.what)?))
    });
    all.collect()
}

/// The classes of a ring of two beside a judge that knows nothing but the reference model: every bit, and every pair of bits
/// in one byte, but for the start bit.
#[test]
fn an_independent_judge_agrees() {
    let judge = Judge::new();
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: String = judge.sent.iter().map(|b| format!(" {b:02X}")).collect();
    let scenario = format!(
        "title t\nsource nd21 9.6\nring 2\ndrive 0..last memory DataIn = 6A\n\
         drive 0..last memory DataOut = 28\n>{bytes}\n"
    );
    std::fs::write(folder.path().join("two.scn"), scenario).expect("a file");
    let mut seen = std::collections::BTreeMap::new();
    for more in ["", "pairs = \"byte\"\n"] {
        let text = format!(
            "schema = 1\ntitle = \"t\"\nscenario = \"two.scn\"\nfaults = [\"bits\"]\n\
             bits = [\"0\", \"1\", \"2\", \"3\", \"4\", \"5\", \"6\", \"7\", \"p\", \"s\"]\n{more}"
        );
        let path = folder.path().join("two.toml");
        std::fs::write(&path, text).expect("a file");
        let campaign = find(&path).unwrap_or_else(|error| panic!("{error}"));
        for case in &campaign.cases {
            let (outcome, _) = campaign.play(case).expect("a class");
            let faults = as_reference(case).expect("bits");
            let verdict = judge.verdict(&faults);
            check(case, &outcome, &verdict);
            *seen.entry(outcome.class).or_insert(0u32) += 1;
        }
    }
    // Cases of one class alone would show little.
    for class in [
        Class::Located,
        Class::Recovered,
        Class::Mislocated,
        Class::Corrupted,
        Class::SilentCorruption,
    ] {
        assert!(seen.get(&class).is_some_and(|count| *count > 5), "{seen:?}");
    }
}

/// Whether class and evidence are what the judge says.
fn check(case: &Case, outcome: &harness::campaign::Outcome, verdict: &Verdict) {
    let place = || format!("{}: {verdict:?} {outcome:?}", case.name(2));
    let evidence = &outcome.evidence;
    match verdict {
        Verdict::Harmless => assert_eq!(outcome.class, Class::Harmless, "{}", place()),
        Verdict::Silent(cells) => {
            assert_eq!(outcome.class, Class::SilentCorruption, "{}", place());
            let cell = |wrong: &Wrong| match wrong {
                Wrong::Cell { drive, address, .. } => Some((*drive, *address)),
                Wrong::Answer { .. } => None,
            };
            let mut found: Vec<_> = evidence.wrong.iter().filter_map(cell).collect();
            found.sort_unstable_by_key(|(drive, address)| (std::cmp::Reverse(*drive), *address));
            assert_eq!(&found, cells, "{}", place());
        }
        Verdict::Noticed(None) => {
            // Data that nobody compares may come back otherwise.
            let data = outcome.class == Class::SilentCorruption
                && evidence
                    .wrong
                    .iter()
                    .all(|wrong| matches!(wrong, Wrong::Answer { .. }));
            assert!(evidence.noticed || data, "{}", place());
            // What is no drive's address can only be the master's own link.
            assert!(evidence.named.is_none_or(|link| link == 2), "{}", place());
        }
        Verdict::Noticed(Some(drive)) => {
            assert!(evidence.noticed, "{}", place());
            assert_eq!(evidence.named, Some(1 - usize::from(*drive)), "{}", place());
        }
    }
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
        let case = Case::from_name(case, campaign.shape.drives).expect("a case");
        let (outcome, _) = campaign.play(&case).expect("a class");
        let text = harness::campaign::replay::scenario(&campaign, &case).expect("a text");
        let source = Source {
            name: "replay".to_owned(),
            text: text.clone().into(),
        };
        let entry = Entry::new(source, None).unwrap_or_else(|p| panic!("{text}\n{:#?}", p.all()));
        let plan = entry.plan.as_ref().expect("a plan");
        let mut link = simulated(plan);
        let played = play(plan, &mut link, AtFinding::GoOn);
        assert!(played.remarks.is_empty(), "{name}: {:?}", played.remarks);
        for wrong in &outcome.evidence.wrong {
            let Wrong::Cell {
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
            let bytes = &trace.links[fault.link].bytes;
            let byte = bytes[usize::try_from(fault.byte - 1).expect("a byte")];
            let late = byte.at.since(bytes[0].at) > link.byte_time() * fault.byte;
            let damaged = byte.sent != byte.received || byte.error.is_some();
            assert!(damaged || late, "{name}: no fault in the trace\n{text}");
        }
    }
}

#[test]
fn names_that_are_not_there() {
    let error = find(&PathBuf::from("9.6-single-bit")).expect_err("no such campaign");
    assert!(
        error
            .to_string()
            .contains("did you mean `9.6-single-bits`?"),
        "{error}"
    );
}
