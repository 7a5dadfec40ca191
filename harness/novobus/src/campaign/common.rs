//! Campaigns on rings, as the commands on campaigns of every bus see them.

use super::fault::CaseFaults;
use super::file::ExpectedCounts;
use super::replay::scenario;
use super::run::Campaign;
use harness_bench::campaign::pairs::FaultPairs;
use harness_bench::campaign::{self, CaseFailure, PlayedCampaign};

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
    ) -> Result<Box<dyn PlayedCampaign>, String> {
        match self.run(threads, progress) {
            Ok(played) => Ok(Box::new(played)),
            Err(contradiction) => Err(contradiction.to_string()),
        }
    }

    fn pairs(&self) -> Option<&dyn FaultPairs> {
        Some(self)
    }
}
