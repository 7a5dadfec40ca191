//! The user guide (`harness/docs`) says what is so: its commands are run and what they print is compared, its options, links,
//! and citations are checked.

mod compare;
mod page;
mod shell;
pub(crate) mod transcript;
mod words;

use harness::buses::BUSES;
use page::{Page, Step};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::panic::{self, UnwindSafe};
use std::path::Path;
use std::sync::Once;

/// Sections of the ND21 manual that the guide and transcripts cite and that have neither a table nor an erratum.
const WITHOUT_TABLES: [&str; 16] = [
    "2", "2.3", "2.5", "5.4", "5.4.1", "5.4.2", "6.3", "6.4", "6.4.1", "6.4.2", "6.4.3", "8.3",
    "8.4", "11.5", "14.5.3.2", "14.6.4",
];

/// Every command does what its page shows.
pub(crate) fn commands(path: &Path) -> datatest_stable::Result<()> {
    let page = Page::read(path);
    let steps = page.steps();
    let runs = |step: &Step| matches!(step, Step::Command(page::Mode::Run, _));
    assert!(
        steps.iter().any(runs),
        "{}: a page without a command that is run",
        path.display()
    );
    for step in &steps {
        if let Step::File { name, .. } = step {
            let told = page
                .prose
                .iter()
                .any(|(_, line)| line.contains(&format!("`{name}`")));
            assert!(told, "{}: the page does not say `{name}`", path.display());
        }
    }
    let name = path.display().to_string();
    let differences = shell::differences(&steps, &name);
    assert!(differences.is_empty(), "\n{differences}");
    Ok(())
}

/// Every `drivebench` command that the guide names is one that the program takes, also where it is not run.
pub(crate) fn options(path: &Path) -> datatest_stable::Result<()> {
    let page = Page::read(path);
    let check = |line: usize, text: &str, strict: bool| {
        for words in words::commands(text) {
            let refused = words::refused(&words, strict);
            assert_eq!(refused, None, "{}:{line}: {words:?}", path.display());
        }
    };
    for block in page.blocks.iter().filter(|b| b.info[0] == "console") {
        for shown in page.commands(block) {
            // A command that is shown to be wrong may be wrong.
            if shown.code != 2 {
                check(shown.line, &shown.command, true);
            }
        }
    }
    for block in page.blocks.iter().filter(|b| b.info[0] == "text") {
        for (number, line) in (block.line + 1..).zip(&block.lines) {
            if line.starts_with("drivebench ") {
                let (command, _comment) = line.split_once(" # ").unwrap_or((line, ""));
                check(number, command, true);
            }
        }
    }
    // A pipeline's lines of shell; `harness-judges` checks its form.
    for block in page.blocks.iter().filter(|b| b.info[0] == "yaml") {
        for (number, line) in (block.line + 1..).zip(&block.lines) {
            let command = line.trim_start().trim_start_matches("- ");
            check(number, command.trim_start_matches("run: "), true);
        }
    }
    for (line, text) in &page.prose {
        for span in text.split('`').skip(1).step_by(2) {
            check(*line, span, false);
        }
    }
    Ok(())
}

/// Every link leads to a file of the repository, and to a heading that is there.
pub(crate) fn links(path: &Path) -> datatest_stable::Result<()> {
    let folder = path.parent().expect("a folder");
    for (line, text) in &Page::read(path).prose {
        for target in text.split("](").skip(1) {
            let target = target.split(')').next().unwrap_or_default();
            if target.starts_with("https://") {
                continue;
            }
            let place = format!("{}:{line}: {target}", path.display());
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if file.is_empty() {
                path.to_owned()
            } else {
                folder.join(file)
            };
            assert!(file.exists(), "{place}: no such file");
            if !heading.is_empty() {
                assert!(has_heading(&file, heading), "{place}: no such heading");
            }
        }
    }
    Ok(())
}

/// Whether a page has this heading; pages outside of the guide have blocks of every kind.
fn has_heading(file: &Path, heading: &str) -> bool {
    let text = std::fs::read_to_string(file).expect("a page is text");
    let mut in_block = false;
    text.lines().any(|line| {
        in_block ^= line.starts_with("```");
        !in_block && anchor(line).is_some_and(|anchor| anchor == heading)
    })
}

/// The name of a heading, as GitHub makes it.
fn anchor(line: &str) -> Option<String> {
    let title = line.strip_prefix('#')?.trim_start_matches('#').trim();
    let title = title.to_lowercase();
    let kept = title
        .chars()
        .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
        .map(|c| if c == ' ' { '-' } else { c });
    Some(kept.collect())
}

/// Every section of the manual that a page cites is one that the manual has.
pub(crate) fn citations(path: &Path) -> datatest_stable::Result<()> {
    let mut sections: BTreeSet<String> = WITHOUT_TABLES.iter().map(|s| (*s).to_owned()).collect();
    sections.extend(
        BUSES[0]
            .manual
            .tables()?
            .into_iter()
            .map(|table| table.section),
    );
    sections.extend(
        BUSES[0]
            .manual
            .errata()?
            .into_iter()
            .map(|erratum| erratum.section),
    );
    // A chapter is there where one of its sections is.
    let chapters: Vec<_> = sections
        .iter()
        .flat_map(|s| s.match_indices('.').map(|(end, _)| s[..end].to_owned()))
        .collect();
    sections.extend(chapters);
    for (line, text) in &Page::read(path).prose {
        for cited in text.split("ND21 ").skip(1) {
            let end = cited.find(|c: char| !c.is_ascii_digit() && c != '.');
            let section = cited[..end.unwrap_or(cited.len())].trim_end_matches('.');
            // `ND21 User Manual` and the like are no citations.
            let known = section.is_empty() || sections.contains(section);
            assert!(known, "{}:{line}: ND21 {section}", path.display());
        }
    }
    Ok(())
}

/// A page with a mistake is refused, by the check that its file is named after and by no other.
pub(crate) fn refused(path: &Path) -> datatest_stable::Result<()> {
    type Check = fn(&Path) -> datatest_stable::Result<()>;
    let checks: [(&str, Check); 4] = [
        ("commands", commands),
        ("options", options),
        ("links", links),
        ("citations", citations),
    ];
    let name = path
        .file_name()
        .and_then(|name| name.to_str())
        .expect("text");
    for (check, judge) in checks {
        let fails = quietly(|| judge(path).is_err()).unwrap_or(true);
        assert_eq!(fails, name.starts_with(check), "{name}: {check}");
    }
    Ok(())
}

thread_local! {
    /// A panic of this thread is what a test looks for.
    static EXPECTED: Cell<bool> = const { Cell::new(false) };
}

/// Runs something that may panic and suppresses the message of that panic, which would hide an unexpected one.
fn quietly<T>(judge: impl FnOnce() -> T + UnwindSafe) -> std::thread::Result<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let told = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !EXPECTED.get() {
                told(info);
            }
        }));
    });
    EXPECTED.set(true);
    let judged = panic::catch_unwind(judge);
    EXPECTED.set(false);
    judged
}
