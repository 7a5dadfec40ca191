//! A scenario of any bus, read and settled.

use crate::bus_name::BusName;
use crate::buses::named;
use crate::buses::novobus::language::plan::Plan;
use crate::buses::novobus::language::read::RingScenario;
use crate::scenario::files;
use crate::scenario::parse;
use crate::scenario::problem::Problems;
use crate::scenario::settled::Settled;
use crate::scenario::source::Source;
use crate::scenario::syntax::ScenarioHead;
use crate::traffic::SegmentReport;
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
    /// The same settled for a bench of a given size; `None` for another bus.
    pub plan: Option<Plan>,
    /// The same of another bus; `None` for [`BusName::DEFAULT`], and for a bus that is not built.
    pub other: Option<Arc<dyn Settled>>,
}

impl Entry {
    /// Reads and settles a scenario, for a ring of `size` where that is given.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn new(source: Source, size: Option<u8>) -> Result<Self, Box<Problems>> {
        let bus = parse::bus(&source);
        if bus != BusName::DEFAULT {
            let found = (named(bus).settle)(&source, size)?;
            return Ok(Self::of_other(source, found));
        }
        Ok(RingScenario::new(source, size)?.into())
    }

    /// A scenario of another bus than [`BusName::DEFAULT`], read and settled.
    pub(crate) fn of_other(source: Source, found: (ScenarioHead, Arc<dyn Settled>)) -> Self {
        let (scenario, other) = found;
        Self {
            name: source.name.clone(),
            source,
            scenario,
            plan: None,
            other: Some(other),
        }
    }

    /// Reads and settles a scenario, for a ring of this many drives where it is for several sizes and that is one of them.
    ///
    /// # Errors
    /// Its mistakes.
    pub fn fitting(source: Source, drives: Option<u8>) -> Result<Self, Box<Problems>> {
        if parse::bus(&source) != BusName::DEFAULT {
            return Self::new(source, None);
        }
        Ok(RingScenario::fitting(source, drives)?.into())
    }

    /// The name without folders and ending.
    #[must_use]
    pub fn short_name(&self) -> &str {
        files::last(&self.name)
    }

    /// The scenario settled, of whichever bus; `None` for a bus that is not built.
    #[must_use]
    pub fn settled(&self) -> Option<&dyn Settled> {
        let own = self.plan.as_ref().map(|plan| plan as &dyn Settled);
        own.or(self.other.as_deref())
    }

    /// How what it carries is shown; `None` for a ring.
    #[must_use]
    pub fn report(&self) -> Option<&'static dyn SegmentReport> {
        self.settled()?.report()
    }

    /// How many drives its bench has, as `3+1`; empty for a bus that is not built yet.
    #[must_use]
    pub fn drives(&self) -> String {
        self.settled().map_or(String::new(), Settled::size)
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

impl From<RingScenario> for Entry {
    fn from(own: RingScenario) -> Self {
        Self {
            name: own.source.name.clone(),
            source: own.source,
            scenario: own.scenario.head(),
            plan: Some(own.plan),
            other: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
            let read = RingScenario::new(source, None).expect("a scenario");
            let own = &read.scenario.header.rings[0];
            for size in [own.smallest, own.largest] {
                if let Err(problems) = Entry::new(read.source.clone(), Some(size)) {
                    wrong.push(format!("{name} on a ring of {size}: {problems}"));
                }
                ends += usize::from(own.smallest != own.largest);
            }
        }
        assert_eq!(wrong, [""; 0]);
        assert!(ends > 50, "{ends} ends of ranges");
    }
}
