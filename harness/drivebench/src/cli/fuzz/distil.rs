//! `drivebench fuzz distil`: what of a grown corpus is worth keeping.

use crate::command::exit::Exit;
use crate::command::output::Output;
use crate::counted::counted;
use crate::fuzz::coverage::{CoverageError, read_folder};
use crate::fuzz::distil::distil as distilled;
use crate::fuzz::input::input;
use crate::fuzz::noting;
use crate::regular;
use clap::Args;
use harness_sim::fuzz::{Feature, features};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// For `fuzz distil`.
#[derive(Clone, Debug, Args)]
pub struct DistilArguments {
    /// The fuzz target.
    #[arg(value_parser = noting().map(|target| target.name).collect::<Vec<_>>())]
    pub target: String,
    /// The folder that the fuzzer filled.
    #[arg(long, value_name = "FOLDER")]
    pub from: PathBuf,
    /// The folder with the kept inputs, to which new ones are added.
    #[arg(long, value_name = "FOLDER")]
    pub to: PathBuf,
}

/// Chooses and shrinks inputs and writes one file per input. Existing files stay unchanged.
pub(crate) fn distil(arguments: &DistilArguments, output: &mut Output) -> std::io::Result<Exit> {
    match chosen(arguments) {
        Ok(text) => {
            output.result(&text)?;
            Ok(Exit::Passed)
        }
        Err(error) => {
            output.complain(&error.to_string());
            Ok(match error {
                CoverageError::Rule { .. } => Exit::Failed,
                CoverageError::Empty => Exit::NothingSelected,
                CoverageError::Unwritable { error, .. } => Exit::of_file(&error),
                _ => Exit::Usage,
            })
        }
    }
}

fn chosen(arguments: &DistilArguments) -> Result<String, CoverageError> {
    let Some(target) = noting().find(|target| target.name == arguments.target) else {
        return Err(CoverageError::Empty);
    };
    let (body, pieces) = (target.body, target.pieces);
    let grown = inputs(&arguments.from)?;
    if grown.is_empty() {
        return Err(CoverageError::Empty);
    }
    let rule = |_| CoverageError::Rule {
        name: arguments.from.display().to_string(),
    };
    let kept = inputs(&arguments.to)?;
    let (before, new) = std::panic::catch_unwind(|| {
        let reached = kept.iter().flat_map(|input| features(body, input));
        let before: BTreeSet<Feature> = reached.collect();
        let new = distilled(body, pieces, &grown, &before);
        (before, new)
    })
    .map_err(rule)?;
    let mut names = Vec::new();
    for one in &new {
        let ending = one.ending(pieces);
        let mut name = format!("{}.{ending}", one.name());
        let mut number = 2;
        while arguments.to.join(&name).exists() {
            name = format!("{}-{number}.{ending}", one.name());
            number += 1;
        }
        write(&arguments.to.join(&name), &one.content(pieces))?;
        names.push(name);
    }
    let more: usize = new.iter().map(|one| one.new.len()).sum();
    Ok(format!(
        "{}{}: {} more, {} before\n",
        names
            .iter()
            .map(|name| format!("{name}\n"))
            .collect::<String>(),
        counted(names.len(), "input"),
        counted(more, "feature"),
        before.len(),
    ))
}

/// The inputs of a folder.
fn inputs(folder: &Path) -> Result<Vec<Vec<u8>>, CoverageError> {
    let mut inputs = Vec::new();
    for (name, content) in read_folder(folder)? {
        let read = input(&name, &content);
        inputs.push(read.map_err(|error| CoverageError::Input { name, error })?);
    }
    Ok(inputs)
}

/// Writes a file atomically, under another name first.
fn write(path: &Path, content: &[u8]) -> Result<(), CoverageError> {
    regular::write_text(path, content).map_err(|error| CoverageError::Unwritable {
        name: path.display().to_string(),
        error,
    })
}
