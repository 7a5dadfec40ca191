//! A scenario of any bus, read and settled; and texts of what came of it.

pub mod finding;
pub mod page;

use crate::buses::{Bus, named};
use crate::scenario::files;
use crate::scenario::parse;
use crate::scenario::problem::Problems;
use crate::scenario::settled::{BenchSize, Settled};
use crate::scenario::source::Source;
use crate::scenario::syntax::ScenarioHead;
use crate::shown::SegmentReport;
use harness_proto::line::Rate;
use std::sync::Arc;

/// A scenario, read and settled, and not yet played.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Where it comes from, for messages: a path or the name of a built-in scenario.
    pub name: String,
    /// Its text.
    pub source: Source,
    /// What it says in the words of every bus.
    pub scenario: ScenarioHead,
    /// The same, settled for a bench of one size.
    pub settled: Arc<dyn Settled>,
    /// How what it carries is shown.
    pub report: &'static dyn SegmentReport,
}

impl Entry {
    /// Reads and settles a scenario, for a ring of `size` where that is given.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn new(source: Source, size: Option<u8>) -> Result<Self, Box<Problems>> {
        Self::read(source, size.map_or(BenchSize::Own, BenchSize::Of))
    }

    fn read(source: Source, size: BenchSize) -> Result<Self, Box<Problems>> {
        Self::of(named(parse::bus(&source)), source, size)
    }

    /// The same with the words of this bus.
    pub(crate) fn of(
        bus: &'static Bus,
        source: Source,
        size: BenchSize,
    ) -> Result<Self, Box<Problems>> {
        let (scenario, settled) = (bus.settle)(&source, size)?;
        Ok(Self {
            name: source.name.clone(),
            source,
            scenario,
            settled,
            report: bus.report,
        })
    }

    /// Reads and settles a scenario, for a ring of this many drives where it is for several sizes and that is one of them.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn fitting(source: Source, drives: Option<u8>) -> Result<Self, Box<Problems>> {
        Self::read(source, drives.map_or(BenchSize::Own, BenchSize::Fitting))
    }

    /// The name without folders and ending.
    #[must_use]
    pub fn short_name(&self) -> &str {
        files::last(&self.name)
    }

    /// How many drives its bench has, as `3+1`.
    #[must_use]
    pub fn drives(&self) -> String {
        self.settled.size()
    }

    /// The rate of its line, where it is that of a ring.
    #[must_use]
    pub fn rate(&self) -> Rate {
        let rings = self.settled.rings();
        rings.map(|rings| rings.rate).unwrap_or_default()
    }

    /// Whether the text occurs in the name, the title or a source.
    #[must_use]
    pub fn matches(&self, text: &str) -> bool {
        let text = text.to_lowercase();
        let mut places = self
            .scenario
            .sources
            .iter()
            .map(|source| source.text.as_str());
        [self.name.as_str(), self.scenario.title.as_str()]
            .into_iter()
            .chain(places.by_ref())
            .any(|place| place.to_lowercase().contains(&text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus_name::BusName;
    use crate::scenario::files::sources;

    /// `run --ring N` reads every scenario for the size where it allows it: none may be wrong at an end of its range.
    #[test]
    fn built_in_scenarios_hold_at_both_ends_of_their_sizes() {
        let (mut ends, mut wrong) = (0, Vec::new());
        for source in sources(&[]).expect("the built-in ones") {
            let name = source.name.clone();
            if parse::bus(&source) != BusName::DEFAULT {
                continue;
            }
            let read = Entry::new(source, None).expect("a scenario");
            let (smallest, largest) = read.settled.rings().expect("rings").sizes[0];
            for size in [smallest, largest] {
                if let Err(problems) = Entry::new(read.source.clone(), Some(size)) {
                    wrong.push(format!("{name} on a ring of {size}: {problems}"));
                }
                ends += usize::from(smallest != largest);
            }
        }
        assert_eq!(wrong, [""; 0]);
        assert!(ends > 50, "{ends} ends of ranges");
    }
}
