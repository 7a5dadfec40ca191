//! Output of a run while it goes on.

use crate::command::output::Output;
use crate::counted::counted;
use crate::explore::{
    Differing, Finding, FuzzCase, FuzzRun, Pool, Progress, RunEnd, Swarm, Watcher,
};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The shortest time between two reports of progress.
const PAUSE: Duration = Duration::from_secs(1);

/// Writes findings to standard output and everything else to standard error.
pub(crate) struct FindingWriter<'o> {
    pub output: &'o mut Output,
    /// The folder with the files of findings.
    pub folder: Option<PathBuf>,
    /// Whether rounds are reported.
    pub rounds: bool,
    /// When progress was last reported.
    pub told: Option<Instant>,
    /// Why standard output could not be written.
    pub failed: Option<std::io::Error>,
}

impl<C: FuzzCase> Watcher<C> for FindingWriter<'_> {
    fn round(&mut self, round: u64, swarm: &Swarm<C::Spice>) {
        if self.rounds && self.output.progress {
            let names = swarm.names().join(" ");
            self.output.say(&format!("round {round}: {names}\n"));
        }
    }

    fn found(&mut self, finding: &Finding<C>, file: &str) {
        if finding.seen_again == 0 {
            self.output.say(&format!(
                "case {} differed once and not again in {} tries; the computer or the line may have been disturbed, so this is not a finding: {}\n",
                finding.number, finding.of, finding.difference.about()
            ));
            return;
        }
        let word = if finding.confirmed { "found" } else { "flaky" };
        let mut text = format!(
            "{word}: case {}, seen again {} of {}: {}\n",
            finding.number,
            finding.seen_again,
            counted(finding.of, "time"),
            finding.difference.signature()
        );
        text.push_str(&format!("  {}\n", finding.difference.about()));
        if let Some(folder) = &self.folder {
            let path = folder.join(file).with_extension("json");
            text.push_str(&format!("  drivebench shrink {}\n", path.display()));
        }
        if let Err(error) = self.output.result(&text) {
            self.failed.get_or_insert(error);
        }
    }

    fn progress(&mut self, progress: &Progress, pool: &Pool<C>) {
        if self.output.progress && self.told.is_none_or(|told| told.elapsed() >= PAUSE) {
            self.told = Some(Instant::now());
            self.output.say(&format!(
                "{}, {} kept with {}\n",
                counted(progress.cases, "case"),
                pool.cases().len(),
                counted(pool.shown(), "feature")
            ));
        }
    }
}

/// The last line of a run.
pub fn summary<C: FuzzCase>(campaign: &FuzzRun<C>, end: &RunEnd) -> String {
    let progress = campaign.progress();
    let (confirmed, flaky) = campaign.findings();
    let why = match end {
        RunEnd::Cases => "all cases were tried".to_owned(),
        RunEnd::Wire => "the next case would exceed the time on the line".to_owned(),
        RunEnd::Findings => "the limit of findings was reached".to_owned(),
        RunEnd::Over(why) => why.clone(),
    };
    format!(
        "{} ({} not allowed or not possible here, {} of findings), {:.3} s on the line, {} kept with {}; \
         {confirmed} found, {flaky} flaky: {why}\n",
        counted(progress.cases, "case"),
        progress.not_sent,
        counted(progress.repeats, "repeat"),
        progress.wire_ns as f64 / 1e9,
        campaign.pool().cases().len(),
        counted(campaign.pool().shown(), "feature"),
    )
}
