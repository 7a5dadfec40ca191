//! Console transcripts (`snapshots/console`): pages whose commands print what is shown and nothing else, each stream by itself.

use super::compare::{fits, line_fits};
use super::page::{Page, STDERR, Shown, Step, trim_end};
use super::shell::{self, Printed, Streams};
use std::fmt::Write as _;
use std::path::Path;

/// Every command of a transcript prints what is shown; `UPDATE_SNAPSHOTS=1` writes what it prints.
pub(crate) fn matches(path: &Path) -> datatest_stable::Result<()> {
    judge(path, std::env::var_os("UPDATE_SNAPSHOTS").is_some())
}

/// A transcript with a mistake is refused.
pub(crate) fn refused(path: &Path) -> datatest_stable::Result<()> {
    let accepted = super::quietly(|| judge(path, false).is_ok()).unwrap_or(false);
    assert!(!accepted, "{}: accepted", path.display());
    Ok(())
}

fn judge(path: &Path, update: bool) -> datatest_stable::Result<()> {
    let page = Page::read(path);
    let titled = page.prose.first();
    let titled = titled.is_some_and(|(line, text)| *line == 1 && text.starts_with("# "));
    assert!(titled, "{}: no title in line 1", path.display());
    let steps = page.steps();
    let runs = steps.iter().any(|step| matches!(step, Step::Command(..)));
    assert!(runs, "{}: no command", path.display());
    let name = path.display().to_string();
    let (commands, mut complaint) = shell::play(&steps, &name, Streams::Apart);
    let mut text: Vec<_> = page.text.lines().map(str::to_owned).collect();
    for (shown, printed) in commands.into_iter().rev() {
        if let Some(change) = Change::between(shown, printed) {
            complaint.insert_str(0, &change.to_text(&name, shown));
            change.write(shown, &mut text);
        }
    }
    if update {
        std::fs::write(path, text.join("\n") + "\n")?;
        return Ok(());
    }
    let again = "`UPDATE_SNAPSHOTS=1 cargo test --test files transcript` writes what is printed";
    assert!(complaint.is_empty(), "\n{complaint}{again}");
    Ok(())
}

/// What a command printed in place of what is shown.
struct Change {
    shown: Vec<String>,
    printed: Vec<String>,
    /// How many lines fit at the beginning and at the end.
    same: [usize; 2],
}

impl Change {
    /// `None` where all is as shown.
    fn between(shown: &Shown, mut printed: Printed) -> Option<Self> {
        trim_end(&mut printed.output);
        trim_end(&mut printed.errors);
        let code = shown.code.to_string();
        let fit = fits(&shown.output, &printed.output) && fits(&shown.errors, &printed.errors);
        if fit && printed.code == code {
            return None;
        }
        let shown = lines(&shown.output, &shown.errors, &code);
        let printed = lines(&printed.output, &printed.errors, &printed.code);
        let pairs = shown.iter().zip(&printed);
        let front = pairs.take_while(|(a, b)| same(a, b)).count();
        let pairs = shown[front..]
            .iter()
            .rev()
            .zip(printed[front..].iter().rev());
        let back = pairs.take_while(|(a, b)| same(a, b)).count();
        Some(Self {
            shown,
            printed,
            same: [front, back],
        })
    }

    /// The lines that differ, with one before and one after them.
    fn to_text(&self, page: &str, shown: &Shown) -> String {
        let [front, back] = self.same;
        let mut text = format!("{page}:{}: $ {}\n", shown.line, shown.command);
        let differing = |lines: &[String]| lines[front..lines.len() - back].to_vec();
        let after = self.shown.get(self.shown.len() - back);
        let after = after.into_iter().cloned().collect();
        let rows = [
            ("  ", self.shown[front.saturating_sub(1)..front].to_vec()),
            ("- ", differing(&self.shown)),
            ("+ ", differing(&self.printed)),
            ("  ", after),
        ];
        for (mark, lines) in rows {
            for line in lines {
                let _written = writeln!(text, "{mark}{line}");
            }
        }
        text + "\n"
    }

    /// Puts what was printed into the lines of the page; lines that fit keep their `...`.
    fn write(&self, shown: &Shown, page: &mut Vec<String>) {
        let [front, back] = self.same;
        let first = shown.line - 1 + shown.command.lines().count();
        let end = first + shown.height;
        let blank = (!page[end].starts_with("```")).then(String::new);
        let new = (self.shown[..front].iter())
            .chain(&self.printed[front..self.printed.len() - back])
            .chain(&self.shown[self.shown.len() - back..]);
        let new: Vec<_> = new
            .map(|line| line.trim_end().to_owned())
            .chain(blank)
            .collect();
        page.splice(first..end, new);
    }
}

/// A line is the same, and stands for no other lines.
fn same(shown: &str, printed: &str) -> bool {
    shown != "..." && line_fits(shown, printed)
}

/// What stands below a command.
fn lines(output: &[String], errors: &[String], code: &str) -> Vec<String> {
    let mut lines = output.to_vec();
    if !errors.is_empty() {
        lines.push(STDERR.to_owned());
        lines.extend_from_slice(errors);
    }
    if code != "0" {
        lines.push(format!("# exit code {code}"));
    }
    lines
}
