//! Campaigns on rings, as the commands on campaigns of every bus see them.

use super::class::{CaseClass, OUTCOMES};
use super::fault::CaseFaults;
use super::file::ExpectedCounts;
use super::html::section;
use super::replay::scenario;
use super::report::{json, line, table};
use super::run::{Campaign, PlayedCampaign};
use harness_bench::campaign::pairs::FaultPairs;
use harness_bench::campaign::{self, CaseFailure, OutcomeClass};
use harness_bench::report::html::Section;

impl campaign::Campaign for Campaign {
    fn name(&self) -> &str {
        &self.name
    }

    fn texts(&self) -> Vec<&str> {
        self.texts().to_vec()
    }

    fn names(&self) -> Vec<String> {
        let drives = self.shape.drives;
        self.cases.iter().map(|case| case.name(drives)).collect()
    }

    fn pinned(&self) -> Vec<(&'static str, u64)> {
        self.file.expect.pinned()
    }

    fn keep(&mut self, at: &dyn Fn(usize) -> bool) {
        let mut places = 0..;
        self.cases.retain(|_| places.next().is_some_and(at));
        self.file.expect = ExpectedCounts::default();
    }

    fn cases(&self) -> usize {
        self.cases.len()
    }

    fn scenario(&self, case: &str) -> Result<String, CaseFailure> {
        let case = CaseFaults::from_name(case, self.shape.drives).map_err(CaseFailure::Unknown)?;
        scenario(self, &case).map_err(|defect| CaseFailure::Defect(defect.to_string()))
    }

    fn run(
        &self,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Box<dyn campaign::PlayedCampaign>, String> {
        match self.run(threads, progress) {
            Ok(played) => Ok(Box::new(played)),
            Err(contradiction) => Err(contradiction.to_string()),
        }
    }

    fn pairs(&self) -> Option<&dyn FaultPairs> {
        Some(self)
    }
}

fn class(place: usize) -> CaseClass {
    CaseClass::ALL[place]
}

impl campaign::PlayedCampaign for PlayedCampaign {
    fn name(&self) -> &str {
        self.name.trim_end_matches(".toml")
    }

    fn classes(&self) -> &'static [OutcomeClass] {
        &OUTCOMES
    }

    fn count(&self, place: usize) -> u64 {
        self.count(class(place))
    }

    fn cases(&self) -> u64 {
        self.outcomes.len() as u64
    }

    fn pinned(&self) -> &[(&'static str, u64)] {
        &self.expect
    }

    fn size(&self) -> [(String, u64); 2] {
        [
            ("Drives".to_owned(), self.drives.into()),
            ("Bytes".to_owned(), self.bytes),
        ]
    }

    fn table(&self) -> String {
        table(self)
    }

    fn lines(&self, place: usize) -> String {
        let all = self
            .outcomes
            .iter()
            .filter(|case| case.class == class(place));
        all.map(|outcome| line(outcome, self.drives)).collect()
    }

    fn json(&self, place: Option<usize>) -> serde_json::Value {
        json(self, place.map(class))
    }

    fn section(&self, number: usize) -> Section {
        section(number, self)
    }
}
