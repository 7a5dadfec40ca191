//! Text of a scenario, a drive or a file's name never becomes markup.

use super::devtools::Browser;
use super::parser::{Element, parse, sound};
use super::{folder, played};
use harness::scenario::run::AtMismatch;
use harness::shown::{Head, ScenarioView, run, section};
use serde_json::json;

/// What would be something else than text in HTML, in an attribute, in a script, in XML, in a comment, or to a reader's eye.
const HOSTILE: [&str; 12] = [
    "<script>window.hacked = 1</script>",
    "\"onload=\"window.hacked = 1\" x=\"",
    "' onmouseover='window.hacked = 1",
    "]]><img src=x onerror=window.hacked=1>",
    "</script><script>window.hacked = 1</script>",
    "</style><svg onload=window.hacked=1>",
    "<!-- --!><iframe srcdoc='<script>parent.hacked=1</script>'>",
    "</title></textarea></p></div><base href=//example.org>",
    "javascript:window.hacked=1",
    "&lt;script&gt; &#x3c;script&#x3e; &amp",
    "a\u{0}b\u{1b}[31mc\u{7f}\u{85}\u{feff}\u{202e}nur\u{2066}\u{200f}",
    "\u{2028}\u{2029}\u{fffe}\u{ffff}`${window.hacked = 1}`",
];

/// A page on which every text that is not the program's own is hostile.
fn page() -> String {
    let all = HOSTILE.iter().enumerate().map(|(number, text)| {
        let calm = "title calm\nring 3\ndrive 1 memory FE13 = 88\nrecord drive 1 FE13 every 1ms\n\n> 88 FE C0 13 FE D1\n> 80*3\n< 88 01 C1\n";
        let (_, mut outcome, traces) = played("calm", calm);
        let finding = outcome.finding.as_mut().expect("it fails");
        finding.message = (*text).to_owned();
        finding.in_error = (*text).to_owned();
        outcome.remarks.push((*text).to_owned());
        for record in &mut outcome.records {
            record.name = (*text).to_owned();
        }
        let shown = format!("{text}\n{calm}");
        let played = ScenarioView {
            name: text,
            title: text,
            sources: &[(*text).to_owned()],
            drives: text,
            text: &shown,
            outcome: &outcome,
            traces: &traces,
            report: super::BUS.report,
            rate: harness_proto::line::Rate::default(),
            again: text,
        };
        section(number + 1, &played)
    });
    let shown = all.collect();
    let facts = HOSTILE.map(|text| (text, text.to_owned())).to_vec();
    run(
        &Head {
            found: Vec::new(),
            title: HOSTILE[0],
            facts,
        },
        shown,
    )
}

fn count(page: &Element, name: &str) -> usize {
    page.all()
        .iter()
        .filter(|element| element.name == name)
        .count()
}

#[test]
fn a_strict_reader_finds_nothing_but_text() {
    let html = page();
    let parsed = parse(&html);
    sound(&parsed);
    // The page's script and the data of each ring and of each curve, and no other.
    assert_eq!(count(&parsed, "script"), 1 + 2 * HOSTILE.len());
    let text = parsed.text();
    assert!(
        text.contains("<script>window.hacked = 1</script>"),
        "it is shown as it is"
    );
    assert!(html.contains("&lt;script&gt;window.hacked"));
}

#[test]
fn a_browser_runs_nothing_of_it() {
    let home = folder("hostile");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let file = home.join("page.html");
    std::fs::write(&file, page()).expect("a file");
    browser.open(&file);
    browser.until("document.readyState === 'complete'");
    let seen = browser.value(
        "(() => { let handlers = 0; for (const element of document.querySelectorAll('*')) for (const { name } of element.attributes) handlers += name.startsWith('on');
           return [typeof window.hacked, handlers, document.querySelectorAll('img,iframe,base,object,embed,link,form').length,
                   document.querySelectorAll('script:not([type])').length, document.title]; })()",
    );
    assert_eq!(seen, json!(["undefined", 0, 0, 1, HOSTILE[0]]));
    // Pointing at bytes shows texts too.
    browser.value("document.querySelector('.ring').scrollIntoView()");
    browser.until("!!document.querySelector('.tools')");
    browser.value("document.querySelector('.scroll').focus()");
    for key in ["ArrowRight", "f", "t", "t"] {
        browser.press(key);
    }
    assert_eq!(browser.value("typeof window.hacked"), json!("undefined"));
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

/// A script that is not the page's own would not run, even if it came into the page.
#[test]
fn the_policy_keeps_other_scripts_out() {
    let home = folder("policy");
    let Some(mut browser) = Browser::start(&home.join("profile")) else {
        return;
    };
    let file = home.join("page.html");
    let broken = page().replacen(
        "<main",
        "<script>window.hacked = 1</script><img src=\"http://127.0.0.1:9/x.png\"><main",
        1,
    );
    std::fs::write(&file, broken).expect("a file");
    browser.open(&file);
    assert_eq!(browser.value("typeof window.hacked"), json!("undefined"));
    let complaints = browser.complaints();
    assert_eq!(complaints.len(), 2, "both are refused: {complaints:?}");
    assert!(
        complaints
            .iter()
            .all(|complaint| complaint.contains("Content Security Policy")),
        "{complaints:?}"
    );
}

/// The same by the language: a title is what stands behind `title`.
#[test]
fn a_hostile_title_of_a_file() {
    for text in HOSTILE {
        let scenario = format!("title {text}\nring 3\n> 80*3\n< 80*3\n");
        let source = harness::scenario::source::Source::from_bytes(
            "own.scn".to_owned(),
            scenario.clone().into(),
        );
        let Ok(source) = source else { continue };
        let Ok(entry) = harness::library::Entry::new(source, None) else {
            continue;
        };
        let mut link = entry.settled.simulate();
        let outcome = entry.settled.play(&mut *link, AtMismatch::Stop);
        assert_eq!(outcome.verdict.name(), "passed");
        sound(&parse(&super::page(&[("own", scenario)])));
    }
}
