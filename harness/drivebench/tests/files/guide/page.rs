//! A page of the guide, taken apart: its fenced blocks, the commands in them and what is shown below each.

use std::path::{Path, PathBuf};

/// A fenced block.
pub(super) struct Block {
    /// The line of its first fence, from 1.
    pub(super) line: usize,
    /// The words behind the fence: `console`, `toml file=desk.toml`.
    pub(super) info: Vec<String>,
    /// What stands in it.
    pub(super) lines: Vec<String>,
}

/// What is done with the commands of a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// They are run, and what they print is compared.
    Run,
    /// They need a machine or a checkout: only their options are checked.
    Parse,
    /// They are run where this program is installed.
    Needs(String),
}

/// A command and what the page shows of it.
pub(super) struct Shown {
    /// Its line, from 1.
    pub(super) line: usize,
    /// As it is typed.
    pub(super) command: String,
    /// How many lines of the page show what it prints.
    pub(super) height: usize,
    /// The lines below it.
    pub(super) output: Vec<String>,
    /// The lines below `# stderr`, which only a transcript has.
    pub(super) errors: Vec<String>,
    /// How it ends.
    pub(super) code: i32,
}

/// A step of a page, in order.
pub(super) enum Step {
    /// A file that the page asks the reader to save.
    File {
        /// Its name, relative to the page's folder.
        name: String,
        /// What is in it.
        text: String,
    },
    /// A command.
    Command(Mode, Shown),
}

/// A page.
pub(super) struct Page {
    /// Its file.
    pub(super) path: PathBuf,
    /// What is in it.
    pub(super) text: String,
    /// The fenced blocks.
    pub(super) blocks: Vec<Block>,
    /// The lines outside of them, with their numbers.
    pub(super) prose: Vec<(usize, String)>,
}

/// The line of a transcript above what a command prints on standard error.
pub(super) const STDERR: &str = "# stderr";

/// Languages whose blocks are not commands.
const OTHER: [&str; 9] = [
    "text", "toml", "yaml", "json", "xml", "markdown", "python", "c", "rust",
];

impl Page {
    /// Reads a page; a mistake in its form is a panic that names the line.
    pub(super) fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).expect("a page is text");
        let (mut blocks, mut prose): (Vec<Block>, Vec<_>) = (Vec::new(), Vec::new());
        let mut open: Option<Block> = None;
        for (number, line) in (1..).zip(text.lines()) {
            let place = format!("{}:{number}", path.display());
            match (open.take(), line.strip_prefix("```")) {
                (None, Some(info)) => {
                    let info: Vec<_> = info.split_whitespace().map(str::to_owned).collect();
                    let language = info.first().map_or("", String::as_str);
                    assert!(
                        language == "console" || OTHER.contains(&language),
                        "{place}: a block is `console` (commands) or one of {OTHER:?}, not `{language}`"
                    );
                    open = Some(Block {
                        line: number,
                        info,
                        lines: Vec::new(),
                    });
                }
                (Some(block), Some(rest)) => {
                    assert_eq!(rest, "", "{place}: a block ends with three backticks");
                    blocks.push(block);
                }
                (Some(mut block), None) => {
                    block.lines.push(line.to_owned());
                    open = Some(block);
                }
                (None, None) => prose.push((number, line.to_owned())),
            }
        }
        assert!(
            open.is_none(),
            "{}: the last block has no end",
            path.display()
        );
        let path = path.to_owned();
        Self {
            path,
            text,
            blocks,
            prose,
        }
    }

    /// Everything that is to be done, in order.
    pub(super) fn steps(&self) -> Vec<Step> {
        self.blocks
            .iter()
            .flat_map(|block| self.block_steps(block))
            .collect()
    }

    fn block_steps(&self, block: &Block) -> Vec<Step> {
        if block.info[0] == "console" {
            let mode = mode(&block.info[1..]).unwrap_or_else(|word| {
                panic!(
                    "{}:{}: nobody knows `{word}`",
                    self.path.display(),
                    block.line
                )
            });
            let commands = self.commands(block).into_iter();
            return commands
                .map(|shown| Step::Command(mode.clone(), shown))
                .collect();
        }
        let name = block.info[1..]
            .iter()
            .find_map(|word| word.strip_prefix("file="));
        let name = name.map(|name| Step::File {
            name: name.to_owned(),
            text: block.lines.join("\n") + "\n",
        });
        name.into_iter().collect()
    }

    /// The commands of a block, whatever its mode.
    pub(super) fn commands(&self, block: &Block) -> Vec<Shown> {
        let mut commands: Vec<Shown> = Vec::new();
        let (mut continued, mut errors) = (false, false);
        for (number, line) in (block.line + 1..).zip(&block.lines) {
            if continued {
                let last = commands.last_mut().expect("a command");
                last.command.push('\n');
                last.command.push_str(line);
                continued = line.ends_with('\\');
            } else if let Some(command) = line.strip_prefix("$ ") {
                continued = command.ends_with('\\');
                errors = false;
                commands.push(Shown {
                    line: number,
                    command: command.to_owned(),
                    height: 0,
                    output: Vec::new(),
                    errors: Vec::new(),
                    code: 0,
                });
            } else {
                let place = format!("{}:{number}", self.path.display());
                let last = commands.last_mut();
                let last = last.unwrap_or_else(|| panic!("{place}: a block begins with `$ `"));
                last.height += 1;
                match line.strip_prefix("# exit code ") {
                    Some(code) => last.code = code.parse().expect("an exit code"),
                    None if line == STDERR => errors = true,
                    None if errors => last.errors.push(line.to_owned()),
                    None => last.output.push(line.to_owned()),
                }
            }
        }
        // A blank line in front of the next command is for the eye.
        for command in &mut commands {
            trim_end(&mut command.output);
            trim_end(&mut command.errors);
        }
        commands
    }
}

/// Removes the blank lines at the end.
pub(super) fn trim_end(lines: &mut Vec<String>) {
    while lines.last().is_some_and(|line| line.trim().is_empty()) {
        lines.pop();
    }
}

fn mode(words: &[String]) -> Result<Mode, &str> {
    match words {
        [] => Ok(Mode::Run),
        [word] if word == "hardware" || word == "checkout" => Ok(Mode::Parse),
        [word] => word
            .strip_prefix("needs=")
            .map(|tool| Mode::Needs(tool.to_owned()))
            .ok_or(word.as_str()),
        [_, word, ..] => Err(word.as_str()),
    }
}
