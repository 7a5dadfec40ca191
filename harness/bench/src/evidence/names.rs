//! Names of scenarios in a folder: each leads to one file.

use std::collections::{BTreeSet, VecDeque};

/// The names that a folder has given.
#[derive(Debug, Default)]
pub struct Names {
    /// The names of a part of a run: those in the folder of the whole run.
    planned: VecDeque<String>,
    given: BTreeSet<String>,
}

impl Names {
    /// Of a part of a run: these names come first, in this order, and no other scenario has a name of `given`.
    pub fn planned(planned: VecDeque<String>, given: BTreeSet<String>) -> Self {
        Self { planned, given }
    }

    /// The name of the next scenario, whose file has this name.
    pub fn next(&mut self, name: &str) -> String {
        match self.planned.pop_front() {
            Some(planned) => planned,
            None => self.unique(name),
        }
    }

    fn unique(&mut self, name: &str) -> String {
        let safe = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
        let bare = name.strip_suffix(".scn").unwrap_or(name);
        let stem: String = bare
            .chars()
            .map(|c| if safe(c) { c } else { '_' })
            .take(120)
            .collect();
        let stem = match stem.trim_matches(['_', '.']) {
            "" => "scenario".to_owned(),
            stem => stem.to_owned(),
        };
        let mut unique = stem.clone();
        let mut number = 1;
        while !self.given.insert(unique.clone()) {
            number += 1;
            unique = format!("{stem}_{number}");
        }
        unique
    }
}
