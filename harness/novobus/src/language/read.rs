//! A scenario of rings, read and settled.

use super::Novobus;
use super::plan::Plan;
use super::syntax::Scenario;
use harness_bench::scenario::files;
use harness_bench::scenario::language::Language as _;
use harness_bench::scenario::parse::parse;
use harness_bench::scenario::plan::plan;
use harness_bench::scenario::problem::Problems;
use harness_bench::scenario::source::Source;

/// A scenario of rings, read and settled, and not yet played.
#[derive(Clone, Debug)]
pub(crate) struct RingScenario {
    /// Its name and text.
    pub source: Source,
    /// What it says.
    pub scenario: Scenario,
    /// The same settled for rings of a given size.
    pub plan: Plan,
}

impl RingScenario {
    /// Reads and settles a scenario, for a ring of `size` where that is given.
    ///
    /// # Errors
    /// Its mistakes.
    pub(crate) fn new(source: Source, size: Option<u8>) -> Result<Self, Box<Problems>> {
        let scenario = parse(&source)?;
        Self::settled(scenario, source, size)
    }

    /// Reads and settles a scenario, for a ring of this many drives where it is for several sizes and that is one of them.
    ///
    /// # Errors
    /// Its mistakes.
    pub(crate) fn fitting(source: Source, drives: Option<u8>) -> Result<Self, Box<Problems>> {
        let scenario: Scenario = parse(&source)?;
        let size = drives.filter(|size| Novobus::fits(&scenario.header, *size));
        Self::settled(scenario, source, size)
    }

    fn settled(
        scenario: Scenario,
        source: Source,
        size: Option<u8>,
    ) -> Result<Self, Box<Problems>> {
        let plan = plan(&scenario, &source, size)?;
        Ok(Self {
            source,
            scenario,
            plan,
        })
    }

    /// The name without folders and ending.
    #[must_use]
    pub(crate) fn short_name(&self) -> &str {
        files::last(&self.source.name)
    }
}
