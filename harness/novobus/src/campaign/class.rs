//! What can come of a fault.

use crate::campaign::fault::link_index;
use harness_bench::campaign::OutcomeClass;
use harness_proto::novobus::master::{Fault, LinkEnd};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The result of a case, in order of severity. Every case is exactly one of these.
///
/// *Noticed* means that the master saw something that was not the conversation without a fault: a byte, a line
/// error, a byte too many, a byte that did not come. *Named* is the link that it then blamed: by the number that the ring
/// spells out (ND21 9.7), or by its own receiver. *Back* means that all drives are out of the error mode (9.8) and that
/// every job has been confirmed by a right answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum CaseClass {
    /// Not noticed and without effect: every drive has the right cells and waits for a sync byte.
    Harmless,
    /// Noticed, the damaged link named, everything back, every cell right.
    Located,
    /// Noticed and no link named; everything back, every cell right.
    Recovered,
    /// Noticed and a sound link named; everything back, every cell right.
    Mislocated,
    /// Noticed, and not everything is back: a drive stays in the error mode, or a job is not confirmed. The master reports this, and no cell
    /// holds a value that it never has without the fault.
    NotRecovered,
    /// Noticed, but a cell holds a value that it never has without the fault, and the master cannot know which cell: a wrong drive or a wrong
    /// cell was written before another fault was noticed.
    Corrupted,
    /// Not noticed, and a cell holds a wrong value or a job returned one.
    SilentCorruption,
}

impl CaseClass {
    /// All of them, in order of gravity.
    pub(crate) const ALL: [Self; 7] = [
        Self::Harmless,
        Self::Located,
        Self::Recovered,
        Self::Mislocated,
        Self::NotRecovered,
        Self::Corrupted,
        Self::SilentCorruption,
    ];

    /// The name in files and tables.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        self.outcome().name
    }

    /// What it means, in a line.
    #[must_use]
    pub(crate) const fn about(self) -> &'static str {
        self.outcome().about
    }

    /// What tables and pages say of it.
    #[must_use]
    pub(crate) const fn outcome(self) -> &'static OutcomeClass {
        &OUTCOMES[self as usize]
    }
}

const fn outcome(
    gravity: u8,
    letter: char,
    name: &'static str,
    about: &'static str,
) -> OutcomeClass {
    OutcomeClass {
        name,
        about,
        letter,
        gravity,
    }
}

/// What tables and pages say of each class, in order.
pub(crate) static OUTCOMES: [OutcomeClass; CaseClass::ALL.len()] = [
    outcome(0, '.', "harmless", "not noticed, and nothing differs"),
    outcome(1, 'L', "located", "the damaged link named, all back"),
    outcome(2, 'R', "recovered", "no link named, all back"),
    outcome(3, 'M', "mislocated", "a sound link named, all back"),
    outcome(4, 'N', "not-recovered", "noticed, not all back"),
    outcome(
        5,
        'C',
        "corrupted",
        "noticed and repaired, but a cell is wrong",
    ),
    outcome(
        6,
        'S',
        "silent-corruption",
        "not noticed, and a value is wrong",
    ),
];

impl fmt::Display for CaseClass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A value that is wrong when everything is over.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum WrongValue {
    /// A cell of a drive.
    Cell {
        drive: u8,
        address: u16,
        /// What it holds.
        value: u8,
        /// What it holds without the fault.
        expected: u8,
    },
    /// What a job brought.
    Answer {
        drive: u8,
        /// What it brought.
        value: u32,
        /// What it brings without the fault.
        expected: u32,
    },
}

/// What was seen of a case.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct CaseEvidence {
    /// Whether the master noticed anything.
    pub noticed: bool,
    /// The link that it named, counted from the master's outgoing one.
    pub named: Option<usize>,
    /// What it made of it, where it says more than a link.
    pub diagnosis: Option<Fault>,
    /// Check sequences that were sent.
    pub sequences: u32,
    /// Whether every job was confirmed.
    pub confirmed: bool,
    /// Whether no drive is in the error mode.
    pub all_back: bool,
    /// What is wrong at the end, in order.
    pub wrong: Vec<WrongValue>,
}

impl CaseEvidence {
    /// The class of a case whose faults were on these links.
    ///
    /// # Errors
    /// A contradiction in the bench's own evidence, as a sentence: it fits no class.
    pub(crate) fn class(&self, links: &[usize]) -> Result<CaseClass, &'static str> {
        let noticed = self.noticed;
        if !noticed && (self.named.is_some() || self.sequences > 0) {
            return Err("a link was named or a check sequence sent, and nothing had been noticed");
        }
        if self.confirmed && !self.all_back {
            return Err("every job was confirmed, and a drive is in the error mode");
        }
        if !noticed && !self.confirmed {
            return Err("nothing was noticed, and a job was not confirmed");
        }
        Ok(match self.named {
            _ if !self.wrong.is_empty() && noticed => CaseClass::Corrupted,
            _ if !self.wrong.is_empty() => CaseClass::SilentCorruption,
            _ if !self.confirmed => CaseClass::NotRecovered,
            _ if !noticed => CaseClass::Harmless,
            None => CaseClass::Recovered,
            Some(link) if links.contains(&link) => CaseClass::Located,
            Some(_) => CaseClass::Mislocated,
        })
    }
}

/// The link that a master's diagnosis names, if it names one.
#[must_use]
pub(crate) fn named(fault: Fault, drives: u8) -> Option<usize> {
    let (Fault::Damaged(link) | Fault::Broken(link)) = fault else {
        return None;
    };
    match link.to {
        LinkEnd::Drive(drive) => link_index(drives, drive),
        LinkEnd::Master => Some(usize::from(drives)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every combination of what can be seen is one class or a contradiction, and nothing else decides.
    #[test]
    fn classes_exclude_each_other() {
        let wrong = WrongValue::Answer {
            drive: 0,
            value: 1,
            expected: 2,
        };
        let mut seen = std::collections::BTreeMap::new();
        for bits in 0..32u8 {
            let bit = |n: u8| bits >> n & 1 == 1;
            for named in [None, Some(1), Some(2)] {
                let evidence = CaseEvidence {
                    noticed: bit(0),
                    named,
                    diagnosis: None,
                    sequences: u32::from(bit(1)),
                    confirmed: bit(2),
                    all_back: bit(3),
                    wrong: if bit(4) { vec![wrong.clone()] } else { vec![] },
                };
                if let Ok(class) = evidence.class(&[1]) {
                    *seen.entry(class).or_insert(0) += 1;
                }
            }
        }
        let seen: Vec<_> = seen.into_iter().collect();
        assert_eq!(
            seen,
            [
                (CaseClass::Harmless, 1),
                (CaseClass::Located, 2),
                (CaseClass::Recovered, 2),
                (CaseClass::Mislocated, 2),
                (CaseClass::NotRecovered, 12),
                (CaseClass::Corrupted, 18),
                (CaseClass::SilentCorruption, 1),
            ]
        );
    }
}
